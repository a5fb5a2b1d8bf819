//! Demonstrations and trajectories.

use ndarray::{Array2, ArrayD};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods, ToPyArray};
use pdmp_core::Sampling;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::convert::{
    Matrix, Reduced, Vector, array, optional, plain, shown_context, texts, to_numpy, two_axes, vector,
};
use crate::error::{printable, raise};

/// One recorded movement.
///
/// Parameters
/// ----------
/// position : array_like (T, D) or Trajectory
///     Positions in the unit of each degree of freedom; at least four samples. A data frame gives names too, those of
///     its columns, and a trajectory time stamps, names and units, where they are not given.
/// dt : float, optional
///     Sampling interval in s. Without `dt` and `time`, the fit is told.
/// time : array_like, (T,), optional
///     Strictly increasing time stamps in s, or dates of numpy, which count from the first.
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
        let stamps = time.map(clock).transpose()?;
        let source = Source::of("position", position)?;
        let stamps = stamps.or(source.time.filter(|_| dt.is_none()));
        let sampling = match (dt, stamps) {
            (Some(_), Some(_)) => return Err(PyValueError::new_err("pass dt or time, not both")),
            (Some(dt), None) => Sampling::Uniform { dt },
            (None, Some(time)) => Sampling::Stamped { time },
            (None, None) => Sampling::Unknown,
        };
        let mut demo =
            pdmp_core::Demonstration::new(two_axes("position", source.position)?, sampling).map_err(raise)?;
        if let Some(goal) = optional("goal", goal)? {
            demo = demo.with_goal(goal).map_err(raise)?;
        }
        if let Some(values) = context {
            demo = demo.with_context(crate::convert::context("context", values)?).map_err(raise)?;
        }
        let given = |name, value: Option<&Bound<'_, PyAny>>| value.map(|value| texts(name, value)).transpose();
        if let Some(names) = given("names", names)?.or(source.names) {
            demo = demo.with_names(names).map_err(raise)?;
        }
        if let Some(units) = given("units", units)?.or(source.units) {
            demo = demo.with_units(units).map_err(raise)?;
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
            Some(context) => {
                let values = context.call_method0("tolist").unwrap_or(context);
                format!(", context {}", printable(&values.repr()?.to_string()))
            }
        };
        let (n_samples, n_dofs) = (self.0.n_samples(), self.0.n_dofs());
        Ok(format!("<pdmp.Demonstration: {n_samples} samples x {n_dofs} DoFs, {rate}{context}>"))
    }
}

/// Latest time stamp [s] that is taken for one, in the year 5138: later ones are in ms, µs or ns.
const MAX_STAMP: f64 = 1e11;

/// Time stamps (T,) in s; dates count from the first.
fn clock(value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = if value.is_instance_of::<PyUntypedArray>() { None } else { Some(plain("time", value)?.into_any()) };
    let array = array.as_ref().unwrap_or(value);
    let dated = array.cast::<PyUntypedArray>().is_ok_and(|array| matches!(array.dtype().kind(), b'M' | b'm'));
    if dated && array.len().is_ok_and(|length| length > 0) {
        let second = value.py().import("numpy")?.call_method1("timedelta64", (1, "s"))?;
        return vector("time", &array.sub(array.get_item(0)?)?.div(second)?);
    }
    let time = vector("time", array)?;
    match time.first() {
        Some(first) if first.abs() > MAX_STAMP => Err(PyValueError::new_err(format!(
            "time[0] = {first:e} s is later than the year 5000: pass seconds, (time - time[0]) * 1e-9 where these are ns"
        ))),
        _ => Ok(time),
    }
}

/// Positions as they come, and what the object that holds them knows beside.
pub(crate) struct Source {
    position: ArrayD<f64>,
    time: Option<Vec<f64>>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
}

