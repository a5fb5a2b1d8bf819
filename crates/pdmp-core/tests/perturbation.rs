//! What a running primitive does when its robot is disturbed, or its user adds terms.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/accepted.rs"]
mod accepted;
mod common;

use std::sync::Arc;

use accepted::mostly_accepted;
use common::*;
use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Conditions, Controller, Error, Kind, Model, Status};
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

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

/// Largest distance of two positions, in ranges of their DoFs.
fn apart(model: &Model, a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).zip(model.ranges()).map(|((a, b), range)| (a - b).abs() / range).fold(0.0, f64::max)
}

/// Where a frame about a goal lies from it: (g − y₀)(m − 1).
fn frame(model: &Model, d: usize, u: f64) -> f64 {
    let demonstrated = model.demonstrated();
    match model.kind() {
        Kind::Discrete => {
            let [goal, start] =
                [&demonstrated.goals, &demonstrated.starts].map(|places| places[[demonstrated.nominal, d]]);
            (goal - start) * (model.transport(u).unwrap() - 1.0)
        }
        Kind::Rhythmic => 0.0,
    }
}

/// State of the equations written down again: positions in the frame, z and the phase's clock.
type Plain = (Vec<f64>, Vec<f64>, f64);

/// What τẏ, τż and τu̇ are under a velocity c_v, an acceleration c_a and a pace κ.
fn slopes(model: &Model, (y, z, u): &Plain, velocity: &[f64], acceleration: &[f64], pace: f64) -> Plain {
    let nominal = model.demonstrated().nominal;
    let demonstrated = model.demonstrated();
    let (style, tau, n) = (demonstrated.styles.row(nominal), model.tau(), model.n_dofs());
    let discrete = model.kind() == Kind::Discrete;
    let centre = if discrete { demonstrated.goals.row(nominal) } else { demonstrated.anchors.row(nominal) };
    let (mut outputs, mut rises) = (vec![0.0; style.len() * n], vec![0.0; style.len() * n]);
    model.forcing_table().evaluate(*u, &mut outputs, &mut rises);
    let w = |d: usize| style.iter().enumerate().map(|(j, s)| s * outputs[j * n + d]).sum::<f64>();
    let pdmp_core::dynamics::Attractor { alpha_z, beta_z } = model.attractor();
    (
        (0..n).map(|d| (z[d] + w(d)) / tau + velocity[d]).collect(),
        (0..n).map(|d| (alpha_z * (beta_z * (centre[d] - y[d]) - z[d]) + tau * tau * acceleration[d]) / tau).collect(),
        pace / tau,
    )
}

