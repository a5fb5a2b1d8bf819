//! Limits along the path: a rate that all DoFs keep, and a governor of commands.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/random.rs"]
mod random;

use std::f64::consts::TAU;
use std::sync::Arc;

use common::*;
use pdmp_core::motion::{Limits, TimeGrid, fastest};
use pdmp_core::{Command, Conditions, Controller, Kind, Model, Status, rollout};
use random::Random;

/// Largest share of a limit of the acceleration that a movement along its path uses; a DoF that is limited on its own uses all.
const ALONG_PATH: f64 = 0.995;

fn controller(model: &Arc<Model>, dt: f64) -> Controller {
    Controller::new(model.primitive(), dt, &Conditions::default(), None).unwrap()
}

/// Limits at a share of the largest velocity and acceleration of the nominal movement.
fn limits(model: &Model, shares: [f64; 2]) -> Limits {
    let grid = TimeGrid { dt: 1e-3, duration: None };
    let free = rollout(model.primitive(), &Conditions::default(), grid).unwrap();
    let peaks = |derivative: &ndarray::Array2<f64>, share: f64| {
        Some(derivative.columns().into_iter().map(|dof| share * dof.fold(0.0, |peak, x| x.abs().max(peak))).collect())
    };
    Limits {
        velocity: peaks(&free.velocity, shares[0]),
        acceleration: peaks(&free.acceleration, shares[1]),
        ..Limits::default()
    }
}

/// Returns the clock u of a controller, relative to τ, from its phase.
fn clock(controller: &Controller, before: f64) -> f64 {
    match controller.primitive().kind() {
        Kind::Discrete => -controller.phase().ln() / controller.primitive().canonical().phase(1.0).recip().ln(),
        Kind::Rhythmic => before + (controller.phase() - before).rem_euclid(TAU),
    }
}

/// Returns the largest shares of the limits of velocity and acceleration that a tick uses.
fn used(limits: &Limits, before: &[f64], after: &[f64], dt: f64) -> [f64; 2] {
    let of = |share: &dyn Fn(usize) -> f64| (0..before.len()).map(share).fold(0.0, f64::max);
    let [velocity, acceleration] = [limits.velocity.as_ref().unwrap(), limits.acceleration.as_ref().unwrap()];
    [of(&|d| after[d].abs() / velocity[d]), of(&|d| (after[d] - before[d]).abs() / (acceleration[d] * dt))]
}

/// A DoF that cannot follow slows all of them: the movement stays on its path, and no DoF is limited on its own.
#[test]
fn movement_within_limits_stays_on_its_path() {
    for model in [&*REACH, &*CYCLE] {
        for (shares, speed) in [([0.9, 0.5], 1.0), ([0.3, 0.9], 1.0), ([0.2, 0.1], 1.0), ([0.4, 0.4], f64::INFINITY)] {
            let limits = limits(model, shares);
            let dt = 2e-3;
            let (mut limited, mut free) = (controller(model, dt), controller(model, dt));
            limited.set_limits(&limits).unwrap();
            limited.set_speed(speed).unwrap();
            let (mut u, mut n_slowed) = (0.0, 0);
            let mut before = limited.velocity().to_vec();
            for _ in 0..4000 {
                let status = limited.step().unwrap();
                let next = clock(&limited, u);
                free.step_with(&Command { dt: Some((next - u) * model.tau()), ..Command::default() }).unwrap();
                u = next;
                for ((y, path), range) in limited.position().iter().zip(free.position()).zip(model.ranges()) {
                    assert!((y - path).abs() < 1e-6 * range, "{y} {path} at {u}");
                }
                let [velocity, acceleration] = used(&limits, &before, limited.velocity(), dt);
                assert!(
                    velocity <= ALONG_PATH + 1e-3 && acceleration <= ALONG_PATH,
                    "{velocity} {acceleration} at {u}"
                );
                n_slowed += usize::from(limited.limited().iter().any(Option::is_some));
                before = limited.velocity().to_vec();
                if status == Status::Finished {
                    break;
                }
            }
            assert!(n_slowed > 50, "{n_slowed}");
        }
    }
}

