//! Path of the movement ahead, and the rates at which the limits of velocity and acceleration admit to follow it.
//!
//! The path under the present commands does not depend on the rate ρ of the clock. A copy of the controller samples it at
//! knots, and a backward pass (`time_law`) computes the largest ρ at each of them from which the rest can be followed. Between
//! knots ρ² is linear. The limits of the path are slightly tighter than those of the DoFs, so that what lies between knots, and
//! the last digits of the tick, keep the latter.

use super::Controller;
use super::governor::MARGINS;
use super::group::Group;
use super::path_sampling::Piece;
use crate::error::Result;
use crate::kind::Kind;
use crate::motion::rate_limits::{PathLimits, in_plane, largest, of_angular_velocity};
use crate::motion::sampled_path::{Derivatives, SampledPath, TurnDerivatives};
use crate::motion::time_law::RateCurve;
use crate::motion::viability::Bounds;
use crate::numerics::simd::{Kernel, Register, compute};
use crate::numerics::state::{Visitor, clone_in_place, visit_flag, visit_number};

/// Number of intervals of the path. Learnt from recordings, y″ between the knots is within 1 % of its maximum.
pub(super) const N_INTERVALS: usize = 576;
/// Number of intervals after which a path that was left is sampled again.
const REFRESH: f64 = 8.0;
/// Margins of the acceleration at a tick: smaller than that of the path, so that the path can be followed.
const TICK_MARGINS: [f64; 2] = [0.022, 0.008];
/// Error of the position at which a DoF turns round between knots, relative to the range.
const TURNING: f64 = 1e-5;
/// Part of an interval by which rounding may miss a knot.
const ROUNDING: f64 = 1e-9;
/// Last position in an interval, past which there is still a distance to its end.
const LAST: f64 = 1.0 - 1e-6;

/// Path ahead, with the largest ρ² at its knots.
#[derive(Debug)]
pub(super) struct PathAhead {
    path: SampledPath,
    /// Largest ρ² at the knots, and the largest that can be kept constant from each interval on for the longest substep.
    curve: RateCurve,
    /// Rate up to which the curve was computed.
    max_rate: f64,
    pieces: [Piece; 2],
    pub(super) position: PathPosition,
}

clone_in_place!(PathAhead { path, curve, max_rate, pieces, position });

/// Position of a movement on its path.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PathPosition {
    /// Clock of the phase since the path was sampled.
    progress: f64,
    /// False once a perturbation or a limit has moved the movement off the path.
    is_current: bool,
}

impl PathPosition {
    /// Visits the state.
    pub(super) fn walk(&mut self, visit: &mut Visitor) -> Result<()> {
        visit_number(visit, &mut self.progress, [0.0, 1e300])?;
        visit_flag(visit, &mut self.is_current)
    }
}

impl PathAhead {
    /// Returns memory for a path of groups of DoFs and rotations.
    pub(super) fn new(n_groups: usize, n_rotations: usize) -> Self {
        Self {
            path: SampledPath::at(vec![0.0; N_INTERVALS + 1], n_groups, n_rotations),
            curve: RateCurve::new(N_INTERVALS + 1, n_groups, n_rotations),
            max_rate: 0.0,
            pieces: [Piece::default(); 2],
            position: PathPosition::default(),
        }
    }

    /// Samples the path of a controller by a copy of it.
    pub(super) fn compute(&mut self, controller: &Controller, sampler: &mut Controller, limits: &PathLimits) {
        sampler.clone_from(controller);
        self.pieces = controller.pieces();
        for Piece { first, start, interval } in self.pieces {
            for (i, knot) in self.path.clock[first..].iter_mut().enumerate() {
                *knot = start + interval * i as f64;
            }
        }
        let longest = self.pieces[0].interval.max(self.pieces[1].interval);
        sampler.max_clock_step = longest * (1.0 + 1e-9);
        self.path.sample_turns(limits);
        sampler.sample_path(&mut self.path);
        self.curve.compute_constant(&self.path, limits);
        let rhythmic = controller.primitive.kind() == Kind::Rhythmic;
        let end =
            if rhythmic { self.curve.constant.iter().copied().fold(f64::INFINITY, f64::min) } else { f64::INFINITY };
        self.max_rate = controller.max_rate();
        self.curve.compute(&self.path, limits, end, self.max_rate.powi(2));
        let (clock, RateCurve { constant, max, .. }) = (&self.path.clock, &mut self.curve);
        constant.iter_mut().zip(max).for_each(|(constant, max)| *constant = constant.min(*max));
        for i in 0..constant.len() - 1 {
            let end = clock[i + 1] + controller.max_clock_step;
            let within = (i + 1..constant.len()).take_while(|k| clock[k - 1] <= end);
            constant[i] = within.fold(constant[i], |least, k| least.min(constant[k]));
        }
        self.position = PathPosition { progress: 0.0, is_current: true };
    }

