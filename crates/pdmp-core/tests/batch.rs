//! Batches of movements and Jacobians agree with the control loop and with rollouts.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;

use std::sync::Arc;

use common::*;
use ndarray::{Array2, Array3, Axis, array, s};
use pdmp_core::model::Derivative;
use pdmp_core::motion::batch;
use pdmp_core::motion::{self, BatchConditions, PerMovement, TimeGrid, Trajectories, Trajectory, WithRespectTo};
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Controller, Error, Kind, Model};
use proptest::prelude::*;

fn all(conditions: &BatchConditions, model: &Arc<Model>, grid: TimeGrid) -> Trajectories {
    let batch = batch(model.primitive(), conditions.clone(), grid, &mut |_| Ok(())).unwrap();
    batch.rollouts(0..batch.shape().0, Derivative::Acceleration, Threads::ONE, &mut |_| Ok(())).unwrap()
}

fn one_each(rows: Array2<f64>) -> Option<PerMovement> {
    Some(PerMovement::Each(rows))
}

fn jacobian(variable: WithRespectTo, order: Derivative, model: &Arc<Model>, conditions: &Conditions) -> Array3<f64> {
    motion::jacobian(model.primitive(), variable, order, conditions, grid(0.01, 1.5), &mut |_| Ok(())).unwrap()
}

fn of(trajectory: &Trajectory, order: Derivative) -> &Array2<f64> {
    match order {
        Derivative::Position => &trajectory.position,
        Derivative::Velocity => &trajectory.velocity,
        Derivative::Acceleration => &trajectory.acceleration,
    }
}

/// Largest difference of two arrays, and largest magnitude of the second.
fn difference(a: &Array2<f64>, b: &Array2<f64>) -> (f64, f64) {
    let largest = |a: &Array2<f64>| a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    (largest(&(a - b)), largest(b))
}

/// Vectors (3, n), one for each of three movements.
fn each(n: usize) -> impl Strategy<Value = Array2<f64>> {
    prop::collection::vec(-3.0..3.0f64, 3 * n).prop_map(move |v| Array2::from_shape_vec((3, n), v).unwrap())
}

/// No vector, one for all movements, or one for each.
fn rows(n: usize) -> impl Strategy<Value = Option<PerMovement>> {
    prop_oneof![
        Just(None),
        each(n).prop_map(|rows| Some(PerMovement::All(rows.row(0).to_vec()))),
        each(n).prop_map(|rows| Some(PerMovement::Each(rows))),
    ]
}

fn row(rows: &Option<PerMovement>, b: usize) -> Option<Vec<f64>> {
    rows.as_ref().map(|rows| match rows {
        PerMovement::All(row) => row.clone(),
        PerMovement::Each(rows) => rows.row(b).to_vec(),
    })
}

