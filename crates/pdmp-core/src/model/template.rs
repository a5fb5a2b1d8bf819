//! The template to which time was warped, and the settings of the warp.

use ndarray::Array2;

use crate::error::{Error, Result};

/// Steps of the grid of time in a segment of linear time, and as many places at which a segment is compared.
pub(crate) const STEPS: usize = 10;
/// Steepest slope that can be asked for: the grid knows no flatter one than its inverse.
const STEEPEST: f64 = STEPS as f64;

/// Settings of a time warp.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    /// Number K of segments of equal phase: how many times describe the timing of a movement.
    pub segments: usize,
    /// Bound of a segment's time: at most `slope` times that of linear scaling, at least as many times less.
    pub slope: f64,
}

impl Default for Warp {
    fn default() -> Self {
        Self { segments: 8, slope: 2.5 }
    }
}

/// What demonstrations were warped to, so that new ones can be.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// Bound of the slopes.
    pub(crate) slope: f64,
    /// What each DoF is counted in (D,).
    pub(crate) unit: Vec<f64>,
    /// Square-root velocities q₀ on the grid (10·K, D).
    pub(crate) shape: Array2<f64>,
}

impl Template {
    /// Number of cells of a template of so many segments.
    pub(crate) fn cells(segments: usize) -> usize {
        segments * STEPS
    }
}

impl Warp {
    /// A warp of so many segments, whose slopes lie between 1/`slope` and `slope`.
    ///
    /// # Errors
    /// No segment, or a slope outside 1 to 10.
    pub fn new(segments: usize, slope: f64) -> Result<Self> {
        let warp = Self { segments, slope };
        warp.check(usize::MAX)?;
        Ok(warp)
    }

    /// Checks the settings, given the most segments that the samples carry.
    pub(crate) fn check(&self, most: usize) -> Result<()> {
        match *self {
            Self { segments: 0, .. } => {
                Err(Error::Range { name: "segments", value: 0.0, allowed: "must be at least 1, which is linear" })
            }
            Self { segments, .. } if segments > most => Err(Error::Segments { segments, most }),
            Self { slope, .. } if !(1.0..=STEEPEST).contains(&slope) => Err(Error::Range {
                name: "slope",
                value: slope,
                allowed: "must lie between 1, which is linear, and 10",
            }),
            _ => Ok(()),
        }
    }
}
