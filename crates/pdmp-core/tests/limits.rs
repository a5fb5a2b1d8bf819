//! Limits of position, velocity and acceleration in the control loop.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/random.rs"]
mod random;
#[path = "common/rare_commands.rs"]
mod rare_commands;

use std::sync::Arc;

use common::*;
use pdmp_core::motion::{Coupling, Limit, Limits, TimeGrid, fastest, fastest_tau};
use pdmp_core::{Command, Conditions, Controller, Error, Kind, LimitError, Model, Status, rollout};
use random::Random;
use rare_commands::*;

fn controller(model: &Arc<Model>) -> Controller {
    Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap()
}

/// Position and velocity after a tick.
type Motion = (Vec<f64>, Vec<f64>);

fn motion(controller: &Controller) -> Motion {
    (controller.position().to_vec(), controller.velocity().to_vec())
}

/// Returns the largest violation of the limits: of the velocity, relative to it, and of the position at which the DoF can
/// brake to rest, relative to the range between the limits.
fn violation(limits: &Limits, (position, velocity): &Motion) -> f64 {
    let [lower, upper, limit, acceleration] =
        [&limits.lower, &limits.upper, &limits.velocity, &limits.acceleration].map(|limit| limit.as_ref().unwrap());
    let of_dof = |d: usize| {
        let (y, v, range) = (position[d], velocity[d], upper[d] - lower[d]);
        let stop = y + v * v.abs() / (2.0 * acceleration[d]);
        let past = (stop.max(y) - upper[d]).max(lower[d] - stop.min(y));
        (past / range).max(v.abs() / limit[d] - 1.0)
    };
    (0..position.len()).map(of_dof).fold(0.0, f64::max)
}

/// Random limits around the present position, in which a tick of up to 0.1 s changes the velocity by a few limits at most.
fn limits_around(controller: &Controller, ranges: &[f64], random: &mut Random) -> Limits {
    let position = controller.position().iter().zip(ranges);
    let sides: Vec<[f64; 2]> =
        position.map(|(y, r)| [0, 1].map(|s| y + (2.0 * f64::from(s) - 1.0) * r * random.scale(0.03, 3.0))).collect();
    let velocity: Vec<f64> = ranges.iter().map(|range| range * random.scale(0.1, 10.0)).collect();
    let acceleration = velocity.iter().map(|velocity| velocity * random.scale(1.0, 100.0)).collect();
    Limits {
        lower: Some(sides.iter().map(|side| side[0]).collect()),
        upper: Some(sides.iter().map(|side| side[1]).collect()),
        velocity: Some(velocity),
        acceleration: Some(acceleration),
        ..Limits::default()
    }
}

/// Returns the positions furthest below the lower and above the upper limits, relative to the range between them, at 100
/// points of the cubic through two motions `h` apart.
fn violation_between(limits: &Limits, before: &Motion, after: &Motion, h: f64) -> f64 {
    let [lower, upper] = [&limits.lower, &limits.upper].map(|limit| limit.as_ref().unwrap());
    let of_dof = |d: usize| {
        let (from, to) = ([before.0[d], h * before.1[d]], [after.0[d], h * after.1[d]]);
        let past = |s: f64| {
            let r = 1.0 - s;
            let y = r * r * ((1.0 + 2.0 * s) * from[0] + s * from[1]) + s * s * ((1.0 + 2.0 * r) * to[0] - r * to[1]);
            (y - upper[d]).max(lower[d] - y) / (upper[d] - lower[d])
        };
        (0..=100).map(|s| past(f64::from(s) / 100.0)).fold(0.0, f64::max)
    };
    (0..before.0.len()).map(of_dof).fold(0.0, f64::max)
}

