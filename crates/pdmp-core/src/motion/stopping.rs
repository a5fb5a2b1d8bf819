//! Motion of a DoF with limited jerk, by stopping motions.
//!
//! With |y⃛| ≤ J and |ÿ| ≤ A, the fastest motion to rest has up to three phases: the jerk ±J until ÿ = ∓p, then ÿ = ∓p, then
//! the jerk ∓J until ÿ = 0. Its direction is that of −w with w = ẏ + ÿ|ÿ|/(2J), the velocity at which ÿ would vanish, and for
//! w > 0
//!
//! ```text
//! p = min(A, √(Jẏ + ÿ²/2)),    hold of (ẏ + ÿ²/(2J) − p²/J)/p.
//! ```
//!
//! A state can stop if this motion keeps the limits of position and velocity. The rest of a stopping motion is the stopping
//! motion of its state, so that a DoF that can stop can do so again after any tick: it keeps its limits for any sequence of
//! wanted motions and tick lengths. [`JerkBounds::follow`] leads from a state to that of a constant jerk towards the wanted
//! acceleration if the DoF can stop from there, and otherwise to a weighted mean of this state and that on the stopping
//! motion, by bisection of the weight. The means of two motions that keep limits of jerk, acceleration and velocity keep them,
//! too. A DoF that cannot stop inside its limits takes the smallest ones inside which it can, and returns.
//!
//! Stopping motions that are kept for the next tick: J. C. Kiemel and T. Kröger, *Learning robot trajectories subject to
//! kinematic joint constraints*, ICRA 2021.

use crate::motion::limits::Limit;

/// Number of bisections: the weight is accurate to 1e-7.
const BISECTIONS: usize = 24;
/// Share of V by which rounding may exceed it.
const ROUNDING: f64 = 1e-9;

/// Position, velocity and acceleration of a DoF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct State {
    pub(crate) y: f64,
    pub(crate) v: f64,
    pub(crate) a: f64,
}

impl State {
    /// Returns the state after `t` seconds of a constant jerk.
    fn after(self, jerk: f64, t: f64) -> Self {
        let Self { y, v, a } = self;
        Self {
            y: y + t * (v + t * (0.5 * a + t * jerk * (1.0 / 6.0))),
            v: v + t * (a + 0.5 * t * jerk),
            a: a + jerk * t,
        }
    }

    /// Returns the weighted mean with another state.
    fn weighted(self, other: Self, weight: f64) -> Self {
        let mean = |from: f64, to: f64| from + (to - from) * weight;
        Self { y: mean(self.y, other.y), v: mean(self.v, other.v), a: mean(self.a, other.a) }
    }

    /// Returns the least and the greatest position over `t` seconds of the cubic to another state.
    fn extremes(self, to: Self, t: f64) -> [f64; 2] {
        let (start, end, change) = (self.v * t, to.v * t, to.y - self.y);
        let mut extremes = [self.y.min(to.y), self.y.max(to.y)];
        let b = change * 6.0 - start * 4.0 - end * 2.0;
        let c = (start + end - change * 2.0) * 3.0;
        let discriminant = b * b - c * start * 4.0;
        if discriminant > 0.0 {
            let q = -0.5 * (b + discriminant.sqrt().copysign(b));
            for s in [q / c, start / q] {
                // Nearer to an end it passes this by 1e-18 of the path at most, and may be one of rounding.
                if s > 1e-9 && s < 1.0 - 1e-9 {
                    let turning = self.y + (start + (b * 0.5 + c * s * (1.0 / 3.0)) * s) * s;
                    extremes = [extremes[0].min(turning), extremes[1].max(turning)];
                }
            }
        }
        extremes
    }
}

/// Limits of a DoF with a finite jerk and acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JerkBounds {
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    pub(crate) jerk: f64,
}

/// Stopping motion: phases of constant jerk.
struct Stop {
    /// Durations and jerks; the first phase reduces an acceleration beyond its limit.
    phases: [[f64; 2]; 4],
    /// Largest |ẏ| of the motion.
    peak: f64,
    /// Least and greatest position of the motion.
    extremes: [f64; 2],
}

