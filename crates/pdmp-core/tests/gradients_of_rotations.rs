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
use pdmp_core::learning::{TimeScaling, Truncation};
use pdmp_core::model::{Frame, TimeWarp};
use pdmp_core::motion::{Batch, BatchConditions, PerMovement, TimeGrid, WithRespectTo, batch};
use pdmp_core::numerics::Threads;
use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, Model, Sampling, fit, rollout};
use poses::*;
use random::Random;

/// First columns of the rotations of [`TWO`].
const FIRST: RotationColumns = RotationColumns { column: 0, order: QuaternionOrder::Xyzw };
const SECOND: RotationColumns = RotationColumns { column: 6, order: QuaternionOrder::Wxyz };

fn demonstration(position: Array2<f64>) -> Demonstration {
    let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap();
    demo.with_rotations(vec![FIRST, SECOND]).unwrap()
}

/// Demonstrations of a rotation x, y, z, w, two coordinates, and a rotation w, x, y, z, at different speeds.
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
    let mut compared = [0; 8];
    for (case, model) in models().iter().enumerate() {
        let (n_dofs, discrete, warped) = (model.n_dofs(), model.kind() == Kind::Discrete, model.breaks().len() > 2);
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
                segment_durations: warped.then(|| model.demonstrated().segment_durations.row(b).to_vec()),
                phase: (!discrete && !warped && own_time).then_some(1.7 * b as f64),
                ..Conditions::default()
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
                    assert!(error < tolerance, "{case} {given} {variable:?} {b} {column}: {found} {expected} {error:e}");
                    compared[*variable as usize] += 1;
                }
            }
        }
    }
    println!("{compared:?}");
    assert!(compared.iter().all(|&n| n > 20), "{compared:?}");
}