proptest! {
    /// Every movement of a batch agrees with the control loop under its conditions, within and past the end.
    #[test]
    fn batch_is_the_loop(
        styles in each(2),
        rows in (rows(3), rows(3), rows(3), rows(3)),
        amplitude in prop_oneof![Just(0.0), 0.1..3.0f64],
        dt in prop_oneof![Just(1e-3), Just(1e-2), 2e-3..3e-2f64],
        factor in 0.3..3.0f64,
        length in 0.1..2.0f64,
    ) {
        for model in [&*REACH, &*CYCLE] {
            let (kind, n) = (model.kind(), model.n_dofs());
            let cut = |rows: &Option<PerMovement>| rows.clone().map(|rows| match rows {
                PerMovement::All(row) => PerMovement::All(row[..n].to_vec()),
                PerMovement::Each(rows) => PerMovement::Each(rows.slice(s![.., ..n]).to_owned()),
            });
            let (centres, starts, velocities) = (cut(&rows.0), cut(&rows.1), cut(&rows.2));
            let discrete = kind == Kind::Discrete;
            let goal_velocities = cut(&rows.3).filter(|_| discrete);
            let tau = Some(factor * model.tau());
            let conditions = BatchConditions {
                style: one_each(styles.clone()),
                goal: centres.clone().filter(|_| discrete),
                anchor: centres.clone().filter(|_| !discrete),
                start: starts.clone(),
                velocity: velocities.clone(),
                goal_velocity: goal_velocities.clone(),
                amplitude: (!discrete).then(|| amplitude.into()),
                tau: tau.map(PerMovement::from),
                ..BatchConditions::default()
            };
            let duration = length * factor * model.duration();
            let made = all(&conditions, model, grid(dt, duration));
            for b in 0..3 {
                let one = Conditions {
                    style: Some(styles.row(b).to_vec()),
                    goal: row(&centres, b).filter(|_| discrete),
                    anchor: row(&centres, b).filter(|_| !discrete),
                    start: row(&starts, b),
                    velocity: row(&velocities, b),
                    goal_velocity: row(&goal_velocities, b),
                    amplitude: (!discrete).then_some(amplitude),
                    tau,
                    ..Conditions::default()
                };
                let mut controller = Controller::new(model.primitive(), dt, &one, Some(0.0)).unwrap();
                let mut stepped = [(); 3].map(|()| Array2::zeros((made.position.len_of(Axis(1)), n)));
                for k in 0..stepped[0].nrows() {
                    if k > 0 {
                        controller.step().unwrap();
                    }
                    let motion = [controller.position(), controller.velocity(), controller.acceleration()];
                    for (stepped, motion) in stepped.iter_mut().zip(motion) {
                        stepped.row_mut(k).assign(&ndarray::aview1(motion));
                    }
                }
                for (order, (made, stepped)) in made.iter().zip(&stepped).enumerate() {
                    let (error, size) = difference(&made.index_axis(Axis(0), b).to_owned(), stepped);
                    prop_assert!(error < 1e-11 * size.max(1.0), "{kind} {order}: {error:e} of {size:e}");
                }
            }
        }
    }

    /// Results are bitwise equal for all sizes of chunks and numbers of threads.
    #[test]
    fn results_do_not_depend_on_the_division_of_the_work(size in 1usize..50, n_threads in 1usize..5, samples in 1usize..900) {
        let styles = Array2::from_shape_fn((41, 2), |(b, j)| (b as f64 + 0.3 * j as f64).sin());
        let velocity = one_each(Array2::from_shape_fn((41, 3), |(b, d)| (b * d) as f64 * 0.01));
        let conditions = BatchConditions { style: one_each(styles), velocity, ..BatchConditions::default() };
        let grid = grid(1e-3, (samples - 1) as f64 * 1e-3);
        let expected = all(&conditions, &REACH, grid);
        let batch = batch(REACH.primitive(), conditions, grid, &mut |_| Ok(())).unwrap();
        let mut ends = vec![0];
        for chunk in batch.chunks(size).unwrap() {
            prop_assert_eq!(chunk.start, *ends.last().unwrap());
            ends.push(chunk.end);
            let threads = Threads::new(n_threads).unwrap();
            let made = batch.rollouts(chunk.clone(), Derivative::Velocity, threads, &mut |_| Ok(())).unwrap();
            prop_assert!(made.velocity.is_some() && made.acceleration.is_none());
            for (made, expected) in made.iter().zip(expected.iter()) {
                prop_assert_eq!(made.view(), expected.slice(s![chunk.clone(), .., ..]));
            }
        }
        prop_assert_eq!(*ends.last().unwrap(), 41);
        prop_assert_eq!(ends.len() - 1, 41usize.div_ceil(size));
    }
}

/// Large batches are bitwise equal on several threads and in strided outputs.
#[test]
fn large_batches_are_the_same_on_several_threads() {
    let styles = Array2::from_shape_fn((2000, 2), |(b, j)| (b as f64 + 0.3 * j as f64).sin());
    let batch = batch(
        REACH.primitive(),
        BatchConditions { style: one_each(styles), ..Default::default() },
        grid(1e-3, 0.4),
        &mut |_| Ok(()),
    )
    .unwrap();
    let expected = batch.rollouts(0..2000, Derivative::Position, Threads::ONE, &mut |_| Ok(())).unwrap();
    let mut shares = Vec::new();
    let threads = Threads::new(3).unwrap();
    let mut strided = Array3::zeros((401, 2000, 6));
    let output = strided.slice_mut(s![.., .., ..;2]).permuted_axes([1, 0, 2]);
    let mut progress = |share| {
        shares.push(share);
        Ok(())
    };
    batch.write(0..2000, vec![output], threads, &mut progress).unwrap();
    assert_eq!(strided.slice(s![.., .., ..;2]).permuted_axes([1, 0, 2]), expected.position);
    assert!(strided.slice(s![.., .., 1..;2]).iter().all(|x| *x == 0.0));
    assert!(shares[0] == 0.0 && shares.is_sorted() && shares.iter().all(|share| (0.0..1.0).contains(share)));
}

