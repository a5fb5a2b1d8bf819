//! The recogniser of poses against that of their degrees of freedom, and its bands on poses drawn from the prior.

use std::f64::consts::PI;
use std::sync::Arc;

use ndarray::Array2;

use super::super::movement_table::MovementTable;
use super::super::tests::{Draws, normal};
use super::super::{Calibration, Estimate, Mixture, Prior, Recogniser, Settings, Timing, responses};
use super::{Layout, Sample};
use crate::demonstration::{QuaternionOrder, RotationColumns};
use crate::learning::Truncation;
use crate::numerics::rotation::{Quaternion, exp, inverse, log, product};
use crate::numerics::simd::F64x4;
use crate::random::Random;
use crate::{Demonstration, FitOptions, Model, Sampling, fit};

/// Heights with a rotation that turns about the vertical axis by `turned` and leans, each lean both ways.
fn turns(turned: f64) -> Vec<Demonstration> {
    let mut random = Random(3);
    let mut demos = Vec::new();
    for _ in 0..6 {
        let lean = [random.between(-0.8, 0.8), random.between(-0.8, 0.8), random.between(-0.4, 0.4)];
        let (duration, height) = (random.scale(0.8, 1.3), random.between(0.2, 0.5));
        for sign in [-1.0, 1.0] {
            let position = Array2::from_shape_fn((61, 5), |(c, d)| {
                let s = c as f64 / 60.0;
                let rise = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
                let leaning = lean.map(|x| sign * x * (rise + 0.5 * (PI * s).sin().powi(2)));
                let q = product(exp([0.0, 0.0, turned * rise]), exp(leaning));
                if d == 0 { height * rise } else { q[d - 1] }
            });
            let columns = RotationColumns { column: 1, order: QuaternionOrder::Wxyz };
            let demo = Demonstration::new(position, Sampling::Uniform { dt: duration / 60.0 }).unwrap();
            demos.push(demo.with_rotations(vec![columns]).unwrap());
        }
    }
    demos
}

fn model(turned: f64) -> Model {
    fit(&turns(turned), &FitOptions::discrete().n_styles(Truncation::Rank(3))).unwrap()
}

fn prior(model: &Model, bandwidth: f64) -> Prior {
    let demonstrated = model.demonstrated();
    let parts = [demonstrated.styles.view(), demonstrated.goals.view(), demonstrated.starts.view()];
    let parameters = ndarray::concatenate(ndarray::Axis(1), &parts).unwrap();
    let log_durations = demonstrated.durations.iter().map(|duration| duration.ln()).collect();
    let settings = Settings { bandwidth, tempering: 1.0, correlation_time: 0.1 };
    let mixture = Mixture { parameters, log_durations, settings, calibration: Calibration::NONE };
    Prior::new(model.kind(), mixture, vec![0.004, 0.02, 0.02, 0.02]).unwrap()
}

/// The model of the degrees of freedom.
fn inside(model: &Model) -> Model {
    Model { primitive: Arc::clone(model.primitive().inside()), ..model.clone() }
}

fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * (1.0 + a.abs()))
}

/// Rotation vectors about the mean at four places are those of the scalar logarithm, up to half a turn.
#[test]
fn rotation_vectors_about_the_mean_are_logarithms() {
    let model = model(2.0);
    let layout = Layout::new(model.primitive());
    let table = Recogniser::new(&model, &prior(&model, 1.0), Timing::default()).unwrap().table;
    let mut random = Random(1);
    let mut largest = 0.0f64;
    for k in 0..3000 {
        let axis = [0; 3].map(|_| random.between(-1.0, 1.0));
        let angle = [random.between(0.0, PI), PI - 1e-9, 1e-9, 0.0][k % 4];
        let norm = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let fractions = [0; 4].map(|_| random.between(-0.2, 1.2));
        let places = table.places(fractions);
        let delta = axis.map(|x| x / norm * angle);
        // About the mean of one of the places.
        let mean =
            model.primitive().coordinates().unwrap().rotations()[0].mean.at(places[k % 4].share() * layout.extent());
        let q: Quaternion = product(mean.rotation, exp(delta));
        let sign = if k % 3 == 0 { -1.0 } else { 1.0 };
        let mut sample = Sample::missing(&layout);
        layout.read(&[0.1, sign * q[0], sign * q[1], sign * q[2], sign * q[3]], &mut sample).unwrap();
        let mut lanes = vec![F64x4::ZERO; 4];
        layout.about_means(&sample, &places, &mut lanes);
        for (l, place) in places.into_iter().enumerate() {
            let mean = model.primitive().coordinates().unwrap().rotations()[0].mean.at(place.share() * layout.extent());
            let expected = log(product(inverse(mean.rotation), q));
            let found = [1, 2, 3].map(|d| lanes[d].to_array()[l]);
            let size = expected.iter().map(|x| x * x).sum::<f64>().sqrt();
            // Near half a turn the sign of the vector is that of a rounding error.
            if size < PI - 1e-7 {
                for (a, b) in found.into_iter().zip(expected) {
                    largest = largest.max((a - b).abs());
                }
            }
        }
    }
    assert!(largest < 2e-15, "{largest:e}");
}

