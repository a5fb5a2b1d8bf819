//! Universal kriging: the best linear unbiased prediction from noisy observations at distinct locations.
//!
//! The model of an output is y = φ(h)ᵀβ + f(h) + ε, with trend coefficients β under a flat prior, a Gaussian process f of
//! covariance ν·ρ·k, and noise ε of variance ν. Let U be an orthonormal basis of the trend functions at the n locations,
//! and B the eigenbasis of k in the orthogonal complement, BᵀKB = diag(λ). In these coordinates the signal-to-noise ratio
//! ρ enters diagonal matrices alone: one eigendecomposition serves any number of outputs, each with its own ratio. BᵀY are
//! the error contrasts of restricted maximum likelihood. Without a kernel the prediction is that of least squares.
//!
//! - N. A. C. Cressie, Statistics for Spatial Data, Wiley 1993, Section 3.4;
//! - C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, Section 2.7.

use ndarray::{Array1, Array2, ArrayView2, Axis, s};

use super::kernel::Kernel;
use crate::error::Result;
use crate::numerics::linear_algebra::{symmetric_eigen, thin_svd};

/// Smallest leverage complement of an observation that the others predict, well above the rounding errors of it.
const MIN_LEVERAGE_COMPLEMENT: f64 = 1e-9;

/// Locations of the observations, and the coordinates in which the prediction is diagonal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kriging {
    /// Features of the locations (n, F).
    features: Array2<f64>,
    n_inputs: usize,
    /// Mean of the features (F,).
    mean: Array1<f64>,
    /// Right singular vectors of the centred features over their singular values (F, q − 1); none for a constant trend.
    directions: Array2<f64>,
    /// Orthonormal basis U of the trend (n, q).
    trend: Array2<f64>,
    eigenbasis: Option<Eigenbasis>,
}

/// Eigendecomposition of the kernel in the complement of the trend.
#[derive(Clone, Debug, PartialEq)]
struct Eigenbasis {
    kernel: Kernel,
    /// Eigenvectors B (n, r).
    vectors: Array2<f64>,
    /// Eigenvalues λ (r,).
    values: Array1<f64>,
    /// UᵀKU (q, q).
    trend_covariance: Array2<f64>,
    /// BᵀKU (r, q).
    cross_covariance: Array2<f64>,
}

/// Observations in the coordinates of [`Kriging`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Observations {
    /// Trend coefficients UᵀY (q, P).
    pub(super) trend: Array2<f64>,
    /// Error contrasts BᵀY (r, P); without a kernel, the residuals of least squares (n, P).
    pub(super) contrasts: Array2<f64>,
}

/// A location of prediction.
pub(super) struct Location {
    /// Trend functions φ(h) (q,); their sum of squares is the variance that the trend adds.
    pub(super) trend: Array1<f64>,
    /// Covariance of f(h) with the contrasts (r,).
    pub(super) covariance: Array1<f64>,
    /// Prior variance of f(h) in the complement of the trend.
    prior: f64,
}

impl Kriging {
    /// Prepares the prediction from locations (n, F). The trend is linear if `linear_trend`, constant otherwise.
    pub(super) fn new(
        features: ArrayView2<f64>,
        n_inputs: usize,
        linear_trend: bool,
        kernel: Option<Kernel>,
    ) -> Result<Self> {
        let (n, n_features) = features.dim();
        let mean = features.mean_axis(Axis(0)).unwrap_or_default();
        let (left, directions) = if linear_trend {
            column_space((&features - &mean).view())?
        } else {
            (Array2::zeros((n, 0)), Array2::zeros((n_features, 0)))
        };
        let mut trend = Array2::from_elem((n, 1 + left.ncols()), 1.0 / (n as f64).sqrt());
        trend.slice_mut(s![.., 1..]).assign(&left);
        let eigenbasis = kernel.map(|kernel| Eigenbasis::new(kernel, features, n_inputs, &trend)).transpose()?;
        Ok(Self { features: features.to_owned(), n_inputs, mean, directions, trend, eigenbasis })
    }

    /// Returns the residual degrees of freedom n − q.
    pub(super) fn degrees_of_freedom(&self) -> usize {
        self.trend.nrows() - self.trend.ncols()
    }

    /// Returns the eigenvalues λ (r,); `None` without a kernel.
    pub(super) fn eigenvalues(&self) -> Option<&Array1<f64>> {
        self.eigenbasis.as_ref().map(|eigenbasis| &eigenbasis.values)
    }

    /// Projects observations (n, P).
    pub(super) fn project(&self, outputs: ArrayView2<f64>) -> Observations {
        let trend = self.trend.t().dot(&outputs);
        let contrasts = match &self.eigenbasis {
            Some(eigenbasis) => eigenbasis.vectors.t().dot(&outputs),
            None => &outputs - &self.trend.dot(&trend),
        };
        Observations { trend, contrasts }
    }

    /// Computes the leave-one-out errors (n, P) in closed form, for ratios ρ (P,).
    ///
    /// An error is infinite where the other observations do not determine the trend.
    pub(super) fn leave_one_out_errors(&self, observations: &Observations, ratios: &[f64]) -> Array2<f64> {
        let (mut errors, weights) = match &self.eigenbasis {
            None => {
                let complements = self.trend.map_axis(Axis(1), |row| 1.0 - row.dot(&row)).insert_axis(Axis(1));
                let residuals = &observations.contrasts;
                (residuals.clone(), complements + Array2::<f64>::zeros(residuals.dim()))
            }
            Some(eigenbasis) => {
                let (vectors, shrinkage) = (&eigenbasis.vectors, eigenbasis.shrinkage(ratios));
                (vectors.dot(&(&observations.contrasts * &shrinkage)), vectors.mapv(|b| b * b).dot(&shrinkage))
            }
        };
        errors.zip_mut_with(&weights, |error, &weight| {
            *error = if weight > MIN_LEVERAGE_COMPLEMENT { *error / weight } else { f64::INFINITY }
        });
        errors
    }

