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

use crate::motion::angular::AngularLimits;
use crate::motion::sampled_path::{Derivatives, SampledPath, TurnDerivatives};
use crate::numerics::rotation::{cross, dot};
use crate::numerics::simd::{F64x4, Kernel, Register, compute};
use crate::numerics::state::clone_in_place;

/// Maximum number of Newton steps to a vertex; each removes a limit, and two to five suffice on recordings.
const MAX_NEWTON_STEPS: usize = 64;
/// Number added to β, far below any other: its inverse is finite.
const MIN_BETA: f64 = 1e-200;
/// Maximum number of rows of an interval for each group.
const MAX_ROWS: usize = 5;
/// Number of groups of four sides of the polygon for a rotation.
const SIDE_GROUPS: usize = 2;
/// Maximum number of rows of an interval for each rotation.
const MAX_TURN_ROWS: usize = SIDE_GROUPS * MAX_ROWS;
/// Cosine and sine of the normals of the sides, at odd multiples of π/16: ω′ points to a corner.
const NORMALS: [[[f64; 4]; 2]; SIDE_GROUPS] = [
    [
        [0.980_785_280_403_230_4, 0.831_469_612_302_545_2, 0.555_570_233_019_602_2, 0.195_090_322_016_128_27],
        [0.195_090_322_016_128_27, 0.555_570_233_019_602_2, 0.831_469_612_302_545_2, 0.980_785_280_403_230_4],
    ],
    [
        [-0.195_090_322_016_128_27, -0.555_570_233_019_602_2, -0.831_469_612_302_545_2, -0.980_785_280_403_230_4],
        [0.980_785_280_403_230_4, 0.831_469_612_302_545_2, 0.555_570_233_019_602_2, 0.195_090_322_016_128_27],
    ],
];
/// Distance of the sides from the centre of a circle of radius 1, cos(π/16).
const SIDE: f64 = 0.980_785_280_403_230_4;
/// Number of intervals from a reversal of a DoF within which its limits also hold in the quarters of an interval.
const REVERSAL: f64 = 4.0;

/// Limits of velocity and acceleration of a group, infinite where there are none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RateLimits {
    pub(crate) acceleration: F64x4,
    /// Inverses of the limits of velocity and acceleration.
    inverse: [F64x4; 2],
}

impl RateLimits {
    pub(crate) fn new(velocity: F64x4, acceleration: F64x4) -> Self {
        // The inverse of the smallest numbers is infinite, and no factor of zero.
        let inverse = |limit: F64x4| (F64x4::ONE / limit).fast_min(F64x4::splat(f64::MAX));
        Self { acceleration, inverse: [velocity, acceleration].map(inverse) }
    }

    /// Returns the inverse of the largest x = ρ² that the limit of the velocity admits.
    #[inline(always)]
    pub(crate) fn of_velocity<T: Register>(&self, slope: T) -> T {
        let ratio = slope * T::load(&self.inverse[0]);
        ratio * ratio
    }

    /// Returns the inverse of the largest x with a = 0 that both limits admit.
    #[inline(always)]
    fn of_constant<T: Register>(&self, Derivatives { slope, bend }: Derivatives<T>) -> T {
        self.of_velocity(slope).fast_max((bend * T::load(&self.inverse[1])).abs())
    }
}

/// Limits along a path.
#[derive(Clone, Debug, Default)]
pub(crate) struct PathLimits {
    pub(crate) groups: Vec<RateLimits>,
    /// Limits of the rotations, empty for a primitive without.
    pub(crate) rotations: Vec<AngularLimits>,
}

impl PathLimits {
    /// Returns whether a rotation has limits.
    pub(crate) fn have_rotations(&self) -> bool {
        self.rotations.iter().any(AngularLimits::are_finite)
    }
}

/// Returns the inverse of the largest x = ρ² that the limit of an angular velocity admits.
#[inline(always)]
pub(crate) fn of_angular_velocity(limits: &AngularLimits, slope: [f64; 3]) -> f64 {
    dot(slope, slope) / (limits.velocity * limits.velocity)
}

/// Returns the inverse of the largest x with a = 0 that both limits of a rotation admit.
#[inline(always)]
fn of_constant_turn(limits: &AngularLimits, TurnDerivatives { slope, bend }: &TurnDerivatives) -> f64 {
    of_angular_velocity(limits, *slope).max(dot(*bend, *bend).sqrt() / limits.acceleration)
}

/// Returns |β|, α along β and α across it, for α = ω″ and β = ω′ + `twice`·ω″.
#[inline(always)]
pub(crate) fn in_plane(TurnDerivatives { slope, bend }: &TurnDerivatives, twice: f64) -> [f64; 3] {
    let beta: [f64; 3] = std::array::from_fn(|i| slope[i] + twice * bend[i]);
    let (length, across) = (dot(beta, beta).sqrt(), cross(*bend, beta));
    if length > 0.0 {
        [length, dot(*bend, beta) / length, dot(across, across).sqrt() / length]
    } else {
        [0.0, 0.0, dot(*bend, *bend).sqrt()]
    }
}

