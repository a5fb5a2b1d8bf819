//! Learning of a model from demonstrations.
//!
//! [`fit`] composes the four steps of Section 3.2: alignment, targets, factorisation, regression.

pub(crate) mod alignment;
mod assembly;
mod braking_rate;
mod constants;
mod context_folds;
mod cycle_phase;
pub(crate) mod factorization;
mod fit;
mod mean_path;
mod movement_metric;
mod noise_findings;
pub(crate) mod options;
mod prior;
pub mod regression;
mod rotation_timing;
mod rotations;
mod stiffness;
mod streaming;
mod style_inference;
pub(crate) mod style_selection;
mod tabulation;
mod targets;
mod transport_profile;
mod warp_selection;

pub use alignment::TimeScaling;
pub use factorization::{Factors, Truncation};
pub use fit::{fit, fit_with};
pub use options::{CanonicalOptions, DofScaling, FitOptions, NStyles, Stage, TransportSelection};
pub use prior::learn_prior;
pub use streaming::{BlockStyles, Blocks, FactorisedFit, PartialFit, StyleProjection, fit_blocks};
pub use style_inference::{StyleOptions, style_of};