/// No sequence of commands, measurements, coupling terms and tick lengths leaves the limits.
#[test]
fn no_command_leaves_the_limits() {
    let mut random = Random(7);
    let (mut joint_ticks, mut limited, mut cubics) = (0, 0, 0);
    for case in 0..60 {
        let model = [&*REACH, &*CYCLE][case % 2];
        let (n, j) = (model.n_dofs(), model.n_styles());
        let conditions =
            Conditions { velocity: (model.kind() == Kind::Discrete).then(|| vec![0.0; n]), ..Conditions::default() };
        let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, None).unwrap();
        let limits = limits_around(&controller, model.ranges(), &mut random);
        controller.set_limits(&limits).unwrap();
        // A command before the first tick would restart the movement.
        controller.step().unwrap();
        let mut before = motion(&controller);
        // A rhythmic movement may start faster than its limits, and is inside them once it has braked.
        let mut inside = model.kind() == Kind::Discrete;
        for tick in 0..3000 {
            let h = if case % 3 == 0 { 1e-3 } else { random.scale(1e-6, 0.1) };
            let vector = |random: &mut Random, scale: f64| {
                (0..n)
                    .map(|d| controller.centre()[d] + model.ranges()[d] * scale * random.between(-1.0, 1.0))
                    .collect::<Vec<f64>>()
            };
            let scale = random.scale(0.1, 100.0);
            let (goal, measured) = (vector(&mut random, scale), vector(&mut random, 1.0));
            let terms = vector(&mut random, scale);
            let style: Vec<f64> = (0..j).map(|_| random.between(-2.0, 2.0)).collect();
            let numbers = Numbers { centre: &goal, style: &style, measured: &measured, terms: &terms };
            let command = rare_command(model, h, &numbers, &mut random);
            controller.step_with(&command).unwrap();
            let after = motion(&controller);
            assert!(after.0.iter().chain(&after.1).all(|x| x.is_finite()), "{case} {tick}");
            let change = |d: usize| (after.1[d] - before.1[d]).abs() / h;
            for (d, acceleration) in limits.acceleration.iter().flatten().enumerate() {
                assert!(change(d) <= acceleration * (1.0 + 1e-9), "{case} {tick}: {} > {acceleration}", change(d));
            }
            let violation = violation(&limits, &after);
            if inside {
                assert!(violation <= 1e-12, "{case} {tick}: {violation}, {before:?} to {after:?} in {h}");
                // A longer tick is limited in parts, and is not a single cubic.
                let short = h <= controller.dt();
                let between = if short { violation_between(&limits, &before, &after, h) } else { 0.0 };
                assert!(between <= 1e-12, "{case} {tick}: {between}, {before:?} to {after:?} in {h}");
                cubics += usize::from(short);
            }
            inside |= violation <= 1e-12;
            before = after;
            joint_ticks += n;
            limited += controller.limited().iter().flatten().count();
            if rare(&mut random) {
                controller.set_speed(random.between(0.0, 2.0).floor()).unwrap();
            }
            if rare(&mut random) {
                controller.release();
            }
        }
        assert!(inside);
    }
    assert!(limited > joint_ticks / 10, "{limited} of {joint_ticks}");
    assert!(cubics > 50_000, "{cubics}");
}

/// Limits that do not bind leave the motion as it is, to the last bit.
#[test]
fn wide_limits_change_nothing() {
    for model in [&*REACH, &*CYCLE] {
        let n = model.n_dofs();
        let (mut free, mut limited) = (controller(model), controller(model));
        let wide = |factor: f64| Some(model.ranges().iter().map(|range| factor * range).collect::<Vec<f64>>());
        let limits = Limits {
            lower: wide(-1e3),
            upper: wide(1e3),
            velocity: wide(1e3),
            acceleration: wide(1e5),
            ..Limits::default()
        };
        limited.set_limits(&limits).unwrap();
        for tick in 0..3000 {
            let goal = vec![0.3; n];
            let command = match model.kind() {
                Kind::Discrete => Command { goal: (tick == 300).then_some(&goal), ..Command::default() },
                Kind::Rhythmic => Command { anchor: (tick == 300).then_some(&goal), ..Command::default() },
            };
            assert_eq!(free.step_with(&command).unwrap(), limited.step_with(&command).unwrap());
            assert_eq!(motion(&free), motion(&limited));
            assert_eq!(free.acceleration(), limited.acceleration());
            assert!(limited.limited().iter().all(Option::is_none));
        }
    }
}

