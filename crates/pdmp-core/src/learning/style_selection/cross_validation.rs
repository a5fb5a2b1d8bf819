//! Selection of the number of styles by cross-validation over the contexts, with the one-standard-error rule.
//!
//! No landscape is regressed for it. With F = S·Σ·Vᵀ of all demonstrations, the factors of a subset are those of its rows
//! of S·Σ. As movements are linear in their styles and SᵀS = I, the response to style j is Rⱼ = Σₘ sᵐⱼ yᵐ, where yᵐ are
//! the positions of demonstration m less its frame: the contribution of goal and start, or of the anchor.
//!
//! T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd edition, Springer 2009, Section 7.10.

use ndarray::{Array1, Array2, Array3, ArrayView1, ArrayView2, Axis, Zip, s};

use crate::context::{ContextColumn, ContextMap, MapSelection, outputs};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{Attractor, State};
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::learning::context_folds::{Fold, folds};
use crate::learning::factorization::{Factors, Truncation};
use crate::learning::targets::Targets;
use crate::model::responses::Curves;
use crate::model::sensitivity::{STEPS, Sensitivity};

/// Demonstrations for the cross-validation of the number of styles.
pub(crate) struct StyleSelection<'a> {
    kind: Kind,
    targets: &'a Targets,
    factors: &'a Factors,
    segment_durations: ArrayView2<'a, f64>,
    /// Response to a start of 1 and a goal of 0, over the phase (S,).
    start: Array1<f64>,
    /// Positions less their frames (M, S, D).
    residuals: Array3<f64>,
}

impl<'a> StyleSelection<'a> {
    /// Samples the demonstrations; `factors` are all factors of their targets.
    pub(crate) fn new(
        aligned: &'a Aligned,
        targets: &'a Targets,
        factors: &'a Factors,
        transport: &Transport,
        attractor: Attractor,
        canonical: Canonical,
    ) -> Self {
        let kind = canonical.kind();
        let n_samples = kind.samples(STEPS);
        let step = attractor.propagator(canonical.extent() / STEPS as f64).resting.transition;
        let next = |State { e, z }| State { e: step[0][0] * e + step[0][1] * z, z: step[1][0] * e + step[1][1] * z };
        let decay = std::iter::successors(Some(State { e: 1.0, z: 0.0 }), |state| Some(next(*state)));
        let start: Array1<f64> = match kind {
            Kind::Discrete => {
                // The output system restores the share of the start that the frame does not carry.
                let free = 1.0 + transport.lag(0.0).value;
                let clock = canonical.clock(n_samples).into_iter();
                decay.zip(clock).map(|(state, u)| free * state.e - transport.lag(u).value).collect()
            }
            Kind::Rhythmic => Array1::zeros(n_samples),
        };
        let sampled = aligned.clone().resampled(n_samples);
        let mut residuals = Array3::zeros((targets.starts.nrows(), n_samples, targets.starts.ncols()));
        for (m, mut position) in residuals.outer_iter_mut().enumerate() {
            sampled.sample(m, crate::validate::row_major_mut(&mut position));
        }
        let mut selection =
            Self { kind, targets, factors, segment_durations: aligned.segment_durations.view(), start, residuals };
        for m in 0..targets.starts.nrows() {
            let frame = selection.frame(selection.centres().row(m).to_vec(), targets.starts.row(m).to_vec());
            let mut residual = selection.residuals.index_axis_mut(Axis(0), m);
            residual -= &frame;
        }
        selection
    }

