//! Inference of whole movements from a part of them: via-points.

mod constraints;
mod linear_path;
mod passage;
mod via_points;

pub use via_points::{At, Passage, PassageOptions, ViaPoint, through};