/// Limits |αx + βa| ≤ A of a group, as −α/β and A/|β|: a lies between slope·x − half and slope·x + half.
#[derive(Clone, Copy, Debug)]
struct Row<T> {
    slope: T,
    half: T,
}

impl<T: Register> Row<T> {
    /// Returns the limits for α = y″ and β = y′ + `twice`·y″.
    #[inline(always)]
    fn new(Derivatives { slope, bend }: Derivatives<T>, acceleration: T, twice: f64) -> Self {
        // For β = 0 the ends become steep lines instead of a bound of x.
        let inverse = T::splat(1.0) / (slope + bend * twice + T::splat(MIN_BETA));
        Self { slope: -bend * inverse, half: acceleration * inverse.abs() }
    }

    /// Returns the limits of a rotation as those of the sides of the polygon.
    #[inline(always)]
    fn of_turn(turn: &TurnDerivatives, acceleration: f64, twice: f64) -> [Self; SIDE_GROUPS] {
        let [beta, along, across] = in_plane(turn, twice);
        NORMALS.map(|[cosine, sine]| {
            let [cosine, sine] = [cosine, sine].map(|x| T::load(&F64x4::new(x)));
            let side = Derivatives { slope: cosine * beta, bend: cosine * along + sine * across };
            Self::new(side, T::splat(SIDE * acceleration), 0.0)
        })
    }

    #[inline(always)]
    fn load(row: &Row<F64x4>) -> Self {
        Self { slope: T::load(&row.slope), half: T::load(&row.half) }
    }

    /// Returns the upper ends of a for a given x. The lower ends at x are minus the upper ones at −x.
    #[inline(always)]
    fn upper(&self, x: f64) -> T {
        self.slope * x + self.half
    }
}

/// Line value + slope·x.
type Line = [f64; 2];

/// Limits of one interval.
#[derive(Debug, Default)]
struct IntervalLimits {
    /// Memory of five rows for each group, and of ten for each rotation.
    rows: Vec<Row<F64x4>>,
    n_rows: usize,
    /// Largest x at the start due to the limits of the velocity there.
    most: f64,
    /// Largest a at the start due to the limits of the velocity in the middle.
    middle: Line,
}

clone_in_place!(IntervalLimits { rows, n_rows, most, middle });

impl IntervalLimits {
    /// Visits the rows of interval `i`, and computes the limits of the velocity.
    #[inline(always)]
    fn visit<T: Register>(&mut self, path: &SampledPath, limits: &PathLimits, i: usize, mut visit: impl FnMut(Row<T>)) {
        let interval = path.interval(i);
        let [mut at_start, mut in_middle] = [T::default(); 2];
        for (ends, limits) in path.ends(i, limits) {
            let ([here, next], acceleration) = (ends.map(Derivatives::<T>::load), T::load(&limits.acceleration));
            let middle = here.between(next, interval, 0.5);
            at_start = at_start.fast_max(limits.of_velocity(here.slope));
            in_middle = in_middle.fast_max(limits.of_velocity(middle.slope));
            visit(Row::new(here, acceleration, 0.0));
            visit(Row::new(middle, acceleration, interval));
            visit(Row::new(next, acceleration, 2.0 * interval));
            // Near a reversal of a DoF its acceleration hardly depends on a, and varies most within the interval.
            let (slowest, bend) =
                (here.slope.abs().fast_min(next.slope.abs()), here.bend.abs().fast_max(next.bend.abs()));
            if !(bend * (REVERSAL * interval)).simd_le(slowest).all() {
                visit(Row::new(here.between(next, interval, 0.25), acceleration, 0.5 * interval));
                visit(Row::new(here.between(next, interval, 0.75), acceleration, 1.5 * interval));
            }
        }
        let mut by_turns = [0.0f64; 2];
        for ([here, next], limits) in path.turns(i, limits) {
            let middle = here.between(&next, interval, 0.5);
            let at = [&here, &middle].map(|turn| of_angular_velocity(limits, turn.slope));
            by_turns = [by_turns[0].max(at[0]), by_turns[1].max(at[1])];
            let mut visit_turn = |turn: &TurnDerivatives, twice: f64| {
                Row::of_turn(turn, limits.acceleration, twice).into_iter().for_each(&mut visit);
            };
            visit_turn(&here, 0.0);
            visit_turn(&middle, interval);
            visit_turn(&next, 2.0 * interval);
            let [slopes, bends] =
                [[here.slope, next.slope], [here.bend, next.bend]].map(|ends| ends.map(|v| dot(v, v).sqrt()));
            if bends[0].max(bends[1]) * (REVERSAL * interval) > slopes[0].min(slopes[1]) {
                visit_turn(&here.between(&next, interval, 0.25), 0.5 * interval);
                visit_turn(&here.between(&next, interval, 0.75), 1.5 * interval);
            }
        }
        self.most = largest(at_start).max(by_turns[0]).recip();
        self.middle = [(largest(in_middle).max(by_turns[1]) * interval).recip(), -interval.recip()];
    }

