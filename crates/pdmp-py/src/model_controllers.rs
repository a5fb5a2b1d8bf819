//! Start of many movements that are computed together.

use std::sync::Arc;

use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pdmp_core::numerics::Threads;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::controllers::Controllers;
use crate::controllers_arguments::conditions_of_each;
use crate::convert::{Matrix, items, threads};
use crate::error::raise;
use crate::instance;
use crate::model::Model;
use crate::motion::warn_of_long_tick;
use crate::scalar::{Scalar, optional_number};

#[pymethods]
impl Model {
    /// Starts many movements that are computed together, tick by tick.
    ///
    /// Parameters
    /// ----------
    /// n_movements : int
    ///     Number B of movements.
    /// dt : float
    ///     Length of a tick in s.
    /// conditions : Conditions, or B Conditions, optional
    ///     Conditions of all movements at the start, or of each.
    /// limits : Limits, optional
    ///     Limits of every movement, see `Controller.limits`.
    /// transition : float, optional
    ///     As in `controller`.
    /// context : array_like or list, (Q,) or (B, Q), optional
    ///     Context of all movements, or of each, whose prediction supplies absent conditions.
    /// out : tuple of ndarray, (B, D), optional
    ///     Writable float64 arrays, contiguous by rows, for positions, velocities and accelerations.
    /// threads : int, optional
    ///     Number of threads of a tick, by default one. The others wait for the next tick, for some fifty microseconds without
    ///     sleep, and end with the movements. The motion does not depend on it.
    /// **changes
    ///     Single conditions by name, as in `rollout`; each may have a leading axis, with one row for each movement.
    ///
    /// Returns
    /// -------
    /// Controllers
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An argument that `controller` rejects, no movement, more than fit into memory, or rows or `out` that do not fit.
    /// TypeError
    ///     As in `controller`.
    ///
    /// Warns
    /// -----
    /// UserWarning
    ///     As in `controller`, of the context that lies farthest outside.
    ///
    /// Examples
    /// --------
    /// >>> goals = [[1.0, 0.1], [1.1, 0.0], [0.9, 0.2]]
    /// >>> controllers = model.controllers(3, dt=0.01, goal=goals)
    /// >>> while controllers.step().any():
    /// ...     pass
    /// >>> np.allclose(controllers.position, goals, atol=0.01)
    /// True
    #[pyo3(
        signature = (
            n_movements, dt=Scalar::Number(0.001), conditions=None, *, limits=None, transition=None, context=None, out=None,
            threads=None, **changes
        ),
        text_signature = "($self, n_movements, dt=0.001, conditions=None, *, limits=None, transition=None, context=None, \
                          out=None, threads=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn controllers(
        &self,
        py: Python<'_>,
        n_movements: Scalar<'_>,
        dt: Scalar<'_>,
        conditions: Option<&Bound<'_, PyAny>>,
        limits: Option<&Bound<'_, PyAny>>,
        transition: Option<Scalar<'_>>,
        context: Option<&Bound<'_, PyAny>>,
        out: Option<&Bound<'_, PyAny>>,
        threads: Option<Scalar<'_>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Controllers> {
        let n = n_movements.count("n_movements")?;
        let threads = threads.map_or(Ok(Threads::ONE), |threads| self::threads(Some(threads)))?;
        let (dt, transition) = (dt.number("dt")?, optional_number("transition", transition)?);
        if n == 0 {
            return Err(PyValueError::new_err("n_movements = 0: start at least one movement"));
        }
        pdmp_core::motion::Controllers::check_memory(self.0.primitive(), n).map_err(raise)?;
        let conditions = conditions_of_each(py, &self.0, n, conditions, context, changes)?;
        let mut inner =
            pdmp_core::motion::Controllers::new(self.0.primitive(), dt, &conditions, transition).map_err(raise)?;
        warn_of_long_tick(py, inner.get(0).map_err(raise)?)?;
        if let Some(limits) = limits {
            let limits = instance::limits(limits)?;
            (0..n).try_for_each(|b| inner.set_limits(b, limits)).map_err(raise)?;
        }
        let columns = [self.0.n_coordinates(), self.0.n_dofs(), self.0.n_dofs()];
        let inner = if threads == Threads::ONE { inner } else { inner.with_threads(threads) };
        Controllers::new(py, Arc::clone(&self.0), inner, outputs(py, out, n, columns)?)
    }
}

/// Returns the arrays for the motion: those of `out`, or new ones.
fn outputs<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    n: usize,
    columns: [usize; 3],
) -> PyResult<[Matrix<'py>; 3]> {
    let Some(out) = out else { return Ok(columns.map(|columns| PyArray2::zeros(py, [n, columns], false))) };
    let given = items("out", out, |_, array| Ok(array.clone()))?;
    let wrong = || {
        let shapes = columns.map(|columns| format!("[{n}, {columns}]")).join(", ");
        PyValueError::new_err(format!("out: expected three separate, writable float64 arrays by rows, {shapes}"))
    };
    let given: [Bound<'py, PyAny>; 3] = given.try_into().map_err(|_| wrong())?;
    let mut arrays = Vec::new();
    for (array, columns) in given.iter().zip(columns) {
        let array = array.cast::<PyArray2<f64>>().map_err(|_| wrong())?;
        if array.shape() != [n, columns] || !array.is_c_contiguous() || !array.is_aligned() {
            return Err(wrong());
        }
        arrays.push(array.clone());
    }
    // Held together, so that arrays which share memory are found.
    let held: Vec<_> = arrays.iter().map(|array| array.try_readwrite()).collect();
    if held.iter().any(Result::is_err) {
        return Err(wrong());
    }
    drop(held);
    arrays.try_into().map_err(|_| wrong())
}
