//! Metric of the context outputs, and residual variance of the demonstrations.

use std::sync::Arc;

use ndarray::{Array1, Array2, ArrayView2};

use crate::error::Result;
use crate::learning::alignment::Aligned;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::model::sensitivity::{STEPS, Sensitivity};
use crate::motion::unit_responses::phases;

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

/// Returns the residual variance (S, D) of the demonstrations over the phase, measurement noise included.
pub(super) fn residual_variance(
    primitive: &Arc<Primitive>,
    outputs: ArrayView2<f64>,
    aligned: Aligned,
) -> Result<Array2<f64>> {
    let kind = primitive.kind();
    let responses = phases(primitive)?;
    let sensitivity = Sensitivity::new(kind, responses.of(Derivative::Position), Vec::new());
    let n_samples = kind.samples(STEPS);
    let levels = aligned.noise.levels().to_vec();
    let aligned = aligned.resampled(n_samples);
    let mut sum = Array2::zeros((n_samples, primitive.n_dofs()));
    let mut position = Array2::zeros(sum.dim());
    for (m, outputs) in outputs.rows().into_iter().enumerate() {
        aligned.sample(m, crate::validate::row_major_mut(&mut position));
        let reproduced = sensitivity.positions(outputs);
        sum.zip_mut_with(&(&position - &reproduced.slice(ndarray::s![..n_samples, ..])), |sum, error| {
            *sum += error * error
        });
    }
    let noise = levels.iter().map(|level| level * level).collect::<Array1<f64>>();
    Ok(sum / (outputs.nrows() - 1).max(1) as f64 + noise)
}
