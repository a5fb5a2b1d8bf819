//! Limits of the jerk in the control loop.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/rare_commands.rs"]
mod rare_commands;

use common::*;
use counting::{Random, allocations};
use pdmp_core::motion::{Limit, Limits};
use pdmp_core::{Command, Conditions, Controller, Error, Kind, LimitError, Model, Status};
use rare_commands::*;

/// Position, velocity and acceleration of one DoF.
type State = [f64; 3];

fn states(controller: &Controller) -> Vec<State> {
    let [y, v, a] = [controller.position(), controller.velocity(), controller.acceleration()];
    (0..y.len()).map(|d| [y[d], v[d], a[d]]).collect()
}

/// Limits of one DoF: lower, upper, velocity, acceleration, jerk.
fn of_dof(limits: &Limits, d: usize) -> [f64; 5] {
    [&limits.lower, &limits.upper, &limits.velocity, &limits.acceleration, &limits.jerk]
        .map(|limit| limit.as_ref().unwrap()[d])
}

/// Returns the largest violations by a tick of `h` seconds: of position and velocity as shares of their range, of the
/// acceleration, and of its change beyond Jh as a share of A, and of the change of the velocity beyond that of the jerk.
fn violation(limits: &Limits, before: &[State], after: &[State], h: f64) -> f64 {
    let of_dof = |(d, (from, to)): (usize, (&State, &State))| {
        let [lower, upper, velocity, acceleration, jerk] = of_dof(limits, d);
        let change = to[2] - from[2];
        let deviation = (to[1] - from[1] - 0.5 * h * (from[2] + to[2])).abs();
        [
            (to[0] - upper).max(lower - to[0]) / (upper - lower),
            to[1].abs() / velocity - 1.0,
            to[2].abs() / acceleration - 1.0,
            (change.abs() - jerk * h) / acceleration,
            ((to[1] - from[1]).abs() - acceleration * h) / velocity,
            (deviation - 0.25 * (jerk * h * h - change * change / jerk)) / velocity,
        ]
        .into_iter()
        .fold(0.0, f64::max)
    };
    before.iter().zip(after).enumerate().map(of_dof).fold(0.0, f64::max)
}

fn limits_around(controller: &Controller, ranges: &[f64], random: &mut Random) -> Limits {
    let side = |sign: f64, random: &mut Random| {
        let sides = controller.position().iter().zip(ranges);
        Some(sides.map(|(y, range)| y + sign * range * random.scale(0.03, 3.0)).collect())
    };
    let velocity: Vec<f64> = ranges.iter().map(|range| range * random.scale(0.1, 10.0)).collect();
    let acceleration: Vec<f64> = velocity.iter().map(|velocity| velocity * random.scale(1.0, 100.0)).collect();
    Limits {
        lower: side(-1.0, random),
        upper: side(1.0, random),
        jerk: Some(acceleration.iter().map(|acceleration| acceleration * random.scale(1.0, 1e4)).collect()),
        velocity: Some(velocity),
        acceleration: Some(acceleration),
        ..Limits::default()
    }
}

/// A controller at rest inside the limits.
fn at_rest(model: &Model) -> Controller {
    let velocity = Some(vec![0.0; model.n_dofs()]);
    Controller::new(model.primitive(), 1e-3, &Conditions { velocity, ..Conditions::default() }, None).unwrap()
}

/// The start of a movement from where another one is.
fn going_on(controller: &Controller) -> Conditions {
    let (start, velocity) = (controller.position().to_vec(), controller.velocity().to_vec());
    Conditions { start: Some(start), velocity: Some(velocity), ..Conditions::default() }
}

/// No sequence of commands, restarts, measurements, coupling terms and tick lengths from 1e-6 to 0.1 s breaks a limit, in over a million
/// ticks of joints, and none allocates.
#[test]
fn no_command_breaks_a_limit() {
    let mut random = Random(7);
    let (mut joint_ticks, mut worst, mut named, mut restarts) = (0, 0.0f64, [0usize; 4], 0);
    for case in 0..160 {
        let model = [&*REACH, &*CYCLE][case % 2];
        let n = model.n_dofs();
        let discrete = model.kind() == Kind::Discrete;
        let mut controller = at_rest(model);
        let wide = limits_around(&controller, model.ranges(), &mut random);
        controller.set_limits(&wide).unwrap();
        controller.step_with(&Command { dt: Some(1e-6), ..Command::default() }).unwrap();
        let mut before = states(&controller);
        let (mut goal, mut measured, mut terms) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut style = vec![0.0; model.n_styles()];
        for tick in 0..3000 {
            let h = if case % 3 == 0 { 1e-3 } else { random.scale(1e-6, 0.1) };
            let size = random.scale(0.1, 100.0);
            for (vector, size) in [(&mut goal, size), (&mut measured, 1.0), (&mut terms, size)] {
                for (d, number) in vector.iter_mut().enumerate() {
                    *number = controller.centre()[d] + model.ranges()[d] * size * random.between(-1.0, 1.0);
                }
            }
            style.iter_mut().for_each(|number| *number = random.between(-2.0, 2.0));
            let allocated = allocations();
            let numbers = Numbers { centre: &goal, style: &style, measured: &measured, terms: &terms };
            let command = rare_command(model, h, &numbers, &mut random);
            controller.step_with(&command).unwrap();
            if rare(&mut random) {
                controller.set_speed(random.between(0.0, 2.0).floor()).unwrap();
            }
            if rare(&mut random) {
                controller.release();
            }
            if rare(&mut random) {
                controller.set_limits(&wide).unwrap();
            }
            assert_eq!(allocations(), allocated);
            if discrete && rare(&mut random) {
                controller.set_speed(1.0).unwrap();
                controller.reset(&going_on(&controller)).unwrap();
                restarts += 1;
            }
            let after = states(&controller);
            assert!(after.iter().flatten().all(|x| x.is_finite()), "{case} {tick}");
            worst = worst.max(violation(&wide, &before, &after, h));
            assert!(worst <= 1e-12, "{case} {tick}: {worst}, {before:?} to {after:?} in {h} at {wide:?}");
            before = after;
            joint_ticks += n;
            controller.limited().iter().flatten().for_each(|limit| named[*limit as usize] += 1);
        }
    }
    println!("{joint_ticks} ticks of joints, worst {worst:e}, limited by {named:?}");
    assert!(joint_ticks > 1_000_000 && restarts > 1000, "{joint_ticks} {restarts}");
    assert!(named.iter().all(|ticks| *ticks > 1000), "{named:?}");
}

