//! Deviations of demonstrations from the predictions for their contexts.

use ndarray::{Array2, ArrayView2};

use super::model_selection::{KrigingModel, StackedLine};
use super::training_data::GroupedData;
use super::{ContextMap, MapParameters, group_equal_contexts};
use crate::error::Result;

impl ContextMap {
    /// Computes the deviation (M, P) of each output of the training data (M, Q) and (M, P) from the prediction by the others,
    /// in closed form with the hyperparameters of all.
    ///
    /// Equal contexts are left out together, where the other contexts determine the prediction. Where they do not, as for a
    /// label, it is the mean of the other movements of the context or, of a single one, of all.
    pub(crate) fn deviations(&self, contexts: &Array2<f64>, outputs: ArrayView2<f64>) -> Result<Array2<f64>> {
        let MapParameters { kernel, ratios, line, .. } = &self.parameters;
        let data = GroupedData::new(self.columns.clone(), contexts, outputs)?;
        let means = data.means.clone();
        let data = data.along(&self.axes);
        let training = data.training_set();
        let mut errors = KrigingModel::with_ratios(*kernel, &training, ratios.clone())?.leave_one_out_errors();
        if let Some((ratios, weights)) = line {
            let line = StackedLine::with_ratios(&training, ratios.clone(), *weights)?.model.leave_one_out_errors();
            let [of_process, of_line] = weights.interpolation;
            errors = errors * of_process + line * of_line;
        }
        let of_others = |n: usize| n as f64 / (n.max(2) - 1) as f64;
        let mut deviations = Array2::zeros(outputs.dim());
        for ((group, errors), mean) in group_equal_contexts(contexts).iter().zip(errors.rows()).zip(means.rows()) {
            let is_determined = errors.iter().all(|error| error.is_finite());
            for &m in group {
                let from_mean = &outputs.row(m) - &mean;
                deviations.row_mut(m).assign(&match group.len() {
                    _ if is_determined => from_mean + errors.dot(&self.axes.directions),
                    1 => (&outputs.row(m) - &self.mean) * of_others(means.nrows()),
                    n => from_mean * of_others(n),
                });
            }
        }
        Ok(deviations)
    }
}
