//! What maps are learnt from: contexts that differ, with the mean of what was demonstrated in each.

use std::collections::HashMap;

use ndarray::{Array2, ArrayView2, Axis};

use super::encoding::Scale;
use super::model_selection::{Choice, MOST, Shown};
use super::principal_axes::Axes;
use super::{ContextColumn, ContextMap, Part};
use crate::error::{Error, Result};

/// Most multiplications n·f² that a linear map of n contexts with f inputs may take: a second or two.
const MAX_WORK: f64 = 4e9;

/// Degrees of freedom below which none is taken for the ratio of signal to noise, which the evidence has chosen. In
/// simulations of lines, curves and constants with much noise, bands of 90 % inside of 5 to 12 contexts hold 81 to 89 % of
/// new values where none is taken, 85 to 93 % with one and 88 to 97 % with two; of 3 contexts 82 to 96 % without, and 97 to
/// 99 % with one, three times as wide.
const MIN_FREEDOM: usize = 2;

/// Contexts that differ, what was shown in each on average, and how much that scattered.
pub(super) struct Data {
    pub(super) columns: Vec<ContextColumn>,
    scale: Scale,
    inputs: Array2<f64>,
    pub(super) means: Array2<f64>,
    /// Pooled covariance of demonstrations of one context, with its degrees of freedom; the mean of one over their
    /// number is the share of it that an average keeps.
    within: Option<(Array2<f64>, usize)>,
    kept: f64,
}

impl Data {
    pub(super) fn of(columns: Vec<ContextColumn>, contexts: &Array2<f64>, outputs: ArrayView2<f64>) -> Result<Self> {
        let groups = group_equal_contexts(contexts);
        // Each label is an input of its own.
        let n_inputs: usize = columns.iter().map(ContextColumn::n_features).sum();
        let work = groups.len() as f64 * (n_inputs as f64).powi(2);
        if work > MAX_WORK {
            let allowed = "labels and numbers of a context: too many for so many contexts; merge labels";
            return Err(Error::Range { name: "contexts", value: n_inputs as f64, allowed });
        }
        let firsts: Vec<usize> = groups.iter().map(|group| group[0]).collect();
        let distinct = contexts.select(Axis(0), &firsts);
        let scale = Scale::of(&columns, &distinct)?;
        let features: Vec<f64> = distinct.rows().into_iter().flat_map(|row| scale.features(&row.to_vec())).collect();
        let inputs =
            Array2::from_shape_fn((groups.len(), scale.n_features()), |(i, f)| features[i * scale.n_features() + f]);
        let mut means = Array2::zeros((groups.len(), outputs.ncols()));
        let mut scatter = Array2::zeros((outputs.ncols(), outputs.ncols()));
        for (group, mut mean) in groups.iter().zip(means.rows_mut()) {
            let shown = outputs.select(Axis(0), group);
            mean.assign(&shown.mean_axis(Axis(0)).unwrap_or_default());
            if group.len() > 1 {
                let deviations = &shown - &mean;
                scatter += &deviations.t().dot(&deviations);
            }
        }
        let degrees_of_freedom = contexts.nrows() - groups.len();
        let within = (degrees_of_freedom > 0).then(|| (scatter / degrees_of_freedom as f64, degrees_of_freedom));
        let kept = groups.iter().map(|group| 1.0 / group.len() as f64).sum::<f64>() / groups.len() as f64;
        Ok(Self { columns, scale, inputs, means, within, kept })
    }

    /// Checks the number of contexts of a map whose cost grows with its cube.
    pub(super) fn check_count(&self, cubic: bool) -> Result<()> {
        if cubic && self.inputs.nrows() > MOST {
            let (name, value) = ("contexts", self.inputs.nrows() as f64);
            let allowed = "different contexts: at most 1024 for this map; round them, or take map=\"linear\"";
            return Err(Error::Range { name, value, allowed });
        }
        Ok(())
    }

    /// The same, of components along axes.
    pub(super) fn along(self, axes: &Axes) -> Self {
        let within = self.within.map(|(within, degrees_of_freedom)| (axes.scatter(&within), degrees_of_freedom));
        Self { means: axes.components(&self.means), within, ..self }
    }

    pub(super) fn shown(&self) -> Shown<'_> {
        Shown { inputs: self.inputs.view(), n_inputs: self.scale.n_inputs(), outputs: self.means.view() }
    }

    pub(super) fn map(self, axes: Axes, choice: Choice) -> ContextMap {
        let Choice { candidate, trend, errors } = choice;
        let (kind, kernel, ratios) = (candidate.kind, candidate.kernel, candidate.ratios.clone());
        let (noise, degrees_of_freedom) = match (candidate.kriging.degrees_of_freedom(), &self.within) {
            // As many coefficients as contexts: what is left is the noise of the averages.
            (0, None) => (None, 0),
            (0, Some((within, degrees_of_freedom))) => (Some(within * self.kept), *degrees_of_freedom),
            (degrees_of_freedom, _) => {
                // The evidence takes one for the ratio; of fewer than two the quantiles would say nothing.
                let taken = usize::from(candidate.kernel.is_some() && degrees_of_freedom > MIN_FREEDOM);
                let degrees_of_freedom = degrees_of_freedom - taken;
                let innovations = candidate.kriging.innovations(&candidate.values, &ratios);
                (Some(innovations.t().dot(&innovations) / degrees_of_freedom as f64), degrees_of_freedom)
            }
        };
        let within = self.within.map(|(within, _)| within * (1.0 - self.kept));
        let (columns, scale) = (self.columns, self.scale);
        let centre = self.means.mean_axis(Axis(0)).unwrap_or_default();
        let slopes = trend.as_ref().map(|trend| trend.line.ratios.clone()).unwrap_or_default();
        let trend = trend.map(|trend| (Part::of(trend.line), trend.stack));
        let process = Part::of(candidate);
        ContextMap {
            columns,
            scale,
            kind,
            kernel,
            axes,
            ratios,
            slopes,
            errors,
            process,
            trend,
            centre,
            noise,
            within,
            degrees_of_freedom,
        }
    }
}

/// Demonstrations of equal contexts (M, Q), in the order of the first of each.
pub(crate) fn group_equal_contexts(contexts: &Array2<f64>) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut known = HashMap::new();
    for (m, row) in contexts.rows().into_iter().enumerate() {
        // Zero of either sign is one context.
        let key: Vec<u64> = row.iter().map(|value| (value + 0.0).to_bits()).collect();
        let group = *known.entry(key).or_insert(groups.len());
        if group == groups.len() {
            groups.push(Vec::new());
        }
        groups[group].push(m);
    }
    groups
}
