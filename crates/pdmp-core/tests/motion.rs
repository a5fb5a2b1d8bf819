//! Controller and rollout: convergence, invariances, continuity, settling, and rejected commands.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/accepted.rs"]
mod accepted;
mod common;

use std::f64::consts::TAU;
use std::sync::{Arc, LazyLock};

use accepted::mostly_accepted;
use common::*;
use ndarray::Array2;
use pdmp_core::learning::Truncation;
use pdmp_core::motion::TimeGrid;
use pdmp_core::motion::rollout_with;
use pdmp_core::rollout;
use pdmp_core::{Command, Conditions, Controller, Demonstration, Error, Kind, Model, Sampling, Status};
use proptest::prelude::*;

fn controller(model: &Arc<Model>, dt: f64) -> Controller {
    Controller::new(model.primitive(), dt, &Conditions::default(), None).unwrap()
}

fn advance(controller: &mut Controller, ticks: usize) {
    for _ in 0..ticks {
        controller.step().unwrap();
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

proptest! {
    /// The goal is reached for any style, goal and start.
    #[test]
    fn goal_is_reached_for_any_style(
        style in prop::collection::vec(-2.0..2.0f64, 2),
        goal in prop::collection::vec(-5.0..5.0f64, 3),
        start in prop::collection::vec(-5.0..5.0f64, 3),
    ) {
        let conditions =
            Conditions { style: Some(style), goal: Some(goal.clone()), start: Some(start), ..Default::default() };
        let end = rollout(REACH.primitive(), &conditions, grid(0.01, 6.0)).unwrap();
        prop_assert!(distance(end.position.row(600).as_slice().unwrap(), &goal) < 1e-6);
        prop_assert!(end.velocity.row(600).iter().all(|v| v.abs() < 1e-6));
    }

    /// τ scales time and leaves the path unchanged.
    #[test]
    fn tau_does_not_change_the_path(factor in 0.2..5.0f64) {
        for model in [&*REACH, &*CYCLE] {
            let slow = Conditions { tau: Some(factor * model.tau()), ..Default::default() };
            let a = rollout(model.primitive(), &Conditions::default(), grid(0.01, 1.5)).unwrap();
            let b = rollout(model.primitive(), &slow, grid(0.01 * factor, 1.5 * factor)).unwrap();
            prop_assert!((&a.position - &b.position).iter().all(|d| d.abs() < 1e-9));
            prop_assert!((&a.velocity - &b.velocity * factor).iter().all(|d| d.abs() < 1e-8));
        }
    }

    /// r₀ scales the oscillation about its anchor.
    #[test]
    fn amplitude_scales_the_oscillation(amplitude in 0.0..3.0f64, anchor in prop::collection::vec(-5.0..5.0f64, 2)) {
        let conditions = Conditions { anchor: Some(anchor.clone()), ..Default::default() };
        let one = rollout(CYCLE.primitive(), &conditions, grid(0.01, 2.0)).unwrap().position;
        let conditions = Conditions { amplitude: Some(amplitude), ..conditions };
        let scaled = rollout(CYCLE.primitive(), &conditions, grid(0.01, 2.0)).unwrap().position;
        for (one, scaled) in one.rows().into_iter().zip(scaled.rows()) {
            for d in 0..2 {
                prop_assert!((scaled[d] - anchor[d] - amplitude * (one[d] - anchor[d])).abs() < 1e-12);
            }
        }
    }
}

/// Valid and invalid commands leave the state finite for ticks of any length; a rejected one leaves the position unchanged.
#[test]
fn random_commands_leave_the_state_finite() {
    let commands = prop::collection::vec((0..12u8, -1e3..1e3f64, 1e-6..3.0f64), 1..60);
    mostly_accepted(commands, |commands, tally| {
        for model in [&*REACH, &*CYCLE] {
            let mut controller = controller(model, 0.001);
            let n = model.n_dofs();
            for &(field, value, dt) in &commands {
                let before = controller.position().to_vec();
                let accepted = tally.count(match (field, model.kind()) {
                    (0..=2, _) => controller.set_style(&[value; 2]),
                    (3..=5, Kind::Discrete) | (10, Kind::Rhythmic) => controller.set_goal(&vec![value; n]),
                    (3..=5, Kind::Rhythmic) | (10, Kind::Discrete) => controller.set_anchor(&vec![value; n]),
                    (6..=8, _) => controller.set_tau(value.abs() + 1e-3),
                    (9, _) => controller.set_amplitude(value),
                    _ => controller.set_style(&[f64::NAN; 2]),
                });
                prop_assert!(accepted || controller.position() == before);
                tally.count(tick(&mut controller, &Command { dt: Some(dt), ..Command::default() }));
                for values in [controller.position(), controller.velocity(), controller.acceleration()] {
                    prop_assert!(values.iter().all(|x| x.is_finite()));
                }
            }
        }
        Ok(())
    });
}

/// Step k of a controller equals sample k of the rollout.
#[test]
fn rollout_equals_the_repeated_step() {
    for model in [&*REACH, &*CYCLE] {
        let rollout = rollout(model.primitive(), &Conditions::default(), grid(0.004, 2.0)).unwrap();
        assert_eq!(rollout.time.len(), 501);
        let mut controller = controller(model, 0.004);
        for k in 0..=500 {
            assert_eq!(controller.position(), rollout.position.row(k).as_slice().unwrap());
            assert_eq!(controller.acceleration(), rollout.acceleration.row(k).as_slice().unwrap());
            controller.step().unwrap();
        }
    }
}

/// Rollouts at 1 kHz agree with those at 10 kHz within 1e-8, and those at 100 Hz within 1e-6, also past the end and for a
/// movement of 0.3 s.
#[test]
fn motion_hardly_depends_on_the_tick_length() {
    for model in [&*REACH, &*CYCLE] {
        for tau in [model.tau(), 0.3 * model.tau()] {
            let conditions = Conditions { tau: Some(tau), ..Default::default() };
            let fine = rollout(model.primitive(), &conditions, grid(1e-4, 2.0)).unwrap().position;
            for (dt, every, bound) in [(1e-3, 10, 1e-8), (1e-2, 100, 1e-6)] {
                let coarse = rollout(model.primitive(), &conditions, grid(dt, 2.0)).unwrap().position;
                for (k, row) in coarse.rows().into_iter().enumerate() {
                    let error = distance(row.as_slice().unwrap(), fine.row(k * every).as_slice().unwrap());
                    assert!(error <= bound, "dt {dt}, sample {k}: {error:e}");
                }
            }
        }
    }
}

/// Velocity and acceleration are the derivatives of the position, also while all commands are in transition.
#[test]
fn velocity_and_acceleration_are_derivatives() {
    for model in [&*REACH, &*CYCLE] {
        let dt = 1e-5;
        let mut controller = controller(model, dt);
        let mut samples = Vec::new();
        for k in 0..40_000 {
            if k == 10_000 {
                controller.set_style(&[0.9, -0.4]).unwrap();
                controller.set_tau(0.6 * model.tau()).unwrap();
                let _ = controller.set_goal(&[0.1, 0.2, 0.3]);
                let _ = controller.set_anchor(&[0.1, 0.2]);
                let _ = controller.set_amplitude(1.7);
            }
            controller.step().unwrap();
            samples.push((
                controller.position().to_vec(),
                controller.velocity().to_vec(),
                controller.acceleration().to_vec(),
            ));
        }
        for k in (5..39_995).filter(|k| !(9998..10_003).contains(k)) {
            for d in 0..model.n_dofs() {
                let velocity = (samples[k + 1].0[d] - samples[k - 1].0[d]) / (2.0 * dt);
                let acceleration = (samples[k + 1].1[d] - samples[k - 1].1[d]) / (2.0 * dt);
                assert!((velocity - samples[k].1[d]).abs() < 1e-5, "{k} {d} {velocity} {}", samples[k].1[d]);
                assert!((acceleration - samples[k].2[d]).abs() < 2e-3, "{k} {d} {acceleration} {}", samples[k].2[d]);
            }
        }
    }
}

/// By default position and velocity stay continuous when all commands change at once; `transition = 0` makes the velocity
/// jump.
#[test]
fn commands_are_continuous_unless_immediate() {
    let jump = |transition| {
        let mut controller = Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), transition).unwrap();
        advance(&mut controller, 400);
        let before = (controller.position().to_vec(), controller.velocity().to_vec());
        controller.set_style(&[-0.9, 0.9]).unwrap();
        controller.set_tau(0.4 * REACH.tau()).unwrap();
        controller.set_goal(&[2.0, -1.0, 0.5]).unwrap();
        tick(&mut controller, &Command { dt: Some(1e-9), ..Command::default() }).unwrap();
        (distance(controller.position(), &before.0), distance(controller.velocity(), &before.1))
    };
    let (position, velocity) = jump(None);
    assert!(position < 1e-7 && velocity < 1e-6, "{position:e} {velocity:e}");
    let (position, velocity) = jump(Some(0.0));
    assert!(position < 1e-7 && velocity > 0.1, "{position:e} {velocity:e}");
}