/// A goal beyond the limits is moved to them; the movement ends there and is finished.
#[test]
fn goal_outside_is_moved_to_the_limit() {
    let mut controller = controller(&REACH);
    let start = controller.position().to_vec();
    let upper: Vec<f64> = start.iter().zip(REACH.ranges()).map(|(y, range)| y + range / 2.0).collect();
    let limits = Limits { upper: Some(upper.clone()), acceleration: Some(vec![50.0; 3]), ..Limits::default() };
    controller.set_limits(&limits).unwrap();
    controller.set_goal(&upper.iter().map(|u| u + 10.0).collect::<Vec<f64>>()).unwrap();
    assert_eq!(controller.centre(), upper);
    while controller.step().unwrap() == Status::Working {
        assert!(controller.time() < 5.0);
        assert!(controller.position().iter().zip(&upper).all(|(y, u)| y <= u));
    }
    for ((y, u), range) in controller.position().iter().zip(&upper).zip(REACH.ranges()) {
        assert!((y - u).abs() < 0.01 * range);
    }
}

/// A movement that starts or is caught outside its limits brakes with A and comes back; the limits are named.
#[test]
fn movement_outside_comes_back() {
    let mut controller = controller(&REACH);
    for _ in 0..400 {
        controller.step().unwrap();
    }
    let (y, v) = motion(&controller);
    // The limit lies behind the present position of the DoF that moves.
    let upper: Vec<f64> = y.iter().zip(&v).map(|(y, v)| if *v > 0.1 { y - 0.05 } else { y + 1.0 }).collect();
    let limits = Limits { upper: Some(upper.clone()), acceleration: Some(vec![20.0; 3]), ..Limits::default() };
    controller.set_limits(&limits).unwrap();
    let outside: Vec<usize> = (0..3).filter(|&d| y[d] > upper[d]).collect();
    assert!(!outside.is_empty());
    let mut before = motion(&controller);
    controller.step().unwrap();
    for &d in &outside {
        assert_eq!(controller.limited()[d], Some(Limit::Position));
    }
    for _ in 0..3000 {
        let after = motion(&controller);
        for d in 0..3 {
            assert!((after.1[d] - before.1[d]).abs() <= 20.0 * 1e-3 * (1.0 + 1e-9));
        }
        before = after;
        controller.step().unwrap();
    }
    assert!(controller.position().iter().zip(&upper).all(|(y, u)| y <= u));
}

/// Bad limits are named with their DoF and numbers, and leave the last ones in force.
#[test]
fn bad_limits_are_rejected() {
    let mut controller = controller(&REACH);
    let limits =
        |lower, upper, velocity, acceleration| Limits { lower, upper, velocity, acceleration, ..Limits::default() };
    let error = controller.set_limits(&limits(Some(vec![0.0, 1.0, 0.0]), Some(vec![1.0; 3]), None, None)).unwrap_err();
    assert!(matches!(error, Error::Limits(LimitError::Order { dof: 1, lower: 1.0, upper: 1.0 })));
    let bad = [
        (limits(Some(vec![0.0; 2]), None, None, None), "lower"),
        (limits(None, Some(vec![f64::NAN; 3]), None, None), "upper"),
        (limits(None, None, Some(vec![1.0, 0.0, 1.0]), None), "velocity"),
        (limits(None, None, None, Some(vec![1.0, -1.0, 1.0])), "acceleration"),
    ];
    for (limits, name) in bad {
        let text = controller.set_limits(&limits).unwrap_err().to_string();
        assert!(text.starts_with(name), "{text}");
    }
    while controller.step().unwrap() == Status::Working {
        assert!(controller.limited().iter().all(Option::is_none));
    }
}

/// A tick in which the limit of the acceleration would allow thousands of times the limit of the velocity, or of the distance
/// between the limits of the position, keeps all of them, between its ends too.
#[test]
fn limits_however_tight_for_a_tick_are_kept() {
    let tight = [
        Limits { velocity: Some(vec![1.0, 1e-3, 1.0]), acceleration: Some(vec![1e6]), ..Limits::default() },
        Limits {
            lower: Some(vec![-10.0, -1e-6, -10.0]),
            upper: Some(vec![10.0, 1e-6, 10.0]),
            acceleration: Some(vec![1e3]),
            ..Limits::default()
        },
    ];
    for (limits, synchronous) in tight.into_iter().flat_map(|limits| [(limits.clone(), false), (limits, true)]) {
        let conditions = Conditions { start: Some(vec![0.0; 3]), ..Conditions::default() };
        let mut controller = Controller::new(REACH.primitive(), 0.01, &conditions, None).unwrap();
        controller.set_limits(&Limits { synchronous, ..limits.clone() }).unwrap();
        let full = |vector: &Option<Vec<f64>>, none: f64| match vector.as_deref() {
            None => vec![none; 3],
            Some([limit]) => vec![*limit; 3],
            Some(limits) => limits.to_vec(),
        };
        let limits = Limits {
            lower: Some(full(&limits.lower, f64::NEG_INFINITY)),
            upper: Some(full(&limits.upper, f64::INFINITY)),
            velocity: Some(full(&limits.velocity, f64::INFINITY)),
            acceleration: Some(full(&limits.acceleration, f64::INFINITY)),
            ..Limits::default()
        };
        let mut before = motion(&controller);
        for tick in 0..500 {
            controller.step().unwrap();
            let after = motion(&controller);
            assert!(violation(&limits, &after) <= 1e-12, "{tick}");
            assert!(violation_between(&limits, &before, &after, controller.dt()) <= 1e-12, "{tick}");
            before = after;
        }
    }
}

