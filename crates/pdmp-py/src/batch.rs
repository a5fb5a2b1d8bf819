//! Many movements at once in Python.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use ndarray::{Ix1, Ix2};
use numpy::PyArrayMethods;
use pdmp_core::Error;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{Batch, BatchChunks, BatchConditions, PerMovement, TimeGrid, batch};
use pdmp_core::numerics::Threads;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::convert::{Cube, array, count, items, matrix, threads, writable};
use crate::error::{interruptible, raise};
use crate::model::Model;

#[pymethods]
impl Model {
    /// Movements of many styles.
    ///
    /// For constant style, goal and tau a movement is linear in its conditions: a batch is one product of coefficients
    /// with response curves, which the model remembers for a few of the last (dt, tau, duration). Agrees with `rollout`
    /// to rounding.
    ///
    /// Parameters
    /// ----------
    /// styles : array_like, (B, J)
    ///     Style parameters s.
    /// goals : array_like, (D,) or (B, D), optional
    ///     Goals g of all or of each, discrete.
    /// starts : array_like, (D,) or (B, D), optional
    ///     Start positions; rhythmic movements otherwise start on their cycles.
    /// velocities : array_like, (D,) or (B, D), optional
    ///     Start velocities per s; otherwise as in the demonstrations.
    /// anchors : array_like, (D,) or (B, D), optional
    ///     Anchors y_a of all or of each, rhythmic.
    /// amplitude, tau, dt, duration
    ///     As in `rollout`, of all.
    /// derivatives : int
    ///     0 for positions alone, 1 with velocities, 2 with accelerations too.
    /// out : tuple of float64 arrays (B, T, D), optional
    ///     Where to write, one array for positions and each derivative.
    /// threads : int, optional
    ///     How many threads may work; otherwise as many as the system has. The numbers do not depend on it.
    ///
    /// Returns
    /// -------
    /// tuple of ndarray, (B, T, D)
    ///     Positions, velocities per s, accelerations per s².
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Rows that do not match the styles, a wrong length, a number that is not finite, an argument of the other
    ///     kind of primitive, or an output that does not fit; nothing is written then.
    /// MemoryError
    ///     More numbers than memory holds: see `rollout_chunks`.
    #[pyo3(signature = (
        styles, *, goals=None, starts=None, velocities=None, anchors=None, amplitude=None, tau=None, dt=0.01,
        duration=None, derivatives=1, out=None, threads=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn rollouts<'py>(
        &self,
        py: Python<'py>,
        styles: &Bound<'py, PyAny>,
        goals: Option<&Bound<'py, PyAny>>,
        starts: Option<&Bound<'py, PyAny>>,
        velocities: Option<&Bound<'py, PyAny>>,
        anchors: Option<&Bound<'py, PyAny>>,
        amplitude: Option<f64>,
        tau: Option<f64>,
        dt: f64,
        duration: Option<f64>,
        derivatives: isize,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<isize>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let arguments = Arguments { styles, goals, starts, velocities, anchors, amplitude, tau };
        let work = Work::new(py, self, arguments, TimeGrid { dt, duration }, derivatives, threads)?;
        let movements = 0..work.batch.shape().0;
        let out = match out {
            Some(out) => work.check(&movements, &items("out", out, |_, array| Ok(array.clone()))?)?,
            None => work.allocate(py, &movements)?,
        };
        work.write(py, movements, out)
    }

    /// Movements of many styles, a piece at a time: what `rollouts` returns for each piece, in order.
    ///
    /// Only one piece is in memory at a time, and the numbers are those of `rollouts` to the last bit. All arguments are
    /// checked by this call.
    ///
    /// Parameters
    /// ----------
    /// styles, goals, starts, velocities, anchors, amplitude, tau, dt, duration, derivatives, threads
    ///     As in `rollouts`.
    /// size : int
    ///     Movements in a piece; the last may have fewer.
    ///
    /// Returns
    /// -------
    /// iterator of tuple of ndarray, (size, T, D)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `rollouts`, or a size below 1.
    ///
    /// Examples
    /// --------
    /// >>> for positions, velocities in model.rollout_chunks(styles, size=1000):
    /// ...     cost.append((velocities**2).sum(axis=(1, 2)))
    #[pyo3(signature = (
        styles, *, size=1000, goals=None, starts=None, velocities=None, anchors=None, amplitude=None, tau=None, dt=0.01,
        duration=None, derivatives=1, threads=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn rollout_chunks<'py>(
        &self,
        py: Python<'py>,
        styles: &Bound<'py, PyAny>,
        size: isize,
        goals: Option<&Bound<'py, PyAny>>,
        starts: Option<&Bound<'py, PyAny>>,
        velocities: Option<&Bound<'py, PyAny>>,
        anchors: Option<&Bound<'py, PyAny>>,
        amplitude: Option<f64>,
        tau: Option<f64>,
        dt: f64,
        duration: Option<f64>,
        derivatives: isize,
        threads: Option<isize>,
    ) -> PyResult<RolloutChunks> {
        let arguments = Arguments { styles, goals, starts, velocities, anchors, amplitude, tau };
        let work = Work::new(py, self, arguments, TimeGrid { dt, duration }, derivatives, threads)?;
        let chunks = work.batch.chunks(count("size", size)?).map_err(raise)?;
        Ok(RolloutChunks { work, chunks: Mutex::new(chunks) })
    }
}

