//! Vector-Jacobian products of movements with rotations agree with differences of rollouts.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/poses.rs"]
mod poses;
#[path = "common/random.rs"]
mod random;

use std::sync::{Arc, LazyLock};

use common::*;
use ndarray::{Array2, Array3, ArrayView3, Axis, concatenate, s};
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::inference::{At, PassageOptions, ViaPoint, through};
use pdmp_core::learning::{TimeScaling, Truncation};
use pdmp_core::model::{Derivative, Frame, TimeWarp};
use pdmp_core::motion::{Batch, BatchConditions, TimeGrid, WithRespectTo, batch};
use pdmp_core::numerics::Threads;
use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, Model, Sampling, fit, rollout};
use poses::*;
use random::Random;

const FIRST: RotationColumns = RotationColumns { column: 0, order: QuaternionOrder::Xyzw };
const SECOND: RotationColumns = RotationColumns { column: 6, order: QuaternionOrder::Wxyz };

fn demonstration(position: Array2<f64>) -> Demonstration {
    let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap();
    demo.with_rotations(vec![FIRST, SECOND]).unwrap()
}

/// Demonstrations of a rotation x, y, z, w, two coordinates, and a rotation w, x, y, z.
fn two_rotations() -> Vec<Demonstration> {
    let own = |seed, angle| screws(5, angle, 0.5, 101, seed);
    let pairs = own(3, 4.7).into_iter().zip(own(4, 1.5));
    pairs
        .map(|(a, b)| {
            let order = [4, 5, 6, 3].map(|column| a.slice(s![.., column..=column]));
            let [x, y, z, w] = order;
            concatenate![Axis(1), x, y, z, w, a.slice(s![.., ..2]), b.slice(s![.., 3..])]
        })
        .map(demonstration)
        .collect()
}

/// Demonstrations of a rotation x, y, z, w that turns once a cycle, two coordinates, and a rotation that returns.
fn two_turns() -> Vec<Demonstration> {
    let pairs = wobbles(5, 1.0, 120).into_iter().zip(wobbles(5, 0.0, 120));
    pairs
        .map(|(a, b)| {
            let [x, y, z, w] = [1, 2, 3, 0].map(|column| a.slice(s![.., column..=column]));
            concatenate![Axis(1), x, y, z, w, b.slice(s![.., ..2]), b]
        })
        .map(demonstration)
        .collect()
}

fn learnt(demos: &[Demonstration], options: FitOptions) -> Arc<Model> {
    Arc::new(fit(demos, &options.n_styles(Truncation::Rank(2))).unwrap())
}

static TWO: LazyLock<Arc<Model>> = LazyLock::new(|| learnt(&two_rotations(), FitOptions::discrete()));
static TURNS: LazyLock<Arc<Model>> = LazyLock::new(|| learnt(&two_turns(), FitOptions::rhythmic()));

/// Both kinds, in both frames, and in warped time.
fn models() -> Vec<Arc<Model>> {
    let warp = || TimeScaling::Warp(TimeWarp::default());
    let world = |model: &Arc<Model>| Arc::new(model.in_frame(Frame::World).unwrap());
    vec![
        TWO.clone(),
        TURNS.clone(),
        world(&TWO),
        world(&TURNS),
        world(&learnt(&two_rotations(), FitOptions::discrete().time_scaling(warp()))),
        learnt(&two_turns(), FitOptions::rhythmic().time_scaling(warp())),
    ]
}

fn numbers(n: usize, size: f64, random: &mut Random) -> Vec<f64> {
    (0..n).map(|_| random.between(-size, size)).collect()
}

/// A place with rotations anywhere.
fn place(random: &mut Random) -> Vec<f64> {
    let [w, x, y, z] = random_rotation(random);
    let plain = numbers(2, 0.5, random);
    [x, y, z, w].into_iter().chain(plain).chain(random_rotation(random)).collect()
}