/// A DoF that rides on a limit neither alternates between free and limited, nor does its acceleration jump from tick to tick,
/// while a noisy goal or anchor is commanded.
#[test]
fn movement_on_a_limit_does_not_chatter() {
    let mut random = Random(3);
    for (model, noise) in [(&*REACH, 0.0), (&*REACH, 0.1), (&*CYCLE, 0.0), (&*CYCLE, 0.1)] {
        let free =
            rollout(model.primitive(), &Conditions::default(), TimeGrid { dt: 1e-3, duration: Some(2.0) }).unwrap();
        let peak = |rate: &ndarray::Array2<f64>, share: f64| {
            Some(rate.columns().into_iter().map(|dof| share * dof.fold(0.0, |peak, x| x.abs().max(peak))).collect())
        };
        for share in [0.3, 0.6, 0.9] {
            let by_velocity = Limits {
                velocity: peak(&free.velocity, share),
                acceleration: peak(&free.acceleration, 2.0),
                synchronous: false,
                ..Limits::default()
            };
            let acceleration = peak(&free.acceleration, share);
            let by_acceleration = Limits { acceleration, synchronous: false, ..Limits::default() };
            for limits in [by_velocity, by_acceleration] {
                let mut controller = controller(model);
                let centre = controller.centre().to_vec();
                controller.set_limits(&limits).unwrap();
                let (mut changes, mut limited, mut squares) = (0, 0, 0.0);
                let mut before = (controller.limited().to_vec(), controller.acceleration().to_vec());
                for _ in 0..2000 {
                    let noisy: Vec<f64> = centre
                        .iter()
                        .zip(model.ranges())
                        .map(|(y, range)| y + noise * range * random.between(-0.5, 0.5))
                        .collect();
                    let command = match model.kind() {
                        Kind::Discrete => Command { goal: Some(&noisy), ..Command::default() },
                        Kind::Rhythmic => Command { anchor: Some(&noisy), ..Command::default() },
                    };
                    controller.step_with(&command).unwrap();
                    let after = (controller.limited().to_vec(), controller.acceleration().to_vec());
                    for (d, most) in limits.acceleration.iter().flatten().enumerate() {
                        limited += usize::from(after.0[d].is_some());
                        changes += usize::from(after.0[d].is_some() != before.0[d].is_some());
                        squares += ((after.1[d] - before.1[d]) / most).powi(2);
                    }
                    before = after;
                }
                // One step of the whole acceleration per touch of a limit is unavoidable without a limit of the jerk.
                let step = (squares / (2000.0 * model.n_dofs() as f64)).sqrt();
                assert!(limited > 200 && changes <= 40 && step < 0.08, "{limited} {changes} {step} at {limits:?}");
            }
        }
    }
}

