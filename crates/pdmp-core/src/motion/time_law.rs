//! Time-optimal time law along a path within limits of velocity and acceleration.
//!
//! The path y(u) of a movement does not depend on the rate ρ = u̇ of its clock, so that ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′. With x = ρ²
//! and a = ρ̇ constant over each interval Δ between knots, x_{i+1} = x_i + 2Δa_i, and the limits are linear in (x, a):
//!
//! ```text
//! |y′| √x ≤ V,    |y″x + y′a| ≤ A at both ends and in the middle of each interval.
//! ```
//!
//! A backward pass computes the largest x from which the rest of the path can be followed, a forward pass takes the largest
//! a that stays below it: O(N·D).
//!
//! H. Pham, Q.-C. Pham, *A new approach to time-optimal path parameterization based on reachability analysis*, IEEE
//! Transactions on Robotics 34(3), 2018.

use crate::numerics::simd::F64x4;
use crate::numerics::state::clone_in_place;

/// Maximum number of Newton steps to a vertex; each removes a limit, and two to five suffice on recordings.
const MAX_NEWTON_STEPS: usize = 64;
/// Number added to β, far below any other: its inverse is finite.
const MIN_BETA: f64 = 1e-200;
/// Number of intervals from a reversal of a DoF within which its limits also hold in the quarters of an interval.
const REVERSAL: f64 = 4.0;

/// Path at knots of the clock.
#[derive(Debug)]
pub(crate) struct SampledPath {
    /// u at the knots, increasing.
    pub(crate) clock: Vec<f64>,
    /// y, y′ and y″ (N + 1, groups of DoFs) by rows.
    pub(crate) samples: Vec<[F64x4; 3]>,
}

clone_in_place!(SampledPath { clock, samples });

impl SampledPath {
    /// Returns a path at knots that has not been sampled yet.
    pub(crate) fn at(clock: Vec<f64>, n_groups: usize) -> Self {
        Self { samples: vec![[F64x4::ZERO; 3]; clock.len() * n_groups], clock }
    }

    /// Returns the samples of all groups at a knot.
    pub(crate) fn knot(&self, index: usize) -> &[[F64x4; 3]] {
        let n_groups = self.samples.len() / self.clock.len();
        &self.samples[index * n_groups..(index + 1) * n_groups]
    }

    /// Returns the length of interval `index`, between this knot and the next.
    pub(crate) fn interval(&self, index: usize) -> f64 {
        self.clock[index + 1] - self.clock[index]
    }

    /// Returns y′ and y″ of all groups within interval `index`, at a position `t` from 0 to 1.
    #[inline(always)]
    pub(crate) fn within(&self, index: usize, t: f64) -> impl Iterator<Item = [F64x4; 2]> {
        let interval = self.interval(index);
        self.knot(index).iter().zip(self.knot(index + 1)).map(move |(here, next)| between(here, next, interval, t))
    }
}

/// Returns y′ and y″ at a position `t` from 0 to 1 between two samples: the cubic Hermite interpolation of y′, and its
/// derivative.
#[inline(always)]
fn between(
    [_, slope, bend]: &[F64x4; 3],
    [_, next_slope, next_bend]: &[F64x4; 3],
    interval: f64,
    t: f64,
) -> [F64x4; 2] {
    let (change, bends) = (*next_slope - *slope, [*bend * interval, *next_bend * interval]);
    // p(t) = y′ + t(b₀ + t(c + td)) with p(1) and p′(1) of the next sample.
    let c = change * 3.0 - bends[0] * 2.0 - bends[1];
    let d = bends[0] + bends[1] - change * 2.0;
    [*slope + (bends[0] + (c + d * t) * t) * t, (bends[0] + (c * 2.0 + d * (3.0 * t)) * t) * interval.recip()]
}

/// Limits of velocity and acceleration of a group, infinite where there are none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RateLimits {
    pub(crate) velocity: F64x4,
    pub(crate) acceleration: F64x4,
}

/// Limits |αx + βa| ≤ A of a group, as −α/β and A/|β|: a lies between slope·x − half and slope·x + half.
#[derive(Clone, Copy, Debug)]
struct Row {
    slope: F64x4,
    half: F64x4,
}

