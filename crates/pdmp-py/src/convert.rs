//! Conversion of Python arguments and results: anything that numpy converts to float64 in, float64 out.

use std::path::PathBuf;

use ndarray::{Array1, Array2, ArrayD, Dimension, Ix1};
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray, PyArray1, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayDyn,
    PyArrayLikeDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pdmp_core::demonstration::ContextValue;
use pdmp_core::numerics::Threads;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyException, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple};

use crate::error::{nested, printable, raise};
use crate::scalar::{Scalar, optional_count};

/// Largest number of items in a list of demonstrations, contexts or names. An endless iterable is refused before memory
/// runs out.
const MAX_ITEMS: usize = 1 << 20;

/// A numpy vector, (n,).
pub(crate) type Vector<'py> = Bound<'py, PyArray1<f64>>;
/// A numpy matrix.
pub(crate) type Matrix<'py> = Bound<'py, PyArray2<f64>>;
/// A numpy array of three axes.
pub(crate) type Cube<'py> = Bound<'py, PyArray3<f64>>;

/// Result of `__reduce__`: a callable and its arguments.
pub(crate) type Reduced<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// Converts the items of an iterable one by one. The length that the iterable reports is not used.
pub(crate) fn items<'py, T>(
    name: &str,
    value: &Bound<'py, PyAny>,
    convert: impl Fn(&str, &Bound<'py, PyAny>) -> PyResult<T>,
) -> PyResult<Vec<T>> {
    let expected = || PyTypeError::new_err(format!("{name} = {}: expected a list", quoted(value)));
    if value.is_instance_of::<PyString>() {
        return Err(expected());
    }
    let mut converted = Vec::new();
    for item in value.try_iter().map_err(|_| expected())? {
        if converted.len() == MAX_ITEMS {
            return Err(PyValueError::new_err(format!("{name} has more than {MAX_ITEMS} items")));
        }
        converted.push(convert(&format!("{name}[{}]", converted.len()), &item?)?);
    }
    Ok(converted)
}

/// Path of a file, converted with an error that names the argument.
pub(crate) struct FilePath(pub(crate) PathBuf);

impl<'py> FromPyObject<'_, 'py> for FilePath {
    type Error = PyErr;

    fn extract(value: pyo3::Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = |_| PyTypeError::new_err(format!("path = {}: expected the path of a file", quoted(&value)));
        value.extract().map(Self).map_err(wrong)
    }
}

/// Converts a list of texts.
pub(crate) fn texts(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    items(name, value, |name, item| {
        item.extract().map_err(|_| PyTypeError::new_err(format!("{name} = {}: expected a text", quoted(item))))
    })
}

/// Largest number of characters of a value in an error text.
const MAX_QUOTED: usize = 60;

/// Returns the repr of a value, escaped and at most [`MAX_QUOTED`] characters long, for an error text.
pub(crate) fn quoted(value: &Bound<'_, PyAny>) -> String {
    let kind = || value.get_type().name().map_or_else(|_| "a value".to_string(), |name| format!("<{name}>"));
    let text = value.repr().map_or_else(|_| kind(), |repr| printable(&repr.to_string()));
    if text.chars().count() <= MAX_QUOTED {
        text
    } else {
        text.chars().take(MAX_QUOTED - 3).chain("...".chars()).collect()
    }
}

/// Converts to an array of any dimension, without a copy if it already holds doubles.
fn doubles<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    // An array of doubles is read without a call into Python.
    if value.is_exact_instance_of::<PyArrayDyn<f64>>() {
        return converted(name, value);
    }
    nested(|| converted(name, value))
}

