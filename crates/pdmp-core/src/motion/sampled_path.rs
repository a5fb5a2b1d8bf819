//! Path of a movement, sampled at knots of the clock.

use crate::motion::time_law::RateLimits;
use crate::numerics::simd::{F64x4, Register};
use crate::numerics::state::clone_in_place;

/// Path at knots of the clock.
#[derive(Debug)]
pub(crate) struct SampledPath {
    /// u at the knots, increasing.
    pub(crate) clock: Vec<f64>,
    n_groups: usize,
    /// y, y′ and y″ (N + 1, groups of DoFs) by rows.
    samples: Vec<[F64x4; 3]>,
}

clone_in_place!(SampledPath { clock, n_groups, samples });

impl SampledPath {
    /// Returns a path at knots that has not been sampled yet.
    pub(crate) fn at(clock: Vec<f64>, n_groups: usize) -> Self {
        Self { samples: vec![[F64x4::ZERO; 3]; clock.len() * n_groups], n_groups, clock }
    }

    /// Returns the samples of all groups at a knot.
    pub(crate) fn knot(&self, index: usize) -> &[[F64x4; 3]] {
        &self.samples[index * self.n_groups..(index + 1) * self.n_groups]
    }

    /// Returns the clock and the samples of each knot.
    pub(crate) fn knots_mut(&mut self) -> impl Iterator<Item = (f64, &mut [[F64x4; 3]])> {
        self.clock.iter().copied().zip(self.samples.chunks_exact_mut(self.n_groups))
    }

    /// Returns the length of interval `index`, between this knot and the next.
    #[inline(always)]
    pub(crate) fn interval(&self, index: usize) -> f64 {
        self.clock[index + 1] - self.clock[index]
    }

    /// Returns the samples of all groups at both ends of interval `index`, with their limits.
    #[inline(always)]
    pub(crate) fn ends<'a>(
        &'a self,
        index: usize,
        limits: &'a [RateLimits],
    ) -> impl Iterator<Item = ([&'a [F64x4; 3]; 2], &'a RateLimits)> {
        let n_groups = self.n_groups;
        let samples = &self.samples[index * n_groups..(index + 2) * n_groups];
        let limits = &limits[..n_groups];
        (0..n_groups).map(move |group| ([&samples[group], &samples[group + n_groups]], &limits[group]))
    }
}

/// y′ and y″ of a group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Derivatives<T> {
    pub(crate) slope: T,
    pub(crate) bend: T,
}

impl<T: Register> Derivatives<T> {
    /// Returns those of a sample.
    #[inline(always)]
    pub(crate) fn load([_, slope, bend]: &[F64x4; 3]) -> Self {
        Self { slope: T::load(slope), bend: T::load(bend) }
    }

    /// Returns those at a position `t` from 0 to 1 in an interval: the cubic Hermite interpolation of y′, and its derivative.
    #[inline(always)]
    pub(crate) fn between(self, next: Self, interval: f64, t: f64) -> Self {
        let [bend, c, d] = self.cubic(next, interval);
        Self {
            slope: self.slope + (bend + (c + d * t) * t) * t,
            bend: (bend + (c * 2.0 + d * (3.0 * t)) * t) * interval.recip(),
        }
    }

    /// Returns the change of y up to a position `t` in an interval: the integral of that interpolation.
    #[inline(always)]
    pub(crate) fn way(self, next: Self, interval: f64, t: f64) -> T {
        let [bend, c, d] = self.cubic(next, interval);
        (self.slope + (bend * 0.5 + (c * (1.0 / 3.0) + d * (0.25 * t)) * t) * t) * (interval * t)
    }

    /// Returns b, c and d of p(t) = y′ + t(b + t(c + td)) with p(1) and p′(1) of the next sample.
    #[inline(always)]
    fn cubic(self, next: Self, interval: f64) -> [T; 3] {
        let (change, bends) = (next.slope - self.slope, [self.bend * interval, next.bend * interval]);
        [bends[0], change * 3.0 - bends[0] * 2.0 - bends[1], bends[0] + bends[1] - change * 2.0]
    }
}
