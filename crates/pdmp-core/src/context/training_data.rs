//! Training data of context maps: distinct contexts, with the mean output of the demonstrations of each.

use std::collections::HashMap;

use ndarray::{Array2, ArrayView2, Axis};

use super::ContextColumn;
use super::encoding::Encoder;
use super::model_selection::{MAX_CONTEXTS, TrainingSet};
use super::principal_axes::PrincipalAxes;
use crate::error::Result;
use crate::validate::check_range;

/// Most multiplications n·F² of least squares for n contexts with F features, which take one or two seconds.
const MAX_WORK: f64 = 4e9;

/// Demonstrations grouped by equal contexts.
pub(super) struct GroupedData {
    pub(super) columns: Vec<ContextColumn>,
    pub(super) encoder: Encoder,
    /// Features of the n distinct contexts (n, F).
    features: Array2<f64>,
    /// Mean outputs of each context (n, P).
    pub(super) means: Array2<f64>,
    /// Covariance (P, P) within contexts, pooled, with its degrees of freedom; `None` without repetitions.
    pub(super) within: Option<(Array2<f64>, usize)>,
    /// Mean of 1/n_i over the contexts with n_i demonstrations each, the share of `within` in the variance of a mean.
    pub(super) averaged_share: f64,
}

impl GroupedData {
    /// Groups tabulated contexts (M, Q) with their outputs (M, P).
    ///
    /// # Errors
    /// Contexts with too many labels and numbers, or with a number that varies too little or too much.
    pub(super) fn new(columns: Vec<ContextColumn>, contexts: &Array2<f64>, outputs: ArrayView2<f64>) -> Result<Self> {
        let groups = group_equal_contexts(contexts);
        let n_features: usize = columns.iter().map(ContextColumn::n_features).sum();
        let allowed = "labels and numbers per context are too many for this number of contexts; merge labels";
        let work = groups.len() as f64 * (n_features as f64).powi(2);
        check_range("contexts", n_features as f64, work <= MAX_WORK, allowed)?;
        let first_of_each: Vec<usize> = groups.iter().map(|group| group[0]).collect();
        let distinct = contexts.select(Axis(0), &first_of_each);
        let encoder = Encoder::fit(&columns, &distinct)?;
        let rows: Vec<Vec<f64>> = distinct.rows().into_iter().map(|row| encoder.features(&row.to_vec())).collect();
        let features = Array2::from_shape_fn((groups.len(), n_features), |(i, f)| rows[i][f]);
        let mut means = Array2::zeros((groups.len(), outputs.ncols()));
        let mut scatter = Array2::zeros((outputs.ncols(), outputs.ncols()));
        for (group, mut mean) in groups.iter().zip(means.rows_mut()) {
            let repetitions = outputs.select(Axis(0), group);
            mean.assign(&repetitions.mean_axis(Axis(0)).unwrap_or_default());
            if group.len() > 1 {
                let deviations = &repetitions - &mean;
                scatter += &deviations.t().dot(&deviations);
            }
        }
        let degrees_of_freedom = contexts.nrows() - groups.len();
        let within = (degrees_of_freedom > 0).then(|| (scatter / degrees_of_freedom as f64, degrees_of_freedom));
        let averaged_share = groups.iter().map(|group| 1.0 / group.len() as f64).sum::<f64>() / groups.len() as f64;
        Ok(Self { columns, encoder, features, means, within, averaged_share })
    }

    /// Checks the number of contexts of a map with a kernel, whose cost grows with its cube.
    ///
    /// # Errors
    /// More than [`MAX_CONTEXTS`].
    pub(super) fn check_kernel_size(&self) -> Result<()> {
        let n = self.features.nrows();
        let allowed = "different contexts: at most 1024 for this map; round them, or select the linear map";
        check_range("contexts", n as f64, n <= MAX_CONTEXTS, allowed)
    }

    /// Returns the data with components along axes for outputs.
    pub(super) fn along(self, axes: &PrincipalAxes) -> Self {
        let within = self.within.map(|(within, n)| (axes.component_covariance(&within), n));
        Self { means: axes.components(&self.means), within, ..self }
    }

    /// Returns a view for the regression.
    pub(super) fn training_set(&self) -> TrainingSet<'_> {
        TrainingSet { features: self.features.view(), n_inputs: self.encoder.n_inputs(), outputs: self.means.view() }
    }
}

/// Groups the indices of equal contexts (M, Q), in the order of the first index of each.
pub(crate) fn group_equal_contexts(contexts: &Array2<f64>) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut group_of = HashMap::new();
    for (m, row) in contexts.rows().into_iter().enumerate() {
        // Adding zero makes −0 and 0 equal.
        let key: Vec<u64> = row.iter().map(|value| (value + 0.0).to_bits()).collect();
        let group = *group_of.entry(key).or_insert(groups.len());
        if group == groups.len() {
            groups.push(Vec::new());
        }
        groups[group].push(m);
    }
    groups
}
