//! Second pass over blocks of demonstrations.

use std::sync::Arc;

use numpy::IntoPyArray;
use pdmp_core::Error;
use pdmp_core::learning::Stage;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::convert::{Matrix, Reduced, items};
use crate::error::{detached, raise};
use crate::fit::demonstrations;
use crate::model::Model;
use crate::scalar::Scalar;

/// Report of the progress of a stage.
pub(crate) type StagedProgress = fn(Python<'_>, Stage, f64) -> PyResult<()>;

/// Factorised targets of a `PartialFit`, which await the styles of its demonstrations.
///
/// Examples
/// --------
/// >>> blocks = [[np.sin(np.linspace(0.0, k, 160))[:, None] for k in (1.0, 2.0)], [np.linspace(0.0, 1.0, 160)[:, None]]]
/// >>> partial = pdmp.PartialFit(blocks[0], dt=0.01)
/// >>> partial.update(blocks[1])
/// >>> factorised = partial.factorise(n_styles=2)
/// >>> projection = factorised.projection
/// >>> parts = [projection.styles(blocks[1], 2), projection.styles(blocks[0], 0)]  # on any machine, in any order
/// >>> factorised.finish(parts).styles.shape
/// (3, 2)
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct FactorisedFit(pub(crate) pdmp_core::learning::FactorisedFit);

impl FactorisedFit {
    /// Returns a model after warnings about its findings.
    pub(crate) fn model(py: Python<'_>, model: pdmp_core::Model) -> PyResult<Model> {
        crate::inspection::warn(py, &model.learnt().findings)?;
        Ok(Model(Arc::new(model)))
    }
}

#[pymethods]
impl FactorisedFit {
    /// Number of styles J.
    #[getter]
    fn n_styles(&self) -> usize {
        self.0.n_styles()
    }

    /// Projection of blocks to their styles, which can be sent to other processes.
    #[getter]
    fn projection(&self) -> StyleProjection {
        StyleProjection(self.0.projection().clone())
    }

    /// Returns the model, given the styles of all blocks in any order.
    ///
    /// Parameters
    /// ----------
    /// styles : list of BlockStyles
    ///     Results of `projection.styles`, each demonstration in one of them.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Demonstrations are missing, repeated or others than those of the partial fit.
    fn finish(&self, py: Python<'_>, styles: &Bound<'_, PyAny>) -> PyResult<Model> {
        let blocks =
            items("styles", styles, |_, item| Ok(item.cast::<BlockStyles>().map_err(PyErr::from)?.get().0.clone()))?;
        let report: StagedProgress = |_, _, _| Ok(());
        let model = detached(py, report, |progress| self.0.clone().finish(blocks, progress))?;
        Self::model(py, model)
    }
}

/// Projection of demonstrations to their styles.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct StyleProjection(pdmp_core::learning::StyleProjection);

#[pymethods]
impl StyleProjection {
    /// Computes the styles of a block.
    ///
    /// Parameters
    /// ----------
    /// demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
    ///     Demonstrations of the partial fit that follow each other.
    /// first : int
    ///     Index of the first of them among all, from 0.
    ///
    /// Returns
    /// -------
    /// BlockStyles
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The demonstrations do not match those of the partial fit.
    fn styles(&self, py: Python<'_>, demos: &Bound<'_, PyAny>, first: Scalar<'_>) -> PyResult<BlockStyles> {
        let (block, first) = (demonstrations("demos", demos)?, first.count("first")?);
        let report = |_: Python<'_>, (), _: f64| Ok(());
        detached(py, report, |progress| self.0.styles(&block, first, &mut |share| progress((), share))).map(BlockStyles)
    }

    /// Returns the projection as bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        bytes(py, self.0.to_bytes())
    }

    /// Reads a projection from bytes.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    ///     Result of `to_bytes`.
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     The data are damaged, of another type or of another version.
    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        pdmp_core::learning::StyleProjection::from_bytes(data).map(Self).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,).into_pyobject(py)?))
    }
}

/// Styles of a block of demonstrations.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct BlockStyles(pdmp_core::learning::BlockStyles);

#[pymethods]
impl BlockStyles {
    /// Styles (B, J); `FactorisedFit.finish` may change their signs.
    #[getter]
    fn styles<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.styles().to_owned().into_pyarray(py)
    }

    /// Returns the styles as bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        bytes(py, self.0.to_bytes())
    }

    /// Reads styles from bytes.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    ///     Result of `to_bytes`.
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     The data are damaged, of another type or of another version.
    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        pdmp_core::learning::BlockStyles::from_bytes(data).map(Self).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,).into_pyobject(py)?))
    }
}

fn bytes<'py>(py: Python<'py>, bytes: Result<Vec<u8>, Error>) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &bytes.map_err(raise)?))
}