impl Stop {
    /// Returns the state after `t` seconds.
    fn after(&self, mut state: State, mut t: f64) -> State {
        for [duration, jerk] in self.phases {
            if t < duration {
                return state.after(jerk, t);
            }
            state = state.after(jerk, duration);
            t -= duration;
        }
        State { y: state.y, v: 0.0, a: 0.0 }
    }
}

impl JerkBounds {
    /// Returns the velocity at which the acceleration would vanish.
    fn coasting(&self, State { v, a, .. }: State) -> f64 {
        v + a * a.abs() / (2.0 * self.jerk)
    }

    /// Returns the stopping motion of a state.
    fn stop(&self, state: State) -> Stop {
        let (j, most) = (self.jerk, self.acceleration);
        let mut phases = [[0.0; 2]; 4];
        let mut braked = state;
        let side = self.coasting(state).signum();
        if -side * state.a > most {
            phases[0] = [(state.a.abs() - most) / j, -j * state.a.signum()];
            braked = state.after(phases[0][1], phases[0][0]);
            braked.a = most.copysign(state.a);
        }
        let side = self.coasting(braked).signum();
        let (v, a) = (side * braked.v, side * braked.a);
        let p = (j * v + 0.5 * a * a).max(0.0).sqrt().max(-a);
        let (p, hold) = if p > most { (most, (v + 0.5 * a * a / j) / most - most / j) } else { (p, 0.0) };
        phases[1] = [(a + p).max(0.0) / j, -side * j];
        phases[2] = [hold.max(0.0), 0.0];
        phases[3] = [p / j, side * j];
        let mut extremes = [state.y; 2];
        let mut from = state;
        for [duration, jerk] in phases {
            if duration > 0.0 {
                let to = from.after(jerk, duration);
                let [least, greatest] = from.extremes(to, duration);
                extremes = [extremes[0].min(least), extremes[1].max(greatest)];
                from = to;
            }
        }
        let peak = state.v.abs().max(self.coasting(state).abs()).max(self.coasting(braked).abs());
        Stop { phases, peak, extremes }
    }

    /// Returns the limit that the stopping motion of a state breaks.
    fn broken(&self, state: State) -> Option<Limit> {
        let Stop { peak, extremes: [least, greatest], .. } = self.stop(state);
        if state.a.abs() > self.acceleration {
            Some(Limit::Acceleration)
        } else if peak > self.velocity {
            Some(Limit::Velocity)
        } else if least < self.lower || greatest > self.upper {
            Some(Limit::Position)
        } else {
            None
        }
    }

    /// Returns whether a tick of `h` seconds between two states keeps the limit of the jerk, and ends where the DoF can stop.
    pub(crate) fn admits(&self, from: State, to: State, h: f64) -> bool {
        let (j, change) = (self.jerk, to.a - from.a);
        // The largest deviations from the mean acceleration and from constant acceleration, and rounding.
        let by_velocity = (j * h * h - change * change / j) * 0.25 + 64.0 * f64::EPSILON * (from.v.abs() + to.v.abs());
        let by_position = j * h * h * h * (1.0 / 6.0) + 64.0 * f64::EPSILON * (from.y.abs() + to.y.abs());
        change.abs() <= j * h
            && (to.v - from.v - 0.5 * h * (from.a + to.a)).abs() <= by_velocity
            && (to.y - from.y - h * (from.v + 0.5 * h * from.a)).abs() <= by_position
            && self.broken(to).is_none()
    }

