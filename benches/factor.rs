//! Time of the factorisation for few and for many demonstrations, by rank and by share of the singular values.
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use pdmp_core::learning::{Factors, Truncation};

/// Returns targets whose singular values decay by a factor of 0.9 down to noise.
fn targets(rows: usize, columns: usize) -> Array2<f64> {
    let wave = |i: usize, k: usize| (0.37 + (i + 1) as f64 * (k + 1) as f64 * 0.618).sin();
    let left = Array2::from_shape_fn((rows, 40), |(i, k)| wave(i, k) * 0.9f64.powi(k as i32));
    let right = Array2::from_shape_fn((40, columns), |(k, j)| wave(j, k));
    let mut state = 1u64;
    let mut noisy = left.dot(&right);
    noisy.mapv_inplace(|x| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        x + 1e-4 * (state >> 32) as f64 / 2f64.powi(32)
    });
    noisy
}

fn factorisations(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("factor");
    for (rows, columns, styles, samples) in [
        (20, 28_000, Truncation::Rank(20), 100),
        (20, 28_000, Truncation::Share(0.9), 100),
        (1000, 40_000, Truncation::Rank(5), 10),
        (1000, 40_000, Truncation::Share(0.9), 10),
        (5000, 1400, Truncation::Rank(5), 10),
        (5000, 1400, Truncation::Share(0.9), 10),
    ] {
        let targets = targets(rows, columns);
        group.sample_size(samples).bench_function(format!("{rows} x {columns} {styles:?}"), |bench| {
            bench.iter(|| Factors::of(targets.view(), styles, &mut |_| Ok(())));
        });
    }
    group.finish();
}

criterion_group!(benches, factorisations);
criterion_main!(benches);