fn prepared(model: &Model, movements: &[Conditions], grid: TimeGrid) -> Batch {
    let conditions = BatchConditions::each(model.primitive(), movements).unwrap();
    batch(model.primitive(), conditions, grid, &mut |_| Ok(())).unwrap()
}

/// Cotangents of the orders of a batch.
fn cotangents(batch: &Batch, n_orders: usize, random: &mut Random) -> Vec<Array3<f64>> {
    let (n, samples, n_dofs) = batch.shape();
    let columns = [n_dofs + 2, n_dofs, n_dofs];
    let array = |&columns: &usize| Array3::from_shape_simple_fn((n, samples, columns), || random.between(-1.0, 1.0));
    columns[..n_orders].iter().map(array).collect()
}

fn gradients(batch: &Batch, variables: &[WithRespectTo], cotangents: &[Array3<f64>]) -> Vec<Array2<f64>> {
    let views: Vec<ArrayView3<f64>> = cotangents.iter().map(|array| array.view()).collect();
    batch.vector_jacobian(0..batch.shape().0, variables, &views, Threads::ONE, &mut |_| Ok(())).unwrap()
}

/// Product of the cotangents of movement `b` with its rollout, and the sum of the sizes of its terms.
fn cost(model: &Model, b: usize, conditions: &Conditions, grid: TimeGrid, cotangents: &[Array3<f64>]) -> [f64; 2] {
    let moved = rollout(model.primitive(), conditions, grid).unwrap();
    let orders = [&moved.position, &moved.velocity, &moved.acceleration];
    let products = cotangents.iter().zip(orders).map(|(v, y)| &v.index_axis(Axis(0), b) * y);
    products.fold([0.0; 2], |[sum, size], terms| [sum + terms.sum(), size + terms.mapv(f64::abs).sum()])
}

/// Returns the condition of a variable as a vector.
fn condition(variable: WithRespectTo, conditions: &mut Conditions) -> Option<&mut [f64]> {
    let Conditions { style, goal, anchor, start, velocity, goal_velocity, amplitude, tau, .. } = conditions;
    match variable {
        WithRespectTo::Style => style.as_deref_mut(),
        WithRespectTo::Goal => goal.as_deref_mut(),
        WithRespectTo::Anchor => anchor.as_deref_mut(),
        WithRespectTo::Start => start.as_deref_mut(),
        WithRespectTo::Velocity => velocity.as_deref_mut(),
        WithRespectTo::GoalVelocity => goal_velocity.as_deref_mut(),
        WithRespectTo::Amplitude => amplitude.as_mut().map(std::slice::from_mut),
        WithRespectTo::Tau => tau.as_mut().map(std::slice::from_mut),
    }
}

const VARIABLES: [WithRespectTo; 8] = [
    WithRespectTo::Style,
    WithRespectTo::Goal,
    WithRespectTo::Anchor,
    WithRespectTo::Start,
    WithRespectTo::Velocity,
    WithRespectTo::GoalVelocity,
    WithRespectTo::Amplitude,
    WithRespectTo::Tau,
];

