//! Claims about learning from demonstrations: reproduction, defaults, styles of new demonstrations, errors.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use common::*;
use ndarray::Array2;
use pdmp_core::dynamics::Canonical;
use pdmp_core::learning::fit_with;
use pdmp_core::learning::{DofScaling, StyleOptions, Truncation, style_of};
use pdmp_core::motion::TimeGrid;
use pdmp_core::rollout;
use pdmp_core::{Error, Kind, Sampling, fit};

/// With J = M every demonstration is reproduced at its own duration.
#[test]
fn every_reach_is_reproduced() {
    let demos = reaches();
    for basis in [options(Kind::Discrete).basis, gp()] {
        let model = learn(&demos, &options(Kind::Discrete).basis(basis).n_styles(Truncation::Rank(5)));
        for m in 0..demos.len() {
            let error = reproduction_error(&model, &demos, m);
            assert!(error <= 1e-4, "{}: {error:e}", model.learnt().regression);
        }
    }
}

/// With J = M the limit cycle is the demonstration, and a rollout starts on it.
#[test]
fn every_cycle_is_reproduced_without_a_transient() {
    let demos = cycles();
    for basis in [options(Kind::Rhythmic).basis, gp()] {
        let model = learn(&demos, &options(Kind::Rhythmic).basis(basis).n_styles(Truncation::Rank(4)));
        for m in 0..demos.len() {
            let error = reproduction_error(&model, &demos, m);
            assert!(error <= 1e-4, "{}: {error:e}", model.learnt().regression);
        }
    }
}

/// Singular values of reaches that differ by one height vanish beyond their intrinsic dimension.
#[test]
fn singular_values_vanish_beyond_the_intrinsic_dimension() {
    // y is affine in (h, h²): at most three dimensions.
    let model = learn(&reaches(), &options(Kind::Discrete).n_styles(Truncation::Rank(5)));
    let sigma = &model.learnt().singular_values;
    assert!(sigma[2] > 1e-6 * sigma[0] && sigma[3] < 1e-6 * sigma[0], "{sigma:?}");
}

/// Defaults are critical damping, x = 0.01 at the end, τ the nominal duration or the period over 2π.
#[test]
fn defaults_follow_from_the_nominal_demonstration() {
    let model = learn(&reaches(), &options(Kind::Discrete));
    assert_eq!(model.attractor().beta_z, model.attractor().alpha_z / 4.0);
    assert_eq!(model.demonstrated().nominal, 2);
    assert!((model.tau() - 0.99).abs() < 1e-12);
    assert!((model.canonical().phase(1.0) - 0.01).abs() < 1e-12);
    let model = learn(&cycles(), &options(Kind::Rhythmic));
    assert_eq!(model.demonstrated().nominal, 1);
    assert!((model.tau() - 1.02 / std::f64::consts::TAU).abs() < 1e-12);
    assert_eq!(model.canonical(), Canonical::Rhythmic { mu: 1.0 });
}

/// Translated and uniformly scaled demonstrations have the same styles.
#[test]
fn styles_are_invariant_to_translation_and_scaling() {
    let model = learn(&reaches(), &options(Kind::Discrete));
    let moved: Vec<_> = reaches()
        .iter()
        .map(|demo| {
            let position = demo.position().mapv(|y| 1000.0 * y + 250.0);
            pdmp_core::Demonstration::new(position, demo.sampling().clone()).unwrap()
        })
        .collect();
    let other = learn(&moved, &options(Kind::Discrete));
    let difference = &model.demonstrated().styles - &other.demonstrated().styles;
    assert!(difference.iter().all(|d| d.abs() < 1e-9));
}

/// Samples at irregular time stamps yield the same movement as samples at equal intervals.
#[test]
fn irregular_time_stamps_yield_the_same_movement() {
    let even = [reach(0.3, 1.0, 0.005)];
    let time: Vec<f64> = (0..201).map(|c| f64::from(c) / 200.0).map(|t| t + 0.1 * t * (1.0 - t)).collect();
    let position = ndarray::Array2::from_shape_fn((201, 3), |(c, d)| {
        let fine = reach(0.3, 1.0, 1e-5);
        fine.position()[[(time[c] * 1e5).round() as usize, d]]
    });
    let time = time.iter().map(|t| 7.0 + (t * 1e5).round() * 1e-5).collect();
    let stamped = pdmp_core::Demonstration::new(position, Sampling::Stamped { time }).unwrap();
    let model = learn(&even, &options(Kind::Discrete));
    let other = learn(&[stamped], &options(Kind::Discrete));
    let grid = TimeGrid { dt: 0.01, duration: Some(1.0) };
    let (a, b) = (
        rollout(model.primitive(), &Default::default(), grid).unwrap(),
        rollout(other.primitive(), &Default::default(), grid).unwrap(),
    );
    assert!((a.position - b.position).iter().all(|d| d.abs() < 1e-5));
}

