//! Metric of the context outputs, and residual variance of the demonstrations.

use std::sync::Arc;

use ndarray::{Array1, Array2, ArrayView2};

use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::model::primitive::Primitive;
use crate::model::responses::{Curves, Derivative};
use crate::model::sensitivity::{STEPS, Sensitivity};
use crate::motion::unit_responses::phases;
use crate::numerics::smoothing_spline::Noise;

/// Returns the metric (P, P) that converts errors of the outputs to mean squared errors of the movement.
pub(super) fn metric(
    primitive: &Arc<Primitive>,
    outputs: ArrayView2<f64>,
    segment_durations: ArrayView2<f64>,
) -> Result<Array2<f64>> {
    let responses = phases(primitive)?;
    let sensitivity = Sensitivity::new(primitive.kind(), responses.of(Derivative::Position), Vec::new());
    Ok(sensitivity.metric(outputs, segment_durations))
}

/// Returns the responses of a primitive over the demonstrated duration in [`STEPS`] steps.
pub(super) fn phase_curves(primitive: &Arc<Primitive>) -> Result<Curves> {
    Ok(phases(primitive)?.of(Derivative::Position).clone())
}

/// Returns the sum over the demonstrations of the squared residuals (S, D) over the phase.
///
/// `curves` are those of [`phase_curves`].
pub(super) fn squared_residuals(
    kind: Kind,
    curves: &Curves,
    outputs: ArrayView2<f64>,
    aligned: Aligned,
) -> Array2<f64> {
    let sensitivity = Sensitivity::new(kind, curves, Vec::new());
    let n_samples = kind.samples(STEPS);
    let n_dofs = aligned.demo(0).n_dofs();
    let aligned = aligned.resampled(n_samples);
    let mut sum = Array2::zeros((n_samples, n_dofs));
    let mut position = Array2::zeros(sum.dim());
    for (m, outputs) in outputs.rows().into_iter().enumerate() {
        aligned.sample(m, crate::validate::row_major_mut(&mut position));
        let reproduced = sensitivity.positions(outputs);
        sum.zip_mut_with(&(&position - &reproduced.slice(ndarray::s![..n_samples, ..])), |sum, error| {
            *sum += error * error
        });
    }
    sum
}

/// Returns the residual variance (S, D) of demonstrations with a sum of squared residuals (S, D), measurement noise included.
pub(super) fn residual_variance(sum: Array2<f64>, n_demos: usize, noise: &Noise) -> Array2<f64> {
    let noise = noise.levels().iter().map(|level| level * level).collect::<Array1<f64>>();
    sum / (n_demos - 1).max(1) as f64 + noise
}