/// The phase stays continuous and increasing when τ changes.
#[test]
fn phase_never_jumps() {
    let mut controller = controller(&CYCLE, 1e-3);
    let mut phase = controller.phase();
    for k in 0..2000 {
        if k % 100 == 50 {
            controller.set_tau(CYCLE.tau() * if k % 200 == 50 { 0.3 } else { 3.0 }).unwrap();
        }
        controller.step().unwrap();
        let advance = (controller.phase() - phase).rem_euclid(std::f64::consts::TAU);
        assert!(advance > 0.0 && advance <= 1e-3 / (0.3 * CYCLE.tau()) * 1.0001);
        phase = controller.phase();
    }
}

/// After online changes a rhythmic movement converges to the cycle of the new style, anchor, amplitude and period.
#[test]
fn online_changes_converge_to_the_new_cycle() {
    let target = Conditions {
        style: Some(CYCLE.demonstrated().styles.row(3).to_vec()),
        anchor: Some(vec![0.5, 0.5]),
        amplitude: Some(1.5),
        tau: Some(1.3 * CYCLE.tau()),
        ..Default::default()
    };
    let mut controller = controller(&CYCLE, 1e-3);
    advance(&mut controller, 777);
    controller.set_style(target.style.as_ref().unwrap()).unwrap();
    controller.set_anchor(&[0.5, 0.5]).unwrap();
    controller.set_amplitude(1.5).unwrap();
    controller.set_tau(1.3 * CYCLE.tau()).unwrap();
    advance(&mut controller, 20_000);
    let at = controller.phase() * 1.3 * CYCLE.tau();
    let cycle = rollout(CYCLE.primitive(), &target, grid(at, at)).unwrap();
    assert!(distance(controller.position(), cycle.position.row(1).as_slice().unwrap()) < 1e-8);
}

