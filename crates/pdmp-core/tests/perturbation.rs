//! Response of the controller to measured positions and coupling terms.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/accepted.rs"]
mod accepted;
mod common;

use std::sync::Arc;

use accepted::mostly_accepted;
use common::*;
use ndarray::Array2;
use pdmp_core::motion::Compliance;
use pdmp_core::motion::Coupling;
use pdmp_core::{
    Command, Conditions, Controller, Demonstration, Error, FitOptions, Kind, Model, Sampling, Status, fit,
};
use proptest::prelude::*;

fn controller(model: &Arc<Model>) -> Controller {
    Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap()
}

fn measured(position: &[f64]) -> Command<'_> {
    Command { measured: Some(position), ..Command::default() }
}

fn coupling<'a>(velocity: &'a [f64], acceleration: &'a [f64]) -> Command<'a> {
    Command { coupling: Some(Coupling { velocity, acceleration }), ..Command::default() }
}

fn max_magnitude(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |max, value| max.max(value.abs()))
}

/// Returns the largest distance of two positions, relative to the range of each DoF.
fn relative_distance(model: &Model, a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).zip(model.ranges()).map(|((a, b), range)| (a - b).abs() / range).fold(0.0, f64::max)
}

/// Returns the displacement of the frame from the goal, (g − y₀)(m − 1).
fn frame_offset(model: &Model, d: usize, u: f64) -> f64 {
    let demonstrated = model.demonstrated();
    match model.kind() {
        Kind::Discrete => {
            let [goal, start] =
                [&demonstrated.goals, &demonstrated.starts].map(|positions| positions[[demonstrated.nominal, d]]);
            (goal - start) * (model.transport(u).unwrap() - 1.0)
        }
        Kind::Rhythmic => 0.0,
    }
}

/// State of the reference integration: positions relative to the frame, z and the clock of the phase.
type ReferenceState = (Vec<f64>, Vec<f64>, f64);

/// Returns ẏ, ż and u̇ for coupling terms c_v and c_a and a phase rate κ.
fn derivatives(
    model: &Model,
    (y, z, u): &ReferenceState,
    velocity: &[f64],
    acceleration: &[f64],
    phase_rate: f64,
) -> ReferenceState {
    let nominal = model.demonstrated().nominal;
    let demonstrated = model.demonstrated();
    let (style, tau, n) = (demonstrated.styles.row(nominal), model.tau(), model.n_dofs());
    let discrete = model.kind() == Kind::Discrete;
    let centre = if discrete { demonstrated.goals.row(nominal) } else { demonstrated.anchors.row(nominal) };
    let (mut values, mut slopes) = (vec![0.0; style.len() * n], vec![0.0; style.len() * n]);
    model.forcing_table().evaluate(*u, &mut values, &mut slopes);
    let w = |d: usize| style.iter().enumerate().map(|(j, s)| s * values[j * n + d]).sum::<f64>();
    let pdmp_core::dynamics::Attractor { alpha_z, beta_z } = model.attractor();
    (
        (0..n).map(|d| (z[d] + w(d)) / tau + velocity[d]).collect(),
        (0..n).map(|d| (alpha_z * (beta_z * (centre[d] - y[d]) - z[d]) + tau * tau * acceleration[d]) / tau).collect(),
        phase_rate / tau,
    )
}

fn rk4(
    model: &Model,
    state: &ReferenceState,
    dt: f64,
    velocity: &[f64],
    acceleration: &[f64],
    phase_rate: f64,
) -> ReferenceState {
    let slope = |state: &ReferenceState| derivatives(model, state, velocity, acceleration, phase_rate);
    let add = |a: &ReferenceState, k: &ReferenceState, t: f64| {
        let sum = |a: &[f64], k: &[f64]| a.iter().zip(k).map(|(a, k)| a + t * k).collect::<Vec<_>>();
        (sum(&a.0, &k.0), sum(&a.1, &k.1), a.2 + t * k.2)
    };
    let k1 = slope(state);
    let k2 = slope(&add(state, &k1, dt / 2.0));
    let k3 = slope(&add(state, &k2, dt / 2.0));
    let k4 = slope(&add(state, &k3, dt));
    let sum = add(&add(state, &k1, dt / 6.0), &k2, dt / 3.0);
    add(&add(&sum, &k3, dt / 3.0), &k4, dt / 6.0)
}

