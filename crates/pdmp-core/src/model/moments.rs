//! Mean and covariance of the parameters of the demonstrations.

use std::sync::OnceLock;

use ndarray::{Array2, Axis, concatenate};

use super::Model;
use super::conditions::Conditions;
use crate::error::Result;
use crate::kind::Kind;

/// Mean and covariance, which are computed once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moments {
    /// Conditions of the degrees of freedom.
    mean: OnceLock<Conditions>,
    covariance: OnceLock<Array2<f64>>,
}

impl Model {
    /// Returns the mean conditions of the demonstrations.
    ///
    /// # Errors
    /// As for [`Self::conditions`].
    pub(crate) fn mean(&self) -> Result<Conditions> {
        let mean = match self.moments.mean.get() {
            Some(mean) => mean.clone(),
            None => {
                let mean = self.conditions_inside(&(0..self.n_demos()).collect::<Vec<_>>())?;
                self.moments.mean.get_or_init(|| mean).clone()
            }
        };
        Ok(self.outside(mean))
    }

    /// Returns the covariance (P, P) of style, goal and start of the demonstrations, or of style and anchor.
    pub(crate) fn covariance(&self) -> &Array2<f64> {
        self.moments.covariance.get_or_init(|| {
            let all = &self.demonstrated;
            let positions = match self.kind() {
                Kind::Discrete => vec![all.styles.view(), all.goals.view(), all.starts.view()],
                Kind::Rhythmic => vec![all.styles.view(), all.anchors.view()],
            };
            // The matrices have a row for each demonstration.
            let parameters = concatenate(Axis(1), &positions).unwrap_or_default();
            let mean = parameters.mean_axis(Axis(0)).unwrap_or_default();
            let deviations = parameters - mean;
            deviations.t().dot(&deviations) / (self.n_demos().max(2) - 1) as f64
        })
    }
}
