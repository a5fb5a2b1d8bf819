//! Snapshots: a restored controller continues to the bit, and no snapshot leads to a number that is not finite.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

#[path = "common/commands.rs"]
mod commands;
mod common;
#[path = "common/counting.rs"]
mod counting;

use std::sync::LazyLock;

use commands::{motion, random_tick};
use common::*;
use counting::Random;
use pdmp_core::{Command, Conditions, Controller, FitOptions, Kind, Model, fit};

/// Reaches with the paper's immediate transport, where the goal passes a filter.
static IMMEDIATE: LazyLock<Model> = LazyLock::new(|| {
    let mut options = FitOptions::new(Kind::Discrete);
    options.canonical = immediate();
    fit(&reaches(), &options).unwrap()
});

fn models() -> [&'static Model; 3] {
    [&REACH, &CYCLE, &IMMEDIATE]
}

/// Performs one tick under commands that suit the primitive, of which immediate transport has no final velocity.
fn random_step(controller: &mut Controller, model: &Model, random: &mut Random) {
    if std::ptr::eq(model, &*IMMEDIATE) {
        let goal: Vec<f64> = (0..model.n_dofs()).map(|_| random.next()).collect();
        if random.rarely() {
            controller.set_goal(&goal).unwrap();
        }
        controller.step().unwrap();
    } else {
        random_tick(controller, random);
    }
}

/// After any commands, with any transition, the restored controller moves as the saved one does under the same commands.
#[test]
fn a_restored_controller_continues_to_the_bit() {
    for model in models() {
        for transition in [None, Some(0.0), Some(0.4)] {
            let mut controller = Controller::new(model.primitive(), 2e-3, &Conditions::default(), transition).unwrap();
            let mut random = Random(7);
            for _ in 0..40 {
                let snapshot = controller.snapshot();
                let mut restored = Controller::restore(model.primitive(), &snapshot).unwrap();
                assert_eq!(restored.snapshot(), snapshot);
                let seed = random.0;
                for _ in 0..25 {
                    random_step(&mut controller, model, &mut random);
                }
                random.0 = seed;
                for _ in 0..25 {
                    random_step(&mut restored, model, &mut random);
                }
                assert_eq!(motion(&restored), motion(&controller));
                assert_eq!(
                    (restored.time(), restored.phase(), restored.status(), restored.goal_velocity()),
                    (controller.time(), controller.phase(), controller.status(), controller.goal_velocity()),
                );
                assert_eq!(
                    (restored.tau(), restored.speed(), restored.tolerance(), restored.compliance()),
                    (controller.tau(), controller.speed(), controller.tolerance(), controller.compliance()),
                );
            }
        }
    }
}

/// A controller saved before its first tick, and one past its end, are restored too.
#[test]
fn snapshots_are_restored_at_the_start_and_past_the_end() {
    let conditions = Conditions { velocity: Some(vec![0.1, -0.2, 0.3]), ..Conditions::default() };
    let mut controller = Controller::new(REACH.primitive(), 1e-3, &conditions, None).unwrap();
    for ticks in [0, 1, 3000] {
        (0..ticks).for_each(|_| _ = controller.step().unwrap());
        let mut restored = Controller::restore(REACH.primitive(), &controller.snapshot()).unwrap();
        assert_eq!(motion(&restored), motion(&controller));
        assert_eq!(restored.status(), controller.status());
        restored.set_goal(&[0.1, 0.2, 0.3]).unwrap();
        let mut original = controller.clone();
        original.set_goal(&[0.1, 0.2, 0.3]).unwrap();
        (0..100).for_each(|_| assert_eq!(original.step().unwrap(), restored.step().unwrap()));
        assert_eq!(motion(&restored), motion(&original));
    }
}

/// Numbers at and beyond the bounds of every quantity.
const EXTREMES: [f64; 19] = [
    f64::NAN,
    f64::INFINITY,
    -f64::MAX,
    1e300,
    -1e200,
    1e199,
    -1e150,
    1e149,
    1e100,
    -1e100,
    1e12,
    1e9,
    1e6,
    6.5,
    1.0,
    -1.0,
    0.0,
    f64::MIN_POSITIVE,
    1e-310,
];

/// Restores a forged snapshot and moves on under further commands: every number stays finite. Returns whether it was
/// accepted.
fn is_accepted(model: &Model, forged: &[f64]) -> bool {
    let Ok(mut restored) = Controller::restore(model.primitive(), forged) else { return false };
    for k in 0..12 {
        // A tick may be too long for a forged rate.
        if restored.step().is_err() {
            break;
        }
        if k == 4 {
            let vector = vec![0.3; model.n_dofs()];
            _ = restored.set_goal(&vector);
            _ = restored.set_goal_velocity(Some(&vector));
            _ = restored.set_phase(1.0);
            _ = restored.step_with(&Command { measured: Some(&vector), ..Command::default() });
        }
        let finite = motion(&restored).iter().all(|vector| vector.iter().all(|x| x.is_finite()));
        assert!(finite, "{} at tick {k}: {:?}", model.kind(), motion(&restored));
    }
    assert!(restored.time().is_finite() && restored.phase().is_finite());
    true
}

/// A snapshot with any number replaced by any other, or several of them, is rejected or stays finite.
#[test]
fn forged_snapshots_are_rejected_or_stay_finite() {
    let (mut accepted, mut rejected) = (0, 0);
    for (model, transition) in models().into_iter().flat_map(|model| [None, Some(0.0)].map(|t| (model, t))) {
        let mut controller = Controller::new(model.primitive(), 5e-3, &Conditions::default(), transition).unwrap();
        let mut random = Random(11);
        (0..60).for_each(|_| random_step(&mut controller, model, &mut random));
        let snapshot = controller.snapshot();
        let mut count = |forged: &[f64]| if is_accepted(model, forged) { accepted += 1 } else { rejected += 1 };
        let mut forged = snapshot.clone();
        for index in 0..snapshot.len() {
            for value in EXTREMES {
                forged[index] = value;
                count(&forged);
            }
            forged[index] = snapshot[index];
        }
        for _ in 0..2000 {
            forged.copy_from_slice(&snapshot);
            for _ in 0..1 + (8.0 * random.next()) as usize {
                let index = (random.next() * snapshot.len() as f64) as usize;
                forged[index] = EXTREMES[2 + (random.next() * 17.0) as usize];
            }
            count(&forged);
        }
    }
    assert!(accepted > 1000 && rejected > 1000, "{accepted} {rejected}");
}

/// A snapshot of another length, version or model is rejected by one clear error.
#[test]
fn snapshots_of_other_models_are_rejected() {
    let controller = Controller::new(REACH.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let snapshot = controller.snapshot();
    let message =
        |model: &Model, numbers: &[f64]| Controller::restore(model.primitive(), numbers).unwrap_err().to_string();
    for n in [0, 1, 9, 10, snapshot.len() - 1] {
        assert!(message(&REACH, &snapshot[..n]).starts_with("snapshot"), "{}", message(&REACH, &snapshot[..n]));
    }
    let longer = [&*snapshot, &[0.0]].concat();
    assert!(message(&REACH, &longer).starts_with("snapshot"));
    assert!(message(&CYCLE, &snapshot).contains("another model"));
    let mut other = snapshot.clone();
    other[0] = 1.0;
    assert_eq!(message(&REACH, &other), "snapshot version = 1: must be 3");
}
