//! Limits of a robot.

use pdmp_core::motion::{Limit, Limits as Inner};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyTuple};

use crate::controller::Controller;
use crate::convert::{Vector, numbers, read_only};
use crate::error::raise;
use crate::instance::{self, pair};

/// Limits of position, velocity, acceleration and jerk.
///
/// Each limit is one number for all degrees of freedom or an array (D,); None and infinity are no limit.
/// `Model.controller` keeps them at every tick, `Model.fastest` along a path, and `Model.fastest_tau` with a constant
/// tau.
///
/// The three degrees of freedom of a rotation have equal limits, in rad/s and rad/s², of the sizes of its angular velocity and
/// acceleration, which depend on no frame; its position and jerk have none.
///
/// Parameters
/// ----------
/// position : tuple of two float or array_like, (D,), optional
///     Lower and upper limits in the unit of each degree of freedom; either may be None.
/// velocity : float or array_like, (D,), optional
///     Limit of the velocity's magnitude per s, positive.
/// acceleration : float or array_like, (D,), optional
///     Limit of the acceleration's magnitude per s², positive.
/// jerk : float or array_like, (D,), optional
///     Limit of the jerk's magnitude per s³, positive; it needs a limit of the acceleration. Controllers keep it,
///     `Model.fastest` does not.
/// synchronous : bool
///     True: a controller slows all degrees of freedom along the path if one cannot follow it, and only then limits single
///     ones. False: it limits every degree of freedom on its own.
///
/// Raises
/// ------
/// ValueError
///     A limit is not a number or a vector, lengths differ, a lower limit is not below the upper one, a velocity,
///     acceleration or jerk is not positive, or a jerk has no acceleration. Models check lengths when they take limits.
/// TypeError
///     `position` does not have two items.
///
/// Examples
/// --------
/// >>> limits = pdmp.Limits(position=(-2.9, 2.9), velocity=2.0, acceleration=[8.0, 10.0])
/// >>> limits
/// pdmp.Limits(position=([-2.9], [2.9]), velocity=[2.0], acceleration=[8.0, 10.0])
/// >>> controller = model.controller(limits=limits)
/// >>> controller.limits.velocity
/// array([2., 2.])
#[pyclass(frozen, eq, module = "pdmp")]
#[derive(Clone, PartialEq)]
pub(crate) struct Limits(pub(crate) Inner);

#[pymethods]
impl Limits {
    #[new]
    #[pyo3(signature = (position=None, velocity=None, acceleration=None, jerk=None, *, synchronous=true))]
    fn new(
        position: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        acceleration: Option<&Bound<'_, PyAny>>,
        jerk: Option<&Bound<'_, PyAny>>,
        synchronous: bool,
    ) -> PyResult<Self> {
        let limit = |name: &str, value: Option<&Bound<'_, PyAny>>| {
            value.filter(|value| !value.is_none()).map(|value| numbers(name, Some(value))).transpose()
        };
        let pair = position.map(|position| pair("position", position, "limits (lower, upper)")).transpose()?;
        let (lower, upper) = pair.map(|[lower, upper]| (lower, upper)).unzip();
        let limits = Inner {
            lower: limit("position: lower", lower.as_ref())?,
            upper: limit("position: upper", upper.as_ref())?,
            velocity: limit("velocity", velocity)?,
            acceleration: limit("acceleration", acceleration)?,
            jerk: limit("jerk", jerk)?,
            synchronous,
        };
        let vectors = [&limits.lower, &limits.upper, &limits.velocity, &limits.acceleration, &limits.jerk];
        let n_dofs = vectors.into_iter().flatten().map(Vec::len).fold(1, usize::max);
        limits.check(n_dofs).map_err(raise)?;
        Ok(Self(limits))
    }

    /// Lower and upper limits of the position, each (1,) or (D,) and infinite where there is none, or None.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Option<(Vector<'py>, Vector<'py>)> {
        let [lower, upper] = [&self.0.lower, &self.0.upper];
        let n = lower.as_ref().or(upper.as_ref())?.len();
        let or = |limits: &Option<Vec<f64>>, none: f64| match limits {
            Some(limits) => read_only(py, limits),
            None => read_only(py, &vec![none; n]),
        };
        Some((or(lower, f64::NEG_INFINITY), or(upper, f64::INFINITY)))
    }

    /// Limit of the velocity's magnitude (1,) or (D,) per s, or None.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.velocity.as_ref().map(|limits| read_only(py, limits))
    }

    /// Limit of the acceleration's magnitude (1,) or (D,) per s², or None.
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.acceleration.as_ref().map(|limits| read_only(py, limits))
    }

    /// Limit of the jerk's magnitude (1,) or (D,) per s³, or None.
    #[getter]
    fn jerk<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.jerk.as_ref().map(|limits| read_only(py, limits))
    }

    /// True if a controller slows all degrees of freedom along the path before it limits single ones.
    #[getter]
    fn synchronous(&self) -> bool {
        self.0.synchronous
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let Inner { lower, upper, velocity, acceleration, jerk, synchronous } = &self.0;
        let position = (lower.is_some() || upper.is_some()).then_some((lower, upper));
        let options = [("synchronous", synchronous)].into_py_dict(py)?;
        ((position, velocity, acceleration, jerk), options).into_pyobject(py)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let Inner { lower, upper, velocity, acceleration, jerk, synchronous } = &self.0;
        let text = |limits: &Option<Vec<f64>>| Ok::<_, PyErr>(limits.into_pyobject(py)?.repr()?.to_string());
        let mut parts = Vec::new();
        if lower.is_some() || upper.is_some() {
            parts.push(format!("position=({}, {})", text(lower)?, text(upper)?));
        }
        for (name, limits) in [("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk)] {
            if limits.is_some() {
                parts.push(format!("{name}={}", text(limits)?));
            }
        }
        if !synchronous {
            parts.push("synchronous=False".to_owned());
        }
        Ok(format!("pdmp.Limits({})", parts.join(", ")))
    }
}