/// With a mean rotation that is constant, rotation vectors about it are positions of a model of them: estimate and
/// continuation are those of the recogniser of that model, with an unknown time and samples missing.
#[test]
fn poses_about_a_constant_mean_are_positions() {
    let model = model(0.0);
    let (prior, plain) = (prior(&model, 0.5), inside(&model));
    let mut poses = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let mut positions = Recogniser::new(&plain, &prior, Timing::default()).unwrap();
    // The diagonal of the covariance is shared among the components of a rotation.
    positions.layout.vectors = poses.layout.vectors.clone();
    let moments = prior.moments(&poses.layout.vectors);
    assert_eq!((positions.layout.vectors.len(), positions.layout.rotations().len()), (1, 0));
    positions.table = MovementTable::new(plain.primitive(), &prior, &moments).unwrap();
    positions.set_prior(prior.clone());
    // A turn and the difference of two rotation vectors differ in the second order.
    (poses.pauses, positions.pauses) = (None, None);
    for k in 0..45 {
        let s = 0.02 * f64::from(k);
        let delta = [0.5 * s, -0.4 * s * s, 0.3 * s + 0.1 * s * s];
        let mut observed = [0.3 * s, delta[0], delta[1], delta[2]];
        let q = exp(delta);
        let mut pose = [observed[0], q[0], q[1], q[2], q[3]];
        if k % 7 == 3 {
            observed[1..].fill(f64::NAN);
            pose[2] = f64::NAN;
        }
        poses.update(0.015 * f64::from(k), &pose).unwrap();
        positions.update(0.015 * f64::from(k), &observed).unwrap();
    }
    let (a, b) = (poses.estimate().unwrap().clone(), positions.estimate().unwrap().clone());
    let scalars = |e: &Estimate| {
        [e.duration, e.duration_deviation, e.arrival, e.fraction, e.fraction_deviation, e.stopped, e.surprise]
    };
    assert!(close(&scalars(&a), &scalars(&b), 1e-9), "{:?} {:?}", scalars(&a), scalars(&b));
    assert!(close(a.style(), b.style(), 1e-9) && close(&poses.parameters, &positions.parameters, 1e-9));
    let goal = log([a.goal()[1], a.goal()[2], a.goal()[3], a.goal()[4]]);
    assert!(close(&goal, &b.goal()[1..], 1e-9) && (a.goal()[0] - b.goal()[0]).abs() < 1e-9);
    let later: Vec<f64> = (0..10).map(|k| 0.66 + 0.05 * f64::from(k)).collect();
    let (a, b) = (poses.continuation(&later).unwrap(), positions.continuation(&later).unwrap());
    for k in 0..later.len() {
        let found = log([1, 2, 3, 4].map(|i| a.position[[k, i]]));
        // The mean of quaternions is not that of rotation vectors.
        let expected = b.position.row(k).to_vec();
        assert!(close(&found, &expected[1..], 2e-3) && (a.position[[k, 0]] - expected[0]).abs() < 1e-9);
        assert!((a.deviation[[k, 0]] / b.deviation[[k, 0]] - 1.0).abs() < 1e-6);
    }
}