/// Gradients by every condition, alone and with others, of movements that share responses and of those that do not, are
/// differences of rollouts.
#[test]
fn gradients_are_differences_of_rollouts() {
    let random = &mut Random(3);
    let (mut compared, mut worst) = ([0; 8], [0.0f64; 8]);
    for (case, model) in models().iter().enumerate() {
        let (n_dofs, discrete, warped) = (model.n_dofs(), model.kind() == Kind::Discrete, model.breaks().len() > 2);
        let points = [ViaPoint::new(At::Time(0.4 * model.duration()), place(random))];
        let passage = through(model, &points, &Conditions::default(), &PassageOptions::default()).unwrap();
        for given in 0..16usize {
            let (has, n_orders) = (|bit: usize| given >> bit & 1 == 1, 1 + given % 3);
            let own_time = given % 5 < 2;
            let has_start = has(0) || !discrete && has(1);
            let movement = |b: usize, random: &mut Random| Conditions {
                style: Some(numbers(2, 0.5, random)),
                goal: (discrete && has(2)).then(|| place(random)),
                anchor: (!discrete && has(2)).then(|| place(random)),
                start: has_start.then(|| place(random)),
                velocity: has(1).then(|| numbers(n_dofs, 2.0, random)),
                goal_velocity: (discrete && has(3)).then(|| numbers(n_dofs, 2.0, random)),
                amplitude: (!discrete).then(|| random.between(0.4, 2.0)),
                tau: (!warped).then(|| model.tau() * if own_time { 0.7137 + 0.3 * b as f64 } else { 1.1137 }),
                segment_durations: warped.then(|| {
                    let durations = model.demonstrated().segment_durations.row(b).to_vec();
                    durations.into_iter().map(|seconds| seconds * random.between(0.7, 1.4)).collect()
                }),
                phase: (!discrete && !warped && own_time).then_some(1.7 * b as f64),
                forcing: passage.conditions.forcing.clone().filter(|_| given % 4 > 1),
            };
            let movements: Vec<Conditions> = (0..2).map(|b| movement(b, random)).collect();
            let grid = grid(0.03, 1.35 * model.duration());
            let batch = prepared(model, &movements, grid);
            let cotangents = cotangents(&batch, n_orders, random);
            let mut one = movements[0].clone();
            let variables: Vec<_> = VARIABLES
                .into_iter()
                .filter(|&variable| condition(variable, &mut one).is_some())
                .filter(|&variable| variable != WithRespectTo::Tau || n_orders < 3)
                .collect();
            let found = gradients(&batch, &variables, &cotangents);
            for (variable, found) in variables.iter().zip(found) {
                for ((b, column), found) in found.indexed_iter() {
                    let [_, size] = cost(model, b, &movements[b], grid, &cotangents);
                    let moved = |step: f64| {
                        let mut moved = movements[b].clone();
                        condition(*variable, &mut moved).unwrap()[column] += step;
                        cost(model, b, &moved, grid, &cotangents)[0]
                    };
                    let slope = |step: f64| (moved(step) - moved(-step)) / (2.0 * step);
                    // A movement has no third derivative by time at the knots of its forcing.
                    let (expected, tolerance) = match variable {
                        WithRespectTo::Tau => (slope(1e-6), 1e-6),
                        _ => ((4.0 * slope(2e-4) - slope(4e-4)) / 3.0, 1e-9),
                    };
                    let error = (found - expected).abs() / (size + expected.abs());
                    assert!(
                        error < tolerance,
                        "{case} {given} {variable:?} {b} {column}: {found} {expected} {error:e}"
                    );
                    let index = *variable as usize;
                    (compared[index], worst[index]) = (compared[index] + 1, worst[index].max(error));
                }
            }
        }
    }
    println!("{compared:?} {worst:?}");
    assert!(compared.iter().all(|&n| n > 20), "{compared:?}");
}

/// Cotangents along a quaternion have no effect, and gradients by a quaternion are orthogonal to it.
#[test]
fn quaternions_have_no_gradient_along_themselves() {
    let random = &mut Random(5);
    for model in models() {
        let place = place(random);
        let discrete = model.kind() == Kind::Discrete;
        let centre = if discrete { WithRespectTo::Goal } else { WithRespectTo::Anchor };
        let conditions = Conditions {
            goal: discrete.then(|| place.clone()),
            anchor: (!discrete).then(|| place.clone()),
            start: Some(place.clone()),
            ..Conditions::default()
        };
        let batch = prepared(&model, &[conditions], grid(0.02, model.duration()));
        let mut along = batch.rollouts(0..1, Derivative::Position, Threads::ONE, &mut |_| Ok(())).unwrap().position;
        along.slice_mut(s![.., .., 4..6]).fill(0.0);
        let variables = [WithRespectTo::Style, centre, WithRespectTo::Start];
        for gradient in gradients(&batch, &variables, &[along]) {
            assert!(gradient.iter().all(|x| x.abs() < 1e-12), "{gradient:?}");
        }
        for gradient in &gradients(&batch, &variables[1..], &cotangents(&batch, 3, random)) {
            let size = gradient.fold(0.0f64, |size, x| size.max(x.abs()));
            for column in [0, 6] {
                let product: f64 = (column..column + 4).map(|i| gradient[[0, i]] * place[i]).sum();
                assert!(size > 1.0 && product.abs() < 1e-14 * size, "{product:e} {size}");
            }
        }
    }
}

