//! Batches of rollouts.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use numpy::PyArrayMethods;
use pdmp_core::Error;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{Batch, BatchChunks, BatchConditions, TimeGrid, batch};
use pdmp_core::numerics::Threads;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::batch_conditions::batch_conditions_of;
use crate::convert::{Cube, items, threads, writable};
use crate::error::{interruptible, raise};
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};

#[pymethods]
impl Model {
    /// Computes the movements of many conditions.
    ///
    /// A movement under constant conditions is linear in them, so that a batch is one product of coefficients with
    /// response curves. The model caches these for a few recent (dt, tau, duration). Results equal those of `rollout`
    /// to rounding.
    ///
    /// Movements that differ in tau, follow `segment_durations`, or start at a `phase` have no response curves in
    /// common: each then costs a rollout, which it equals to the bit. All are sampled at the same times. Without
    /// `duration`, these reach to the end of the longest movement; the others continue past their end as in `rollout`,
    /// discrete ones at rest on their goal.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, or B Conditions, optional
    ///     Conditions of all movements, or of each.
    /// context : array_like or list, (Q,) or (B, Q), optional
    ///     Context of all movements, or of each, whose prediction supplies absent conditions, durations included. One
    ///     `tau` for all keeps the response curves.
    /// dt : float
    ///     Interval between samples in s.
    /// duration : float, optional
    ///     Length of all movements in s, as in `rollout`.
    /// derivatives : int
    ///     Order of the highest derivative to return: 0 for positions, 1 for velocities too, 2 for accelerations too.
    /// out : tuple of ndarray, (B, T, D), optional
    ///     Writable float64 arrays for the results, one per order of derivative.
    /// threads : int, optional
    ///     Largest number of threads; by default all that the system offers. Results do not depend on it.
    /// **changes
    ///     Single conditions by name, which replace those of `conditions`; see `Conditions`. All may have a leading axis
    ///     with one entry for each of B movements: vectors (B, n), and tau, amplitude and phase (B,).
    ///
    /// Returns
    /// -------
    /// tuple of ndarray, (B, T, D)
    ///     Positions in the unit of each degree of freedom, velocities per s, accelerations per s².
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An argument has a wrong shape, is not finite, belongs to the other kind of primitive, or `out` does not fit;
    ///     leading axes differ. Nothing is written then.
    /// TypeError
    ///     A keyword is unknown, or `conditions` has another type.
    /// MemoryError
    ///     The results do not fit into memory; use `rollout_chunks`.
    ///
    /// Examples
    /// --------
    /// >>> positions, velocities = model.rollouts(style=model.styles, goal=model.goals, dt=0.1)
    /// >>> positions.shape
    /// (5, 13, 2)
    /// >>> at_own_pace, _ = model.rollouts(style=model.styles, tau=[0.6, 0.8, 1.0, 1.2, 1.4], dt=0.1)
    #[pyo3(
        signature = (
            conditions=None, *, dt=Scalar::Number(0.01), duration=None, context=None, derivatives=Scalar::Count(1),
            out=None, threads=None, **changes
        ),
        text_signature = "($self, conditions=None, *, dt=0.01, duration=None, context=None, derivatives=1, out=None, \
                          threads=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn rollouts<'py>(
        &self,
        py: Python<'py>,
        conditions: Option<&Bound<'py, PyAny>>,
        dt: Scalar<'py>,
        duration: Option<Scalar<'py>>,
        context: Option<&Bound<'py, PyAny>>,
        derivatives: Scalar<'py>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<Scalar<'py>>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let conditions = batch_conditions_of(py, &self.0, conditions, context, changes)?;
        let options = Options { dt, duration, derivatives, threads };
        let work = PreparedBatch::new(py, self, conditions, options)?;
        let movements = 0..work.batch.shape().0;
        let out = match out {
            Some(out) => work.check(&movements, &items("out", out, |_, array| Ok(array.clone()))?)?,
            None => work.allocate(py, &movements)?,
        };
        work.write(py, movements, out)
    }

    /// Computes the movements of many conditions in chunks.
    ///
    /// Memory holds one chunk at a time. Results equal those of `rollouts` bit for bit. This call checks all arguments.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, or B Conditions, optional
    ///     As in `rollouts`.
    /// size : int
    ///     Number of movements in a chunk; the last may have fewer.
    /// context : array_like or list, (Q,) or (B, Q), optional
    ///     As in `rollouts`.
    /// dt, duration : float, optional
    ///     As in `rollouts`.
    /// derivatives, threads : int, optional
    ///     As in `rollouts`.
    /// **changes
    ///     As in `rollouts`.
    ///
    /// Returns
    /// -------
    /// RolloutChunks
    ///     Iterator over the results of `rollouts` for each chunk, with arrays (size, T, D).
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An argument that `rollouts` rejects, or a `size` below 1.
    /// TypeError
    ///     As in `rollouts`.
    ///
    /// Examples
    /// --------
    /// >>> cost = []
    /// >>> for positions, velocities in model.rollout_chunks(style=model.styles, size=2):
    /// ...     cost.extend((velocities**2).sum(axis=(1, 2)))
    /// >>> len(cost) == model.n_demos
    /// True
    #[pyo3(
        signature = (
            conditions=None, *, size=Scalar::Count(1000), dt=Scalar::Number(0.01), duration=None, context=None,
            derivatives=Scalar::Count(1), threads=None, **changes
        ),
        text_signature = "($self, conditions=None, *, size=1000, dt=0.01, duration=None, context=None, derivatives=1, \
                          threads=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn rollout_chunks<'py>(
        &self,
        py: Python<'py>,
        conditions: Option<&Bound<'py, PyAny>>,
        size: Scalar<'py>,
        dt: Scalar<'py>,
        duration: Option<Scalar<'py>>,
        context: Option<&Bound<'py, PyAny>>,
        derivatives: Scalar<'py>,
        threads: Option<Scalar<'py>>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<RolloutChunks> {
        let size = size.count("size")?;
        let conditions = batch_conditions_of(py, &self.0, conditions, context, changes)?;
        let options = Options { dt, duration, derivatives, threads };
        let work = PreparedBatch::new(py, self, conditions, options)?;
        let chunks = work.batch.chunks(size).map_err(raise)?;
        Ok(RolloutChunks { work, chunks: Mutex::new(chunks) })
    }
}

