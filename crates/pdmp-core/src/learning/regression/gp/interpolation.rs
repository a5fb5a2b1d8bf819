//! Posterior of a Matérn process at any point of the clock.
//!
//! Let u lie between samples i and j, with transition A, Q from i to u and A′ from u to j. The smoothed state xᵢ, and the
//! adjoint rⱼ and precision Nⱼ of the smoother, give
//!
//! ```text
//! x(u) = A·xᵢ + Q·A′ᵀrⱼ        cov(u) = P − P·A′ᵀNⱼA′·P,   P = A·PᵢAᵀ + Q
//! ```
//!
//! with the filtered covariance Pᵢ. Before the first sample of an interval, A is zero and Q is Q(∞); after the last
//! sample, r and N are zero. On the circle the first sample follows the last, and the covariance gains the squares of
//! the columns along which the initial state stays uncertain.

use std::f64::consts::TAU;

use super::kalman_filter::States;
use super::matern_sde::{Square, Transition};
use super::posterior::Posterior;
use crate::numerics::simd::{F64x4, WIDTH};

/// Posterior of the state given all samples.
#[derive(Clone, Debug)]
pub(super) struct StatePosterior<const D: usize> {
    pub(super) circle: bool,
    /// Rate λ of the scaled clock a = λu.
    pub(super) rate: f64,
    /// Value of the state-space kernel at 0.
    pub(super) norm: f64,
    /// Clock of the samples (C,), ascending.
    pub(super) u: Vec<f64>,
    /// Filtered covariances P; the last one holds for the remaining samples.
    pub(super) covariances: Vec<Square<D>>,
    /// Precisions N before each sample and at the end of the process (C + 1,).
    pub(super) precisions: Vec<Square<D>>,
    /// Smoothed states x (C, groups).
    pub(super) states: Vec<States<D>>,
    /// Adjoints r before each sample and at the end of the process (C + 1, groups).
    pub(super) adjoints: Vec<States<D>>,
    pub(super) n_outputs: usize,
}

/// Neighbouring samples of a point, and the transitions from and to them.
struct Neighbours<const D: usize> {
    /// Sample before the point; 0 where there is none.
    before: usize,
    /// Sample after the point, or C.
    after: usize,
    /// A and Q.
    since: Transition<D>,
    /// A′.
    until: Square<D>,
}

impl<const D: usize> StatePosterior<D> {
    fn neighbours(&self, u: f64) -> Neighbours<D> {
        let first = self.u[0];
        let u = if self.circle { first + (u - first).rem_euclid(TAU) } else { u };
        let after = self.u.partition_point(|sample| *sample <= u);
        let before = after.saturating_sub(1);
        let since = if after > 0 { u - self.u[before] } else { f64::INFINITY };
        let next = self.u.get(after).copied().unwrap_or(if self.circle { first + TAU } else { u });
        let until = (next - u).max(0.0);
        Neighbours {
            before,
            after,
            since: Transition::new(self.rate * since),
            until: Transition::new(self.rate * until).matrix,
        }
    }

    /// Returns f and df/du by groups of columns: the outputs, then the columns of the periodic boundary.
    fn groups(&self, at: &Neighbours<D>) -> impl Iterator<Item = (F64x4, F64x4)> {
        let groups = self.states.len() / self.u.len();
        let (a, q) = (at.since.matrix, at.since.noise * at.until.transpose());
        let rate = self.rate;
        // f is the first component of the state, f′ = λ(v₁ − v₀).
        let read = move |m: &Square<D>, x: &States<D>| {
            let row = |i: usize| (0..D).fold(F64x4::ZERO, |sum, j| sum + x[j] * m[(i, j)]);
            (row(0), (row(1) - row(0)) * rate)
        };
        let states = &self.states[at.before * groups..][..groups];
        states.iter().zip(&self.adjoints[at.after * groups..][..groups]).map(move |(x, r)| {
            let ((value, slope), (value_ahead, slope_ahead)) = (read(&a, x), read(&q, r));
            (value + value_ahead, slope + slope_ahead)
        })
    }
}

impl<const D: usize> Posterior for StatePosterior<D> {
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        let pairs = value.chunks_mut(WIDTH).zip(slope.chunks_mut(WIDTH));
        for ((value, slope), (v, s)) in pairs.zip(self.groups(&self.neighbours(u))) {
            value.copy_from_slice(&v.to_array()[..value.len()]);
            slope.copy_from_slice(&s.to_array()[..slope.len()]);
        }
    }

    fn variance(&self, u: f64) -> f64 {
        let at = self.neighbours(u);
        let a = at.since.matrix;
        let covariance = self.covariances[at.before.min(self.covariances.len() - 1)];
        let p = a * covariance * a.transpose() + at.since.noise;
        let row = at.until * p.column(0);
        let reduction = row.dot(&(self.precisions[at.after] * row));
        let columns = self.groups(&at).flat_map(|(value, _)| value.to_array());
        let boundary: f64 = columns.skip(self.n_outputs).map(|f| f * f).sum();
        // Rounding can make a variance near zero negative.
        (p[(0, 0)] - reduction + boundary).max(0.0) / self.norm
    }
}
