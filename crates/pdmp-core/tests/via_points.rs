//! Movements through points: exact passage, agreement with a dense Gaussian computation, and additional forcing in the loop.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/counting.rs"]
mod counting;
#[path = "common/poses.rs"]
mod poses;

use std::sync::Arc;

use common::*;
use counting as random;
use counting::allocations;
use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use pdmp_core::inference::{At, Passage, PassageOptions, ViaPoint, through};
use pdmp_core::model::{Derivative, Frame};
use pdmp_core::motion::{BatchConditions, Limits, TimeGrid, batch, fastest};
use pdmp_core::numerics::Threads;
use pdmp_core::{Conditions, Controller, Kind, Model, rollout};
use poses::{angle, pose, rotation, screws, turning, wobbles};
use proptest::prelude::*;

const STEPS: usize = 200;

fn plain(model: &Model, points: &[ViaPoint]) -> pdmp_core::Result<Passage> {
    through(model, points, &Conditions::default(), &PassageOptions::default())
}

/// Movement in [`STEPS`] steps, or twice that over two periods.
fn movement(model: &Model, conditions: &Conditions, cycles: usize) -> Array2<f64> {
    let duration = conditions.segment_durations.as_ref().map_or(model.duration(), |parts| parts.iter().sum());
    let grid = TimeGrid { dt: duration / STEPS as f64, duration: Some(duration * cycles as f64) };
    rollout(model.primitive(), conditions, grid).unwrap().position
}

/// Mean movement of the demonstrations.
fn mean(model: &Model) -> (Conditions, Array2<f64>) {
    let conditions = model.conditions(&(0..model.n_demos()).collect::<Vec<_>>()).unwrap();
    let positions = movement(model, &conditions, 1);
    (conditions, positions)
}

fn duration(conditions: &Conditions) -> f64 {
    conditions.segment_durations.as_ref().unwrap().iter().sum()
}

/// Sets of points at samples of a movement, with displacements from the mean movement relative to the range.
fn sets() -> impl Strategy<Value = (bool, Vec<usize>, Vec<f64>, Option<f64>)> {
    let samples = prop::sample::subsequence((2..18).map(|k| k * 11).collect::<Vec<_>>(), 1..=6);
    let deviation = prop_oneof![Just(None), Just(Some(0.0)), Just(Some(0.05)), Just(Some(1.0))];
    (any::<bool>(), samples, prop::collection::vec(-0.3..0.3f64, 18), deviation)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Random points are passed to 1e-9 of the range, of rhythmic movements in every period.
    #[test]
    fn points_are_passed((rhythmic, samples, offsets, deviation) in sets()) {
        let model = if rhythmic { &CYCLE } else { &REACH };
        let (conditions, positions) = mean(model);
        let step = duration(&conditions) / STEPS as f64;
        let (n, ranges) = (model.n_dofs(), model.ranges());
        let wanted: Vec<Vec<f64>> = samples.iter().enumerate().map(|(i, &k)| {
            (0..n).map(|d| positions[[k, d]] + offsets[(i * n + d) % 18] * ranges[d]).collect()
        }).collect();
        let points: Vec<ViaPoint> = samples.iter().zip(&wanted)
            .map(|(&k, wanted)| ViaPoint::new(At::Time(k as f64 * step), wanted.clone())).collect();
        let options = PassageOptions { deviation, ..PassageOptions::default() };
        let passage = through(model, &points, &Conditions::default(), &options).unwrap();
        let found = movement(model, &passage.conditions, 2);
        for (&k, wanted) in samples.iter().zip(&wanted) {
            for k in if rhythmic { vec![k, k + STEPS] } else { vec![k] } {
                for d in 0..n {
                    let error = (found[[k, d]] - wanted[d]).abs() / ranges[d];
                    prop_assert!(error <= 1e-9, "{error:e} of the range at {k}");
                }
            }
        }
    }
}