/// An error of `progress` cancels a batch between blocks.
#[test]
fn batches_can_be_interrupted() {
    let styles = Array2::zeros((3000, 2));
    let batch = motion::batch(
        REACH.primitive(),
        BatchConditions { style: one_each(styles), ..Default::default() },
        grid(1e-3, 1.0),
        &mut |_| Ok(()),
    )
    .unwrap();
    let mut cancel_later = |share: f64| if share < 0.3 { Ok(()) } else { Err(Error::Interrupted) };
    let stopped = batch.rollouts(0..3000, Derivative::Position, Threads::ONE, &mut cancel_later);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    let new = Model::from_bytes(&REACH.to_bytes().unwrap()).unwrap();
    let stopped = motion::batch(
        new.primitive(),
        BatchConditions { style: one_each(array![[0.0, 0.0]]), ..Default::default() },
        grid(1e-3, 1.0),
        &mut |_| Err(Error::Interrupted),
    );
    assert!(matches!(stopped, Err(Error::Interrupted)));
}

/// Cached responses are bitwise equal to newly computed ones, also after other keys have evicted them.
#[test]
fn cached_responses_are_bitwise_equal_to_new_ones() {
    let styles = array![[0.4, -1.0], [0.0, 2.0]];
    for (model, other) in [(&*REACH, 0.7), (&*CYCLE, 1.3)] {
        let conditions = BatchConditions { style: one_each(styles.clone()), ..Default::default() };
        let slower = BatchConditions { tau: Some(other.into()), ..conditions.clone() };
        let fresh = || Arc::new(Model::clone(model));
        let (expected, expected_slower) = [&conditions, &slower].map(|c| all(c, &fresh(), grid(0.01, 1.0))).into();
        let used = fresh();
        for k in 0..40 {
            assert_eq!(all(&conditions, &used, grid(0.01, 1.0)), expected);
            assert_eq!(all(&slower, &used, grid(0.01, 1.0)), expected_slower);
            all(&conditions, &used, grid(0.01, 0.1 + 0.01 * k as f64));
        }
    }
}

/// Jacobians are differences of rollouts, with and without a given start and start velocity: a movement is linear in its
/// conditions.
#[test]
fn jacobians_are_differences_of_rollouts() {
    for model in [&*REACH, &*CYCLE] {
        let (n, discrete) = (model.n_dofs(), model.kind() == Kind::Discrete);
        let vector = |x: f64| Some((0..n).map(|d| x + d as f64).collect::<Vec<_>>());
        let cases = [
            (None, None, None),
            (vector(0.4), None, None),
            (None, vector(-0.3), vector(0.6)),
            (vector(0.4), vector(-0.3), vector(0.6)),
        ];
        for (start, velocity, goal_velocity) in cases {
            let goal_velocity = goal_velocity.filter(|_| discrete);
            let base = Conditions {
                style: Some(vec![0.2, -0.3]),
                goal: vector(0.1).filter(|_| discrete),
                anchor: vector(0.1).filter(|_| !discrete),
                start,
                velocity,
                goal_velocity,
                amplitude: (!discrete).then_some(0.7),
                tau: Some(1.4 * model.tau()),
                ..Conditions::default()
            };
            let rollout = |conditions: &Conditions| rollout(model.primitive(), conditions, grid(0.01, 1.5)).unwrap();
            let centre = if discrete { WithRespectTo::Goal } else { WithRespectTo::Anchor };
            let variables = [
                WithRespectTo::Style,
                centre,
                WithRespectTo::Start,
                WithRespectTo::Velocity,
                WithRespectTo::GoalVelocity,
                WithRespectTo::Amplitude,
            ];
            for variable in variables {
                let absent = match variable {
                    WithRespectTo::Start => base.start.is_none() && !discrete,
                    WithRespectTo::Velocity => base.velocity.is_none(),
                    WithRespectTo::Amplitude => discrete,
                    WithRespectTo::GoalVelocity => base.goal_velocity.is_none(),
                    _ => false,
                };
                if absent {
                    continue;
                }
                let entries = match variable {
                    WithRespectTo::Style => 2,
                    WithRespectTo::Amplitude => 1,
                    _ => n,
                };
                for entry in 0..entries {
                    let mut moved = base.clone();
                    let mut amplitude = base.amplitude.map(|amplitude| vec![amplitude]);
                    let condition = match variable {
                        WithRespectTo::Amplitude => &mut amplitude,
                        WithRespectTo::Velocity => &mut moved.velocity,
                        WithRespectTo::Tau => unreachable!("a movement is not linear in tau"),
                        WithRespectTo::Style => &mut moved.style,
                        WithRespectTo::Goal => &mut moved.goal,
                        WithRespectTo::Anchor => &mut moved.anchor,
                        WithRespectTo::Start => &mut moved.start,
                        WithRespectTo::GoalVelocity => &mut moved.goal_velocity,
                    };
                    let nominal = || model.demonstrated().starts.row(model.demonstrated().nominal).to_vec();
                    condition.get_or_insert_with(nominal)[entry] += 0.5;
                    moved.amplitude = amplitude.map(|amplitude| amplitude[0]);
                    let (ahead, behind) = (rollout(&moved), rollout(&base));
                    for order in Derivative::ALL {
                        let slope = (of(&ahead, order) - of(&behind, order)) / 0.5;
                        let found = jacobian(variable, order, model, &base).index_axis(Axis(2), entry).to_owned();
                        let (error, size) = difference(&found, &slope);
                        assert!(error < 1e-10 * size.max(1.0), "{variable:?} {order:?} {entry}: {error:e} of {size:e}");
                    }
                }
            }
        }
    }
}

