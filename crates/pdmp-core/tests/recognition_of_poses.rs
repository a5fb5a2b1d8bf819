//! Recognition of movements with rotations: frames, signs, gaps, pauses and cycles, and no allocation.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/poses.rs"]
mod poses;
mod random {
    pub(crate) use super::counting::Random;
}

use std::f64::consts::PI;

use common::minimum_jerk;
use counting::allocations;
use ndarray::{Array2, ArrayView1, s};
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::inference::{Calibration, Continuation, Estimate, Mixture, Prior, Recogniser, Timing};
use pdmp_core::learning::{TimeScaling, Truncation, learn_prior};
use pdmp_core::model::Frame;
use pdmp_core::motion::TimeGrid;
use pdmp_core::numerics::Threads;
use pdmp_core::{Demonstration, FitOptions, Model, Sampling, fit, rollout};
use poses::*;
use random::Random;

const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];
const SAMPLES: usize = 81;

/// Duration in seconds of the m-th movement.
fn duration(m: usize) -> f64 {
    0.8 + 0.03 * ((7 * m) % 13) as f64
}

fn demonstration(position: Array2<f64>, duration: f64) -> Demonstration {
    let sampling = Sampling::Uniform { dt: duration / (position.nrows() - 1) as f64 };
    let columns = RotationColumns { column: position.ncols() - 4, order: QuaternionOrder::Wxyz };
    Demonstration::new(position, sampling).unwrap().with_rotations(vec![columns]).unwrap()
}

/// Screws with noise of 1 mm and 3 mrad, in another world and with another tool frame.
fn movements(n: usize, angle: f64, world: Quaternion, tool: Quaternion) -> Vec<Array2<f64>> {
    let (mut random, mut signs) = (Random(9), Random(4));
    let noisy = |mut pose: Array2<f64>| {
        for mut row in pose.rows_mut() {
            row.slice_mut(s![..3]).mapv_inplace(|x| x + random.between(-1e-3, 1e-3));
            let shake = of_vector(std::array::from_fn(|_| random.between(-3e-3, 3e-3)));
            let turned = times(rotation(row.view(), 3), shake);
            row.slice_mut(s![3..]).iter_mut().zip(turned).for_each(|(x, own)| *x = own);
        }
        in_frames(&pose, world, tool, &mut signs)
    };
    screws(n, angle, 0.5, SAMPLES, 2).into_iter().map(noisy).collect()
}

fn learnt(movements: &[Array2<f64>], options: &FitOptions) -> (Model, Prior) {
    let demos: Vec<_> = movements.iter().enumerate().map(|(m, one)| demonstration(one.clone(), duration(m))).collect();
    let model = fit(&demos, options).unwrap();
    let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
    (model, prior)
}

fn three_styles() -> FitOptions {
    FitOptions::discrete().n_styles(Truncation::Rank(3))
}

/// Shows the first samples of the m-th movement, and returns the estimate and the positions at the other samples.
fn recognised(recogniser: &mut Recogniser, movement: &Array2<f64>, m: usize, n: usize) -> (Estimate, Continuation) {
    recogniser.reset();
    let time = |k: usize| duration(m) * k as f64 / (movement.nrows() - 1) as f64;
    for k in 0..n {
        recogniser.update(time(k), &movement.row(k).to_vec()).unwrap();
    }
    let rest: Vec<f64> = (n..movement.nrows()).map(time).collect();
    let ahead = recogniser.continuation(&rest).unwrap();
    (recogniser.estimate().unwrap().clone(), ahead)
}

/// Distance of two poses: of their points, and the angle between their rotations.
fn distances(a: ArrayView1<f64>, b: ArrayView1<f64>) -> [f64; 2] {
    let point = (0..a.len() - 4).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    [point, angle(rotation(a, a.len() - 4), rotation(b, b.len() - 4))]
}

