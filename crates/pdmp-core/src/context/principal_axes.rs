//! The axes along which outputs are foreseen: those along which movements vary.
//!
//! Each output has a signal and a noise of its own. Styles, goals and starts of a movement are not what should have
//! them: they say the same thing several times, and styles are ordered by what they force, not by how far they move.
//! The principal components of the movements themselves vary independently, and the errors of each count alike.

use ndarray::{Array2, ArrayView2, Axis};

use crate::error::{Error, Result};
use crate::numerics::linear_algebra::{inverse, symmetric_eigen};

/// Least size of a movement per unit of an output, relative to the largest: what moves nothing is foreseen too.
const FLOOR: f64 = 1e-5;

/// Coordinates in which outputs are a mean and independent components.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axes {
    /// Outputs per unit of each component, by rows (P, P), and the inverse of that.
    pub(super) directions: Array2<f64>,
    components: Array2<f64>,
}

impl Axes {
    /// The principal axes of outputs (n, P), whose errors e count eᵀGe with the `metric` G (P, P).
    pub(super) fn principal(outputs: ArrayView2<f64>, metric: ArrayView2<f64>) -> Result<Self> {
        // Styles, goals and times come in units of their own, which may be far apart.
        let units = metric.diag().mapv(|g| if g > 0.0 { g.sqrt() } else { 1.0 });
        let balanced = Array2::from_shape_fn(metric.dim(), |(p, q)| metric[[p, q]] / units[p] / units[q]);
        let (sizes, vectors) = symmetric_eigen(balanced.view(), "covariance of the outputs")?;
        let largest = sizes.iter().fold(f64::MIN_POSITIVE, |most, size| most.max(*size));
        let sizes: Vec<f64> = sizes.iter().map(|size| size.max(largest * FLOOR * FLOOR).sqrt()).collect();
        // In these coordinates every error counts alike, and stays so where they are rotated.
        let scaled = |power: i32| {
            Array2::from_shape_fn(vectors.dim(), |(p, k)| vectors[[p, k]] * (units[p] * sizes[k]).powi(power))
        };
        let mut deviations = (&outputs - &outputs.mean_axis(Axis(0)).unwrap_or_default()).dot(&scaled(1));
        deviations /= deviations.fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
        let (_, rotation) = symmetric_eigen(deviations.t().dot(&deviations).view(), "covariance of the outputs")?;
        // In rows, as a file gives them: sums are then the same to the last bit.
        Self::new(rotation.t().dot(&scaled(-1).t()).as_standard_layout().into_owned())
    }

    /// The axes of known directions (P, P).
    ///
    /// # Errors
    /// Directions that do not span the outputs.
    pub(super) fn new(directions: Array2<f64>) -> Result<Self> {
        let components = inverse(directions.view());
        if components.iter().any(|x| !x.is_finite()) {
            return Err(Error::Fit("the axes of the map from contexts depend on each other".to_string()));
        }
        Ok(Self { directions, components })
    }

    /// Components (n, P) of outputs (n, P).
    pub(super) fn components(&self, outputs: &Array2<f64>) -> Array2<f64> {
        outputs.dot(&self.components)
    }

    /// Covariance of the components of outputs whose covariance is known.
    pub(super) fn scatter(&self, covariance: &Array2<f64>) -> Array2<f64> {
        self.components.t().dot(covariance).dot(&self.components)
    }

    /// Covariance of the outputs whose components have a known one.
    pub(super) fn covariance(&self, scatter: &Array2<f64>) -> Array2<f64> {
        self.directions.t().dot(scatter).dot(&self.directions)
    }
}
