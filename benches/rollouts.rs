//! Time of rollouts, batches and Jacobians; `step.rs` measures one tick, `stages.rs` a fit.
#![allow(missing_docs)]

mod movements;

use std::sync::Arc;

use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, criterion_group, criterion_main};
use movements::movements;
use ndarray::{Array2, Array3};
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::learning::Truncation;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::model::Derivative;
use pdmp_core::motion::batch;
use pdmp_core::motion::jacobian;
use pdmp_core::motion::{Batch, BatchConditions, PerMovement, TimeGrid, WithRespectTo};
use pdmp_core::numerics::Threads;
use pdmp_core::rollout;
use pdmp_core::{Conditions, Demonstration, FitOptions, Model, Sampling, fit};

fn learn(n_styles: usize) -> Arc<Model> {
    let options = FitOptions::discrete().n_styles(Truncation::Rank(n_styles)).basis(Basis::NGnet(NGnet::default()));
    Arc::new(fit(&movements(40, 1001), &options).expect("a fit"))
}

/// Measures rollouts with accelerations, and their gradients by all variables and by those but the last, τ.
fn with_accelerations(
    group: &mut BenchmarkGroup<WallTime>,
    n: &str,
    timing: &str,
    batch: &Batch,
    variables: &[WithRespectTo],
) {
    let mut outputs = [(); 3].map(|()| Array3::zeros(batch.shape()));
    let cotangents = [(); 3].map(|()| Array3::from_elem(batch.shape(), 0.5));
    let cotangents = cotangents.each_ref().map(|array| array.view());
    let all = 0..batch.shape().0;
    group.bench_function(format!("{n} rollouts with accelerations{timing}"), |bench| {
        bench.iter(|| {
            let outputs = outputs.each_mut().map(|output| output.view_mut());
            batch.write(all.clone(), outputs.into(), Threads::ONE, &mut |_| Ok(()))
        });
    });
    for (name, variables) in [("", &variables[..variables.len() - 1]), (" and tau", variables)] {
        let name = format!("{n} gradients with accelerations by style, goal, start{name}{timing}");
        group.bench_function(name, |bench| {
            bench.iter(|| batch.vector_jacobian(all.clone(), variables, &cotangents, Threads::ONE, &mut |_| Ok(())));
        });
    }
}

fn rollouts(criterion: &mut Criterion) {
    let grid = TimeGrid { dt: 1e-3, duration: None };
    let model = learn(3);
    let mut group = criterion.benchmark_group("1 s at 1 kHz, D=7");
    group.sample_size(20);
    group.bench_function("rollout", |bench| bench.iter(|| rollout(model.primitive(), &Conditions::default(), grid)));
    for n_styles in [3, 35] {
        let model = learn(n_styles);
        let styles = Array2::from_shape_fn((1000, n_styles), |(b, j)| (b + j) as f64 / 1000.0);
        let conditions = BatchConditions { style: Some(PerMovement::Each(styles)), ..BatchConditions::default() };
        let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(())).expect("a batch");
        let mut outputs = [(); 2].map(|()| Array3::zeros(batch.shape()));
        let cotangents = [(); 2].map(|()| Array3::from_elem(batch.shape(), 0.5));
        let cotangents = cotangents.each_ref().map(|array| array.view());
        let variables = [WithRespectTo::Style, WithRespectTo::Goal, WithRespectTo::Start, WithRespectTo::Tau];
        for (name, variables) in [("", &variables[..3]), (" and tau", &variables[..])] {
            let name = format!("1000 gradients of positions and velocities by style, goal, start{name}, J={n_styles}");
            group.bench_function(name, |bench| {
                bench.iter(|| batch.vector_jacobian(0..1000, variables, &cotangents, Threads::ONE, &mut |_| Ok(())));
            });
        }
        if n_styles == 3 {
            with_accelerations(&mut group, "1000", "", &batch, &variables);
        }
        for n_threads in [1, 2] {
            let threads = Threads::new(n_threads).expect("some");
            group.bench_function(
                format!("1000 rollouts with velocities, J={n_styles}, threads={n_threads}"),
                |bench| {
                    bench.iter(|| {
                        let outputs = outputs.each_mut().map(|output| output.view_mut());
                        batch.write(0..1000, outputs.into(), threads, &mut |_| Ok(()))
                    });
                },
            );
        }
    }
    // Movements that differ in τ, and so have no response curves in common.
    let (n, taus) = (100, |b: usize| model.tau() * (0.8 + 0.004 * b as f64));
    let styles = Array2::from_shape_fn((n, 3), |(b, j)| (b + j) as f64 / n as f64);
    let conditions = BatchConditions {
        style: Some(PerMovement::Each(styles)),
        tau: Some(PerMovement::Each(Array2::from_shape_fn((n, 1), |(b, _)| taus(b)))),
        ..BatchConditions::default()
    };
    let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(())).expect("a batch");
    let mut outputs = [(); 2].map(|()| Array3::zeros(batch.shape()));
    let cotangents = [(); 2].map(|()| Array3::from_elem(batch.shape(), 0.5));
    let cotangents = cotangents.each_ref().map(|array| array.view());
    group.bench_function("100 rollouts with velocities, each with its tau", |bench| {
        bench.iter(|| {
            let outputs = outputs.each_mut().map(|output| output.view_mut());
            batch.write(0..n, outputs.into(), Threads::ONE, &mut |_| Ok(()))
        });
    });
    let variables = [WithRespectTo::Style, WithRespectTo::Goal, WithRespectTo::Start, WithRespectTo::Tau];
    for (name, variables) in [("", &variables[..3]), (" and tau", &variables[..])] {
        let name = format!("100 gradients by style, goal, start{name}, each with its tau");
        group.bench_function(name, |bench| {
            bench.iter(|| batch.vector_jacobian(0..n, variables, &cotangents, Threads::ONE, &mut |_| Ok(())));
        });
    }
    with_accelerations(&mut group, "100", ", each with its tau", &batch, &variables);
    poses(&mut group);
    let jacobian = |model: &Arc<Model>| {
        let (variable, derivative) = (WithRespectTo::Style, Derivative::Position);
        jacobian(model.primitive(), variable, derivative, &Conditions::default(), grid, &mut |_| Ok(()))
    };
    group.bench_function("style Jacobian", |bench| bench.iter(|| jacobian(&model)));
    group.bench_function("style Jacobian without cached responses", |bench| {
        bench.iter_batched(|| Arc::new(Model::clone(&model)), |model| jacobian(&model), BatchSize::SmallInput);
    });
    group.finish();
}