/// Gradients turn with the frames: those of a model learnt in another world and with another tool.
#[test]
fn gradients_turn_with_the_frames() {
    let random = &mut Random(11);
    let recorded = screws(5, 4.7, 0.5, 101, 20);
    let (world, tool) = (random_rotation(random), random_rotation(random));
    let turned: Vec<_> = recorded.iter().map(|one| in_frames(one, world, tool, random)).collect();
    let [own, other] = [recorded, turned]
        .map(|poses| learnt(&poses.into_iter().map(pose).collect::<Vec<_>>(), FitOptions::discrete()));
    let convert = |position: &[f64]| in_frame(position, world, tool);
    let turn = |velocity: &[f64]| {
        let parts: [[f64; 3]; 2] = std::array::from_fn(|k| std::array::from_fn(|i| velocity[3 * k + i]));
        [apply(matrix(world), parts[0]), apply(matrix(back(tool)), parts[1])].concat()
    };
    let pose = |random: &mut Random| [numbers(3, 0.5, random), random_rotation(random).to_vec()].concat();
    let conditions = Conditions {
        goal: Some(pose(random)),
        start: Some(pose(random)),
        velocity: Some(numbers(6, 1.0, random)),
        goal_velocity: Some(numbers(6, 1.0, random)),
        tau: Some(1.1 * own.tau()),
        ..own.conditions(&[2]).unwrap()
    };
    let conditions = Conditions { segment_durations: None, ..conditions };
    let moved = Conditions {
        style: other.conditions(&[2]).unwrap().style,
        goal: conditions.goal.as_deref().map(convert),
        start: conditions.start.as_deref().map(convert),
        velocity: conditions.velocity.as_deref().map(turn),
        goal_velocity: conditions.goal_velocity.as_deref().map(turn),
        ..conditions.clone()
    };
    let grid = grid(0.02, 1.3);
    let [own, other] = [(&own, conditions), (&other, moved)].map(|(model, one)| prepared(model, &[one], grid));
    let (_, n_samples, _) = own.shape();
    let cotangents = [7, 6, 6].map(|n| Array3::from_shape_simple_fn((1, n_samples, n), || random.between(-1.0, 1.0)));
    let mut turned = cotangents.clone();
    // A movement and its converted one may have quaternions of other signs.
    let starts = [&own, &other].map(|batch| {
        let movement = batch.rollouts(0..1, Derivative::Position, Threads::ONE, &mut |_| Ok(())).unwrap();
        movement.position.index_axis(Axis(0), 0).row(0).to_vec()
    });
    let sign = convert(&starts[0])[3..].iter().zip(&starts[1][3..]).map(|(a, b)| a * b).sum::<f64>().signum();
    for k in 0..n_samples {
        for (from, to) in cotangents.iter().zip(&mut turned) {
            let from = from.slice(s![0, k, ..]).to_vec();
            let mut row = if from.len() == 7 { convert(&from) } else { turn(&from) };
            row[3..].iter_mut().filter(|_| from.len() == 7).for_each(|x| *x *= sign);
            to.slice_mut(s![0, k, ..]).assign(&ndarray::aview1(&row));
        }
    }
    let variables = [WithRespectTo::Goal, WithRespectTo::Start, WithRespectTo::Velocity, WithRespectTo::GoalVelocity];
    let found = gradients(&own, &variables, &cotangents);
    for (own, other) in found.iter().zip(gradients(&other, &variables, &turned)) {
        let own = own.row(0).to_vec();
        let expected = if own.len() == 7 { convert(&own) } else { turn(&own) };
        let size = expected.iter().fold(1.0f64, |size, x| size.max(x.abs()));
        assert!(other.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-8 * size), "{other} {expected:?}");
    }
    let by_tau = [(&own, &cotangents), (&other, &turned)]
        .map(|(batch, cotangents)| gradients(batch, &[WithRespectTo::Tau], &cotangents[..2])[0][[0, 0]]);
    assert!((by_tau[0] - by_tau[1]).abs() < 1e-8 * by_tau[0].abs(), "{by_tau:?}");
}