/// Motion under coupling terms and a constant tracking error agrees with RK4 on the stated equations.
#[test]
fn perturbed_movement_solves_the_stated_equations() {
    let (velocity, acceleration, behind) = ([0.3, -0.2, 0.1], [2.0, 1.0, -3.0], [-0.02, 0.01, 0.005]);
    let (dt, stopping, tracking) = (1e-3, 700.0, 3.0);
    for (model, tracking_error) in [(&*REACH, true), (&*REACH, false), (&*CYCLE, true), (&*CYCLE, false)] {
        let n = model.n_dofs();
        let mut controller = controller(model);
        controller.set_compliance(Compliance { stopping, tracking }).unwrap();
        // The initial z follows from the initial velocity, since the controller does not expose it.
        let start: Vec<f64> = (0..n).map(|d| controller.position()[d] - frame_offset(model, d, 0.0)).collect();
        let rest = controller.velocity().iter().map(|v| v * model.tau());
        let at_start = derivatives(model, &(start.clone(), vec![0.0; n], 0.0), &vec![0.0; n], &vec![0.0; n], 1.0).0;
        let z = rest.zip(&at_start).map(|(flow, w)| flow - w * model.tau()).collect();
        let mut reference: ReferenceState = (start, z, 0.0);
        let pull = if tracking_error { (1.0 - (-tracking * dt / model.tau()).exp()) / dt } else { 0.0 };
        let (mut total_velocity, mut phase_rate, mut expected) = (velocity[..n].to_vec(), 1.0, 0.0);
        // Past the demonstrated end, which coincides with the end of a tick if the phase is not slowed. The error begins
        // with the second tick, since one from the first tick on would be expected.
        for k in 0..1500 {
            let behind = if k == 0 { [0.0; 3] } else { behind };
            let robot: Vec<f64> = controller.position().iter().zip(behind).map(|(y, e)| y + e).collect();
            let terms = coupling(&velocity[..n], &acceleration[..n]);
            let terms = if tracking_error { Command { measured: Some(&robot), ..terms } } else { terms };
            tick(&mut controller, &Command { dt: Some(dt), ..terms }).unwrap();
            // The expected error is the same share of the constant error for every DoF.
            let excess: Vec<f64> = behind[..n].iter().map(|e| e * (1.0 - expected)).collect();
            if tracking_error && k > 0 {
                let before = phase_rate;
                let squares: f64 = excess.iter().zip(model.ranges()).map(|(d, range)| (d / range).powi(2)).sum();
                phase_rate = 1.0 / (1.0 + stopping * squares);
                // z takes up the change of the frame's velocity κc′.
                for d in 0..n {
                    let [a, b] = [-1e-6, 1e-6].map(|step| frame_offset(model, d, reference.2 + step));
                    reference.1[d] += (before - phase_rate) * (b - a) / 2e-6;
                }
                expected += (1.0 - expected)
                    * (1.0 - (-5.0 / model.canonical().extent() * phase_rate * dt / model.tau()).exp());
            }
            total_velocity = velocity.iter().zip(&excess).map(|(v, d)| v + pull * d).collect();
            for _ in 0..4 {
                reference = rk4(model, &reference, dt / 4.0, &total_velocity, &acceleration[..n], phase_rate);
            }
            let position: Vec<f64> = (0..n).map(|d| reference.0[d] + frame_offset(model, d, reference.2)).collect();
            assert!(relative_distance(model, controller.position(), &position) < 1e-7);
        }
        let slope = derivatives(model, &reference, &total_velocity, &acceleration[..n], phase_rate);
        let frame_velocity = |d: usize| {
            let [before, after] = [-1e-6, 1e-6].map(|step| frame_offset(model, d, reference.2 + step));
            (after - before) / 2e-6 * slope.2
        };
        assert!((0..n).all(|d| (slope.0[d] + frame_velocity(d) - controller.velocity()[d]).abs() < 1e-6));
        assert!((controller.phase() - model.canonical().phase(reference.2)).abs() < 1e-9);
    }
}

