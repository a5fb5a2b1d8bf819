//! Conversion of contexts with names: mappings, named records and data frames.

use pdmp_core::Model;
use pdmp_core::context::ContextMap;
use pdmp_core::demonstration::ContextValue;
use pdmp_core::model::Prediction;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};

use crate::convert::{context, context_value, contexts, items};
use crate::error::{raise, warn};

/// Context values of one movement.
type Context = Vec<ContextValue>;
/// Names of context values, with the values.
type Named = Vec<(String, ContextValue)>;

/// Converts the context (Q,) of a movement of a model; a mapping or a named record in any order.
pub(crate) fn context_for(model: &Model, value: &Bound<'_, PyAny>) -> PyResult<Context> {
    match named("context", value)? {
        Some(values) => ordered(model.map(), &values),
        None => context("context", value),
    }
}

/// Returns the prediction for a context. A warning says that the context lies outside the demonstrated ones.
pub(crate) fn predicted(py: Python<'_>, model: &Model, context: &[ContextValue]) -> PyResult<Prediction> {
    let prediction = model.predict(context).map_err(raise)?;
    warn_of_extrapolation(py, model, &[context], std::slice::from_ref(&prediction))?;
    Ok(prediction)
}

/// Warns about the context that lies farthest outside the demonstrated ones, if by more than a tenth of their range.
pub(crate) fn warn_of_extrapolation(
    py: Python<'_>,
    model: &Model,
    contexts: &[impl AsRef<[ContextValue]>],
    predictions: &[Prediction],
) -> PyResult<()> {
    let far = predictions.iter().enumerate().filter_map(|(b, prediction)| {
        let column = prediction.far_value()?;
        Some((b, column, prediction.extrapolation[column]))
    });
    let Some((b, column, distance)) = far.max_by(|one, other| one.2.total_cmp(&other.2)) else { return Ok(()) };
    let name = model.map().and_then(|map| map.names().get(column));
    let name = name.map_or_else(|| column.to_string(), |name| format!("{name:?}"));
    let value = match &contexts[b].as_ref()[column] {
        ContextValue::Number(number) => format!("{number}"),
        ContextValue::Label(label) => format!("{label:?}"),
    };
    let place = if distance.is_finite() {
        format!("lies outside the demonstrated range, by {distance:.2} times that range")
    } else {
        "differs from the only demonstrated value".to_string()
    };
    warn(py, &format!("context[{name}] = {value} {place}: the movement is an extrapolation"))
}

/// Converts a context (Q,), or contexts (B, Q). The second value is true for contexts.
pub(crate) fn contexts_for(model: &Model, value: &Bound<'_, PyAny>) -> PyResult<(Vec<Context>, bool)> {
    let is_row = |item: &Bound<'_, PyAny>| !item.is_instance_of::<PyString>() && item.try_iter().is_ok();
    let is_matrix = match value.cast::<PyMapping>() {
        Ok(columns) => columns.values()?.iter().any(|column| is_row(&column)),
        Err(_) => is_matrix(value, is_row)?,
    };
    if !is_matrix {
        return Ok((vec![context_for(model, value)?], false));
    }
    let (names, rows) = named_contexts("context", value)?;
    let in_order = |row: Context| match (&names, model.map()) {
        (Some(names), Some(map)) if !map.names().is_empty() => {
            ordered(Some(map), &names.iter().cloned().zip(row).collect::<Named>())
        }
        _ => Ok(row),
    };
    Ok((rows.into_iter().map(in_order).collect::<PyResult<_>>()?, true))
}

fn is_matrix(value: &Bound<'_, PyAny>, is_row: impl Fn(&Bound<'_, PyAny>) -> bool) -> PyResult<bool> {
    Ok(match value.getattr("ndim").and_then(|axes| axes.extract::<usize>()) {
        Ok(axes) => axes > 1 || (axes == 1 && record_names(value)?.is_some()),
        Err(_) if column_names(value)?.is_some() => true,
        Err(_) => is_row(value) && value.get_item(0).is_ok_and(|first| is_row(&first)),
    })
}