impl Row {
    /// Returns the limits for α = y″ and β = y′ + `twice`·y″.
    #[inline(always)]
    fn new([slope, bend]: [F64x4; 2], limits: &RateLimits, twice: f64) -> Self {
        // For β = 0 the ends become steep lines instead of a bound of x.
        let inverse = F64x4::ONE / (slope + bend * twice + F64x4::splat(MIN_BETA));
        Self { slope: -bend * inverse, half: limits.acceleration * inverse.abs() }
    }
}

/// Line value + slope·x.
type Line = [f64; 2];

/// Largest x = ρ² at each knot of a path.
#[derive(Debug, Default)]
pub(crate) struct RateCurve {
    /// Largest x from which the rest of the path can be followed.
    pub(crate) max: Vec<f64>,
    rows: Vec<Row>,
    /// Largest a at the start of the interval due to the limit of the velocity in its middle.
    middle: Line,
}

impl Clone for RateCurve {
    fn clone(&self) -> Self {
        Self { max: self.max.clone(), rows: Vec::with_capacity(self.rows.capacity()), middle: self.middle }
    }

    fn clone_from(&mut self, source: &Self) {
        self.max.clone_from(&source.max);
    }
}

impl RateCurve {
    /// Returns a curve of `n_knots` knots for a path of `n_groups` groups, to be computed by [`RateCurve::compute`].
    pub(crate) fn new(n_knots: usize, n_groups: usize) -> Self {
        Self { max: vec![0.0; n_knots], rows: Vec::with_capacity(5 * n_groups), middle: [0.0; 2] }
    }

    /// Computes the curve backwards from `end`, which the limits at the last knot reduce; `max` bounds every x.
    pub(crate) fn compute(&mut self, path: &SampledPath, limits: &[RateLimits], end: f64, max: f64) {
        let last = path.clock.len() - 1;
        self.max[last] = end.min(max_constant(path.within(last - 1, 1.0), limits)).min(max);
        for i in (0..last).rev() {
            let twice = 2.0 * path.interval(i);
            let most = self.write_rows(path, limits, i).min(max);
            self.max[i] = self.vertex(most, [[0.0, -1.0 / twice], [self.max[i + 1] / twice, -1.0 / twice]]);
        }
    }

    /// Limits the curve to what can be reached from `start` ≤ max[0]: the time-optimal law.
    pub(crate) fn reach(&mut self, path: &SampledPath, limits: &[RateLimits], start: f64) {
        self.max[0] = start;
        for i in 0..path.clock.len() - 1 {
            let twice = 2.0 * path.interval(i);
            self.write_rows(path, limits, i);
            let x = self.max[i];
            let [_, upper] = self.ends(x);
            let most = upper.min(self.middle[0] + self.middle[1] * x);
            self.max[i + 1] = self.max[i + 1].min(x + twice * most).max(0.0);
        }
    }

    /// Writes the limits of interval `i`; returns the largest x at its start that the limits of the velocity admit.
    fn write_rows(&mut self, path: &SampledPath, limits: &[RateLimits], i: usize) -> f64 {
        let interval = path.interval(i);
        let [mut most, mut in_middle] = [F64x4::splat(f64::INFINITY); 2];
        self.rows.clear();
        for ((here, next), limits) in path.knot(i).iter().zip(path.knot(i + 1)).zip(limits) {
            let middle = between(here, next, interval, 0.5);
            let [rate, middle_rate] = [here[1], middle[0]].map(|slope| limits.velocity / slope.abs());
            (most, in_middle) = (most.fast_min(rate * rate), in_middle.fast_min(middle_rate * middle_rate));
            self.rows.push(Row::new([here[1], here[2]], limits, 0.0));
            self.rows.push(Row::new(middle, limits, interval));
            self.rows.push(Row::new([next[1], next[2]], limits, 2.0 * interval));
            // Near a reversal of a DoF its acceleration hardly depends on a, and varies most within the interval.
            let (slowest, bend) = (here[1].abs().fast_min(next[1].abs()), here[2].abs().fast_max(next[2].abs()));
            if slowest.simd_lt(bend * (REVERSAL * interval)).any() {
                for t in [0.25, 0.75] {
                    self.rows.push(Row::new(between(here, next, interval, t), limits, 2.0 * t * interval));
                }
            }
        }
        self.middle = [smallest(in_middle) / interval, -interval.recip()];
        smallest(most)
    }