/// Half of a held-out pose gives the rest, the goal and the time, far better than the mean movement does; for turns of less
/// than half a turn and of more than one. The bands of 90 % hold the rest.
#[test]
fn half_a_pose_gives_the_whole() {
    let mut inside = [0.0; 2];
    for turned in [1.0, 4.7, 9.0] {
        let all = movements(26, turned, IDENTITY, IDENTITY);
        let (model, prior) = learnt(&all[..20], &three_styles());
        let everyone: Vec<usize> = (0..20).collect();
        let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
        let (mut found, mut mean) = ([0.0; 2], [0.0; 2]);
        for (m, movement) in all.iter().enumerate().skip(20) {
            let (estimate, ahead) = recognised(&mut recogniser, movement, m, 41);
            let dt = duration(m) / (SAMPLES - 1) as f64;
            let grid = TimeGrid { dt, duration: Some(duration(m)) };
            let same = rollout(model.primitive(), &model.conditions(&everyone).unwrap(), grid).unwrap();
            for (k, row) in ahead.position.rows().into_iter().enumerate() {
                let own = movement.row(41 + k);
                let (a, b) = (distances(row, own), distances(same.position.row(41 + k), own));
                (0..2).for_each(|i| (found[i], mean[i]) = (found[i] + a[i] * a[i], mean[i] + b[i] * b[i]));
                let norm: f64 = row.slice(s![3..]).iter().map(|x| x * x).sum();
                assert!((norm - 1.0).abs() < 1e-12);
                let off = relative(rotation(row, 3), rotation(own, 3));
                for (error, deviation) in off.iter().zip(ahead.deviation.slice(s![k, 3..])) {
                    inside = [inside[0] + f64::from(error.abs() < 1.645 * deviation), inside[1] + 1.0];
                }
            }
            let goal = ArrayView1::from(estimate.goal());
            let [_, off] = distances(goal, movement.row(SAMPLES - 1));
            assert!(off < 0.25, "{turned}: {off} rad");
            assert!((estimate.duration / duration(m)).ln().abs() < 0.1);
            assert_eq!((estimate.goal().len(), estimate.goal_deviation().len()), (7, 6));
            let whole = rollout(model.primitive(), &estimate.conditions(), grid).unwrap();
            let [_, off] = distances(whole.position.row(SAMPLES - 1), goal);
            assert!(off < 0.1, "the conditions of the estimate end {off} rad from its goal");
        }
        for i in 0..2 {
            assert!(found[i] < 0.15 * mean[i], "{turned}: {found:?} {mean:?}");
        }
    }
    let share = inside[0] / inside[1];
    assert!(share > 0.8, "the bands of rotations hold {share}");
}

/// Rotation vector from one rotation to another.
fn relative(from: Quaternion, to: Quaternion) -> [f64; 3] {
    let [w, v @ ..] = times(back(from), to);
    let (sine, sign) = (v.iter().map(|x| x * x).sum::<f64>().sqrt(), if w < 0.0 { -1.0 } else { 1.0 });
    v.map(|x| if sine > 0.0 { sign * 2.0 * sine.atan2(w.abs()) / sine * x } else { 0.0 })
}

/// Another world or tool frame, and other signs of quaternions, turn the estimate and change nothing else, up to rounding.
#[test]
fn estimates_turn_with_their_frames() {
    let random = &mut Random(6);
    let seen = |world: Quaternion, tool: Quaternion| {
        let all = movements(16, 2.0, world, tool);
        let (model, prior) = learnt(&all[..15], &three_styles());
        // The factors of the bands are quantiles over components, which depend on the frame.
        let mixture = Mixture { calibration: Calibration::NONE, ..prior.mixture().clone() };
        let prior = Prior::new(prior.kind(), mixture, prior.residual().to_vec()).unwrap();
        let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
        recognised(&mut recogniser, &all[15], 15, 30)
    };
    let (estimate, ahead) = seen(IDENTITY, IDENTITY);
    for _ in 0..3 {
        let (world, tool) = (random_rotation(random), random_rotation(random));
        let (turned, rest) = seen(world, tool);
        let expected = in_frame(estimate.goal(), world, tool);
        let [point, turn] = distances(ArrayView1::from(&expected), ArrayView1::from(turned.goal()));
        assert!(point < 1e-9 && turn < 1e-9, "{point:e} m, {turn:e} rad");
        let scalars = |e: &Estimate| [e.duration, e.duration_deviation, e.fraction, e.fraction_deviation, e.surprise];
        for (a, b) in scalars(&estimate).into_iter().zip(scalars(&turned)) {
            assert!((a - b).abs() < 1e-8 * a.abs(), "{a} {b}");
        }
        let size = |deviation: ArrayView1<f64>| deviation.iter().map(|x| x * x).sum::<f64>().sqrt();
        for k in 0..rest.time.len() {
            let expected = in_frame(&ahead.position.row(k).to_vec(), world, tool);
            let [point, turn] = distances(ArrayView1::from(&expected), rest.position.row(k));
            assert!(point < 1e-9 && turn < 1e-9, "{point:e} m, {turn:e} rad");
            for columns in [0..3, 3..6] {
                let [a, b] = [&ahead, &rest].map(|rest| size(rest.deviation.slice(s![k, columns.clone()])));
                assert!((a - b).abs() < 1e-8 * a, "{a} {b}");
            }
        }
    }
}

