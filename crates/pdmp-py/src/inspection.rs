//! Warnings about implausible samples of demonstrations.

use pdmp_core::preprocessing::inspection::{Finding, inspect, unwound};
use pyo3::prelude::*;

use crate::demonstration::Demonstration;
use crate::error;
use crate::scalar::{Scalar, optional_number};

/// Issues a `UserWarning` for each finding, at the line that called the library.
pub(crate) fn warn(py: Python<'_>, findings: &[Finding]) -> PyResult<()> {
    findings.iter().try_for_each(|finding| error::warn(py, &finding.to_string()))
}

/// Inspects demonstrations as `fit` does.
///
/// Parameters
/// ----------
/// demos : list of Demonstration
///     Demonstrations of one skill.
/// dt : float, optional
///     Sampling interval in s of demonstrations without one.
///
/// Returns
/// -------
/// demos : list of Demonstration
///     The demonstrations as `fit` learns from them, without whole turns between their angles.
/// findings : list of str
///     Descriptions of implausible samples, with their positions.
///
/// Raises
/// ------
/// ValueError
///     `dt` is not a number.
#[pyfunction]
#[pyo3(signature = (demos, *, dt=None))]
pub(crate) fn inspected(
    py: Python<'_>,
    demos: Vec<Demonstration>,
    dt: Option<Scalar<'_>>,
) -> PyResult<(Vec<Demonstration>, Vec<String>)> {
    let dt = optional_number("dt", dt)?;
    Ok(py.detach(|| {
        let demos: Vec<_> = demos.into_iter().map(|demo| demo.0).collect();
        let findings = inspect(&demos, dt).iter().map(ToString::to_string).collect();
        (unwound(&demos).iter().cloned().map(Demonstration).collect(), findings)
    }))
}