/// Iterator over the chunks of a batch, returned by `Model.rollout_chunks`.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct RolloutChunks {
    work: PreparedBatch,
    chunks: Mutex<BatchChunks>,
}

#[pymethods]
impl RolloutChunks {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        // The lock is released before the chunk is computed, so that threads may share the iterator.
        let next = self.chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
        let Some(movements) = next else { return Ok(None) };
        let out = self.work.allocate(py, &movements)?;
        self.work.write(py, movements, out).map(Some)
    }
}

/// Batch with the settings of its outputs.
struct PreparedBatch {
    batch: Batch,
    highest: Derivative,
    threads: Threads,
}

impl PreparedBatch {
    fn new(py: Python<'_>, model: &Model, conditions: BatchConditions, options: Options<'_>) -> PyResult<Self> {
        let highest = Derivative::of_order("derivatives", options.derivatives.count("derivatives")?).map_err(raise)?;
        let threads = threads(options.threads)?;
        let duration = optional_number("duration", options.duration)?;
        let grid = TimeGrid { dt: options.dt.number("dt")?, duration };
        let batch = interruptible(py, |progress| batch(model.0.primitive(), conditions, grid, progress))?;
        Ok(Self { batch, highest, threads })
    }

    fn n_outputs(&self) -> usize {
        self.highest as usize + 1
    }

    fn shape(&self, movements: &Range<usize>, derivative: Derivative) -> [usize; 3] {
        let (_, n_samples, _) = self.batch.shape();
        [movements.len(), n_samples, self.batch.n_columns(derivative)]
    }

    /// Checks the number and the shapes of given output arrays.
    fn check<'py>(&self, movements: &Range<usize>, out: &[Bound<'py, PyAny>]) -> PyResult<Vec<Cube<'py>>> {
        let (n_arrays, expected) = (out.len(), self.n_outputs());
        if n_arrays != expected {
            let shape = self.shape(movements, Derivative::Position);
            let message = format!("out: {n_arrays} arrays; expected {expected} float64 arrays {shape:?}");
            return Err(PyValueError::new_err(message));
        }
        out.iter()
            .zip(Derivative::ALL)
            .map(|(out, derivative)| writable(out, &self.shape(movements, derivative)))
            .collect()
    }

    /// Allocates output arrays by numpy, which requests large pages: fewer page faults than with Rust's allocator.
    fn allocate<'py>(&self, py: Python<'py>, movements: &Range<usize>) -> PyResult<Vec<Cube<'py>>> {
        let new = |derivative| {
            let shape = self.shape(movements, derivative);
            let numbers = shape.iter().map(|&n| n as f64).product();
            let array = py.import("numpy")?.call_method1("empty", (shape,));
            let array = array.map_err(|_| raise(Error::Memory { name: "rollouts", numbers }))?;
            writable(&array, &shape)
        };
        Derivative::ALL.into_iter().take(self.n_outputs()).map(new).collect()
    }

    fn write<'py>(
        &self,
        py: Python<'py>,
        movements: Range<usize>,
        out: Vec<Cube<'py>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let borrow = |out: &Cube<'py>| out.try_readwrite().map_err(|_| PyValueError::new_err(OVERLAP));
        let mut borrowed = out.iter().map(borrow).collect::<PyResult<Vec<_>>>()?;
        let outputs = borrowed.iter_mut().map(|out| out.as_array_mut()).collect();
        interruptible(py, |progress| self.batch.write(movements, outputs, self.threads, progress))?;
        drop(borrowed);
        PyTuple::new(py, out)
    }
}

const OVERLAP: &str = "out: arrays that share memory, with each other or with one in use; pass separate ones";

/// Arguments for the samples of a batch.
struct Options<'py> {
    dt: Scalar<'py>,
    duration: Option<Scalar<'py>>,
    derivatives: Scalar<'py>,
    threads: Option<Scalar<'py>>,
}
