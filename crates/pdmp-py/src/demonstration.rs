//! Demonstrations, trajectories, and objects that are read as either.

use ndarray::{Array2, ArrayD};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods, ToPyArray};
use pdmp_core::Sampling;
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::model::Coordinates;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::convert::{
    Matrix, Reduced, Vector, array, context_to_python, locked, optional, plain, quoted, read_only, texts, to_numpy,
    two_axes, vector,
};
use crate::error::raise;
use crate::scalar::{Scalar, optional_number};

/// Recorded movement.
///
/// Parameters
/// ----------
/// position : array_like, (T, D), or Trajectory
///     Positions in the unit of each degree of freedom; at least four samples. The columns of a data frame supply
///     names, and a trajectory supplies time stamps, names and units, unless they are given.
/// dt : float, optional
///     Sampling interval in s. Without `dt` and `time`, `fit` needs it.
/// time : array_like, (T,), optional
///     Strictly increasing time stamps in s, or datetimes of numpy, counted from the first.
/// goal : array_like, (D,), optional
///     Goal g in the unit of each degree of freedom; by default the last sample.
/// context : array_like or list, (Q,), optional
///     Numbers and labels that describe the task, such as the height of an obstacle, in any unit.
/// names : sequence of str, (D,), optional
///     Names of the degrees of freedom, all different.
/// units : sequence of str, (D,), optional
///     Units of the degrees of freedom, such as "rad" or "m"; "" if unknown.
/// rotations : mapping, optional
///     First column of each unit quaternion, as an index or a name, and the order of its components: {3: "wxyz"} or
///     {3: "xyzw"}. A quaternion rotates from the body frame to the world frame; the other convention cannot be told from
///     the data. Norms become 1, and signs continuous along time. `position`, `goal`, `names` and `units` have one element
///     per column; a rotation has four columns and three degrees of freedom.
///
/// Raises
/// ------
/// ValueError
///     Samples are too few, a number is not finite, times do not increase, or lengths differ.
///
/// Examples
/// --------
/// >>> s = np.linspace(0.0, 1.0, 61)
/// >>> reach = np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), 0.2 * np.sin(np.pi * s) ** 2])
/// >>> pdmp.Demonstration(reach, dt=0.02, names=["x", "y"], units=["m", "m"])
/// <pdmp.Demonstration: 61 samples x 2 DoFs, dt 0.02 s>
#[pyclass(frozen, module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct Demonstration(pub(crate) pdmp_core::Demonstration);

#[pymethods]
impl Demonstration {
    #[new]
    #[pyo3(signature = (position, *, dt=None, time=None, goal=None, context=None, names=None, units=None, rotations=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        position: &Bound<'_, PyAny>,
        dt: Option<Scalar<'_>>,
        time: Option<&Bound<'_, PyAny>>,
        goal: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        names: Option<&Bound<'_, PyAny>>,
        units: Option<&Bound<'_, PyAny>>,
        rotations: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let dt = optional_number("dt", dt)?;
        let stamps = time.map(time_stamps).transpose()?;
        let source = Source::of("position", position)?;
        let stamps = stamps.or(source.time.filter(|_| dt.is_none()));
        let sampling = match (dt, stamps) {
            (Some(_), Some(_)) => return Err(PyValueError::new_err("pass dt or time, not both")),
            (Some(dt), None) => Sampling::Uniform { dt },
            (None, Some(time)) => Sampling::Stamped { time },
            (None, None) => Sampling::Unknown,
        };
        let mut demo =
            pdmp_core::Demonstration::new(two_axes("position", "(T, D)", source.position)?, sampling).map_err(raise)?;
        if let Some(values) = context {
            demo = demo.with_context(crate::convert::context("context", values)?).map_err(raise)?;
        }
        let labels = |name, value: Option<&Bound<'_, PyAny>>| value.map(|value| texts(name, value)).transpose();
        let (names, units) = (labels("names", names)?.or(source.names), labels("units", units)?.or(source.units));
        demo = labelled(demo, names, units).map_err(raise)?;
        let rotations = match rotations {
            Some(rotations) => Some(rotations_of(rotations, demo.names())?),
            None => source.rotations,
        };
        if let Some(rotations) = rotations {
            demo = demo.with_rotations(rotations).map_err(raise)?;
        }
        if let Some(goal) = optional("goal", goal)? {
            demo = demo.with_goal(goal).map_err(raise)?;
        }
        Ok(Self(demo))
    }

    /// Positions (T, D) in the unit of each degree of freedom.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.position().to_pyarray(py))
    }

    /// Times of the samples (T,) in s; None if unknown.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        match self.0.sampling() {
            Sampling::Unknown => None,
            Sampling::Uniform { dt } => {
                let time: Vec<f64> = (0..self.0.n_samples()).map(|c| c as f64 * dt).collect();
                Some(read_only(py, &time))
            }
            Sampling::Stamped { time } => Some(read_only(py, time)),
        }
    }

    /// Sampling interval in s; None if not given.
    #[getter]
    fn dt(&self) -> Option<f64> {
        match self.0.sampling() {
            Sampling::Uniform { dt } => Some(*dt),
            _ => None,
        }
    }

    /// Goal g (D,); None if not given.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.goal().map(|goal| read_only(py, goal))
    }

    /// Context (Q,), an array of numbers or a list with labels; None if not given.
    #[getter]
    fn context<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.0.context().map(|context| context_to_python(py, context)).transpose()
    }

    /// Names of the degrees of freedom (D,); None if not given.
    #[getter]
    fn names(&self) -> Option<Vec<String>> {
        self.0.names().map(<[String]>::to_vec)
    }

    /// Units of the degrees of freedom (D,); None if not given.
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

    /// Number of coordinates, the columns of `position`: one more than the degrees of freedom for each rotation.
    #[getter]
    fn n_coordinates(&self) -> usize {
        self.0.n_coordinates()
    }

    /// First column of each unit quaternion, and the order of its components, "wxyz" or "xyzw".
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        rotations_to_python(py, self.0.rotations())
    }

    /// Returns the arguments that rebuild the demonstration.
    fn __getnewargs_ex__<'py>(slf: &Bound<'py, Self>) -> PyResult<((Bound<'py, PyAny>,), Bound<'py, PyDict>)> {
        let stamped = matches!(slf.get().0.sampling(), Sampling::Stamped { .. });
        let options = PyDict::new(slf.py());
        for name in [if stamped { "time" } else { "dt" }, "goal", "context", "names", "units", "rotations"] {
            options.set_item(name, slf.getattr(name)?)?;
        }
        Ok(((slf.getattr("position")?,), options))
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
                format!(", context {}", quoted(&values))
            }
        };
        let (n_samples, n_dofs) = (self.0.n_samples(), self.0.n_dofs());
        Ok(format!("<pdmp.Demonstration: {n_samples} samples x {n_dofs} DoFs, {rate}{context}>"))
    }
}