/// k of the residual between points, given that it vanishes with two derivatives at both ends: by differences of the textbook
/// formula, and the Schur complement.
fn bridge(places: &[f64]) -> DMatrix<f64> {
    let k = |v: f64, w: f64| {
        let a = 5f64.sqrt() * (v - w).abs() / 0.2;
        (1.0 + a + a * a / 3.0) * (-a).exp()
    };
    // Six values near the ends determine value and two derivatives there to 1e-3 of the length scale.
    let h = 2e-4;
    let ends = [0.0, h, 2.0 * h, 1.0 - 2.0 * h, 1.0 - h, 1.0];
    let of = |a: &[f64], b: &[f64]| DMatrix::from_fn(a.len(), b.len(), |i, j| k(a[i], b[j]));
    let (cross, own) = (of(places, &ends), of(&ends, &ends));
    of(places, places) - &cross * own.lu().solve(&cross.transpose()).unwrap()
}

/// The movement is the posterior mean of a dense Gaussian over all samples, computed from rollouts of single demonstrations.
#[test]
fn movement_is_the_posterior_mean_of_a_dense_gaussian() {
    let model = &*REACH;
    let (conditions, mean) = mean(model);
    let (n_dofs, m) = (model.n_dofs(), model.n_demos());
    let size = (STEPS + 1) * n_dofs;
    let nominal_time = |one: Conditions| Conditions { segment_durations: conditions.segment_durations.clone(), ..one };
    let flat = |positions: &Array2<f64>| DVector::from_iterator(size, positions.iter().copied());
    let centre = flat(&mean);
    let mut covariance = DMatrix::zeros(size, size);
    for demo in 0..m {
        let one = nominal_time(conditions_of(model, demo));
        let deviation = flat(&movement(model, &one, 1)) - &centre;
        covariance += &deviation * deviation.transpose() / (m - 1) as f64;
    }
    let places: Vec<f64> = (0..=STEPS).map(|k| k as f64 / STEPS as f64).collect();
    let (residual, deviation) = (bridge(&places), 0.03);
    for i in 0..size {
        for j in (i % n_dofs..size).step_by(n_dofs) {
            let sd = deviation * model.ranges()[i % n_dofs];
            covariance[(i, j)] += sd * sd * residual[(i / n_dofs, j / n_dofs)];
        }
    }
    let step = duration(&conditions) / STEPS as f64;
    let height = |k: usize, offset: f64, tolerance: f64| ViaPoint {
        dofs: Some(vec![1]),
        tolerance,
        ..ViaPoint::new(At::Time(k as f64 * step), vec![mean[[k, 1]] + offset])
    };
    let points = [height(60, 0.1, 0.0), height(150, -0.05, 0.1)];
    let options = PassageOptions { deviation: Some(deviation), ..PassageOptions::default() };
    let passage = through(model, &points, &Conditions::default(), &options).unwrap();
    let found = flat(&movement(model, &passage.conditions, 1)) - &centre;

    let at = [60 * n_dofs + 1, 150 * n_dofs + 1];
    let mut own = DMatrix::from_fn(2, 2, |i, j| covariance[(at[i], at[j])]);
    own[(1, 1)] += (0.1 * model.ranges()[1]).powi(2);
    let residual = DVector::from_vec(vec![0.1, -0.05]);
    let weights = own.lu().solve(&residual).unwrap();
    let expected: DVector<f64> = (0..2).map(|i| covariance.column(at[i]) * weights[i]).sum();
    let error = (&found - &expected).amax();
    assert!(error < 2e-4 * expected.amax(), "{error:e} of {:e}", expected.amax());
    assert!((passage.distance - residual.dot(&weights).sqrt()).abs() < 1e-4 * passage.distance);
}

