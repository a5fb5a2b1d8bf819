//! Demonstrations, and objects that are read as demonstrations.

use ndarray::ArrayD;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods, ToPyArray};
use pdmp_core::Sampling;
use pdmp_core::demonstration::RotationColumns;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::convert::{
    Matrix, Vector, array, context_to_python, locked, optional, plain, quoted, read_only, texts, two_axes, vector,
};
use crate::error::raise;
use crate::rotations::{rotations_of, rotations_to_python};
use crate::scalar::{Scalar, optional_number};
use crate::trajectory::Trajectory;

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
///     {3: "xyzw"}. A quaternion rotates from the body frame to the world frame; the other convention is not
///     recognised. Norms become 1, and signs continuous along time. `position`, `goal`, `names` and `units` have one element
///     per column; a rotation has four columns and three degrees of freedom. The three columns before it, else after it,
///     with one unit that is none of an angle are the point of the pose: its components share their noise and range.
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
        let ordered = match (goal, demo.names()) {
            (Some(goal), Some(names)) => crate::labelled::arranged("goal", names, goal)?,
            _ => None,
        };
        if let Some(goal) = optional("goal", ordered.as_ref().or(goal))? {
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
