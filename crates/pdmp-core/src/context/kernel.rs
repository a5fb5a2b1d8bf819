//! What kind of function leads from contexts to movements.

use serde::{Deserialize, Serialize};

/// How alike the movements of two contexts are, beyond what they have in common.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Kernel {
    /// aᵀb/Q: lines, whose slopes are held small.
    Linear,
    /// (1 + aᵀb/Q)² − 1: polynomials of second degree, whose coefficients are held small.
    Quadratic,
    /// Matérn-5/2 of the distance |a − b|/√Q, over a length in units of the contexts' spread.
    Matern { length: f64 },
}

impl Kernel {
    /// k(a, b) of two sets of features of `n_inputs` context values.
    pub(crate) fn of(self, a: &[f64], b: &[f64], n_inputs: usize) -> f64 {
        let share = 1.0 / n_inputs as f64;
        let product = || share * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        match self {
            Self::Linear => product(),
            Self::Quadratic => {
                let product = product();
                product * (2.0 + product)
            }
            Self::Matern { length } => {
                let square = share * a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                let x = (5.0 * square).sqrt() / length;
                (1.0 + x + x * x / 3.0) * (-x).exp()
            }
        }
    }
}
