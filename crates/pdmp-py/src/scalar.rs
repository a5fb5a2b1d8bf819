//! Conversion of scalar arguments, with errors that name them.

use std::convert::Infallible;

use pyo3::exceptions::{PyException, PyOverflowError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use crate::convert::{check_real, is_masked, quoted};

/// Scalar argument that is converted once its name is known: pyo3 converts arguments before the call, without a name in
/// most of its errors.
pub(crate) enum Scalar<'py> {
    Number(f64),
    Count(usize),
    Object(Bound<'py, PyAny>),
}

impl<'py> FromPyObject<'_, 'py> for Scalar<'py> {
    type Error = Infallible;

    fn extract(value: pyo3::Borrowed<'_, 'py, PyAny>) -> Result<Self, Infallible> {
        Ok(match value.cast_exact::<PyFloat>() {
            Ok(float) => Self::Number(float.value()),
            Err(_) => Self::Object(value.to_owned()),
        })
    }
}

impl Scalar<'_> {
    /// Returns the number, or an error that names the argument.
    pub(crate) fn number(self, name: &str) -> PyResult<f64> {
        match self {
            Self::Number(number) => Ok(number),
            Self::Count(count) => Ok(count as f64),
            Self::Object(value) => number(name, &value),
        }
    }

    /// Returns the whole number, or an error that names the argument.
    pub(crate) fn count(self, name: &str) -> PyResult<usize> {
        match self {
            Self::Count(count) => Ok(count),
            Self::Number(number) => Err(PyValueError::new_err(format!("{name} = {number}: expected one whole number"))),
            Self::Object(value) => {
                let whole: isize =
                    value.extract().map_err(|error| not_scalar(name, &value, error, "one whole number"))?;
                let negative = |_| PyValueError::new_err(format!("{name} = {whole}: must not be negative"));
                usize::try_from(whole).map_err(negative)
            }
        }
    }
}

/// Converts a scalar that may be absent to a number.
pub(crate) fn optional_number(name: &str, value: Option<Scalar<'_>>) -> PyResult<Option<f64>> {
    value.map(|value| value.number(name)).transpose()
}

/// Converts a scalar that may be absent to a whole number.
pub(crate) fn optional_count(name: &str, value: Option<Scalar<'_>>) -> PyResult<Option<usize>> {
    value.map(|value| value.count(name)).transpose()
}

/// Converts to one number: a float, or any object that Python or numpy converts to one. An array with an axis is none,
/// even if it has one element.
pub(crate) fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(float) = value.cast_exact::<PyFloat>() {
        return Ok(float.value());
    }
    let wrong = || PyValueError::new_err(format!("{name} = {}: expected one number", quoted(value)));
    if value.getattr("ndim").is_ok_and(|axes| !axes.eq(0).unwrap_or(false)) || is_masked(value)? {
        return Err(wrong());
    }
    check_real(name, value).map_err(|_| wrong())?;
    value.extract().map_err(|error| not_scalar(name, value, error, "one number"))
}

fn not_scalar(name: &str, value: &Bound<'_, PyAny>, error: PyErr, expected: &str) -> PyErr {
    let py = value.py();
    if !error.is_instance_of::<PyException>(py) {
        return error;
    }
    let too_large = error.is_instance_of::<PyOverflowError>(py);
    let reason = if too_large { "its magnitude is too large".to_string() } else { format!("expected {expected}") };
    PyValueError::new_err(format!("{name} = {}: {reason}", quoted(value)))
}