/// A command between ticks publishes no velocity that the last tick has not reached, and no acceleration beyond its limit,
/// even where it takes effect at once.
#[test]
fn commands_between_ticks_publish_no_motion_beyond_the_limits() {
    type Setter = fn(&mut Controller, &[f64]);
    let setters: [Setter; 9] = [
        |controller, _| controller.release(),
        |controller, _| controller.set_speed(3.0).unwrap(),
        |controller, _| controller.set_speed(0.0).unwrap(),
        |controller, x| controller.set_tau(0.2 * (1.1 + x[0])).unwrap(),
        |controller, x| controller.set_style(&x[..controller.style().len()]).unwrap(),
        |controller, x| drop(controller.set_goal(x)),
        |controller, x| drop(controller.set_anchor(x)),
        |controller, x| drop(controller.set_phase(3.0 * x[0])),
        |controller, _| controller.set_limits(&Limits { upper: Some(vec![0.3]), ..controller.limits() }).unwrap(),
    ];
    let mut random = Random(5);
    for (model, transition) in [(&*REACH, None), (&*REACH, Some(0.0)), (&*CYCLE, None), (&*CYCLE, Some(0.0))] {
        let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), transition).unwrap();
        controller
            .set_limits(&Limits { velocity: Some(vec![1.0]), acceleration: Some(vec![6.0]), ..Limits::default() })
            .unwrap();
        for tick in 0..3000 {
            let x: Vec<f64> = (0..model.n_dofs()).map(|_| random.between(-1.0, 1.0)).collect();
            let measured = random.next() < 0.1;
            let coupling = (random.next() < 0.1).then_some(Coupling { velocity: &x, acceleration: &x });
            controller
                .step_with(&Command { measured: measured.then_some(&x), coupling, ..Command::default() })
                .unwrap();
            let (before, settled) = (motion(&controller), controller.acceleration().iter().all(|a| a.abs() <= 6.0));
            setters[tick % setters.len()](&mut controller, &x);
            assert_eq!(motion(&controller), before, "{tick}");
            assert!(!settled || controller.acceleration().iter().all(|a| a.abs() <= 6.0), "{tick}");
            // Wide limits of the position again.
            controller.set_limits(&Limits { upper: None, ..controller.limits() }).unwrap();
        }
    }
}

/// Ticks down to the shortest positive number of seconds leave the motion finite and inside.
#[test]
fn ticks_of_any_length_keep_the_limits() {
    let wide = [None, Some(vec![0.5])];
    for model in [&*REACH, &*CYCLE] {
        let pairs = wide.iter().flat_map(|v| wide.iter().map(move |a| (v.clone(), a.clone(), None)));
        for (velocity, acceleration, jerk) in pairs.chain([(None, Some(vec![0.5]), Some(vec![5.0]))]) {
            for dt in [5e-324, 1e-310, 1e-300, 1e-200, 1e-100, 1e-30, 1e-12] {
                let mut controller = controller(model);
                let start = controller.position().iter();
                let [lower, upper] = [-0.3, 0.3].map(|side| Some(start.clone().map(|y| y + side).collect()));
                controller
                    .set_limits(&Limits {
                        lower,
                        upper,
                        velocity: velocity.clone(),
                        acceleration: acceleration.clone(),
                        jerk: jerk.clone(),
                        ..Limits::default()
                    })
                    .unwrap();
                for tick in 0..600 {
                    let goal = vec![if tick % 200 < 100 { 2.0 } else { -2.0 }; 3];
                    let goal = (model.kind() == Kind::Discrete).then_some(&*goal);
                    let h = if tick % 3 == 0 { 0.01 } else { dt };
                    controller.step_with(&Command { dt: Some(h), goal, ..Command::default() }).unwrap();
                    let numbers = [controller.position(), controller.velocity(), controller.acceleration()].concat();
                    assert!(numbers.iter().all(|x| x.is_finite()), "{dt} {tick} {numbers:?}");
                    assert!(controller.phase().is_finite());
                }
            }
        }
    }
}

/// Without a limit of the acceleration, limits of the position alone name themselves, also with infinite elements; a start on
/// the limit that moves outwards stays there.
#[test]
fn limits_of_the_position_alone_are_kept_and_named() {
    for is_infinite in [false, true] {
        for model in [&*REACH, &*CYCLE] {
            let acceleration = is_infinite.then(|| vec![f64::INFINITY; model.n_dofs()]);
            let start = controller(model).position().to_vec();
            let upper: Vec<f64> = start.clone();
            let lower = Some(start.iter().zip(model.ranges()).map(|(y, range)| y - 0.3 * range).collect());
            let velocity = (model.kind() == Kind::Discrete).then(|| vec![1.0; model.n_dofs()]);
            let conditions = Conditions { velocity, ..Conditions::default() };
            let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, None).unwrap();
            let limits = Limits { lower, upper: Some(upper), acceleration, ..Limits::default() };
            controller.set_limits(&limits).unwrap();
            let mut named = 0;
            for tick in 0..2000 {
                controller.step().unwrap();
                for (d, y) in controller.position().iter().enumerate() {
                    let [lower, upper] = [&limits.lower, &limits.upper].map(|limit| limit.as_ref().unwrap()[d]);
                    // The first tick ends the velocity out of the limit.
                    assert!(tick < 2 || (lower..=upper).contains(y), "{tick} {d}: {lower} {y} {upper}");
                }
                assert!(controller.limited().iter().flatten().all(|limit| *limit == Limit::Position));
                named += controller.limited().iter().flatten().count();
            }
            assert!(named > 20, "{named}");
        }
    }
}

