//! Kriging: the best unbiased linear prediction from noisy values at distinct places (Cressie, Statistics for Spatial
//! Data, 1993, Section 3.4; Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, Section 2.7).
//!
//! y = φ(h)ᵀβ + f(h) + ε with flat coefficients β, a Gaussian process f of covariance ν·ρ·k, and noise of variance ν.
//! With an orthonormal basis U of what the coefficients span over the n places, and in the eigenbasis B of k on the
//! rest of the space, BᵀKB = diag(λ), all that depends on the ratio ρ is diagonal: any number of outputs, each with a
//! ratio of its own, costs one eigendecomposition. Without a kernel this is least squares.

use ndarray::{Array1, Array2, ArrayView2, Axis, s};

use super::kernel::Kernel;
use crate::error::Result;
use crate::numerics::linear_algebra::{symmetric_eigen, thin_svd};

/// The places of a prediction, and the coordinates in which it is diagonal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kriging {
    /// Features of the places (n, F).
    inputs: Array2<f64>,
    n_inputs: usize,
    /// Mean of the features (F,), and the directions (F, q − 1) along which they vary, by their size.
    centre: Array1<f64>,
    directions: Array2<f64>,
    /// U (n, q).
    flat: Array2<f64>,
    smooth: Option<Smooth>,
}

/// What the kernel adds.
#[derive(Clone, Debug, PartialEq)]
struct Smooth {
    kernel: Kernel,
    /// B (n, r) and λ (r,).
    basis: Array2<f64>,
    eigenvalues: Array1<f64>,
    /// UᵀKU (q, q) and BᵀKU (r, q).
    flat_flat: Array2<f64>,
    basis_flat: Array2<f64>,
}

/// Values at the places, in the coordinates of [`Kriging`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Values {
    /// UᵀY (q, P).
    pub(super) flat: Array2<f64>,
    /// BᵀY (r, P); without a kernel, the residuals of least squares (n, P).
    pub(super) rest: Array2<f64>,
}

/// A place, as the values at all others see it.
pub(super) struct Place {
    /// φ(h) (q,), whose square is the variance that the flat coefficients add.
    pub(super) flat: Array1<f64>,
    /// Covariance of f with the rest of the values (r,).
    pub(super) rest: Array1<f64>,
    /// Variance of f that the flat coefficients leave.
    prior: f64,
}

impl Kriging {
    /// `linear` gives every feature a flat coefficient, otherwise the constant alone has one.
    pub(super) fn new(inputs: ArrayView2<f64>, n_inputs: usize, linear: bool, kernel: Option<Kernel>) -> Result<Self> {
        let (n, n_features) = inputs.dim();
        let centre = inputs.mean_axis(Axis(0)).unwrap_or_default();
        let (left, directions) = if linear {
            span((&inputs - &centre).view())?
        } else {
            (Array2::zeros((n, 0)), Array2::zeros((n_features, 0)))
        };
        let mut flat = Array2::from_elem((n, 1 + left.ncols()), 1.0 / (n as f64).sqrt());
        flat.slice_mut(s![.., 1..]).assign(&left);
        let smooth = kernel.map(|kernel| Smooth::new(kernel, inputs, n_inputs, &flat)).transpose()?;
        Ok(Self { inputs: inputs.to_owned(), n_inputs, centre, directions, flat, smooth })
    }

    /// Degrees of freedom that the flat coefficients leave.
    pub(super) fn freedom(&self) -> usize {
        self.flat.nrows() - self.flat.ncols()
    }

    /// λ (r,); none without a kernel.
    pub(super) fn eigenvalues(&self) -> Option<&Array1<f64>> {
        self.smooth.as_ref().map(|smooth| &smooth.eigenvalues)
    }

    /// Values (n, P) in these coordinates.
    pub(super) fn project(&self, values: ArrayView2<f64>) -> Values {
        let flat = self.flat.t().dot(&values);
        let rest = match &self.smooth {
            Some(smooth) => smooth.basis.t().dot(&values),
            None => &values - &self.flat.dot(&flat),
        };
        Values { flat, rest }
    }

    /// What each value lacks of its prediction from all others (n, P), in closed form.
    pub(super) fn left_out(&self, values: &Values, ratios: &[f64]) -> Array2<f64> {
        let (mut errors, weights) = match &self.smooth {
            None => {
                let leverages = self.flat.map_axis(Axis(1), |row| 1.0 - row.dot(&row)).insert_axis(Axis(1));
                (values.rest.clone(), leverages + Array2::<f64>::zeros(values.rest.dim()))
            }
            Some(smooth) => {
                let shrinkage = smooth.shrinkage(ratios);
                (smooth.basis.dot(&(&values.rest * &shrinkage)), smooth.basis.mapv(|b| b * b).dot(&shrinkage))
            }
        };
        // A place that the others say nothing about has no prediction from them.
        errors.zip_mut_with(&weights, |error, &weight| {
            *error = if weight > 1e-9 { *error / weight } else { f64::INFINITY }
        });
        errors
    }

