//! Model files.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::convert::{FilePath, Reduced};
use crate::error::raise;
use crate::instance;
use crate::model::Model;

/// Reads a model file.
///
/// Parameters
/// ----------
/// path : path-like
///     A `.safetensors` file that `Model.save` wrote. Files of unknown origin are safe to load: a file contains no code
///     and no reference to other files, needs memory and time in proportion to its size, and generates finite numbers
///     or an error. The checksum detects damage, not intent: the author of a file decides its movements and texts.
///
/// Returns
/// -------
/// Model
///
/// Raises
/// ------
/// OSError
///     The file cannot be read.
/// ModelFileError
///     The file is damaged, not a model, or of another version.
///
/// Examples
/// --------
/// >>> import tempfile, pathlib
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
/// >>> model.save(path)
/// >>> loaded = pdmp.load(path)
/// >>> np.array_equal(loaded.styles, model.styles)
/// True
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: FilePath) -> PyResult<Model> {
    py.detach(|| pdmp_core::Model::load(&path.0)).map(|model| Model(Arc::new(model))).map_err(raise)
}

#[pymethods]
impl Model {
    /// Writes a model file.
    ///
    /// The file is replaced atomically: an interrupted call leaves the old one. A killed process may leave a temporary
    /// file `.pdmp-*.draft` beside it.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     File to write, conventionally with the suffix `.safetensors`.
    /// prior : Prior, optional
    ///     Prior that the file keeps with the model, from `Model.prior`; `Prior.load` reads it.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written, or its folder does not exist.
    /// ValueError
    ///     The prior is of another model.
    ///
    /// Examples
    /// --------
    /// >>> import tempfile, pathlib
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
    /// >>> model.save(path)
    /// >>> path.exists()
    /// True
    /// >>> model.save(path, prior=model.prior(demos))
    /// >>> len(pdmp.Prior.load(path).parameters) == model.n_demos
    /// True
    #[pyo3(signature = (path, *, prior=None))]
    fn save(&self, py: Python<'_>, path: FilePath, prior: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let prior = prior.map(instance::prior).transpose()?;
        let save = || prior.map_or_else(|| self.0.save(&path.0), |prior| prior.save(&self.0, &path.0));
        py.detach(save).map_err(raise)
    }

    /// Returns the contents of a model file as bytes.
    ///
    /// Parameters
    /// ----------
    /// prior : Prior, optional
    ///     Prior that the file keeps with the model, as for `save`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The prior is of another model.
    #[pyo3(signature = (*, prior=None))]
    fn to_bytes<'py>(&self, py: Python<'py>, prior: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyBytes>> {
        let prior = prior.map(instance::prior).transpose()?;
        let bytes = py.detach(|| prior.map_or_else(|| self.0.to_bytes(), |prior| prior.to_bytes(&self.0)));
        Ok(PyBytes::new(py, &bytes.map_err(raise)?))
    }

    /// Reads a model from the contents of a model file.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    ///     Result of `to_bytes`, or the contents of a file that `save` wrote.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     The data are damaged, not a model, or of another version.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| pdmp_core::Model::from_bytes(data)).map(|model| Self(Arc::new(model))).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py, None)?,).into_pyobject(py)?))
    }
}
