//! The factorisation of targets by itself, in Python.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{matrix, to_numpy};
use crate::error::interruptible;
use crate::fit::style_count;

/// The leading factors of targets F ≈ S·F_basis (Eq. 7), as `pdmp.factorise` finds them.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Factors {
    /// Styles S (M, J) with orthonormal columns, in each of which the entry of largest magnitude is positive.
    styles: Py<PyArray2<f64>>,
    /// Basis targets F_basis (J, C·D) = SᵀF, whose rows are orthogonal and as long as the singular values.
    basis: Py<PyArray2<f64>>,
    /// Singular values in decreasing order: all min(M, C·D), or the first J alone, where the others were not computed.
    singular_values: Py<PyArray1<f64>>,
    /// Share of the targets, by root mean square, that the factors leave out: ‖F − S·F_basis‖/‖F‖.
    truncation_error: f64,
}

#[pymethods]
impl Factors {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (styles, basis) = (self.styles.bind(py), self.basis.bind(py));
        let (rows, n_styles, columns) = (styles.shape()[0], styles.shape()[1], basis.shape()[1]);
        Ok(format!(
            "<pdmp.Factors: J = {n_styles} of targets ({rows}, {columns}), {:.1e} left out>",
            self.truncation_error
        ))
    }
}

/// Factorise stacked targets: the truncated singular value decomposition of step 3 of Section 3.2.
///
/// F = UΣVᵀ, S = the first J columns of U, F_basis = the first J rows of ΣVᵀ: of all products of this shape the one
/// nearest to F. `fit` does this to its targets. Few factors of many demonstrations are found from products with F
/// alone, the others from its Gram matrix or by reflections; which, depends on J, the shape and the singular values.
///
/// Parameters
/// ----------
/// targets : (M, C·D) array_like
///     One row per demonstration.
/// n_styles : int, optional
///     Number of factors J, at most min(M, C·D); otherwise from `singular_value_share`.
/// singular_value_share : float
///     Keep the fewest singular values whose sum exceeds this share of the sum of all.
///
/// Returns
/// -------
/// Factors
///     Residuals ‖F·v − σ·u‖ are at most 1e-11 times the largest singular value.
///
/// Raises
/// ------
/// ValueError
///     A J or share out of range; targets that are empty, or not finite.
///
/// References
/// ----------
/// Eckart and Young, Psychometrika 1 (1936), https://doi.org/10.1007/BF02288367
#[pyfunction]
#[pyo3(signature = (targets, *, n_styles=None, singular_value_share=0.9))]
pub(crate) fn factorise(
    py: Python<'_>,
    targets: &Bound<'_, PyAny>,
    n_styles: Option<isize>,
    singular_value_share: f64,
) -> PyResult<Factors> {
    let styles = style_count(n_styles, singular_value_share)?;
    let targets = matrix("targets", "(M, C·D)", targets)?;
    let factors = interruptible(py, |progress| pdmp_core::learning::Factors::of(targets.view(), styles, progress))?;
    let truncation_error = factors.truncation_error();
    Ok(Factors {
        styles: factors.styles.into_pyarray(py).unbind(),
        basis: factors.basis.into_pyarray(py).unbind(),
        singular_values: to_numpy(py, &factors.singular_values).unbind(),
        truncation_error,
    })
}
