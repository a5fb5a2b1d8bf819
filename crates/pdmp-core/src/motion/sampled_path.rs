//! Path of a movement, sampled at knots of the clock.

use crate::motion::angular::AngularLimits;
use crate::motion::rate_limits::{PathLimits, RateLimits};
use crate::numerics::rotation::{Vector, add_scaled};
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
    /// Number of rotations that are sampled, 0 without limits of rotations.
    n_turns: usize,
    /// Angular velocity and acceleration per unit of the clock (N + 1, rotations) by rows, in the body frame.
    turns: Vec<TurnDerivatives>,
}

clone_in_place!(SampledPath { clock, n_groups, samples, n_turns, turns });

impl SampledPath {
    /// Returns a path of groups of DoFs and rotations at knots that has not been sampled yet.
    pub(crate) fn at(clock: Vec<f64>, n_groups: usize, n_rotations: usize) -> Self {
        let samples = vec![[F64x4::ZERO; 3]; clock.len() * n_groups];
        let turns = vec![TurnDerivatives::default(); clock.len() * n_rotations];
        Self { samples, n_groups, n_turns: 0, turns, clock }
    }

    /// Sets whether the rotations are sampled, for limits along the path.
    pub(crate) fn sample_turns(&mut self, limits: &PathLimits) {
        self.n_turns = if limits.have_rotations() { limits.rotations.len() } else { 0 };
    }

    /// Returns the samples of the rotations at a knot; none where they are not sampled.
    pub(crate) fn turns_mut(&mut self, index: usize) -> &mut [TurnDerivatives] {
        &mut self.turns[index * self.n_turns..(index + 1) * self.n_turns]
    }

    /// Returns the samples of the rotations at both ends of interval `index`, with their limits; none without limits of rotations.
    #[inline(always)]
    pub(crate) fn turns<'a>(
        &'a self,
        index: usize,
        limits: &'a PathLimits,
    ) -> impl Iterator<Item = ([TurnDerivatives; 2], &'a AngularLimits)> {
        let n = self.n_turns;
        let turns = &self.turns[index * n..(index + 2) * n];
        limits.rotations.iter().take(n).enumerate().map(move |(i, limits)| ([turns[i], turns[i + n]], limits))
    }

    /// Returns the samples of all groups at a knot.
    pub(crate) fn knot(&self, index: usize) -> &[[F64x4; 3]] {
        &self.samples[index * self.n_groups..(index + 1) * self.n_groups]
    }

    /// Returns the samples of all groups at a knot, to be set.
    pub(crate) fn knot_mut(&mut self, index: usize) -> &mut [[F64x4; 3]] {
        &mut self.samples[index * self.n_groups..(index + 1) * self.n_groups]
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
        limits: &'a PathLimits,
    ) -> impl Iterator<Item = ([&'a [F64x4; 3]; 2], &'a RateLimits)> {
        let n_groups = self.n_groups;
        let samples = &self.samples[index * n_groups..(index + 2) * n_groups];
        let limits = &limits.groups[..n_groups];
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

    /// Returns those of two samples.
    #[inline(always)]
    pub(crate) fn load_both([here, next]: [&[F64x4; 3]; 2]) -> [Self; 2] {
        [Self::load(here), Self::load(next)]
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

/// Angular velocity and acceleration of a rotation per unit of the clock, in the body frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TurnDerivatives {
    pub(crate) slope: Vector,
    pub(crate) bend: Vector,
}

impl TurnDerivatives {
    /// Returns those at a position `t` from 0 to 1 in an interval, as [`Derivatives::between`].
    #[inline(always)]
    pub(crate) fn between(&self, next: &Self, interval: f64, t: f64) -> Self {
        let change = add_scaled(next.slope, -1.0, self.slope);
        let [from, to] = [self.bend, next.bend].map(|bend| bend.map(|x| x * interval));
        let c: Vector = std::array::from_fn(|i| change[i] * 3.0 - from[i] * 2.0 - to[i]);
        let d: Vector = std::array::from_fn(|i| from[i] + to[i] - change[i] * 2.0);
        Self {
            slope: std::array::from_fn(|i| self.slope[i] + (from[i] + (c[i] + d[i] * t) * t) * t),
            bend: std::array::from_fn(|i| (from[i] + (c[i] * 2.0 + d[i] * (3.0 * t)) * t) * interval.recip()),
        }
    }
}
