//! The posterior of a Matérn process at any time.
//!
//! Between samples i and j, with the steps A, Q from i to u and A′ from u to j, the smoothed state and the adjoint and
//! precision at the samples give
//!
//! ```text
//! x(u) = A·xᵢ + Q·A′ᵀrⱼ        cov(u) = P − P·A′ᵀNⱼA′·P,   P = A·PᵢAᵀ + Q
//! ```
//!
//! with Pᵢ of the filter. Before the first sample of an interval A is zero and Q is Q(∞), after the last one r and N are
//! zero; on the circle the first sample comes after the last, and the directions in which the first state stays
//! uncertain add their squares to the covariance.

use std::f64::consts::TAU;

use super::kalman_filter::States;
use super::matern_sde::{Square, Transition};
use crate::numerics::simd::{Lanes, WIDTH};

/// What all samples say about the state.
#[derive(Clone, Debug)]
pub(super) struct Trajectory<const D: usize> {
    pub(super) circle: bool,
    /// Rate λ of the clock a = λu.
    pub(super) rate: f64,
    /// What the chain's kernel is at 0.
    pub(super) norm: f64,
    /// Clock of the samples (C,), in order.
    pub(super) u: Vec<f64>,
    /// P after each sample, as far as they differ: the last stands for the rest.
    pub(super) covariances: Vec<Square<D>>,
    /// N before each sample, and where the chain ends (C + 1,).
    pub(super) precisions: Vec<Square<D>>,
    /// x at each sample (C, groups).
    pub(super) states: Vec<States<D>>,
    /// r before each sample, and where the chain ends (C + 1, groups).
    pub(super) adjoints: Vec<States<D>>,
    pub(super) n_outputs: usize,
}

/// A time between two samples.
struct Place<const D: usize> {
    /// The sample before; any, where there is none.
    before: usize,
    /// The sample after, or C.
    after: usize,
    /// A and Q.
    since: Transition<D>,
    /// A′.
    until: Square<D>,
}

impl<const D: usize> Trajectory<D> {
    fn place(&self, u: f64) -> Place<D> {
        let first = self.u[0];
        let u = if self.circle { first + (u - first).rem_euclid(TAU) } else { u };
        let after = self.u.partition_point(|sample| *sample <= u);
        let before = after.saturating_sub(1);
        let since = if after > 0 { u - self.u[before] } else { f64::INFINITY };
        let next = self.u.get(after).copied().unwrap_or(if self.circle { first + TAU } else { u });
        let until = (next - u).max(0.0);
        Place {
            before,
            after,
            since: Transition::new(self.rate * since),
            until: Transition::new(self.rate * until).matrix,
        }
    }

    /// f and its derivative with respect to u, in groups, the columns behind the outputs included.
    fn groups(&self, place: &Place<D>) -> impl Iterator<Item = (Lanes, Lanes)> {
        let groups = self.states.len() / self.u.len();
        let (a, q) = (place.since.matrix, place.since.noise * place.until.transpose());
        let rate = self.rate;
        // f is the first component of the state, f′ = λ(v₁ − v₀).
        let read = move |m: &Square<D>, x: &States<D>| {
            let row = |i: usize| (0..D).fold(Lanes::ZERO, |sum, j| sum + x[j] * m[(i, j)]);
            (row(0), (row(1) - row(0)) * rate)
        };
        let states = &self.states[place.before * groups..][..groups];
        states.iter().zip(&self.adjoints[place.after * groups..][..groups]).map(move |(x, r)| {
            let ((value, slope), (more, steeper)) = (read(&a, x), read(&q, r));
            (value + more, slope + steeper)
        })
    }

    /// Means and their derivatives.
    pub(super) fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        let pairs = value.chunks_mut(WIDTH).zip(slope.chunks_mut(WIDTH));
        for ((value, slope), (v, s)) in pairs.zip(self.groups(&self.place(u))) {
            value.copy_from_slice(&v.to_array()[..value.len()]);
            slope.copy_from_slice(&s.to_array()[..slope.len()]);
        }
    }

    /// Variance of f, in units of the signal variance.
    pub(super) fn variance(&self, u: f64) -> f64 {
        let place = self.place(u);
        let a = place.since.matrix;
        let covariance = self.covariances[place.before.min(self.covariances.len() - 1)];
        let p = a * covariance * a.transpose() + place.since.noise;
        let row = place.until * p.column(0);
        let known = row.dot(&(self.precisions[place.after] * row));
        let columns = self.groups(&place).flat_map(|(value, _)| value.to_array());
        let open: f64 = columns.skip(self.n_outputs).map(|f| f * f).sum();
        // Rounding may take a variance of nearly zero below it.
        (p[(0, 0)] - known + open).max(0.0) / self.norm
    }
}
