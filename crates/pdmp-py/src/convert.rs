//! Arrays across the border: anything numpy can turn into float64 comes in, float64 goes out.

use ndarray::{Array1, Array2, ArrayD, Ix1, Ix2};
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayDyn, PyArrayLikeDyn,
    PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pdmp_core::demonstration::ContextValue;
use pdmp_core::numerics::Threads;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyException, PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyFloat, PyInt, PyList, PyString, PyTuple};

use crate::error::{nested, printable, raise};

/// Most items of a list of demonstrations, contexts or names. Lists without an end are refused before memory is.
const MAX_ITEMS: usize = 1 << 20;

/// A numpy vector, (n,).
pub(crate) type Vector<'py> = Bound<'py, PyArray1<f64>>;
/// A numpy matrix.
pub(crate) type Matrix<'py> = Bound<'py, PyArray2<f64>>;
/// A numpy array of three axes.
pub(crate) type Cube<'py> = Bound<'py, PyArray3<f64>>;

/// What `__reduce__` returns: a callable, and its arguments.
pub(crate) type Reduced<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// The items of a list or any other iterable, each converted as it comes: a length that the iterable reports is not
/// relied on.
pub(crate) fn items<'py, T>(
    name: &str,
    value: &Bound<'py, PyAny>,
    convert: impl Fn(&str, &Bound<'py, PyAny>) -> PyResult<T>,
) -> PyResult<Vec<T>> {
    let expected = || PyTypeError::new_err(format!("{name} must be a list"));
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

/// A list of texts.
pub(crate) fn texts(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    items(name, value, |name, item| {
        item.extract().map_err(|_| PyTypeError::new_err(format!("{name} = {}: expected a text", shown(item))))
    })
}

/// A value as Python writes it.
fn shown(value: &Bound<'_, PyAny>) -> String {
    value.repr().map_or_else(|_| "it".to_string(), |repr| printable(&repr.to_string()))
}

/// An array of any dimension, without a copy where it comes as doubles.
fn doubles<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    // What comes as doubles is read without a call to Python.
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
    // Fields of packed records: a view in Rust steps by whole numbers.
    if !array.is_aligned() {
        return converted(name, &value.call_method0("copy")?);
    }
    value.extract().map_err(|error: PyErr| not_numbers(name, value.py(), error))
}

const MASKED: &str = "has masked values: fill them, or cut them out";

/// The numpy array of a list, or of any object that knows how to become one.
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

/// Checks that `float` finds a real number, and does not read one out of a text.
fn check_real(name: &str, item: &Bound<'_, PyAny>) -> PyResult<()> {
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

/// Whether a mask of numpy hides something.
fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    if !value.is_instance_of::<PyUntypedArray>() || value.is_exact_instance_of::<PyUntypedArray>() {
        return Ok(false);
    }
    Ok(value.is_instance(&value.py().import("numpy.ma")?.getattr("MaskedArray")?)?
        && value.getattr("mask")?.call_method0("any")?.is_truthy()?)
}

/// Deepest list that is searched: numpy has no more axes.
const MAX_DEPTH: usize = 64;

/// Refuses what numpy would take for numbers: in lists, values behind masks and bytes that can be written.
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

/// An array of any dimension.
pub(crate) fn array(name: &str, value: &Bound<'_, PyAny>) -> PyResult<ArrayD<f64>> {
    Ok(doubles(name, value)?.as_array().to_owned())
}

/// Positions, whose axes are time and degree of freedom.
pub(crate) fn two_axes(name: &str, array: ArrayD<f64>) -> PyResult<Array2<f64>> {
    let shape = array.shape().to_vec();
    array
        .into_dimensionality()
        .map_err(|_| PyValueError::new_err(format!("{name} has shape {shape:?}, expected two axes (T, D)")))
}

/// A vector, (n,).
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    // Commands of a loop, mostly.
    if let Ok(list) = value.cast_exact::<PyList>()
        && list.iter().all(|item| item.is_exact_instance_of::<PyFloat>())
    {
        return list.extract();
    }
    let array = array(name, value)?;
    let shape = array.shape().to_vec();
    let vector = array
        .into_dimensionality::<Ix1>()
        .map_err(|_| PyValueError::new_err(format!("{name} has shape {shape:?}, expected one axis")))?;
    Ok(vector.to_vec())
}

/// Returns one number: a float, or anything that Python or numpy turns into one.
pub(crate) fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let single = value.getattr("ndim").is_ok_and(|axes| axes.eq(0).unwrap_or(false));
    let value = if single { &value.call_method0("item")? } else { value };
    value.extract().map_err(|_| {
        let found = value.repr().map_or_else(|_| "a value without repr".to_string(), |text| text.to_string());
        let found: String = found.chars().take(60).collect();
        PyValueError::new_err(format!("{name} = {found}: expected one number"))
    })
}

/// A vector into a buffer that is kept, without allocation if it comes as an array of doubles.
#[allow(unsafe_code)]
pub(crate) fn refill(name: &str, value: &Bound<'_, PyAny>, buffer: &mut Vec<f64>) -> PyResult<()> {
    let doubles = value.cast::<PyArray1<f64>>().ok();
    // SAFETY: the elements are copied at once, and no Python code runs meanwhile.
    match doubles.map(|array| unsafe { array.as_slice() }) {
        Some(Ok(values)) => {
            buffer.clear();
            buffer.extend_from_slice(values);
        }
        _ => *buffer = vector(name, value)?,
    }
    Ok(())
}

