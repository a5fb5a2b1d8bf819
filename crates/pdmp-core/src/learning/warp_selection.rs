//! Selection between a time warp and linear time scaling by cross-validation over the contexts.
//!
//! The mean squared prediction error over linear time is lowest for movements averaged over linear time. A warp lowers it
//! where contexts predict the segment durations, or where fewer styles remain, and raises it otherwise. Both are validated on
//! held-out contexts, with principal components of the positions in place of styles and landscape, equal in number to
//! the styles of the fit.

use std::iter::repeat_n;

use ndarray::{Array1, Array2, ArrayView1, Axis, concatenate};

use crate::context::{ContextColumn, ContextMap, MapSelection, log_durations};
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::context_folds::{Fold, folds};
use crate::learning::factorization::{Factors, Truncation};
use crate::model::sensitivity::STEPS;
use crate::motion::prediction_band::interpolate;

/// Cross-validation of a time warp.
pub(super) struct WarpSelection<'a> {
    /// Number of styles of aligned demonstrations.
    pub(super) n_styles: &'a dyn Fn(&Aligned) -> Result<usize>,
    /// Types of the context columns (Q,).
    pub(super) columns: &'a [ContextColumn],
    /// Contexts (M, Q).
    pub(super) numbers: &'a Array2<f64>,
    /// Map from contexts to movements.
    pub(super) map: MapSelection,
}

impl WarpSelection<'_> {
    /// Returns true if the warp lowers the cross-validation error by more than its standard error, or if there are fewer
    /// than three different contexts.
    ///
    /// # Errors
    /// A map that does not suit the contexts, or the error that `progress` returned.
    pub(super) fn favours_warp(
        &self,
        warped: &Aligned,
        linear: &Aligned,
        kind: Kind,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<bool> {
        let Some(folds) = folds(self.numbers) else { return Ok(true) };
        let recorded = positions(linear, kind);
        let mut share = 0.0;
        let mut errors = |aligned: &Aligned| {
            let errors = self.errors(&folds, aligned, &recorded, kind, &mut |done| progress(share + 0.5 * done));
            share = 0.5;
            errors
        };
        let (linear, warped) = (errors(linear)?, errors(warped)?);
        let gains: Vec<f64> = linear.iter().zip(&warped).map(|(linear, warped)| linear - warped).collect();
        let gains = ArrayView1::from(&gains);
        Ok(gains.mean().unwrap_or(0.0) > gains.std(1.0) / (gains.len() as f64).sqrt())
    }

    /// Returns the mean squared error over linear time of each held-out context.
    fn errors(
        &self,
        folds: &[Fold],
        aligned: &Aligned,
        recorded: &Array2<f64>,
        kind: Kind,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Vec<f64>> {
        let positions = positions(aligned, kind);
        let n_styles = (self.n_styles)(aligned)?;
        let mut errors = Vec::new();
        for (k, Fold { training, held_out }) in folds.iter().enumerate() {
            progress(k as f64 / folds.len() as f64)?;
            let rows = positions.select(Axis(0), training);
            let factors = Factors::of(rows.view(), Truncation::Rank(n_styles.min(training.len())), &mut |_| Ok(()))?;
            let (outputs, metric) = outputs(&factors, &aligned.segment_durations.select(Axis(0), training));
            let numbers = self.numbers.select(Axis(0), training);
            let map = ContextMap::learn(self.columns.to_vec(), &numbers, outputs.view(), metric.view(), self.map)?;
            for group in held_out {
                let expected = map.predict_mean(&self.numbers.row(group[0]).to_vec());
                let predicted = predicted(&expected, &factors, aligned, kind);
                let error = |m: &usize| (&recorded.row(*m) - &predicted).mapv(|x| x * x).sum();
                errors.push(group.iter().map(error).sum::<f64>() / (group.len() * recorded.ncols()) as f64);
            }
        }
        Ok(errors)
    }
}

/// Returns the positions (M, S·D) over the phase.
fn positions(aligned: &Aligned, kind: Kind) -> Array2<f64> {
    let n_samples = kind.samples(STEPS);
    let sampled = aligned.clone().resampled(n_samples);
    let mut positions = Array2::zeros((aligned.n_demos(), n_samples * aligned.demo(0).n_dofs()));
    for (m, mut row) in positions.rows_mut().into_iter().enumerate() {
        sampled.sample(m, crate::validate::row_major_mut(&mut row));
    }
    positions
}

/// Returns the outputs of the map, which are the component scores and the logarithms of the segment durations, and the
/// metric of their errors. An error of 1 in the relative segment durations weighs as much as the movement about its mean.
fn outputs(factors: &Factors, segment_durations: &Array2<f64>) -> (Array2<f64>, Array2<f64>) {
    let logarithms = log_durations(segment_durations.view());
    let movement = factors.basis_targets.var_axis(Axis(1), 0.0).sum() * factors.basis_targets.ncols() as f64
        / segment_durations.nrows() as f64;
    let sizes = factors.basis_targets.rows().into_iter().map(|row| row.dot(&row));
    let weights: Array1<f64> = sizes.chain(repeat_n(movement, logarithms.ncols())).collect();
    (concatenate![Axis(1), factors.styles, logarithms], Array2::from_diag(&weights))
}

/// Returns the predicted movement (S·D) over linear time.
fn predicted(expected: &[f64], factors: &Factors, aligned: &Aligned, kind: Kind) -> Array1<f64> {
    let (styles, logarithms) = expected.split_at(factors.styles.ncols());
    let curve = ArrayView1::from(styles).dot(&factors.basis_targets);
    if logarithms.len() == 1 {
        return curve;
    }
    let segment_durations: Vec<f64> = logarithms[1..].iter().chain(&[0.0]).map(|logarithm| logarithm.exp()).collect();
    let time = WarpingFunction::new(kind, &aligned.breaks, &segment_durations);
    let n_dofs = aligned.demo(0).n_dofs();
    let curve = Array2::from_shape_fn((curve.len() / n_dofs, n_dofs), |(c, d)| curve[c * n_dofs + d]);
    let sample = |c: usize| (time.phase(time.duration() * c as f64 / STEPS as f64)[0] * STEPS as f64).max(0.0);
    (0..curve.nrows()).flat_map(|c| interpolate(&curve, sample(c), kind)).collect()
}
