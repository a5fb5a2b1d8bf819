//! Points that movements pass.

use pdmp_core::inference::{At, ViaPoint as Inner};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

use crate::convert::{Vector, items, optional, quoted, read_only};
use crate::error::ascii;
use crate::scalar::{Scalar, optional_number};

/// Point that a movement passes at a time or a phase.
///
/// Parameters
/// ----------
/// time : float, optional
///     Time since the start in s; either this or `phase`.
/// position : array_like, (n,), optional
///     Position in the unit of each degree of freedom, one number for each of `dofs`.
/// phase : float, optional
///     Phase x of a discrete movement, in rad of a rhythmic one, as `Controller.phase`.
/// velocity : array_like, (n,), optional
///     Velocity per s, one number for each of `dofs`. A rotation has three in place of its four coordinates: its angular velocity
///     in rad/s, in the model's `rotation_frame`, at the orientation that `position` gives.
/// dofs : sequence of int or str, optional
///     Indices or names of the n degrees of freedom, or of coordinates if the model has rotations; all by default. A rotation
///     has all four coordinates or none.
/// tolerance : float
///     Standard deviation of the point relative to the range of each degree of freedom; a point with 0 is passed exactly.
///
/// Raises
/// ------
/// ValueError
///     `time` and `phase` are both given or both absent, or a value is not a number or a vector of numbers. `Model.through`
///     checks the others.
///
/// Examples
/// --------
/// >>> pdmp.ViaPoint(0.4, [0.2], dofs=[1])
/// pdmp.ViaPoint(time=0.4, position=[0.2], dofs=[1])
#[pyclass(frozen, eq, module = "pdmp")]
#[derive(Clone, PartialEq)]
pub(crate) struct ViaPoint {
    point: Inner,
    /// Indices or names.
    dofs: Option<Vec<Dof>>,
}

/// Index or name of a degree of freedom.
#[derive(Clone, PartialEq, FromPyObject, IntoPyObject)]
pub(crate) enum Dof {
    Index(usize),
    Name(String),
}

#[pymethods]
impl ViaPoint {
    #[new]
    #[pyo3(signature = (time=None, position=None, *, phase=None, velocity=None, dofs=None, tolerance=Scalar::Number(0.0)),
           text_signature = "(time=None, position=None, *, phase=None, velocity=None, dofs=None, tolerance=0.0)")]
    fn new(
        time: Option<Scalar<'_>>,
        position: Option<&Bound<'_, PyAny>>,
        phase: Option<Scalar<'_>>,
        velocity: Option<&Bound<'_, PyAny>>,
        dofs: Option<&Bound<'_, PyAny>>,
        tolerance: Scalar<'_>,
    ) -> PyResult<Self> {
        let at = match (optional_number("time", time)?, optional_number("phase", phase)?) {
            (Some(time), None) => At::Time(time),
            (None, Some(phase)) => At::Phase(phase),
            _ => return Err(PyValueError::new_err("pass either the time of the point or its phase")),
        };
        let dof = |name: &str, item: &Bound<'_, PyAny>| {
            let wrong = |_| PyValueError::new_err(format!("{name} = {}: expected an index or a name", quoted(item)));
            item.extract::<Dof>().map_err(wrong)
        };
        let point = Inner {
            at,
            position: optional("position", position)?,
            velocity: optional("velocity", velocity)?,
            dofs: None,
            tolerance: tolerance.number("tolerance")?,
        };
        Ok(Self { point, dofs: dofs.map(|dofs| items("dofs", dofs, dof)).transpose()? })
    }

    /// Time since the start in s, or None.
    #[getter]
    fn time(&self) -> Option<f64> {
        if let At::Time(time) = self.point.at { Some(time) } else { None }
    }

    /// Phase, or None.
    #[getter]
    fn phase(&self) -> Option<f64> {
        if let At::Phase(phase) = self.point.at { Some(phase) } else { None }
    }

    /// Position (n,), or None.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.point.position.as_ref().map(|position| read_only(py, position))
    }

    /// Velocity (n,) per s, or None.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.point.velocity.as_ref().map(|velocity| read_only(py, velocity))
    }

    /// Indices or names of the degrees of freedom, or None for all.
    #[getter]
    fn dofs(&self) -> Option<Vec<Dof>> {
        self.dofs.clone()
    }

    /// Standard deviation relative to the ranges.
    #[getter]
    fn tolerance(&self) -> f64 {
        self.point.tolerance
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((), Bound<'py, PyDict>)> {
        let Inner { position, velocity, tolerance, .. } = &self.point;
        let arguments = [("time", self.time()), ("phase", self.phase()), ("tolerance", Some(*tolerance))];
        let arguments = arguments.into_py_dict(py)?;
        arguments.set_item("position", position)?;
        arguments.set_item("velocity", velocity)?;
        arguments.set_item("dofs", self.dofs.clone())?;
        Ok(((), arguments))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (_, arguments) = self.__getnewargs_ex__(py)?;
        let mut parts = Vec::new();
        for name in ["time", "phase", "position", "velocity", "dofs", "tolerance"] {
            let value = arguments.get_item(name)?.filter(|value| !value.is_none());
            if let Some(value) = value.filter(|_| name != "tolerance" || self.point.tolerance != 0.0) {
                parts.push(format!("{name}={}", value.repr()?));
            }
        }
        Ok(format!("pdmp.ViaPoint({})", parts.join(", ")))
    }
}

impl ViaPoint {
    /// Returns the point with the indices of its degrees of freedom.
    pub(crate) fn of(&self, names: &[String]) -> PyResult<Inner> {
        let index = |dof: &Dof| match dof {
            Dof::Index(index) => Ok(*index),
            Dof::Name(name) => names.iter().position(|other| other == name).ok_or_else(|| {
                let text = format!("dofs: no '{name}' among {}", names.join(", "));
                PyValueError::new_err(ascii(&text))
            }),
        };
        let dofs = self.dofs.as_ref().map(|dofs| dofs.iter().map(index).collect::<PyResult<_>>()).transpose()?;
        Ok(Inner { dofs, ..self.point.clone() })
    }
}
