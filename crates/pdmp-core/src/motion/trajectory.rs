//! Trajectories: sampled movements, singly and in batches.

use ndarray::{Array2, Array3, Ix2};

use crate::error::Result;
use crate::model::Primitive;
use crate::motion::command::Motion;
use crate::validate::{check_positive, check_range, row_major_mut, zeros};

/// Number of samples between two calls of `progress`.
const PROGRESS_INTERVAL: usize = 4096;
/// Maximum number of steps of a trajectory.
const MAX_STEPS: f64 = 1e7;

/// Generated movement, sampled at T times: row k of each array is the state at `time[k]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Times (T,), in seconds from the start, or from the present for a forecast.
    pub time: Vec<f64>,
    /// Positions (T, D), in the unit of each DoF, or (T, nq) in coordinates.
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
        primitive: &Primitive,
        steps: usize,
        dt: f64,
        progress: &mut dyn FnMut(f64) -> Result<()>,
        sample: impl FnMut(usize, f64, &mut Motion) -> Result<()>,
    ) -> Result<Self> {
        Self::record_at(name, primitive, sampling_times(steps, dt), progress, sample)
    }

    /// Records samples at the given times, as [`Self::record`] does.
    pub(crate) fn record_at(
        name: &'static str,
        primitive: &Primitive,
        time: Vec<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
        mut sample: impl FnMut(usize, f64, &mut Motion) -> Result<()>,
    ) -> Result<Self> {
        let n_samples = time.len();
        let (n_coordinates, n_dofs) = (primitive.n_coordinates(), primitive.n_dofs());
        let shape = (n_samples, n_dofs);
        let mut trajectory = Self {
            time,
            position: zeros(name, (n_samples, n_coordinates))?,
            velocity: zeros(name, shape)?,
            acceleration: zeros(name, shape)?,
        };
        let Self { time, position, velocity, acceleration } = &mut trajectory;
        let rows = |array, n| row_major_mut::<_, Ix2>(array).chunks_exact_mut(n);
        let rows = rows(position, n_coordinates).zip(rows(velocity, n_dofs)).zip(rows(acceleration, n_dofs));
        for (k, (time, ((position, velocity), acceleration))) in time.iter().zip(rows).enumerate() {
            if k % PROGRESS_INTERVAL == 0 {
                progress(k as f64 / n_samples as f64)?;
            }
            sample(k, *time, &mut Motion { position, velocity, acceleration })?;
        }
        Ok(trajectory)
    }
}

/// Returns the times 0, dt, …, n·dt of n steps.
pub(crate) fn sampling_times(steps: usize, dt: f64) -> Vec<f64> {
    (0..=steps).map(|k| k as f64 * dt).collect()
}

/// Returns the number of steps n = ⌊duration/dt·(1 + 1e-12) + 1e-9⌋ of a duration, with its name if it is an argument; the
/// margins keep the last sample of a duration that is a multiple of dt up to rounding.
pub(crate) fn step_count(name: Option<&'static str>, duration: f64, dt: f64) -> Result<usize> {
    check_positive("dt", dt)?;
    check_range(
        name.unwrap_or("duration"),
        duration,
        (0.0..f64::INFINITY).contains(&duration),
        "must be finite and not negative",
    )?;
    let steps = (duration / dt * (1.0 + 1e-12) + 1e-9).floor();
    let (name, value, allowed) = match name {
        Some(name) => (name, duration, "more than 1e7 intervals of dt: shorten it, or enlarge dt"),
        None => ("dt", dt, "gives more than 1e7 samples: enlarge it"),
    };
    check_range(name, value, steps <= MAX_STEPS, allowed)?;
    Ok(steps as usize)
}

/// Generated movements of a batch, sampled at T common times: entry b of each array is movement b.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectories {
    /// Positions (B, T, D), in the unit of each DoF.
    pub position: Array3<f64>,
    /// Velocities (B, T, D), per second, if requested.
    pub velocity: Option<Array3<f64>>,
    /// Accelerations (B, T, D), per second squared, if requested.
    pub acceleration: Option<Array3<f64>>,
}

impl Trajectories {
    /// Returns the positions and the derivatives that are present, in order of differentiation.
    pub fn iter(&self) -> impl Iterator<Item = &Array3<f64>> {
        [Some(&self.position), self.velocity.as_ref(), self.acceleration.as_ref()].into_iter().flatten()
    }
}