/// An iterator over pieces of a batch, made by `Model.rollout_chunks`.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct RolloutChunks {
    work: Work,
    chunks: Mutex<BatchChunks>,
}

#[pymethods]
impl RolloutChunks {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        // The lock is free again before anything is written: several threads may share the pieces.
        let next = self.chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
        let Some(movements) = next else { return Ok(None) };
        let out = self.work.allocate(py, &movements)?;
        self.work.write(py, movements, out).map(Some)
    }
}

/// A batch, and how it is to be written.
struct Work {
    batch: Batch,
    highest: Derivative,
    threads: Threads,
}

impl Work {
    fn new(
        py: Python<'_>,
        model: &Model,
        arguments: Arguments<'_, '_>,
        grid: TimeGrid,
        derivatives: isize,
        n_threads: Option<isize>,
    ) -> PyResult<Self> {
        let highest = Derivative::of_order("derivatives", count("derivatives", derivatives)?).map_err(raise)?;
        let (threads, conditions) = (threads(n_threads)?, arguments.conditions()?);
        let batch = interruptible(py, |progress| batch(model.0.primitive(), conditions, grid, progress))?;
        Ok(Self { batch, highest, threads })
    }

    fn n_outputs(&self) -> usize {
        self.highest as usize + 1
    }

    fn shape(&self, movements: &Range<usize>) -> [usize; 3] {
        let (_, n_samples, n_dofs) = self.batch.shape();
        [movements.len(), n_samples, n_dofs]
    }

    /// The arrays given, if they fit.
    fn check<'py>(&self, movements: &Range<usize>, out: &[Bound<'py, PyAny>]) -> PyResult<Vec<Cube<'py>>> {
        let (found, expected, shape) = (out.len(), self.n_outputs(), self.shape(movements));
        if found != expected {
            let message = format!("out: {found} arrays; expected {expected} float64 arrays {shape:?}");
            return Err(PyValueError::new_err(message));
        }
        out.iter().map(|out| writable(out, &shape)).collect()
    }

    /// New arrays, by numpy itself: it asks the system for large pages, of which there are fewer to fetch.
    fn allocate<'py>(&self, py: Python<'py>, movements: &Range<usize>) -> PyResult<Vec<Cube<'py>>> {
        let shape = self.shape(movements);
        let numbers = shape.iter().map(|&n| n as f64).product();
        let new = || {
            let array = py.import("numpy")?.call_method1("empty", (shape,));
            let array = array.map_err(|_| raise(Error::Memory { name: "rollouts", numbers }))?;
            writable(&array, &shape)
        };
        (0..self.n_outputs()).map(|_| new()).collect()
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

/// What the movements of a batch start with, from Python's arguments.
struct Arguments<'a, 'py> {
    styles: &'a Bound<'py, PyAny>,
    goals: Option<&'a Bound<'py, PyAny>>,
    starts: Option<&'a Bound<'py, PyAny>>,
    velocities: Option<&'a Bound<'py, PyAny>>,
    anchors: Option<&'a Bound<'py, PyAny>>,
    amplitude: Option<f64>,
    tau: Option<f64>,
}

impl Arguments<'_, '_> {
    fn conditions(self) -> PyResult<BatchConditions> {
        Ok(BatchConditions {
            styles: matrix("styles", "(B, J)", self.styles)?,
            goals: rows("goals", self.goals)?,
            anchors: rows("anchors", self.anchors)?,
            starts: rows("starts", self.starts)?,
            velocities: rows("velocities", self.velocities)?,
            amplitude: self.amplitude,
            tau: self.tau,
        })
    }
}

/// A vector for all movements, or a matrix with one for each.
fn rows(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<PerMovement>> {
    let Some(value) = value else { return Ok(None) };
    let array = array(name, value)?;
    let shape = array.shape().to_vec();
    let rows = match shape.len() {
        1 => array.into_dimensionality::<Ix1>().map(|row| PerMovement::All(row.to_vec())),
        _ => array.into_dimensionality::<Ix2>().map(PerMovement::Each),
    };
    rows.map(Some).map_err(|_| PyValueError::new_err(format!("{name} has shape {shape:?}, expected (D,) or (B, D)")))
}