    /// Returns the largest distance of the rest of the path beyond the limits of the position, relative to the ranges.
    pub(super) fn distance_outside(&self, bounds: &[Bounds], groups: &[Group]) -> f64 {
        let (first, _) = self.locate(self.position.progress);
        compute(Outside { path: &self.path, first, bounds, groups })
    }

    /// Returns the interval that contains a progress, and the position in it from 0 to 1, past the end that at its end.
    #[inline(always)]
    fn locate(&self, progress: f64) -> (usize, f64) {
        let piece = &self.pieces[usize::from(progress >= self.pieces[1].start * (1.0 - ROUNDING))];
        let position = (progress - piece.start) / piece.interval + ROUNDING;
        let index = (position as usize).min(N_INTERVALS - 1 - piece.first);
        (piece.first + index, (position - index as f64).min(LAST))
    }

    /// Returns whether the rate of square `x` can be kept constant from the present clock on.
    #[inline(always)]
    pub(super) fn admits_constant(&self, x: f64) -> bool {
        x <= self.curve.constant[self.locate(self.position.progress).0]
    }

    /// Returns the largest ρ² at the present clock.
    pub(super) fn largest_square(&self) -> f64 {
        let (index, t) = self.locate(self.position.progress);
        self.curve.max[index] + self.change(index) * t
    }

    /// Returns the change of the largest ρ² over an interval.
    fn change(&self, index: usize) -> f64 {
        self.curve.max[index + 1] - self.curve.max[index]
    }

    /// Returns the clock until the next knot, infinity past the last one.
    #[inline(always)]
    pub(super) fn rest(&self) -> f64 {
        let (index, _) = self.locate(self.position.progress);
        let rest = self.path.clock[index + 1] - self.position.progress;
        if rest > 0.0 { rest } else { f64::INFINITY }
    }

    /// Returns the smallest and the largest constant ρ̇ to the end of the interval, for ρ² = `x` now, that keep the limits in the
    /// quarters of the interval and arrive below the curve.
    pub(super) fn slopes(&self, x: f64, limits: &PathLimits) -> [f64; 2] {
        let (index, t) = self.locate(self.position.progress);
        self.slopes_within(index, t, x, limits)
    }

    /// Returns the slopes as [`PathAhead::slopes`] at the next knot, for ρ² = `x` there.
    pub(super) fn next_slopes(&self, x: f64, limits: &PathLimits) -> [f64; 2] {
        let (index, _) = self.locate(self.position.progress);
        self.slopes_within((index + 1).min(N_INTERVALS - 1), 0.0, x, limits)
    }

    fn slopes_within(&self, index: usize, t: f64, x: f64, limits: &PathLimits) -> [f64; 2] {
        let [least, most] = compute(Slopes { path: &self.path, limits, index, t, x });
        let (change, gap) = (self.change(index), self.curve.max[index] + self.change(index) * t - x);
        // Below the curve, the filter of the rate does not exceed the rate that the curve was computed for.
        if gap >= 0.0 && self.curve.max[index + 1] >= self.max_rate.powi(2) {
            return [least, most];
        }
        // A rate above the curve, by what the margins allow, returns over an interval even shortly before a knot.
        let arrival = 0.5 * (change + gap / if gap < 0.0 { 1.0 } else { 1.0 - t }) / self.path.interval(index);
        [least, most.min(arrival)]
    }

    /// Adds a clock interval of the phase.
    #[inline(always)]
    pub(super) fn advance(&mut self, h: f64) {
        self.position.progress += h;
    }

    /// Marks the path as left.
    pub(super) fn leave(&mut self) {
        self.position.is_current = false;
    }

    /// Returns whether the path has to be sampled again: for a higher commanded `rate`, when it was left, or at a third of a
    /// rhythmic one.
    pub(super) fn is_due(&self, rate: f64, rhythmic: bool) -> bool {
        let ends = rhythmic && 3.0 * self.intervals() >= N_INTERVALS as f64;
        rate > self.max_rate || ((ends || !self.position.is_current) && self.has_progressed())
    }

    /// Returns whether enough of the path has passed for a new attempt.
    pub(super) fn has_progressed(&self) -> bool {
        self.intervals() >= REFRESH
    }

    fn intervals(&self) -> f64 {
        self.position.progress / self.pieces[0].interval
    }
}

/// Kernel of [`PathAhead::slopes`]: the smallest and the largest ρ̇ from position `t` in interval `index`, for ρ² = `x` there.
struct Slopes<'a> {
    path: &'a SampledPath,
    limits: &'a PathLimits,
    index: usize,
    t: f64,
    x: f64,
}

