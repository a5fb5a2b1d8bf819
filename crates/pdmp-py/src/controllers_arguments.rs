//! Arguments with one row for each of many movements.

use ndarray::{ArrayView2, Axis};
use numpy::{PyArray1, PyArrayMethods};
use pdmp_core::Error;
use pdmp_core::model::Conditions as Inner;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::{Conditions, changed, reject_style};
use crate::convert::{array, items, plain};
use crate::error::raise;
use crate::instance;
use crate::named_contexts::{contexts_for, warn_of_extrapolation};

/// Commands of a tick, in memory that later ticks use again.
#[derive(Default)]
pub(crate) struct Buffers {
    rows: [Rows; 5],
    numbers: [Option<Vec<f64>>; 4],
}

#[derive(Default)]
struct Rows {
    values: Vec<f64>,
    shape: [usize; 2],
    is_present: bool,
}

impl Buffers {
    /// Reads a matrix (B, n), or a vector (n,) for all.
    pub(crate) fn read_rows(
        &mut self,
        slot: usize,
        name: &str,
        value: Option<&Bound<'_, PyAny>>,
        shape: [usize; 2],
    ) -> PyResult<()> {
        let rows = &mut self.rows[slot];
        rows.is_present = value.is_some();
        let Some(value) = value else { return Ok(()) };
        let (given, [n, columns]) = (array(name, value)?, shape);
        let found = given.shape().to_vec();
        let wrong = || {
            let expected = format!("expected ({n}, {columns}), or ({columns},) for all movements");
            PyValueError::new_err(format!("{name} has shape {found:?}, {expected}"))
        };
        if !(found == [n, columns] || found == [columns]) {
            return Err(wrong());
        }
        rows.values.clear();
        for _ in 0..if found.len() == 1 { n } else { 1 } {
            rows.values.extend(&given);
        }
        rows.shape = shape;
        Ok(())
    }

    /// Reads numbers (B,), or one for all.
    pub(crate) fn read_numbers(
        &mut self,
        slot: usize,
        name: &str,
        value: Option<&Bound<'_, PyAny>>,
        n: usize,
    ) -> PyResult<()> {
        self.numbers[slot] = value.map(|value| number_each(name, value, n)).transpose()?;
        Ok(())
    }

    pub(crate) fn rows(&self, slot: usize) -> Option<ArrayView2<'_, f64>> {
        let Rows { values, shape, is_present } = &self.rows[slot];
        is_present.then(|| ArrayView2::from_shape(*shape, values).ok()).flatten()
    }

    pub(crate) fn numbers(&self, slot: usize) -> Option<&[f64]> {
        self.numbers[slot].as_deref()
    }
}

/// Converts numbers (B,), or one for all movements.
pub(crate) fn number_each(name: &str, value: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<f64>> {
    let given = array(name, value)?;
    match given.shape() {
        [] => Ok(vec![given.sum(); n]),
        [found] if *found == n => Ok(given.iter().copied().collect()),
        shape => {
            let text = format!("{name} has shape {shape:?}, expected ({n},), or one number for all movements");
            Err(PyValueError::new_err(text))
        }
    }
}

/// Converts a mask (B,).
pub(crate) fn mask(value: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<bool>> {
    let given = plain("mask", value)?;
    let wrong = || PyValueError::new_err(format!("mask: expected {n} truth values, one for each movement"));
    let mask = given.cast::<PyArray1<bool>>().map_err(|_| wrong())?.to_vec()?;
    if mask.len() == n { Ok(mask) } else { Err(wrong()) }
}

/// Converts indices of movements or a mask (B,); all movements if absent.
pub(crate) fn movements(value: Option<&Bound<'_, PyAny>>, n: usize) -> PyResult<Vec<usize>> {
    let Some(value) = value else { return Ok((0..n).collect()) };
    if plain("movements", value)?.cast::<PyArray1<bool>>().is_ok() {
        let selected = mask(value, n)?;
        return Ok((0..n).filter(|&b| selected[b]).collect());
    }
    let index = |name: &str, item: &Bound<'_, PyAny>| {
        let index: isize = item.extract().map_err(|_| PyValueError::new_err(format!("{name}: expected an index")))?;
        let b = if index < 0 { index + n as isize } else { index };
        let beyond = || PyValueError::new_err(format!("{name} = {index}: there are {n} movements"));
        usize::try_from(b).ok().filter(|b| *b < n).ok_or_else(beyond)
    };
    items("movements", value, index)
}

/// Returns the conditions of each of `n` movements: `conditions` of all or of each, single ones replaced by `changes` with
/// one row for each or one value for all, those absent from both predicted for the context of all or of each.
pub(crate) fn conditions_of_each(
    py: Python<'_>,
    model: &pdmp_core::Model,
    n: usize,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Inner>> {
    let (common, each) = (PyDict::new(py), PyDict::new(py));
    for (key, value) in crate::labelled::in_order(model, changes)?.iter().flatten() {
        let name: String = key.extract()?;
        let n_axes = if matches!(name.as_str(), "tau" | "amplitude" | "phase") { 1 } else { 2 };
        let has_rows = !value.is_none() && array(&name, &value).is_ok_and(|array| array.ndim() == n_axes);
        if has_rows { each.set_item(key, value)? } else { common.set_item(key, value)? }
    }
    let listed = match conditions {
        None => vec![Inner::default()],
        Some(list) if !list.is_instance_of::<Conditions>() && list.try_iter().is_ok() => {
            items("conditions", list, |name, item| instance::conditions(name, item).cloned())?
        }
        Some(one) => vec![instance::conditions("conditions", one)?.clone()],
    };
    let is_each = |name: &'static str, found: usize| {
        if found == n || found == 1 { Ok(()) } else { Err(raise(Error::Rows { name, expected: n, found })) }
    };
    is_each("conditions", listed.len())?;
    let bases = listed.into_iter().map(|one| changed(one, Some(&common))).collect::<PyResult<Vec<_>>>()?;
    let mut all: Vec<Inner> = bases.into_iter().cycle().take(n).collect();
    for (key, value) in each {
        let name: String = key.extract()?;
        let rows = array(&name, &value)?;
        if rows.shape()[0] != n {
            let text = format!("{name} has {} rows, but there are {n} movements", rows.shape()[0]);
            return Err(PyValueError::new_err(text));
        }
        for (one, row) in all.iter_mut().zip(rows.axis_iter(Axis(0))) {
            let row: Vec<f64> = row.iter().copied().collect();
            let change = PyDict::new(py);
            match row[..] {
                [number] if rows.ndim() == 1 => change.set_item(&name, number)?,
                _ => change.set_item(&name, row)?,
            }
            *one = changed(std::mem::take(one), Some(&change))?;
        }
    }
    if let Some(context) = context {
        reject_style(all.iter().any(|one| one.style.is_some()))?;
        let (contexts, _) = contexts_for(model, context)?;
        is_each("context", contexts.len())?;
        let predict = || contexts.iter().map(|context| model.predict(context)).collect::<pdmp_core::Result<Vec<_>>>();
        let predictions = py.detach(predict).map_err(raise)?;
        warn_of_extrapolation(py, model, &contexts, &predictions)?;
        let predicted: Vec<Inner> = predictions.into_iter().map(|prediction| prediction.conditions).collect();
        let predicted = predicted.into_iter().cycle();
        all = all.into_iter().zip(predicted).map(|(one, predicted)| one.or(predicted)).collect();
    }
    Ok(all)
}
