//! Conversion of conditions, keywords and contexts to the conditions of a batch.

use ndarray::{Array2, Ix2};
use pdmp_core::Error;
use pdmp_core::model::Conditions as Inner;
use pdmp_core::motion::{BatchConditions, PerMovement};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::conditions::{Conditions, changed, reject_style};
use crate::convert::{array, items};
use crate::error::raise;
use crate::instance;
use crate::named_contexts::{contexts_for, warn_of_extrapolation};

/// Returns the conditions of a batch: `conditions` of all movements or of each, single ones replaced by `changes`, those
/// absent from both predicted for the context of all movements or of each.
pub(crate) fn batch_conditions_of(
    py: Python<'_>,
    model: &pdmp_core::Model,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<BatchConditions> {
    let (common, rows) = split(py, crate::labelled::in_order(model, changes)?.as_ref())?;
    let (mut bases, mut is_list) = match conditions {
        None => (vec![Inner::default()], false),
        Some(list) if !list.is_instance_of::<Conditions>() && list.try_iter().is_ok() => {
            (items("conditions", list, |name, item| instance::conditions(name, item).cloned())?, true)
        }
        Some(one) => (vec![instance::conditions("conditions", one)?.clone()], false),
    };
    for base in &mut bases {
        *base = changed(std::mem::take(base), Some(&common))?;
    }
    if let Some(context) = context {
        let has_style = rows.iter().any(|(name, _)| name == "style") || bases.iter().any(|base| base.style.is_some());
        reject_style(has_style)?;
        let (contexts, is_matrix) = contexts_for(model, context)?;
        let predict = || contexts.iter().map(|context| model.predict(context)).collect::<pdmp_core::Result<Vec<_>>>();
        let predictions = py.detach(predict).map_err(raise)?;
        warn_of_extrapolation(py, model, &contexts, &predictions)?;
        let predicted: Vec<Inner> = predictions.into_iter().map(|prediction| prediction.conditions).collect();
        let (found, expected) = (predicted.len(), bases.len());
        if is_matrix && is_list && found != expected {
            return Err(raise(Error::Rows { name: "context", expected, found }));
        }
        let n_movements = if is_matrix { found } else { expected };
        let bases_of_all = bases.into_iter().cycle().zip(predicted.into_iter().cycle()).take(n_movements);
        bases = bases_of_all.map(|(base, predicted)| base.or(predicted)).collect();
        is_list |= is_matrix;
    }
    let made = match bases.pop() {
        Some(one) if !is_list => BatchConditions::shared(model.primitive(), one),
        last => {
            bases.extend(last);
            BatchConditions::each(model.primitive(), &bases)
        }
    };
    let mut made = made.map_err(raise)?;
    for (name, rows) in rows {
        // A time constant and segment durations stand for each other.
        match name.as_str() {
            "tau" => made.segment_durations = None,
            "segment_durations" => made.tau = None,
            _ => {}
        }
        if let Some(condition) = vectors(&mut made, &name) {
            *condition = Some(PerMovement::Each(rows));
        }
    }
    Ok(made)
}

/// Conditions that are numbers.
const NUMBERS: [&str; 3] = ["amplitude", "tau", "phase"];

/// Conditions by name, with one row for each movement (B, n).
type Rows = Vec<(String, Array2<f64>)>;

/// Divides keywords into those that hold for all movements and those with one row for each.
fn split<'py>(py: Python<'py>, changes: Option<&Bound<'py, PyDict>>) -> PyResult<(Bound<'py, PyDict>, Rows)> {
    let (common, mut each) = (PyDict::new(py), Vec::new());
    for (key, value) in changes.into_iter().flatten() {
        let name: String = key.extract()?;
        let is_number = NUMBERS.contains(&name.as_str());
        let is_one = is_number && (value.len().is_err() || value.is_instance_of::<PyString>());
        if value.is_none() || is_one || vectors(&mut BatchConditions::default(), &name).is_none() {
            common.set_item(key, value)?;
            continue;
        }
        let rows = array(&name, &value)?;
        let n = rows.len();
        match rows.ndim() + usize::from(is_number) {
            1 => common.set_item(key, value)?,
            2 if is_number => {
                let column = rows.into_shape_with_order((n, 1));
                each.push((name, column.map_err(|_| PyValueError::new_err("axes"))?));
            }
            2 => each.push((name, rows.into_dimensionality::<Ix2>().map_err(|_| PyValueError::new_err("axes"))?)),
            _ => {
                let expected = match name.as_str() {
                    _ if is_number => "expected a number or (B,)",
                    "style" => "expected (J,) or (B, J)",
                    "segment_durations" => "expected (K,) or (B, K)",
                    _ => "expected (D,) or (B, D)",
                };
                let shape = rows.shape();
                return Err(PyValueError::new_err(format!("{name} has shape {shape:?}, {expected}")));
            }
        }
    }
    Ok((common, each))
}

/// Returns the condition of a name, if it may differ between the movements.
fn vectors<'a>(conditions: &'a mut BatchConditions, name: &str) -> Option<&'a mut Option<PerMovement>> {
    match name {
        "style" => Some(&mut conditions.style),
        "goal" => Some(&mut conditions.goal),
        "start" => Some(&mut conditions.start),
        "velocity" => Some(&mut conditions.velocity),
        "goal_velocity" => Some(&mut conditions.goal_velocity),
        "anchor" => Some(&mut conditions.anchor),
        "amplitude" => Some(&mut conditions.amplitude),
        "tau" => Some(&mut conditions.tau),
        "segment_durations" => Some(&mut conditions.segment_durations),
        "phase" => Some(&mut conditions.phase),
        _ => None,
    }
}