/// Limits that exclude the anchor leave the start of a rhythmic movement where it was, and move the anchor from there on.
#[test]
fn rhythmic_movement_does_not_start_with_a_jump() {
    let mut controller = controller(&CYCLE);
    let (start, anchor) = (controller.position().to_vec(), controller.centre().to_vec());
    let upper: Vec<f64> = anchor.iter().zip(CYCLE.ranges()).map(|(y, range)| y - range).collect();
    let acceleration = 50.0;
    controller
        .set_limits(&Limits { upper: Some(upper.clone()), acceleration: Some(vec![acceleration]), ..Limits::default() })
        .unwrap();
    assert_eq!(controller.position(), start);
    assert_eq!(controller.centre(), upper);
    let mut before = motion(&controller);
    for _ in 0..5000 {
        controller.step().unwrap();
        let after = motion(&controller);
        assert!(after.1.iter().zip(&before.1).all(|(v, w)| (v - w).abs() <= acceleration * 1e-3 * (1.0 + 1e-9)));
        before = after;
    }
    assert!(before.0.iter().zip(&upper).all(|(y, u)| y <= u));
}

/// A pause stops the movement where it is, at the pace that the limits allow, and it continues from there.
#[test]
fn pause_within_limits_stops_the_movement() {
    for (model, jerk) in [(&*REACH, None), (&*REACH, Some(vec![50.0])), (&*CYCLE, None), (&*CYCLE, Some(vec![50.0]))] {
        let mut controller = controller(model);
        controller.set_limits(&Limits { acceleration: Some(vec![4.0]), jerk, ..Limits::default() }).unwrap();
        for _ in 0..300 {
            controller.step().unwrap();
        }
        controller.set_speed(0.0).unwrap();
        let fastest = controller.velocity().iter().fold(0.0f64, |fastest, v| fastest.max(v.abs()));
        let n_ticks = 2000 + (fastest / 4.0 * 1e3) as usize;
        for _ in 0..n_ticks {
            controller.step().unwrap();
        }
        let paused = controller.position().to_vec();
        assert!(controller.velocity().iter().all(|v| v.abs() < 1e-6), "{:?}", controller.velocity());
        for _ in 0..1000 {
            controller.step().unwrap();
        }
        assert!(controller.position().iter().zip(&paused).all(|(y, paused)| (y - paused).abs() < 1e-6));
        controller.set_speed(1.0).unwrap();
        for _ in 0..1500 {
            controller.step().unwrap();
        }
        assert!(model.kind() == Kind::Rhythmic || controller.status() == Status::Finished);
    }
}

/// Limits count from the motion of the last tick, also after a command without limits that changes the velocity at once.
#[test]
fn limits_after_a_jump_count_from_the_last_tick() {
    let mut controller = Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), Some(0.0)).unwrap();
    for _ in 0..300 {
        controller.step().unwrap();
    }
    controller.set_speed(0.0).unwrap();
    controller.step().unwrap();
    assert!(controller.velocity().iter().all(|v| *v == 0.0));
    controller.set_speed(1.0).unwrap();
    assert!(controller.velocity().iter().any(|v| v.abs() > 0.1));
    let limits = Limits { acceleration: Some(vec![5.0]), ..Limits::default() };
    for mut controller in [controller.clone(), Controller::restore(REACH.primitive(), &controller.snapshot()).unwrap()]
    {
        controller.set_limits(&limits).unwrap();
        assert!(controller.velocity().iter().all(|v| *v == 0.0));
        controller.step().unwrap();
        assert!(controller.velocity().iter().all(|v| v.abs() <= 5.0 * 1e-3 * (1.0 + 1e-12)));
    }
}

