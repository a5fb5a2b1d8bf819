//! Limits of the angular velocity and acceleration of a rotation.
//!
//! |ω| ≤ Ω and |ω̇| ≤ A bound the sizes of both vectors, which depend on no frame. Over a tick of length h from the angular velocity
//! ω₀ in the world frame, the limits admit the intersection of two balls,
//!
//! ```text
//! |ω| ≤ Ω,   |ω − ω₀| ≤ Ah.
//! ```
//!
//! A limited tick ends with the ω in it that is closest to the wanted one, and turns by the mean velocity: q = exp(hm) ⊗ q₀ with
//! m = (ω₀ + ω)/2. In the body frame ω then changes by the mean of ω − ω₀ and exp(−hm)(ω − ω₀), hence by no more than in the
//! world frame. Every state inside can go on, as the position has no limits.

use crate::motion::limits::Limit;
use crate::motion::viability::MIN_TICK;
use crate::numerics::rotation::{
    Turning, Vector, add_scaled, cross, dot, exp, inverse, log, normalised, product, rotate,
};

/// Rounding error of an angle between two unit quaternions, in rad.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Share of a limit that a limited motion keeps free for the rounding errors of its frames.
const MARGIN: f64 = 1e-14;
/// Turn over a tick, in rad, up to which it is compared with the mean velocity: the series behind it converges fast there.
const MAX_TURN: f64 = 1.0;

/// Limits Ω of |ω| in rad/s and A of |ω̇| in rad/s², infinite where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AngularLimits {
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
}

impl AngularLimits {
    /// No limits.
    pub(crate) const NONE: Self = Self { velocity: f64::INFINITY, acceleration: f64::INFINITY };

    /// Returns whether there is a limit.
    #[inline(always)]
    pub(crate) fn are_finite(&self) -> bool {
        self.velocity < f64::INFINITY || self.acceleration < f64::INFINITY
    }

    /// Returns whether a tick of length `h` keeps the limits between two motions: ω and its change in either frame, the angle, and
    /// the deviation of the turn from the mean velocity, which an acceleration within A cannot exceed.
    pub(crate) fn admits(&self, from: &Turning, to: &Turning, h: f64) -> bool {
        let square = |limit: f64| limit * limit;
        let velocities = [from, to].map(|at| rotate(at.rotation, at.velocity));
        let changes = [[from.velocity, to.velocity], velocities].map(|[from, to]| add_scaled(to, -1.0, from));
        let reach = square(self.acceleration * h);
        let [by_body, by_world] = changes.map(|change| dot(change, change));
        if !(dot(to.velocity, to.velocity) <= square(self.velocity) && by_body <= reach && by_world <= reach) {
            return false;
        }
        let turn = log(product(to.rotation, inverse(from.rotation)));
        let angle = dot(turn, turn).sqrt();
        if angle - ROUNDING > self.velocity * h {
            return false;
        }
        if angle > MAX_TURN {
            return true;
        }
        let mean = add_scaled(velocities[0], 1.0, velocities[1]);
        let detour = add_scaled(turn, -0.5 * h, mean);
        // A velocity whose axis turns adds h²ω₀×ω/12 to the mean, and terms of higher order.
        let twist = cross(velocities[0], velocities[1]);
        let allowed = 0.25 * self.acceleration * h * h + 0.125 * h * h * dot(twist, twist).sqrt() + ROUNDING;
        dot(detour, detour) <= square(allowed)
    }

    /// Returns whether the angular velocity may change at once: its change has no limit, and the new one keeps that of its size.
    pub(crate) fn admits_change(&self, to: Vector) -> bool {
        self.acceleration == f64::INFINITY && dot(to, to) <= self.velocity * self.velocity
    }

    /// Returns an acceleration reduced to its limit, an admissible one unchanged.
    pub(crate) fn reduced(&self, acceleration: Vector) -> Vector {
        if dot(acceleration, acceleration) <= self.acceleration * self.acceleration {
            return acceleration;
        }
        within(acceleration, self.acceleration * (1.0 - MARGIN))
    }

    /// Returns the motion after a tick of length `h` within the limits that is closest to the wanted one, and the limit that
    /// determines it. A motion faster than Ω slows with A.
    pub(crate) fn follow(&self, from: &Turning, wanted: &Turning, h: f64) -> (Turning, Limit) {
        let is_finite = wanted.rotation.iter().chain(&wanted.velocity).all(|x| x.is_finite());
        let wanted = if is_finite { wanted } else { from };
        let [start, target] = [from, wanted].map(|at| rotate(at.rotation, at.velocity));
        let (velocity, limit) = self.closest(start, target, h);
        let mean = add_scaled(start, 1.0, velocity).map(|x| 0.5 * x);
        let turned = normalised(product(exp(mean.map(|x| x * h)), from.rotation));
        let rotation = if turned.iter().all(|x| x.is_finite()) { turned } else { from.rotation };
        let change = add_scaled(velocity, -1.0, start).map(|x| x / h.max(MIN_TICK));
        let back = inverse(rotation);
        let acceleration = within(rotate(back, change), self.acceleration * (1.0 - MARGIN));
        (Turning { rotation, velocity: rotate(back, velocity), acceleration }, limit)
    }