fn converted<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    let Ok(array) = value.cast::<PyUntypedArray>() else { return converted(name, plain(name, value)?.as_any()) };
    let wrong = |reason: &str| Err(PyValueError::new_err(format!("{name} {reason}")));
    match array.dtype().kind() {
        b'f' | b'i' | b'u' | b'b' => {}
        b'O' => {
            for item in value.call_method0("ravel")?.try_iter()? {
                check_real(name, &item?)?;
            }
        }
        // numpy would drop imaginary parts, and read text and dates as numbers.
        _ => return wrong(&format!("has dtype {}: expected real numbers", array.dtype())),
    }
    if is_masked(value)? {
        return wrong(MASKED);
    }
    // A field of a packed record may be unaligned, which a view in Rust must not be.
    if !array.is_aligned() {
        return converted(name, &value.call_method0("copy")?);
    }
    value.extract().map_err(|error: PyErr| not_numbers(name, value.py(), error))
}

const MASKED: &str = "has masked values: fill them, or cut them out";

/// Returns the numpy array of a list or of any object that converts to one.
pub(crate) fn plain<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = value.py();
    check_items(name, value, 0)?;
    let foreign = value.hasattr("__dlpack__")? && !value.hasattr("__array__")?;
    let made = py.import("numpy")?.call_method1(if foreign { "from_dlpack" } else { "asarray" }, (value,));
    Ok(made.map_err(|error| not_numbers(name, py, error))?.cast_into()?)
}

fn not_numbers(name: &str, py: Python<'_>, error: PyErr) -> PyErr {
    if !error.is_instance_of::<PyException>(py) {
        return error;
    }
    PyValueError::new_err(format!("{name} is not an array of numbers: {}", printable(&error.value(py).to_string())))
}

/// Checks that an object holds a real number. `float` would also parse a text.
pub(crate) fn check_real(name: &str, item: &Bound<'_, PyAny>) -> PyResult<()> {
    if item.is_instance_of::<PyFloat>() || item.is_instance_of::<PyInt>() || item.is_none() {
        return Ok(());
    }
    let kind = item.getattr("dtype").and_then(|dtype| dtype.getattr("kind")).and_then(|kind| kind.extract::<char>());
    let text = item.is_instance_of::<PyString>()
        || item.is_instance_of::<PyBytes>()
        || item.is_instance_of::<PyByteArray>()
        || kind.is_ok_and(|kind| !"fiub".contains(kind));
    let reason = match item.get_type().name() {
        _ if text => format!("holds {}: expected real numbers", printable(&item.repr()?.to_string())),
        Ok(kind) if kind == "NAType" => "has missing values: fill them, or cut them out".to_string(),
        _ => return Ok(()),
    };
    Err(PyValueError::new_err(format!("{name} {reason}")))
}

/// Returns whether a masked array of numpy hides an element.
pub(crate) fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    if !value.is_instance_of::<PyUntypedArray>() || value.is_exact_instance_of::<PyUntypedArray>() {
        return Ok(false);
    }
    Ok(value.is_instance(&value.py().import("numpy.ma")?.getattr("MaskedArray")?)?
        && value.getattr("mask")?.call_method0("any")?.is_truthy()?)
}

/// Depth to which nested lists are searched: numpy arrays have at most 64 axes.
const MAX_DEPTH: usize = 64;

/// Rejects values in lists that numpy would convert silently: masked ones and bytearrays.
fn check_items(name: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<()> {
    let wrong = |reason: &str| Err(PyValueError::new_err(format!("{name} {reason}")));
    if value.is_instance_of::<PyByteArray>() {
        return wrong("holds a bytearray: expected real numbers");
    }
    if is_masked(value)? {
        return wrong(MASKED);
    }
    if depth < MAX_DEPTH && (value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>()) {
        for item in value.try_iter()? {
            let item = item?;
            if !item.is_exact_instance_of::<PyFloat>() {
                check_items(name, &item, depth + 1)?;
            }
        }
    }
    Ok(())
}

/// Converts to an array of any dimension.
pub(crate) fn array(name: &str, value: &Bound<'_, PyAny>) -> PyResult<ArrayD<f64>> {
    Ok(doubles(name, value)?.as_array().to_owned())
}

/// Returns positions (T, D).
pub(crate) fn two_axes(name: &str, axes: &str, array: ArrayD<f64>) -> PyResult<Array2<f64>> {
    let shape = array.shape().to_vec();
    array
        .into_dimensionality()
        .map_err(|_| PyValueError::new_err(format!("{name} has shape {shape:?}, expected two axes {axes}")))
}

/// Converts to a vector (n,).
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    // The usual form of a command in a control loop.
    if let Ok(list) = value.cast_exact::<PyList>()
        && list.iter().all(|item| item.is_exact_instance_of::<PyFloat>())
    {
        return list.extract();
    }
    let array = array(name, value)?;
    let shape = array.shape().to_vec();
    let vector = array.into_dimensionality::<Ix1>().map_err(|_| {
        let found = if shape.is_empty() { format!("= {}", quoted(value)) } else { format!("has shape {shape:?}") };
        PyValueError::new_err(format!("{name} {found}, expected one axis: a list or array of numbers"))
    })?;
    Ok(vector.to_vec())
}