/// A rhythmic movement converges to its limit cycle from a distant start.
#[test]
fn limit_cycle_attracts() {
    let off = Conditions { start: Some(vec![40.0, -30.0]), ..Default::default() };
    let (a, b) = (
        rollout(CYCLE.primitive(), &off, grid(0.01, 4.0)).unwrap(),
        rollout(CYCLE.primitive(), &Conditions::default(), grid(0.01, 4.0)).unwrap(),
    );
    assert_eq!(a.position.row(0).to_vec(), [40.0, -30.0]);
    assert!((&a.position - &b.position).row(400).iter().all(|d| d.abs() < 1e-8));
}

/// The first sample has the given start velocity.
#[test]
fn start_velocity_is_respected() {
    for model in [&*REACH, &*CYCLE] {
        let velocity: Vec<f64> = (0..model.n_dofs()).map(|d| d as f64 - 0.7).collect();
        let conditions = Conditions { velocity: Some(velocity.clone()), ..Default::default() };
        let rollout = rollout(model.primitive(), &conditions, grid(0.01, 0.1)).unwrap();
        assert!(distance(rollout.velocity.row(0).as_slice().unwrap(), &velocity) < 1e-12);
    }
}

/// Commands before the first step apply from the start.
#[test]
fn commands_before_the_first_step_apply_at_once() {
    let conditions = Conditions {
        style: Some(vec![0.3, 0.2]),
        goal: Some(vec![1.0, 2.0, 3.0]),
        tau: Some(0.7),
        ..Default::default()
    };
    let rollout = rollout(REACH.primitive(), &conditions, grid(1e-3, 0.5)).unwrap();
    let mut controller = controller(&REACH, 1e-3);
    controller.set_style(&[0.3, 0.2]).unwrap();
    controller.set_goal(&[1.0, 2.0, 3.0]).unwrap();
    controller.set_tau(0.7).unwrap();
    advance(&mut controller, 500);
    assert_eq!(controller.position(), rollout.position.row(500).as_slice().unwrap());
}