    /// Returns the velocity in both balls that is closest to the wanted one, and the limit that determines it.
    fn closest(&self, start: Vector, wanted: Vector, h: f64) -> (Vector, Limit) {
        let [most, reach] = [self.velocity, self.acceleration * h].map(|limit| limit * (1.0 - MARGIN));
        let from = size(start);
        if from - reach > most {
            return (start.map(|x| x * (1.0 - reach / from)), Limit::Velocity);
        }
        let change = add_scaled(wanted, -1.0, start);
        let by_acceleration = add_scaled(start, 1.0, within(change, reach));
        if size(by_acceleration) <= most {
            let binds = size(change) > reach || self.velocity == f64::INFINITY;
            return (by_acceleration, if binds { Limit::Acceleration } else { Limit::Velocity });
        }
        let by_velocity = within(wanted, most);
        if size(add_scaled(by_velocity, -1.0, start)) <= reach || from == 0.0 {
            return (by_velocity, Limit::Velocity);
        }
        // The circle in which both spheres intersect, by the change of ω along ω₀ and across it: without cancellation.
        let along = ((most - from) * ((most + from) / from) - reach * (reach / from)) * 0.5;
        let across = ((reach - along) * (reach + along)).max(0.0).sqrt();
        let axis = start.map(|x| x / from);
        let off = add_scaled(wanted, -dot(wanted, axis), axis);
        let distance = size(off);
        let share = if distance > 0.0 && distance.is_finite() { across / distance } else { 0.0 };
        let moved = add_scaled(start, along.clamp(-reach, reach), axis);
        (add_scaled(moved, share, off), Limit::Acceleration)
    }
}

/// Returns |v|, without overflow of its square.
fn size(v: Vector) -> f64 {
    let largest = v.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let scaled = v.map(|x| x / largest);
    largest * dot(scaled, scaled).sqrt()
}

/// Returns the vector closest to `v` in a ball about 0.
fn within(v: Vector, radius: f64) -> Vector {
    let length = size(v);
    if length <= radius { v } else { v.map(|x| x / length * radius) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn vector(random: &mut Random, size: f64) -> Vector {
        std::array::from_fn(|_| size * (2.0 * random.next() - 1.0))
    }

    /// The velocity of a limited tick lies in both balls, and no other point of them is closer to the wanted one.
    #[test]
    fn limited_velocity_is_the_closest_in_both_balls() {
        let (mut random, mut both) = (Random(3), 0);
        for _ in 0..20_000 {
            let limits = AngularLimits { velocity: 1.0, acceleration: 10f64.powf(2.0 * random.next() - 1.0) };
            let start = within(vector(&mut random, 1.0), 1.0 - 1e-12);
            let scale = 10f64.powf(2.0 * random.next() - 1.0);
            let wanted = vector(&mut random, scale);
            let (found, _) = limits.closest(start, wanted, 1.0);
            let excess = |v: Vector| {
                let change = add_scaled(v, -1.0, start);
                (size(v) - limits.velocity).max(size(change) - limits.acceleration)
            };
            assert!(excess(found) <= 1e-14, "{start:?} {wanted:?} {found:?}");
            both += usize::from((size(found) - 1.0).abs() < 1e-9 && excess(found).abs() < 1e-9);
            let distance = |v: Vector| size(add_scaled(v, -1.0, wanted));
            for _ in 0..20 {
                let size = 10f64.powf(-6.0 * random.next());
                let other = add_scaled(found, size, vector(&mut random, 1.0));
                assert!(excess(other) > 0.0 || distance(other) >= distance(found) - 1e-12);
            }
        }
        assert!(both > 1000, "{both}");
    }

    /// A limited tick changes ω by no more than A in the world frame and in the body frame, and turns by no more than Ω.
    #[test]
    fn limited_ticks_keep_the_limits_in_both_frames() {
        let mut random = Random(5);
        for _ in 0..300 {
            let [velocity, acceleration] = [(); 2].map(|()| 10f64.powf(3.0 * random.next() - 1.0));
            let limits = AngularLimits { velocity, acceleration };
            let rotation = normalised(std::array::from_fn(|_| random.next() - 0.5));
            let mut at = Turning { rotation, velocity: [0.0; 3], acceleration: [0.0; 3] };
            for _ in 0..300 {
                let h = 10f64.powf(-5.0 * random.next());
                let rotation = normalised(std::array::from_fn(|_| random.next() - 0.5));
                let wanted = Turning { rotation, velocity: vector(&mut random, 3.0 * velocity), ..at };
                let (next, _) = limits.follow(&at, &wanted, h);
                assert!(size(next.velocity) <= velocity && size(next.acceleration) <= acceleration);
                let rounding = 8e-15 * velocity;
                for [from, to] in [[at.velocity, next.velocity], [at, next].map(|at| rotate(at.rotation, at.velocity))]
                {
                    assert!(size(add_scaled(to, -1.0, from)) <= acceleration * h + rounding);
                }
                let turn = size(log(product(next.rotation, inverse(at.rotation))));
                assert!(turn <= velocity * h + ROUNDING, "{turn} {velocity} {h}");
                at = next;
            }
        }
    }

    /// A motion faster than the limit slows with A along its own axis.
    #[test]
    fn motion_beyond_the_limit_slows() {
        let limits = AngularLimits { velocity: 1.0, acceleration: 2.0 };
        let (found, limit) = limits.closest([3.0, 4.0, 0.0], [0.0, 0.0, 9.0], 0.5);
        assert!((found[0] - 2.4).abs() < 1e-12 && (found[1] - 3.2).abs() < 1e-12 && found[2] == 0.0);
        assert_eq!(limit, Limit::Velocity);
        // Near it, the velocity returns inside.
        let (found, _) = limits.closest([0.0, 1.5, 0.0], [9.0, 0.0, 0.0], 0.5);
        assert!(size(found) <= 1.0 && found[0] > 0.5);
    }
}