/// A rhythmic primitive has no goal, and a discrete one no anchor.
#[test]
fn variables_of_the_other_kind_are_rejected() {
    let jacobian = |model: &Arc<Model>, variable| {
        motion::jacobian(
            model.primitive(),
            variable,
            Derivative::Position,
            &Conditions::default(),
            grid(0.1, 1.0),
            &mut |_| Ok(()),
        )
    };
    assert!(matches!(jacobian(&REACH, WithRespectTo::Anchor), Err(Error::Kind { name: "anchor", .. })));
    assert!(matches!(jacobian(&CYCLE, WithRespectTo::Goal), Err(Error::Kind { name: "goal", .. })));
    assert!(matches!(Derivative::of_order("derivative", 3), Err(Error::Range { name: "derivative", .. })));
}

/// A batch of conditions has the movements of their rollouts, with nominal values where a condition is absent.
#[test]
fn a_batch_of_conditions_has_their_rollouts() {
    for model in [&*REACH, &*CYCLE] {
        let (n, discrete) = (model.n_dofs(), model.kind() == Kind::Discrete);
        let centre = Some(vec![0.4; n]);
        let demonstrated = model.conditions(&[1]).unwrap();
        let conditions = [
            Conditions::default(),
            Conditions { style: Some(vec![0.3, -0.2]), ..Conditions::default() },
            Conditions {
                goal: centre.clone().filter(|_| discrete),
                anchor: centre.filter(|_| !discrete),
                ..Conditions::default()
            },
            Conditions { segment_durations: None, ..demonstrated },
        ];
        let batch = BatchConditions::each(model.primitive(), &conditions).unwrap();
        let made = all(&batch, model, grid(0.01, 1.0));
        assert_eq!(made.position.len_of(Axis(0)), 4);
        for (b, one) in conditions.iter().enumerate() {
            let expected = rollout(model.primitive(), one, grid(0.01, 1.0)).unwrap();
            let shared = BatchConditions::shared(model.primitive(), one.clone()).unwrap();
            let alone = all(&shared, model, grid(0.01, 1.0));
            for (made, b) in [(&made, b), (&alone, 0)] {
                let (error, size) = difference(&made.position.index_axis(Axis(0), b).to_owned(), &expected.position);
                assert!(error < 1e-11 * size.max(1.0), "{b}: {error:e} of {size:e}");
            }
        }
    }
}