    /// Returns the smallest number of styles within one standard error of the lowest cross-validation error.
    ///
    /// # Errors
    /// Fewer than three different contexts, a map that does not suit them, or the error that `progress` returned.
    pub(crate) fn n_styles(
        &self,
        columns: &[ContextColumn],
        contexts: &Array2<f64>,
        map: MapSelection,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<usize> {
        let folds = folds(contexts).ok_or(Error::Argument {
            name: "n_styles",
            problem: "needs at least three different contexts for cross-validation: pass a number of styles",
        })?;
        let mut errors: Vec<Vec<f64>> = Vec::new();
        for (k, fold) in folds.iter().enumerate() {
            progress(k as f64 / folds.len() as f64)?;
            errors.extend(self.errors(fold, columns, contexts, map)?);
        }
        Ok(one_standard_error_rule(&errors))
    }

    /// Returns the mean squared errors (J,) of each held-out context, for 1 to J styles.
    fn errors(
        &self,
        fold: &Fold,
        columns: &[ContextColumn],
        contexts: &Array2<f64>,
        map: MapSelection,
    ) -> Result<Vec<Vec<f64>>> {
        let of = |rows: &Array2<f64>| rows.select(Axis(0), &fold.training);
        let sizes = ArrayView1::from(&self.factors.singular_values[..self.factors.styles.ncols()]);
        let weights = of(&self.factors.styles) * sizes;
        let styles = Factors::of(weights.view(), Truncation::Share(1.0), &mut |_| Ok(()))?.styles;
        let residuals = self.residuals.select(Axis(0), &fold.training);
        let response =
            |style: ArrayView1<f64>| Zip::from(residuals.lanes(Axis(0))).map_collect(|lane| lane.dot(&style));
        let (n_samples, n_dofs) = (self.start.len(), self.targets.starts.ncols());
        let start = Array2::from_shape_fn((n_samples, n_dofs), |(k, _)| self.start[k]);
        let velocity = Array2::zeros(start.dim());
        let unit_styles = styles.columns().into_iter().map(response).collect();
        let curves = Curves { styles: unit_styles, start, velocity, goal_velocity: None };

        let [goals, starts, anchors] = [&self.targets.goals, &self.targets.starts, &self.targets.anchors].map(of);
        let segment_durations = self.segment_durations.select(Axis(0), &fold.training);
        let locations = [goals.view(), starts.view(), anchors.view()];
        let outputs = outputs(self.kind, styles.view(), locations, segment_durations.view());
        let metric = Sensitivity::new(self.kind, &curves, Vec::new()).metric(outputs.view(), segment_durations.view());
        let map = ContextMap::learn(columns.to_vec(), &of(contexts), outputs.view(), metric.view(), map)?;

        let errors_of = |group: &Vec<usize>| {
            let expected = map.predict_mean(&contexts.row(group[0]).to_vec());
            let (style, locations) = expected.split_at(curves.styles.len());
            let (centre, start) = locations.split_at(n_dofs);
            // A cycle has no start; its frame depends on the anchor alone.
            let start = if self.kind == Kind::Discrete { &start[..n_dofs] } else { centre };
            let predicted = self.frame(centre.to_vec(), start.to_vec());
            let mut errors = vec![0.0; style.len()];
            for &m in group {
                let own = self.frame(self.centres().row(m).to_vec(), self.targets.starts.row(m).to_vec());
                let mut error_curve = &self.residuals.index_axis(Axis(0), m) + &own - &predicted;
                for ((error, s), curve) in errors.iter_mut().zip(style).zip(&curves.styles) {
                    error_curve.scaled_add(-s, curve);
                    *error += error_curve.iter().map(|x| x * x).sum::<f64>() / (n_samples * group.len()) as f64;
                }
            }
            errors
        };
        Ok(fold.held_out.iter().map(errors_of).collect())
    }

    /// Returns the goals, or the anchors.
    fn centres(&self) -> &Array2<f64> {
        match self.kind {
            Kind::Discrete => &self.targets.goals,
            Kind::Rhythmic => &self.targets.anchors,
        }
    }

    /// Returns the positions (S, D) of a movement of style zero.
    fn frame(&self, centre: Vec<f64>, start: Vec<f64>) -> Array2<f64> {
        Array2::from_shape_fn((self.start.len(), centre.len()), |(k, d)| {
            centre[d] + (start[d] - centre[d]) * self.start[k]
        })
    }
}

/// Returns the smallest number of styles whose mean error exceeds the lowest by at most the standard error of the
/// difference over the contexts.
fn one_standard_error_rule(errors: &[Vec<f64>]) -> usize {
    let (n, most) = (errors.len() as f64, errors.iter().map(Vec::len).min().unwrap_or(1));
    let errors = Array2::from_shape_fn((errors.len(), most), |(i, j)| errors[i][j]);
    let means = errors.mean_axis(Axis(0)).unwrap_or_default();
    let best = (0..most).min_by(|&i, &j| means[i].total_cmp(&means[j])).unwrap_or(0);
    let within = |j: &usize| {
        let excess = &errors.slice(s![.., *j]) - &errors.slice(s![.., best]);
        excess.mean().unwrap_or(0.0) <= excess.std(1.0) / n.sqrt()
    };
    1 + (0..best).find(within).unwrap_or(best)
}