    /// Computes whitened residuals, whose sum of squares over the degrees of freedom estimates the noise covariance (P, P).
    pub(super) fn innovations(&self, observations: &Observations, ratios: &[f64]) -> Array2<f64> {
        match &self.eigenbasis {
            None => observations.contrasts.clone(),
            Some(eigenbasis) => &observations.contrasts * &eigenbasis.shrinkage(ratios).mapv(f64::sqrt),
        }
    }

    /// Computes the kriging weights (r, P) of [`Location::covariance`]; none without a kernel.
    pub(super) fn weights(&self, observations: &Observations, ratios: &[f64]) -> Array2<f64> {
        match &self.eigenbasis {
            None => Array2::zeros((0, ratios.len())),
            Some(eigenbasis) => {
                &observations.contrasts * &eigenbasis.shrinkage(ratios) * &Array1::from_vec(ratios.to_vec())
            }
        }
    }

    /// Returns the location with features (F,).
    pub(super) fn location(&self, features: &[f64]) -> Location {
        let (n, n_trend) = self.trend.dim();
        let offset = Array1::from_vec(features.to_vec()) - &self.mean;
        let mut trend = Array1::from_elem(n_trend, 1.0 / (n as f64).sqrt());
        trend.slice_mut(s![1..]).assign(&self.directions.t().dot(&offset));
        let Some(eigenbasis) = &self.eigenbasis else {
            return Location { trend, covariance: Array1::zeros(0), prior: 0.0 };
        };
        let k = |other: &[f64]| eigenbasis.kernel.covariance(features, other, self.n_inputs);
        let to_all: Array1<f64> = self.features.rows().into_iter().map(|row| k(&row.to_vec())).collect();
        let covariance = eigenbasis.vectors.t().dot(&to_all) - eigenbasis.cross_covariance.dot(&trend);
        let prior = k(features) - 2.0 * self.trend.t().dot(&to_all).dot(&trend)
            + trend.dot(&eigenbasis.trend_covariance.dot(&trend));
        Location { trend, covariance, prior: prior.max(0.0) }
    }

    /// Computes the kriging variance at a location in units of ν, without the noise of a new observation.
    pub(super) fn variance(&self, location: &Location, ratio: f64) -> f64 {
        let explained = self.eigenvalues().map_or(0.0, |eigenvalues| {
            let terms = eigenvalues.iter().zip(&location.covariance);
            terms.map(|(lambda, k)| (ratio * k).powi(2) / (ratio * lambda + 1.0)).sum()
        });
        location.trend.dot(&location.trend) + (ratio * location.prior - explained).max(0.0)
    }
}

impl Eigenbasis {
    fn new(kernel: Kernel, features: ArrayView2<f64>, n_inputs: usize, trend: &Array2<f64>) -> Result<Self> {
        let (n, n_trend) = trend.dim();
        let rows: Vec<Vec<f64>> = features.rows().into_iter().map(|row| row.to_vec()).collect();
        let covariance = Array2::from_shape_fn((n, n), |(i, j)| kernel.covariance(&rows[i], &rows[j], n_inputs));
        let to_trend = covariance.dot(trend);
        let trend_covariance = trend.t().dot(&to_trend);
        // With P = I − UUᵀ, the columns of U are eigenvectors of PKP − UUᵀ with eigenvalue −1, below all others.
        let half = &to_trend - &(trend.dot(&trend_covariance) * 0.5) + &(trend * 0.5);
        let cross = half.dot(&trend.t());
        let projected = covariance - &cross - cross.t();
        let (values, vectors) = symmetric_eigen(projected.view(), "covariance of the contexts")?;
        let vectors = vectors.slice(s![.., n_trend..]).as_standard_layout().into_owned();
        let values = values.iter().skip(n_trend).map(|lambda| lambda.max(0.0)).collect();
        let cross_covariance = vectors.t().dot(&to_trend);
        Ok(Self { kernel, vectors, values, trend_covariance, cross_covariance })
    }

    /// Computes 1/(ρλ + 1) for each eigenvalue and output (r, P).
    fn shrinkage(&self, ratios: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((self.values.len(), ratios.len()), |(k, p)| 1.0 / (ratios[p] * self.values[k] + 1.0))
    }
}

/// Returns an orthonormal basis (n, k) of the column space of a matrix (n, F), and V/σ (F, k), which maps a row of the
/// matrix to its row of the basis.
fn column_space(matrix: ArrayView2<f64>) -> Result<(Array2<f64>, Array2<f64>)> {
    let (n, n_features) = matrix.dim();
    let (u, sigma, v) = thin_svd(matrix, "features of the contexts")?;
    let tolerance = sigma.first().copied().unwrap_or(0.0) * f64::EPSILON * n.max(n_features) as f64;
    let rank = sigma.iter().filter(|&&s| s > tolerance).count();
    let left = u.slice(s![.., ..rank]).as_standard_layout().into_owned();
    let directions = Array2::from_shape_fn((n_features, rank), |(f, k)| v[[f, k]] / sigma[k]);
    Ok((left, directions))
}
