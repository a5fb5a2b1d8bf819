//! Viability of a DoF inside its limits: the states from which it can still brake.
//!
//! With limits l ≤ y ≤ u and |ẏ| ≤ V and a deceleration B, a state can be braked to rest inside the limits if and only if
//!
//! ```text
//! |ẏ| ≤ V,    max(ẏ, 0)² ≤ 2B(u − y),    max(−ẏ, 0)² ≤ 2B(y − l).
//! ```
//!
//! B is the limit A of |ÿ|, or less where A would turn a DoF round within a tick: V/2Δt or (u − l)/Δt². The set is viable in
//! continuous time, and hence for any sequence of tick lengths up to Δt. [`Bounds::interval`] are the constant accelerations
//! over a tick of length h that end inside it and do not leave the limits on the way. At a distance d from the upper limit, the
//! largest is
//!
//! ```text
//! d ≥ hẏ/2:  [−ẏ − Bh/2 + ½√(B²h² + 8Bd − 4Bhẏ)]/h     the end lies on the boundary of the set
//! d < hẏ/2:  −ẏ²/(2d)                                    the DoF turns round at the limit within the tick
//! ```
//!
//! and at most (V − ẏ)/h and A. It follows A. Del Prete, *Joint position and velocity bounds in discrete-time acceleration
//! or torque control of robot manipulators*, IEEE RA-L 3(1), 2018. A DoF beyond the limit returns to it: its velocity is at
//! most −√(B|d|), which half of B brakes to rest at the limit, and at most V in magnitude.

use crate::motion::limits::Limit;
use crate::numerics::simd::{F64x4, Register};

/// Shortest length of a tick in seconds whose accelerations are finite. What a longer tick may do, a shorter one may too.
pub(crate) const MIN_TICK: f64 = 1e-100;
/// Share of ẏ² that is rounding.
const ROUNDING: f64 = 1e-9;

/// Limits of a group of DoFs, infinite where there are none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) lower: F64x4,
    pub(crate) upper: F64x4,
    pub(crate) velocity: F64x4,
    pub(crate) acceleration: F64x4,
    /// Deceleration B in front of the limits of the position.
    pub(crate) braking: F64x4,
}

impl Bounds {
    /// Returns the lanes in which a tick of length `h` keeps the limits and ends in a viable state, where `from` and `to` are
    /// position and velocity at its ends, and `acceleration` that at the end. Between them the cubic through both, by which a
    /// robot interpolates, keeps the limits of the position.
    #[inline(always)]
    pub(crate) fn admits<T: Register>(&self, from: [T; 2], to: [T; 2], acceleration: T, h: f64) -> T {
        let ([[y, v], [y_end, v_end]], zero) = ([from, to], T::default());
        let [lower, upper, max_velocity, max_acceleration, braking] =
            T::load_all([&self.lower, &self.upper, &self.velocity, &self.acceleration, &self.braking]);
        let (above, below) = (upper - y_end, y_end - lower);
        let (square, twice) = (v_end * v_end.abs(), braking * 2.0);
        let kept = (v_end - v).abs().simd_le(max_acceleration * h)
            & acceleration.abs().simd_le(max_acceleration)
            & v_end.abs().simd_le(max_velocity)
            & square.simd_le(twice * above)
            & (-square).simd_le(twice * below)
            & zero.simd_le(above)
            & zero.simd_le(below);
        // Within both limits, the DoF can move by this distance.
        let rounding = y_end.abs() * (4.0 * f64::EPSILON);
        let way = y_end - y;
        let detour = (way - (v + v_end) * (0.5 * h)).abs();
        let kept = kept
            & (way.abs() - rounding).simd_le(max_velocity * h)
            & (detour - rounding).simd_le(max_acceleration * h * (0.25 * h));
        // The cubic lies between the least and the greatest of its Bézier points.
        let (first, last) = (y + v * (h / 3.0), y_end - v_end * (h / 3.0));
        if (first.fast_max(last).simd_le(upper) & lower.simd_le(first.fast_min(last))).all() {
            return kept;
        }
        let [least, greatest] = extremes([y.store(), v.store()], [y_end.store(), v_end.store()], h);
        kept & T::load(&greatest).simd_le(upper) & lower.simd_le(T::load(&least))
    }

    /// Returns the lanes in which the velocity may change to `to` at once: those where it does not change, or where its change
    /// has no limit and the new one can brake.
    pub(crate) fn admits_change(&self, y: F64x4, from: F64x4, to: F64x4) -> F64x4 {
        let (ahead, behind) = (to.max(F64x4::ZERO), (-to).max(F64x4::ZERO));
        let kept = self.acceleration.simd_eq(F64x4::splat(f64::INFINITY))
            & to.abs().simd_le(self.velocity)
            & (ahead * ahead).simd_le(self.braking * 2.0 * (self.upper - y))
            & (behind * behind).simd_le(self.braking * 2.0 * (y - self.lower));
        kept | to.simd_eq(from)
    }

