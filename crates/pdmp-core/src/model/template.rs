//! Template and settings of the elastic time warp.

use ndarray::Array2;

use crate::error::{Error, Result};
use crate::validate::check_range;

/// Number of time steps of the search grid per segment of linear time, and of comparison points per segment.
pub(crate) const STEPS: usize = 10;
/// Maximum of `max_slope`: the smallest slope that the grid resolves is its inverse.
const MAX_SLOPE: f64 = STEPS as f64;

/// Settings of a time warp.
///
/// ```
/// use pdmp_core::model::TimeWarp;
///
/// assert_eq!(TimeWarp::new(8, 2.5)?, TimeWarp::default());
/// assert!(TimeWarp::new(0, 2.5).is_err());
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TimeWarp {
    /// Number K of segments of equal phase, whose durations are individual to each demonstration.
    pub n_segments: usize,
    /// Bound of the duration of a segment, relative to linear scaling: between 1/`max_slope` and `max_slope`.
    pub max_slope: f64,
}

impl Default for TimeWarp {
    fn default() -> Self {
        Self { n_segments: 8, max_slope: 2.5 }
    }
}

/// Mean movement to which demonstrations were warped; new demonstrations are warped to it too.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpTemplate {
    /// Bound of the slopes, [`TimeWarp::max_slope`].
    pub(crate) slope: f64,
    /// Scale of each DoF in the comparison (D,).
    pub(crate) unit: Vec<f64>,
    /// Square-root velocities q₀ on the grid (10·K, D).
    pub(crate) shape: Array2<f64>,
}

impl WarpTemplate {
    /// Returns the number of grid cells of a template with K segments.
    pub(crate) fn cells(segments: usize) -> usize {
        segments * STEPS
    }
}

impl TimeWarp {
    /// Returns the settings for K segments whose slopes lie between 1/`max_slope` and `max_slope`.
    ///
    /// # Errors
    /// `n_segments` of 0, or `max_slope` outside 1 to 10.
    pub fn new(n_segments: usize, max_slope: f64) -> Result<Self> {
        let warp = Self { n_segments, max_slope };
        warp.check(usize::MAX)?;
        Ok(warp)
    }

    /// Checks the settings, given the maximum number of segments that the samples resolve.
    pub(crate) fn check(&self, max_segments: usize) -> Result<()> {
        let Self { n_segments, max_slope } = *self;
        check_range("n_segments", n_segments as f64, n_segments > 0, "must be at least 1, which is linear")?;
        if n_segments > max_segments {
            return Err(Error::Segments { n_segments, most: max_segments });
        }
        let valid = (1.0..=MAX_SLOPE).contains(&max_slope);
        check_range("max_slope", max_slope, valid, "must lie between 1, which is linear, and 10")
    }
}