fn rk4(model: &Model, state: &Plain, dt: f64, velocity: &[f64], acceleration: &[f64], pace: f64) -> Plain {
    let slope = |state: &Plain| slopes(model, state, velocity, acceleration, pace);
    let add = |a: &Plain, k: &Plain, t: f64| {
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

/// Terms of one's own and a constant tracking error do what the equations say, as RK4 integrates them.
#[test]
fn perturbed_movement_solves_the_stated_equations() {
    let (velocity, acceleration, behind) = ([0.3, -0.2, 0.1], [2.0, 1.0, -3.0], [-0.02, 0.01, 0.005]);
    let (dt, stopping, tracking) = (1e-3, 700.0, 3.0);
    for (model, phase) in [(&*REACH, true), (&*REACH, false), (&*CYCLE, true), (&*CYCLE, false)] {
        let n = model.n_dofs();
        let mut controller = controller(model);
        controller.set_compliance(stopping, tracking).unwrap();
        // From rest where the cycle would start on its cycle: z is then not seen from outside.
        let start: Vec<f64> = (0..n).map(|d| controller.position()[d] - frame(model, d, 0.0)).collect();
        let rest = controller.velocity().iter().map(|v| v * model.tau());
        let at_start = slopes(model, &(start.clone(), vec![0.0; n], 0.0), &vec![0.0; n], &vec![0.0; n], 1.0).0;
        let z = rest.zip(&at_start).map(|(flow, w)| flow - w * model.tau()).collect();
        let mut plain: Plain = (start, z, 0.0);
        let pull = if phase { (1.0 - (-tracking * dt / model.tau()).exp()) / dt } else { 0.0 };
        let (mut pushed, mut pace, mut expected) = (velocity[..n].to_vec(), 1.0, 0.0);
        // Past the demonstrated end, which is a tick's end in the unslowed reach.
        for _ in 0..1500 {
            let robot: Vec<f64> = controller.position().iter().zip(behind).map(|(y, e)| y + e).collect();
            let terms = coupling(&velocity[..n], &acceleration[..n]);
            let terms = if phase { Command { measured: Some(&robot), ..terms } } else { terms };
            tick(&mut controller, &Command { dt: Some(dt), ..terms }).unwrap();
            // The expected error is a share of the constant one, the same for every DoF.
            let beyond: Vec<f64> = behind[..n].iter().map(|e| e * (1.0 - expected)).collect();
            if phase {
                let strain: f64 = beyond.iter().zip(model.ranges()).map(|(d, range)| (d / range).powi(2)).sum();
                pace = 1.0 / (1.0 + stopping * strain);
                expected +=
                    (1.0 - expected) * (1.0 - (-5.0 / model.canonical().extent() * pace * dt / model.tau()).exp());
            }
            pushed = velocity.iter().zip(&beyond).map(|(v, d)| v + pull * d).collect();
            for _ in 0..4 {
                plain = rk4(model, &plain, dt / 4.0, &pushed, &acceleration[..n], pace);
            }
            let position: Vec<f64> = (0..n).map(|d| plain.0[d] + frame(model, d, plain.2)).collect();
            assert!(apart(model, controller.position(), &position) < 1e-7);
        }
        let slope = slopes(model, &plain, &pushed, &acceleration[..n], pace);
        let rise = |d: usize| (frame(model, d, plain.2 + 1e-6) - frame(model, d, plain.2 - 1e-6)) / 2e-6 * slope.2;
        assert!((0..n).all(|d| (slope.0[d] + rise(d) - controller.velocity()[d]).abs() < 1e-6));
        assert!((controller.phase() - model.canonical().phase(plain.2)).abs() < 1e-9);
    }
}

/// Velocity and acceleration are the derivatives of the position, perturbed and while τ is in transition: the acceleration
/// but for the pace of the phase, which a measured position changes from tick to tick.
#[test]
fn velocity_and_acceleration_stay_derivatives() {
    for (model, follows) in [(&*REACH, true), (&*REACH, false), (&*CYCLE, true), (&*CYCLE, false)] {
        let (n, dt) = (model.n_dofs(), 1e-5);
        let mut controller = controller(model);
        // A pull is held over each tick, and steps from one to the next.
        controller.set_compliance(1000.0, 0.0).unwrap();
        (0..200).for_each(|_| _ = controller.step().unwrap());
        controller.set_tau(0.6 * model.tau()).unwrap();
        let (velocity, acceleration) = (vec![0.4; n], vec![-5.0; n]);
        let mut samples = Vec::new();
        for _ in 0..5000 {
            let robot: Vec<f64> = controller.position().iter().map(|y| y + 0.01).collect();
            let measured = Some(robot.as_slice()).filter(|_| follows);
            let terms = Command { measured, ..coupling(&velocity, &acceleration) };
            tick(&mut controller, &Command { dt: Some(dt), ..terms }).unwrap();
            let row = [controller.position(), controller.velocity(), controller.acceleration()];
            samples.push(row.map(<[f64]>::to_vec));
        }
        for ticks in samples.windows(3) {
            let [before, now, after] = [&ticks[0], &ticks[1], &ticks[2]];
            let accelerates = !follows || model.kind() == Kind::Rhythmic;
            for (what, bound) in [(0, 1e-5), (1, if accelerates { 5e-3 } else { 2.0 })] {
                for d in 0..n {
                    let slope = (after[what][d] - before[what][d]) / (2.0 * dt);
                    assert!((slope - now[what + 1][d]).abs() < bound);
                }
            }
        }
    }
}

/// Terms of zero and a robot that is where it should be change nothing, to the last bit.
#[test]
fn no_error_and_zero_terms_change_nothing() {
    for model in [&*REACH, &*CYCLE] {
        let zero = vec![0.0; model.n_dofs()];
        let (mut plain, mut coupled, mut followed) = (controller(model), controller(model), controller(model));
        for k in 0..1500 {
            if k == 300 {
                for controller in [&mut plain, &mut coupled, &mut followed] {
                    controller.set_style(&[0.9, -0.4]).unwrap();
                    controller.set_tau(0.6 * model.tau()).unwrap();
                }
            }
            plain.step().unwrap();
            tick(&mut coupled, &coupling(&zero, &zero)).unwrap();
            let robot = followed.position().to_vec();
            tick(&mut followed, &measured(&robot)).unwrap();
            for other in [&coupled, &followed] {
                assert_eq!(plain.position(), other.position());
                assert_eq!(plain.velocity(), other.velocity());
                assert_eq!((plain.phase(), plain.status()), (other.phase(), other.status()));
            }
        }
    }
}

/// Held fast for as long as the whole movement, the phase nearly stops and the movement waits near the place; let go, it
/// goes on from there without a leap.
#[test]
fn held_and_let_go_it_continues() {
    for model in [&*REACH, &*CYCLE] {
        let mut free = controller(model);
        let peak = (0..1500).fold(0.0f64, |peak, _| {
            free.step().unwrap();
            peak.max(largest(free.velocity()))
        });
        let mut held = controller(model);
        (0..400).for_each(|_| _ = held.step().unwrap());
        let (place, phase) = (held.position().to_vec(), held.phase());
        for _ in 0..1000 {
            assert_eq!(tick(&mut held, &measured(&place)).unwrap(), Status::Working);
            assert!(apart(model, held.position(), &place) < 0.2);
            assert!(largest(held.velocity()) < peak);
        }
        // Free, the phase would have gone through the whole movement.
        let gone = match model.canonical() {
            pdmp_core::dynamics::Canonical::Discrete { alpha_x, u_end } => {
                (phase / held.phase()).ln() / alpha_x / u_end
            }
            pdmp_core::dynamics::Canonical::Rhythmic { .. } => (held.phase() - phase) / std::f64::consts::TAU,
        };
        assert!((0.0..0.12).contains(&gone), "{gone}");
        held.release();
        let before = held.position().to_vec();
        let mut ticks = 0;
        loop {
            let status = held.step().unwrap();
            assert!(ticks > 0 || apart(model, held.position(), &before) < 0.01);
            assert!(largest(held.velocity()) < 1.25 * peak, "{} {peak}", largest(held.velocity()));
            ticks += 1;
            if status == Status::Finished || ticks == 20_000 {
                break;
            }
        }
        match model.kind() {
            Kind::Discrete => {
                let goal = model.demonstrated().goals.row(model.demonstrated().nominal).to_vec();
                assert!(apart(model, held.position(), &goal) < 2e-3 && ticks < 1600, "{ticks}");
            }
            Kind::Rhythmic => {
                // Back on the cycle: where the free one is at the same phase.
                while (free.phase() - held.phase()).rem_euclid(std::f64::consts::TAU) > 1e-9 {
                    let left = (held.phase() - free.phase()).rem_euclid(std::f64::consts::TAU) * model.tau();
                    tick(&mut free, &Command { dt: Some(left.min(1e-3)), ..Command::default() }).unwrap();
                }
                assert!(apart(model, held.position(), free.position()) < 1e-6);
            }
        }
    }
}

/// A robot that always lags by the same holds nothing up: the movement arrives on its own goal.
#[test]
fn constant_error_neither_moves_the_goal_nor_stops_the_phase() {
    let goal = REACH.demonstrated().goals.row(REACH.demonstrated().nominal).to_vec();
    for (share, every, longest) in [(0.002, 1, 1.6), (0.05, 1, 1.9), (0.05, 10, 1.9), (0.1, 1, 4.5)] {
        let mut controller = controller(&REACH);
        let mut free = controller.clone();
        let alone = 1 + (0..).take_while(|_| free.step().unwrap() == Status::Working).count();
        let ticks = (0..20_000).position(|k| {
            let robot: Vec<f64> =
                controller.position().iter().zip(REACH.ranges()).map(|(y, range)| y - share * range).collect();
            let command = if k % every == 0 { measured(&robot) } else { Command::default() };
            tick(&mut controller, &command).unwrap() == Status::Finished
        });
        assert!(apart(&REACH, controller.position(), &goal) < 1.5e-3);
        assert!(ticks.is_some_and(|ticks| (ticks as f64) < longest * alone as f64), "{share}: {ticks:?} of {alone}");
    }
}

/// A robot that follows is not held back by a sensor slower than the loop; one that is held fast holds the movement.
#[test]
fn last_distance_stays_in_force_between_measurements() {
    let (mut free, mut followed) = (controller(&REACH), controller(&REACH));
    for k in 0..1500 {
        free.step().unwrap();
        let robot = followed.position().to_vec();
        if k % 10 == 0 { tick(&mut followed, &measured(&robot)) } else { followed.step() }.unwrap();
        assert_eq!(free.position(), followed.position());
    }
    let away = [1, 10, 40].map(|every| {
        let mut held = controller(&REACH);
        (0..300).for_each(|_| _ = held.step().unwrap());
        let place = held.position().to_vec();
        for k in 0..1000 {
            if k % every == 0 { tick(&mut held, &measured(&place)) } else { held.step() }.unwrap();
        }
        apart(&REACH, held.position(), &place)
    });
    assert!(away[1] < 1.1 * away[0] && away[2] < 1.5 * away[0], "{away:?}");
}

/// An encoder that starts anew at ±π or ±180° is no error.
#[test]
fn angles_take_the_error_the_short_way_round() {
    for (unit, turn) in [("rad", std::f64::consts::TAU), ("deg", 360.0), ("°", 360.0)] {
        let demos = [0.9, 1.0, 1.1].map(|a| {
            let rise = |s: f64| turn * (0.4 + 0.16 * a * s * s * (3.0 - 2.0 * s));
            let position = ndarray::Array2::from_shape_fn((101, 1), |(c, _)| rise(c as f64 / 100.0));
            let demo = pdmp_core::Demonstration::new(position, pdmp_core::Sampling::Uniform { dt: 0.01 }).unwrap();
            demo.with_units(vec![unit.to_owned()]).unwrap()
        });
        let model = learn(&demos, &options(Kind::Discrete));
        let (mut free, mut followed) = (controller(&model), controller(&model));
        for _ in 0..1200 {
            let wrapped = (followed.position()[0] + turn / 2.0).rem_euclid(turn) - turn / 2.0;
            free.step().unwrap();
            tick(&mut followed, &measured(&[wrapped])).unwrap();
            assert!(apart(&model, free.position(), followed.position()) < 1e-9);
        }
        assert!(followed.position()[0] > turn / 2.0);
    }
}

/// A movement whose phase is stopped does not finish, be it on its goal.
#[test]
fn stopped_phase_does_not_finish() {
    let mut controller = controller(&REACH);
    controller.set_compliance(1e12, 0.0).unwrap();
    for _ in 0..5000 {
        let far: Vec<f64> = controller.position().iter().map(|y| y + 0.1).collect();
        assert_eq!(tick(&mut controller, &measured(&far)).unwrap(), Status::Working);
    }
    assert!(controller.phase() > 0.99);
}

/// A degree of freedom that was shown standing still does not stop the phase.
#[test]
fn still_dof_does_not_stop_the_phase() {
    let still = reaches().into_iter().map(|demo| {
        let mut position = demo.position().to_owned();
        position.column_mut(2).fill(0.7);
        pdmp_core::Demonstration::new(position, pdmp_core::Sampling::Uniform { dt: 0.01 }).unwrap()
    });
    let model = learn(&still.collect::<Vec<_>>(), &options(Kind::Discrete));
    let (mut free, mut pulled, mut most) = (controller(&model), controller(&model), 0.0f64);
    for _ in 0..500 {
        let mut robot = pulled.position().to_vec();
        robot[2] += 0.1;
        free.step().unwrap();
        tick(&mut pulled, &measured(&robot)).unwrap();
        most = most.max(pulled.position()[2] - free.position()[2]);
    }
    assert_eq!(free.phase(), pulled.phase());
    assert_eq!(free.position()[..2], pulled.position()[..2]);
    assert!(most > 0.03, "{most}");
}

/// What is refused changes nothing.
#[test]
fn refused_perturbations_leave_the_state() {
    let mut bad_one = controller(&REACH);
    let mut good = controller(&REACH);
    let fine = [0.1; 3];
    for _ in 0..10 {
        for bad in [&[0.1; 2][..], &[0.1; 4], &[0.1, f64::NAN, 0.0], &[f64::INFINITY, 0.0, 0.0], &[0.0, 0.0, 1e200]] {
            let last = Command { measured: Some(bad), ..coupling(&fine, &fine) };
            for terms in [measured(bad), coupling(bad, &fine), coupling(&fine, bad), last] {
                assert!(tick(&mut bad_one, &terms).is_err());
            }
        }
        assert!(tick(&mut bad_one, &Command { dt: Some(-1.0), ..measured(&fine) }).is_err());
        for gains in [(-1.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(matches!(bad_one.set_compliance(gains.0, gains.1), Err(Error::Range { .. })));
        }
        assert_eq!(bad_one.compliance(), good.compliance());
        assert_eq!((bad_one.position(), bad_one.time()), (good.position(), good.time()));
        tick(&mut bad_one, &coupling(&fine, &fine)).unwrap();
        tick(&mut good, &coupling(&fine, &fine)).unwrap();
        assert_eq!((bad_one.position(), bad_one.velocity()), (good.position(), good.velocity()));
    }
    let error = tick(&mut bad_one, &measured(&[0.1, f64::NAN, 0.0])).unwrap_err();
    assert_eq!(error.to_string(), "measured[1] = NaN: every number must be finite");
    // A new start forgets what was held.
    bad_one.reset(&Conditions::default()).unwrap();
    assert_eq!(bad_one.velocity(), controller(&REACH).velocity());
}

proptest! {
    /// Pulled with any gain at ticks of any length, the movement goes no further than robot and goal are apart.
    #[test]
    fn pull_is_stable_at_any_tick(dt in 1e-6..100.0f64, tracking in 1e-3..1e6f64, ticks in 1..200usize) {
        for model in [&*REACH, &*CYCLE] {
            let mut controller = controller(model);
            controller.set_compliance(1000.0, tracking).unwrap();
            let robot = vec![100.0; model.n_dofs()];
            for _ in 0..ticks {
                tick(&mut controller, &Command { dt: Some(dt), ..measured(&robot) }).unwrap();
                prop_assert!(largest(controller.position()) < 250.0, "{:?}", controller.position());
            }
        }
    }
}

/// Perturbations and gains of any size, in ticks of any length, leave the state finite.
#[test]
fn any_perturbation_leaves_the_state_finite() {
    let ticks = prop::collection::vec((0..4u8, -150.0..150.0f64, 1e-9..100.0f64, 0.0..1e100f64), 1..40);
    mostly_accepted(ticks, |ticks, tally| {
        for model in [&*REACH, &*CYCLE] {
            let mut controller = controller(model);
            for &(what, exponent, dt, gain) in &ticks {
                let values = vec![10f64.powf(exponent); model.n_dofs()];
                let terms = coupling(&values, &values);
                let both = Command { measured: Some(&values), ..terms };
                tally.count(match what {
                    0 => tick(&mut controller, &Command { dt: Some(dt), ..measured(&values) }),
                    1 => tick(&mut controller, &Command { dt: Some(dt), ..terms }),
                    2 => tick(&mut controller, &Command { dt: Some(dt), ..both }),
                    _ => controller.set_compliance(gain, gain).and_then(|()| controller.step()),
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