/// Converts contexts (M, Q), with the names of their columns where they have any.
pub(crate) fn named_contexts(
    argument: &str,
    value: &Bound<'_, PyAny>,
) -> PyResult<(Option<Vec<String>>, Vec<Context>)> {
    if let Ok(columns) = value.cast::<PyMapping>() {
        let names: Vec<String> = columns.keys()?.extract()?;
        let columns = columns.values()?.iter().zip(&names);
        let columns: Vec<Context> = columns
            .map(|(column, name)| context(&format!("{argument}[{name:?}]"), &column))
            .collect::<PyResult<_>>()?;
        let n = columns.first().map_or(0, Vec::len);
        if columns.iter().any(|column| column.len() != n) {
            return Err(PyValueError::new_err(format!(
                "{argument}: columns of different lengths; one value per movement"
            )));
        }
        return Ok((Some(names), (0..n).map(|m| columns.iter().map(|column| column[m].clone()).collect()).collect()));
    }
    if let Some(names) = record_names(value)? {
        return Ok((Some(names), contexts(argument, &value.call_method0("tolist")?)?));
    }
    if let Some(names) = column_names(value)? {
        return Ok((Some(names), contexts(argument, value)?));
    }
    let first = value.get_item(0).ok().filter(|_| value.getattr("ndim").is_err());
    let Some(first) = first.map(|first| named(argument, &first)).transpose()?.flatten() else {
        return Ok((None, contexts(argument, value)?));
    };
    let names: Vec<String> = first.into_iter().map(|(name, _)| name).collect();
    let rows = items(argument, value, |own, row| {
        let values = named(own, row)?.unwrap_or_default();
        let value = |name: &String| values.iter().find(|(key, _)| key == name).map(|(_, value)| value.clone());
        let row: Option<Context> = names.iter().map(value).collect();
        row.filter(|row| row.len() == values.len())
            .ok_or_else(|| PyValueError::new_err(format!("{own}: expected one value for each of {}", names.join(", "))))
    })?;
    Ok((Some(names), rows))
}

/// Converts contexts of M demonstrations as `fit` does.
///
/// Parameters
/// ----------
/// contexts : array_like, (M, Q) or (M,), or M lists of Q numbers and labels, or mapping
///     Contexts of the demonstrations.
///
/// Returns
/// -------
/// list of list of float or str
///     Q numbers and labels of each demonstration.
///
/// Raises
/// ------
/// ValueError
///     Another shape, or columns of different lengths.
/// TypeError
///     A value that is neither a number nor a text.
#[pyfunction]

pub(crate) fn context_rows<'py>(contexts: &Bound<'py, PyAny>) -> PyResult<Vec<Vec<Bound<'py, PyAny>>>> {
    let py = contexts.py();
    let to_python = |value: ContextValue| match value {
        ContextValue::Number(number) => number.into_bound_py_any(py),
        ContextValue::Label(label) => label.into_bound_py_any(py),
    };
    let (_, rows) = named_contexts("contexts", contexts)?;
    rows.into_iter().map(|row| row.into_iter().map(to_python).collect()).collect()
}

fn ordered(map: Option<&ContextMap>, values: &[(String, ContextValue)]) -> PyResult<Context> {
    match map {
        Some(map) => map.named(values).map_err(raise),
        None => Ok(values.iter().map(|(_, value)| value.clone()).collect()),
    }
}

/// Converts a mapping, or a row of a table with names; `None` for another value.
fn named(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Option<Named>> {
    let names: Vec<String> = match (value.cast::<PyMapping>(), record_names(value)?) {
        (Ok(mapping), _) => mapping.keys()?.extract()?,
        (_, Some(names)) => names,
        // A row of a data frame.
        _ => match value.call_method0("keys").and_then(|keys| keys.try_iter()?.map(|key| key?.extract()).collect()) {
            Ok(names) => names,
            Err(_) => return Ok(None),
        },
    };
    let value =
        |name: &String| Ok((name.clone(), context_value(&format!("{argument}[{name:?}]"), &value.get_item(name)?)?));
    names.iter().map(value).collect::<PyResult<Named>>().map(Some)
}

/// Returns the names of the fields of a record or of an array of records.
fn record_names(value: &Bound<'_, PyAny>) -> PyResult<Option<Vec<String>>> {
    let names = value.getattr("dtype").and_then(|dtype| dtype.getattr("names"));
    names.ok().filter(|names| !names.is_none()).map(|names| names.extract()).transpose()
}

/// Returns the names of the columns of a data frame, if all are texts.
fn column_names(value: &Bound<'_, PyAny>) -> PyResult<Option<Vec<String>>> {
    let Ok(columns) = value.getattr("columns") else { return Ok(None) };
    Ok(columns.try_iter()?.map(|name| name?.extract()).collect::<PyResult<_>>().ok())
}
