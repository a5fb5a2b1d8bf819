//! Maps from contexts, by themselves.

use ndarray::{Array2, Array3, Axis};
use numpy::IntoPyArray;
use pdmp_core::context::MapChoice;
use pyo3::prelude::*;

use crate::convert::{Cube, Matrix, matrix};
use crate::error::{ascii, raise};
use crate::fit::map_of;

/// A map from contexts to outputs, with the covariance of what it predicts.
///
/// What `fit` learns from contexts to style, goal, start and duration (Section 4.1.2 of the paper), for any outputs:
/// y = φ(h)ᵀβ + f(h) + ε for each principal component. "linear" is least squares, φ = (1, h) and no f; "polynomial" and
/// "gp" have a constant and a Gaussian process f, with the kernel of the polynomials of second degree or Matérn-5/2. The
/// ratio of f to the noise is found by restricted maximum likelihood, for each component; the length, by the error at
/// contexts left out. "stacked" combines the deviations g of "gp" and l of a line with penalised slopes from the mean,
/// w_g·g + w_l·l, with the weights of least error at contexts left out: w_g + w_l = 1 inside of the contexts given,
/// w_g + w_l ≤ 1 from a tenth of their range outside on. Numbers are compared by their spread, labels by whether they are
/// the same; repetitions of one context are averaged and count once.
///
/// Parameters
/// ----------
/// contexts : (M, Q) array_like, or M lists of Q numbers and labels
///     Conditions.
/// outputs : (M, P) array_like
///     What was shown in each.
/// map : {"auto", "stacked", "gp", "linear", "polynomial"}
///     As for `fit`.
///
/// Raises
/// ------
/// ValueError
///     Contexts and outputs that do not fit together, or numbers that are not finite.
///
/// References
/// ----------
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 2.7
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct ContextMap(pub(crate) pdmp_core::context::ContextMap);

#[pymethods]
impl ContextMap {
    #[new]
    #[pyo3(signature = (contexts, outputs, map="auto"))]
    fn new(contexts: &Bound<'_, PyAny>, outputs: &Bound<'_, PyAny>, map: &str) -> PyResult<Self> {
        let (rows, outputs) = (crate::convert::contexts(contexts)?, matrix("outputs", "(M, P)", outputs)?);
        let choice: MapChoice = map_of(map)?;
        pdmp_core::context::ContextMap::fit(&rows, outputs.view(), choice).map(Self).map_err(raise)
    }

    /// Which kind of map it is.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind().name()
    }

    /// Mean squared error of each kind that was tried, at contexts left out one by one, with the constants of all.
    #[getter]
    fn errors(&self) -> Vec<(&'static str, f64)> {
        self.0.errors().iter().map(|(kind, error)| (kind.name(), *error)).collect()
    }

    /// Degrees of freedom from which the covariance is known.
    #[getter]
    fn freedom(&self) -> usize {
        self.0.freedom()
    }

    /// Expected outputs (B, P) for contexts (B, Q), and the covariance (B, P, P) of new ones, or None if unknown.
    fn predict<'py>(&self, py: Python<'py>, contexts: &Bound<'_, PyAny>) -> PyResult<(Matrix<'py>, Option<Cube<'py>>)> {
        let found = crate::convert::contexts(contexts)?
            .iter()
            .map(|context| self.0.predict(context))
            .collect::<pdmp_core::Result<Vec<_>>>()
            .map_err(raise)?;
        let n_outputs = found.first().map_or(0, |first| first.mean.len());
        let means = Array2::from_shape_fn((found.len(), n_outputs), |(b, p)| found[b].mean[p]);
        let known = !found.is_empty() && found.iter().all(|expected| expected.covariance.is_some());
        let covariances = known.then(|| {
            let mut covariances = Array3::zeros((found.len(), n_outputs, n_outputs));
            for (expected, mut to) in found.iter().zip(covariances.axis_iter_mut(Axis(0))) {
                expected.covariance.iter().for_each(|covariance| to.assign(covariance));
            }
            covariances.into_pyarray(py)
        });
        Ok((means.into_pyarray(py), covariances))
    }

    fn __repr__(&self) -> String {
        ascii(&format!("<pdmp.ContextMap: {}>", self.0))
    }
}