/// Movements of different τ or phase are rollouts to the bit, at the times of the longest; different amplitudes keep the
/// response curves, and agree to rounding. Chunks and threads do not change them.
#[test]
fn movements_may_differ_in_timing_and_amplitude() {
    for model in [&*REACH, &*CYCLE] {
        let discrete = model.kind() == Kind::Discrete;
        let taus: Vec<f64> = (0..20).map(|b| model.tau() * (0.5 + 0.07 * f64::from(b))).collect();
        let of = |b: usize| Conditions {
            style: Some(vec![0.1 * b as f64, -0.2]),
            tau: Some(taus[b]),
            phase: (!discrete).then_some(0.3 * b as f64),
            amplitude: (!discrete).then_some(0.1 * b as f64),
            ..Conditions::default()
        };
        let movements: Vec<_> = (0..20).map(of).collect();
        let conditions = BatchConditions::each(model.primitive(), &movements).unwrap();
        let (dt, duration) = (0.01, model.duration() * taus[19] / model.tau());
        for length in [None, Some(0.7), Some(2.0 * duration)] {
            let made = all(&conditions, model, TimeGrid { dt, duration: length });
            let grid = TimeGrid { dt, duration: length.or(Some(duration)) };
            let batch = batch(model.primitive(), conditions.clone(), grid, &mut |_| Ok(())).unwrap();
            let threads = Threads::new(3).unwrap();
            let part = batch.rollouts(7..20, Derivative::Velocity, threads, &mut |_| Ok(())).unwrap();
            for (b, one) in movements.iter().enumerate() {
                let single = rollout(model.primitive(), one, grid).unwrap();
                assert_eq!(made.position.index_axis(Axis(0), b), single.position);
                assert_eq!(made.velocity.as_ref().unwrap().index_axis(Axis(0), b), single.velocity);
                assert_eq!(made.acceleration.as_ref().unwrap().index_axis(Axis(0), b), single.acceleration);
                if b >= 7 {
                    assert_eq!(part.position.index_axis(Axis(0), b - 7), single.position);
                }
            }
        }
    }
    let amplitudes = [0.0, 0.5, 2.0].map(|amplitude| Conditions {
        style: Some(vec![0.4, -0.2]),
        amplitude: Some(amplitude),
        ..Conditions::default()
    });
    let conditions = BatchConditions::each(CYCLE.primitive(), &amplitudes).unwrap();
    let made = all(&conditions, &CYCLE, grid(0.01, 3.0));
    for (b, one) in amplitudes.iter().enumerate() {
        let single = rollout(CYCLE.primitive(), one, grid(0.01, 3.0)).unwrap();
        let (error, largest) = difference(&made.position.index_axis(Axis(0), b).to_owned(), &single.position);
        assert!(error <= 1e-12 * (1.0 + largest), "{error}");
    }
}

/// Conditions that a batch cannot have are refused by name: a start velocity for some movements only, and a phase of a discrete
/// movement. Time constants that are equal but for rounding keep the response curves; gradients by other ones are those of
/// equal ones, to rounding.
#[test]
fn conditions_that_a_batch_cannot_share_are_refused() {
    let none = Conditions::default;
    let refused = |model: &Arc<Model>, conditions: &[Conditions]| {
        let conditions = BatchConditions::each(model.primitive(), conditions);
        let made = conditions.and_then(|one| batch(model.primitive(), one, grid(0.01, 1.0), &mut |_| Ok(())));
        made.unwrap_err().argument().map(str::to_string)
    };
    let velocity = Conditions { velocity: Some(vec![0.0; 3]), ..none() };
    assert_eq!(refused(&REACH, &[velocity, none()]).as_deref(), Some("velocity"));
    let phase = Conditions { phase: Some(1.0), ..none() };
    assert_eq!(refused(&REACH, &[phase, none()]).as_deref(), Some("phase"));
    let warped = Conditions { segment_durations: Some(vec![0.5, 0.5]), ..none() };
    assert_eq!(refused(&REACH, &[warped]).as_deref(), Some("segment_durations"));
    let tau = |tau: f64| Conditions { tau: Some(tau), ..none() };
    assert_eq!(refused(&REACH, &[tau(1.0), tau(-1.0)]).as_deref(), Some("tau"));
    let gradient = |second: f64| {
        let conditions = BatchConditions::each(REACH.primitive(), &[tau(REACH.tau()), tau(second)]).unwrap();
        let batch = batch(REACH.primitive(), conditions, grid(0.01, 1.0), &mut |_| Ok(())).unwrap();
        let cotangents = Array3::ones(batch.shape());
        let found =
            batch.vector_jacobian(0..2, &[WithRespectTo::Goal], &[cotangents.view()], Threads::ONE, &mut |_| Ok(()));
        found.unwrap()[0].row(1).to_owned()
    };
    let [equal, near] = [1e-12, 2e-9].map(|difference| gradient(REACH.tau() * (1.0 + difference)));
    assert!(equal != near && equal.iter().zip(&near).all(|(a, b)| (a - b).abs() < 1e-6 * a.abs()));
}

