//! From recordings to demonstrations: what is done to a raw recording before a primitive is learnt from it.
//!
//! | room | what it does |
//! |---|---|
//! | `gaps` | interpolates samples that are missing |
//! | `lowpass` | the low-pass filter, and what it takes off at each cut-off |
//! | `cut` | even sampling, parts between given times, the part in which there is movement |
//! | `repetition` | how well a recording repeats itself after each lag, and its period |
//! | `track` | when each cycle begins |
//! | `odd` | which cycles are unlike the others |
//! | `cycles` | one closed demonstration per cycle, in phase across recordings |
//!
//! Between samples a recording is the cubic spline through them, over its own clock. What is made of it keeps the names,
//! units and context, and the goal where the end of the movement is the same.

mod cut;
mod cycles;
mod gaps;
mod lowpass;
mod odd;
mod repetition;
mod track;

use ndarray::Array2;

use crate::align::check_duration;
use crate::demo::{Demonstration, Sampling, zeros};
use crate::error::{Error, Result};
use crate::spline::{Knots, Splines};

pub use cut::{cut, resample, trim};
pub use cycles::{Cycle, Cycles, Keep, Rejected, cycles};
pub use gaps::fill;
pub use lowpass::{lowpass, residuals};
pub use odd::Reason;
pub use repetition::period;

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

/// A recording between its samples.
struct Curve {
    time: Vec<f64>,
    splines: Splines,
}

impl Curve {
    fn of(demo: &Demonstration) -> Result<Self> {
        let time = clock(demo)?;
        let values: Vec<f64> = demo.position().iter().copied().collect();
        let splines = Splines::through(Knots::not_a_knot(time.clone()), &values, demo.n_dofs());
        Ok(Self { time, splines })
    }

    fn first(&self) -> f64 {
        self.time[0]
    }

    fn last(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Mean sampling interval, in seconds.
    fn interval(&self) -> f64 {
        (self.last() - self.first()) / (self.time.len() - 1) as f64
    }

    /// Positions (n, D) at n even times from `from` to `to`, both included.
    fn sample(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let mut position = zeros("position", (n, self.splines.n_dofs()))?;
        let times = (0..n).map(|c| from + (to - from) * (c as f64 / (n - 1) as f64));
        self.splines.sample(times, position.as_slice_mut().unwrap_or_default());
        Ok(position)
    }
}