    /// Returns the constant accelerations over a tick of length `h` that keep the limits and end in a viable state.
    pub(crate) fn interval(&self, y: F64x4, v: F64x4, h: f64) -> Interval {
        let h = h.max(MIN_TICK);
        let distances = [y - self.lower, self.upper - y];
        let position = [-self.max_acceleration(distances[0], -v, h), self.max_acceleration(distances[1], v, h)];
        let broken = [self.cannot_brake(distances[0], -v), self.cannot_brake(distances[1], v)];
        let velocity = [(-self.velocity - v) * (1.0 / h), (self.velocity - v) * (1.0 / h)];
        Interval { position, broken, velocity, acceleration: self.acceleration, to_rest: v * (-1.0 / h) }
    }

    /// Returns the lanes that at a distance `d` and a velocity `v` towards a limit are beyond it, or cannot brake in front of it.
    fn cannot_brake(&self, d: F64x4, v: F64x4) -> F64x4 {
        let ahead = v.max(F64x4::ZERO);
        (ahead * ahead * (1.0 - ROUNDING)).simd_gt(self.braking * d * 2.0)
    }

    /// Returns the largest acceleration over `h` at a distance `d` from the upper limit and a velocity `v` towards it.
    fn max_acceleration(&self, d: F64x4, v: F64x4, h: f64) -> F64x4 {
        let (braking, infinity) = (self.braking, F64x4::splat(f64::INFINITY));
        let ah = braking * h;
        let root = (ah * ah + braking * d * 8.0 - ah * v * 4.0).max(F64x4::ZERO).sqrt();
        let arriving = (root * 0.5 - v - ah * 0.5) * (1.0 / h);
        // A state that cannot brake, at the start or after limits that shrink, would turn round ever harder close to the limit.
        let hardest = self.acceleration.simd_lt(infinity).select(self.acceleration, braking);
        let turning = (-(v * v) / (d * 2.0)).max(-v * (1.0 / h) - hardest);
        let returning = (-(-braking * d).max(F64x4::ZERO).sqrt() - v) * (1.0 / h);
        let inside = (d * 2.0).simd_ge(v * h).select(arriving, turning);
        let finite = d.simd_lt(infinity).select(inside, infinity);
        d.simd_ge(F64x4::ZERO).select(finite, returning)
    }
}

/// Accelerations that keep the limits over a tick, from the smallest to the largest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    /// Ends due to the limits of the position.
    position: [F64x4; 2],
    /// Lanes in which the lower and the upper limit of the position cannot be kept.
    broken: [F64x4; 2],
    /// Ends due to the limit of the velocity.
    velocity: [F64x4; 2],
    /// Limit of the acceleration.
    acceleration: F64x4,
    /// Acceleration that ends in rest.
    to_rest: F64x4,
}

impl Interval {
    /// Returns the smallest and the largest acceleration.
    fn ends(&self) -> [F64x4; 2] {
        let within = |bound: F64x4| bound.max(-self.acceleration).min(self.acceleration);
        let [slowest, fastest] = self.velocity.map(within);
        let [least, most] = self.position.map(|bound| bound.max(slowest).min(fastest));
        // A limit of the position that cannot be kept gives way to the other one. Between two of them a DoF stops.
        let (lesser, greater) = (least.min(most), least.max(most));
        let rest = self.to_rest.max(lesser).min(greater);
        let neither = self.broken[0] & self.broken[1] & most.simd_lt(least);
        [
            neither.select(rest, self.broken[0].select(lesser, least)),
            neither.select(rest, self.broken[1].select(greater, most)),
        ]
    }

    /// Returns the acceleration closest to the wanted one.
    pub(crate) fn nearest(&self, wanted: F64x4) -> F64x4 {
        let [least, most] = self.ends();
        wanted.max(least).min(most)
    }