/// Points right after the departure, and right before it in the next period, are passed under way.
#[test]
fn points_near_the_departure_are_passed() {
    for (model, samples) in [(&REACH, [61, 120, 199]), (&CYCLE, [61, 120, 58])] {
        let (conditions, positions) = mean(model);
        let step = duration(&conditions) / STEPS as f64;
        let from_phase = Some(model.canonical().phase(0.3 * model.canonical().extent()));
        let wanted = |k: usize| -> Vec<f64> {
            let size = if k == 120 { 0.1 } else { 1e-4 };
            positions.row(k).iter().zip(model.ranges()).map(|(y, range)| y + size * range).collect()
        };
        let points = samples.map(|k| ViaPoint::new(At::Time(k as f64 * step), wanted(k)));
        for deviation in [0.0, 0.03] {
            let options = PassageOptions { from_phase, deviation: Some(deviation), ..PassageOptions::default() };
            let times = Conditions { segment_durations: conditions.segment_durations.clone(), ..Conditions::default() };
            let passage = through(model, &points, &times, &options).unwrap();
            let found = movement(model, &passage.conditions, 1);
            for k in samples {
                for ((found, wanted), range) in found.row(k).iter().zip(wanted(k)).zip(model.ranges()) {
                    assert!((found - wanted).abs() < 1e-9 * range, "{deviation} at {k}: {:e}", found - wanted);
                }
            }
        }
    }
}

/// Under way, the displacement is the posterior mean of a dense Gaussian in which movements have left with three equal samples,
/// and end with three.
#[test]
fn displacement_under_way_is_the_posterior_mean_of_a_dense_gaussian() {
    const FINE: usize = 5000;
    let model = &*REACH;
    let (conditions, _) = mean(model);
    let (n_dofs, m) = (model.n_dofs(), model.n_demos());
    let dt = duration(&conditions) / FINE as f64;
    let times = || Conditions { segment_durations: conditions.segment_durations.clone(), ..Conditions::default() };
    let fine = |one: Conditions| {
        let grid = TimeGrid { dt, duration: None };
        rollout(model.primitive(), &times().or(one), grid).unwrap().position
    };
    let centre = fine(conditions.clone());
    let points = [2600, 3900];
    let ends = [1499, 1500, 1501, FINE - 2, FINE - 1, FINE];
    let samples: Vec<usize> = ends.into_iter().chain(points).chain((1600..FINE).step_by(150)).collect();
    let size = samples.len() * n_dofs;
    let mut covariance = DMatrix::zeros(size, size);
    for demo in 0..m {
        let off = fine(conditions_of(model, demo)) - &centre;
        let deviation = DVector::from_fn(size, |i, _| off[[samples[i / n_dofs], i % n_dofs]]);
        covariance += &deviation * deviation.transpose() / (m - 1) as f64;
    }
    for i in 0..size {
        for j in (i % n_dofs..size).step_by(n_dofs) {
            let a = 5f64.sqrt() * samples[i / n_dofs].abs_diff(samples[j / n_dofs]) as f64 / (0.2 * FINE as f64);
            let sd = 0.03 * model.ranges()[i % n_dofs];
            covariance[(i, j)] += sd * sd * (1.0 + a + a * a / 3.0) * (-a).exp();
        }
    }
    let given: Vec<usize> = (0..6 * n_dofs).chain([6, 7].map(|k| k * n_dofs + 1)).collect();
    let offsets = [0.1, -0.05];
    let residual = DVector::from_fn(given.len(), |i, _| if i < 6 * n_dofs { 0.0 } else { offsets[i - 6 * n_dofs] });
    let own = DMatrix::from_fn(given.len(), given.len(), |i, j| covariance[(given[i], given[j])]);
    let weights = own.lu().solve(&residual).unwrap();
    let expected = DMatrix::from_fn(size, given.len(), |i, j| covariance[(i, given[j])]) * &weights;

    let point = |k: usize, offset: f64| ViaPoint {
        dofs: Some(vec![1]),
        ..ViaPoint::new(At::Time(k as f64 * dt), vec![centre[[k, 1]] + offset])
    };
    let extent = model.canonical().extent();
    let from_phase = Some(model.canonical().phase(extent * ends[1] as f64 / FINE as f64));
    let options = PassageOptions { from_phase, ..PassageOptions::default() };
    let points = [point(points[0], offsets[0]), point(points[1], offsets[1])];
    let passage = through(model, &points, &times(), &options).unwrap();
    assert_eq!(passage.conditions.style, conditions.style);
    for (k, expected) in samples.iter().zip(expected.as_slice().chunks(n_dofs)) {
        let [found, ..] = passage.forcing.displacement(extent * *k as f64 / FINE as f64);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-4, "{found} instead of {expected} at {k}");
        }
    }
    let distance = residual.dot(&weights).sqrt();
    assert!((passage.distance - distance).abs() < 1e-3 * distance, "{} {distance}", passage.distance);
}

