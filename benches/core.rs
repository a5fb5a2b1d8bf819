//! Time of fits, regressions and rollouts; `step.rs` measures one tick.
#![allow(missing_docs)]

mod movements;

use std::f64::consts::PI;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use movements::movements;
use ndarray::{Array2, Array3};
use pdmp_core::learning::Truncation;
use pdmp_core::learning::regression::{Basis, Domain, Gp, Kernel, NGnet};
use pdmp_core::model::Derivative;
use pdmp_core::motion::batch;
use pdmp_core::motion::jacobian;
use pdmp_core::motion::{BatchConditions, PerMovement, TimeGrid, WithRespectTo};
use pdmp_core::numerics::{Smoothing, Threads};
use pdmp_core::rollout;
use pdmp_core::{Conditions, FitOptions, Kind, Model, fit};

fn options(basis: Basis, smoothing: Smoothing) -> FitOptions {
    let mut options = FitOptions::new(Kind::Discrete).n_styles(Truncation::Rank(3)).basis(basis);
    options.smoothing = smoothing;
    options
}

fn learn(n_styles: usize) -> Arc<Model> {
    let options = options(Basis::NGnet(NGnet::default()), Smoothing::Interpolate);
    let options = options.n_styles(Truncation::Rank(n_styles));
    Arc::new(fit(&movements(40, 1001), &options).expect("a fit"))
}

fn fits(criterion: &mut Criterion) {
    let demos = movements(20, 1001);
    let mut group = criterion.benchmark_group("fit M=20 C=1001 D=7 J=3");
    group.sample_size(10);
    for (name, basis, smoothing) in [
        ("ngnet", Basis::NGnet(NGnet::default()), Smoothing::Interpolate),
        ("ngnet, auto smoothing", Basis::NGnet(NGnet::default()), Smoothing::Auto),
        ("gp", Basis::Gp(Gp::default()), Smoothing::Interpolate),
    ] {
        let options = options(basis, smoothing);
        group.bench_function(name, |bench| bench.iter(|| fit(&demos, &options)));
    }
    group.finish();
}

/// Returns C samples of P smooth outputs over [0, 1].
fn targets(n_samples: usize, n_outputs: usize) -> (Vec<f64>, Array2<f64>) {
    let u: Vec<f64> = (0..n_samples).map(|i| i as f64 / (n_samples - 1) as f64).collect();
    let targets = Array2::from_shape_fn((n_samples, n_outputs), |(i, o)| {
        let (phase, o) = (2.0 * PI * u[i], o as f64);
        ((1.0 + 0.3 * o) * phase + 0.4 * o).sin().exp() / (1.0 + o)
    });
    (u, targets)
}

fn networks(criterion: &mut Criterion) {
    let domain = Domain::Interval { end: 1.0 };
    let mut group = criterion.benchmark_group("network");
    for (n_samples, n_outputs) in [(1001, 21), (16_000, 3)] {
        let (u, targets) = targets(n_samples, n_outputs);
        group.bench_function(format!("C={n_samples} P={n_outputs}"), |bench| {
            bench.iter(|| NGnet::default().regress(domain, &u, targets.view()));
        });
    }
    group.finish();
}

fn processes(criterion: &mut Criterion) {
    let domain = Domain::Interval { end: 1.0 };
    let mut group = criterion.benchmark_group("gaussian process");
    group.sample_size(10);
    for kernel in Kernel::ALL {
        for (n_samples, n_outputs) in [(1001, 21), (1000, 3), (4000, 3), (16_000, 3), (100_000, 3)] {
            let (u, targets) = targets(n_samples, n_outputs);
            for (source, length, noise) in [("given", Some(0.2), Some(1e-8)), ("estimated", None, None)] {
                let gp = Gp { kernel, length, noise };
                let name = format!("{kernel} C={n_samples} P={n_outputs}, hyperparameters {source}");
                group.bench_function(name, |bench| {
                    bench.iter(|| gp.regress(domain, &u, targets.view(), &mut |_| Ok(())));
                });
            }
        }
    }
    group.finish();
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

criterion_group!(benches, fits, networks, processes, rollouts);
criterion_main!(benches);
