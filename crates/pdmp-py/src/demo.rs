//! Demonstrations and trajectories.

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, ToPyArray};
use pdmp_core::Sampling;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{Matrix, Reduced, Vector, matrix, optional, shown_context, texts, to_numpy};
use crate::error::raise;

/// One recorded movement.
///
/// Parameters
/// ----------
/// position : array_like, (T, D)
///     Positions in the unit of each degree of freedom; at least four samples.
/// dt : float, optional
///     Sampling interval in s. Without `dt` and `time`, the fit is told.
/// time : array_like, (T,), optional
///     Strictly increasing time stamps in s.
/// goal : array_like, (D,), optional
///     Point attractor; the last sample serves otherwise.
/// context : array_like or list, (Q,), optional
///     The condition under which the movement was made, such as an obstacle's height.
/// names : sequence of str, optional
///     One name per degree of freedom.
/// units : sequence of str, optional
///     One unit per degree of freedom, such as "rad" or "m"; "" where it is not known.
///
/// Raises
/// ------
/// ValueError
///     Too few samples, numbers that are not finite, times that do not increase, or lengths that do not agree.
#[pyclass(frozen, module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct Demonstration(pub(crate) pdmp_core::Demonstration);

#[pymethods]
impl Demonstration {
    #[new]
    #[pyo3(signature = (position, *, dt=None, time=None, goal=None, context=None, names=None, units=None))]
    fn new(
        position: &Bound<'_, PyAny>,
        dt: Option<f64>,
        time: Option<&Bound<'_, PyAny>>,
        goal: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        names: Option<&Bound<'_, PyAny>>,
        units: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let sampling = match (dt, optional("time", time)?) {
            (Some(_), Some(_)) => return Err(PyValueError::new_err("pass dt or time, not both")),
            (Some(dt), None) => Sampling::Uniform { dt },
            (None, Some(time)) => Sampling::Stamped { time },
            (None, None) => Sampling::Unknown,
        };
        let position = matrix("position", "(T, D)", position)?;
        let mut demo = pdmp_core::Demonstration::new(position, sampling).map_err(raise)?;
        if let Some(goal) = optional("goal", goal)? {
            demo = demo.with_goal(goal).map_err(raise)?;
        }
        if let Some(values) = context {
            demo = demo.with_context(crate::convert::context("context", values)?).map_err(raise)?;
        }
        if let Some(names) = names {
            demo = demo.with_names(texts("names", names)?).map_err(raise)?;
        }
        if let Some(units) = units {
            demo = demo.with_units(texts("units", units)?).map_err(raise)?;
        }
        Ok(Self(demo))
    }

    /// Positions (T, D).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.position().to_pyarray(py)
    }

    /// Times of the samples (T,) in s; None while the rate is unknown.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        match self.0.sampling() {
            Sampling::Unknown => None,
            Sampling::Uniform { dt } => {
                let time: Vec<f64> = (0..self.0.n_samples()).map(|c| c as f64 * dt).collect();
                Some(to_numpy(py, &time))
            }
            Sampling::Stamped { time } => Some(to_numpy(py, time)),
        }
    }

    /// Sampling interval in s; None unless it was given.
    #[getter]
    fn dt(&self) -> Option<f64> {
        match self.0.sampling() {
            Sampling::Uniform { dt } => Some(*dt),
            _ => None,
        }
    }

    /// Point attractor (D,), if one was given.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.goal().map(|goal| to_numpy(py, goal))
    }

    /// Condition (Q,), if one was given: an array, or a list where there are labels.
    #[getter]
    fn context<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.0.context().map(|context| shown_context(py, context)).transpose()
    }

    /// Names of the degrees of freedom, if they were given.
    #[getter]
    fn names(&self) -> Option<Vec<String>> {
        self.0.names().map(<[String]>::to_vec)
    }

    /// Units of the degrees of freedom, if they were given.
    #[getter]
    fn units(&self) -> Option<Vec<String>> {
        self.0.units().map(<[String]>::to_vec)
    }

    /// Number of samples T.
    #[getter]
    fn n_samples(&self) -> usize {
        self.0.n_samples()
    }

    /// Number of degrees of freedom D.
    #[getter]
    fn n_dofs(&self) -> usize {
        self.0.n_dofs()
    }

    /// Arguments that make the same demonstration again.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((Matrix<'py>,), Bound<'py, PyDict>)> {
        let options = PyDict::new(py);
        match self.0.sampling() {
            Sampling::Stamped { .. } => options.set_item("time", self.time(py))?,
            _ => options.set_item("dt", self.dt())?,
        }
        options.set_item("goal", self.goal(py))?;
        options.set_item("context", self.context(py)?)?;
        options.set_item("names", self.names())?;
        options.set_item("units", self.units())?;
        Ok(((self.position(py),), options))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let rate = match self.0.sampling() {
            Sampling::Unknown => "rate unknown".to_string(),
            Sampling::Uniform { dt } => format!("dt {dt} s"),
            Sampling::Stamped { time } => format!("{} s", time[time.len() - 1] - time[0]),
        };
        let context = match self.context(py)? {
            None => String::new(),
            Some(context) => format!(", context {}", context.call_method0("tolist").unwrap_or(context).repr()?),
        };
        let (n_samples, n_dofs) = (self.0.n_samples(), self.0.n_dofs());
        Ok(format!("<pdmp.Demonstration: {n_samples} samples × {n_dofs} DoFs, {rate}{context}>"))
    }
}

/// A generated movement: row k of each array is the state at `time[k]`.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Trajectory {
    /// Times (T,) in s, from 0.
    time: Py<PyArray1<f64>>,
    /// Positions (T, D), in the unit of each degree of freedom.
    position: Py<PyArray2<f64>>,
    /// Velocities (T, D), per s.
    velocity: Py<PyArray2<f64>>,
    /// Accelerations (T, D), per s².
    acceleration: Py<PyArray2<f64>>,
}

impl Trajectory {
    pub(crate) fn new(py: Python<'_>, trajectory: pdmp_core::Trajectory) -> Self {
        let convert = |matrix: Array2<f64>| matrix.into_pyarray(py).unbind();
        Self {
            time: to_numpy(py, &trajectory.time).unbind(),
            position: convert(trajectory.position),
            velocity: convert(trajectory.velocity),
            acceleration: convert(trajectory.acceleration),
        }
    }
}

#[pymethods]
impl Trajectory {
    /// One of arrays as they were.
    #[staticmethod]
    fn _of(
        time: Py<PyArray1<f64>>,
        position: Py<PyArray2<f64>>,
        velocity: Py<PyArray2<f64>>,
        acceleration: Py<PyArray2<f64>>,
    ) -> Self {
        Self { time, position, velocity, acceleration }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let arrays = (&self.time, &self.position, &self.velocity, &self.acceleration).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of")?, arrays))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.position.bind(py).getattr("shape")?;
        Ok(format!("<pdmp.Trajectory: (samples, DoFs) = {shape}>"))
    }
}
