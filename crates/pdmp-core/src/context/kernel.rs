//! Covariance functions (kernels) of the context map.

use serde::{Deserialize, Serialize};

/// Covariance function k(a, b) of the features of two contexts with Q values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Kernel {
    /// aᵀb/Q: linear functions with penalised slopes.
    Linear,
    /// (1 + aᵀb/Q)² − 1: polynomials of second degree with penalised coefficients.
    Quadratic,
    /// Matérn-5/2 of the distance |a − b|/√Q.
    Matern {
        /// Length scale, in standard deviations of the contexts.
        length: f64,
    },
}

impl Kernel {
    /// Computes k(a, b) for features of `n_inputs` context values.
    pub(super) fn covariance(self, a: &[f64], b: &[f64], n_inputs: usize) -> f64 {
        let weight = 1.0 / n_inputs as f64;
        let product = || weight * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        match self {
            Self::Linear => product(),
            Self::Quadratic => {
                let product = product();
                product * (2.0 + product)
            }
            Self::Matern { length } => {
                let square = weight * a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                let x = (5.0 * square).sqrt() / length;
                (1.0 + x + x * x / 3.0) * (-x).exp()
            }
        }
    }
}
