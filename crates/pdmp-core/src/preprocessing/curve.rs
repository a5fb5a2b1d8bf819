//! A recording between its samples.
//!
//! It is the cubic spline through the samples as generalised cross-validation smooths them, and beside it the noise r
//! that smoothing takes off, which is carried by the nearest sample:
//!
//! ```text
//! y(t) = f(t) + r(nearest sample)
//! ```
//!
//! Clean samples are met by f alone. A spline through noisy ones would be smooth noise, which no later smoothing can
//! separate from movement; carried by the samples it stays as white as it was recorded, as long as no more samples are
//! drawn than there are. Of several within a new interval it is the mean: then its power density stays, too. At the times
//! of the recording, y is what was recorded.

use std::ops::Range;

use ndarray::Array2;

use super::clock;
use crate::demonstration::Demonstration;
use crate::error::Result;
use crate::numerics::smoothing_spline::{Smoothing, smooth};
use crate::numerics::spline::{Knots, Splines};
use crate::validate::zeros;

/// A recording between its samples.
pub(super) struct Curve {
    pub(super) time: Vec<f64>,
    /// Through the smoothed samples.
    pub(super) splines: Splines,
    /// What smoothing takes off the samples (T, D).
    pub(super) noise: Array2<f64>,
}

impl Curve {
    pub(super) fn of(demo: &Demonstration) -> Result<Self> {
        let time = clock(demo)?;
        let smoothed = smooth(Smoothing::Auto, &time, None, demo.position())?;
        let values: Vec<f64> = smoothed.iter().copied().collect();
        let splines = Splines::through(Knots::not_a_knot(time.clone()), &values, demo.n_dofs());
        Ok(Self { time, splines, noise: &demo.position() - &smoothed })
    }

    pub(super) fn first(&self) -> f64 {
        self.time[0]
    }

    pub(super) fn last(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Mean sampling interval, in seconds.
    pub(super) fn interval(&self) -> f64 {
        (self.last() - self.first()) / (self.time.len() - 1) as f64
    }

    /// Positions (n, D) at n even times from `from` to `to`, both included, without noise.
    pub(super) fn smooth(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let mut position = zeros("position", (n, self.splines.n_dofs()))?;
        self.splines.sample(even(from, to, n), position.as_slice_mut().unwrap_or_default());
        Ok(position)
    }

    /// Positions (n, D) at n even times from `from` to `to`, both included, of the spline through all samples.
    pub(super) fn interpolate(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let values: Vec<f64> = self.noise.iter().copied().collect();
        let noise = Splines::through(Knots::not_a_knot(self.time.clone()), &values, self.splines.n_dofs());
        let mut position = zeros("position", (n, self.splines.n_dofs()))?;
        noise.sample(even(from, to, n), position.as_slice_mut().unwrap_or_default());
        Ok(position + self.smooth(from, to, n)?)
    }

    /// Positions (n, D) at n even times from `from` to `to`, both included, with the noise of the nearest samples.
    pub(super) fn sample(&self, from: f64, to: f64, n: usize) -> Result<Array2<f64>> {
        let mut position = self.smooth(from, to, n)?;
        let half = 0.5 * (to - from) / (n - 1) as f64;
        for (mut row, t) in position.rows_mut().into_iter().zip(even(from, to, n)) {
            let near = self.near(t, half);
            let share = 1.0 / near.len() as f64;
            near.for_each(|c| row.scaled_add(share, &self.noise.row(c)));
        }
        Ok(position)
    }

    /// The samples less than `half` an interval from a time, or the nearest one.
    fn near(&self, t: f64, half: f64) -> Range<usize> {
        let before = |limit: f64| self.time.partition_point(|&time| time < limit);
        let within = before(t - half)..before(t + half);
        if !within.is_empty() {
            return within;
        }
        let after = before(t).clamp(1, self.time.len() - 1);
        let nearest = if t - self.time[after - 1] <= self.time[after] - t { after - 1 } else { after };
        nearest..nearest + 1
    }
}

/// The n even times from `from` to `to`, both included.
fn even(from: f64, to: f64, n: usize) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |c| from + (to - from) * (c as f64 / (n - 1) as f64))
}
