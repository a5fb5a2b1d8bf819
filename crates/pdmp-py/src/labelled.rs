//! Names that objects of Python carry: vectors with names, put into the order of a model, and collections.

use numpy::PyUntypedArray;
use pyo3::PyTypeCheck;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyMapping, PyString, PyTuple};

use crate::convert::{array, refill};
use crate::error::ascii;

/// Conditions whose elements are coordinates.
const OF_COORDINATES: [&str; 3] = ["goal", "start", "anchor"];
/// Conditions whose elements are degrees of freedom.
const OF_DOFS: [&str; 2] = ["velocity", "goal_velocity"];

/// Returns the changes of conditions, those with names in the order of the model.
pub(crate) fn in_order<'py>(
    model: &pdmp_core::Model,
    changes: Option<&Bound<'py, PyDict>>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let Some(changes) = changes else { return Ok(None) };
    let mut ordered = None;
    for (key, value) in changes {
        let argument: String = key.extract()?;
        let names = match argument.as_str() {
            name if OF_COORDINATES.contains(&name) => model.coordinate_names(),
            name if OF_DOFS.contains(&name) => model.names(),
            _ => continue,
        };
        if let Some(values) = arranged(&argument, names, &value)? {
            ordered.get_or_insert(changes.copy()?).set_item(key, values)?;
        }
    }
    Ok(Some(ordered.unwrap_or_else(|| changes.clone())))
}

/// Rejects changes with names where no model is known.
pub(crate) fn reject(changes: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    for (key, value) in changes.into_iter().flatten() {
        let argument: String = key.extract()?;
        let named = OF_COORDINATES.contains(&argument.as_str()) || OF_DOFS.contains(&argument.as_str());
        if named && labels(&value)?.is_some() {
            let text = format!(
                "{argument} has names, which conditions alone cannot put into the order of a model: pass {argument}= to \
                 the rollout or controller, or a list"
            );
            return Err(PyValueError::new_err(ascii(&text)));
        }
    }
    Ok(())
}

/// Copies a vector into a buffer, as `refill`, in the order of these names if its elements have names.
pub(crate) fn refill_in_order(
    argument: &str,
    names: &[String],
    value: &Bound<'_, PyAny>,
    buffer: &mut Vec<f64>,
) -> PyResult<()> {
    let refilled = match arranged(argument, names, value)? {
        Some(values) => refill(argument, &values, buffer),
        None => refill(argument, value, buffer),
    };
    refilled.map_err(|error| match array(argument, value) {
        Ok(found) if found.ndim() != 1 => {
            PyValueError::new_err(format!("{}, {} of them", error.value(value.py()), names.len()))
        }
        _ => error,
    })
}

/// Returns the elements of a mapping or a series, or the columns of a data frame, in the order of these names; `None`
/// for a value without names.
pub(crate) fn arranged<'py>(
    argument: &str,
    names: &[String],
    value: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(labels) = labels(value)? else { return Ok(None) };
    if labels.len() != names.len() || !names.iter().all(|name| labels.contains(name)) {
        let (found, expected) = (labels.join(", "), names.join(", "));
        let text = format!("{argument} has elements {found}, expected one for each of {expected}");
        return Err(PyValueError::new_err(ascii(&text)));
    }
    if value.hasattr("columns")? {
        return value.get_item(PyList::new(value.py(), names)?).map(Some);
    }
    let values: Vec<Bound<'_, PyAny>> = names.iter().map(|name| value.get_item(name)).collect::<PyResult<_>>()?;
    Ok(Some(PyList::new(value.py(), values)?.into_any()))
}

/// Returns the keys of a mapping or a series, or the columns of a data frame, if all are texts.
fn labels(value: &Bound<'_, PyAny>) -> PyResult<Option<Vec<String>>> {
    // The usual commands of a control loop.
    if value.is_instance_of::<PyUntypedArray>() || value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>()
    {
        return Ok(None);
    }
    let keys = match value.getattr("columns") {
        Ok(columns) => columns,
        Err(_) if value.is_instance_of::<PyMapping>() || value.hasattr("iloc")? => value.call_method0("keys")?,
        Err(_) => return Ok(None),
    };
    // Another kind of object may have an attribute of this name.
    let Ok(keys) = keys.try_iter() else { return Ok(None) };
    let keys: Vec<Bound<'_, PyAny>> = keys.collect::<PyResult<_>>()?;
    match !keys.is_empty() && keys.iter().all(|key| key.is_instance_of::<PyString>()) {
        true => keys.iter().map(|key| key.extract()).collect::<PyResult<_>>().map(Some),
        false => Ok(None),
    }
}

/// Returns an attribute of collections of demonstrations: the kind of cycles, or contexts with their names.
pub(crate) fn attribute<'py, T: PyTypeCheck>(demos: &Bound<'py, PyAny>, name: &str) -> Option<Bound<'py, PyAny>> {
    demos.getattr(name).ok().filter(|value| value.cast::<T>().is_ok())
}
