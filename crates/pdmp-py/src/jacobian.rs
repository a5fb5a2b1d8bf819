//! Jacobians of a movement in Python.

use numpy::IntoPyArray;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{TimeGrid, WithRespectTo, jacobian};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::conditions_of;
use crate::convert::{Cube, count};
use crate::error::{interruptible, raise};
use crate::model::Model;

#[pymethods]
impl Model {
    /// Compute the Jacobian ∂y/∂v of a rollout's positions with respect to one of its conditions v.
    ///
    /// A movement is linear in style, goal, anchor and start: y(v + Δv) = y(v) + (∂y/∂v)Δv exactly, with the same
    /// Jacobian for all their values. It depends on which of `start` and `velocity` are given, on amplitude and on tau.
    ///
    /// Parameters
    /// ----------
    /// wrt : {"style", "goal", "anchor", "start"}
    ///     Condition with respect to which to differentiate.
    /// conditions : Conditions, optional
    ///     Conditions at the start.
    /// derivative : int
    ///     0 for positions, 1 for velocities, 2 for accelerations.
    /// dt, duration, context, **changes
    ///     As in `rollout`.
    ///
    /// Returns
    /// -------
    /// ndarray, (T, D, J) with respect to the style, (T, D, D) otherwise
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Conditions that do not fit, a condition that this kind of primitive does not have, or segment durations of
    ///     several segments.
    ///
    /// Examples
    /// --------
    /// >>> model.jacobian("goal", dt=0.001).shape
    /// (1001, 2, 2)
    #[pyo3(
        signature = (wrt, conditions=None, *, derivative=0, dt=0.01, duration=None, context=None, **changes),
        text_signature = "($self, wrt, conditions=None, *, derivative=0, dt=0.01, duration=None, context=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        wrt: &str,
        conditions: Option<&Bound<'py, PyAny>>,
        derivative: isize,
        dt: f64,
        duration: Option<f64>,
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
        let derivative = Derivative::of_order("derivative", count("derivative", derivative)?).map_err(raise)?;
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let found = interruptible(py, |progress| {
            jacobian(self.0.primitive(), wrt, derivative, &conditions, TimeGrid { dt, duration }, progress)
        })?;
        Ok(found.into_pyarray(py))
    }
}
