//! Accelerations of limited ticks beside those of a search by brute force.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/accepted.rs"]
mod accepted;
mod common;

use std::cell::Cell;

use accepted::{Tally, mostly_accepted};
use common::*;
use pdmp_core::motion::{Coupling, Limits};
use pdmp_core::{Command, Conditions, Controller};
use proptest::prelude::*;

/// Number of candidate accelerations, from −A to A.
const N_CANDIDATES: usize = 400;
/// Steps of a simulated stop.
const N_STEPS: usize = 20;
/// Rounding of a simulated position, relative to the range.
const ROUNDING: f64 = 3e-15;

/// A DoF at the start of a tick, beside one of its limits y ≤ 0; the other one is at −range.
#[derive(Clone, Copy, Debug)]
struct Joint {
    range: f64,
    velocity: f64,
    acceleration: f64,
}

impl Joint {
    /// Returns whether a DoF at `y` with the velocity `v` can stop inside the limits, by simulation under full braking.
    fn can_stop(&self, mut y: f64, mut v: f64) -> bool {
        let step = v.abs() / self.acceleration / N_STEPS as f64;
        let braking = -self.acceleration.copysign(v);
        for _ in 0..N_STEPS {
            y += v * step + 0.5 * braking * step * step;
            v += braking * step;
            if !self.is_inside(y) {
                return false;
            }
        }
        true
    }

    fn is_inside(&self, y: f64) -> bool {
        let rounding = ROUNDING * self.range;
        (-self.range - rounding..=rounding).contains(&y)
    }

    /// Returns whether a constant acceleration over a tick of `h` seconds keeps the limits, and the DoF can then stop inside.
    fn admits(&self, y: f64, v: f64, a: f64, h: f64) -> bool {
        let at = |t: f64| y + v * t + 0.5 * a * t * t;
        // The extremum within the tick, by ternary search of a parabola.
        let sign = -a.signum();
        let [mut from, mut to] = [0.0, h];
        for _ in 0..100 {
            let third = (to - from) / 3.0;
            if sign * at(from + third) < sign * at(to - third) {
                from += third;
            } else {
                to -= third;
            }
        }
        let end = v + a * h;
        end.abs() <= self.velocity * (1.0 + 1e-15) && self.is_inside(at(from)) && self.can_stop(at(h), end)
    }

    /// Returns the acceleration closest to the wanted one that the limits admit: that of a grid, refined by bisection.
    fn closest(&self, y: f64, v: f64, wanted: f64, h: f64) -> Option<f64> {
        let wanted = wanted.clamp(-self.acceleration, self.acceleration);
        if self.admits(y, v, wanted, h) {
            return Some(wanted);
        }
        let candidates = (0..=N_CANDIDATES).map(|k| (2.0 * k as f64 / N_CANDIDATES as f64 - 1.0) * self.acceleration);
        let admitted = candidates.filter(|a| self.admits(y, v, *a, h));
        let mut best = admitted.min_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()))?;
        let mut refused = wanted;
        for _ in 0..100 {
            let middle = 0.5 * (best + refused);
            if self.admits(y, v, middle, h) {
                best = middle;
            } else {
                refused = middle;
            }
        }
        Some(best)
    }
}

/// Parameters of all DoFs, logarithm of the share of the longest tick, and logarithms and signs of the pushes relative to A.
type Case = (Vec<(f64, f64, f64, f64, f64)>, f64, Vec<f64>);

/// Parameters of a DoF: logarithms of range, V and A, the share of the way between the limits, and that of the largest velocity
/// from which the DoF can stop.
fn joint() -> impl Strategy<Value = (f64, f64, f64, f64, f64)> {
    let share = prop_oneof![4 => 0.0..=1.0, 1 => Just(0.0), 1 => Just(1.0)];
    let speed = prop_oneof![4 => -1.0..=1.0, 1 => Just(1.0), 1 => Just(-1.0), 1 => Just(0.0)];
    (-3.0..1.0_f64, -2.0..2.0_f64, -2.0..4.0_f64, share, speed)
}

