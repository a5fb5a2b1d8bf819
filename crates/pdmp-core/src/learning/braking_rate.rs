//! Rate at which movements brake past their ends.

use std::ops::Range;

use ndarray::{Array2, ArrayView2, s};

use super::alignment::Aligned;
use super::constants::Constants;
use crate::dynamics::output_system::Attractor;
use crate::numerics::rotation::{add_scaled, dot};
use crate::validate::row_major_mut;

/// Largest braking rate κ, in units of α_z; that of a movement that ends nearly at rest. With 4 instead, movements leave
/// their goals by 1.2 to 2 times as much on the recordings of `docs/transport.md`; 16 improves on few of them.
const MAX_BRAKING: f64 = 8.0;

/// Returns the rate κ at which movements brake past their ends: y″ is −κy′ at most.
///
/// From its fastest end among the demonstrated styles (M, J), with the velocities of unit styles at the end (J, D), each DoF
/// decelerates by no more than its largest demonstrated acceleration (D,). κ is at least α_z, since the attractor itself
/// decelerates so, and at most 8α_z, that of movements that end at rest. The components of a vector are compared by its size.
pub(super) fn braking_rate(
    attractor: Attractor,
    accelerations: &[f64],
    styles: ArrayView2<f64>,
    end_velocities: &Array2<f64>,
    vectors: &[Range<usize>],
) -> f64 {
    let mut speeds = styles.dot(end_velocities);
    for vector in vectors {
        let mut components = speeds.slice_mut(s![.., vector.clone()]);
        for mut row in components.rows_mut() {
            let size = row.dot(&row).sqrt();
            row.fill(size);
        }
    }
    let rate = |(acceleration, speeds): (&f64, ndarray::ArrayView1<f64>)| {
        let fastest = speeds.fold(0.0f64, |fastest, speed| fastest.max(speed.abs()));
        if fastest > 0.0 { acceleration / fastest } else { f64::INFINITY }
    };
    let slowest = accelerations.iter().zip(speeds.columns()).map(rate).fold(f64::INFINITY, f64::min);
    slowest.clamp(attractor.alpha_z, MAX_BRAKING * attractor.alpha_z)
}

/// Replaces the largest accelerations of the components of vectors by those of the vectors, which do not depend on a frame.
pub(super) fn share_accelerations(
    accelerations: &mut [f64],
    vectors: &[Range<usize>],
    aligned: &Aligned,
    constants: &Constants,
) {
    if vectors.is_empty() {
        return;
    }
    let clock = constants.canonical.clock(aligned.n_samples);
    let per_step = 1.0 / (clock[1] * clock[1]);
    let mut position = Array2::zeros((aligned.n_samples, accelerations.len()));
    let mut largest = vec![0.0f64; vectors.len()];
    for m in 0..aligned.n_demos() {
        aligned.sample(m, row_major_mut(&mut position));
        for (vector, largest) in vectors.iter().zip(&mut largest) {
            let at = |c: usize| -> [f64; 3] { std::array::from_fn(|i| position[[c, vector.start + i]]) };
            for c in 1..aligned.n_samples - 1 {
                let bend = add_scaled(add_scaled(at(c - 1), -2.0, at(c)), 1.0, at(c + 1));
                *largest = largest.max(dot(bend, bend).sqrt() * per_step);
            }
        }
    }
    for (vector, largest) in vectors.iter().zip(largest) {
        accelerations[vector.clone()].fill(largest);
    }
}