/// Velocity and acceleration are the derivatives of the position under perturbations and while τ is in transition.
#[test]
fn velocity_and_acceleration_stay_derivatives() {
    for (model, is_measured) in [(&*REACH, true), (&*REACH, false), (&*CYCLE, true), (&*CYCLE, false)] {
        let (n, dt) = (model.n_dofs(), 1e-5);
        let mut controller = controller(model);
        // The tracking velocity is constant over a tick and would jump between ticks.
        controller.set_compliance(Compliance { stopping: 1000.0, tracking: 0.0 }).unwrap();
        (0..200).for_each(|_| _ = controller.step().unwrap());
        controller.set_tau(0.6 * model.tau()).unwrap();
        let (velocity, acceleration) = (vec![0.4; n], vec![-5.0; n]);
        let mut samples = Vec::new();
        for _ in 0..5000 {
            let robot: Vec<f64> = controller.position().iter().map(|y| y + 0.01).collect();
            let measured = Some(robot.as_slice()).filter(|_| is_measured);
            let terms = Command { measured, ..coupling(&velocity, &acceleration) };
            tick(&mut controller, &Command { dt: Some(dt), ..terms }).unwrap();
            let row = [controller.position(), controller.velocity(), controller.acceleration()];
            samples.push(row.map(<[f64]>::to_vec));
        }
        for ticks in samples.windows(3) {
            let [before, now, after] = [&ticks[0], &ticks[1], &ticks[2]];
            for (order, bound) in [(0, 1e-5), (1, 5e-3)] {
                for d in 0..n {
                    let slope = (after[order][d] - before[order][d]) / (2.0 * dt);
                    assert!(
                        (slope - now[order + 1][d]).abs() < bound,
                        "{order} {slope} {now:?} {is_measured}, {before:?} {after:?}"
                    );
                }
            }
        }
    }
}

/// Zero coupling terms and a robot without tracking error leave the motion unchanged to the last bit.
#[test]
fn zero_terms_and_zero_error_leave_the_motion() {
    for model in [&*REACH, &*CYCLE] {
        let zero = vec![0.0; model.n_dofs()];
        let (mut free, mut coupled, mut tracking) = (controller(model), controller(model), controller(model));
        for k in 0..1500 {
            if k == 300 {
                for controller in [&mut free, &mut coupled, &mut tracking] {
                    controller.set_style(&[0.9, -0.4]).unwrap();
                    controller.set_tau(0.6 * model.tau()).unwrap();
                }
            }
            free.step().unwrap();
            tick(&mut coupled, &coupling(&zero, &zero)).unwrap();
            let robot = tracking.position().to_vec();
            tick(&mut tracking, &measured(&robot)).unwrap();
            for other in [&coupled, &tracking] {
                assert_eq!(free.position(), other.position());
                assert_eq!(free.velocity(), other.velocity());
                assert_eq!((free.phase(), free.status()), (other.phase(), other.status()));
            }
        }
    }
}

/// While the robot is blocked, for as long as the whole movement, the phase almost stops and the movement stays near the
/// robot; after the release it continues from there without a leap.
#[test]
fn blocked_movement_continues_after_its_release() {
    for model in [&*REACH, &*CYCLE] {
        let mut free = controller(model);
        let peak = (0..1500).fold(0.0f64, |peak, _| {
            free.step().unwrap();
            peak.max(max_magnitude(free.velocity()))
        });
        let mut blocked = controller(model);
        (0..400).for_each(|_| _ = blocked.step().unwrap());
        let (robot, phase) = (blocked.position().to_vec(), blocked.phase());
        for _ in 0..1000 {
            assert_eq!(tick(&mut blocked, &measured(&robot)).unwrap(), Status::Working);
            assert!(relative_distance(model, blocked.position(), &robot) < 0.2);
            assert!(max_magnitude(blocked.velocity()) < peak);
        }
        // An unperturbed phase would have covered the whole movement.
        let covered = match model.canonical() {
            pdmp_core::dynamics::Canonical::Discrete { alpha_x, u_end } => {
                (phase / blocked.phase()).ln() / alpha_x / u_end
            }
            pdmp_core::dynamics::Canonical::Rhythmic { .. } => (blocked.phase() - phase) / std::f64::consts::TAU,
        };
        assert!((0.0..0.12).contains(&covered), "{covered}");
        blocked.release();
        let before = blocked.position().to_vec();
        let mut ticks = 0;
        loop {
            let status = blocked.step().unwrap();
            assert!(ticks > 0 || relative_distance(model, blocked.position(), &before) < 0.01);
            assert!(max_magnitude(blocked.velocity()) < 1.25 * peak, "{} {peak}", max_magnitude(blocked.velocity()));
            ticks += 1;
            if status == Status::Finished || ticks == 20_000 {
                break;
            }
        }
        match model.kind() {
            Kind::Discrete => {
                let goal = model.demonstrated().goals.row(model.demonstrated().nominal).to_vec();
                assert!(
                    relative_distance(model, blocked.position(), &goal) < blocked.tolerance() && ticks < 1600,
                    "{ticks}"
                );
            }
            Kind::Rhythmic => {
                // It has returned to the limit cycle: the unperturbed movement has this position at the same phase.
                while (free.phase() - blocked.phase()).rem_euclid(std::f64::consts::TAU) > 1e-9 {
                    let remaining = (blocked.phase() - free.phase()).rem_euclid(std::f64::consts::TAU) * model.tau();
                    tick(&mut free, &Command { dt: Some(remaining.min(1e-3)), ..Command::default() }).unwrap();
                }
                assert!(relative_distance(model, blocked.position(), free.position()) < 1e-6);
            }
        }
    }
}

