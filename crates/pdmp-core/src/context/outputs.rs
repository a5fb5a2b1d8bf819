//! Conditions of movements as outputs of the map.

use ndarray::{Array2, ArrayView2, Axis, concatenate};

use crate::kind::Kind;

/// The outputs of the map (M, P): style, goal and start or anchor, and the timing (M, K) as logarithms: that of the
/// duration, and those of each segment's time relative to the last one's.
pub(crate) fn outputs(
    kind: Kind,
    styles: ArrayView2<f64>,
    [goals, starts, anchors]: [ArrayView2<f64>; 3],
    timings: ArrayView2<f64>,
) -> Array2<f64> {
    let last = timings.ncols() - 1;
    let logarithms = Array2::from_shape_fn(timings.dim(), |(m, k)| match k {
        0 => timings.row(m).sum().ln(),
        _ => (timings[[m, k - 1]] / timings[[m, last]]).ln(),
    });
    let parts = match kind {
        Kind::Discrete => vec![styles, goals, starts, logarithms.view()],
        Kind::Rhythmic => vec![styles, anchors, logarithms.view()],
    };
    // Row counts are equal by construction.
    concatenate(Axis(1), &parts).unwrap_or_default()
}

/// Relative change of each time (K,) in a timing per unit of the outputs that it is foreseen by (K,).
pub(crate) fn relative_changes(timing: &[f64]) -> Array2<f64> {
    let duration: f64 = timing.iter().sum();
    Array2::from_shape_fn((timing.len(), timing.len()), |(k, output)| match output {
        0 => 1.0,
        i => f64::from(u8::from(k == i - 1)) - timing[i - 1] / duration,
    })
}
