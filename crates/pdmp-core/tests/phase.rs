//! Phase of a rhythmic movement: the pull by a measured phase, and the reset at an event.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use std::f64::consts::{PI, TAU};

use common::*;
use pdmp_core::{Command, Conditions, Controller, ErrorKind, Kind};

fn started(transition: f64) -> Controller {
    let mut controller = Controller::new(CYCLE.primitive(), 1e-3, &Conditions::default(), Some(transition)).unwrap();
    controller.step().unwrap();
    controller
}

/// Returns the angle in (−π, π].
fn wrapped(angle: f64) -> f64 {
    PI - (PI - angle).rem_euclid(TAU)
}

/// Returns position, velocity and acceleration.
fn motion(controller: &Controller) -> [Vec<f64>; 3] {
    [controller.position(), controller.velocity(), controller.acceleration()].map(<[f64]>::to_vec)
}

/// Returns the largest deviation of the position from that of another controller.
fn deviation(a: &Controller, b: &Controller) -> f64 {
    a.position().iter().zip(b.position()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The difference of a measured phase that advances at the rate of the movement solves δ′ = −k sin δ, for ticks of any length.
#[test]
fn a_measured_phase_pulls_as_coupled_oscillators_do() {
    let tau = CYCLE.tau();
    for gain in [0.25, 1.0] {
        for dt in [1e-3, 1e-2, 0.1 * tau, tau] {
            let mut controller = started(0.0);
            controller.set_phase_gain(gain).unwrap();
            let (start, difference) = (controller.time(), 2.0);
            let offset = controller.phase() + difference;
            for _ in 0..20 {
                let elapsed = (controller.time() - start) / tau;
                let command = Command { dt: Some(dt), phase: Some(offset + elapsed), ..Command::default() };
                tick(&mut controller, &command).unwrap();
                let elapsed = (controller.time() - start) / tau;
                let expected = 2.0 * ((0.5f64 * difference).tan() * (-gain * elapsed).exp()).atan();
                let found = wrapped(offset + elapsed - controller.phase());
                assert!((found - expected).abs() < 1e-9, "{gain} {dt}: {found} {expected}");
            }
        }
    }
}

/// A gait whose frequency differs by the share ε is followed with a lag of asin(ε/k), if ε < k.
#[test]
fn the_phase_locks_with_the_lag_of_adlers_equation() {
    for (share, gain) in [(0.2, 1.0), (-0.2, 1.0), (0.2, 0.5), (0.1, 4.0)] {
        let mut controller = started(0.0);
        controller.set_phase_gain(gain).unwrap();
        let gait = |time: f64| 1.0 + time / CYCLE.tau() * (1.0 + share);
        for _ in 0..20_000 {
            let phase = Some(gait(controller.time()));
            tick(&mut controller, &Command { phase, ..Command::default() }).unwrap();
        }
        let lag = wrapped(gait(controller.time()) - controller.phase());
        assert!((lag - f64::asin(share / gain)).abs() < 2e-3, "{share} {gain}: {lag}");
    }
}

/// The pull never turns the phase back, and a gain of 0 disables it.
#[test]
fn the_phase_never_runs_backwards() {
    let mut controller = started(0.1);
    controller.set_phase_gain(1000.0).unwrap();
    let behind = controller.phase() - 1.0;
    for _ in 0..100 {
        let before = controller.phase();
        tick(&mut controller, &Command { phase: Some(behind), ..Command::default() }).unwrap();
        assert!(wrapped(controller.phase() - before) >= 0.0);
    }
    let mut free = controller.clone();
    controller.set_phase_gain(0.0).unwrap();
    tick(&mut controller, &Command { phase: Some(behind + PI), ..Command::default() }).unwrap();
    free.step().unwrap();
    assert_eq!(motion(&controller), motion(&free));
}

/// The pull acts on the tick of its measurement alone.
#[test]
fn a_measured_phase_acts_for_one_tick() {
    let mut controller = started(0.1);
    tick(&mut controller, &Command { phase: Some(2.0), ..Command::default() }).unwrap();
    let before = controller.phase();
    controller.step().unwrap();
    let advance = wrapped(controller.phase() - before) * CYCLE.tau() / controller.dt();
    assert!((advance - 1.0).abs() < 1e-9, "{advance}");
}

/// A reset moves the phase and leaves position and velocity, and the movement returns to its cycle at the new phase.
#[test]
fn a_reset_phase_leaves_position_and_velocity_continuous() {
    for k in 0..24 {
        let mut controller = started(0.1);
        (0..10 * k).for_each(|_| _ = controller.step().unwrap());
        let [position, velocity, _] = motion(&controller);
        let phase = TAU * f64::from(k) / 24.0;
        controller.set_phase(phase + TAU * f64::from(k % 3 - 1)).unwrap();
        assert!(wrapped(controller.phase() - phase).abs() < 1e-12);
        assert_eq!(controller.position(), position);
        let scale = velocity.iter().fold(1.0, |scale: f64, v| scale.max(v.abs()));
        assert!(controller.velocity().iter().zip(&velocity).all(|(new, old)| (new - old).abs() < 1e-12 * scale));

        // Over the next tick the velocity changes by no more than the acceleration that was announced.
        let [_, _, acceleration] = motion(&controller);
        controller.step().unwrap();
        let [_, continued, _] = motion(&controller);
        let bound = 1.3 * controller.dt() * acceleration.iter().fold(0.0, |bound: f64, a| bound.max(a.abs()));
        assert!(continued.iter().zip(&velocity).all(|(new, old)| (new - old).abs() <= bound));

        let conditions = Conditions { phase: Some(controller.phase()), ..Conditions::default() };
        let mut on_cycle = Controller::new(CYCLE.primitive(), 1e-3, &conditions, None).unwrap();
        assert!(k == 0 || deviation(&controller, &on_cycle) > 1e-3);
        for _ in 0..3000 {
            controller.step().unwrap();
            on_cycle.step().unwrap();
        }
        assert!(deviation(&controller, &on_cycle) < 1e-9, "{}", deviation(&controller, &on_cycle));
    }
}

/// A reset to the present phase changes nothing but rounding.
#[test]
fn a_reset_to_the_present_phase_changes_nothing() {
    let mut controller = started(0.1);
    controller.set_style(&[0.3, 0.1]).unwrap();
    controller.set_amplitude(0.7).unwrap();
    (0..300).for_each(|_| _ = controller.step().unwrap());
    let mut other = controller.clone();
    for _ in 0..500 {
        other.set_phase(other.phase()).unwrap();
        controller.step().unwrap();
        other.step().unwrap();
        assert!(deviation(&controller, &other) < 1e-12);
    }
}

/// Before the first tick, a phase is that of the start.
#[test]
fn a_phase_before_the_first_tick_is_that_of_the_start() {
    let fresh = |conditions| Controller::new(CYCLE.primitive(), 1e-3, &conditions, None).unwrap();
    let mut controller = fresh(Conditions::default());
    controller.set_phase(4.0).unwrap();
    let at_start = fresh(Conditions { phase: Some(4.0), ..Conditions::default() });
    assert_eq!(motion(&controller), motion(&at_start));
}

/// Nakanishi et al. 2004: with the phase reset at heel strike and the frequency adapted by the measured stride, the movement
/// locks onto a gait of another period and phase.
#[test]
fn resets_and_adapted_frequency_lock_onto_a_gait() {
    let heel = 1.0;
    for (ratio, offset) in [(1.25, 0.3), (0.8, 0.7), (1.5, 0.0), (0.7, 0.5)] {
        let stride = ratio * TAU * CYCLE.tau();
        let mut controller = started(0.05);
        let mut strike = offset * stride;
        let mut last = None;
        let mut errors = Vec::new();
        while strike < 20.0 * stride {
            while controller.time() < strike {
                controller.step().unwrap();
            }
            errors.push(wrapped(controller.phase() - heel).abs() / TAU);
            controller.set_phase(heel).unwrap();
            if let Some(last) = last {
                let omega = 1.0 / controller.tau();
                controller.set_tau(1.0 / (omega + 0.5 * (TAU / (controller.time() - last) - omega))).unwrap();
            }
            last = Some(controller.time());
            strike += stride;
        }
        let period = TAU * controller.tau() / stride;
        assert!((period - 1.0).abs() < 0.01, "{ratio}: period {period}");
        assert!(errors[10..].iter().all(|error| *error < 0.02), "{ratio}: {errors:?}");
        assert!(errors[0] > 0.02 || errors[1] > 0.02, "{errors:?}");
    }
}

/// A discrete movement has no phase that can be set, and a phase must be finite; the state then remains unchanged.
#[test]
fn invalid_phases_are_rejected_without_effect() {
    let mut discrete = Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    discrete.step().unwrap();
    let before = motion(&discrete);
    let text = "phase does not apply to a discrete primitive: its state depends on its past; it starts at the start of its path";
    assert_eq!(discrete.set_phase(1.0).unwrap_err().to_string(), text);
    let command = Command { phase: Some(1.0), ..Command::default() };
    assert_eq!(discrete.step_with(&command).unwrap_err().to_string(), text);
    assert_eq!(motion(&discrete), before);

    let mut controller = started(0.1);
    assert_eq!(controller.primitive().kind(), Kind::Rhythmic);
    let before = (motion(&controller), controller.phase(), controller.phase_gain());
    for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
        let error = controller.set_phase(bad).unwrap_err();
        assert!(error.to_string().ends_with("must be a finite angle in rad"), "{error}");
        assert!(controller.step_with(&Command { phase: Some(bad), ..Command::default() }).is_err());
    }
    for bad in [-1.0, f64::NAN, 1001.0] {
        let error = controller.set_phase_gain(bad).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Argument);
        assert!(error.to_string().starts_with("phase_gain = "), "{error}");
    }
    assert_eq!((motion(&controller), controller.phase(), controller.phase_gain()), before);
}