    /// Deviations whose mean product is the covariance ν of the outputs' noise.
    pub(super) fn innovations(&self, values: &Values, ratios: &[f64]) -> Array2<f64> {
        match &self.smooth {
            None => values.rest.clone(),
            Some(smooth) => &values.rest * &smooth.shrinkage(ratios).mapv(f64::sqrt),
        }
    }

    /// What the rest of the place's coordinates is multiplied by (r, P); nothing without a kernel.
    pub(super) fn coefficients(&self, values: &Values, ratios: &[f64]) -> Array2<f64> {
        match &self.smooth {
            None => Array2::zeros((0, ratios.len())),
            Some(smooth) => &values.rest * &smooth.shrinkage(ratios) * &Array1::from_vec(ratios.to_vec()),
        }
    }

    /// A place by its features (F,).
    pub(super) fn place(&self, features: &[f64]) -> Place {
        let (n, n_flat) = self.flat.dim();
        let offset = Array1::from_vec(features.to_vec()) - &self.centre;
        let mut flat = Array1::from_elem(n_flat, 1.0 / (n as f64).sqrt());
        flat.slice_mut(s![1..]).assign(&self.directions.t().dot(&offset));
        let Some(smooth) = &self.smooth else { return Place { flat, rest: Array1::zeros(0), prior: 0.0 } };
        let k = |other: &[f64]| smooth.kernel.of(features, other, self.n_inputs);
        let covariance: Array1<f64> = self.inputs.rows().into_iter().map(|row| k(&row.to_vec())).collect();
        let rest = smooth.basis.t().dot(&covariance) - smooth.basis_flat.dot(&flat);
        let prior =
            k(features) - 2.0 * self.flat.t().dot(&covariance).dot(&flat) + flat.dot(&smooth.flat_flat.dot(&flat));
        Place { flat, rest, prior: prior.max(0.0) }
    }

    /// Variance of the prediction at a place, without the noise of a new value, in units of ν.
    pub(super) fn variance(&self, place: &Place, ratio: f64) -> f64 {
        let known = self.eigenvalues().map_or(0.0, |eigenvalues| {
            eigenvalues.iter().zip(&place.rest).map(|(l, k)| (ratio * k).powi(2) / (ratio * l + 1.0)).sum()
        });
        place.flat.dot(&place.flat) + (ratio * place.prior - known).max(0.0)
    }
}

impl Smooth {
    fn new(kernel: Kernel, inputs: ArrayView2<f64>, n_inputs: usize, flat: &Array2<f64>) -> Result<Self> {
        let (n, n_flat) = flat.dim();
        let rows: Vec<Vec<f64>> = inputs.rows().into_iter().map(|row| row.to_vec()).collect();
        let covariance = Array2::from_shape_fn((n, n), |(i, j)| kernel.of(&rows[i], &rows[j], n_inputs));
        let covariance_flat = covariance.dot(flat);
        let flat_flat = flat.t().dot(&covariance_flat);
        // With P = I − UUᵀ: PKP − UUᵀ has U for the eigenvalue −1, below all others.
        let half = &covariance_flat - &(flat.dot(&flat_flat) * 0.5) + &(flat * 0.5);
        let cross = half.dot(&flat.t());
        let projected = covariance - &cross - cross.t();
        let (eigenvalues, vectors) = symmetric_eigen(projected.view(), "covariance of the contexts")?;
        let basis = vectors.slice(s![.., n_flat..]).as_standard_layout().into_owned();
        let eigenvalues = eigenvalues.iter().skip(n_flat).map(|lambda| lambda.max(0.0)).collect();
        let basis_flat = basis.t().dot(&covariance_flat);
        Ok(Self { kernel, basis, eigenvalues, flat_flat, basis_flat })
    }

    /// 1/(ρλ + 1) for each eigenvalue and output (r, P).
    fn shrinkage(&self, ratios: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((self.eigenvalues.len(), ratios.len()), |(k, p)| {
            1.0 / (ratios[p] * self.eigenvalues[k] + 1.0)
        })
    }
}

/// An orthonormal basis (n, k) of the columns, and the directions V/σ (F, k) that lead there from a row.
fn span(rows: ArrayView2<f64>) -> Result<(Array2<f64>, Array2<f64>)> {
    let (n, n_features) = rows.dim();
    let (u, sigma, v) = thin_svd(rows, "features of the contexts")?;
    let floor = sigma.first().copied().unwrap_or(0.0) * f64::EPSILON * n.max(n_features) as f64;
    let rank = sigma.iter().filter(|&&s| s > floor).count();
    let left = u.slice(s![.., ..rank]).as_standard_layout().into_owned();
    let directions = Array2::from_shape_fn((n_features, rank), |(f, k)| v[[f, k]] / sigma[k]);
    Ok((left, directions))
}