/// The styles of the demonstrations themselves are recovered.
#[test]
fn style_of_recovers_the_styles_of_demonstrations() {
    let demos = reaches();
    let model = learn(&demos, &options(Kind::Discrete).n_styles(Truncation::Rank(3)));
    for (m, demo) in demos.iter().enumerate() {
        let style = style_of(&model, demo, &StyleOptions::default()).unwrap();
        for (j, s) in style.iter().enumerate() {
            assert!((s - model.demonstrated().styles[[m, j]]).abs() < 2e-3, "{m} {j} {s}");
        }
    }
}

/// A cycle recorded from another phase is shifted to the phase of the model and has the same style.
#[test]
fn style_of_recovers_the_style_of_a_cycle_in_any_phase() {
    let demos = cycles();
    let model = learn(&demos, &options(Kind::Rhythmic).n_styles(Truncation::Rank(2)));
    for (m, demo) in demos.iter().enumerate() {
        let expected = style_of(&model, demo, &StyleOptions::default()).unwrap();
        let n = demo.n_samples();
        for lead in [n / 7, n / 2, n - 3] {
            let turned = Array2::from_shape_fn(demo.position().dim(), |(c, d)| demo.position()[[(c + lead) % n, d]]);
            let turned = pdmp_core::Demonstration::new(turned, demo.sampling().clone()).unwrap();
            let style = style_of(&model, &turned, &StyleOptions::default()).unwrap();
            for (found, expected) in style.iter().zip(&expected) {
                assert!((found - expected).abs() < 5e-3, "{m}, {lead}: {found} is not {expected}");
            }
        }
    }
}

/// Other movements and other units are rejected with the size of the deviation. Style components without effect, of
/// equal demonstrations, stay bounded and are not quotients of rounding errors.
#[test]
fn style_of_rejects_demonstrations_that_no_style_describes() {
    let demos = reaches();
    let model = learn(&demos, &options(Kind::Discrete).n_styles(Truncation::Rank(2)));
    let changed = |change: &dyn Fn(usize, f64) -> f64| {
        let position =
            Array2::from_shape_fn(demos[1].position().dim(), |(c, d)| change(c, demos[1].position()[[c, d]]));
        let demo = pdmp_core::Demonstration::new(position, demos[1].sampling().clone()).unwrap();
        style_of(&model, &demo, &StyleOptions::default())
    };
    assert!(changed(&|_, y| y).is_ok());
    assert!(matches!(changed(&|_, y| 57.3 * y), Err(Error::StyleSize { ratio }) if ratio > 10.0));
    let other = changed(&|c, y| y + (0.5 * c as f64).sin());
    assert!(matches!(other, Err(Error::Undescribed { off, times }) if off > 0.5 && times > 3.0), "{other:?}");

    let equal = vec![demos[1].clone(); 4];
    let model = learn(&equal, &options(Kind::Discrete).n_styles(Truncation::Rank(3)));
    let style = style_of(&model, &equal[0], &StyleOptions::default()).unwrap();
    assert!(style.iter().all(|s| s.abs() <= 1.0), "{style:?}");
    let style = style_of(&model, &demos[2], &StyleOptions::default());
    assert!(style.is_err() || style.unwrap().iter().all(|s| s.abs() < 10.0));
}

/// The goal of a demonstration replaces its last sample.
#[test]
fn given_goals_are_kept() {
    let demos: Vec<_> = reaches().into_iter().map(|demo| demo.with_goal(vec![0.8, 0.55, 0.1]).unwrap()).collect();
    let model = learn(&demos, &options(Kind::Discrete));
    assert_eq!(model.demonstrated().goals.row(3).to_vec(), [0.8, 0.55, 0.1]);
}

/// Two fits of the same demonstrations are equal bit for bit.
#[test]
fn fits_are_reproducible() {
    for kind in [Kind::Discrete, Kind::Rhythmic] {
        let demos = if kind == Kind::Discrete { reaches() } else { cycles() };
        let bytes = || learn(&demos, &options(kind).basis(gp())).to_bytes().unwrap();
        assert_eq!(bytes(), bytes());
    }
}

