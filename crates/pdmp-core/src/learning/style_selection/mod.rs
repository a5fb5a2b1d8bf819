//! Selection of the number of styles J.

pub(crate) mod cross_validation;
pub(crate) mod singular_values;