/// A deviation of zero leaves the forcing without effect if the parameters suffice; if these are given, the forcing alone leads
/// to the point.
#[test]
fn without_deviation_the_parameters_carry_the_change() {
    let model = &*REACH;
    let target = conditions_of(model, 3);
    let (conditions, _) = mean(model);
    let same_time = Conditions { segment_durations: conditions.segment_durations.clone(), ..target };
    let positions = movement(model, &same_time, 1);
    let time = 0.5 * duration(&conditions);
    let point = ViaPoint { dofs: Some(vec![1]), ..ViaPoint::new(At::Time(time), vec![positions[[STEPS / 2, 1]]]) };
    let options = PassageOptions { deviation: Some(0.0), ..PassageOptions::default() };
    let passage = through(model, std::slice::from_ref(&point), &Conditions::default(), &options).unwrap();
    assert!(passage.displacement.iter().all(|x| *x < 1e-6), "{:?}", passage.displacement);
    assert!(!passage.is_far() && passage.n_constraints == 1);
    // With all parameters given, the forcing carries it.
    let fixed = through(model, &[point], &conditions, &options).unwrap();
    assert_eq!(fixed.conditions.style, conditions.style);
    assert!(fixed.displacement[1] > 0.01 && fixed.displacement[0] < 1e-12);
}

/// A velocity is passed, too.
#[test]
fn velocities_are_passed() {
    for model in [&REACH, &CYCLE] {
        let n = model.n_dofs();
        let (conditions, positions) = mean(model);
        let (k, step) = (80, duration(&conditions) / STEPS as f64);
        let mut point = ViaPoint::new(At::Time(k as f64 * step), positions.row(k).to_vec());
        point.velocity = Some(vec![0.3; n]);
        let passage = plain(model, &[point]).unwrap();
        let grid = TimeGrid { dt: step, duration: None };
        let velocity = rollout(model.primitive(), &passage.conditions, grid).unwrap().velocity;
        assert!(velocity.row(k).iter().all(|v| (v - 0.3).abs() < 1e-7), "{}", velocity.row(k));
    }
}

/// Runs a controller, adds a forcing at tick `k`, and returns the motion of all ticks.
fn run(model: &Model, conditions: &Conditions, k: usize, late: usize, limits: Option<&Limits>) -> Vec<[Vec<f64>; 3]> {
    let tick = duration(conditions) / 2000.0;
    let mut controller = Controller::new(model.primitive(), tick, conditions, None).unwrap();
    if let Some(limits) = limits {
        controller.set_limits(limits).unwrap();
    }
    let mut motion = Vec::new();
    let mut forcing = None;
    for i in 0..2600 {
        if i == k {
            let positions = controller.forecast(tick * 800.0, None).unwrap().position;
            let target = positions.row(800).iter().zip(model.ranges()).map(|(y, r)| y + 0.2 * r).collect();
            let point = ViaPoint::new(At::Time(((i + 800) % 2000) as f64 * tick), target);
            let options = PassageOptions { from_phase: Some(controller.phase()), ..PassageOptions::default() };
            forcing = through(model, &[point], conditions, &options).unwrap().conditions.forcing;
        }
        if i == k + late {
            let (position, velocity) = (controller.position().to_vec(), controller.velocity().to_vec());
            let before = allocations();
            controller.add_forcing(forcing.as_ref().unwrap()).unwrap();
            assert!(limits.is_some() || allocations() == before, "adding a first forcing allocates");
            assert_eq!(controller.position(), position);
            let kept = controller.velocity().iter().zip(&velocity).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(kept || limits.is_some());
        }
        let before = allocations();
        controller.step().unwrap();
        assert_eq!(allocations(), before, "a tick allocates");
        motion.push([controller.position(), controller.velocity(), controller.acceleration()].map(<[f64]>::to_vec));
    }
    motion
}