/// Gradients do not depend on the division into ranges and threads, and those by conditions of the nominal demonstration are
/// those by its values.
#[test]
fn gradients_are_those_of_each_movement() {
    let random = &mut Random(13);
    for model in models() {
        for own_time in [false, true] {
            let discrete = model.kind() == Kind::Discrete;
            let movement = |b: usize| Conditions {
                tau: (model.breaks().len() == 2).then(|| model.tau() * if own_time { 1.0 + b as f64 } else { 1.1 }),
                ..Conditions::default()
            };
            let movements: Vec<_> = (0..3).map(movement).collect();
            let batch = prepared(&model, &movements, grid(0.05, 1.0));
            let cotangents = cotangents(&batch, 2, random);
            let variables = match discrete {
                true => vec![WithRespectTo::Goal, WithRespectTo::Start],
                false => vec![WithRespectTo::Anchor, WithRespectTo::Amplitude],
            };
            let all = gradients(&batch, &variables, &cotangents);
            let views: Vec<_> = cotangents.iter().map(|array| array.slice(s![1.., .., ..])).collect();
            let threads = Threads::new(2).unwrap();
            let last = batch.vector_jacobian(1..3, &variables, &views, threads, &mut |_| Ok(())).unwrap();
            for (last, all) in last.iter().zip(&all) {
                assert_eq!(last, all.slice(s![1.., ..]));
            }
            // A condition of one movement lets all have the nominal values.
            let mut movements = movements;
            let nominal = rollout(model.primitive(), &movements[0], grid(0.05, 0.0)).unwrap().position;
            if discrete {
                movements[0].start = Some(nominal.row(0).to_vec());
                let given = gradients(&prepared(&model, &movements, grid(0.05, 1.0)), &variables, &cotangents);
                for (given, all) in given.iter().zip(&all) {
                    assert!((given - all).iter().all(|x| x.abs() < 1e-9), "{given} {all}");
                }
            }
        }
    }
}

/// Errors name the argument.
#[test]
fn invalid_products_are_rejected() {
    let batch = prepared(&TWO, &[Conditions::default()], grid(0.05, 1.0));
    let valid = cotangents(&batch, 3, &mut Random(3));
    let refused = |variable, cotangents: &[&Array3<f64>]| {
        let views: Vec<_> = cotangents.iter().map(|array| array.view()).collect();
        let result = batch.vector_jacobian(0..1, &[variable], &views, Threads::ONE, &mut |_| Ok(()));
        result.unwrap_err().argument().map(str::to_string)
    };
    let [positions, velocities, accelerations] = &valid[..] else { panic!("three orders") };
    assert_eq!(refused(WithRespectTo::Style, &[velocities]).as_deref(), Some("cotangents"));
    assert_eq!(refused(WithRespectTo::Style, &[positions, positions]).as_deref(), Some("cotangents"));
    assert_eq!(
        refused(WithRespectTo::Style, &[positions, velocities, velocities, velocities]).as_deref(),
        Some("cotangents")
    );
    assert_eq!(refused(WithRespectTo::Velocity, &[positions]).as_deref(), Some("velocity"));
    assert_eq!(refused(WithRespectTo::Tau, &[positions, velocities, accelerations]).as_deref(), Some("tau"));
    let mut bad = positions.clone();
    bad[[0, 3, 1]] = f64::NAN;
    assert_eq!(refused(WithRespectTo::Goal, &[&bad]).as_deref(), Some("cotangents"));
}