/// Largest time stamp in s, which is in the year 5138. Larger ones are most likely in ms, µs or ns.
const MAX_STAMP: f64 = 1e11;

/// Converts time stamps (T,) in s, and datetimes to seconds since the first.
fn time_stamps(value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
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
            "time[0] = {first:e} s is later than the year 5000: pass seconds, such as (time - time[0]) * 1e-9 \
             for ns"
        ))),
        _ => Ok(time),
    }
}

/// Positions and the metadata of the object that holds them.
pub(crate) struct Source {
    position: ArrayD<f64>,
    time: Option<Vec<f64>>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
    rotations: Option<Vec<RotationColumns>>,
}

impl Source {
    /// Reads a trajectory, a data frame, a labelled array or bare positions.
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
                rotations: Some(rotations_of(trajectory.rotations.bind(py), None)?)
                    .filter(|rotations| !rotations.is_empty()),
            });
        }
        let bare = value.is_instance_of::<PyUntypedArray>() || value.is_instance_of::<PyList>();
        let (names, units) = match bare {
            true => (None, None),
            false => py.import("pdmp._labels")?.call_method1("names_and_units", (value,))?.extract()?,
        };
        Ok(Self { position: array(name, value)?, time: None, names, units, rotations: None })
    }

    /// Returns demonstration `m` of a fit.
    pub(crate) fn demonstration(self, m: usize) -> PyResult<pdmp_core::Demonstration> {
        let sampling = self.time.map_or(Sampling::Unknown, |time| Sampling::Stamped { time });
        let position = two_axes(&format!("demo {m}: position"), "(T, D)", self.position)?;
        let demo = pdmp_core::Demonstration::new(position, sampling);
        demo.and_then(|demo| labelled(demo, self.names, self.units))
            .and_then(|demo| demo.with_rotations(self.rotations.unwrap_or_default()))
            .map_err(|error| raise(error.in_demo(m)))
    }
}

/// Sets the names and units that are given.
fn labelled(
    mut demo: pdmp_core::Demonstration,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
) -> pdmp_core::Result<pdmp_core::Demonstration> {
    if let Some(names) = names {
        demo = demo.with_names(names)?;
    }
    match units {
        Some(units) => demo.with_units(units),
        None => Ok(demo),
    }
}

/// Generated movement, returned by `Model.rollout`. Row k of each array is the state at `time[k]`.
///
/// `Demonstration(trajectory)` makes a demonstration of it, and `fit` takes trajectories as demonstrations.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Trajectory {
    /// Times (T,) in s, starting at 0.
    pub(crate) time: Py<PyArray1<f64>>,
    /// Positions (T, D) in the unit of each degree of freedom.
    pub(crate) position: Py<PyArray2<f64>>,
    /// Velocities (T, D) per s.
    velocity: Py<PyArray2<f64>>,
    /// Accelerations (T, D) per s².
    acceleration: Py<PyArray2<f64>>,
    /// Names of the columns of `position`.
    pub(crate) names: Vec<String>,
    /// Units of the columns of `position`; "" if unknown.
    pub(crate) units: Vec<String>,
    /// Names of the columns of `velocity` and `acceleration`; those of `position` without rotations.
    dof_names: Vec<String>,
    /// Units of the columns of `velocity` and `acceleration`, without "per second".
    dof_units: Vec<String>,
    /// First column of each unit quaternion in `position`, and the order of its components, "wxyz" or "xyzw".
    rotations: Py<PyDict>,
}

