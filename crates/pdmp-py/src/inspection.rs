//! What an inspection of demonstrations finds, as warnings of Python.

use std::ffi::CString;

use pdmp_core::preprocessing::inspection::{Finding, inspect, unwound};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

use crate::demonstration::Demonstration;

/// Warns of every finding, at the line that called the library.
pub(crate) fn warn(py: Python<'_>, findings: &[Finding]) -> PyResult<()> {
    let category = py.get_type::<PyUserWarning>();
    for finding in findings {
        PyErr::warn(py, &category, &CString::new(finding.to_string())?, 1)?;
    }
    Ok(())
}

/// Inspect demonstrations as `fit` does.
///
/// Parameters
/// ----------
/// demos : list of Demonstration
///     Demonstrations of one skill.
/// dt : float, optional
///     Sampling interval in s of those that carry none.
///
/// Returns
/// -------
/// list of Demonstration
///     The same, without the whole turns by which angles lie apart, as `fit` learns from them.
/// list of str
///     What is implausible about them, with its place.
#[pyfunction]
#[pyo3(signature = (demos, *, dt=None))]
pub(crate) fn inspected(
    py: Python<'_>,
    demos: Vec<Demonstration>,
    dt: Option<f64>,
) -> (Vec<Demonstration>, Vec<String>) {
    py.detach(|| {
        let demos: Vec<_> = demos.into_iter().map(|demo| demo.0).collect();
        let findings = inspect(&demos, dt).iter().map(ToString::to_string).collect();
        (unwound(&demos).iter().cloned().map(Demonstration).collect(), findings)
    })
}
