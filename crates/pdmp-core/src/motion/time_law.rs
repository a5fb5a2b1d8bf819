//! Time-optimal time law along a path within limits of velocity and acceleration.
//!
//! The path y(u) of a movement does not depend on the rate ρ = u̇ of its clock, so that ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′. With x = ρ²
//! and a = ρ̇ constant over each interval Δ between knots, x_{i+1} = x_i + 2Δa_i, and the limits are linear in (x, a):
//!
//! ```text
//! |y′| √x ≤ V,    |y″x + y′a| ≤ A at both ends and in the middle of each interval.
//! ```
//!
//! A rotation has |ω′|√x ≤ Ω and |ω″x + ω′a| ≤ A with the sizes of vectors. In the plane of ω′ and ω″ the latter is a disc, of which
//! x ≥ 0 needs one half; the regular polygon with 16 corners on the circle replaces it. Without curvature, and for a = 0 with ω″ ⟂ ω′,
//! it is exact; elsewhere up to 1.9 % of A remain unused.
//!
//! A backward pass computes the largest x from which the rest of the path can be followed, a forward pass takes the largest
//! a that stays below it: O(N·D).
//!
//! H. Pham, Q.-C. Pham, *A new approach to time-optimal path parameterization based on reachability analysis*, IEEE
//! Transactions on Robotics 34(3), 2018.

use crate::motion::rate_limits::{IntervalLimits, PathLimits, largest, of_constant_turn};
use crate::motion::sampled_path::{Derivatives, SampledPath};
use crate::numerics::simd::{Kernel, Register, compute};
use crate::numerics::state::clone_in_place;

/// Largest x = ρ² at each knot of a path.
#[derive(Debug)]
pub(crate) struct RateCurve {
    /// Largest x from which the rest of the path can be followed.
    pub(crate) max: Vec<f64>,
    /// Largest x with a = 0 at each knot and in the middle of the interval that follows, 0 where it is not known.
    pub(crate) constant: Vec<f64>,
    /// True where some a leads from the largest x to the next one.
    leads: Vec<bool>,
    interval: IntervalLimits,
}

clone_in_place!(RateCurve { max, constant, leads, interval });

impl RateCurve {
    /// Returns a curve of `n_knots` knots for a path of groups and rotations, to be computed by [`RateCurve::compute`].
    pub(crate) fn new(n_knots: usize, n_groups: usize, n_rotations: usize) -> Self {
        let interval = IntervalLimits::new(n_groups, n_rotations);
        Self { max: vec![0.0; n_knots], constant: vec![0.0; n_knots], leads: vec![false; n_knots], interval }
    }

    /// Computes the largest constant rates, with which [`RateCurve::compute`] is faster where they suffice.
    pub(crate) fn compute_constant(&mut self, path: &SampledPath, limits: &PathLimits) {
        compute(Constant { curve: self, path, limits });
    }

    /// Computes the curve backwards from `end`, which the limits at the last knot reduce; `max` bounds every x.
    pub(crate) fn compute(&mut self, path: &SampledPath, limits: &PathLimits, end: f64, max: f64) {
        compute(Backward { curve: self, path, limits, end, max });
    }

    /// Limits the curve to what can be reached from `start` ≤ max[0]: the time-optimal law.
    pub(crate) fn reach(&mut self, path: &SampledPath, limits: &PathLimits, start: f64) {
        compute(Forward { curve: self, path, limits, start });
    }
}

/// Returns the largest x with a = 0 at the last knot.
#[inline(always)]
fn last_constant<T: Register>(path: &SampledPath, limits: &PathLimits) -> f64 {
    let mut inverse = T::default();
    for ([_, here], limits) in path.ends(path.clock.len() - 2, limits) {
        inverse = inverse.fast_max(limits.of_constant(Derivatives::load(here)));
    }
    let turns = path.turns(path.clock.len() - 2, limits).map(|([_, here], limits)| of_constant_turn(limits, &here));
    turns.fold(largest::<T>(inverse), f64::max).recip()
}

/// Kernel of [`RateCurve::compute_constant`].
struct Constant<'a> {
    curve: &'a mut RateCurve,
    path: &'a SampledPath,
    limits: &'a PathLimits,
}

impl Kernel for Constant<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { curve, path, limits } = self;
        let last = curve.constant.len() - 1;
        for (i, constant) in curve.constant[..last].iter_mut().enumerate() {
            let (interval, mut inverse) = (path.interval(i), T::default());
            for (ends, limits) in path.ends(i, limits) {
                let [here, next] = Derivatives::<T>::load_both(ends);
                inverse = inverse.fast_max(limits.of_constant(here));
                inverse = inverse.fast_max(limits.of_constant(here.between(next, interval, 0.5)));
            }
            let turns = path.turns(i, limits).map(|([here, next], limits)| {
                of_constant_turn(limits, &here).max(of_constant_turn(limits, &here.between(&next, interval, 0.5)))
            });
            *constant = turns.fold(largest(inverse), f64::max).recip();
        }
        curve.constant[last] = last_constant::<T>(path, limits);
    }
}

/// Kernel of [`RateCurve::compute`].
struct Backward<'a> {
    curve: &'a mut RateCurve,
    path: &'a SampledPath,
    limits: &'a PathLimits,
    end: f64,
    max: f64,
}