/// Copies a vector into a buffer, without allocation if it is an array of doubles and the buffer is large enough.
#[allow(unsafe_code)]
pub(crate) fn refill(name: &str, value: &Bound<'_, PyAny>, buffer: &mut Vec<f64>) -> PyResult<()> {
    let doubles = value.cast::<PyArray1<f64>>().ok();
    // SAFETY: the slice is copied before this thread calls into Python or releases the interpreter, so that no other
    // Python code writes to the array while it is borrowed.
    match doubles.map(|array| unsafe { array.as_slice() }) {
        Some(Ok(values)) => {
            buffer.clear();
            buffer.extend_from_slice(values);
        }
        _ => *buffer = vector(name, value)?,
    }
    Ok(())
}

/// Converts a vector that may be absent.
pub(crate) fn optional(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    value.map(|value| vector(name, value)).transpose()
}

/// Converts a context (Q,) of numbers and labels.
pub(crate) fn context(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<ContextValue>> {
    if value.is_instance_of::<PyString>() || value.is_instance_of::<PyBytes>() {
        return Err(PyTypeError::new_err(format!("{name} is a single text: put it into a list, one value per column")));
    }
    if value.is_instance_of::<PyMapping>() {
        return Err(PyTypeError::new_err(format!("{name} is a mapping: pass its values in a list")));
    }
    let value = &rows_of(name, value)?;
    if value.try_iter().is_err() {
        return Ok(vec![context_value(name, value)?]);
    }
    items(name, value, context_value)
}

/// Returns the array of a data frame, which would iterate over its columns; lists and arrays unchanged.
fn rows_of<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if is_masked(value)? {
        return Err(PyValueError::new_err(format!("{name} {MASKED}")));
    }
    if value.is_instance_of::<PyUntypedArray>() || !(value.hasattr("__array__")? || value.hasattr("__dlpack__")?) {
        return Ok(value.clone());
    }
    Ok(plain(name, value)?.into_any())
}

pub(crate) fn context_value(name: &str, value: &Bound<'_, PyAny>) -> PyResult<ContextValue> {
    if let Ok(label) = value.extract::<String>() {
        return Ok(ContextValue::Label(label));
    }
    check_real(name, value)?;
    value
        .extract()
        .map(ContextValue::Number)
        .map_err(|_| PyTypeError::new_err(format!("{name} = {}: expected a number or a text", quoted(value))))
}

/// Converts contexts (M, Q), or (M,) of one value each, of numbers and labels.
pub(crate) fn contexts(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<ContextValue>>> {
    let value = &rows_of(argument, value)?;
    if let Ok(shape) = value.getattr("shape")
        && let Ok(shape) = shape.cast::<PyTuple>()
        && !(1..=2).contains(&shape.len())
    {
        let shape: Vec<String> = shape.iter().map(|length| length.to_string()).collect();
        let shape = format!("[{}]", shape.join(", "));
        return Err(PyValueError::new_err(format!("{argument} has shape {shape}, expected axes (M, Q) or (M,)")));
    }
    if value.is_instance_of::<PyString>() || value.try_iter().is_err() {
        return Err(PyTypeError::new_err(format!("{argument} must be an array of shape (M, Q) or (M,), or a list")));
    }
    items(argument, value, |name, row| {
        if row.is_instance_of::<PyString>() { Ok(vec![context_value(name, row)?]) } else { context(name, row) }
    })
}

/// Returns a context as an array if all values are numbers, or as a list of numbers and labels.
pub(crate) fn context_to_python<'py>(py: Python<'py>, context: &[ContextValue]) -> PyResult<Bound<'py, PyAny>> {
    let numbers: Option<Vec<f64>> = context
        .iter()
        .map(|value| if let ContextValue::Number(number) = value { Some(*number) } else { None })
        .collect();
    if let Some(numbers) = numbers {
        return Ok(read_only(py, &numbers).into_any());
    }
    let values = context.iter().map(|value| match value {
        ContextValue::Number(number) => number.into_bound_py_any(py),
        ContextValue::Label(label) => label.into_bound_py_any(py),
    });
    Ok(PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)?.into_any())
}