/// At an unlimited speed the controller takes the time of the time-optimal law, but for its margins.
#[test]
fn unlimited_speed_is_time_optimal() {
    for shares in [[0.9, 0.5], [0.3, 0.9], [0.5, 0.5]] {
        let limits = limits(&REACH, shares);
        let optimum = fastest(REACH.primitive(), &limits, &Conditions::default(), 1e-3).unwrap();
        let optimum = optimum.time[optimum.time.len() - 1];
        let mut controller = controller(&REACH, 1e-3);
        controller.set_limits(&limits).unwrap();
        controller.set_speed(f64::INFINITY).unwrap();
        let end = REACH.primitive().canonical().phase(REACH.primitive().canonical().extent());
        while controller.phase() > end {
            controller.step().unwrap();
        }
        // The optimum also comes to rest at the end of the demonstrations.
        assert!(controller.time() < 1.03 * optimum, "{} {optimum}", controller.time());
        assert!(controller.time() > 0.9 * optimum, "{} {optimum}", controller.time());
    }
    let mut controller = controller(&REACH, 1e-3);
    let text = controller.set_speed(f64::INFINITY).unwrap_err().to_string();
    assert!(text.starts_with("speed = inf"), "{text}");
}

/// A pause and its end keep the limits and leave the path by nothing.
#[test]
fn pause_keeps_the_limits_on_the_path() {
    let limits = limits(&REACH, [1.0, 0.8]);
    let dt = 1e-3;
    let (mut limited, mut free) = (controller(&REACH, dt), controller(&REACH, dt));
    limited.set_limits(&limits).unwrap();
    let (mut u, mut before) = (0.0, limited.velocity().to_vec());
    for tick in 0..3000 {
        if tick == 300 {
            limited.set_speed(0.0).unwrap();
        }
        if tick == 1200 {
            assert!(limited.velocity().iter().all(|v| v.abs() < 1e-9));
            limited.set_speed(1.0).unwrap();
        }
        limited.step().unwrap();
        let next = clock(&limited, u);
        free.step_with(&Command { dt: Some((next - u) * REACH.tau()), ..Command::default() }).unwrap();
        u = next;
        for ((y, path), range) in limited.position().iter().zip(free.position()).zip(REACH.ranges()) {
            assert!((y - path).abs() < 1e-6 * range, "{y} {path}");
        }
        let [_, acceleration] = used(&limits, &before, limited.velocity(), dt);
        assert!(acceleration <= ALONG_PATH, "{acceleration}");
        before = limited.velocity().to_vec();
    }
    assert_eq!(limited.status(), Status::Finished);
}