impl Kernel for Slopes<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<T: Register>(self) -> [f64; 2] {
        let Self { path, limits, index, t, x } = self;
        let interval = path.interval(index);
        // −ρ̇ and ρ̇.
        let (mut ends, mut by_velocity) = ([T::splat(f64::INFINITY); 2], f64::INFINITY);
        for position in [t, 0.25, 0.5, 0.75, 1.0] {
            let since = (position - t) * interval;
            if position <= t + ROUNDING && position != t {
                continue;
            }
            let mut inverse = T::default();
            for ([here, next], limits) in path.ends(index, limits) {
                let Derivatives { slope, bend } =
                    Derivatives::<T>::load(here).between(Derivatives::load(next), interval, position);
                // Near a reversal, where y″ρ² alone reaches the tighter limit, ρ̇ has no effect and must not be driven by it.
                let [tight, wide] = TICK_MARGINS.map(|margin| (1.0 - margin) / (1.0 - MARGINS[1]));
                let limit = T::load(&limits.acceleration);
                let (tight, wide) = (limit * tight, limit * wide);
                let by_bend = bend * x;
                let acceleration = by_bend.abs().fast_max(tight).fast_min(wide);
                let share = T::splat(1.0) / (slope + bend * (2.0 * since));
                let (centre, half) = (by_bend * share, acceleration * share.abs());
                // No number, where a DoF rests, leaves the ends.
                ends = [(centre + half).fast_min(ends[0]), (half - centre).fast_min(ends[1])];
                inverse = inverse.fast_max(limits.of_velocity(slope));
            }
            let mut by_turns = 0.0f64;
            for ([here, next], limits) in path.turns(index, limits) {
                let turn = here.between(&next, interval, position);
                let of_turn = turn_slopes(&turn, limits.acceleration, 2.0 * since, x);
                for (end, of_turn) in ends.iter_mut().zip(of_turn) {
                    // No number, where the rotation rests, leaves the end.
                    *end = T::splat(of_turn).fast_min(*end);
                }
                by_turns = by_turns.max(of_angular_velocity(limits, turn.slope));
            }
            // At the present clock the velocity does not depend on ρ̇.
            if since > 0.0 {
                let rest = (largest(inverse).max(by_turns).recip() - x) * 0.5;
                by_velocity = by_velocity.min((rest / since).max(rest / interval));
            }
        }
        [-ends[0].smallest(), ends[1].smallest().min(by_velocity)]
    }
}

/// Returns minus the smallest and the largest ρ̇ that a limit of the angular acceleration admits for ρ² = `x`. No number is none.
fn turn_slopes(turn: &TurnDerivatives, limit: f64, twice: f64, x: f64) -> [f64; 2] {
    let [beta, along, across] = in_plane(turn, twice);
    let (along, across) = (along * x, across * x);
    // As for a DoF.
    let [tight, wide] = TICK_MARGINS.map(|margin| limit * ((1.0 - margin) / (1.0 - MARGINS[1])));
    if across > wide {
        // No ρ̇ reduces the part across β before the rate has fallen.
        return [f64::INFINITY, 0.0];
    }
    let acceleration = (along * along + across * across).sqrt().max(tight).min(wide);
    let half = ((acceleration - across) * (acceleration + across)).max(0.0).sqrt();
    [half + along, half - along].map(|end| end / beta)
}

/// Kernel of [`PathAhead::distance_outside`], from knot `first` on.
struct Outside<'a> {
    path: &'a SampledPath,
    first: usize,
    bounds: &'a [Bounds],
    groups: &'a [Group],
}

impl Kernel for Outside<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<T: Register>(self) -> f64 {
        let Self { path, first, bounds, groups } = self;
        let (zero, mut farthest) = (T::default(), 0.0f64);
        for (index, (bounds, group)) in bounds.iter().zip(groups).enumerate() {
            let [lower, upper, range] = T::load_all([&bounds.lower, &bounds.upper, &group.range]);
            let mut outside = zero;
            for knot in first..N_INTERVALS {
                let [y, slope, _] = T::load_all(path.knot(knot)[index].each_ref());
                let [next, next_slope, _] = T::load_all(path.knot(knot + 1)[index].each_ref());
                outside = outside.fast_max(next - upper).fast_max(lower - next);
                let turns = (slope * next_slope).simd_lt(zero);
                if turns.to_bitmask() != 0 {
                    let turning = y + slope * slope / (slope - next_slope) * (0.5 * path.interval(knot));
                    let beyond = (turning - upper).fast_max(lower - turning) + range * TURNING;
                    outside = outside.fast_max(turns & beyond);
                }
            }
            farthest = farthest.max(largest(outside / range));
        }
        farthest
    }
}