    /// Returns the limit that determines the acceleration of one DoF. Inside the interval it is that of the acceleration if
    /// the acceleration at the end of the tick exceeds it, and otherwise that of the position, beyond which the DoF turns round
    /// within the tick, or without one that of the velocity, which the mean over the tick exceeds.
    pub(crate) fn limit(&self, wanted: F64x4, at_end: F64x4, lane: usize) -> Limit {
        let [least, most] = self.ends();
        let (side, sign) = if (wanted.as_array()[lane]) > most.as_array()[lane] {
            (1, 1.0)
        } else if wanted.as_array()[lane] < least.as_array()[lane] {
            (0, -1.0)
        } else if at_end.as_array()[lane].abs() > self.acceleration.as_array()[lane] {
            return Limit::Acceleration;
        } else if self.position.iter().any(|end| end.as_array()[lane].is_finite()) {
            return Limit::Position;
        } else {
            return Limit::Velocity;
        };
        let [position, velocity] = [self.position, self.velocity].map(|ends| sign * ends[side].as_array()[lane]);
        let acceleration = self.acceleration.as_array()[lane];
        if position <= velocity.min(acceleration) {
            Limit::Position
        } else if velocity <= acceleration {
            Limit::Velocity
        } else {
            Limit::Acceleration
        }
    }
}

/// Returns the least and the greatest position on the cubic between two states.
pub(crate) fn extremes(from: [F64x4; 2], to: [F64x4; 2], h: f64) -> [F64x4; 2] {
    let [[y, v], [y_end, v_end]] = [from, to];
    // hẏ(s) = hv + bs + cs² with s = t/h.
    let (start, end, change) = (v * h, v_end * h, y_end - y);
    let b = change * 6.0 - start * 4.0 - end * 2.0;
    let c = (start + end - change * 2.0) * 3.0;
    // This sum avoids cancellation: one root is q/c, the other one hv/q.
    let root = (b * b - c * start * 4.0).max(F64x4::ZERO).sqrt();
    let q = (b + b.simd_lt(F64x4::ZERO).select(-root, root)) * -0.5;
    let mut extremes = [y.min(y_end), y.max(y_end)];
    for s in [q / c, start / q] {
        let is_inside = s.simd_gt(F64x4::ZERO) & s.simd_lt(F64x4::splat(1.0));
        let turning = y + (start + (b * 0.5 + c * s * (1.0 / 3.0)) * s) * s;
        let turning = is_inside.select(turning, y);
        extremes = [extremes[0].min(turning), extremes[1].max(turning)];
    }
    extremes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn lanes(random: &mut Random, number: impl Fn(f64) -> f64) -> F64x4 {
        F64x4::new([(); 4].map(|()| number(random.next())))
    }

    /// Any sequence of wanted accelerations and tick lengths keeps every limit, between ticks too, and leaves an interval.
    #[test]
    fn clamped_motion_keeps_the_limits() {
        let mut random = Random(1);
        let mut ticks = 0;
        for case in 0..400 {
            let acceleration = lanes(&mut random, |x| 10f64.powf(4.0 * x - 1.0));
            let velocity = lanes(&mut random, |x| 10f64.powf(2.0 * x - 1.0));
            // The longest tick takes half of the velocity's limit.
            let shortest = (velocity * 0.5 / acceleration).to_array().into_iter().fold(0.1, f64::min);
            let free = case % 4 == 3;
            let lower = lanes(&mut random, |x| -x);
            let range =
                lanes(&mut random, |x| 10f64.powf(3.0 * x - 2.0)).max(acceleration * (2.0 * shortest * shortest));
            let braking = acceleration;
            let acceleration = if free { F64x4::splat(f64::INFINITY) } else { acceleration };
            let bounds = Bounds { lower, upper: lower + range, velocity, acceleration, braking };
            let (mut y, mut v) = (lower + range * lanes(&mut random, |x| x), F64x4::ZERO);
            for _ in 0..2000 {
                let h = shortest * 10f64.powf(-4.0 * random.next() * f64::from(case % 2));
                let interval = bounds.interval(y, v, h);
                let [least, most] = interval.ends();
                assert!(least.simd_le(most).all(), "{bounds:?} {y} {v} {h}");
                let size = if free { 1.0 } else { 10f64.powf(6.0 * random.next() - 3.0) };
                let scale = if free { velocity * (1.0 / h) } else { bounds.acceleration };
                let wanted = (lanes(&mut random, |x| 2.0 * x - 1.0) + F64x4::splat(random.next() - 0.5)) * scale * size;
                let a = interval.nearest(wanted);
                let next = [y + v * h + a * (0.5 * h * h), v + a * h];
                let tolerance = range * 1e-12;
                for position in extremes([y, v], next, h) {
                    assert!(position.simd_le(bounds.upper + tolerance).all(), "{bounds:?} {y} {v} {h} {a}");
                    assert!(position.simd_ge(bounds.lower - tolerance).all(), "{bounds:?} {y} {v} {h} {a}");
                }
                assert!(next[1].abs().simd_le(velocity * (1.0 + 1e-12)).all());
                assert!(a.abs().simd_le(bounds.acceleration).all());
                [y, v] = [next[0].max(bounds.lower).min(bounds.upper), next[1]];
                ticks += 4;
            }
        }
        assert_eq!(ticks, 3_200_000);
    }
}
