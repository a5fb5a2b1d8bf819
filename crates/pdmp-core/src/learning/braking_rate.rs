//! Rate at which movements brake past their ends.

use ndarray::{Array2, ArrayView2};

use crate::dynamics::output_system::Attractor;

/// Largest braking rate κ, in units of α_z; that of a movement that ends nearly at rest. With 4 instead, movements leave
/// their goals by 1.2 to 2 times as much on the recordings of `docs/transport.md`; 16 improves on few of them.
const MAX_BRAKING: f64 = 8.0;

/// Returns the rate κ at which movements brake past their ends: y″ is −κy′ at most.
///
/// From its fastest end among the demonstrated styles (M, J), with the velocities of unit styles at the end (J, D), each DoF
/// decelerates by no more than its largest demonstrated acceleration (D,). κ is at least α_z, since the attractor itself
/// decelerates so, and at most 8α_z, that of movements that end at rest.
pub(super) fn braking_rate(
    attractor: Attractor,
    accelerations: &[f64],
    styles: ArrayView2<f64>,
    end_velocities: &Array2<f64>,
) -> f64 {
    let speeds = styles.dot(end_velocities);
    let rate = |(acceleration, speeds): (&f64, ndarray::ArrayView1<f64>)| {
        let fastest = speeds.fold(0.0f64, |fastest, speed| fastest.max(speed.abs()));
        if fastest > 0.0 { acceleration / fastest } else { f64::INFINITY }
    };
    let slowest = accelerations.iter().zip(speeds.columns()).map(rate).fold(f64::INFINITY, f64::min);
    slowest.clamp(attractor.alpha_z, MAX_BRAKING * attractor.alpha_z)
}