/// Of commands during the movement only such a share is accepted that no DoF has to be limited on its own; in the end all of them
/// are accepted.
#[test]
fn governed_commands_never_make_a_dof_leave_the_path() {
    let mut random = Random(7);
    let mut uniform = || random.next();
    let (mut n_commands, mut n_pending) = (0, 0);
    for case in 0..20 {
        let model = [&*REACH, &*CYCLE][case % 2];
        let mut limits = limits(model, [0.4 + uniform(), 0.3 + uniform()]);
        let grid = TimeGrid { dt: 1e-2, duration: None };
        let free = rollout(model.primitive(), &Conditions::default(), grid).unwrap();
        let side = |sign: f64| {
            let dof = |d: usize| free.position.column(d).fold(f64::NEG_INFINITY, |most, y| most.max(sign * y));
            Some((0..model.n_dofs()).map(|d| sign * (dof(d) + 0.1 * model.ranges()[d])).collect::<Vec<f64>>())
        };
        (limits.lower, limits.upper) = (side(-1.0), side(1.0));
        let dt = 2e-3;
        let mut controller = controller(model, dt);
        controller.set_limits(&limits).unwrap();
        controller.step().unwrap();
        let centre = controller.centre().to_vec();
        let mut before = controller.velocity().to_vec();
        for tick in 0..1500 {
            let goal: Vec<f64> =
                centre.iter().zip(model.ranges()).map(|(y, range)| y + range * (uniform() - 0.5) * 0.6).collect();
            let style = model.demonstrated().styles.row(tick % model.demonstrated().styles.nrows()).to_vec();
            let commanded = tick % 120 == 60 && tick < 1200;
            let is_style = uniform() < 0.5;
            let command = Command {
                style: (commanded && is_style).then_some(&style),
                goal: (commanded && !is_style && model.kind() == Kind::Discrete).then_some(&goal),
                anchor: (commanded && !is_style && model.kind() == Kind::Rhythmic).then_some(&goal),
                ..Command::default()
            };
            n_commands += usize::from(commanded);
            controller.step_with(&command).unwrap();
            n_pending += usize::from(controller.is_pending());
            let [velocity, acceleration] = used(&limits, &before, controller.velocity(), dt);
            assert!(
                velocity <= ALONG_PATH + 1e-3 && acceleration <= ALONG_PATH,
                "{case} {tick}: {velocity} {acceleration} {:?} {:?} of {:?} {:?} pending {} a {:?}",
                controller.limited(),
                controller.position(),
                limits.lower,
                limits.upper,
                controller.is_pending(),
                controller.acceleration()
            );
            for (d, y) in controller.position().iter().enumerate() {
                let [lower, upper] = [&limits.lower, &limits.upper].map(|limit| limit.as_ref().unwrap()[d]);
                assert!((lower..=upper).contains(y), "{case} {tick}: {y}");
            }
            before = controller.velocity().to_vec();
        }
    }
    assert!(n_commands > 150 && n_pending > 500, "{n_commands} {n_pending}");
}

/// A goal at the limit beyond which the movement would overshoot is accepted at last, and reached.
#[test]
fn pending_goal_is_reached_at_last() {
    let mut controller = controller(&REACH, 1e-3);
    let mut limits = limits(&REACH, [2.0, 2.0]);
    let upper: Vec<f64> = controller.centre().iter().zip(REACH.ranges()).map(|(g, range)| g + 0.35 * range).collect();
    limits.upper = Some(upper.clone());
    controller.set_limits(&limits).unwrap();
    let mut was_pending = false;
    for tick in 0..6000 {
        if tick == 200 {
            controller.set_goal(&upper).unwrap();
        }
        let status = controller.step().unwrap();
        was_pending |= controller.is_pending();
        assert!(controller.position().iter().zip(&upper).all(|(y, upper)| y <= upper));
        if tick > 200 && status == Status::Finished {
            break;
        }
    }
    assert!(
        was_pending && !controller.is_pending(),
        "{was_pending} {} {} {:?} {:?}",
        controller.is_pending(),
        controller.time(),
        controller.centre(),
        upper
    );
    assert_eq!(controller.status(), Status::Finished);
    assert_eq!(controller.centre(), upper);
}

/// A style that can be accepted in part alone does not keep a movement from its end.
#[test]
fn pending_style_lets_the_movement_finish() {
    let mut n_pending = 0;
    for command_at in (50..900).step_by(50) {
        let mut controller = controller(&REACH, 1e-3);
        let path = controller.forecast(1.0, Some(1e-3)).unwrap();
        let highest = (0..REACH.n_dofs()).map(|d| path.position.column(d).fold(f64::MIN, |max, y| max.max(*y)));
        let mut limits = limits(&REACH, [2.0, 2.0]);
        limits.upper = Some(highest.zip(REACH.ranges()).map(|(y, range)| y + 0.1 * range).collect());
        controller.set_limits(&limits).unwrap();
        let far: Vec<f64> = controller.style().iter().map(|s| s + 3.0).collect();
        let mut ticks = 0;
        while controller.step().unwrap() == Status::Working {
            ticks += 1;
            if ticks == command_at {
                controller.set_style(&far).unwrap();
            }
            n_pending += usize::from(controller.is_pending());
            assert!(ticks < 5000, "{command_at}: pending {}", controller.is_pending());
        }
        assert!(!controller.is_pending());
    }
    assert!(n_pending > 2000, "{n_pending}");
}