/// Under one hypothesis of the time, a rotation about a mean that moves is the position δ at its clock.
#[test]
fn poses_of_a_known_time_are_positions_about_the_mean() {
    let model = model(4.0);
    let (prior, plain) = (prior(&model, 0.5), inside(&model));
    let timing = Timing { duration: Some(1.05), ..Timing::default() };
    let mut poses = Recogniser::new(&model, &prior, timing).unwrap();
    let mut positions = Recogniser::new(&plain, &prior, timing).unwrap();
    let moments = prior.moments(&poses.layout.vectors);
    positions.layout.vectors = poses.layout.vectors.clone();
    positions.table = MovementTable::new(plain.primitive(), &prior, &moments).unwrap();
    positions.set_prior(prior.clone());
    (poses.pauses, positions.pauses) = (None, None);
    for k in 0..30 {
        let (time, s) = (0.02 * f64::from(k), 0.02 * f64::from(k) / 1.05);
        let dofs = [0.3 * s, 0.5 * s, -0.4 * s * s, 0.3 * s];
        let mut pose = [0.0; 5];
        poses.layout.write(s * poses.layout.extent(), &dofs, &mut pose);
        poses.update(time, &pose).unwrap();
        positions.update(time, &dofs).unwrap();
    }
    let (a, b) = (poses.estimate().unwrap().clone(), positions.estimate().unwrap().clone());
    assert!(close(&poses.parameters, &positions.parameters, 1e-9));
    assert!((a.surprise - b.surprise).abs() < 1e-9 * b.surprise);
    let later: Vec<f64> = (0..8).map(|k| 0.6 + 0.05 * f64::from(k)).collect();
    let (found, expected) = (poses.continuation(&later).unwrap(), positions.continuation(&later).unwrap());
    for (k, time) in later.iter().enumerate() {
        let mut pose = [0.0; 5];
        let dofs = expected.position.row(k).to_vec();
        poses.layout.write((time / 1.05).min(1.0) * poses.layout.extent(), &dofs, &mut pose);
        assert!(close(&found.position.row(k).to_vec(), &pose, 1e-9), "{} {pose:?}", found.position.row(k));
    }
    // The conditions of the estimate are those of the degrees of freedom.
    let conditions = model.primitive().coordinates().unwrap().in_dofs(&a.conditions()).unwrap();
    let (goal, start) = (conditions.goal.unwrap(), conditions.start.unwrap());
    assert!(close(&goal, b.goal(), 1e-9) && close(&start, b.start(), 1e-9));
}

/// The bands of goal, duration and poses to come hold nine tenths of poses that are drawn from the prior. Those of a rotation
/// are of rotation vectors from the mean.
#[test]
fn bands_hold_poses_of_the_prior() {
    let model = model(2.0);
    let (prior, mut random) = (prior(&model, 0.5), Random(11));
    let layout = Layout::new(model.primitive());
    let draws = Draws::new(&prior, &layout.vectors);
    let responses = responses(model.primitive()).unwrap();
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let (mut held, mut total, mut errors) = ([0.0; 3], [0.0; 3], [0.0; 4]);
    for _ in 0..150 {
        let (theta, duration) = draws.draw(&mut random);
        let movement = responses.dot(&ndarray::aview1(&theta));
        recogniser.reset();
        let mut process = [0.0; 4];
        let mut pose = |k: usize, random: &mut Random| {
            let share = f64::from(u32::try_from(k).unwrap()) / 40.0;
            let decay = if k == 0 { 0.0 } else { (-duration / 40.0 / 0.1f64).exp() };
            let dofs = [0, 1, 2, 3].map(|d| {
                let sd = prior.residual()[d];
                process[d] = decay * process[d] + (0.9 * (1.0 - decay * decay)).sqrt() * sd * normal(random);
                movement[4 * (5 * k) + d] + process[d] + 0.1f64.sqrt() * sd * normal(random)
            });
            let mut pose = vec![0.0; 5];
            layout.write(share * layout.extent(), &dofs, &mut pose);
            pose
        };
        for k in 0..16 {
            let y = pose(k, &mut random);
            recogniser.update(k as f64 * duration / 40.0, &y).unwrap();
        }
        let later: Vec<f64> = (16..40).map(|k| k as f64 * duration / 40.0).collect();
        let ahead = recogniser.continuation(&later).unwrap();
        for k in 0..later.len() {
            let y = pose(16 + k, &mut random);
            layout.errors(&ahead.position.row(k).to_vec(), &y, &mut errors);
            for (error, deviation) in errors.iter().zip(ahead.deviation.row(k)) {
                held[0] += f64::from(error.abs() < 1.645 * deviation);
                total[0] += 1.0;
            }
        }
        let estimate = recogniser.estimate().unwrap();
        let (first, mut goal) = (model.n_styles(), vec![0.0; 5]);
        layout.write(layout.clocks()[0], &theta[first..first + 4], &mut goal);
        layout.errors(estimate.goal(), &goal, &mut errors);
        for (error, deviation) in errors.iter().zip(estimate.goal_deviation()) {
            held[1] += f64::from(error.abs() < 1.645 * deviation);
            total[1] += 1.0;
        }
        held[2] += f64::from((estimate.duration / duration).ln().abs() < 1.645 * estimate.duration_deviation);
        total[2] += 1.0;
    }
    let shares = [0, 1, 2].map(|k| held[k] / total[k]);
    assert!(shares.iter().all(|share| (0.84..=0.98).contains(share)), "{shares:?}");
}