/// A vector that may be missing.
pub(crate) fn optional(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    value.map(|value| vector(name, value)).transpose()
}

/// A context (Q,) of numbers and labels.
pub(crate) fn context(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<ContextValue>> {
    if value.is_instance_of::<PyString>() || value.is_instance_of::<PyBytes>() {
        return Err(PyTypeError::new_err(format!("{name} is a single text: put it into a list, one value per column")));
    }
    let value = &rows_of(name, value)?;
    if value.try_iter().is_err() {
        return Ok(vec![context_value(name, value)?]);
    }
    items(name, value, context_value)
}

/// An array in place of a data frame, which would go through its columns; lists and arrays as they are.
fn rows_of<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if is_masked(value)? {
        return Err(PyValueError::new_err(format!("{name} {MASKED}")));
    }
    if value.is_instance_of::<PyUntypedArray>() || !(value.hasattr("__array__")? || value.hasattr("__dlpack__")?) {
        return Ok(value.clone());
    }
    Ok(plain(name, value)?.into_any())
}

fn context_value(name: &str, value: &Bound<'_, PyAny>) -> PyResult<ContextValue> {
    if let Ok(label) = value.extract::<String>() {
        return Ok(ContextValue::Label(label));
    }
    check_real(name, value)?;
    value.extract().map(ContextValue::Number).map_err(|_| {
        let shown = shown(value);
        PyTypeError::new_err(format!("{name} = {shown}: expected a number or a text"))
    })
}

/// Contexts (M, Q) of numbers and labels.
pub(crate) fn contexts(value: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<ContextValue>>> {
    let value = &rows_of("contexts", value)?;
    if let Ok(shape) = value.getattr("shape")
        && let Ok(shape) = shape.cast::<PyTuple>()
        && shape.len() != 2
    {
        let shape: Vec<String> = shape.iter().map(|length| length.to_string()).collect();
        let shape = format!("[{}]", shape.join(", "));
        return Err(PyValueError::new_err(format!("contexts has shape {shape}, expected two axes (M, Q)")));
    }
    if value.try_iter().is_err() {
        return Err(PyTypeError::new_err("contexts must be an array of shape (M, Q), or a list of M lists"));
    }
    items("contexts", value, |name, row| {
        if row.is_instance_of::<PyString>() || row.try_iter().is_err() {
            let shown = shown(row);
            return Err(PyValueError::new_err(format!(
                "{name} = {shown}: expected two axes (M, Q): put the values of each demonstration into a list"
            )));
        }
        context(name, row)
    })
}

/// A context as numpy has it where all are numbers, or as a list with its labels.
pub(crate) fn shown_context<'py>(py: Python<'py>, context: &[ContextValue]) -> PyResult<Bound<'py, PyAny>> {
    let numbers: Option<Vec<f64>> = context
        .iter()
        .map(|value| if let ContextValue::Number(number) = value { Some(*number) } else { None })
        .collect();
    if let Some(numbers) = numbers {
        return Ok(to_numpy(py, &numbers).into_any());
    }
    let values = context.iter().map(|value| match value {
        ContextValue::Number(number) => number.into_bound_py_any(py),
        ContextValue::Label(label) => label.into_bound_py_any(py),
    });
    Ok(PyList::new(py, values.collect::<PyResult<Vec<_>>>()?)?.into_any())
}

/// One number, or a vector.
pub(crate) fn numbers(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let array = array(name, value)?;
    if array.ndim() > 1 {
        let shape = array.shape();
        return Err(PyValueError::new_err(format!("{name} has shape {shape:?}, expected a number or one axis")));
    }
    Ok(array.iter().copied().collect())
}

/// A matrix with the named axes.
pub(crate) fn matrix(name: &str, axes: &str, value: &Bound<'_, PyAny>) -> PyResult<Array2<f64>> {
    // Copied: other threads may write to the caller's memory while a long call reads.
    let array = array(name, value)?;
    let shape = array.shape().to_vec();
    array
        .into_dimensionality::<Ix2>()
        .map_err(|_| PyValueError::new_err(format!("{name} has shape {shape:?}, expected two axes {axes}")))
}

/// A float64 array of this shape that can be written.
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

/// Whether elements of an array may share memory: sorted by stride, each axis must step over the whole of the last.
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

/// A new numpy vector that cannot be written to: assigning to an element would change nothing else.
pub(crate) fn read_only<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Vector<'py>> {
    let vector = to_numpy(py, values);
    vector.call_method(intern!(py, "setflags"), (false,), None)?;
    Ok(vector)
}

/// A new numpy vector.
pub(crate) fn to_numpy<'py>(py: Python<'py>, values: &[f64]) -> Vector<'py> {
    Array1::from_vec(values.to_vec()).into_pyarray(py)
}

/// A count, which cannot be negative.
pub(crate) fn count(name: &str, value: isize) -> PyResult<usize> {
    usize::try_from(value).map_err(|_| PyValueError::new_err(format!("{name} = {value}: must not be negative")))
}

/// A number of threads; without one, as many as the system has.
pub(crate) fn threads(value: Option<isize>) -> PyResult<Threads> {
    let Some(value) = value else { return Ok(Threads::available()) };
    Threads::new(count("threads", value)?).map_err(raise)
}
