//! From recordings to demonstrations: what is done to a raw recording before a primitive is learnt from it.
//!
//! | room | what it does |
//! |---|---|
//! | `gaps` | interpolates samples that are missing |
//! | `lowpass` | the low-pass filter, and what it takes off at each cut-off |
//! | `curve` | a recording between its samples: its smoothing spline, and the noise beside it |
//! | `cut` | even sampling, parts between given times |
//! | `trim` | the part in which there is movement |
//! | `repetition` | how well a recording repeats itself after each lag, and its period |
//! | `track` | when each cycle begins |
//! | `odd` | which cycles are unlike the others |
//! | `significance` | the least correlation that chance does not explain |
//! | `growth` | what grows from cycle to cycle, such as the angle of a wheel |
//! | `cycles` | one closed demonstration per cycle, in phase across recordings |
//!
//! What is made of a recording keeps the names, units and context, and the goal where the end of the movement is the
//! same.

mod curve;
mod cycle_growth;
mod cycle_onsets;
mod cycles;
mod gaps;
pub mod inspection;
mod lowpass;
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
pub use cycles::{Cycle, Cycles, Keep, Rejected, cycles};
pub use gaps::fill;
pub use lowpass::{lowpass, residuals};
pub use outliers::Reason;
pub use periodicity::period;
pub use resampling::{cut, resample};
pub use trim::trim;

/// When the samples were taken (T,), in seconds.
fn clock(demo: &Demonstration) -> Result<Vec<f64>> {
    let time: Vec<f64> = match demo.sampling() {
        Sampling::Unknown => {
            return Err(Error::Arguments(
                "the recording does not tell when its samples were taken: make the demonstration with dt= or time=",
            ));
        }
        Sampling::Uniform { dt } => (0..demo.n_samples()).map(|c| c as f64 * dt).collect(),
        Sampling::Stamped { time } => time.clone(),
    };
    check_duration(time[time.len() - 1] - time[0])?;
    Ok(time)
}