/// A quaternion and its negative are one observation, a quaternion with a NaN is none, and gaps are allowed.
#[test]
fn signs_and_missing_components_do_not_matter() {
    let all = movements(13, 3.0, IDENTITY, IDENTITY);
    let (model, prior) = learnt(&all[..12], &three_styles());
    let mut recognisers = [(); 2].map(|()| Recogniser::new(&model, &prior, Timing::default()).unwrap());
    let mut random = Random(5);
    for k in (0..60).filter(|k| !(20..32).contains(k)) {
        let mut one = all[12].row(k).to_vec();
        let mut other = one.clone();
        other[3..].iter_mut().for_each(|x| *x = -*x);
        match k % 5 {
            1 => {
                one[3..].fill(f64::NAN);
                other[3 + (random.next() * 4.0) as usize] = f64::NAN;
            }
            3 => (one[k % 3], other[k % 3]) = (f64::NAN, f64::NAN),
            _ => {}
        }
        let time = duration(12) * k as f64 / (SAMPLES - 1) as f64;
        recognisers[0].update(time, &one).unwrap();
        recognisers[1].update(time, &other).unwrap();
    }
    let [a, b] = recognisers.each_mut().map(|recogniser| recogniser.estimate().unwrap().clone());
    assert_eq!(a, b);
    let [_, off] = distances(ArrayView1::from(a.goal()), all[12].row(SAMPLES - 1));
    assert!(off < 0.2, "{off}");
    let time = duration(12) * 59.0 / 80.0;
    let [a, b] = recognisers.each_mut().map(|recogniser| recogniser.continuation(&[time, time + 0.1]).unwrap());
    assert_eq!(a, b);
    let turned = a.position.row(0).iter().zip(a.position.row(1)).skip(3).map(|(a, b)| a * b).sum::<f64>();
    assert!(turned > 0.9, "the sign changes");
}

/// Observations, estimates and continuations of poses do not allocate, with rotations missing, gaps, and after a reset.
#[test]
fn observations_of_poses_allocate_nothing() {
    let all = movements(12, 2.0, IDENTITY, IDENTITY);
    let (model, prior) = learnt(&all, &three_styles());
    let mut recogniser = Recogniser::new(&model, &prior, Timing { starts: [-0.2, 0.3], duration: None }).unwrap();
    let mut random = Random(2);
    let (mut ahead, mut deviation) = ([0.0; 14], [0.0; 12]);
    let before = allocations();
    let mut time = 0.0;
    for k in 0..60 {
        if k == 40 {
            recogniser.reset();
        }
        time += random.scale(1e-3, 0.1);
        // After a while the movement rests.
        let mut position: [f64; 7] = std::array::from_fn(|i| all[k % 12][[k.min(30), i]]);
        if random.rarely() {
            position[(random.next() * 7.0) as usize] = f64::NAN;
        }
        recogniser.update(time, &position).unwrap();
        recogniser.estimate().unwrap();
        recogniser.write_continuation(&[time, time + 0.1], &mut ahead, &mut deviation).unwrap();
    }
    assert_eq!(allocations() - before, 0);
    let whole = recogniser.continuation(&[time, time + 0.1]).unwrap();
    assert!(whole.position.iter().eq(&ahead) && whole.deviation.iter().eq(&deviation));
    assert!(recogniser.write_continuation(&[time], &mut ahead[..7], &mut deviation[..7]).is_err(), "a wrong length");
    assert!(recogniser.write_continuation(&[time], &mut ahead[..6], &mut deviation[..6]).is_err(), "a wrong length");
}

