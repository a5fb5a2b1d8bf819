//! A Gaussian process given its samples.

use ndarray::Array2;

use super::Hyperparameters;
use super::dense::Expansion;
use super::interpolation::Trajectory;
use super::kernel::Kernel;
use crate::learning::regression::Regression;

/// Points whose covariances with the samples are held in memory at once.
const CHUNK: usize = 256;

/// A Gaussian process given its samples.
#[derive(Clone, Debug)]
pub struct GpPosterior {
    pub(super) kernel: Kernel,
    pub(super) at: Hyperparameters,
    /// Of the outputs divided by `scale`, in units of the signal variance.
    pub(super) form: Form,
    pub(super) scale: f64,
    pub(super) n_outputs: usize,
    /// σ̂, in the unit of the outputs.
    pub(super) deviation: f64,
    pub(super) log_likelihood: f64,
}

/// How a posterior is held.
#[derive(Clone, Debug)]
pub(super) enum Form {
    Matern32(Trajectory<2>),
    Matern52(Trajectory<3>),
    SquaredExponential(Expansion),
}

impl From<Trajectory<2>> for Form {
    fn from(trajectory: Trajectory<2>) -> Self {
        Self::Matern32(trajectory)
    }
}

impl From<Trajectory<3>> for Form {
    fn from(trajectory: Trajectory<3>) -> Self {
        Self::Matern52(trajectory)
    }
}

impl Form {
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        match self {
            Self::Matern32(trajectory) => trajectory.evaluate(u, value, slope),
            Self::Matern52(trajectory) => trajectory.evaluate(u, value, slope),
            Self::SquaredExponential(expansion) => expansion.evaluate(u, value, slope),
        }
    }

    /// Variances of f at each point, in units of the signal variance.
    fn variances(&self, u: &[f64]) -> Vec<f64> {
        match self {
            Self::Matern32(trajectory) => u.iter().map(|&u| trajectory.variance(u)).collect(),
            Self::Matern52(trajectory) => u.iter().map(|&u| trajectory.variance(u)).collect(),
            Self::SquaredExponential(expansion) => u.chunks(CHUNK).flat_map(|u| expansion.variances(u)).collect(),
        }
    }
}

impl GpPosterior {
    /// The covariance function.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Length scale ℓ in units of u.
    pub fn length(&self) -> f64 {
        self.at.length
    }

    /// Ratio ν of noise to signal variance.
    pub fn noise(&self) -> f64 {
        self.at.noise
    }

    /// Signal variance σ̂², in the squared unit of the outputs; that of the noise is νσ̂².
    pub fn signal_variance(&self) -> f64 {
        self.deviation * self.deviation
    }

    /// ln p(f | u, ℓ, ν, σ̂²), summed over the outputs; 0 where all are zero.
    pub fn log_likelihood(&self) -> f64 {
        self.log_likelihood
    }

    /// Mean and variance of the noise-free outputs at `u` (n,), each (n, outputs): kᵀK⁻¹f and σ̂²(1 − kᵀK⁻¹k),
    /// the same for every output.
    ///
    /// Takes O(ln C + P) a point with a Matérn kernel, O(C² + CP) with the squared exponential.
    pub fn predict(&self, u: &[f64]) -> (Array2<f64>, Array2<f64>) {
        let shape = (u.len(), self.n_outputs);
        let (mut mean, mut variance) = (Array2::zeros(shape), Array2::zeros(shape));
        let (mut value, mut slope) = (vec![0.0; self.n_outputs], vec![0.0; self.n_outputs]);
        for (row, (&u, share)) in u.iter().zip(self.form.variances(u)).enumerate() {
            self.evaluate(u, &mut value, &mut slope);
            mean.row_mut(row).assign(&ndarray::aview1(&value));
            variance.row_mut(row).fill(self.deviation * share * self.deviation);
        }
        (mean, variance)
    }
}

impl Regression for GpPosterior {
    /// Takes O(ln C + P) with a Matérn kernel, O(CP) with the squared exponential.
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        self.form.evaluate(u, value, slope);
        value.iter_mut().chain(slope).for_each(|number| *number *= self.scale);
    }

    fn describe(&self) -> String {
        let (length, noise) = (significant(self.length()), significant(self.noise()));
        format!("Gaussian process, {}, length {length}, noise {noise:e}", self.kernel)
    }
}

/// Rounded to three significant digits, for printing.
fn significant(x: f64) -> f64 {
    let unit = 10f64.powi(2 - x.log10().floor() as i32);
    (x * unit).round() / unit
}