/// A discrete movement finishes after its duration, at rest on its goal; a reset restarts it.
#[test]
fn movement_finishes_when_settled_and_restarts() {
    let mut controller = controller(&REACH, 1e-3);
    let first = controller.position().to_vec();
    let mut ticks = 1;
    while controller.step().unwrap() == Status::Working {
        ticks += 1;
        assert!(ticks < 5000);
    }
    assert!(f64::from(ticks) * 1e-3 >= REACH.duration() - 1e-9);
    let goal = REACH.demonstrated().goals.row(REACH.demonstrated().nominal).to_vec();
    assert!(distance(controller.position(), &goal) < 1e-3 && controller.velocity().iter().all(|v| v.abs() < 2e-3));
    controller.reset(&Conditions::default()).unwrap();
    assert_eq!((controller.position(), controller.time()), (first.as_slice(), 0.0));
    assert_eq!(controller.step().unwrap(), Status::Working);
}

/// Movements that end in motion, with braking at the rate α_z and above.
static ENDS_IN_MOTION: LazyLock<[Arc<Model>; 2]> = LazyLock::new(|| {
    [0.4, 3.3].map(|turns| {
        let demo = |size: f64| {
            let position = Array2::from_shape_fn((101, 2), |(c, d)| {
                let s = c as f64 / 100.0;
                size * if d == 0 { s * s } else { (turns * TAU * s).sin() * s + size * s.powi(3) }
            });
            Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
        };
        let options = options(Kind::Discrete).n_styles(Truncation::Rank(2));
        learn(&[demo(0.7), demo(1.0), demo(1.2)], &options)
    })
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Finished movements stay within the tolerance of their goal, after any late command; without one they finish as
    /// soon as |y − g| + 2τ|ẏ|/α_z stays within it.
    #[test]
    fn finished_movements_stay_within_their_tolerance(
        style in prop::collection::vec(-2.0..2.0f64, 2),
        tolerance in prop_oneof![Just(0.005), 1e-4..0.05f64],
        transition in prop_oneof![Just(0.0), 0.01..0.3f64],
        late in prop::option::of((prop::bool::ANY, prop::collection::vec(-1.0..1.0f64, 2), 0.5..1.2f64)),
    ) {
        for model in &*ENDS_IN_MOTION {
            let conditions = Conditions { style: Some(style.clone()), ..Conditions::default() };
            let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, Some(transition)).unwrap();
            controller.set_tolerance(tolerance).unwrap();
            let distances = |controller: &Controller| -> Vec<f64> {
                controller.position().iter().zip(controller.centre()).map(|(y, g)| (y - g).abs()).collect()
            };
            let mut lengths: Vec<f64> =
                distances(&controller).iter().zip(model.ranges()).map(|(d, range)| d.max(*range)).collect();
            let (mut finished, mut settled) = (None, 0);
            for k in 1..6000 {
                if let Some((is_goal, value, _)) = late.as_ref().filter(|(_, _, at)| k == (1e3 * at) as usize) {
                    finished = None;
                    if *is_goal { controller.set_goal(value) } else { controller.set_style(value) }.unwrap();
                    lengths = distances(&controller).iter().zip(model.ranges()).map(|(d, range)| d.max(*range)).collect();
                }
                let status = controller.step().unwrap();
                finished = finished.or((status == Status::Finished).then_some(k));
                let overshoot = controller.velocity().iter().map(|v| 2.0 * model.tau() * v.abs() / 25.0);
                let distances = distances(&controller);
                let relative = |values: &[f64]| {
                    values.iter().zip(&lengths).map(|(value, length)| value / length).fold(0.0, f64::max)
                };
                if finished.is_some() {
                    prop_assert!(relative(&distances) <= 1.001 * tolerance);
                }
                let bounds: Vec<f64> = distances.iter().zip(overshoot).map(|(d, v)| d + v).collect();
                if relative(&bounds) > tolerance {
                    settled = k + 1;
                }
            }
            prop_assert!(finished.is_some());
            if late.is_none() {
                prop_assert!(finished.unwrap() <= settled.max(1000) + 2, "{finished:?} {settled}");
            }
        }
    }
}