/// A limit of the jerk that does not bind changes nothing, to the last bit; infinity is none.
#[test]
fn wide_limits_change_nothing() {
    for model in [&*REACH, &*CYCLE] {
        let n = model.n_dofs();
        let wide = |number: f64| Some(vec![number; n]);
        for jerk in [1e9, f64::INFINITY] {
            let limits = Limits { velocity: wide(1e4), acceleration: wide(1e6), jerk: wide(jerk), ..Limits::default() };
            let mut free = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
            let mut limited = free.clone();
            limited.set_limits(&limits).unwrap();
            let moved = vec![0.3; n];
            for tick in 0..2000 {
                let command = match model.kind() {
                    Kind::Discrete => Command { goal: (tick == 300).then_some(&moved), ..Command::default() },
                    Kind::Rhythmic => Command { anchor: (tick == 300).then_some(&moved), ..Command::default() },
                };
                assert_eq!(free.step_with(&command).unwrap(), limited.step_with(&command).unwrap());
                assert_eq!(states(&free), states(&limited));
                assert!(limited.limited().iter().all(Option::is_none));
            }
        }
    }
}

/// A movement begins with zero acceleration and finishes at its goal for any ratio of jerk and acceleration, longer for smaller
/// ones and without swinging past the goal by more than it does when it is free.
#[test]
fn movement_begins_smoothly_and_finishes() {
    let goal: Vec<f64> =
        at_rest(&REACH).centre().iter().zip(REACH.ranges()).map(|(y, range)| y + 0.5 * range).collect();
    let mut durations = Vec::new();
    for ratio in [1000.0, 30.0, 3.0, 1.0] {
        let mut controller = Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        let acceleration: Vec<f64> = REACH.ranges().iter().map(|range| 20.0 * range).collect();
        let jerk = acceleration.iter().map(|acceleration| ratio * acceleration).collect();
        let limits = Limits { acceleration: Some(acceleration), jerk: Some(jerk), ..Limits::default() };
        controller.set_limits(&limits).unwrap();
        assert!(controller.acceleration().iter().all(|a| *a == 0.0));
        let mut farthest = 0.0f64;
        while controller.step().unwrap() == Status::Working || controller.time() < 0.5 {
            if controller.time() > 0.4 && controller.centre() != goal {
                controller.set_goal(&goal).unwrap();
            }
            let past = controller
                .position()
                .iter()
                .zip(&goal)
                .zip(REACH.ranges())
                .map(|((y, goal), range)| (y - goal) / range);
            farthest = past.fold(farthest, f64::max);
            assert!(controller.time() < 10.0, "{ratio}");
        }
        assert!(farthest < 0.15, "{ratio}: {farthest}");
        durations.push(controller.time());
    }
    println!("{durations:?}");
    assert!(durations[0] < 2.0 && durations[3] > durations[0], "{durations:?}");
}

/// A limit of the jerk needs one of the acceleration, and is positive.
#[test]
fn jerk_without_acceleration_is_refused() {
    let mut controller = at_rest(&REACH);
    let jerk = |jerk: f64| Some(vec![1e3, jerk, 1e3]);
    let error = controller.set_limits(&Limits { jerk: jerk(5.0), ..Limits::default() }).unwrap_err();
    assert!(matches!(error, Error::Limits(LimitError::JerkAlone { dof: 0, jerk: 1e3 })), "{error}");
    let acceleration = Some(vec![1.0, f64::INFINITY, 1.0]);
    let error = controller.set_limits(&Limits { jerk: jerk(5.0), acceleration, ..Limits::default() }).unwrap_err();
    assert!(error.to_string().starts_with("limits of DoF 1: a jerk of 5 needs a limit of the acceleration"), "{error}");
    let acceleration = Some(vec![1.0; 3]);
    let error = controller.set_limits(&Limits { jerk: jerk(0.0), acceleration, ..Limits::default() }).unwrap_err();
    assert!(error.to_string().starts_with("jerk = 0: "), "{error}");
    assert_eq!(
        controller.limits(),
        Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), None).unwrap().limits()
    );
}

/// A copy and a restored snapshot continue to the bit while the jerk is limited.
#[test]
fn copies_continue_identically() {
    let mut controller = at_rest(&REACH);
    let limits = Limits { acceleration: Some(vec![5.0]), jerk: Some(vec![40.0]), ..Limits::default() };
    controller.set_limits(&limits).unwrap();
    while !controller.limited().contains(&Some(Limit::Jerk)) || controller.time() < 0.1 {
        controller.step().unwrap();
    }
    let mut twins = [controller.clone(), Controller::restore(REACH.primitive(), &controller.snapshot()).unwrap()];
    for _ in 0..500 {
        controller.step().unwrap();
        for twin in &mut twins {
            twin.step().unwrap();
            assert_eq!(states(twin), states(&controller));
            assert_eq!(twin.limited(), controller.limited());
        }
    }
}
