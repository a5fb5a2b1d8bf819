//! Jacobians of a movement in Python.

use numpy::IntoPyArray;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{Timing, Variable};
use pyo3::prelude::*;

use crate::conditions::Arguments;
use crate::convert::{Cube, count};
use crate::error::{interruptible, raise};
use crate::model::Model;

#[pymethods]
impl Model {
    /// Jacobian ∂y/∂s of a rollout's positions: exact, and the same for every style, goal and anchor.
    ///
    /// A movement is linear in its style: y(s + Δs) = y(s) + (∂y/∂s)Δs. A given start velocity is the same for all
    /// styles, which the Jacobian knows.
    ///
    /// Parameters
    /// ----------
    /// dt : float
    ///     Interval between samples in s.
    /// derivative : int
    ///     0 for positions, 1 for velocities, 2 for accelerations.
    /// start, velocity : array_like, (D,), optional
    ///     As in `rollout`; which of them are given matters, their values do not.
    /// amplitude, tau, duration
    ///     As in `rollout`.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, J)
    #[pyo3(signature = (dt=0.01, *, derivative=0, start=None, velocity=None, amplitude=1.0, tau=None, duration=None))]
    #[allow(clippy::too_many_arguments)]
    fn style_jacobian<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        derivative: isize,
        start: Option<&Bound<'py, PyAny>>,
        velocity: Option<&Bound<'py, PyAny>>,
        amplitude: f64,
        tau: Option<f64>,
        duration: Option<f64>,
    ) -> PyResult<Cube<'py>> {
        let arguments = Arguments {
            style: None,
            goal: None,
            start,
            velocity,
            anchor: None,
            amplitude,
            tau,
            timing: None,
            phase: None,
        };
        self.jacobian(py, Variable::Style, derivative, arguments, Timing { dt, duration })
    }

    /// Jacobian ∂y/∂g of a discrete rollout's positions: exact, and the same for every style, goal and start.
    ///
    /// Parameters
    /// ----------
    /// dt, derivative, tau, duration
    ///     As in `style_jacobian`.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, D)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A rhythmic primitive: see `anchor_jacobian`.
    #[pyo3(signature = (dt=0.01, *, derivative=0, tau=None, duration=None))]
    fn goal_jacobian<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        derivative: isize,
        tau: Option<f64>,
        duration: Option<f64>,
    ) -> PyResult<Cube<'py>> {
        self.jacobian(py, Variable::Goal, derivative, from(None, tau), Timing { dt, duration })
    }

    /// Jacobian ∂y/∂y_a of a rhythmic rollout's positions: exact, and the same for every style, anchor and start.
    ///
    /// Parameters
    /// ----------
    /// dt, derivative, start, tau, duration
    ///     As in `style_jacobian`: a given start stays where it is, otherwise all moves with the anchor.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, D)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A discrete primitive: see `goal_jacobian`.
    #[pyo3(signature = (dt=0.01, *, derivative=0, start=None, tau=None, duration=None))]
    fn anchor_jacobian<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        derivative: isize,
        start: Option<&Bound<'py, PyAny>>,
        tau: Option<f64>,
        duration: Option<f64>,
    ) -> PyResult<Cube<'py>> {
        self.jacobian(py, Variable::Anchor, derivative, from(start, tau), Timing { dt, duration })
    }

    /// Jacobian ∂y/∂y(0) of a rollout's positions with respect to a given start: exact, and the same everywhere.
    ///
    /// Parameters
    /// ----------
    /// dt, derivative, tau, duration
    ///     As in `style_jacobian`.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, D)
    #[pyo3(signature = (dt=0.01, *, derivative=0, tau=None, duration=None))]
    fn start_jacobian<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        derivative: isize,
        tau: Option<f64>,
        duration: Option<f64>,
    ) -> PyResult<Cube<'py>> {
        self.jacobian(py, Variable::Start, derivative, from(None, tau), Timing { dt, duration })
    }
}

impl Model {
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        variable: Variable,
        derivative: isize,
        arguments: Arguments<'_, 'py>,
        timing: Timing,
    ) -> PyResult<Cube<'py>> {
        let derivative = Derivative::of_order("derivative", count("derivative", derivative)?).map_err(raise)?;
        let conditions = arguments.conditions()?;
        let jacobian = interruptible(py, |proceed| {
            pdmp_core::motion::jacobian(self.0.primitive(), variable, derivative, &conditions, timing, proceed)
        })?;
        Ok(jacobian.into_pyarray(py))
    }
}

/// Arguments of which only start and time constant matter.
fn from<'a, 'py>(start: Option<&'a Bound<'py, PyAny>>, tau: Option<f64>) -> Arguments<'a, 'py> {
    Arguments {
        style: None,
        goal: None,
        start,
        velocity: None,
        anchor: None,
        amplitude: 1.0,
        tau,
        timing: None,
        phase: None,
    }
}
