//! Selection of the number of styles from the singular values.

use crate::error::{Error, Result};
use crate::validate::check_range;

/// Minimum number of styles above the noise, even where fewer carry the share. They cost little: a mean and three styles
/// are four factors, of which the largest two or three often carry nine tenths. With fewer than ten demonstrations so
/// many made predictions from contexts worse.
const MIN_STYLES: usize = 5;

/// Smallest ratio of a singular value to the largest that exceeds rounding of the targets and of the decomposition.
const MIN_RATIO: f64 = 1e-6;

/// Rule for the number of styles J, by singular values σ.
///
/// Shares are of Σσ, as in the paper, not of Σσ².
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truncation {
    /// The given J.
    Rank(usize),
    /// The smallest J with Σ_{j≤J} σ_j / Σ_m σ_m above this share.
    Share(f64),
    /// The smallest J that carries this share of the singular values above `noise`, but at least five of these, or half
    /// the number of demonstrations if that is smaller.
    AboveNoise {
        /// Largest singular value of the measurement noise in the targets.
        noise: f64,
        /// Share of the sum, in (0, 1].
        share: f64,
    },
}

impl Truncation {
    /// Checks the share, and J against its upper bound `most`, the number of the things named by `of`.
    pub(crate) fn check(self, most: usize, of: &'static str) -> Result<()> {
        match self {
            Truncation::Rank(n_styles) if n_styles < 1 || n_styles > most => Err(Error::Styles { n_styles, most, of }),
            Truncation::Rank(_) => Ok(()),
            Truncation::Share(share) | Truncation::AboveNoise { share, .. } => {
                check_range("singular_value_share", share, share > 0.0 && share <= 1.0, "must lie in (0, 1]")
            }
        }
    }

    /// Returns J for decreasing singular values of `n_demos` demonstrations.
    pub(crate) fn among(self, singular_values: &[f64], n_demos: usize) -> usize {
        match self {
            Truncation::Rank(n_styles) => n_styles,
            Truncation::Share(share) => leading(singular_values, share),
            Truncation::AboveNoise { noise, share } => {
                let least = MIN_STYLES.min(n_demos / 2);
                let floor = noise.max(MIN_RATIO * singular_values.first().copied().unwrap_or(0.0));
                let above = singular_values.iter().take_while(|&&sigma| sigma > floor).count().max(1);
                leading(&singular_values[..above], share).max(least).min(above)
            }
        }
    }
}

/// Returns the smallest J with Σ_{j≤J} σ_j / Σ_m σ_m > share; where rounding leaves none, the number of non-zero σ.
fn leading(singular_values: &[f64], share: f64) -> usize {
    let Some(&largest) = singular_values.first().filter(|&&s| s > 0.0) else { return 1 };
    let total: f64 = singular_values.iter().map(|s| s / largest).sum();
    let mut sum = 0.0;
    for (j, s) in singular_values.iter().enumerate() {
        sum += s / largest;
        if sum > share * total {
            return j + 1;
        }
    }
    let rounding = singular_values.len() as f64 * f64::EPSILON * largest;
    singular_values.iter().filter(|&&s| s > rounding).count().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J is the smallest number of singular values above the share, and 1 where all targets vanish.
    #[test]
    fn share_rule_is_that_of_the_paper() {
        for (sigma, share, expected) in [
            (&[8.0, 1.5, 0.5][..], 0.9, 2),
            (&[9.0, 1.0], 0.9, 2),
            (&[9.1, 0.9], 0.9, 1),
            (&[3.0, 2.0, 0.0], 1.0, 2),
            (&[0.0, 0.0], 0.9, 1),
        ] {
            assert_eq!(Truncation::Share(share).among(sigma, 10), expected);
        }
    }
}
