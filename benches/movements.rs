//! Demonstrations for the benches of learning.

use std::f64::consts::PI;

use ndarray::Array2;
use pdmp_core::{Demonstration, Sampling};

/// Returns M movements of one second with D = 7 and a style space of low dimension.
pub(crate) fn movements(n_demos: usize, n_samples: usize) -> Vec<Demonstration> {
    let shape = |m: usize, d: usize, s: f64| {
        let reach = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
        let phase = m as f64 / n_demos as f64;
        reach * (1.0 + d as f64)
            + phase * (PI * s).sin().powi(2)
            + phase * phase * (2.0 * PI * s).sin() * (PI * s).sin()
    };
    let steps = (n_samples - 1) as f64;
    (0..n_demos)
        .map(|m| {
            let position = Array2::from_shape_fn((n_samples, 7), |(c, d)| shape(m, d, c as f64 / steps));
            Demonstration::new(position, Sampling::Uniform { dt: 1.0 / steps }).expect("finite")
        })
        .collect()
}