/// Batches of a pose, and of a pose each with its τ.
fn poses(group: &mut BenchmarkGroup<WallTime>) {
    let options = FitOptions::discrete().n_styles(Truncation::Rank(3)).basis(Basis::NGnet(NGnet::default()));
    let model = fit(&movements(40, 1001).iter().map(pose).collect::<Vec<_>>(), &options).expect("a fit");
    let vectors = |n, columns| Array2::from_shape_fn((n, columns), |(b, j)| (b + j) as f64 / n as f64);
    let variables = [WithRespectTo::Style, WithRespectTo::Goal, WithRespectTo::Start, WithRespectTo::Tau];
    for (n, kind) in [(1000, "poses"), (100, "poses, each with its tau")] {
        let own = Array2::from_shape_fn((n, 1), |(b, _)| model.tau() * (0.8 + 0.004 * b as f64));
        let conditions = BatchConditions {
            style: Some(PerMovement::Each(vectors(n, 3))),
            tau: (n == 100).then_some(PerMovement::Each(own)),
            ..BatchConditions::default()
        };
        let grid = TimeGrid { dt: 1e-3, duration: Some(1.0) };
        let batch = batch(model.primitive(), conditions, grid, &mut |_| Ok(())).expect("a batch");
        let new = |order: Derivative| Array3::from_elem((n, batch.shape().1, batch.n_columns(order)), 0.5);
        let mut outputs = Derivative::ALL.map(new);
        let cotangents = Derivative::ALL.map(new);
        for n_orders in 1..=3 {
            let suffix = ["", " with velocities", " with velocities and accelerations"][n_orders - 1];
            group.bench_function(format!("{n} {kind}, rollouts{suffix}"), |bench| {
                bench.iter(|| {
                    let outputs = outputs.iter_mut().take(n_orders).map(|output| output.view_mut()).collect();
                    batch.write(0..n, outputs, Threads::ONE, &mut |_| Ok(()))
                });
            });
            let views: Vec<_> = cotangents.iter().take(n_orders).map(|array| array.view()).collect();
            for (name, variables) in [("", &variables[..3]), (" and tau", &variables[..])] {
                if n_orders == 3 && variables.len() == 4 {
                    continue;
                }
                group.bench_function(format!("{n} {kind}, gradients by style, goal, start{name}{suffix}"), |bench| {
                    bench.iter(|| batch.vector_jacobian(0..n, variables, &views, Threads::ONE, &mut |_| Ok(())));
                });
            }
        }
    }
}

/// Returns a movement whose last four columns are a unit quaternion.
fn pose(movement: &Demonstration) -> Demonstration {
    let position = movement.position();
    let rotated = Array2::from_shape_fn((position.nrows(), 7), |(c, d)| {
        let vector: [f64; 3] = std::array::from_fn(|i| 0.3 * position[[c, 3 + i]]);
        let angle = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        match d {
            0..3 => position[[c, d]],
            3 => (0.5 * angle).cos(),
            _ => vector[d - 4] * if angle > 0.0 { (0.5 * angle).sin() / angle } else { 0.5 },
        }
    });
    let rotations = vec![RotationColumns { column: 3, order: QuaternionOrder::Wxyz }];
    let demo = Demonstration::new(rotated, Sampling::Uniform { dt: 1e-3 }).expect("finite");
    demo.with_rotations(rotations).expect("unit quaternions")
}

criterion_group!(benches, rollouts);
criterion_main!(benches);
