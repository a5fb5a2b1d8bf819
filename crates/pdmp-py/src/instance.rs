//! Conversion of arguments of the module's own classes, with errors that name them.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::{PyClass, pyclass::boolean_struct::True};

use crate::conditions::Conditions;
use crate::convert::quoted;
use crate::demonstration::Demonstration;
use crate::limits::Limits;
use crate::prior::Prior;
use crate::via_point::ViaPoint;
use crate::via_points::AdditionalForcing;

/// Returns the recording that an argument holds.
pub(crate) fn demonstration<'a>(name: &str, value: &'a Bound<'_, PyAny>) -> PyResult<&'a pdmp_core::Demonstration> {
    instance(name, value, "pdmp.Demonstration").map(|demonstration: &Demonstration| &demonstration.0)
}

/// Returns the conditions that an argument holds.
pub(crate) fn conditions<'a>(name: &str, value: &'a Bound<'_, PyAny>) -> PyResult<&'a pdmp_core::Conditions> {
    let expected = "pdmp.Conditions; pass single ones by name, such as style=";
    let expected = if name.starts_with("conditions") { expected } else { "pdmp.Conditions" };
    instance(name, value, expected).map(|conditions: &Conditions| &conditions.0)
}

/// Returns the limits that an argument holds.
pub(crate) fn limits<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<&'a pdmp_core::motion::Limits> {
    instance("limits", value, "pdmp.Limits").map(|limits: &Limits| &limits.0)
}

/// Returns the point that an argument holds.
pub(crate) fn via_point<'a>(name: &str, value: &'a Bound<'_, PyAny>) -> PyResult<&'a ViaPoint> {
    instance(name, value, "pdmp.ViaPoint")
}

/// Returns the additional forcing that an argument holds.
pub(crate) fn forcing<'a>(
    name: &str,
    value: &'a Bound<'_, PyAny>,
) -> PyResult<&'a std::sync::Arc<pdmp_core::dynamics::AdditionalForcing>> {
    instance(name, value, "pdmp.AdditionalForcing").map(|forcing: &AdditionalForcing| &forcing.0)
}

/// Returns the prior that an argument holds.
pub(crate) fn prior<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<&'a pdmp_core::inference::Prior> {
    instance("prior", value, "pdmp.Prior, from Model.prior").map(|prior: &Prior| &prior.0)
}

fn instance<'a, T>(name: &str, value: &'a Bound<'_, PyAny>, expected: &str) -> PyResult<&'a T>
where
    T: PyClass<Frozen = True> + Sync,
{
    let wrong = |_| PyTypeError::new_err(format!("{name} = {}: expected {expected}", quoted(value)));
    value.cast::<T>().map(Bound::get).map_err(wrong)
}

/// Returns the two items of an iterable.
pub(crate) fn pair<'py>(name: &str, value: &Bound<'py, PyAny>, expected: &str) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let wrong = || PyTypeError::new_err(format!("{name} = {}: expected two {expected}", quoted(value)));
    let items: Vec<_> = value.try_iter().map_err(|_| wrong())?.take(3).collect::<PyResult<_>>()?;
    items.try_into().map_err(|_| wrong())
}

/// Returns a function that is called with the progress of a long call.
pub(crate) fn callback<'a, 'py>(
    name: &str,
    value: Option<&'a Bound<'py, PyAny>>,
) -> PyResult<Option<&'a Bound<'py, PyAny>>> {
    match value {
        Some(value) if !value.is_callable() => {
            Err(PyTypeError::new_err(format!("{name} = {}: expected a function", quoted(value))))
        }
        other => Ok(other),
    }
}