    /// Returns the state after a tick of `h` seconds towards a wanted acceleration, and the limit that determines it.
    ///
    /// The DoF does not pass `target`, the position at which the wanted acceleration would vanish with the velocity: at a low
    /// limit of the jerk, a DoF that reverses its acceleration only as it is wanted overshoots the target ever farther.
    pub(crate) fn follow(&self, from: State, wanted: f64, target: f64, h: f64) -> (State, Limit) {
        let stop = self.stop(from);
        let stopping = stop.after(from, h);
        if stop.peak > self.velocity * (1.0 + ROUNDING) {
            return (stopping, Limit::Velocity);
        }
        let [least, greatest] = stop.extremes;
        let possible = Self {
            lower: self.lower.min(least),
            upper: self.upper.max(greatest),
            velocity: self.velocity.max(stop.peak),
            acceleration: self.acceleration.max(from.a.abs()),
            ..*self
        };
        let target = target.max(self.lower).min(self.upper);
        let within = Self { lower: least.min(target), upper: greatest.max(target), ..possible };
        let towards = self.inwards(from, stop.extremes, wanted, h);
        let reach = self.jerk * h;
        let a = towards.clamp(-self.acceleration, self.acceleration).clamp(from.a - reach, from.a + reach);
        let steady = State {
            y: from.y + h * (from.v + h * (from.a * (1.0 / 3.0) + a * (1.0 / 6.0))),
            v: from.v + 0.5 * h * (from.a + a),
            a,
        };
        let broken = |bounds: &Self, state: State| {
            let [least, greatest] = from.extremes(state, h);
            let way = (state.y - from.y).abs() - 4.0 * f64::EPSILON * state.y.abs();
            if least < bounds.lower || greatest > bounds.upper {
                Some(Limit::Position)
            } else if state.v.abs().max((state.v + h * state.a).abs()) > bounds.velocity {
                // The next tick can then end the acceleration at the limit of the velocity; an end beyond it would alternate.
                Some(Limit::Velocity)
            } else if way > bounds.velocity * h {
                // An acceleration that changes its sign within a long tick raises the velocity in between.
                Some(Limit::Velocity)
            } else {
                bounds.broken(state)
            }
        };
        if broken(&within, steady).is_none() {
            let limit = match towards {
                towards if towards != wanted => Limit::Position,
                towards if towards.abs() > self.acceleration && a.abs() >= self.acceleration => Limit::Acceleration,
                _ => Limit::Jerk,
            };
            return (steady, limit);
        }
        let (mut kept, mut weight, mut share) = (stopping, 0.0, 0.5);
        for _ in 0..BISECTIONS {
            let state = stopping.weighted(steady, weight + share);
            if broken(&within, state).is_none() {
                (kept, weight) = (state, weight + share);
            }
            share *= 0.5;
        }
        (kept, broken(&possible, steady).unwrap_or(Limit::Jerk))
    }