/// Added to a movement under way, a forcing leaves position, velocity and acceleration continuous and passes its point; added
/// late, position and velocity stay continuous.
#[test]
fn forcing_joins_a_movement_under_way() {
    for model in [&REACH, &CYCLE] {
        let conditions = mean(model).0;
        let without = run(model, &conditions, 5000, 0, None);
        let with = run(model, &conditions, 700, 0, None);
        let step = |motion: &[[Vec<f64>; 3]], order: usize| {
            motion
                .windows(2)
                .flat_map(|pair| {
                    let (a, b) = (pair[0][order].clone(), pair[1][order].clone());
                    a.into_iter().zip(b).zip(model.ranges()).map(|((a, b), r)| (b - a).abs() / r).collect::<Vec<_>>()
                })
                .fold(0.0, f64::max)
        };
        for order in 0..3 {
            let (largest, usual) = (step(&with[1..1990], order), step(&without[1..1990], order));
            assert!(largest < 4.0 * usual, "order {order}: {largest} against {usual}");
        }
        for d in 0..model.n_dofs() {
            let moved = (with[1499][0][d] - without[1499][0][d]) / model.ranges()[d];
            assert!((moved - 0.2).abs() < 1e-6, "{moved}");
        }
        let late = run(model, &conditions, 700, 300, None);
        assert!(step(&late[1..1990], 0) < 4.0 * step(&without[1..1990], 0));
    }
    // A discrete movement still ends at its goal.
    let conditions = mean(&REACH).0;
    let end = run(&REACH, &conditions, 700, 0, None).pop().unwrap();
    assert!(end[0].iter().zip(conditions.goal.unwrap()).all(|(y, g)| (y - g).abs() < 1e-6));
}

/// Limits hold with a forcing, and the fastest movement passes the point, too.
#[test]
fn limits_see_the_forcing() {
    let model = &*REACH;
    let (conditions, positions) = mean(model);
    let limits = Limits { velocity: Some(vec![1.0; 3]), acceleration: Some(vec![8.0; 3]), ..Limits::default() };
    let motion = run(model, &conditions, 700, 0, Some(&limits));
    let largest = |order: usize| motion.iter().flat_map(|at| &at[order]).fold(0.0f64, |most, x| most.max(x.abs()));
    assert!(largest(1) <= 1.0 + 1e-12 && largest(2) <= 8.0 + 1e-12, "{} {}", largest(1), largest(2));
    let wanted: Vec<f64> = positions.row(90).iter().map(|y| y + 0.1).collect();
    let step = duration(&conditions) / STEPS as f64;
    let passage = plain(model, &[ViaPoint::new(At::Time(90.0 * step), wanted.clone())]).unwrap();
    let path = fastest(model.primitive(), &limits, &passage.conditions, 1e-3).unwrap().position;
    let distance =
        |row: ndarray::ArrayView1<f64>| row.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let nearest = path.rows().into_iter().map(distance).fold(f64::INFINITY, f64::min);
    assert!(nearest < 2e-3, "{nearest}");
}