/// A command of τ leaves a pending goal pending: it is accepted at last.
#[test]
fn other_commands_do_not_discard_a_pending_goal() {
    let mut controller = controller(&REACH, 1e-3);
    let mut limits = limits(&REACH, [2.0, 2.0]);
    let upper: Vec<f64> = controller.centre().iter().zip(REACH.ranges()).map(|(g, range)| g + 0.35 * range).collect();
    limits.upper = Some(upper.clone());
    controller.set_limits(&limits).unwrap();
    for _ in 0..200 {
        controller.step().unwrap();
    }
    controller.set_goal(&upper).unwrap();
    controller.step().unwrap();
    assert!(controller.is_pending());
    controller.set_tau(1.1 * REACH.tau()).unwrap();
    while controller.step().unwrap() == Status::Working {
        assert!(controller.time() < 6.0);
    }
    assert_eq!(controller.centre(), upper);
}

/// Without limits, a pending goal is taken up as a whole, and new limits have nothing pending.
#[test]
fn pending_goal_is_taken_up_when_limits_are_removed() {
    let mut controller = controller(&REACH, 1e-3);
    let mut limits = limits(&REACH, [2.0, 2.0]);
    let upper: Vec<f64> = controller.centre().iter().zip(REACH.ranges()).map(|(g, range)| g + 0.35 * range).collect();
    limits.upper = Some(upper.clone());
    controller.set_limits(&limits).unwrap();
    for _ in 0..200 {
        controller.step().unwrap();
    }
    controller.set_goal(&upper).unwrap();
    assert!(controller.is_pending() && controller.centre() != upper);
    controller.set_limits(&Limits::default()).unwrap();
    assert_eq!(controller.centre(), upper);
    controller.set_limits(&limits).unwrap();
    assert!(!controller.is_pending());
}

/// A movement starts with its given velocity at any speed.
#[test]
fn given_velocity_does_not_depend_on_the_speed() {
    let velocity = vec![0.3, -0.2, 0.1];
    let conditions = Conditions { velocity: Some(velocity.clone()), ..Conditions::default() };
    let finite = [0.0, 1e-3, 0.5, 2.0].into_iter().flat_map(|speed| [(speed, false), (speed, true)]);
    for (speed, limited) in finite.chain([(f64::INFINITY, true)]) {
        let mut controller = Controller::new(REACH.primitive(), 1e-3, &conditions, None).unwrap();
        if limited {
            controller.set_limits(&limits(&REACH, [2.0, 2.0])).unwrap();
        }
        controller.set_speed(speed).unwrap();
        for (found, expected) in controller.velocity().iter().zip(&velocity) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected} at {speed}");
        }
    }
}

/// A movement that starts in a pause, or at a low speed, with a given velocity brakes from it within the limits: after a
/// restart in motion and from the start, with and without a limit of the jerk, filtered or switched. It stays near its start,
/// and resumes no faster than a demonstrated movement or the given velocity.
#[test]
fn given_velocity_is_braked_into_a_pause() {
    let dt = 1e-3;
    for (model, speed, transition, jerk) in [&*REACH, &*CYCLE].into_iter().flat_map(|model| {
        [(0.0, None, false), (0.0, None, true), (0.0, Some(0.0), false), (1e-3, None, false)]
            .map(|(speed, transition, jerk)| (model, speed, transition, jerk))
    }) {
        let mut limits = limits(model, [2.0, 2.0]);
        if jerk {
            limits.jerk = limits.acceleration.as_ref().map(|all| all.iter().map(|limit| 50.0 * limit).collect());
        }
        let peaks: Vec<f64> = limits.velocity.iter().flatten().map(|limit| 0.5 * limit).collect();
        for share in [1e-6, 0.1, 1.0] {
            let velocity: Vec<f64> = peaks.iter().map(|peak| share * peak).collect();
            let conditions = Conditions { velocity: Some(velocity.clone()), ..Conditions::default() };
            let mut controller = Controller::new(model.primitive(), dt, &Conditions::default(), transition).unwrap();
            controller.set_limits(&limits).unwrap();
            (0..50).for_each(|_| controller.step().map(drop).unwrap());
            controller.set_speed(speed).unwrap();
            controller.reset(&conditions).unwrap();
            let start = controller.position().to_vec();
            let mut before = controller.velocity().to_vec();
            assert!(before.iter().zip(&velocity).all(|(found, given)| (found - given).abs() < 1e-12));
            let mut away = 0.0f64;
            for _ in 0..1500 {
                controller.step().unwrap();
                let [velocity, acceleration] = used(&limits, &before, controller.velocity(), dt);
                assert!(velocity <= 1.0 + 1e-9 && acceleration <= 1.0 + 1e-9, "{velocity} {acceleration}");
                before.copy_from_slice(controller.velocity());
                for ((y, start), range) in controller.position().iter().zip(&start).zip(model.ranges()) {
                    away = away.max((y - start).abs() / range);
                }
            }
            assert!(away < 0.5 * share + 0.02 * (speed / 1e-3), "{away} at {share}");
            assert!(before.iter().zip(&peaks).all(|(v, peak)| v.abs() <= (10.0 * speed + 1e-9) * peak), "{before:?}");
            controller.set_speed(1.0).unwrap();
            for _ in 0..1500 {
                controller.step().unwrap();
                let [velocity, acceleration] = used(&limits, &before, controller.velocity(), dt);
                assert!(velocity <= 0.75 && acceleration <= 1.0 + 1e-9, "{velocity} {acceleration}");
                before.copy_from_slice(controller.velocity());
            }
        }
    }
}

