//! Limits of velocity and acceleration on the rate of the clock along a path, as rows that are linear in x = ρ² and a = ρ̇; see
//! `time_law`.

use crate::motion::angular::AngularLimits;
use crate::motion::sampled_path::{Derivatives, SampledPath, TurnDerivatives};
use crate::numerics::rotation::{cross, dot};
use crate::numerics::simd::{F64x4, Register};
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
    pub(super) fn of_constant<T: Register>(&self, Derivatives { slope, bend }: Derivatives<T>) -> T {
        self.of_velocity(slope).fast_max((bend * T::load(&self.inverse[1])).abs())
    }
}

/// Limits along a path.
#[derive(Debug, Default)]
pub(crate) struct PathLimits {
    pub(crate) groups: Vec<RateLimits>,
    /// Limits of the rotations, empty for a primitive without.
    pub(crate) rotations: Vec<AngularLimits>,
}

clone_in_place!(PathLimits { groups, rotations });

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
pub(super) fn of_constant_turn(limits: &AngularLimits, TurnDerivatives { slope, bend }: &TurnDerivatives) -> f64 {
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
        let mut rows = [Self { slope: T::default(), half: T::default() }; SIDE_GROUPS];
        for (row, [cosine, sine]) in rows.iter_mut().zip(NORMALS) {
            let (cosine, sine) = (T::load(&F64x4::new(cosine)), T::load(&F64x4::new(sine)));
            let side = Derivatives { slope: cosine * beta, bend: cosine * along + sine * across };
            *row = Self::new(side, T::splat(SIDE * acceleration), 0.0);
        }
        rows
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
pub(super) struct IntervalLimits {
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
    /// Returns memory for the limits of a path of groups and rotations.
    pub(super) fn new(n_groups: usize, n_rotations: usize) -> Self {
        let none = Row { slope: F64x4::ZERO, half: F64x4::ZERO };
        Self { rows: vec![none; MAX_ROWS * n_groups + MAX_TURN_ROWS * n_rotations], ..Self::default() }
    }

    /// Visits the rows of interval `i`, and computes the limits of the velocity.
    #[inline(always)]
    fn visit<T: Register>(&mut self, path: &SampledPath, limits: &PathLimits, i: usize, mut visit: impl FnMut(Row<T>)) {
        let interval = path.interval(i);
        let [mut at_start, mut in_middle] = [T::default(); 2];
        for (ends, limits) in path.ends(i, limits) {
            let ([here, next], acceleration) = (Derivatives::<T>::load_both(ends), T::load(&limits.acceleration));
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
            visit_turn(&here, limits.acceleration, 0.0, &mut visit);
            visit_turn(&middle, limits.acceleration, interval, &mut visit);
            visit_turn(&next, limits.acceleration, 2.0 * interval, &mut visit);
            let [slopes, bends] =
                [[here.slope, next.slope], [here.bend, next.bend]].map(|ends| ends.map(|v| dot(v, v).sqrt()));
            if bends[0].max(bends[1]) * (REVERSAL * interval) > slopes[0].min(slopes[1]) {
                let (first, last) = (here.between(&next, interval, 0.25), here.between(&next, interval, 0.75));
                visit_turn(&first, limits.acceleration, 0.5 * interval, &mut visit);
                visit_turn(&last, limits.acceleration, 1.5 * interval, &mut visit);
            }
        }
        self.most = largest(at_start).max(by_turns[0]).recip();
        self.middle = [(largest(in_middle).max(by_turns[1]) * interval).recip(), -interval.recip()];
    }

    /// Computes the limits of interval `i`.
    #[inline(always)]
    pub(super) fn compute<T: Register>(&mut self, path: &SampledPath, limits: &PathLimits, i: usize) {
        let (mut rows, mut n_rows) = (std::mem::take(&mut self.rows), 0);
        self.visit(path, limits, i, |Row::<T> { slope, half }| {
            rows[n_rows] = Row { slope: slope.store(), half: half.store() };
            n_rows += 1;
        });
        (self.rows, self.n_rows) = (rows, n_rows);
    }

    /// Returns the largest a of interval `i` for a given x at its start.
    #[inline(always)]
    pub(super) fn largest_slope<T: Register>(
        &mut self,
        path: &SampledPath,
        limits: &PathLimits,
        i: usize,
        x: f64,
    ) -> f64 {
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
    pub(super) fn largest_from<T: Register>(&self, next: f64, twice: f64, max: f64) -> (f64, bool) {
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

/// Visits the rows of a rotation.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // See `Kernel`.
fn visit_turn<T: Register>(turn: &TurnDerivatives, acceleration: f64, twice: f64, visit: &mut impl FnMut(Row<T>)) {
    let rows = Row::of_turn(turn, acceleration, twice);
    for i in 0..SIDE_GROUPS {
        visit(rows[i]);
    }
}

/// Returns the largest lane.
#[inline(always)]
pub(crate) fn largest<T: Register>(lanes: T) -> f64 {
    -(-lanes).smallest()
}