    /// Computes the limits of interval `i`.
    #[inline(always)]
    fn compute<T: Register>(&mut self, path: &SampledPath, limits: &PathLimits, i: usize) {
        let (mut rows, mut n_rows) = (std::mem::take(&mut self.rows), 0);
        self.visit(path, limits, i, |Row::<T> { slope, half }| {
            rows[n_rows] = Row { slope: slope.store(), half: half.store() };
            n_rows += 1;
        });
        (self.rows, self.n_rows) = (rows, n_rows);
    }

    /// Returns the largest a of interval `i` for a given x at its start.
    #[inline(always)]
    fn largest_slope<T: Register>(&mut self, path: &SampledPath, limits: &PathLimits, i: usize, x: f64) -> f64 {
        let mut upper = T::splat(f64::INFINITY);
        self.visit(path, limits, i, |row| upper = upper.fast_min(row.upper(x)));
        upper.smallest().min(self.middle[0] + self.middle[1] * x)
    }

    /// Returns the largest lower and the smallest upper end of a for a given x.
    #[inline(always)]
    fn ends<T: Register>(&self, x: f64) -> [f64; 2] {
        let [mut lower, mut upper] = [T::splat(f64::INFINITY); 2];
        for row in &self.rows[..self.n_rows] {
            let row = Row::<T>::load(row);
            (lower, upper) = (lower.fast_min(row.upper(-x)), upper.fast_min(row.upper(x)));
        }
        [-lower.smallest(), upper.smallest()]
    }

    /// Returns the slope of the row whose upper end at x is `upper`, the smallest one.
    #[inline(always)]
    fn slope_of<T: Register>(&self, upper: f64, x: f64) -> f64 {
        for row in &self.rows[..self.n_rows] {
            let is_smallest = Row::<T>::load(row).upper(x).simd_le(T::splat(upper)).to_bitmask();
            if is_smallest != 0 {
                return row.slope.as_array()[is_smallest.trailing_zeros() as usize];
            }
        }
        0.0
    }

    /// Returns the largest x up to `max` from which some a within the limits leads to at most `next` at the end of an interval of
    /// half the length `twice`, and whether one leads to `next`.
    ///
    /// The gap between the smallest upper and the largest lower end is concave in x and not negative at 0. Newton's method begins
    /// at `next`: the first step leads to its zero or past it, and from there finitely many steps lead back.
    #[inline(always)]
    fn largest_from<T: Register>(&self, next: f64, twice: f64, max: f64) -> (f64, bool) {
        let per_twice = twice.recip();
        let most = self.most.min(max);
        let (mut x, mut leads) = (next.min(most), false);
        for step in 0..MAX_NEWTON_STEPS {
            let [lower, upper] = self.ends::<T>(x);
            let (least, arrival) = (-x * per_twice, (next - x) * per_twice);
            let middle = self.middle[0] + self.middle[1] * x;
            leads = arrival <= middle.min(upper);
            let line = if arrival <= middle { [arrival, -per_twice] } else { [middle, self.middle[1]] };
            let gap = upper.min(line[0]) - lower.max(least);
            if gap >= 0.0 && (step > 0 || x >= most) {
                break;
            }
            let upper_slope = if line[0] <= upper { line[1] } else { self.slope_of::<T>(upper, x) };
            let lower_slope = if least >= lower { -per_twice } else { self.slope_of::<T>(-lower, -x) };
            let (crossing, closes) = (x + gap / (lower_slope - upper_slope), lower_slope > upper_slope);
            if gap >= 0.0 {
                x = if closes { crossing.min(most) } else { most };
            } else if closes && crossing < x {
                x = crossing.max(0.0);
            } else {
                break;
            }
        }
        (x, leads)
    }
}

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
        let none = Row { slope: F64x4::ZERO, half: F64x4::ZERO };
        let n_rows = MAX_ROWS * n_groups + MAX_TURN_ROWS * n_rotations;
        let interval = IntervalLimits { rows: vec![none; n_rows], ..IntervalLimits::default() };
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

/// Returns the largest lane.
#[inline(always)]
pub(crate) fn largest<T: Register>(lanes: T) -> f64 {
    -(-lanes).smallest()
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
                let [here, next] = ends.map(Derivatives::<T>::load);
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
