//! Numerical methods that know no movement.

pub(crate) mod simd;
pub(crate) mod smoothing_spline;
pub(crate) mod spline;
pub(crate) mod threads;