/// A tool that turns in place and pauses is stopped.
#[test]
fn a_pause_of_a_rotation_holds_the_clock() {
    let all: Vec<_> =
        movements(13, 3.0, IDENTITY, IDENTITY).iter().map(|one| one.slice(s![.., 3..]).to_owned()).collect();
    let (model, prior) = learnt(&all[..12], &three_styles());
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let (dt, pause) = (duration(12) / (SAMPLES - 1) as f64, 50);
    for k in 0..SAMPLES - 1 + pause {
        let own = if k < 35 { k } else { (k.saturating_sub(pause)).max(35) };
        recogniser.update(dt * k as f64, &all[12].row(own).to_vec()).unwrap();
        let stopped = recogniser.estimate().unwrap().stopped;
        match k {
            2..=34 | 96.. => assert!(stopped < 0.5, "{k}: {stopped}"),
            65..=84 => assert!(stopped > 0.9, "{k}: {stopped}"),
            _ => {}
        }
    }
    let arrival = recogniser.estimate().unwrap().arrival;
    assert!((arrival - duration(12) - dt * pause as f64).abs() < 0.1, "{arrival}");
}

/// Phase and period of a cycle that turns as a whole, once per period, are known from less than one period.
#[test]
fn part_of_a_cycle_of_rotations_gives_period_and_phase() {
    for turns in [0.0, 1.0] {
        let period = |m: usize| 0.9 + 0.03 * ((5 * m) % 9) as f64;
        let all = wobbles(13, turns, 100);
        let demo = |m: usize| {
            let columns = RotationColumns { column: 0, order: QuaternionOrder::Wxyz };
            let sampling = Sampling::Uniform { dt: period(m) / 100.0 };
            Demonstration::new(all[m].clone(), sampling).unwrap().with_rotations(vec![columns]).unwrap()
        };
        let demos: Vec<_> = (0..12).map(demo).collect();
        let model = fit(&demos, &FitOptions::rhythmic().n_styles(Truncation::Rank(3))).unwrap();
        let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
        let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
        let time = |k: usize| period(12) / 100.0 * k as f64;
        for k in 0..80 {
            recogniser.update(time(k), &all[12].row((k + 30) % 100).to_vec()).unwrap();
        }
        let ahead = recogniser.continuation(&(80..150).map(time).collect::<Vec<_>>()).unwrap();
        let estimate = recogniser.estimate().unwrap();
        assert!((estimate.duration / period(12)).ln().abs() < 0.08, "{turns}: {}", estimate.duration);
        assert!((estimate.fraction - 1.09 + 0.5).rem_euclid(1.0) - 0.5 < 0.06, "{turns}: {}", estimate.fraction);
        assert_eq!((estimate.goal().len(), estimate.goal_deviation().len(), estimate.start().len()), (4, 3, 0));
        let offs = (0..70).map(|k| distances(ahead.position.row(k), all[12].row((k + 110) % 100))[1]);
        let off = offs.fold(0.0, f64::max);
        assert!(off < 0.3, "{turns}: {off}");
        let signs = ahead.position.rows().into_iter().zip(ahead.position.rows().into_iter().skip(1));
        assert!(signs.into_iter().all(|(a, b)| a.dot(&b) > 0.9), "{turns}: the sign changes");
    }
}