/// A limited tick takes the acceleration closest to the wanted one among those that keep the limits and from which the DoF can
/// stop inside: it is not needlessly conservative.
#[test]
fn limited_tick_takes_the_closest_acceleration() {
    let n = REACH.n_dofs();
    let [worst, worst_exact] = [(); 2].map(|()| Cell::new(0.0_f64));
    let [compared, limited, inner, exact] = [(); 4].map(|()| Cell::new(0_usize));
    let case = (prop::collection::vec(joint(), n), -2.0..=0.0_f64, prop::collection::vec(-4.0..4.0_f64, n));
    let compare = |(parameters, log_h, pushes): Case, tally: &Tally| {
        let joint = |d: usize| {
            let (range, velocity, acceleration, ..) = parameters[d];
            Joint { range: 10f64.powf(range), velocity: 10f64.powf(velocity), acceleration: 10f64.powf(acceleration) }
        };
        // A longer tick is one of several accelerations.
        let longest = |d: usize| {
            let Joint { range, velocity, acceleration } = joint(d);
            (0.5 * velocity / acceleration).min((range / acceleration).sqrt())
        };
        let h = (0..n).map(longest).fold(1.0, f64::min) * 10f64.powf(log_h);
        let state = |d: usize| {
            let (Joint { range, velocity, acceleration }, share, speed) = (joint(d), parameters[d].3, parameters[d].4);
            let way = if speed > 0.0 { (1.0 - share) * range } else { share * range };
            [(share - 1.0) * range, speed * (2.0 * acceleration * way).sqrt().min(velocity)]
        };
        let vector = |of: &dyn Fn(usize) -> f64| Some((0..n).map(of).collect::<Vec<f64>>());
        let mut limits = Limits {
            lower: vector(&|d| -joint(d).range),
            upper: Some(vec![0.0]),
            velocity: vector(&|d| joint(d).velocity),
            synchronous: false,
            ..Limits::default()
        };
        limits.acceleration = vector(&|d| joint(d).acceleration);
        let conditions = Conditions {
            goal: vector(&|d| -0.5 * joint(d).range),
            start: vector(&|d| state(d)[0]),
            velocity: vector(&|d| state(d)[1]),
            ..Conditions::default()
        };
        let mut free = Controller::new(REACH.primitive(), h, &conditions, None).unwrap();
        let mut controller = free.clone();
        if !tally.count(controller.set_limits(&limits)) {
            return Ok(());
        }
        let before: Vec<[f64; 2]> = (0..n).map(|d| [controller.position()[d], controller.velocity()[d]]).collect();
        let acceleration: Vec<f64> =
            (0..n).map(|d| pushes[d].signum() * 10f64.powf(pushes[d].abs()) * joint(d).acceleration).collect();
        let coupling = Coupling { velocity: &vec![0.0; n], acceleration: &acceleration };
        let command = Command { coupling: Some(coupling), ..Command::default() };
        free.step_with(&command).unwrap();
        controller.step_with(&command).unwrap();
        for (d, [y, v]) in before.into_iter().enumerate() {
            if controller.limited()[d].is_none() {
                continue;
            }
            limited.set(limited.get() + 1);
            let wanted = (free.velocity()[d] - v) / h;
            let Some(expected) = joint(d).closest(y, v, wanted, h) else { continue };
            let found = (controller.velocity()[d] - v) / h;
            // Rounding of the position, by the way that a change of the acceleration moves the point of rest or of turning.
            let Joint { range, velocity, acceleration } = joint(d);
            let (way, end) = (2.0 * ROUNDING * range, v + expected * h);
            let moved = if v * end < 0.0 {
                0.5 * (v / expected) * (v / expected)
            } else {
                0.5 * h * h + end.abs().max((2.0 * acceleration * way).sqrt()) * h / acceleration
            };
            let rounding = 4.0 * way / moved + 4.0 * f64::EPSILON * velocity / h;
            let gap = ((found - expected).abs() - rounding) / acceleration;
            compared.set(compared.get() + 1);
            let by_acceleration = expected.abs() == acceleration;
            inner.set(inner.get() + usize::from(!by_acceleration));
            if !by_acceleration && rounding < 1e-6 * acceleration {
                worst_exact.set(worst_exact.get().max((found - expected).abs() / acceleration));
                exact.set(exact.get() + 1);
            }
            worst.set(worst.get().max(gap));
            prop_assert!(
                gap < 1e-6,
                "DoF {d}: {found}, {expected} by brute force, {:?} {y} {v} {wanted} {h}",
                joint(d)
            );
        }
        Ok(())
    };
    mostly_accepted(prop::collection::vec(case, 8), |cases, tally| {
        cases.into_iter().try_for_each(|case| compare(case, tally))
    });
    println!(
        "{} limited, {} compared, largest gap {:e} of A beyond rounding",
        limited.get(),
        compared.get(),
        worst.get()
    );
    println!(
        "{} within A, {} of them without rounding above 1e-6, largest gap {:e} of A",
        inner.get(),
        exact.get(),
        worst_exact.get()
    );
    assert!(10 * compared.get() >= 9 * limited.get() && compared.get() > 200);
}