/// A smaller limit of the velocity is kept from the first tick at which braking with A can have reached it.
#[test]
fn shrinking_velocity_is_kept_as_soon_as_possible() {
    let mut controller = controller(&REACH);
    while controller.velocity()[0].abs() < 0.8 {
        controller.step().unwrap();
    }
    let (v, limit, acceleration) = (controller.velocity()[0].abs(), 0.3, 4.0);
    controller
        .set_limits(&Limits {
            velocity: Some(vec![limit]),
            acceleration: Some(vec![acceleration]),
            ..Limits::default()
        })
        .unwrap();
    let ticks = ((v - limit) / (acceleration * 1e-3)).ceil() as usize;
    for tick in 1..1000 {
        controller.step().unwrap();
        let bound = (v - acceleration * 1e-3 * tick as f64).max(limit);
        let found = controller.velocity()[0].abs();
        assert!(found <= bound * (1.0 + 1e-12), "{tick} of {ticks}: {found} > {bound}");
    }
}

/// Along a straight path from rest to rest the fastest movement is that of the constant acceleration ±A, or of the
/// trapezoid below V, for any learnt profile of speed.
#[test]
fn fastest_straight_movement_is_that_of_the_textbook() {
    let reach = |length: f64| {
        let position = ndarray::Array2::from_shape_fn((101, 2), |(c, d)| {
            let s = c as f64 / 100.0;
            [1.0, -0.3][d] * length * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
        });
        pdmp_core::Demonstration::new(position, pdmp_core::Sampling::Uniform { dt: 0.01 }).unwrap()
    };
    let model = learn(&[reach(0.9), reach(1.0), reach(1.1)], &options(Kind::Discrete));
    let goal = vec![1.0, -0.3];
    let conditions = Conditions { start: Some(vec![0.0; 2]), goal: Some(goal), ..Conditions::default() };
    for (velocity, acceleration) in [(10.0, 4.0), (1.0, 4.0), (0.25, 0.5)] {
        let limits =
            Limits { velocity: Some(vec![velocity]), acceleration: Some(vec![acceleration]), ..Limits::default() };
        let movement = fastest(model.primitive(), &limits, &conditions, 1e-4).unwrap();
        let expected = if velocity * velocity >= acceleration {
            2.0 / acceleration.sqrt()
        } else {
            1.0 / velocity + velocity / acceleration
        };
        let duration = movement.time[movement.time.len() - 1];
        assert!((duration / expected - 1.0).abs() < 3e-3, "{duration} {expected}");
        assert!(movement.velocity.iter().all(|v| v.abs() <= velocity * 1.001));
        assert!(movement.acceleration.iter().all(|a| a.abs() <= acceleration * 1.05));
    }
}

/// Slowed by the factor that the smallest constant τ states, the movement touches a limit and exceeds none.
#[test]
fn fastest_tau_touches_the_limits() {
    let limits = Limits { velocity: Some(vec![1.1, 0.8, 0.5]), acceleration: Some(vec![9.0]), ..Limits::default() };
    let tau = fastest_tau(REACH.primitive(), &limits, &Conditions::default()).unwrap();
    let conditions = Conditions { tau: Some(tau), ..Conditions::default() };
    let grid = TimeGrid { dt: tau / REACH.tau() * REACH.duration() / 2000.0, duration: None };
    let movement = rollout(REACH.primitive(), &conditions, grid).unwrap();
    let [velocity, acceleration] = [limits.velocity.unwrap(), vec![9.0; 3]];
    let largest = |derivative: &ndarray::Array2<f64>, limits: &[f64]| {
        derivative.indexed_iter().map(|((_, d), x)| x.abs() / limits[d]).fold(0.0, f64::max)
    };
    let worst = largest(&movement.velocity, &velocity).max(largest(&movement.acceleration, &acceleration));
    assert!((worst - 1.0).abs() < 1e-5, "{worst}");
    let fastest = fastest(
        REACH.primitive(),
        &Limits { velocity: Some(velocity), acceleration: Some(acceleration), ..Limits::default() },
        &Conditions::default(),
        1e-3,
    )
    .unwrap();
    assert!(fastest.time[fastest.time.len() - 1] < tau / REACH.tau() * REACH.duration());
}
