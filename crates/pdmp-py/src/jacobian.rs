//! Jacobians of rollouts.

use numpy::IntoPyArray;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{TimeGrid, WithRespectTo, jacobian};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::conditions_of;
use crate::convert::Cube;
use crate::error::{interruptible, raise};
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};

#[pymethods]
impl Model {
    /// Compute the Jacobian ∂y/∂v of a rollout with respect to one of its conditions v.
    ///
    /// A movement is linear in style, goal, anchor and start: y(v + Δv) = y(v) + (∂y/∂v)Δv exactly, with the same
    /// Jacobian for all their values. It depends on tau, on the amplitude, and on the presence of `start` and `velocity`.
    ///
    /// Parameters
    /// ----------
    /// wrt : {"style", "goal", "anchor", "start"}
    ///     Condition v.
    /// conditions : Conditions, optional
    ///     Conditions at the start.
    /// derivative : int
    ///     Order of the time derivative of y: 0 for positions, 1 for velocities, 2 for accelerations.
    /// dt : float
    ///     Interval between samples in s.
    /// duration : float, optional
    ///     Length in s, as in `rollout`.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, J) or (T, D, D)
    ///     ∂y/∂v in the unit of y per unit of v, at the samples of `rollout`; (T, D, J) for the style.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Conditions that `rollout` rejects, a condition of the other kind of primitive, or several segment durations.
    ///
    /// Examples
    /// --------
    /// >>> jacobian = model.jacobian("goal", dt=0.1)
    /// >>> shift = np.array([0.1, 0.0])
    /// >>> base, moved = (model.rollout(goal=model.goals[0] + k * shift, dt=0.1).position for k in (0, 1))
    /// >>> np.allclose(moved - base, jacobian @ shift)
    /// True
    #[pyo3(
        signature = (wrt, conditions=None, *, derivative=Scalar::Count(0), dt=Scalar::Number(0.01), duration=None, context=None, **changes),
        text_signature = "($self, wrt, conditions=None, *, derivative=0, dt=0.01, duration=None, context=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        wrt: &str,
        conditions: Option<&Bound<'py, PyAny>>,
        derivative: Scalar<'py>,
        dt: Scalar<'py>,
        duration: Option<Scalar<'py>>,
        context: Option<&Bound<'py, PyAny>>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Cube<'py>> {
        let wrt = match wrt {
            "style" => WithRespectTo::Style,
            "goal" => WithRespectTo::Goal,
            "anchor" => WithRespectTo::Anchor,
            "start" => WithRespectTo::Start,
            _ => {
                let text = format!("wrt = '{wrt}': must be 'style', 'goal', 'anchor' or 'start'");
                return Err(PyValueError::new_err(text));
            }
        };
        let derivative = Derivative::of_order("derivative", derivative.count("derivative")?).map_err(raise)?;
        let grid = TimeGrid { dt: dt.number("dt")?, duration: optional_number("duration", duration)? };
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let jacobian =
            interruptible(py, |progress| jacobian(self.0.primitive(), wrt, derivative, &conditions, grid, progress))?;
        Ok(jacobian.into_pyarray(py))
    }
}
