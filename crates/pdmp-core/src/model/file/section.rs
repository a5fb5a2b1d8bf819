//! Arrays of a prior in the file of its model.

use std::collections::BTreeMap;

use super::{ensure, unreadable};
use crate::error::Result;

/// Start of the names of all arrays of a prior.
pub(super) const PREFIX: &str = "prior.";

/// Arrays of a prior, with the version of their format.
pub(crate) struct Section {
    pub(crate) version: u32,
    /// Shape, and elements by rows, of each array by its name.
    pub(super) arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
}

impl Section {
    /// Creates a section without arrays.
    pub(crate) fn new(version: u32) -> Self {
        Self { version, arrays: BTreeMap::new() }
    }

    /// Adds an array with its elements by rows.
    pub(crate) fn with_array(mut self, name: &str, shape: &[usize], data: Vec<f64>) -> Self {
        self.arrays.insert(format!("{PREFIX}{name}"), (shape.to_vec(), data));
        self
    }

    /// Returns the shape of an array.
    ///
    /// # Errors
    /// No array of this name.
    pub(crate) fn shape_of(&self, name: &str) -> Result<Vec<usize>> {
        let name = format!("{PREFIX}{name}");
        self.arrays.get(&name).map(|(shape, _)| shape.clone()).ok_or_else(|| unreadable(format!("no array {name}")))
    }

    /// Takes the elements of an array out.
    ///
    /// # Errors
    /// No array of this name, or one of another shape.
    pub(crate) fn take_array(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let name = format!("{PREFIX}{name}");
        let (found, data) = self.arrays.remove(&name).ok_or_else(|| unreadable(format!("no array {name}")))?;
        ensure(found == shape, &format!("{name} is {found:?}, expected {shape:?}"))?;
        Ok(data)
    }

    /// Checks that every array was taken out.
    ///
    /// # Errors
    /// An array is left.
    pub(crate) fn close(self) -> Result<()> {
        ensure(self.arrays.is_empty(), "it contains arrays that do not belong to a prior")
    }
}