/// Batches, snapshots and copies move as rollouts do.
#[test]
fn batches_snapshots_and_copies_carry_the_forcing() {
    for model in [&REACH, &CYCLE] {
        let (conditions, positions) = mean(model);
        let step = duration(&conditions) / STEPS as f64;
        let wanted: Vec<f64> = positions.row(70).iter().map(|y| y + 0.1).collect();
        let passed = plain(model, &[ViaPoint::new(At::Time(70.0 * step), wanted)]).unwrap().conditions;
        let one = rollout(model.primitive(), &passed, TimeGrid { dt: step, duration: None }).unwrap();
        let shared = BatchConditions::shared(model.primitive(), passed.clone()).unwrap();
        let each = BatchConditions::each(model.primitive(), &[passed.clone(), passed.clone()]).unwrap();
        for conditions in [shared, each] {
            let grid = TimeGrid { dt: step, duration: None };
            let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(())).unwrap();
            let found = batch.rollouts(0..1, Derivative::Acceleration, Threads::ONE, &mut |_| Ok(())).unwrap();
            let same = |a: ndarray::ArrayView2<f64>, b: &Array2<f64>, tolerance: f64| {
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < tolerance));
            };
            same(found.position.index_axis(ndarray::Axis(0), 0), &one.position, 1e-9);
            same(found.velocity.unwrap().index_axis(ndarray::Axis(0), 0), &one.velocity, 1e-7);
        }
        let plain = Conditions { forcing: None, ..passed.clone() };
        assert!(BatchConditions::each(model.primitive(), &[passed.clone(), plain.clone()]).is_err());
        let half = plain.blend(&passed, 0.5).unwrap();
        let [a, b, c] = [&plain, &passed, &half].map(|conditions| movement(model, conditions, 1));
        assert!((&c * 2.0 - &a - &b).iter().all(|x| x.abs() < 1e-9));

        let mut controller = Controller::new(model.primitive(), 1e-3, &passed, None).unwrap();
        (0..300).try_for_each(|_| controller.step().map(drop)).unwrap();
        let snapshot = controller.snapshot();
        let mut restored = Controller::restore(model.primitive(), &snapshot).unwrap();
        (0..300).for_each(|_| {
            controller.step().unwrap();
            restored.step().unwrap();
        });
        assert_eq!(controller.position(), restored.position());
        let other = if model.kind() == Kind::Discrete { &CYCLE } else { &REACH };
        assert!(Controller::restore(other.primitive(), &snapshot).is_err());
        assert!(
            rollout(
                other.primitive(),
                &Conditions { forcing: passed.forcing, ..Conditions::default() },
                grid(0.01, 1.0)
            )
            .is_err()
        );
    }
}

/// An orientation is passed.
#[test]
fn rotations_are_passed() {
    let demos: Vec<_> = screws(5, 2.0, 0.3, 101, 1).into_iter().map(pose).collect();
    let model = learn(&demos, &options(Kind::Discrete));
    let (_, positions) = mean(&model);
    let (first, second) = (positions.row(80).to_vec(), positions.row(90).to_vec());
    let (conditions, _) = mean(&model);
    let time = 80.0 * duration(&conditions) / STEPS as f64;
    let passage = plain(&model, &[ViaPoint::new(At::Time(time), second.clone())]).unwrap();
    let found = movement(&model, &passage.conditions, 1);
    let sign: f64 = (3..7).map(|i| found[[80, i]] * second[i]).sum::<f64>().signum();
    for i in 0..7 {
        let sign = if i < 3 { 1.0 } else { sign };
        assert!((found[[80, i]] - sign * second[i]).abs() < 1e-8, "{first:?} {second:?} {}", found.row(80));
    }
    let part = ViaPoint { dofs: Some(vec![3, 4]), ..ViaPoint::new(At::Time(time), vec![1.0, 0.0]) };
    assert!(plain(&model, &[part]).is_err());
}

/// Models of poses, and of a rotation that turns about once a cycle.
fn turning_models() -> [Arc<Model>; 2] {
    let demos: Vec<_> = screws(5, 2.0, 0.3, 101, 1).into_iter().map(pose).collect();
    let cycles: Vec<_> = wobbles(5, 1.0, 100).iter().map(turning).collect();
    [learn(&demos, &options(Kind::Discrete)), learn(&cycles, &options(Kind::Rhythmic))]
}

/// Velocities at a sample of a movement in steps of a given length.
fn velocities(model: &Model, conditions: &Conditions, step: f64, k: usize) -> Vec<f64> {
    let grid = TimeGrid { dt: step, duration: Some(step * k as f64) };
    rollout(model.primitive(), conditions, grid).unwrap().velocity.row(k).to_vec()
}

