//! Generated movements.

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pdmp_core::model::Coordinates;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{Reduced, to_numpy};
use crate::rotations::rotations_to_python;

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
    pub(crate) rotations: Py<PyDict>,
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
        for name in ["time", "position", "velocity", "acceleration", "names", "units"] {
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