    /// Returns the wanted acceleration, or that of the return of a DoF whose stopping motion leaves the limits of the position.
    ///
    /// It returns at √(Ad) at a distance d, from which half of A brakes to rest at the limit.
    fn inwards(&self, from: State, [least, greatest]: [f64; 2], wanted: f64, h: f64) -> f64 {
        let duration = (self.acceleration / self.jerk).max(h);
        let speed = |distance: f64| (self.acceleration * distance.max(0.0)).sqrt().min(self.velocity);
        let mut towards = wanted;
        if greatest > self.upper {
            towards = towards.min((-speed(from.y - self.upper) - from.v) / duration);
        }
        if least < self.lower {
            towards = towards.max((speed(self.lower - from.y) - from.v) / duration);
        }
        towards
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn random_bounds(random: &mut Random) -> JerkBounds {
        let acceleration = random.scale(0.1, 1e3);
        let lower = -random.next();
        JerkBounds {
            lower,
            upper: lower + random.scale(0.01, 10.0),
            velocity: random.scale(0.1, 10.0),
            acceleration,
            jerk: acceleration * random.scale(0.1, 1e4),
        }
    }

    /// Hostile wanted accelerations over ticks from 1e-6 to 0.1 s break no limit by more than rounding.
    #[test]
    fn followed_motion_keeps_the_limits() {
        let mut random = Random(1);
        let mut worst = [0.0f64; 5];
        let mut limits = [0usize; 4];
        for case in 0..1000 {
            let bounds = random_bounds(&mut random);
            let JerkBounds { lower, upper, velocity, acceleration, jerk } = bounds;
            let range = upper - lower;
            let mut state = State { y: lower + range * random.next(), v: 0.0, a: 0.0 };
            let (mut wanted, mut target) = (0.0, 0.0);
            for _ in 0..2000 {
                let h = if case % 4 == 0 { 1e-3 } else { random.scale(1e-6, 0.1) };
                if random.next() < [1.0, 0.1, 0.002][case % 3] {
                    wanted = acceleration * random.scale(1e-2, 1e3) * (random.next() - 0.5).signum();
                    target = lower + range * (2.0 * random.next() - 0.5);
                }
                let (next, limit) = bounds.follow(state, wanted, target, h);
                limits[limit as usize] += 1;
                let (change, reach) = (next.a - state.a, jerk * h);
                let rounding = 4.0 * f64::EPSILON;
                let deviation = (next.v - state.v - 0.5 * h * (state.a + next.a)).abs();
                let excess = [
                    (next.y - upper).max(lower - next.y) / range,
                    next.v.abs() / velocity - 1.0,
                    next.a.abs() / acceleration - 1.0,
                    (change.abs() - reach - rounding * acceleration) / reach,
                    (deviation - 0.25 * (jerk * h * h - change * change / jerk) - rounding * velocity) / velocity,
                ];
                for (worst, excess) in worst.iter_mut().zip(excess) {
                    assert!(excess.is_finite());
                    *worst = worst.max(excess);
                }
                // On the cubic a stop that ends within the tick may pass the limit by a small share of Jh³.
                let [least, greatest] = state.extremes(next, h);
                let between = (greatest - upper).max(lower - least);
                assert!(between <= reach * h * h / 150.0 + 1e-12 * range, "{between} {}", reach * h * h);
                state = next;
            }
        }
        println!("position, velocity, acceleration, jerk, change of the velocity: {worst:?}, limits {limits:?}");
        assert!(worst.iter().all(|worst| *worst <= 1e-12), "{worst:?}");
        assert!(limits.iter().all(|ticks| *ticks > 10_000), "{limits:?}");
    }

    /// The stopping motion ends at rest with all of J and A in use, in the time that the textbook gives.
    #[test]
    fn stopping_takes_the_time_of_the_trapezoid() {
        let bounds = JerkBounds { lower: -1e9, upper: 1e9, velocity: 10.0, acceleration: 2.0, jerk: 5.0 };
        // From a constant velocity: A/J + v/A with a phase of constant acceleration, 2√(v/J) without.
        for (v, expected) in [(3.0, 2.0 / 5.0 + 3.0 / 2.0), (-3.0, 1.9), (0.5, 2.0 * (0.5f64 / 5.0).sqrt())] {
            let stop = bounds.stop(State { y: 0.0, v, a: 0.0 });
            let duration: f64 = stop.phases.iter().map(|[duration, _]| duration).sum();
            assert!((duration - expected).abs() < 1e-12, "{v}: {duration} {expected}");
        }
    }

    /// The extremes of a stopping motion are those of its states, which end at rest, and its states have its rest as theirs.
    #[test]
    fn stopping_motion_is_that_of_its_phases() {
        let mut random = Random(2);
        for _ in 0..2000 {
            let bounds = random_bounds(&mut random);
            let v = bounds.velocity * (2.0 * random.next() - 1.0);
            let from = State { y: 0.0, v, a: bounds.acceleration * 1.5 * (2.0 * random.next() - 1.0) };
            let stop = bounds.stop(from);
            let duration: f64 = stop.phases.iter().map(|[duration, _]| duration).sum();
            let [mut least, mut greatest] = [0.0f64; 2];
            let length = stop.extremes[1] - stop.extremes[0] + 1e-300;
            for k in 0..=1000 {
                let state = stop.after(from, duration * f64::from(k) / 1000.0);
                (least, greatest) = (least.min(state.y), greatest.max(state.y));
                let rest = bounds.stop(state).after(state, 2.0 * duration);
                let end = stop.after(from, 2.0 * duration);
                assert!((rest.y - end.y).abs() <= 1e-9 * length, "{bounds:?} {from:?} {k}");
            }
            assert!(greatest <= stop.extremes[1] + 1e-12 * length && stop.extremes[1] <= greatest + 1e-2 * length);
            assert!(least >= stop.extremes[0] - 1e-12 * length && stop.extremes[0] >= least - 1e-2 * length);
            let State { v, a, .. } = stop.phases.iter().fold(from, |state, [t, jerk]| state.after(*jerk, *t));
            assert!(v.abs() <= 1e-12 * (bounds.velocity + bounds.acceleration * duration), "{v}");
            assert!(a.abs() <= 1e-12 * bounds.acceleration, "{a}");
        }
    }

    /// A DoF outside its limits, or too fast for them, comes inside without breaking its jerk, and stays.
    #[test]
    fn motion_outside_returns() {
        let mut random = Random(3);
        for case in 0..200 {
            let bounds = random_bounds(&mut random);
            // The excursion before the return grows with the square of the time that a reversal takes.
            let jerk = bounds.jerk.max(bounds.acceleration * (10.0 * bounds.acceleration / bounds.velocity).max(10.0));
            let bounds = JerkBounds { jerk, ..bounds };
            let JerkBounds { lower, upper, velocity, acceleration, jerk } = bounds;
            let range = upper - lower;
            let mut state = State {
                y: upper + range * (random.next() - 0.3),
                v: velocity * 2.0 * (random.next() - 0.5) * f64::from(1 + case % 2),
                a: acceleration * 3.0 * (random.next() - 0.5),
            };
            let h = 1e-3 * random.scale(0.1, 1.0);
            let is_inside = |state: State| bounds.broken(state).is_none();
            let (mut ticks, [mut distance, mut speed]) = (0, [0.0f64; 2]);
            while !is_inside(state) {
                let (next, _) = bounds.follow(state, acceleration, upper + range, h);
                assert!((next.a - state.a).abs() <= jerk * h + 4.0 * f64::EPSILON * acceleration * 3.0);
                state = next;
                distance = distance.max((state.y - upper).max(lower - state.y));
                speed = speed.max(state.v.abs());
                ticks += 1;
                let time =
                    acceleration / jerk + speed / acceleration + distance / velocity + (distance / acceleration).sqrt();
                assert!(f64::from(ticks) * h < 10.0 * time + 0.01, "{bounds:?} {state:?}");
            }
            for _ in 0..500 {
                state = bounds.follow(state, acceleration, upper + range, h).0;
                assert!(state.y <= upper + 1e-12 * range && state.y >= lower - 1e-12 * range);
                assert!(state.v.abs() <= velocity * (1.0 + 1e-9) && state.a.abs() <= acceleration * (1.0 + 1e-12));
            }
        }
    }

    /// A DoF that an attractor pulls settles at any limit of the jerk, however low.
    #[test]
    fn attracted_motion_settles_at_any_jerk() {
        for jerk in [1e4, 1e2, 1e1, 1.0, 0.1] {
            let bounds = JerkBounds { lower: -9.0, upper: 9.0, velocity: 5.0, acceleration: 10.0, jerk };
            let (mut state, omega, h) = (State { y: 0.0, v: 0.0, a: 0.0 }, 12.5, 1e-3);
            let mut largest = 0.0f64;
            for _ in 0..60_000 {
                let wanted = omega * omega * (1.0 - state.y) - 2.0 * omega * state.v;
                let next = state.after(0.0, h);
                let next = State { v: state.v + wanted * h, a: wanted, ..next };
                state = if bounds.admits(state, next, h) { next } else { bounds.follow(state, wanted, 1.0, h).0 };
                largest = largest.max(state.y);
            }
            assert!((state.y - 1.0).abs() < 1e-3 && state.v.abs() < 1e-3, "{jerk}: {state:?}");
            assert!(largest < 1.05, "{jerk}: {largest}");
        }
    }
}
