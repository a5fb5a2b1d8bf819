//! Outputs of the context map.

use ndarray::{Array2, ArrayView2, Axis, concatenate};

use crate::kind::Kind;

/// Returns the outputs of the context map for each movement (M, P): style, goal and start or anchor, and logarithms of time.
pub(crate) fn outputs(
    kind: Kind,
    styles: ArrayView2<f64>,
    [goals, starts, anchors]: [ArrayView2<f64>; 3],
    segment_durations: ArrayView2<f64>,
) -> Array2<f64> {
    let logarithms = log_durations(segment_durations);
    let parts = match kind {
        Kind::Discrete => vec![styles, goals, starts, logarithms.view()],
        Kind::Rhythmic => vec![styles, anchors, logarithms.view()],
    };
    concatenate(Axis(1), &parts).expect("each part has one row per movement")
}

/// Returns the logarithms of time (M, K), which keep predicted durations positive: ln ΣT_k, and ln(T_k/T_K) for all k < K,
/// of the durations T_k of K segments (M, K).
pub(crate) fn log_durations(segment_durations: ArrayView2<f64>) -> Array2<f64> {
    let last = segment_durations.ncols() - 1;
    Array2::from_shape_fn(segment_durations.dim(), |(m, k)| match k {
        0 => segment_durations.row(m).sum().ln(),
        _ => (segment_durations[[m, k - 1]] / segment_durations[[m, last]]).ln(),
    })
}

/// Computes the Jacobian (K, K) ∂ln T_k/∂o_i of the K segment durations by the outputs o of time.
pub(crate) fn log_duration_jacobian(segment_durations: &[f64]) -> Array2<f64> {
    let duration: f64 = segment_durations.iter().sum();
    Array2::from_shape_fn((segment_durations.len(), segment_durations.len()), |(k, output)| match output {
        0 => 1.0,
        i => f64::from(u8::from(k == i - 1)) - segment_durations[i - 1] / duration,
    })
}
