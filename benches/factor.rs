//! Times of the factorisation: few demonstrations, few styles of many, and the share of the spectrum of many.
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use pdmp_core::learning::{Factors, StyleCount};

/// A library whose singular values fall by a tenth from one to the next, down to noise.
fn library(rows: usize, columns: usize) -> Array2<f64> {
    let wave = |i: usize, k: usize| (0.37 + (i + 1) as f64 * (k + 1) as f64 * 0.618).sin();
    let left = Array2::from_shape_fn((rows, 40), |(i, k)| wave(i, k) * 0.9f64.powi(k as i32));
    let right = Array2::from_shape_fn((40, columns), |(k, j)| wave(j, k));
    let mut noise = 1u64;
    let mut noisy = left.dot(&right);
    noisy.mapv_inplace(|x| {
        noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        x + 1e-4 * (noise >> 32) as f64 / 2f64.powi(32)
    });
    noisy
}

fn factors(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("factor");
    for (rows, columns, styles, samples) in [
        (20, 28_000, StyleCount::Given(20), 100),
        (20, 28_000, StyleCount::Spectrum(0.9), 100),
        (1000, 40_000, StyleCount::Given(5), 10),
        (1000, 40_000, StyleCount::Spectrum(0.9), 10),
        (5000, 1400, StyleCount::Given(5), 10),
        (5000, 1400, StyleCount::Spectrum(0.9), 10),
    ] {
        let targets = library(rows, columns);
        group.sample_size(samples).bench_function(format!("{rows} x {columns} {styles:?}"), |bench| {
            bench.iter(|| Factors::of(targets.view(), styles, &mut |_| Ok(())));
        });
    }
    group.finish();
}

criterion_group!(benches, factors);
criterion_main!(benches);
