//! Inference of a movement from a part of it: points that it passes, or observations of its first part.
//!
//! At a given clock u a movement is linear in its parameters θ = (style, goal, start), or (style, anchor), y(u) = Φ(u)θ.
//! Via-points are therefore linear constraints ([`through`]). The duration and the time of the start enter through u alone: a
//! [`Recogniser`] keeps one linear-Gaussian estimate of θ for each hypothesis of duration and start, and weighs the hypotheses
//! by their likelihood.

mod calibration;
mod constraints;
mod continuation;
mod estimate;
mod evidence;
mod file;
mod linear_path;
mod movement_table;
mod noise_filter;
mod observation;
mod passage;
mod pauses;
pub(crate) mod prior;
pub(crate) mod recogniser;
mod residual;
mod rotations;
mod triangle;
mod via_points;

pub(crate) use calibration::SHARES;
pub use calibration::{BandFactors, Calibration};
pub use continuation::Continuation;
pub use estimate::Estimate;
pub(crate) use movement_table::responses;
pub use prior::{Mixture, Prior, Settings};
pub use recogniser::{Recogniser, Timing};
pub(crate) use rotations::Layout;
pub use via_points::{At, Passage, PassageOptions, ViaPoint, through};

#[cfg(all(test, feature = "learning"))]
mod tests;