/// Without limits, a given velocity passes into a pause without a step: its change over a tick is proportional to the tick.
#[test]
fn given_velocity_is_continuous_without_limits() {
    for model in [&*REACH, &*CYCLE] {
        let velocity = vec![0.3; model.n_dofs()];
        let conditions = Conditions { velocity: Some(velocity.clone()), ..Conditions::default() };
        let largest = |dt: f64| {
            let mut controller = Controller::new(model.primitive(), dt, &conditions, None).unwrap();
            controller.set_speed(0.0).unwrap();
            let (mut before, mut largest) = (velocity.clone(), 0.0f64);
            for _ in 0..(1.5 / dt) as usize {
                controller.step().unwrap();
                for (v, before) in controller.velocity().iter().zip(&before) {
                    largest = largest.max((v - before).abs());
                }
                before.copy_from_slice(controller.velocity());
            }
            assert!(before.iter().all(|v| v.abs() < 1e-12), "{before:?}");
            largest
        };
        let [coarse, fine] = [2e-3, 2e-4].map(largest);
        assert!((9.0..11.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}

/// A restored controller continues to the bit, slowed, governed or perturbed.
#[test]
fn snapshots_continue_within_limits() {
    for model in [&*REACH, &*CYCLE] {
        let mut controller = controller(model, 2e-3);
        let mut limits = limits(model, [0.6, 0.5]);
        limits.upper = Some(controller.centre().iter().zip(model.ranges()).map(|(g, range)| g + 0.8 * range).collect());
        controller.set_limits(&limits).unwrap();
        let goal: Vec<f64> = limits.upper.iter().flatten().map(|upper| upper - 0.01).collect();
        for tick in 0..400 {
            if tick == 150 {
                let rhythmic = model.kind() == Kind::Rhythmic;
                if rhythmic { controller.set_anchor(&goal) } else { controller.set_goal(&goal) }.unwrap();
            }
            let measured: Vec<f64> = controller.position().iter().map(|y| y + 0.01).collect();
            let command = Command { measured: (tick % 90 == 80).then_some(&measured), ..Command::default() };
            controller.step_with(&command).unwrap();
            if tick % 23 == 0 {
                let mut restored = Controller::restore(model.primitive(), &controller.snapshot()).unwrap();
                let mut copy = controller.clone();
                for _ in 0..60 {
                    restored.step().unwrap();
                    copy.step().unwrap();
                    assert_eq!(restored.position(), copy.position(), "{tick}");
                    assert_eq!(restored.limited(), copy.limited());
                    assert_eq!(restored.is_pending(), copy.is_pending());
                }
            }
        }
    }
}