/// With a constant tracking error the movement still reaches its goal, within a bounded time.
#[test]
fn constant_error_neither_moves_the_goal_nor_stops_the_phase() {
    let goal = REACH.demonstrated().goals.row(REACH.demonstrated().nominal).to_vec();
    for (error, every, max_ratio) in [(0.002, 1, 1.6), (0.05, 1, 1.9), (0.05, 10, 1.9), (0.1, 1, 4.5)] {
        let mut controller = controller(&REACH);
        let mut free = controller.clone();
        let free_ticks = 1 + (0..).take_while(|_| free.step().unwrap() == Status::Working).count();
        let ticks = (0..20_000).position(|k| {
            let robot: Vec<f64> =
                controller.position().iter().zip(REACH.ranges()).map(|(y, range)| y - error * range).collect();
            let command = if k % every == 0 { measured(&robot) } else { Command::default() };
            tick(&mut controller, &command).unwrap() == Status::Finished
        });
        assert!(relative_distance(&REACH, controller.position(), &goal) < 1.5e-3);
        assert!(
            ticks.is_some_and(|ticks| (ticks as f64) < max_ratio * free_ticks as f64),
            "{error}: {ticks:?} of {free_ticks}"
        );
    }
}

/// A sensor slower than the loop does not slow a robot without tracking error, and still blocks the movement of a blocked
/// one.
#[test]
fn last_error_stays_in_force_between_measurements() {
    let (mut free, mut tracking) = (controller(&REACH), controller(&REACH));
    for k in 0..1500 {
        free.step().unwrap();
        let robot = tracking.position().to_vec();
        if k % 10 == 0 { tick(&mut tracking, &measured(&robot)) } else { tracking.step() }.unwrap();
        assert_eq!(free.position(), tracking.position());
    }
    let distances = [1, 10, 40].map(|every| {
        let mut blocked = controller(&REACH);
        (0..300).for_each(|_| _ = blocked.step().unwrap());
        let robot = blocked.position().to_vec();
        for k in 0..1000 {
            if k % every == 0 { tick(&mut blocked, &measured(&robot)) } else { blocked.step() }.unwrap();
        }
        relative_distance(&REACH, blocked.position(), &robot)
    });
    assert!(distances[1] < 1.1 * distances[0] && distances[2] < 1.5 * distances[0], "{distances:?}");
}

/// An encoder that wraps at ±π or ±180° causes no tracking error.
#[test]
fn errors_of_angles_are_wrapped() {
    for (unit, turn) in [("rad", std::f64::consts::TAU), ("deg", 360.0), ("°", 360.0)] {
        let demos = [0.9, 1.0, 1.1].map(|a| {
            let angle = |s: f64| turn * (0.4 + 0.16 * a * s * s * (3.0 - 2.0 * s));
            let position = ndarray::Array2::from_shape_fn((101, 1), |(c, _)| angle(c as f64 / 100.0));
            let demo = pdmp_core::Demonstration::new(position, pdmp_core::Sampling::Uniform { dt: 0.01 }).unwrap();
            demo.with_units(vec![unit.to_owned()]).unwrap()
        });
        let model = learn(&demos, &options(Kind::Discrete));
        let (mut free, mut tracking) = (controller(&model), controller(&model));
        for _ in 0..1200 {
            let wrapped = (tracking.position()[0] + turn / 2.0).rem_euclid(turn) - turn / 2.0;
            free.step().unwrap();
            tick(&mut tracking, &measured(&[wrapped])).unwrap();
            assert!(relative_distance(&model, free.position(), tracking.position()) < 1e-9);
        }
        assert!(tracking.position()[0] > turn / 2.0);
    }
}