/// An error of the progress callback in any stage is returned.
#[test]
fn a_fit_can_be_cancelled_in_every_stage() {
    use pdmp_core::learning::Stage;

    for stop in [Stage::Align, Stage::Targets, Stage::Factorise, Stage::Regress, Stage::Compile] {
        let mut progress = |stage, _| if stage == stop { Err(Error::Interrupted) } else { Ok(()) };
        let mut options = options(Kind::Discrete).basis(gp());
        if stop == Stage::Align {
            options.time_scaling = pdmp_core::learning::TimeScaling::Warp(pdmp_core::model::TimeWarp::default());
        }
        assert!(matches!(fit_with(&reaches(), &options, &mut progress), Err(Error::Interrupted)));
    }
}

/// A single demonstration, constant DoFs, identical demonstrations, and tiny and huge ones are reproduced.
#[test]
fn degenerate_demonstrations_are_learnt() {
    let still = |value: f64| {
        let position = ndarray::Array2::from_shape_fn((50, 2), |(_, d)| value + d as f64);
        pdmp_core::Demonstration::new(position, Sampling::Uniform { dt: 0.02 }).unwrap()
    };
    let tiny = |factor: f64| {
        let position = reach(0.3, 1.0, 0.01).position().mapv(|y| factor * y);
        pdmp_core::Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
    };
    let sets = [
        vec![reach(0.3, 1.0, 0.01)],
        vec![still(0.7), still(0.7)],
        vec![reach(0.3, 1.0, 0.01); 3],
        vec![tiny(1e-150), tiny(2e-150)],
        vec![tiny(1e149)],
    ];
    for demos in &sets {
        for basis in [options(Kind::Discrete).basis, gp()] {
            let options = options(Kind::Discrete).basis(basis);
            let model = learn(demos, &options);
            for (m, demo) in demos.iter().enumerate() {
                let grid = TimeGrid { dt: 0.01, duration: None };
                let found = rollout(model.primitive(), &conditions_of(&model, m), grid).unwrap().position;
                let recorded = demo.position();
                let size = recorded.iter().fold(0.0f64, |a, b| a.max(b.abs()));
                for d in 0..found.ncols() {
                    for c in 0..found.nrows().min(recorded.nrows()) {
                        assert!((found[[c, d]] - recorded[[c, d]]).abs() <= 2e-4 * size, "{m} {c} {d}");
                    }
                }
            }
        }
    }
    let model = learn(&[still(0.7)], &options(Kind::Discrete));
    let found = rollout(model.primitive(), &Default::default(), TimeGrid { dt: 0.01, duration: Some(3.0) }).unwrap();
    assert!(found.position.rows().into_iter().all(|y| y.to_vec() == [0.7, 1.7]), "the model stays at rest");
}

/// Scaling by range preserves the reproduction of a DoF that is a million times smaller than another.
#[test]
fn range_scaling_reproduces_dofs_of_different_units() {
    let demos: Vec<_> = reaches()
        .iter()
        .map(|demo| {
            let mut position = demo.position().to_owned();
            position.column_mut(1).mapv_inplace(|y| 1e6 * y);
            pdmp_core::Demonstration::new(position, demo.sampling().clone()).unwrap()
        })
        .collect();
    let scaled = options(Kind::Discrete).dof_scale(DofScaling::Range).n_styles(Truncation::Rank(5));
    let model = learn(&demos, &scaled);
    for (m, demo) in demos.iter().enumerate() {
        let grid = TimeGrid { dt: 0.01, duration: None };
        let found = rollout(model.primitive(), &conditions_of(&model, m), grid).unwrap().position;
        let last = found.nrows() - 1;
        for c in 0..=last {
            assert!((found[[c, 2]] - demo.position()[[c, 2]]).abs() < 1e-4);
        }
    }
}

/// Errors name the demonstration, the argument and the numbers.
#[test]
fn invalid_demonstrations_are_rejected_by_name() {
    let demos = vec![
        reach(0.0, 1.0, 0.01),
        pdmp_core::Demonstration::new(ndarray::Array2::zeros((9, 2)), Sampling::Unknown).unwrap(),
    ];
    let message = |demos: &[_], options: &_| fit(demos, options).unwrap_err().to_string();
    let options = options(Kind::Discrete);
    assert_eq!(message(&demos, &options), "demo 1: position has 2 DoFs, but demo 0 has 3: all must have the same");
    assert!(message(&[], &options).contains("at least one demonstration"));
    assert!(message(&demos[1..], &options).starts_with("demo 0: dt is missing"));
    let options = options.n_styles(Truncation::Rank(2));
    assert!(message(&demos[..1], &options).contains("n_styles = 2: must lie between 1 and 1"));
}