impl Trajectory {
    pub(crate) fn new(
        py: Python<'_>,
        trajectory: pdmp_core::motion::Trajectory,
        primitive: &pdmp_core::Primitive,
    ) -> PyResult<Self> {
        let convert = |matrix: Array2<f64>| matrix.into_pyarray(py).unbind();
        let rotations = primitive.coordinates().map(Coordinates::columns).unwrap_or_default();
        Ok(Self {
            time: to_numpy(py, &trajectory.time).unbind(),
            position: convert(trajectory.position),
            velocity: convert(trajectory.velocity),
            acceleration: convert(trajectory.acceleration),
            names: primitive.coordinate_names().to_vec(),
            units: primitive.coordinate_units().to_vec(),
            dof_names: primitive.names().to_vec(),
            dof_units: primitive.units().to_vec(),
            rotations: rotations_to_python(py, &rotations)?.unbind(),
        })
    }
}

#[pymethods]
impl Trajectory {
    /// Rebuilds a pickled trajectory.
    #[staticmethod]
    fn _of(
        time: Py<PyArray1<f64>>,
        position: Py<PyArray2<f64>>,
        velocity: Py<PyArray2<f64>>,
        acceleration: Py<PyArray2<f64>>,
        labels: [Vec<String>; 4],
        rotations: Py<PyDict>,
    ) -> Self {
        let [names, units, dof_names, dof_units] = labels;
        Self { time, position, velocity, acceleration, names, units, dof_names, dof_units, rotations }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Self { time, position, velocity, acceleration, names, units, dof_names, dof_units, rotations } = self;
        let labels = [names, units, dof_names, dof_units].map(Clone::clone);
        let arguments = (time, position, velocity, acceleration, labels, rotations).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of")?, arguments))
    }

    /// Returns the arrays, names and units in a dictionary.
    ///
    /// `io.read_npz` reads the file that `numpy.savez(path, **trajectory.to_dict())` writes.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Keys are the names of the attributes.
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(slf.py());
        for name in
            ["time", "position", "velocity", "acceleration", "names", "units", "dof_names", "dof_units", "rotations"]
        {
            values.set_item(name, slf.getattr(name)?)?;
        }
        Ok(values)
    }

    /// Returns a data frame of positions, velocities and accelerations.
    ///
    /// `Demonstration(frame[names], time=frame.index)` makes a demonstration of it.
    ///
    /// Returns
    /// -------
    /// pandas.DataFrame
    ///     The index is the time `t` in s. Columns are positions `<name>`, velocities `<name>_velocity` and
    ///     accelerations `<name>_acceleration`; `attrs["units"]` maps each column to its unit.
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     pandas is not installed.
    fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pdmp._labels")?.call_method1("to_dataframe", (slf,))
    }

    /// Writes a CSV file as `io.write_csv` does.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     File to write.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written, or its folder does not exist.
    /// ValueError
    ///     A name could not be read back by `io.read_csv`.
    fn to_csv(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import("pdmp.io")?.call_method1("write_csv", (path, slf)).map(drop)
    }
}

/// Returns the rotations of a mapping from the first column of a quaternion, its index or name, to its order.
fn rotations_of(rotations: &Bound<'_, PyAny>, names: Option<&[String]>) -> PyResult<Vec<RotationColumns>> {
    let wrong = |problem: String| PyValueError::new_err(format!("rotations = {}: {problem}", quoted(rotations)));
    let form = "must map the first column of each quaternion to its order, such as {3: \"wxyz\"}";
    let items = rotations.call_method0("items").map_err(|_| wrong(form.to_string()))?;
    items
        .try_iter()?
        .map(|item| {
            let (column, order) = item?.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
            let column = match column.extract::<String>() {
                Ok(name) => names
                    .and_then(|names| names.iter().position(|other| *other == name))
                    .ok_or_else(|| wrong(format!("there is no column named {name:?}; pass names=, or an index")))?,
                Err(_) => Scalar::Object(column).count("rotations")?,
            };
            let order = match order.extract::<String>().as_deref() {
                Ok("wxyz") => QuaternionOrder::Wxyz,
                Ok("xyzw") => QuaternionOrder::Xyzw,
                _ => return Err(wrong("the order must be \"wxyz\" or \"xyzw\"".to_string())),
            };
            Ok(RotationColumns { column, order })
        })
        .collect()
}

/// Returns rotations as a mapping from the first column of a quaternion to its order.
pub(crate) fn rotations_to_python<'py>(py: Python<'py>, rotations: &[RotationColumns]) -> PyResult<Bound<'py, PyDict>> {
    let mapping = PyDict::new(py);
    for rotation in rotations {
        let order = match rotation.order {
            QuaternionOrder::Wxyz => "wxyz",
            QuaternionOrder::Xyzw => "xyzw",
        };
        mapping.set_item(rotation.column, order)?;
    }
    Ok(mapping)
}
