//! Conditions of a movement, and the conversion of keywords to conditions.

use numpy::PyArray1;
use pdmp_core::Error;
use pdmp_core::model::{Conditions as Inner, Prediction};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{read_only, vector};
use crate::error::{ascii, raise};
use crate::instance;
use crate::named_contexts::{context_for, predicted};
use crate::scalar::{Scalar, number};
use crate::via_points::AdditionalForcing;

/// Names of all conditions, which are their keywords.
const NAMES: [&str; 11] = [
    "style",
    "goal",
    "start",
    "velocity",
    "goal_velocity",
    "anchor",
    "amplitude",
    "tau",
    "segment_durations",
    "phase",
    "forcing",
];

/// Conditions of a movement.
///
/// A condition that is None is that of the nominal demonstration. `Model.rollout`, `Model.controller` and
/// `Model.jacobian` take conditions, and keywords of the same names that replace single ones; `Model.conditions`,
/// `Model.predict` and `blend` return conditions.
///
/// Parameters
/// ----------
/// style : array_like, (J,), optional
///     Style parameter s. ``style=model.styles[m]`` alone keeps start, goal and duration of the nominal demonstration;
///     ``model.conditions(m)`` has all of demonstration m.
/// goal : array_like, (D,), optional
///     Goal g in the unit of each degree of freedom; discrete.
/// start : array_like, (D,), optional
///     Start position y₀ in the unit of each degree of freedom. A rhythmic movement starts on its limit cycle by
///     default.
/// velocity : array_like, (D,), optional
///     Start velocity per s; by default that of the demonstrations.
/// goal_velocity : array_like, (D,), optional
///     Final velocity per s with which a discrete movement passes its goal at the end, such as that of a strike; by
///     default that of the demonstrations. It needs learnt transport. See `Controller.goal_velocity` for changes on the
///     way.
/// anchor : array_like, (D,), optional
///     Anchor y_a, the centre of oscillation, in the unit of each degree of freedom; rhythmic.
/// amplitude : float, optional
///     Amplitude r₀ relative to the demonstrations, 1 by default; rhythmic.
/// tau : float, optional
///     Time constant τ in s: the duration of a discrete movement, the period over 2π of a rhythmic one.
/// segment_durations : array_like, (K,), optional
///     Time in s in each segment between `Model.breaks`, in place of `tau`. Time over phase is the monotone cubic
///     through their sums. A rollout follows it; a controller takes the total, and `Model.tau_at` returns τ at each
///     phase.
/// phase : float, optional
///     Phase φ in rad at which a rhythmic movement starts on its limit cycle; 0 by default.
/// forcing : AdditionalForcing, optional
///     Additional forcing, which displaces the movement; see `Model.through`.
///
/// Raises
/// ------
/// ValueError
///     A condition is not a number or a vector of numbers. Models check lengths and finiteness when they take
///     conditions.
/// TypeError
///     A keyword is unknown.
///
/// Examples
/// --------
/// >>> slow = pdmp.Conditions(goal=[0.4, 0.1], tau=2.0)
/// >>> fast = slow.replace(tau=0.5)
/// >>> pdmp.blend(slow, fast, 0.5).tau
/// 1.25
#[pyclass(frozen, eq, module = "pdmp", from_py_object)]
#[derive(Clone, PartialEq)]
pub(crate) struct Conditions(pub(crate) Inner);

#[pymethods]
impl Conditions {
    #[new]
    #[pyo3(
        signature = (**conditions),
        text_signature = "(*, style=None, goal=None, start=None, velocity=None, goal_velocity=None, anchor=None, amplitude=None, \
                          tau=None, segment_durations=None, phase=None, forcing=None)"
    )]
    fn new(conditions: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        crate::labelled::reject(conditions)?;
        changed(Inner::default(), conditions).map(Self)
    }

    /// Returns a copy with some conditions replaced.
    ///
    /// Parameters
    /// ----------
    /// **changes
    ///     Conditions by name; None stands for that of the nominal demonstration. `tau` replaces `segment_durations`
    ///     and vice versa.
    ///
    /// Returns
    /// -------
    /// Conditions
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As for `Conditions`.
    #[pyo3(signature = (**changes))]
    fn replace(&self, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        crate::labelled::reject(changes)?;
        changed(self.0.clone(), changes).map(Self)
    }

    /// Style parameter s (J,), or None.
    #[getter]
    fn style<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.style)
    }

    /// Goal g (D,) of a discrete movement, or None.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.goal)
    }

    /// Start position y₀ (D,), or None.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.start)
    }

    /// Start velocity (D,) per s, or None.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.velocity)
    }

    /// Final velocity (D,) per s of a discrete movement, or None.
    #[getter]
    fn goal_velocity<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.goal_velocity)
    }

    /// Anchor y_a (D,) of a rhythmic movement, or None.
    #[getter]
    fn anchor<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.anchor)
    }

    /// Amplitude r₀ of a rhythmic movement, or None.
    #[getter]
    fn amplitude(&self) -> Option<f64> {
        self.0.amplitude
    }

    /// Time constant τ in s, or None.
    #[getter]
    fn tau(&self) -> Option<f64> {
        self.0.tau
    }

    /// Time in s in each segment (K,), or None.
    #[getter]
    fn segment_durations<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.segment_durations)
    }

    /// Phase φ in rad at which a rhythmic movement starts, or None.
    #[getter]
    fn phase(&self) -> Option<f64> {
        self.0.phase
    }

    /// Additional forcing, or None.
    #[getter]
    fn forcing(&self) -> Option<AdditionalForcing> {
        self.0.forcing.clone().map(AdditionalForcing)
    }

    fn __getnewargs_ex__<'py>(slf: &Bound<'py, Self>) -> PyResult<((), Bound<'py, PyDict>)> {
        Ok(((), present(slf)?))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let text = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let list = value.call_method0("tolist").unwrap_or(value);
            Ok(format!("{name}={}", list.repr()?))
        };
        let parts = present(slf)?.iter().map(text).collect::<PyResult<Vec<_>>>()?;
        Ok(format!("pdmp.Conditions({})", parts.join(", ")))
    }
}