/// An orientation and an angular velocity that the mean movement has leave it as it is; others are passed, in both frames and
/// at any duration.
#[test]
fn angular_velocities_are_passed() {
    for plain in turning_models() {
        for frame in [Frame::Body, Frame::World] {
            let model = plain.in_frame(frame).unwrap();
            for factor in [1.0, 1.6] {
                let given = Conditions { tau: Some(factor * model.tau()), ..Conditions::default() };
                let mean = Conditions { segment_durations: None, ..mean(&model).0 }.or(given.clone());
                let (k, step) = (80, factor * model.duration() / STEPS as f64);
                let grid = TimeGrid { dt: step, duration: None };
                let movement = |conditions: &Conditions| rollout(model.primitive(), conditions, grid).unwrap();
                let before = movement(&mean);
                let mut point = ViaPoint::new(At::Time(k as f64 * step), before.position.row(k).to_vec());
                point.velocity = Some(before.velocity.row(k).to_vec());
                let pass = |point: &ViaPoint| {
                    through(&model, std::slice::from_ref(point), &given, &PassageOptions::default()).unwrap()
                };
                let same = pass(&point);
                assert!(same.distance < 1e-6, "{}", same.distance);
                assert!((movement(&same.conditions).position - &before.position).iter().all(|x| x.abs() < 1e-8));

                // The orientation of a later sample, and another velocity.
                point.position = Some(before.position.row(k + 8).to_vec());
                let wanted: Vec<f64> =
                    before.velocity.row(k).iter().enumerate().map(|(i, x)| 0.7 * x + 0.1 * i as f64).collect();
                point.velocity = Some(wanted.clone());
                let passage = pass(&point);
                assert!(passage.displacement.iter().any(|x| *x > 1e-3) && passage.distance > 0.01);
                let found = movement(&passage.conditions);
                let column = if model.kind() == Kind::Discrete { 3 } else { 0 };
                let off = angle(rotation(found.position.row(k), column), rotation(before.position.row(k + 8), column));
                assert!(off < 1e-8, "{off:e} rad");
                for (found, wanted) in found.velocity.row(k).iter().zip(&wanted) {
                    assert!((found - wanted).abs() < 1e-6, "{frame:?} {factor}: {found} instead of {wanted}");
                }
            }
        }
    }
}

/// Under way, the additional forcing alone leads to an orientation with an angular velocity, of a rotation without the rest of a
/// pose.
#[test]
fn angular_velocities_are_passed_under_way() {
    for model in turning_models() {
        let conditions = mean(&model).0;
        let step = duration(&conditions) / STEPS as f64;
        let column = if model.kind() == Kind::Discrete { 3 } else { 0 };
        let positions = movement(&model, &conditions, 1);
        let wanted = [0.3, -0.2, 0.4];
        let point = ViaPoint {
            velocity: Some(wanted.to_vec()),
            dofs: Some((column..column + 4).collect()),
            ..ViaPoint::new(At::Time(150.0 * step), (0..4).map(|i| positions[[145, column + i]]).collect())
        };
        let from_phase = Some(model.canonical().phase(0.3 * model.canonical().extent()));
        let options = PassageOptions { from_phase, ..PassageOptions::default() };
        let passage = through(&model, &[point], &conditions, &options).unwrap();
        assert_eq!(passage.n_constraints, 6);
        let found = movement(&model, &passage.conditions, 1);
        let off = angle(rotation(found.row(150), column), rotation(positions.row(145), column));
        assert!(off < 1e-8, "{off:e} rad");
        let omega = velocities(&model, &passage.conditions, step, 150);
        assert!(omega[column..].iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-6), "{omega:?}");
    }
}

/// Velocities of another shape, and those of a rotation without its orientation, are refused with the remedy.
#[test]
fn angular_velocities_need_an_orientation() {
    let [model, _] = turning_models();
    let (conditions, positions) = mean(&model);
    let at = At::Time(80.0 * duration(&conditions) / STEPS as f64);
    let point = |position: Option<Vec<f64>>, n: usize, dofs: Option<Vec<usize>>| ViaPoint {
        position,
        velocity: Some(vec![0.1; n]),
        dofs,
        ..ViaPoint::new(at, vec![])
    };
    let position = positions.row(80).to_vec();
    let rotation = position[3..].to_vec();
    for (point, text) in [
        (
            point(Some(position.clone()), 7, None),
            "expected 6: one value per DoF of the point, of which a rotation has three",
        ),
        (point(Some(rotation), 4, Some(vec![3, 4, 5, 6])), "expected 3"),
        (point(None, 6, None), "give the point a position, too"),
    ] {
        let message = plain(&model, &[point]).unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    }
    // The velocity of the other coordinates needs no position.
    let free = plain(&model, &[point(None, 2, Some(vec![0, 2]))]).unwrap();
    let step = duration(&conditions) / STEPS as f64;
    let found = velocities(&model, &free.conditions, step, 80);
    assert!((found[0] - 0.1).abs() < 1e-7 && (found[2] - 0.1).abs() < 1e-7 && free.n_constraints == 2, "{found:?}");
}