/// A movement finishes at the goal in force after any earlier goals, and not while the goal is in transition.
#[test]
fn movement_finishes_at_the_goal_in_force() {
    let nominal = REACH.demonstrated().goals.row(REACH.demonstrated().nominal).to_vec();
    let mut far = controller(&REACH, 1e-3);
    advance(&mut far, 10);
    far.set_goal(&[1e4; 3]).unwrap();
    advance(&mut far, 10);
    far.set_goal(&nominal).unwrap();
    while far.step().unwrap() == Status::Working {}
    // The tolerance is a share of the largest distance from the goal, about a hundred.
    assert!(distance(far.position(), &nominal) < 0.1, "{:?}", far.position());

    let mut back = controller(&REACH, 1e-3);
    while back.step().unwrap() == Status::Working {}
    back.set_goal(&[10.0; 3]).unwrap();
    back.step().unwrap();
    back.set_goal(&nominal).unwrap();
    while back.step().unwrap() == Status::Working {}
    advance(&mut back, 20);
    assert!(distance(back.position(), &nominal) < 0.01, "{:?}", back.position());
}

/// A movement does not finish while the style in transition still moves it away from its goal.
#[test]
fn movement_finishes_in_the_style_in_force() {
    let nominal = REACH.demonstrated().goals.row(REACH.demonstrated().nominal).to_vec();
    let range = REACH.ranges().iter().copied().fold(0.0, f64::max);
    for size in [1.0, 30.0, 1000.0] {
        let conditions =
            Conditions { style: Some(vec![0.0; 2]), start: Some(nominal.clone()), ..Conditions::default() };
        let mut late = Controller::new(REACH.primitive(), 1e-3, &conditions, None).unwrap();
        while late.time() < 1.001 * REACH.duration() {
            late.step().unwrap();
        }
        late.set_style(&[size; 2]).unwrap();
        while late.step().unwrap() == Status::Working {}
        let mut farthest = 0.0f64;
        for _ in 0..3000 {
            late.step().unwrap();
            farthest = farthest.max(distance(late.position(), &nominal));
        }
        assert!(farthest < 5e-3 * range, "{size}: {farthest:e} of {range}");
    }
}

/// A controller with a tick of any length can be created, and rejects a tick of more than 1000 τ.
#[test]
fn ticks_of_extreme_length_are_rejected() {
    for dt in [1e100, 1e160, f64::MAX] {
        let mut controller = controller(&REACH, dt);
        assert!(matches!(controller.step(), Err(Error::Range { name: "dt", .. })));
        let grid = TimeGrid { dt, duration: Some(f64::MAX) };
        let _ = rollout(REACH.primitive(), &Conditions::default(), grid);
    }
}

