//! Output vectors of a controller, which Python reads without a copy.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use ndarray::ArrayView1;
use numpy::PyArray1;
use numpy::npyffi::{_PyArray_GET_ITEM_DATA, NPY_ARRAY_WRITEABLE};
use pyo3::prelude::*;

use crate::convert::Vector;

/// Bits of the outputs, which the loop may write while arrays over them are read.
#[pyclass(frozen, module = "pdmp._native")]
struct Memory(Box<[AtomicU64]>);

/// Vector that the loop writes and Python reads without a copy. Each access returns a new read-only array, so that a
/// change of its shape affects no other reader. numpy does not own the memory, so that it can neither make the array
/// writable nor resize it.
pub(crate) struct Output(Py<Memory>);

impl Output {
    pub(crate) fn new(py: Python<'_>, length: usize) -> PyResult<Self> {
        Py::new(py, Memory((0..length).map(|_| AtomicU64::new(0)).collect())).map(Self)
    }

    pub(crate) fn write(&self, values: &[f64]) {
        for (bits, value) in self.0.get().0.iter().zip(values) {
            bits.store(value.to_bits(), Relaxed);
        }
    }

    #[allow(unsafe_code)]
    pub(crate) fn view<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let memory = &self.0.get().0;
        // SAFETY: the pointer and the length are those of the boxed slice, which is neither moved nor freed while the
        // array refers to its owner as base. `AtomicU64` has the size and alignment of `f64`, and every bit pattern is
        // an `f64`. The writable flag of the new array is cleared before any other code sees it.
        // Stores are atomic and aligned, so that a concurrent load by numpy reads a whole number.
        unsafe {
            let numbers = ArrayView1::from_shape_ptr(memory.len(), memory.as_ptr().cast::<f64>());
            let array = PyArray1::borrow_from_array(&numbers, self.0.bind(py).clone().into_any());
            (*_PyArray_GET_ITEM_DATA(array.as_ptr().cast())).flags &= !NPY_ARRAY_WRITEABLE;
            array
        }
    }
}