    /// Returns the largest lower and the smallest upper end of a for a given x.
    #[inline(always)]
    fn ends(&self, x: f64) -> [f64; 2] {
        let mut upper = F64x4::splat(f64::INFINITY);
        let mut lower = -upper;
        for row in &self.rows {
            let centre = row.slope * x;
            (lower, upper) = (lower.fast_max(centre - row.half), upper.fast_min(centre + row.half));
        }
        [-smallest(-lower), smallest(upper)]
    }

    /// Returns the slope of the row whose lower (`side` −1) or upper (1) end has a given value at x.
    fn slope_of(&self, value: f64, x: f64, side: f64) -> f64 {
        let ends = self.rows.iter().flat_map(|row| {
            let end = row.slope * x + row.half * side;
            end.to_array().into_iter().zip(row.slope.to_array())
        });
        ends.into_iter().find(|(end, _)| *end == value).map_or(0.0, |(_, slope)| slope)
    }

    /// Returns the largest x up to `most` for which some a lies within all rows and between the lines `next`.
    ///
    /// The gap between the smallest upper and the largest lower end is concave in x and not negative at 0, so that Newton's
    /// method from above reaches its zero in finitely many steps.
    fn vertex(&self, most: f64, next: [Line; 2]) -> f64 {
        let mut x = most;
        for _ in 0..MAX_NEWTON_STEPS {
            let [lower, upper] = self.ends(x);
            let [least, arrival, middle] =
                [next[0], next[1], self.middle].map(|[value, slope]| [value + slope * x, slope]);
            let line = if middle[0] < arrival[0] { middle } else { arrival };
            let gap = upper.min(line[0]) - lower.max(least[0]);
            if gap >= 0.0 {
                break;
            }
            let upper_slope = if line[0] <= upper { line[1] } else { self.slope_of(upper, x, 1.0) };
            let lower_slope = if least[0] >= lower { least[1] } else { self.slope_of(lower, x, -1.0) };
            let crossing = x + gap / (lower_slope - upper_slope);
            if crossing >= x || crossing.is_nan() {
                break;
            }
            x = crossing.max(0.0);
        }
        x
    }
}

/// Returns the largest x with a = 0 that the limits admit at y′ and y″ of all groups.
#[inline(always)]
pub(crate) fn max_constant(derivatives: impl Iterator<Item = [F64x4; 2]>, limits: &[RateLimits]) -> f64 {
    let most = derivatives.zip(limits).fold(F64x4::splat(f64::INFINITY), |most, ([slope, bend], limits)| {
        let rate = limits.velocity / slope.abs();
        most.fast_min(rate * rate).fast_min(limits.acceleration / bend.abs())
    });
    smallest(most)
}

/// Returns the smallest lane.
#[inline(always)]
fn smallest(lanes: F64x4) -> f64 {
    let [a, b, c, d] = lanes.to_array();
    a.min(b).min(c.min(d))
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
    pub(crate) fn new(clock: Vec<f64>, x: &[f64]) -> Self {
        let rate: Vec<f64> = x.iter().map(|x| x.sqrt()).collect();
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

    /// Returns u, u̇ and ü at time `t`; past the end, those of the end.
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let last = self.time.len() - 2;
        let i = self.time.partition_point(|knot| *knot <= t).saturating_sub(1).min(last);
        let length = self.time[i + 1] - self.time[i];
        let a = (self.rate[i + 1] - self.rate[i]) / length;
        let since = (t - self.time[i]).clamp(0.0, length);
        let u = self.clock[i] + (self.rate[i] + 0.5 * a * since) * since;
        [u, self.rate[i] + a * since, if t <= self.duration() { a } else { 0.0 }]
    }
}
