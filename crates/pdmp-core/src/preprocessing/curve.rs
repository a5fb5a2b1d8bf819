//! Continuous recordings.
//!
//! A recording as a function of time is the cubic spline f through its samples, smoothed by generalised cross-validation,
//! plus the residual r of the smoothing at the nearest sample:
//!
//! ```text
//! y(t) = f(t) + r(nearest sample)
//! ```
//!
//! f interpolates clean samples. A spline through noisy samples would turn the noise into smooth curves, which no later
//! smoothing can separate from movement. The residual of the nearest sample is as white as the recorded noise, as long as
//! the new samples are no denser than the recorded ones. If a new interval has several recorded samples, their mean
//! preserves the power density of the noise. At the times of the recording y is the recorded value.

use std::ops::Range;

use ndarray::{Array2, ArrayView2};

use super::clock;
use super::cycle_rotations::with_matrices;
use crate::demonstration::Demonstration;
use crate::error::Result;
use crate::numerics::smoothing_spline::{Smoothing, smooth};
use crate::numerics::spline::{Knots, Splines};
use crate::validate::{row_major_mut, zeros};

/// Recording as a function of time.
pub(super) struct Curve {
    /// Sampling times (T,), in seconds.
    pub(super) time: Vec<f64>,
    /// Splines through the smoothed samples.
    pub(super) splines: Splines,
    /// Residual of the smoothing (T, D), in the unit of each DoF.
    pub(super) noise: Array2<f64>,
    /// Columns of each rotation.
    pub(super) rotations: Vec<Range<usize>>,
}

impl Curve {
    /// Smooths a recording.
    ///
    /// # Errors
    /// A recording without times.
    pub(super) fn of(demo: &Demonstration) -> Result<Self> {
        Self::through(demo, demo.position(), demo.quaternion_columns())
    }

    /// Smooths a recording with the elements of rotation matrices in place of quaternions: they do not depend on signs, and
    /// repeat themselves with the rotation.
    ///
    /// # Errors
    /// A recording without times.
    pub(super) fn with_matrices(demo: &Demonstration) -> Result<Self> {
        let (values, rotations) = with_matrices(demo.position(), demo.rotations());
        Self::through(demo, values.view(), rotations)
    }

    fn through(demo: &Demonstration, values: ArrayView2<f64>, rotations: Vec<Range<usize>>) -> Result<Self> {
        let time = clock(demo)?;
        let smoothed = smooth(Smoothing::Auto, &time, None, values, &rotations)?;
        let noise = &values - &smoothed;
        let smoothed: Vec<f64> = smoothed.iter().copied().collect();
        let splines = Splines::through(Knots::not_a_knot(time.clone()), &smoothed, values.ncols());
        Ok(Self { time, splines, noise, rotations })
    }

    /// Returns the time of the first sample, in seconds.
    pub(super) fn first(&self) -> f64 {
        self.time[0]
    }

    /// Returns the time of the last sample, in seconds.
    pub(super) fn last(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Returns the mean sampling interval, in seconds.
    pub(super) fn interval(&self) -> f64 {
        (self.last() - self.first()) / (self.time.len() - 1) as f64
    }

    /// Returns positions (n, D) without noise at n equidistant times from `from` to `to`, both included.
    pub(super) fn smooth(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let mut position = zeros("position", (n, self.splines.n_dofs()))?;
        self.splines.sample(equidistant(from, to, n), row_major_mut(&mut position));
        Ok(position)
    }

    /// Returns positions (n, D) of the spline through all samples at n equidistant times from `from` to `to`, both included.
    pub(super) fn interpolate(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let values: Vec<f64> = self.noise.iter().copied().collect();
        let noise = Splines::through(Knots::not_a_knot(self.time.clone()), &values, self.splines.n_dofs());
        let mut position = zeros("position", (n, self.splines.n_dofs()))?;
        noise.sample(equidistant(from, to, n), row_major_mut(&mut position));
        Ok(position + self.smooth(from, to, n)?)
    }

    /// Returns positions (n, D) with the noise of the nearest samples at n equidistant times from `from` to `to`, both
    /// included.
    pub(super) fn sample(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let mut position = self.smooth(from, to, n)?;
        let half_interval = 0.5 * (to - from) / (n - 1) as f64;
        for (mut row, t) in position.rows_mut().into_iter().zip(equidistant(from, to, n)) {
            let nearest = self.nearest(t, half_interval);
            let weight = 1.0 / nearest.len() as f64;
            nearest.for_each(|c| row.scaled_add(weight, &self.noise.row(c)));
        }
        Ok(position)
    }

    /// Returns the samples within `half_interval` of time `t`, or the nearest one.
    fn nearest(&self, t: f64, half_interval: f64) -> Range<usize> {
        let n_before = |limit: f64| self.time.partition_point(|&time| time < limit);
        let within = n_before(t - half_interval)..n_before(t + half_interval);
        if !within.is_empty() {
            return within;
        }
        let after = n_before(t).clamp(1, self.time.len() - 1);
        let nearest = if t - self.time[after - 1] <= self.time[after] - t { after - 1 } else { after };
        nearest..nearest + 1
    }
}

/// Returns n equidistant times from `from` to `to`, both included.
fn equidistant(from: f64, to: f64, n: usize) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |c| from + (to - from) * (c as f64 / (n - 1) as f64))
}