#[pymethods]
impl Controller {
    /// Limits of position, velocity and acceleration (D,) in force, or None.
    ///
    /// Every tick keeps them, for any commands, measurements, coupling terms and tick lengths: at its end lower ≤ y ≤ upper,
    /// |ẏ| ≤ V, |ÿ| ≤ A and a change of ẏ by at most A·dt, and between its ends lower ≤ y ≤ upper on the cubic through
    /// position and velocity at both, by which a robot interpolates; the mean velocity of a tick is at most V, too. A degree
    /// of freedom brakes with A, or with V / (2 dt) or (upper - lower) / dt² for the default tick if that is less. A longer
    /// tick is limited in parts of constant acceleration, and is no single cubic. A movement inside the limits is not changed.
    ///
    /// With a limit of the jerk, ÿ changes by at most J·dt, the degree of freedom can always stop inside, and a movement
    /// begins with ÿ = 0, or with the present ÿ if it goes on from the present position and velocity. Where a degree of freedom
    /// comes to rest within a tick, the cubic may pass the limit by J·dt³/150.
    ///
    /// The limits of a rotation are those of the sizes of its angular velocity and acceleration: at the end of every tick |ω| ≤ V and
    /// |ω̇| ≤ A, over it a change of ω by at most A·dt in the frame of the tool and in that of the world, and a turn by at most V·dt. A limited
    /// tick ends with the closest ω within them, and turns about a fixed axis.
    ///
    /// A goal or anchor outside is moved to the limit: `goal` and `anchor` return it, and a movement finishes there. A
    /// movement outside, after limits that shrink or at a start outside, brakes with A and returns at V or below. Along a path that
    /// leaves the limits of the position from its start on, a degree of freedom is held at its limit and continues from there
    /// when the path returns; `Model.nearest_feasible` finds conditions that stay inside. A command during the movement is
    /// accepted in part instead, see `pending`. Where the acceleration along the path steps, a limit of the jerk binds single
    /// degrees of freedom. The limits stay in force after `reset`; None removes them.
    #[getter]
    fn limits(&self) -> Option<Limits> {
        Limits::of(self.inner.limits())
    }

    #[setter]
    fn set_limits(&mut self, limits: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let result = match limits {
            Some(limits) => self.inner.set_limits(instance::limits(limits)?),
            None => self.inner.set_limits(&Inner::default()),
        };
        self.command(result)
    }

    /// True while a part of a commanded style, goal, anchor or amplitude is not yet accepted, as the movement ahead would leave
    /// its limits with it.
    #[getter]
    fn pending(&self) -> bool {
        self.inner.is_pending()
    }

    /// Limit that determined the acceleration of each degree of freedom in the last tick: "position", "velocity",
    /// "acceleration", "jerk", or None for a free one.
    ///
    /// A limit of the position counts from where the degree of freedom brakes in front of it.
    #[getter]
    fn limited(&self) -> Vec<Option<&'static str>> {
        let name = |limit: &Limit| match limit {
            Limit::Position => "position",
            Limit::Velocity => "velocity",
            Limit::Acceleration => "acceleration",
            Limit::Jerk => "jerk",
        };
        self.inner.limited().iter().map(|limit| limit.as_ref().map(name)).collect()
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
            jerk: finite(limits.jerk),
            synchronous: limits.synchronous,
        };
        (limits != Inner { synchronous: limits.synchronous, ..Inner::default() }).then_some(Self(limits))
    }
}
