//! Profile likelihood of the hyperparameters as an objective of the search.

use super::state_space::StateSpace;
use super::{Hyperparameters, Progress};
use crate::error::Result;
use crate::learning::regression::hyperparameter_search::{Objective, Score};

/// Weight, in halves of the number of values, of the squared excess of the logarithm of the noise over its bound. The
/// gradient of the likelihood is at most half of that number, so that the bound is exceeded by at most a twentieth.
const BARRIER: f64 = 20.0;

/// Likelihood of the samples with the signal variance of maximum likelihood.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    /// CP.
    pub(super) n_values: f64,
    /// σ̂² = Σ fᵀK⁻¹f/(CP).
    pub(super) variance: f64,
    /// P·ln|K|.
    pub(super) log_determinant: f64,
}

/// Derivatives of the log likelihood with respect to (ln ℓ, ln ν), by its two terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gradient {
    /// Data fit: ½Σ αᵀdKα/σ̂², α = K⁻¹f.
    pub(super) data_fit: [f64; 2],
    /// Complexity penalty: P/2·tr(K⁻¹dK).
    pub(super) complexity: [f64; 2],
}

impl Profile {
    /// Returns −CP/2·ln σ̂² − P/2·ln|K|, the log likelihood up to a constant; 0 where all outputs are zero.
    pub(super) fn value(&self) -> f64 {
        if self.variance == 0.0 { 0.0 } else { -0.5 * (self.n_values * self.variance.ln() + self.log_determinant) }
    }

    /// Returns the derivatives of the value with respect to (ln ℓ, ln ν).
    pub(super) fn gradient(&self, Gradient { data_fit, complexity }: &Gradient) -> [f64; 2] {
        [0, 1].map(|k| if self.variance == 0.0 { 0.0 } else { data_fit[k] - complexity[k] })
    }
}

/// Log likelihood as a function of (ln ℓ, ln ν), with a penalty on noise beyond its bound.
pub(super) struct Likelihood<'a, 'b, const D: usize> {
    /// Thinned samples, for the scan.
    pub(super) scanned: StateSpace<D>,
    pub(super) process: &'a StateSpace<D>,
    /// Largest νσ̂², where it is bounded.
    pub(super) bound: Option<f64>,
    pub(super) progress: &'a mut Progress<'b>,
}

impl<const D: usize> Likelihood<'_, '_, D> {
    /// Returns the excess of ln(νσ̂²) over its bound, at least 0.
    fn excess(&self, profile: &Profile, noise: f64) -> f64 {
        self.bound.map_or(0.0, |bound| (noise * profile.variance / bound).ln().max(0.0))
    }
}

impl<const D: usize> Objective for Likelihood<'_, '_, D> {
    fn estimate(&mut self, at: [f64; 2]) -> Result<f64> {
        self.progress.advance()?;
        let [length, noise] = at.map(f64::exp);
        let found = self.scanned.profile(Hyperparameters { length, noise }, self.progress)?;
        Ok(found.map_or(f64::NEG_INFINITY, |profile| {
            profile.value() - 0.25 * BARRIER * profile.n_values * self.excess(&profile, noise).powi(2)
        }))
    }

    fn score(&mut self, at: [f64; 2]) -> Result<Score> {
        self.progress.advance()?;
        let [length, noise] = at.map(f64::exp);
        let Some((profile, terms)) = self.process.gradient(Hyperparameters { length, noise }, self.progress)? else {
            return Ok(Score::INFEASIBLE);
        };
        // d ln σ̂² = −2·data_fit/(CP).
        let (excess, weight) = (self.excess(&profile, noise), 0.5 * BARRIER * profile.n_values);
        let excess_slope = [0, 1].map(|k| k as f64 - 2.0 * terms.data_fit[k] / profile.n_values);
        let gradient = profile.gradient(&terms);
        Ok(Score {
            value: profile.value() - 0.5 * weight * excess * excess,
            gradient: [0, 1].map(|k| gradient[k] - weight * excess * excess_slope[k]),
        })
    }
}