/// Invalid conditions are rejected with the name of the argument and its numbers.
#[test]
fn invalid_batches_are_rejected() {
    let valid = || BatchConditions { style: one_each(Array2::zeros((4, 2))), ..Default::default() };
    let error_of = |model: &Arc<Model>, conditions| {
        batch(model.primitive(), conditions, grid(0.1, 1.0), &mut |_| Ok(())).unwrap_err().to_string()
    };
    let mut nan = Array2::zeros((4, 3));
    nan[[2, 1]] = f64::NAN;
    for (conditions, message) in [
        (BatchConditions { style: one_each(Array2::zeros((4, 3))), ..valid() }, "style has length 3, expected 2"),
        (BatchConditions { style: one_each(array![[0.0, 1e101]]), ..valid() }, "style[0, 1] = 1e101"),
        (BatchConditions { goal: one_each(Array2::zeros((3, 3))), ..valid() }, "goal has 3 rows, but there are 4"),
        (BatchConditions { start: one_each(Array2::zeros((4, 2))), ..valid() }, "start has length 2, expected 3"),
        (BatchConditions { velocity: one_each(nan), ..valid() }, "velocity[2, 1] = NaN"),
        (
            BatchConditions { velocity: Some(PerMovement::All(vec![0.0; 4])), ..valid() },
            "velocity has length 4, expected 3",
        ),
        (
            BatchConditions { anchor: Some(PerMovement::All(vec![0.0; 3])), ..valid() },
            "anchor does not apply to a discrete",
        ),
        (BatchConditions { amplitude: Some(2.0.into()), ..valid() }, "amplitude does not apply"),
        (BatchConditions { tau: Some((-1.0).into()), ..valid() }, "tau = -1"),
    ] {
        let found = error_of(&REACH, conditions);
        assert!(found.starts_with(message), "{found}");
    }
    let goal = Some(PerMovement::All(vec![0.0; 2]));
    assert!(error_of(&CYCLE, BatchConditions { goal, ..valid() }).ends_with("it moves about an anchor; set anchor"));
    let batch = batch(REACH.primitive(), valid(), grid(0.1, 1.0), &mut |_| Ok(())).unwrap();
    assert!(matches!(batch.chunks(0), Err(Error::Range { name: "size", .. })));
    let (mut narrow, mut valid) = (Array3::zeros((4, 11, 2)), Array3::zeros((4, 11, 3)));
    for (movements, output, argument) in [(0..4, narrow.view_mut(), "outputs"), (1..5, valid.view_mut(), "movements")] {
        let error = batch.write(movements, vec![output], Threads::ONE, &mut |_| Ok(())).unwrap_err();
        assert_eq!(error.argument(), Some(argument));
    }
}

/// Conditions at the limits of their ranges give finite movements.
#[test]
fn extreme_batches_are_finite() {
    for model in [&*REACH, &*CYCLE] {
        let huge = Some(PerMovement::All(vec![1e150; model.n_dofs()]));
        let conditions = BatchConditions {
            style: one_each(array![[1e100, -1e100], [0.0, 0.0]]),
            start: huge.clone(),
            velocity: huge,
            amplitude: (model.kind() == Kind::Rhythmic).then(|| 1e150.into()),
            ..Default::default()
        };
        assert!(all(&conditions, model, grid(0.01, 2.0)).iter().flatten().all(|x| x.is_finite()));
    }
    let none = BatchConditions { style: one_each(Array2::zeros((0, 2))), ..Default::default() };
    assert_eq!(all(&none, &REACH, grid(0.1, 1.0)).position.dim(), (0, 11, 3));
}
