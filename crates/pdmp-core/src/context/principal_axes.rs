//! Principal axes of the movements, along which the outputs are regressed.
//!
//! The regression estimates a signal-to-noise ratio for each of its outputs. Styles, goals and starts suit it badly: they
//! are correlated, and styles are ordered by forcing instead of displacement. The principal components of the movements
//! are uncorrelated, and their errors have equal weight.

use ndarray::{Array2, ArrayView2, Axis};

use crate::error::{Error, Result};
use crate::numerics::linear_algebra::{inverse, symmetric_eigen};

/// Least size of a movement per unit of an output, relative to the largest. It gives directions without movement a finite
/// scale, so that they are predicted too.
const MIN_RELATIVE_SIZE: f64 = 1e-5;

/// Linear coordinates of the outputs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PrincipalAxes {
    /// Outputs per unit of each component, as rows (P, P).
    pub(super) directions: Array2<f64>,
    /// Inverse of the directions (P, P).
    components: Array2<f64>,
}

impl PrincipalAxes {
    /// Computes the axes of outputs (n, P), where an error e of the outputs displaces the movement by √(eᵀGe) with the
    /// `metric` G (P, P).
    pub(super) fn fit(outputs: ArrayView2<f64>, metric: ArrayView2<f64>) -> Result<Self> {
        // Balances the units of styles, goals and times, which may differ by many orders of magnitude.
        let units = metric.diag().mapv(|g| if g > 0.0 { g.sqrt() } else { 1.0 });
        let balanced = Array2::from_shape_fn(metric.dim(), |(p, q)| metric[[p, q]] / units[p] / units[q]);
        let (sizes, vectors) = symmetric_eigen(balanced.view(), "covariance of the outputs")?;
        let largest = sizes.iter().fold(f64::MIN_POSITIVE, |max, size| max.max(*size));
        let sizes: Vec<f64> =
            sizes.iter().map(|size| size.max(largest * MIN_RELATIVE_SIZE * MIN_RELATIVE_SIZE).sqrt()).collect();
        // In these coordinates G is the identity, and remains so under rotation.
        let scaled = |power: i32| {
            Array2::from_shape_fn(vectors.dim(), |(p, k)| vectors[[p, k]] * (units[p] * sizes[k]).powi(power))
        };
        let mut deviations = (&outputs - &outputs.mean_axis(Axis(0)).unwrap_or_default()).dot(&scaled(1));
        deviations /= deviations.fold(f64::MIN_POSITIVE, |max, x| max.max(x.abs()));
        let (_, rotation) = symmetric_eigen(deviations.t().dot(&deviations).view(), "covariance of the outputs")?;
        // Row-major as in a model file, so that a loaded map has bitwise equal sums.
        Self::from_directions(rotation.t().dot(&scaled(-1).t()).as_standard_layout().into_owned())
    }

    /// Returns the axes with given directions (P, P).
    ///
    /// # Errors
    /// Directions that are linearly dependent.
    pub(super) fn from_directions(directions: Array2<f64>) -> Result<Self> {
        let components = inverse(directions.view());
        if components.iter().any(|x| !x.is_finite()) {
            return Err(Error::Fit("the axes of the context map are linearly dependent".to_string()));
        }
        Ok(Self { directions, components })
    }

    /// Transforms outputs (n, P) to components (n, P).
    pub(super) fn components(&self, outputs: &Array2<f64>) -> Array2<f64> {
        outputs.dot(&self.components)
    }

    /// Transforms a covariance of outputs (P, P) to that of the components.
    pub(super) fn component_covariance(&self, covariance: &Array2<f64>) -> Array2<f64> {
        self.components.t().dot(covariance).dot(&self.components)
    }

    /// Transforms a covariance of components (P, P) to that of the outputs.
    pub(super) fn output_covariance(&self, covariance: &Array2<f64>) -> Array2<f64> {
        self.directions.t().dot(covariance).dot(&self.directions)
    }
}