/// Points half a percent of the movement apart with velocities are passed, which takes large weights of opposite sign.
#[test]
fn points_close_to_each_other_are_passed() {
    for (model, deviation) in [(&REACH, 0.03), (&REACH, 1.0), (&CYCLE, 0.0), (&CYCLE, 1.0)] {
        let (conditions, positions) = mean(model);
        let step = duration(&conditions) / STEPS as f64;
        let wanted = |k: usize| -> Vec<f64> { positions.row(k).iter().map(|y| y + 0.01 * (k % 3) as f64).collect() };
        let point = |k: usize| ViaPoint {
            velocity: Some(vec![0.1; model.n_dofs()]),
            ..ViaPoint::new(At::Time(k as f64 * step), wanted(k))
        };
        let options = PassageOptions { deviation: Some(deviation), ..PassageOptions::default() };
        let samples = [60, 61, 90, 120, 121];
        let passage = through(model, &samples.map(point), &Conditions::default(), &options).unwrap();
        let found = movement(model, &passage.conditions, 1);
        for k in samples {
            for ((found, wanted), range) in found.row(k).iter().zip(wanted(k)).zip(model.ranges()) {
                assert!((found - wanted).abs() < 1e-9 * range, "{deviation} at {k}: {:e}", found - wanted);
            }
        }
    }
}

/// Points that no movement passes are refused, with their reason.
#[test]
fn impossible_points_are_refused() {
    let model = &*REACH;
    let point = |time: f64, position: Vec<f64>| ViaPoint::new(At::Time(time), position);
    let y = vec![0.5, 0.5, 0.1];
    let refused = |points: &[ViaPoint], text: &str| {
        let message = plain(model, points).unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    };
    refused(&[], "at least one");
    refused(&[point(9.0, y.clone())], "time");
    refused(&[point(-0.1, y.clone())], "time");
    refused(&[point(f64::NAN, y.clone())], "time");
    refused(&[ViaPoint::new(At::Phase(1.5), y.clone())], "phase");
    refused(&[point(0.5, vec![0.5])], "length");
    refused(&[point(0.5, vec![0.5, f64::NAN, 0.0])], "finite");
    refused(&[ViaPoint { tolerance: -1.0, ..point(0.5, y.clone()) }], "tolerance");
    refused(&[ViaPoint { dofs: Some(vec![3]), ..point(0.5, vec![0.1]) }], "dofs");
    refused(&[ViaPoint { position: None, ..point(0.5, y.clone()) }], "nothing");
    refused(&[point(0.5, y.clone()), point(0.5, vec![0.6, 0.5, 0.1])], "one place");
    refused(&[point(0.0, vec![0.9; 3])], "an end");
    let many: Vec<ViaPoint> = (1..200).map(|k| point(0.004 * f64::from(k), y.clone())).collect();
    refused(&many, "500");
    let before = PassageOptions { from_phase: Some(model.canonical().phase(0.6)), ..PassageOptions::default() };
    assert!(through(model, &[point(0.5, y.clone())], &Conditions::default(), &before).is_err());
    // The same point twice is one, and a point far away is called far.
    let twice = plain(model, &[point(0.5, y.clone()), point(0.5, y)]).unwrap();
    assert_eq!(twice.n_constraints, 3);
    assert!(plain(model, &[point(0.5, vec![9.0, 0.5, 0.1])]).unwrap().is_far());
}
