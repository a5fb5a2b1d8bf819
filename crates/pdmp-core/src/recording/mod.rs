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
mod cut;
mod cycles;
mod gaps;
mod growth;
mod lowpass;
mod odd;
mod repetition;
mod significance;
mod track;
mod trim;

use crate::align::check_duration;
use crate::demo::{Demonstration, Sampling};
use crate::error::{Error, Result};

use curve::Curve;

pub use cut::{cut, resample};
pub use cycles::{Cycle, Cycles, Keep, Rejected, cycles};
pub use gaps::fill;
pub use growth::Growth;
pub use lowpass::{lowpass, residuals};
pub use odd::Reason;
pub use repetition::period;
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
