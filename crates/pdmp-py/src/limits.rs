//! Limits of a robot.

use numpy::PyArray1;
use pdmp_core::motion::Limits as Inner;
use pyo3::prelude::*;

use crate::convert::{numbers, to_numpy};
use crate::instance::pair;

/// Limits of position, velocity and acceleration.
///
/// Each limit is one number for all degrees of freedom or an array (D,); None and infinity are no limit.
///
/// Parameters
/// ----------
/// position : tuple of two float or array_like, (D,), optional
///     Lower and upper limit in the unit of each degree of freedom.
/// velocity : float or array_like, (D,), optional
///     Limit of the velocity's magnitude per s.
/// acceleration : float or array_like, (D,), optional
///     Limit of the acceleration's magnitude per s².
///
/// Raises
/// ------
/// ValueError
///     A limit is not a number or a vector. Lengths and signs are checked where the limits are used.
/// TypeError
///     `position` has other than two items.
///
/// Examples
/// --------
/// >>> limits = pdmp.Limits(position=(-2.9, 2.9), velocity=2.0, acceleration=[8.0, 10.0])
/// >>> controller = model.controller(limits=limits)
/// >>> limits.velocity
/// array([2.])
#[pyclass(frozen, eq, module = "pdmp", from_py_object)]
#[derive(Clone, PartialEq)]
pub(crate) struct Limits(pub(crate) Inner);

#[pymethods]
impl Limits {
    #[new]
    #[pyo3(signature = (position=None, velocity=None, acceleration=None))]
    fn new(
        position: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        acceleration: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let limit = |name: &str, value: Option<&Bound<'_, PyAny>>| {
            value.filter(|value| !value.is_none()).map(|value| numbers(name, Some(value))).transpose()
        };
        let pair = position.map(|position| pair("position", position, "limits (lower, upper)")).transpose()?;
        let (lower, upper) = pair.map(|[lower, upper]| (lower, upper)).unzip();
        Ok(Self(Inner {
            lower: limit("lower", lower.as_ref())?,
            upper: limit("upper", upper.as_ref())?,
            velocity: limit("velocity", velocity)?,
            acceleration: limit("acceleration", acceleration)?,
        }))
    }

    /// Lower and upper limits of the position, each (1,) or (D,), or None.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let [lower, upper] = [&self.0.lower, &self.0.upper];
        let n = lower.as_ref().or(upper.as_ref())?.len();
        let or = |limits: &Option<Vec<f64>>, none: f64| match limits {
            Some(limits) => to_numpy(py, limits),
            None => to_numpy(py, &vec![none; n]),
        };
        Some((or(lower, f64::NEG_INFINITY), or(upper, f64::INFINITY)))
    }

    /// Limit of the velocity's magnitude (1,) or (D,) per s, or None.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.velocity.as_ref().map(|limits| to_numpy(py, limits))
    }

    /// Limit of the acceleration's magnitude (1,) or (D,) per s², or None.
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.acceleration.as_ref().map(|limits| to_numpy(py, limits))
    }
}

impl Limits {
    /// Returns the limits that are finite somewhere, `None` without any.
    pub(crate) fn of(limits: Inner) -> Option<Self> {
        let finite = |limits: Option<Vec<f64>>| limits.filter(|limits| limits.iter().any(|limit| limit.is_finite()));
        let limits = Inner {
            lower: finite(limits.lower),
            upper: finite(limits.upper),
            velocity: finite(limits.velocity),
            acceleration: finite(limits.acceleration),
        };
        (limits != Inner::default()).then_some(Self(limits))
    }
}