/// A movement with a stopped phase does not finish, even on its goal.
#[test]
fn stopped_phase_does_not_finish() {
    let mut controller = controller(&REACH);
    controller.set_compliance(Compliance { stopping: 1e12, tracking: 0.0 }).unwrap();
    controller.step().unwrap();
    for _ in 0..5000 {
        let far: Vec<f64> = controller.position().iter().map(|y| y + 0.1).collect();
        assert_eq!(tick(&mut controller, &measured(&far)).unwrap(), Status::Working);
    }
    assert!(controller.phase() > 0.99);
}

/// An error from the first tick on is expected at once: the movement takes its time, and ends no further off than the error.
#[test]
fn error_from_the_first_tick_neither_slows_nor_shifts_the_movement() {
    let ticks = |error: f64| {
        let mut controller = controller(&REACH);
        for ticks in 1..5000 {
            let robot: Vec<f64> = controller.position().iter().map(|y| y + error).collect();
            if tick(&mut controller, &measured(&robot)).unwrap() == Status::Finished {
                assert!(relative_distance(&REACH, controller.position(), controller.centre()) < 0.01);
                return ticks;
            }
        }
        5000
    };
    for error in [0.01, -0.1, 0.5] {
        assert_eq!(ticks(error), ticks(0.0));
    }
}

/// The error of a degree of freedom that is stationary in the demonstrations does not stop the phase.
#[test]
fn stationary_dof_does_not_stop_the_phase() {
    let stationary = reaches().into_iter().map(|demo| {
        let mut position = demo.position().to_owned();
        position.column_mut(2).fill(0.7);
        pdmp_core::Demonstration::new(position, pdmp_core::Sampling::Uniform { dt: 0.01 }).unwrap()
    });
    let model = learn(&stationary.collect::<Vec<_>>(), &options(Kind::Discrete));
    let (mut free, mut pulled, mut max_pull) = (controller(&model), controller(&model), 0.0f64);
    free.step().unwrap();
    pulled.step().unwrap();
    for _ in 0..500 {
        let mut robot = pulled.position().to_vec();
        robot[2] += 0.1;
        free.step().unwrap();
        tick(&mut pulled, &measured(&robot)).unwrap();
        max_pull = max_pull.max(pulled.position()[2] - free.position()[2]);
    }
    assert_eq!(free.phase(), pulled.phase());
    assert_eq!(free.position()[..2], pulled.position()[..2]);
    assert!(max_pull > 0.03, "{max_pull}");
}