/// Commands at the limits of all ranges at once leave the motion finite.
#[test]
fn commands_at_all_limits_leave_the_motion_finite() {
    for model in [&*REACH, &*CYCLE] {
        for transition in [0.0, 1e-307, 1e-3, 1e6 * model.duration()] {
            for (size, tau, dt) in [(1e100, 1e-6, 1e-4), (1e100, 1e6, 1e4), (-1e50, 1e6, 1e8), (0.0, 1e-6, 1e-9)] {
                let conditions = Conditions::default();
                let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, Some(transition)).unwrap();
                controller.step().unwrap();
                let (style, centre) = ([size; 2], vec![size; model.n_dofs()]);
                let discrete = model.kind() == Kind::Discrete;
                let command = Command {
                    dt: Some(dt),
                    style: Some(&style),
                    goal: discrete.then_some(&centre),
                    goal_velocity: discrete.then_some(&centre),
                    anchor: (!discrete).then_some(&centre),
                    tau: Some(tau * model.tau()),
                    amplitude: (!discrete).then_some(1e45),
                    measured: Some(&centre),
                    ..Command::default()
                };
                for _ in 0..20 {
                    let _ = tick(&mut controller, &command);
                    let motion = [controller.position(), controller.velocity(), controller.acceleration()];
                    assert!(motion.into_iter().flatten().all(|x| x.is_finite()), "{transition} {size} {tau} {dt}");
                    assert!(controller.phase().is_finite());
                }
            }
        }
    }
}

/// A rejected command leaves the last valid one in force.
#[test]
fn rejected_commands_leave_the_last_valid_value() {
    let mut controller = controller(&REACH, 1e-3);
    controller.set_goal(&[1.0, 2.0, 3.0]).unwrap();
    for bad in [vec![f64::NAN; 3], vec![1.0; 2], vec![f64::INFINITY, 0.0, 0.0], vec![1e200; 3]] {
        assert!(controller.set_goal(&bad).is_err());
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        assert!(controller.set_tau(bad).is_err());
        // A tick of length zero is valid: nothing moves.
        let rejected = tick(&mut controller, &Command { dt: Some(bad), ..Command::default() }).is_err();
        assert_eq!(rejected, bad != 0.0);
    }
    assert!(matches!(controller.set_anchor(&[0.0; 3]), Err(Error::Kind { .. })));
    assert!(matches!(controller.set_amplitude(1.0), Err(Error::Kind { .. })));
    assert_eq!((controller.centre(), controller.tau()), ([1.0, 2.0, 3.0].as_slice(), REACH.tau()));
}

/// A rollout has ⌊duration/dt⌋ + 1 samples; a duration that is a multiple of dt up to rounding keeps its last sample.
#[test]
fn rollouts_have_the_stated_number_of_samples() {
    for (dt, duration, samples) in [(0.1, 0.3, 4), (0.1, 0.35, 4), (0.01, 1.0, 101), (0.001, 2.0, 2001), (0.7, 0.0, 1)]
    {
        let rollout = rollout(REACH.primitive(), &Conditions::default(), grid(dt, duration)).unwrap();
        assert_eq!(rollout.time.len(), samples);
    }
}

/// A demonstrated context predicts the goal and the duration of its demonstration.
#[test]
fn context_predicts_its_demonstration() {
    // The durations are not linear in the context, hence the wider tolerance.
    let prediction = REACH.predict(&[0.3]).unwrap();
    let goals = &REACH.demonstrated().goals;
    assert!(distance(prediction.conditions.goal.as_ref().unwrap(), goals.row(2).as_slice().unwrap()) < 1e-9);
    assert!((prediction.duration - REACH.demonstrated().durations[2]).abs() < 0.01);
    let conditions = prediction.conditions;
    assert!((conditions.time_constant(&REACH).unwrap() - prediction.duration).abs() < 1e-12);
    assert!(matches!(CYCLE.predict(&[0.3]), Err(Error::Argument { name: "context", .. })));
    assert!(REACH.predict(&[0.3, 0.1]).is_err() && REACH.predict(&[f64::NAN]).is_err());
}