/// Deviations in the world frame are those of the body frame, turned.
#[test]
fn deviations_are_in_the_frame_of_angular_velocities() {
    let all = movements(13, 2.0, IDENTITY, IDENTITY);
    let seen = |options: &FitOptions| {
        let (model, prior) = learnt(&all[..12], options);
        let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
        (recognised(&mut recogniser, &all[12], 12, 20).1, prior)
    };
    let (body, _) = seen(&three_styles());
    let (world, _) = seen(&three_styles().frame(Frame::World));
    assert!(body.position.iter().zip(&world.position).all(|(a, b)| (a - b).abs() < 1e-9));
    let mut largest: f64 = 0.0;
    for k in 0..body.time.len() {
        let squares = |rest: &Continuation| (3..6).map(|i| rest.deviation[[k, i]].powi(2)).sum::<f64>();
        let scale = body.deviation[[k, 0]] / world.deviation[[k, 0]];
        assert!((squares(&body) / squares(&world) / (scale * scale) - 1.0).abs() < 1e-6);
        largest = largest.max((body.deviation[[k, 3]] / world.deviation[[k, 3]] / scale - 1.0).abs());
    }
    assert!(largest > 0.02, "{largest}");
}

/// Two poses in one model, as of two hands: the second follows from the first.
#[test]
fn a_pose_that_is_not_seen_follows_from_another() {
    let pairs: Vec<Array2<f64>> = movements(17, 1.5, IDENTITY, IDENTITY)
        .into_iter()
        .map(|one| {
            let other = in_frames(&one, turn([0.0, 1.0, 0.0], 2.0), turn([1.0, 0.0, 0.0], PI), &mut Random(1));
            ndarray::concatenate![ndarray::Axis(1), one, other]
        })
        .collect();
    let demo = |(m, pair): (usize, &Array2<f64>)| {
        let sampling = Sampling::Uniform { dt: duration(m) / (SAMPLES - 1) as f64 };
        let columns = [3, 10].map(|column| RotationColumns { column, order: QuaternionOrder::Wxyz });
        Demonstration::new(pair.clone(), sampling).unwrap().with_rotations(columns.to_vec()).unwrap()
    };
    let demos: Vec<_> = pairs.iter().enumerate().take(16).map(demo).collect();
    let model = fit(&demos, &three_styles()).unwrap();
    let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let mut seen = pairs[16].clone();
    seen.slice_mut(s![.., 7..]).fill(f64::NAN);
    let (estimate, ahead) = recognised(&mut recogniser, &seen, 16, 41);
    let hidden = pairs[16].slice(s![.., 7..]);
    let [point, off] = distances(ArrayView1::from(&estimate.goal()[7..]), hidden.row(SAMPLES - 1));
    assert!(point < 0.1 && off < 0.25, "{point} {off}");
    for k in 0..ahead.time.len() {
        let [point, off] = distances(ahead.position.slice(s![k, 7..]), hidden.row(41 + k));
        assert!(point < 0.1 && off < 0.35, "{k}: {point} {off}");
    }
}

/// Positions that are no poses are refused, and the recogniser then remains as it was.
#[test]
fn bad_poses_are_refused() {
    let all = movements(12, 2.0, IDENTITY, IDENTITY);
    let (model, prior) = learnt(&all, &three_styles());
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    recogniser.update(0.0, &all[0].row(0).to_vec()).unwrap();
    let before = recogniser.estimate().unwrap().clone();
    let with = |column: usize, value: f64| {
        let mut position = all[0].row(1).to_vec();
        position[column] = value;
        position
    };
    for (position, name) in [
        (with(4, 0.9), "norm"),
        (with(5, f64::INFINITY), "position"),
        (all[0].row(1).to_vec()[..6].to_vec(), "coordinate"),
    ] {
        let error = recogniser.update(0.1, &position).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
    assert_eq!(*recogniser.estimate().unwrap(), before);
    let demos: Vec<_> = all.iter().enumerate().map(|(m, one)| demonstration(one.clone(), duration(m))).collect();
    let plain: Vec<_> = all
        .iter()
        .map(|one| Demonstration::new(one.slice(s![.., ..6]).to_owned(), Sampling::Uniform { dt: 0.01 }).unwrap())
        .collect();
    let error = learn_prior(&model, &plain, None, Threads::ONE).unwrap_err().to_string();
    assert!(error.contains("rotations"), "{error}");
    let halves = Array2::from_shape_fn((12, 1), |(m, _)| 0.5 * duration(m));
    let warped = fit(&demos, &three_styles().time_scaling(TimeScaling::Landmarks(halves))).unwrap();
    let error = learn_prior(&warped, &demos, None, Threads::ONE).unwrap_err().to_string();
    assert!(error.contains("time warp"), "{error}");
}
