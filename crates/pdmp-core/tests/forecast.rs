//! Copies of a controller, and forecasts of its movement.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/commands.rs"]
mod commands;
mod common;
#[path = "common/counting.rs"]
mod counting;

use commands::{motion, random_tick};
use common::*;
use counting::{Random, allocations};
use pdmp_core::{Command, Conditions, Controller, Kind, Model};

fn started(model: &Model) -> Controller {
    Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap()
}

/// A forecast with the ticks of the loop is its future to the bit, after any commands, and leaves the loop unchanged.
#[test]
fn a_forecast_is_the_future_of_the_loop_to_the_bit() {
    for model in [&*REACH, &*CYCLE] {
        let (mut controller, mut random) = (started(model), Random(3));
        for _ in 0..40 {
            let forecast = controller.forecast(0.05, None).unwrap();
            let mut undisturbed = controller.clone();
            assert_eq!(forecast.time, (0..=50).map(|k| f64::from(k) * 1e-3).collect::<Vec<_>>());
            for k in 0..=50 {
                let rows = [&forecast.position, &forecast.velocity, &forecast.acceleration].map(|rows| rows.row(k));
                for (row, vector) in rows.into_iter().zip(motion(&controller)) {
                    assert_eq!(row.as_slice().unwrap(), vector);
                }
                controller.step().unwrap();
            }
            (0..=50).for_each(|_| _ = undisturbed.step().unwrap());
            assert_eq!(motion(&controller), motion(&undisturbed));
            (0..30).for_each(|_| random_tick(&mut controller, &mut random));
        }
    }
}

/// Without a measured position, a forecast with coarse ticks agrees with one with fine ticks.
#[test]
fn a_coarse_forecast_is_as_accurate_as_a_fine_one() {
    for model in [&*REACH, &*CYCLE] {
        let mut controller = started(model);
        (0..200).for_each(|_| _ = controller.step().unwrap());
        controller.set_style(&[0.5, -0.2]).unwrap();
        controller.set_tau(0.8 * model.tau()).unwrap();
        let (fine, coarse) = (controller.forecast(1.0, None).unwrap(), controller.forecast(1.0, Some(0.1)).unwrap());
        for (k, row) in coarse.position.outer_iter().enumerate() {
            let deviation = (&row - &fine.position.row(100 * k)).mapv(f64::abs).into_iter().fold(0.0, f64::max);
            assert!(deviation < 1e-7, "{} at {k}: {deviation:e}", model.kind());
        }
    }
}

/// A measured position in force holds the forecast back as it holds the loop.
#[test]
fn a_measured_position_stays_in_force_in_a_forecast() {
    let mut controller = started(&REACH);
    (0..300).for_each(|_| _ = controller.step().unwrap());
    let free = controller.forecast(0.3, None).unwrap();
    let blocked = [0.0; 3];
    tick(&mut controller, &Command { measured: Some(&blocked), ..Command::default() }).unwrap();
    let held = controller.forecast(0.3, None).unwrap();
    assert!((free.position[[300, 0]] - held.position[[300, 0]]).abs() > 0.05);
}

/// Copying into an earlier copy allocates nothing, and the copy moves as the original does.
#[test]
fn copying_into_an_earlier_copy_allocates_nothing() {
    for model in [&*REACH, &*CYCLE] {
        let (mut controller, mut random) = (started(model), Random(5));
        let mut copy = controller.clone();
        for _ in 0..200 {
            (0..20).for_each(|_| random_tick(&mut controller, &mut random));
            let before = allocations();
            copy.clone_from(&controller);
            (0..10).for_each(|_| _ = copy.step().unwrap());
            assert_eq!(allocations() - before, 0);
            (0..10).for_each(|_| _ = controller.step().unwrap());
            assert_eq!(motion(&copy), motion(&controller));
            assert_eq!(
                (copy.time(), copy.phase(), copy.status()),
                (controller.time(), controller.phase(), controller.status())
            );
        }
        // A copy of a controller of another model has its model.
        let mut other = started(if model.kind() == Kind::Discrete { &CYCLE } else { &REACH });
        other.clone_from(&controller);
        other.step().unwrap();
        controller.step().unwrap();
        assert_eq!(motion(&other), motion(&controller));
    }
}

/// Invalid horizons and intervals are rejected by name.
#[test]
fn invalid_horizons_are_rejected() {
    let controller = started(&REACH);
    let message = |horizon, dt| controller.forecast(horizon, dt).unwrap_err().to_string();
    for horizon in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(message(horizon, None).starts_with("horizon = "), "{}", message(horizon, None));
    }
    for dt in [0.0, -1.0, f64::NAN] {
        assert!(message(1.0, Some(dt)).starts_with("dt = "));
    }
    assert_eq!(message(1.0, Some(1e-9)), "horizon = 1: more than 1e7 intervals of dt: shorten it, or enlarge dt");
    assert_eq!(message(1e9, Some(1e8)), "dt = 100000000: must not exceed 1000 tau");
    assert_eq!(controller.forecast(0.0, None).unwrap().position.nrows(), 1);
}