/// A long rollout reports its progress, and an error of the callback cancels it.
#[test]
fn rollouts_can_be_cancelled() {
    let mut calls = 0;
    let mut progress = |completed: f64| {
        calls += 1;
        if completed < 0.5 { Ok(()) } else { Err(Error::Interrupted) }
    };
    let cancelled = rollout_with(REACH.primitive(), &Conditions::default(), grid(1e-5, 1.0), &mut progress);
    assert!(matches!(cancelled, Err(Error::Interrupted)));
    assert!(calls > 10);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// The path does not depend on the rate: movements at any sequence of speeds and τ, with pauses, pass the same
    /// positions, also past the end and after commands.
    #[test]
    fn path_does_not_depend_on_the_rate(rates in prop::collection::vec((0..4u8, 0.2..1.5f64), 6)) {
        for model in [&*REACH, &*CYCLE] {
            let dt = 2e-4;
            let make = || Controller::new(model.primitive(), dt, &Conditions::default(), None).unwrap();
            let clock = |controller: &Controller| match model.canonical() {
                pdmp_core::dynamics::Canonical::Discrete { alpha_x, .. } => -controller.phase().ln() / alpha_x,
                pdmp_core::dynamics::Canonical::Rhythmic { .. } => controller.phase(),
            };
            // Advances to a clock, with a last tick of the remaining length. Returns whether the clock is reached.
            let advance_to = |controller: &mut Controller, to: f64, rates: &[(u8, f64)]| {
                for k in 0..100_000 {
                    if k % 400 == 0 && !rates.is_empty() {
                        let (command, factor) = rates[k / 400 % rates.len()];
                        match command {
                            0 => controller.set_speed(0.0).unwrap(),
                            1 => {
                                controller.set_speed(1.0).unwrap();
                                controller.set_tau(factor * model.tau()).unwrap();
                            }
                            _ => controller.set_speed(factor).unwrap(),
                        }
                    }
                    let mut ahead = controller.clone();
                    ahead.step().unwrap();
                    if clock(&ahead) < to {
                        *controller = ahead;
                        continue;
                    }
                    let (mut low, mut high) = (0.0, dt);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        let mut ahead = controller.clone();
                        tick(&mut ahead, &Command { dt: Some(middle), ..Command::default() }).unwrap();
                        if clock(&ahead) < to { low = middle } else { high = middle }
                    }
                    tick(controller, &Command { dt: Some(high), ..Command::default() }).unwrap();
                    return true;
                }
                false
            };
            let extent = model.canonical().extent();
            let (mut constant, mut varied) = (make(), make());
            // The phase of a rhythmic movement wraps at its extent.
            let n_stops = if model.kind() == Kind::Discrete { 6 } else { 5 };
            for (k, share) in [0.2, 0.3, 0.45, 0.7, 0.9, 1.3].into_iter().take(n_stops).enumerate() {
                let mut reached = advance_to(&mut constant, share * extent, &[]);
                reached &= advance_to(&mut varied, share * extent, &rates);
                prop_assume!(reached);
                for ((a, b), range) in constant.position().iter().zip(varied.position()).zip(model.ranges()) {
                    prop_assert!((a - b).abs() < 1e-9 * range, "{share}: {a} {b}");
                }
                let centre: Vec<f64> = constant.centre().iter().map(|c| c + 0.3).collect();
                for controller in [&mut constant, &mut varied] {
                    match (k, model.kind()) {
                        (0, _) => controller.set_style(&[0.6, -0.2]).unwrap(),
                        (1 | 4, Kind::Discrete) => controller.set_goal(&centre).unwrap(),
                        (1, Kind::Rhythmic) => controller.set_anchor(&centre).unwrap(),
                        (2, Kind::Rhythmic) => controller.set_amplitude(0.4).unwrap(),
                        _ => {}
                    }
                }
            }
        }
    }
}
