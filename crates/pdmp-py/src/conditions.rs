//! What a movement starts with, from Python's arguments.

use pdmp_core::Conditions;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::convert::optional;
use crate::error::raise;

/// Conditions from Python's arguments: what is missing is left to the model.
pub(crate) struct Arguments<'a, 'py> {
    pub(crate) style: Option<&'a Bound<'py, PyAny>>,
    pub(crate) goal: Option<&'a Bound<'py, PyAny>>,
    pub(crate) start: Option<&'a Bound<'py, PyAny>>,
    pub(crate) velocity: Option<&'a Bound<'py, PyAny>>,
    pub(crate) anchor: Option<&'a Bound<'py, PyAny>>,
    pub(crate) amplitude: f64,
    pub(crate) tau: Option<f64>,
    pub(crate) timing: Option<&'a Bound<'py, PyAny>>,
    pub(crate) phase: Option<f64>,
}

impl Arguments<'_, '_> {
    pub(crate) fn conditions(self) -> PyResult<Conditions> {
        Ok(Conditions {
            style: optional("style", self.style)?,
            goal: optional("goal", self.goal)?,
            anchor: optional("anchor", self.anchor)?,
            start: optional("start", self.start)?,
            velocity: optional("velocity", self.velocity)?,
            amplitude: Some(self.amplitude),
            tau: self.tau,
            timing: optional("timing", self.timing)?,
            phase: self.phase,
        })
    }

    /// The same, with a context's prediction for what is missing.
    pub(crate) fn in_context(
        self,
        model: &pdmp_core::Model,
        context: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Conditions> {
        let given = self.conditions()?;
        let Some(context) = context else { return Ok(given) };
        let context = crate::convert::context("context", context)?;
        if given.style.is_some() {
            return Err(PyValueError::new_err("pass style or context, not both: the context predicts the style"));
        }
        let predicted = model.predict(&context).map_err(raise)?.conditions;
        Ok(Conditions {
            style: predicted.style,
            goal: given.goal.or(predicted.goal),
            anchor: given.anchor.or(predicted.anchor),
            start: given.start.or(predicted.start),
            velocity: given.velocity,
            amplitude: given.amplitude,
            // A tau that is given takes the place of the predicted timing.
            timing: given.timing.or(predicted.timing.filter(|_| given.tau.is_none())),
            tau: given.tau,
            phase: given.phase,
        })
    }
}