/// A rejected perturbation leaves the state unchanged.
#[test]
fn rejected_perturbations_leave_the_state() {
    let mut rejecting = controller(&REACH);
    let mut reference = controller(&REACH);
    let valid = [0.1; 3];
    for _ in 0..10 {
        for bad in [&[0.1; 2][..], &[0.1; 4], &[0.1, f64::NAN, 0.0], &[f64::INFINITY, 0.0, 0.0], &[0.0, 0.0, 1e200]] {
            let last = Command { measured: Some(bad), ..coupling(&valid, &valid) };
            for terms in [measured(bad), coupling(bad, &valid), coupling(&valid, bad), last] {
                assert!(tick(&mut rejecting, &terms).is_err());
            }
        }
        assert!(tick(&mut rejecting, &Command { dt: Some(-1.0), ..measured(&valid) }).is_err());
        for gains in [(-1.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(matches!(
                rejecting.set_compliance(Compliance { stopping: gains.0, tracking: gains.1 }),
                Err(Error::Range { .. })
            ));
        }
        assert_eq!(rejecting.compliance(), reference.compliance());
        assert_eq!((rejecting.position(), rejecting.time()), (reference.position(), reference.time()));
        tick(&mut rejecting, &coupling(&valid, &valid)).unwrap();
        tick(&mut reference, &coupling(&valid, &valid)).unwrap();
        assert_eq!((rejecting.position(), rejecting.velocity()), (reference.position(), reference.velocity()));
    }
    let error = tick(&mut rejecting, &measured(&[0.1, f64::NAN, 0.0])).unwrap_err();
    assert_eq!(error.to_string(), "measured[1] = NaN: every number must be finite");
    // A reset discards the perturbation.
    rejecting.reset(&Conditions::default()).unwrap();
    assert_eq!(rejecting.velocity(), controller(&REACH).velocity());
}

/// A DoF that rests in all demonstrations delays the end of a movement by no more than others when it was pushed away.
#[test]
fn disturbed_dof_at_rest_does_not_delay_the_end() {
    let demos: Vec<Demonstration> = [0.8, 1.0, 1.3].map(reach_beside_rest).into();
    let model = Arc::new(fit(&demos, &FitOptions::new(Kind::Discrete)).unwrap());
    let end = |push: [f64; 2]| {
        let mut controller = controller(&model);
        let mut ticks = 0;
        while controller.status() == Status::Working {
            let pushed = [controller.position()[0] + push[0], controller.position()[1] + push[1]];
            let command = if (300..350).contains(&ticks) { measured(&pushed) } else { Command::default() };
            controller.step_with(&command).unwrap();
            ticks += 1;
            if ticks == 350 {
                controller.release();
            }
            assert!(ticks < 20_000);
        }
        ticks
    };
    let [free, moving, resting] = [[0.0, 0.0], [1e-3, 0.0], [0.0, 1e-3]].map(end);
    assert!(resting <= moving && moving < free + 300, "{free} {moving} {resting}");
    // A change of its goal is waited for, within the tolerance of this change.
    let mut controller = controller(&model);
    let goal = [controller.centre()[0], controller.centre()[1] + 0.01];
    controller.set_goal(&goal).unwrap();
    while controller.step().unwrap() == Status::Working {}
    assert!((controller.position()[1] - goal[1]).abs() <= 0.005 * 0.01);
}

/// Returns a demonstration of a reach of given height beside a DoF at rest.
fn reach_beside_rest(height: f64) -> Demonstration {
    let position =
        Array2::from_shape_fn((201, 2), |(c, d)| if d == 0 { height * minimum_jerk(c as f64 / 200.0) } else { 0.4 });
    Demonstration::new(position, Sampling::Uniform { dt: 0.005 }).unwrap()
}

proptest! {
    /// The tracking term is stable for any gain and tick length: the position stays within a multiple of its input.
    #[test]
    fn tracking_is_stable_at_any_tick(dt in 1e-6..100.0f64, tracking in 1e-3..1e6f64, ticks in 1..200usize) {
        for model in [&*REACH, &*CYCLE] {
            let mut controller = controller(model);
            controller.set_compliance(Compliance { stopping: 1000.0, tracking }).unwrap();
            let robot = vec![100.0; model.n_dofs()];
            for _ in 0..ticks {
                tick(&mut controller, &Command { dt: Some(dt), ..measured(&robot) }).unwrap();
                prop_assert!(max_magnitude(controller.position()) < 250.0, "{:?}", controller.position());
            }
        }
    }
}

/// Perturbations and gains of any size leave the state finite for ticks of any length.
#[test]
fn any_perturbation_leaves_the_state_finite() {
    let ticks = prop::collection::vec((0..4u8, -150.0..150.0f64, 1e-9..100.0f64, 0.0..1e100f64), 1..40);
    mostly_accepted(ticks, |ticks, tally| {
        for model in [&*REACH, &*CYCLE] {
            let mut controller = controller(model);
            for &(input, exponent, dt, gain) in &ticks {
                let values = vec![10f64.powf(exponent); model.n_dofs()];
                let terms = coupling(&values, &values);
                let both = Command { measured: Some(&values), ..terms };
                tally.count(match input {
                    0 => tick(&mut controller, &Command { dt: Some(dt), ..measured(&values) }),
                    1 => tick(&mut controller, &Command { dt: Some(dt), ..terms }),
                    2 => tick(&mut controller, &Command { dt: Some(dt), ..both }),
                    _ => controller
                        .set_compliance(Compliance { stopping: gain, tracking: gain })
                        .and_then(|()| controller.step()),
                });
                for values in [controller.position(), controller.velocity(), controller.acceleration()] {
                    prop_assert!(values.iter().all(|x| x.is_finite()));
                }
                prop_assert!(controller.phase().is_finite());
            }
        }
        Ok(())
    });
}
