//! Blocks of demonstrations from a Python function or list.

use std::sync::{Arc, Mutex, PoisonError};

use pdmp_core::Error;
use pdmp_core::learning::Blocks as CoreBlocks;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyIterator, PyList, PyTuple};

use crate::convert::quoted;
use crate::demonstration::Demonstration;
use crate::fit::demonstrations;

/// Blocks of demonstrations, which can be read more than once.
pub(crate) struct Blocks {
    source: Py<PyAny>,
    /// Exception of the source, or of the conversion of a block.
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Blocks {
    /// Returns the blocks of a function without arguments that returns an iterable of them, or of a list of blocks; `None` for
    /// an argument of demonstrations.
    pub(crate) fn of(demos: &Bound<'_, PyAny>) -> PyResult<Option<Self>> {
        let is_list = demos.is_instance_of::<PyList>() || demos.is_instance_of::<PyTuple>();
        let holds_blocks = is_list && demos.get_item(0).is_ok_and(|first| is_block(&first));
        Ok((demos.is_callable() || holds_blocks).then(|| Self::from_source(demos)))
    }

    /// Returns the blocks of a function, or of an iterable that may be read once only.
    pub(crate) fn from_source(source: &Bound<'_, PyAny>) -> Self {
        Self { source: source.clone().unbind(), raised: Arc::default() }
    }

    /// Returns the iterator of one pass. It attaches to the interpreter for each block.
    pub(crate) fn pass(&self) -> CoreBlocks<'static> {
        let raised = Arc::clone(&self.raised);
        let started = Python::attach(|py| {
            let source = self.source.bind(py);
            let blocks = if source.is_callable() { source.call0()? } else { source.clone() };
            let wrong = |_| {
                let owner = if source.is_callable() { "the function of blocks returned" } else { "blocks =" };
                let expected = "expected a list or another iterable of blocks, each a list of demonstrations";
                PyTypeError::new_err(format!("{owner} {}: {expected}", quoted(&blocks)))
            };
            Ok(blocks.try_iter().map_err(wrong)?.unbind())
        });
        let mut iterator: Option<PyResult<Py<PyIterator>>> = Some(started);
        let mut index = 0;
        Box::new(std::iter::from_fn(move || {
            let next = match iterator.take()? {
                Err(error) => Some(Err(error)),
                Ok(blocks) => Python::attach(|py| {
                    let block = blocks.bind(py).clone().next()?;
                    let block = block.and_then(|block| if block.is_callable() { block.call0() } else { Ok(block) });
                    let block = block.and_then(|block| demonstrations(&format!("block {index}"), &block));
                    index += 1;
                    iterator = block.is_ok().then_some(Ok(blocks));
                    Some(block)
                }),
            };
            next.map(|block| {
                block.map_err(|error| {
                    *raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    Error::Interrupted
                })
            })
        }))
    }

    /// Returns the result of a call that reads the blocks, or the exception of a block.
    pub(crate) fn checked_result<T>(&self, result: PyResult<T>) -> PyResult<T> {
        match self.raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(error) if result.is_err() => Err(error),
            _ => result,
        }
    }
}

/// Returns whether an item of a list is a block of demonstrations: a list of them, an array (B, T, D), or a function that
/// returns one.
fn is_block(item: &Bound<'_, PyAny>) -> bool {
    let is_list = item.is_instance_of::<PyList>() || item.is_instance_of::<PyTuple>();
    if is_list {
        return item
            .get_item(0)
            .is_ok_and(|first| first.is_instance_of::<Demonstration>() || dimensions(&first) == Some(2));
    }
    item.is_callable() || dimensions(item) == Some(3)
}

fn dimensions(item: &Bound<'_, PyAny>) -> Option<usize> {
    item.getattr("ndim").ok()?.extract().ok()
}
