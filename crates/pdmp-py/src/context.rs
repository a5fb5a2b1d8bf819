//! Stand-alone context maps.

use ndarray::{Array2, Array3, Axis};
use numpy::IntoPyArray;
use pdmp_core::context::MapSelection;
use pyo3::prelude::*;

use crate::choice::Choice;
use crate::convert::{Cube, Matrix, matrix};
use crate::error::{ascii, raise};
use crate::fit::map_of;

/// Regression from contexts to outputs with predictive covariance.
///
/// `fit` uses it from contexts to style, goal, start and duration (Section 4.1.2 of the paper); here outputs are
/// arbitrary. Each principal component of the outputs is modelled as y = φ(h)ᵀβ + f(h) + ε:
///
/// - "linear" is least squares with φ = (1, h) and f = 0.
/// - "gp" and "polynomial" have φ = 1 and a Gaussian process f, whose kernel is Matérn-5/2 or that of polynomials of
///   second degree. Restricted maximum likelihood estimates the ratio of f to the noise for each component;
///   leave-one-out error decides the length scale.
/// - "stacked" is the mean plus w_g·g + w_l·l, with the deviations g of "gp" and l of a ridge regression. The weights
///   minimise the leave-one-out error under w_g + w_l = 1 inside the range of the contexts, and under w_g + w_l ≤ 1
///   beyond a tenth of their range outside.
///
/// Numbers are scaled by their spread; labels are equal or not. Repetitions of a context are averaged and count once.
///
/// Parameters
/// ----------
/// contexts : array_like, (M, Q), or M lists of Q numbers and labels
///     Contexts h, numbers in any unit.
/// outputs : array_like, (M, P)
///     Outputs y for each context, in any unit.
/// map : {"auto", "stacked", "gp", "linear", "polynomial"}
///     Model of the outputs; "auto" as in `fit`.
///
/// Raises
/// ------
/// ValueError
///     Lengths differ, `map` is unknown, or a number is not finite.
///
/// References
/// ----------
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 2.7
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct ContextMap(pub(crate) pdmp_core::context::ContextMap);

#[pymethods]
impl ContextMap {
    #[new]
    #[pyo3(
        signature = (contexts, outputs, map=Choice::FIRST),
        text_signature = "(contexts, outputs, map='auto')"
    )]
    fn new(contexts: &Bound<'_, PyAny>, outputs: &Bound<'_, PyAny>, map: Choice<'_>) -> PyResult<Self> {
        let (rows, outputs) = (crate::convert::contexts("contexts", contexts)?, matrix("outputs", "(M, P)", outputs)?);
        let selection: MapSelection = map_of(map)?;
        pdmp_core::context::ContextMap::fit(&rows, outputs.view(), selection).map(Self).map_err(raise)
    }

    /// Name of the model: "stacked", "gp", "linear" or "polynomial".
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind().name()
    }

    /// Mean squared leave-one-out error of each model that was fitted, with hyperparameters of all contexts.
    ///
    /// Pairs (name, error), in the squared unit of the principal components.
    #[getter]
    fn errors(&self) -> Vec<(&'static str, f64)> {
        self.0.errors().iter().map(|(kind, error)| (kind.name(), *error)).collect()
    }

    /// Degrees of freedom of the covariance estimate.
    #[getter]
    fn degrees_of_freedom(&self) -> usize {
        self.0.degrees_of_freedom()
    }

    /// Computes the predictive mean and covariance of new outputs.
    ///
    /// Parameters
    /// ----------
    /// contexts : array_like, (B, Q), or B lists of Q numbers and labels
    ///     Contexts.
    ///
    /// Returns
    /// -------
    /// mean : ndarray, (B, P)
    ///     In the unit of the outputs.
    /// covariance : ndarray, (B, P, P), or None
    ///     None if no degree of freedom is left to estimate it.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A context has a wrong length, an unknown label, or a number that is not finite.
    fn predict<'py>(&self, py: Python<'py>, contexts: &Bound<'_, PyAny>) -> PyResult<(Matrix<'py>, Option<Cube<'py>>)> {
        let predictions = crate::convert::contexts("contexts", contexts)?
            .iter()
            .map(|context| self.0.predict(context))
            .collect::<pdmp_core::Result<Vec<_>>>()
            .map_err(raise)?;
        let n_outputs = predictions.first().map_or(0, |first| first.mean.len());
        let means = Array2::from_shape_fn((predictions.len(), n_outputs), |(b, p)| predictions[b].mean[p]);
        let available = !predictions.is_empty() && predictions.iter().all(|each| each.covariance.is_some());
        let covariances = available.then(|| {
            let mut covariances = Array3::zeros((predictions.len(), n_outputs, n_outputs));
            for (prediction, mut to) in predictions.iter().zip(covariances.axis_iter_mut(Axis(0))) {
                prediction.covariance.iter().for_each(|covariance| to.assign(covariance));
            }
            covariances.into_pyarray(py)
        });
        Ok((means.into_pyarray(py), covariances))
    }

    fn __repr__(&self) -> String {
        format!("<pdmp.ContextMap: {}>", self.__str__())
    }

    fn __str__(&self) -> String {
        ascii(&self.0.to_string())
    }
}