impl Source {
    pub(crate) fn of(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = value.py();
        if let Ok(trajectory) = value.cast::<Trajectory>() {
            let trajectory = trajectory.get();
            let (position, time) = (trajectory.position.bind(py), trajectory.time.bind(py));
            return Ok(Self {
                position: array(name, position)?,
                time: Some(vector("time", time)?),
                names: Some(trajectory.names.clone()),
                units: trajectory.units.iter().any(|unit| !unit.is_empty()).then(|| trajectory.units.clone()),
            });
        }
        let bare = value.is_instance_of::<PyUntypedArray>() || value.is_instance_of::<PyList>();
        let (names, units) = match bare {
            true => (None, None),
            false => py.import("pdmp._labels")?.call_method1("names_and_units", (value,))?.extract()?,
        };
        Ok(Self { position: array(name, value)?, time: None, names, units })
    }

    /// Demonstration `m` of a fit, with what is known of it.
    pub(crate) fn demonstration(self, m: usize) -> PyResult<pdmp_core::Demonstration> {
        let sampling = self.time.map_or(Sampling::Unknown, |time| Sampling::Stamped { time });
        let position = two_axes(&format!("demo {m}: position"), self.position)?;
        let mut demo = pdmp_core::Demonstration::new(position, sampling);
        if let Some(names) = self.names {
            demo = demo.and_then(|demo| demo.with_names(names));
        }
        if let Some(units) = self.units {
            demo = demo.and_then(|demo| demo.with_units(units));
        }
        demo.map_err(|error| raise(error.in_demo(m)))
    }
}

/// A generated movement: row k of each array is the state at `time[k]`.
///
/// `Demonstration(trajectory)` is the movement as a demonstration, as is a trajectory in a list for `fit`.
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
    /// Names of the degrees of freedom.
    names: Vec<String>,
    /// Units of the degrees of freedom; "" where one is not known.
    units: Vec<String>,
}

impl Trajectory {
    pub(crate) fn new(
        py: Python<'_>,
        trajectory: pdmp_core::motion::Trajectory,
        names: &[String],
        units: &[String],
    ) -> Self {
        let convert = |matrix: Array2<f64>| matrix.into_pyarray(py).unbind();
        Self {
            time: to_numpy(py, &trajectory.time).unbind(),
            position: convert(trajectory.position),
            velocity: convert(trajectory.velocity),
            acceleration: convert(trajectory.acceleration),
            names: names.to_vec(),
            units: units.to_vec(),
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
        names: Vec<String>,
        units: Vec<String>,
    ) -> Self {
        Self { time, position, velocity, acceleration, names, units }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Self { time, position, velocity, acceleration, names, units } = self;
        let arguments = (time, position, velocity, acceleration, names.clone(), units.clone()).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of")?, arguments))
    }

    /// Returns arrays, names and units by their names; `numpy.savez(path, **trajectory.to_dict())` writes what
    /// `io.read_npz` reads.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        values.set_item("time", &self.time)?;
        values.set_item("position", &self.position)?;
        values.set_item("velocity", &self.velocity)?;
        values.set_item("acceleration", &self.acceleration)?;
        values.set_item("names", self.names.clone())?;
        values.set_item("units", self.units.clone())?;
        Ok(values)
    }

    /// Returns a pandas.DataFrame.
    ///
    /// Its index is the time `t` in s. Its columns are the position of each degree of freedom under its name, then
    /// velocities under `<name>_velocity` and accelerations under `<name>_acceleration`; `attrs["units"]` has the unit
    /// of each column. `Demonstration(frame[names], time=frame.index)` is the movement as a demonstration.
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     pandas is not installed.
    fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pdmp._labels")?.call_method1("to_dataframe", (slf,))
    }

    /// Writes a CSV file, whose positions `io.read_csv` reads back: `io.write_csv` describes it.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     Where to write.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     A file that cannot be written.
    /// ValueError
    ///     Names that would not be read back.
    fn to_csv(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import("pdmp.io")?.call_method1("write_csv", (path, slf)).map(drop)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.position.bind(py).getattr("shape")?;
        Ok(format!("<pdmp.Trajectory: (samples, DoFs) = {shape}>"))
    }
}
