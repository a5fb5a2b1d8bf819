//! Trajectories: sampled movements.

use ndarray::{Array2, Ix2};

use crate::error::{Error, Result};
use crate::motion::command::Motion;
use crate::validate::{check_positive, row_major_mut, zeros};

/// Number of samples between two calls of `progress`.
const PROGRESS_INTERVAL: usize = 4096;
/// Maximum number of steps of a trajectory.
const MAX_STEPS: f64 = 1e7;

/// Generated movement, sampled at T times: row k of each array is the state at `time[k]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Times (T,), in seconds from the start, or from the present for a forecast.
    pub time: Vec<f64>,
    /// Positions (T, D), in the unit of each DoF.
    pub position: Array2<f64>,
    /// Velocities (T, D), per second.
    pub velocity: Array2<f64>,
    /// Accelerations (T, D), per second squared.
    pub acceleration: Array2<f64>,
}

impl Trajectory {
    /// Records n + 1 samples at 0, dt, …, n·dt: `sample` writes the motion of a sample, given its index and time. `progress`
    /// is called periodically with the completed fraction.
    pub(crate) fn record(
        name: &'static str,
        n_dofs: usize,
        steps: usize,
        dt: f64,
        progress: &mut dyn FnMut(f64) -> Result<()>,
        mut sample: impl FnMut(usize, f64, &mut Motion) -> Result<()>,
    ) -> Result<Self> {
        let shape = (steps + 1, n_dofs);
        let mut trajectory = Self {
            time: (0..=steps).map(|k| k as f64 * dt).collect(),
            position: zeros(name, shape)?,
            velocity: zeros(name, shape)?,
            acceleration: zeros(name, shape)?,
        };
        let Self { time, position, velocity, acceleration } = &mut trajectory;
        let rows = |array| row_major_mut::<_, Ix2>(array).chunks_exact_mut(n_dofs);
        let rows = rows(position).zip(rows(velocity)).zip(rows(acceleration));
        for (k, (time, ((position, velocity), acceleration))) in time.iter().zip(rows).enumerate() {
            if k % PROGRESS_INTERVAL == 0 {
                progress(k as f64 / (steps + 1) as f64)?;
            }
            sample(k, *time, &mut Motion { position, velocity, acceleration })?;
        }
        Ok(trajectory)
    }
}

/// Returns the number of steps n = ⌊duration/dt·(1 + 1e-12) + 1e-9⌋ of a duration with the given name; the margins keep the
/// last sample of a duration that is a multiple of dt up to rounding.
pub(crate) fn step_count(name: &'static str, duration: f64, dt: f64) -> Result<usize> {
    check_positive("dt", dt)?;
    if !(0.0..f64::INFINITY).contains(&duration) {
        return Err(Error::Range { name, value: duration, allowed: "must be finite and not negative" });
    }
    let steps = (duration / dt * (1.0 + 1e-12) + 1e-9).floor();
    if steps > MAX_STEPS {
        return Err(Error::Range { name: "dt", value: dt, allowed: "gives more than 1e7 samples: enlarge it" });
    }
    Ok(steps as usize)
}
