//! Preprocessing: from raw recordings to demonstrations.
//!
//! | module | content |
//! |---|---|
//! | `gaps` | interpolation of missing samples |
//! | `lowpass` | low-pass filter, and its residual at each cut-off frequency |
//! | `curve` | continuous recording: a smoothing spline, and the noise of the samples |
//! | `resampling` | uniform sampling, and splitting at given times |
//! | `trim` | removal of rest before and after the movement |
//! | `periodicity` | autocorrelation of a recording, and its period |
//! | `significance` | correlations that chance explains |
//! | `cycle_onsets` | onset of each cycle |
//! | `outliers` | cycles that differ from the others |
//! | `cycle_growth` | gain per cycle, such as that of the angle of a wheel |
//! | `cycle_rotations` | features, gain and mean of rotations |
//! | `cycles` | one closed demonstration per cycle, in phase across recordings |
//! | `orientation` | conversions to and from unit quaternions |
//! | `inspection` | detection of implausible samples |
//!
//! Results keep the names, units and context of a recording, and its goal if the movement ends where the recording does.

mod curve;
mod cycle_growth;
mod cycle_onsets;
mod cycle_rotations;
mod cycles;
mod gaps;
pub mod inspection;
mod lowpass;
pub mod orientation;
mod outliers;
mod periodicity;
mod resampling;
mod significance;
mod trim;

use crate::demonstration::{Demonstration, Sampling};
use crate::error::{Error, Result};
use crate::validate::check_duration;

use curve::Curve;

pub use cycle_growth::Growth;
pub use cycles::{Cycle, CycleOutput, Cycles, Rejected, cycles};
pub use gaps::fill_gaps;
pub use lowpass::{lowpass, residuals};
pub use outliers::RejectionReason;
pub use periodicity::period;
pub use resampling::{resample, split_at};
pub use trim::trim;

/// Returns the sampling times (T,), in seconds.
fn clock(demo: &Demonstration) -> Result<Vec<f64>> {
    let time: Vec<f64> = match demo.sampling() {
        Sampling::Unknown => {
            return Err(Error::Argument {
                name: "time",
                problem: "is unknown: create the demonstration with a sampling interval or time stamps",
            });
        }
        Sampling::Uniform { dt } => (0..demo.n_samples()).map(|c| c as f64 * dt).collect(),
        Sampling::Stamped { time } => time.clone(),
    };
    check_duration(time[time.len() - 1] - time[0])?;
    Ok(time)
}