impl Kernel for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { curve, path, limits, end, max } = self;
        let RateCurve { max: largest, constant, leads, interval } = curve;
        let last = path.clock.len() - 1;
        let (largest, constant, leads) = (&mut largest[..=last], &constant[..=last], &mut leads[..=last]);
        let mut next = end.min(last_constant::<T>(path, limits)).min(max);
        largest[last] = next;
        for i in (0..last).rev() {
            // Where the largest rate can be kept, nothing else needs to be computed.
            let keeps = next >= max && constant[i] >= max && constant[i + 1] >= max;
            if keeps {
                (next, leads[i]) = (max, true);
            } else {
                interval.compute::<T>(path, limits, i);
                (next, leads[i]) = interval.largest_from::<T>(next, 2.0 * path.interval(i), max);
            }
            largest[i] = next;
        }
    }
}

/// Kernel of [`RateCurve::reach`].
struct Forward<'a> {
    curve: &'a mut RateCurve,
    path: &'a SampledPath,
    limits: &'a PathLimits,
    start: f64,
}

impl Kernel for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { curve, path, limits, start } = self;
        let RateCurve { max: largest, leads, interval, .. } = curve;
        let mut on_curve = start >= largest[0];
        largest[0] = start;
        for i in 0..path.clock.len() - 1 {
            if on_curve && leads[i] {
                continue;
            }
            let (x, twice) = (largest[i], 2.0 * path.interval(i));
            let reached = (x + twice * interval.largest_slope::<T>(path, limits, i, x)).max(0.0);
            on_curve = reached >= largest[i + 1];
            largest[i + 1] = largest[i + 1].min(reached);
        }
    }
}

/// Time law u(t): pieces of constant ü.
#[derive(Clone, Debug)]
pub(crate) struct TimeLaw {
    clock: Vec<f64>,
    /// Time at each knot, in seconds.
    time: Vec<f64>,
    /// ρ at each knot.
    rate: Vec<f64>,
}

impl TimeLaw {
    /// Returns the time law from x = ρ² at knots of the clock.
    pub(crate) fn new(clock: &[f64], x: &[f64]) -> Self {
        let (clock, rate): (_, Vec<f64>) = (clock.to_vec(), x.iter().map(|x| x.sqrt()).collect());
        let mut time = Vec::with_capacity(rate.len());
        time.push(0.0);
        for (ends, knots) in rate.windows(2).zip(clock.windows(2)) {
            time.push(time[time.len() - 1] + 2.0 * (knots[1] - knots[0]) / (ends[0] + ends[1]));
        }
        Self { clock, time, rate }
    }

    /// Returns the duration, in seconds.
    pub(crate) fn duration(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Returns the interval that contains time `t`, from interval `first` on, and u, u̇ and ü; past the end, those of the end.
    pub(crate) fn at(&self, t: f64, first: usize) -> (usize, [f64; 3]) {
        let last = self.time.len() - 2;
        let i = (first..last).find(|i| self.time[i + 1] > t).unwrap_or(last);
        let length = self.time[i + 1] - self.time[i];
        let a = (self.rate[i + 1] - self.rate[i]) / length;
        let since = (t - self.time[i]).clamp(0.0, length);
        let u = self.clock[i] + (self.rate[i] + 0.5 * a * since) * since;
        (i, [u, self.rate[i] + a * since, if t <= self.duration() { a } else { 0.0 }])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::rate_limits::RateLimits;
    use crate::numerics::simd::F64x4;

    /// The registers of the processor and portable ones yield the same curve and the same law to the last bit, with a DoF that
    /// rests, one that reverses, and lanes without limits.
    #[test]
    fn curve_does_not_depend_on_the_register_width() {
        let knots: Vec<f64> = (0..=200).map(|i| i as f64 / 200.0).collect();
        let mut path = SampledPath::at(knots, 2, 0);
        for index in 0..path.clock.len() {
            let u = path.clock[index];
            for (group, sample) in path.knot_mut(index).iter_mut().enumerate() {
                let frequency = F64x4::new([0.0, 3.0, 7.0, 11.0]) * (1.0 + group as f64);
                let phase = frequency * u;
                *sample = [phase.sin(), frequency * phase.cos(), -frequency * frequency * phase.sin()];
            }
        }
        let infinity = f64::INFINITY;
        let velocity = F64x4::new([1.0, 2.0, infinity, 3.0]);
        let of_group = |size: f64| RateLimits::new(velocity * size, F64x4::new([5.0, 6.0, 7.0, infinity]) * size);
        let limits = PathLimits { groups: [4.0, 9.0].map(of_group).to_vec(), rotations: Vec::new() };
        let (path, limits) = (&path, &limits);
        let (end, max) = (infinity, 0.5);
        let [mut any, mut four] = [(); 2].map(|()| RateCurve::new(201, 2, 0));
        any.compute_constant(path, limits);
        Constant { curve: &mut four, path, limits }.run::<F64x4>();
        assert_eq!(any.constant, four.constant);
        any.compute(path, limits, end, max);
        Backward { curve: &mut four, path, limits, end, max }.run::<F64x4>();
        assert_eq!(any.max, four.max);
        let start = 0.5 * any.max[0];
        any.reach(path, limits, start);
        Forward { curve: &mut four, path, limits, start }.run::<F64x4>();
        assert_eq!(any.max, four.max);
        // Some of the curve is limited, some of it is not.
        let n_free = any.max.iter().filter(|x| **x == max).count();
        assert!((10..190).contains(&n_free), "{n_free}");
        assert!(any.max.iter().all(|x| (0.0..=max).contains(x)));
    }
}
