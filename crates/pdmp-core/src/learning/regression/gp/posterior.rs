//! Gaussian process conditioned on its samples.

use std::fmt;

use ndarray::Array2;

use super::Hyperparameters;
use super::kernel::Kernel;
use crate::learning::regression::Regression;

/// Gaussian process conditioned on its samples.
///
/// ```
/// # use ndarray::array;
/// use pdmp_core::learning::regression::{Domain, Gp, GpPrediction};
///
/// let gp = Gp { length: Some(0.5), noise: Some(1e-6), ..Gp::default() };
/// let targets = array![[0.0], [1.0], [0.0]];
/// let posterior = gp.regress(Domain::Interval { end: 1.0 }, &[0.0, 0.5, 1.0], targets.view(), &mut |_| Ok(()))?;
/// let GpPrediction { mean, variance } = posterior.predict(&[0.5]);
/// assert!((mean[[0, 0]] - 1.0).abs() < 1e-3 && variance[[0, 0]] < 1e-3);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Debug)]
pub struct GpPosterior {
    pub(super) kernel: Kernel,
    pub(super) at: Hyperparameters,
    /// Posterior of the outputs divided by `scale`, with variances in units of the signal variance.
    pub(super) function: Box<dyn Posterior>,
    pub(super) scale: f64,
    pub(super) n_outputs: usize,
    /// Signal standard deviation σ̂, in the unit of the outputs.
    pub(super) deviation: f64,
    pub(super) log_likelihood: f64,
}

/// Mean and variance of the noise-free outputs of a Gaussian process.
#[derive(Clone, Debug, PartialEq)]
pub struct GpPrediction {
    /// Means (n, outputs), in the unit of the outputs.
    pub mean: Array2<f64>,
    /// Variances (n, outputs), in the squared unit of the outputs.
    pub variance: Array2<f64>,
}

/// Posterior of the outputs as functions of the clock.
pub(super) trait Posterior: fmt::Debug + Send + Sync {
    /// Writes the means and their derivatives with respect to u, each (outputs,).
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]);

    /// Returns the variance, which is the same for every output, in units of the signal variance.
    fn variance(&self, u: f64) -> f64;
}

impl GpPosterior {
    /// Returns the covariance function.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Returns the length scale ℓ in units of u.
    pub fn length(&self) -> f64 {
        self.at.length
    }

    /// Returns the ratio ν of noise to signal variance.
    pub fn noise(&self) -> f64 {
        self.at.noise
    }

    /// Returns the signal variance σ̂² in the squared unit of the outputs; the noise variance is νσ̂².
    pub fn signal_variance(&self) -> f64 {
        self.deviation * self.deviation
    }

    /// Returns ln p(f | u, ℓ, ν, σ̂²), summed over the outputs; 0 where all of them are zero.
    pub fn log_likelihood(&self) -> f64 {
        self.log_likelihood
    }

    /// Returns mean kᵀK⁻¹f and variance σ̂²(1 − kᵀK⁻¹k) of the noise-free outputs at `u` (n,), each (n, outputs).
    ///
    /// The variance is the same for every output. A point costs O(ln C + P).
    pub fn predict(&self, u: &[f64]) -> GpPrediction {
        let shape = (u.len(), self.n_outputs);
        let (mut mean, mut variance) = (Array2::zeros(shape), Array2::zeros(shape));
        let (mut value, mut slope) = (vec![0.0; self.n_outputs], vec![0.0; self.n_outputs]);
        for (row, &u) in u.iter().enumerate() {
            self.evaluate(u, &mut value, &mut slope);
            mean.row_mut(row).assign(&ndarray::aview1(&value));
            variance.row_mut(row).fill(self.deviation * self.function.variance(u) * self.deviation);
        }
        GpPrediction { mean, variance }
    }
}

impl Regression for GpPosterior {
    /// Writes the means and their derivatives in O(ln C + P).
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        self.function.evaluate(u, value, slope);
        value.iter_mut().chain(slope).for_each(|number| *number *= self.scale);
    }

    fn describe(&self) -> String {
        let (length, noise) = (significant(self.length()), significant(self.noise()));
        format!("Gaussian process, {}, length {length}, noise {noise:e}", self.kernel)
    }
}

/// Rounds to three significant digits, for printing.
fn significant(x: f64) -> f64 {
    let unit = 10f64.powi(2 - x.log10().floor() as i32);
    (x * unit).round() / unit
}