/// Converts one number or a vector; empty if absent.
pub(crate) fn numbers(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let array = array(name, value)?;
    if array.ndim() > 1 {
        let shape = array.shape();
        return Err(PyValueError::new_err(format!("{name} has shape {shape:?}, expected a number or one axis")));
    }
    Ok(array.iter().copied().collect())
}

/// Converts to a matrix with the named axes.
pub(crate) fn matrix(name: &str, axes: &str, value: &Bound<'_, PyAny>) -> PyResult<Array2<f64>> {
    // Copied: other threads may write to the caller's memory during a long call.
    two_axes(name, axes, array(name, value)?)
}

/// Checks that an output is a writable float64 array of the given shape.
pub(crate) fn writable<'py>(out: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Cube<'py>> {
    let wrong = |reason: String| PyValueError::new_err(format!("out: {reason}; expected float64 arrays {shape:?}"));
    let array = out.cast::<PyArray3<f64>>().map_err(|error| wrong(error.to_string()))?;
    if array.shape() != shape {
        return Err(wrong(format!("shape {:?}", array.shape())));
    }
    if !array.is_aligned() {
        return Err(wrong("not aligned in memory".into()));
    }
    if overlaps(array.shape(), array.strides()) {
        return Err(wrong("elements that share memory".into()));
    }
    array.try_readwrite().map_err(|error| wrong(error.to_string()))?;
    Ok(array.clone())
}

/// Returns whether elements of an array may share memory: in order of their strides, each axis must step over the
/// extent of the one before.
fn overlaps(shape: &[usize], strides: &[isize]) -> bool {
    if shape.contains(&0) {
        return false;
    }
    let mut axes: Vec<(usize, usize)> = strides
        .iter()
        .map(|stride| stride.unsigned_abs())
        .zip(shape.iter().copied())
        .filter(|axis| axis.1 > 1)
        .collect();
    axes.sort_unstable();
    let mut reach = size_of::<f64>();
    axes.into_iter().any(|(stride, length)| {
        let over = stride < reach;
        reach = stride.saturating_mul(length);
        over
    })
}

/// Returns a new read-only numpy vector: assignment to an element would not reach the object.
pub(crate) fn read_only<'py>(py: Python<'py>, values: &[f64]) -> Vector<'py> {
    locked(to_numpy(py, values))
}

/// Makes a new array read-only: assignment to an element of a copy would not reach the object.
pub(crate) fn locked<D: Dimension>(array: Bound<'_, PyArray<f64, D>>) -> Bound<'_, PyArray<f64, D>> {
    if let Ok(array) = array.try_readwrite() {
        // The borrow ends, the flag remains.
        drop(array.make_nonwriteable());
    }
    array
}

/// Returns a new numpy vector.
pub(crate) fn to_numpy<'py>(py: Python<'py>, values: &[f64]) -> Vector<'py> {
    Array1::from_vec(values.to_vec()).into_pyarray(py)
}

/// Converts a number of threads; all that the system offers if absent.
pub(crate) fn threads(value: Option<Scalar<'_>>) -> PyResult<Threads> {
    optional_count("threads", value)?.map_or_else(|| Ok(Threads::available()), |n| Threads::new(n).map_err(raise))
}
