//! Stand-alone factorisation of targets.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyUntypedArrayMethods};
use pdmp_core::learning::Truncation;
use pyo3::prelude::*;

use crate::convert::{matrix, to_numpy};
use crate::error::interruptible;
use crate::scalar::{Scalar, optional_count};

/// Leading factors of targets F ≈ S·F_basis (Eq. 7), returned by `factorise`.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Factors {
    /// Styles S (M, J) with orthonormal columns. The entry of largest magnitude in each column is positive.
    styles: Py<PyArray2<f64>>,
    /// Basis targets F_basis = SᵀF (J, C·D). Their rows are orthogonal with the singular values as norms.
    basis_targets: Py<PyArray2<f64>>,
    /// Singular values in decreasing order: all min(M, C·D), or the first J if the others were not computed.
    singular_values: Py<PyArray1<f64>>,
    /// Truncation error ‖F − S·F_basis‖/‖F‖ in the Frobenius norm.
    truncation_error: f64,
}

#[pymethods]
impl Factors {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (styles, targets) = (self.styles.bind(py), self.basis_targets.bind(py));
        let (rows, n_styles, columns) = (styles.shape()[0], styles.shape()[1], targets.shape()[1]);
        Ok(format!(
            "<pdmp.Factors: J = {n_styles} of targets ({rows}, {columns}), truncation error {:.1e}>",
            self.truncation_error
        ))
    }
}

/// Factorises stacked targets by a truncated singular value decomposition (step 3 of Section 3.2).
///
/// F = UΣVᵀ; S is the first J columns of U and F_basis the first J rows of ΣVᵀ, the best approximation of F of rank J.
/// `fit` factorises its targets so. A few factors of many demonstrations are computed by Krylov iteration, others from
/// the Gram matrix or by Householder reflections, depending on J, the shape and the singular values.
///
/// Parameters
/// ----------
/// targets : array_like, (M, C·D)
///     Targets F, one row per demonstration, in any unit.
/// n_styles : int, optional
///     Number J of factors, at most min(M, C·D). By default `singular_value_share` decides.
/// singular_value_share : float
///     Share in (0, 1]: J is the smallest number of singular values whose sum exceeds this share of the sum of all.
///
/// Returns
/// -------
/// Factors
///     Residuals ‖F·v − σ·u‖ are at most 1e-11 times the largest singular value.
///
/// Raises
/// ------
/// ValueError
///     `n_styles` or `singular_value_share` is out of range, or `targets` is empty or not finite.
///
/// References
/// ----------
/// Eckart and Young, Psychometrika 1 (1936), https://doi.org/10.1007/BF02288367
#[pyfunction]
#[pyo3(
    signature = (targets, *, n_styles=None, singular_value_share=Scalar::Number(0.9)),
    text_signature = "(targets, *, n_styles=None, singular_value_share=0.9)"
)]
pub(crate) fn factorise(
    py: Python<'_>,
    targets: &Bound<'_, PyAny>,
    n_styles: Option<Scalar<'_>>,
    singular_value_share: Scalar<'_>,
) -> PyResult<Factors> {
    let share = singular_value_share.number("singular_value_share")?;
    let styles = optional_count("n_styles", n_styles)?.map_or(Truncation::Share(share), Truncation::Rank);
    let targets = matrix("targets", "(M, C·D)", targets)?;
    let factors = interruptible(py, |progress| pdmp_core::learning::Factors::of(targets.view(), styles, progress))?;
    let truncation_error = factors.truncation_error();
    Ok(Factors {
        styles: factors.styles.into_pyarray(py).unbind(),
        basis_targets: factors.basis_targets.into_pyarray(py).unbind(),
        singular_values: to_numpy(py, &factors.singular_values).unbind(),
        truncation_error,
    })
}