/// Computes the conditions (1 − share)·a + share·b.
///
/// Parameters
/// ----------
/// a, b : Conditions
///     Conditions of equal names and lengths, such as two of `Model.conditions`.
/// share : float
///     Share of `b`, from 0 to 1; values outside extrapolate.
///
/// Returns
/// -------
/// Conditions
///
/// Raises
/// ------
/// ValueError
///     A condition is given for only one of the two, lengths differ, or `share` is not finite.
///
/// Examples
/// --------
/// >>> between = pdmp.blend(model.conditions(0), model.conditions(1), 0.25)
/// >>> np.allclose(between.goal, 0.75 * model.goals[0] + 0.25 * model.goals[1])
/// True
#[pyfunction]
pub(crate) fn blend(a: &Bound<'_, PyAny>, b: &Bound<'_, PyAny>, share: Scalar<'_>) -> PyResult<Conditions> {
    let (a, b) = (instance::conditions("a", a)?, instance::conditions("b", b)?);
    a.blend(b, share.number("share")?).map(Conditions).map_err(raise)
}

/// Returns the conditions of a call: `conditions`, single ones replaced by `changes`, those absent from both predicted
/// for `context`.
pub(crate) fn conditions_of(
    model: &pdmp_core::Model,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<Inner> {
    Ok(predicted_conditions_of(model, conditions, context, changes)?.0)
}

/// Returns the conditions of a call and the prediction for its context, if there is one.
pub(crate) fn predicted_conditions_of(
    model: &pdmp_core::Model,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<(Inner, Option<Prediction>)> {
    let (own, prediction) = own_and_predicted(model, conditions, context, changes)?;
    let predicted = prediction.as_ref().map(|prediction| prediction.conditions.clone()).unwrap_or_default();
    Ok((own.or(predicted), prediction))
}

/// Returns `conditions` with `changes`, and the prediction for the context, if there is one.
pub(crate) fn own_and_predicted(
    model: &pdmp_core::Model,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<(Inner, Option<Prediction>)> {
    let base = match conditions {
        None => Inner::default(),
        Some(object) => instance::conditions("conditions", object)?.clone(),
    };
    let own = changed(base, crate::labelled::in_order(model, changes)?.as_ref())?;
    let Some(context) = context else { return Ok((own, None)) };
    reject_style(own.style.is_some())?;
    let prediction = predicted(context.py(), model, &context_for(model, context)?)?;
    Ok((own, Some(prediction)))
}

/// Rejects a style beside a context.
pub(crate) fn reject_style(is_present: bool) -> PyResult<()> {
    let reason = "the context predicts the style";
    if is_present { Err(raise(Error::Conflict { names: ["style", "context"], reason })) } else { Ok(()) }
}

/// Returns conditions with the changes of a keyword dictionary.
pub(crate) fn changed(mut conditions: Inner, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Inner> {
    let Some(changes) = changes else { return Ok(conditions) };
    for (name, value) in changes {
        let name: String = name.extract()?;
        let value = Some(value).filter(|value| !value.is_none());
        let numbers = |name: &str| value.as_ref().map(|value| vector(name, value)).transpose();
        let scalar = |name: &str| value.as_ref().map(|value| number(name, value)).transpose();
        match name.as_str() {
            "style" => conditions.style = numbers("style")?,
            "goal" => conditions.goal = numbers("goal")?,
            "start" => conditions.start = numbers("start")?,
            "velocity" => conditions.velocity = numbers("velocity")?,
            "goal_velocity" => conditions.goal_velocity = numbers("goal_velocity")?,
            "anchor" => conditions.anchor = numbers("anchor")?,
            "amplitude" => conditions.amplitude = scalar("amplitude")?,
            "tau" => {
                conditions.tau = scalar("tau")?;
                conditions.segment_durations.take_if(|_| is_absent(changes, "segment_durations") && value.is_some());
            }
            "segment_durations" => {
                conditions.segment_durations = numbers("segment_durations")?;
                conditions.tau.take_if(|_| is_absent(changes, "tau") && value.is_some());
            }
            "phase" => conditions.phase = scalar("phase")?,
            "forcing" => {
                let forcing = value.as_ref().map(|value| instance::forcing("forcing", value).cloned());
                conditions.forcing = forcing.transpose()?;
            }
            _ => {
                let text = format!("unexpected keyword argument '{name}'; conditions are {}", NAMES.join(", "));
                return Err(PyTypeError::new_err(ascii(&text)));
            }
        }
    }
    Ok(conditions)
}

fn is_absent(changes: &Bound<'_, PyDict>, name: &str) -> bool {
    changes.get_item(name).ok().flatten().is_none_or(|value| value.is_none())
}

/// Returns the conditions that are not None, by name.
fn present<'py>(conditions: &Bound<'py, Conditions>) -> PyResult<Bound<'py, PyDict>> {
    let present = PyDict::new(conditions.py());
    for name in NAMES {
        let value = conditions.getattr(name)?;
        if !value.is_none() {
            present.set_item(name, value)?;
        }
    }
    Ok(present)
}

fn array<'py>(py: Python<'py>, values: &Option<Vec<f64>>) -> Option<Bound<'py, PyArray1<f64>>> {
    values.as_ref().map(|values| read_only(py, values))
}
