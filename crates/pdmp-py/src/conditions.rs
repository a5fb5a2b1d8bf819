//! Conditions of a movement in Python, and the one place where keywords become conditions.

use numpy::PyArray1;
use pdmp_core::model::Conditions as Inner;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{number, to_numpy, vector};
use crate::error::{ascii, raise};

/// Names of all conditions, as keywords have them.
const NAMES: [&str; 9] =
    ["style", "goal", "start", "velocity", "anchor", "amplitude", "tau", "segment_durations", "phase"];

/// Conditions under which a movement starts. A condition that is None is that of the nominal demonstration.
///
/// Rollouts, controllers and Jacobians take conditions, with keywords of the same names in place of single ones;
/// `Model.conditions`, `Model.predict` and `blend` return them.
///
/// Parameters
/// ----------
/// style : array_like, (J,), optional
///     Style parameter s.
/// goal : array_like, (D,), optional
///     Goal g; discrete.
/// start : array_like, (D,), optional
///     Start position y₀. A rhythmic movement otherwise starts on its limit cycle.
/// velocity : array_like, (D,), optional
///     Start velocity per s; otherwise that of the demonstrations.
/// anchor : array_like, (D,), optional
///     Anchor y_a, the centre of oscillation; rhythmic.
/// amplitude : float, optional
///     Amplitude r₀, 1 as demonstrated; rhythmic.
/// tau : float, optional
///     Time constant τ in s.
/// segment_durations : array_like, (K,), optional
///     Time in s in each segment between `Model.breaks`, in place of `tau`. Time over phase is the monotone cubic through
///     them. A rollout follows it; a controller takes the total, and `Model.tau_at` gives its τ at each phase.
/// phase : float, optional
///     Phase φ in rad at which a rhythmic movement starts, on its limit cycle; 0 otherwise.
///
/// Raises
/// ------
/// ValueError
///     A condition that is not a number or a vector of numbers. Lengths and kind are checked where a model takes them.
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
        text_signature = "(*, style=None, goal=None, start=None, velocity=None, anchor=None, amplitude=None, tau=None, \
                          segment_durations=None, phase=None)"
    )]
    fn new(conditions: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        changed(Inner::default(), conditions).map(Self)
    }

    /// Return the same conditions with others in place of those named; None leaves one to the nominal demonstration.
    ///
    /// Parameters
    /// ----------
    /// **changes
    ///     Conditions by name. `tau` takes the place of `segment_durations`, and the other way round.
    ///
    /// Returns
    /// -------
    /// Conditions
    #[pyo3(signature = (**changes))]
    fn replace(&self, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        changed(self.0.clone(), changes).map(Self)
    }

    /// Style parameter s (J,).
    #[getter]
    fn style<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.style)
    }

    /// Goal g (D,), discrete.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.goal)
    }

    /// Start position y₀ (D,).
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.start)
    }

    /// Start velocity (D,), per s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.velocity)
    }

    /// Anchor y_a (D,), rhythmic.
    #[getter]
    fn anchor<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.anchor)
    }

    /// Amplitude r₀, rhythmic.
    #[getter]
    fn amplitude(&self) -> Option<f64> {
        self.0.amplitude
    }

    /// Time constant τ in s.
    #[getter]
    fn tau(&self) -> Option<f64> {
        self.0.tau
    }

    /// Time in s in each segment (K,).
    #[getter]
    fn segment_durations<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        array(py, &self.0.segment_durations)
    }

    /// Phase φ in rad at which a rhythmic movement starts.
    #[getter]
    fn phase(&self) -> Option<f64> {
        self.0.phase
    }

    fn __getnewargs_ex__<'py>(slf: &Bound<'py, Self>) -> PyResult<((), Bound<'py, PyDict>)> {
        Ok(((), given(slf)?))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let text = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let list = value.call_method0("tolist").unwrap_or(value);
            Ok(format!("{name}={}", list.repr()?))
        };
        let parts = given(slf)?.iter().map(text).collect::<PyResult<Vec<_>>>()?;
        Ok(format!("pdmp.Conditions({})", parts.join(", ")))
    }
}

/// Returns the conditions (1 − share)·a + share·b.
///
/// Parameters
/// ----------
/// a, b : Conditions
///     Conditions with the same names, such as two of `Model.conditions`.
/// share : float
///     0 gives `a`, 1 gives `b`; values outside [0, 1] extrapolate.
///
/// Returns
/// -------
/// Conditions
///
/// Raises
/// ------
/// ValueError
///     A condition that one of the two lacks, lengths that differ, or a share that is not finite.
#[pyfunction]
pub(crate) fn blend(a: &Conditions, b: &Conditions, share: f64) -> PyResult<Conditions> {
    a.0.blend(&b.0, share).map(Conditions).map_err(raise)
}

/// Returns the conditions of a call: `conditions`, with `changes` in place of single ones, and the prediction for a
/// `context` where both lack one.
pub(crate) fn conditions_of(
    model: &pdmp_core::Model,
    conditions: Option<&Bound<'_, PyAny>>,
    context: Option<&Bound<'_, PyAny>>,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<Inner> {
    let base = match conditions {
        None => Inner::default(),
        Some(given) => match given.cast::<Conditions>() {
            Ok(conditions) => conditions.get().0.clone(),
            Err(_) => {
                let found = given.get_type().name()?;
                let text = format!(
                    "conditions: expected pdmp.Conditions, found {found}; pass single ones by name, such as style="
                );
                return Err(PyTypeError::new_err(text));
            }
        },
    };
    let own = changed(base, changes)?;
    let Some(context) = context else { return Ok(own) };
    if own.style.is_some() {
        return Err(PyValueError::new_err("pass style or context, not both: the context predicts the style"));
    }
    let prediction = model.predict(&crate::convert::context("context", context)?).map_err(raise)?;
    Ok(own.or(prediction.conditions))
}

/// Returns conditions with the changes of a keyword dictionary.
fn changed(mut conditions: Inner, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Inner> {
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
fn given<'py>(conditions: &Bound<'py, Conditions>) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(conditions.py());
    for name in NAMES {
        let value = conditions.getattr(name)?;
        if !value.is_none() {
            found.set_item(name, value)?;
        }
    }
    Ok(found)
}

fn array<'py>(py: Python<'py>, values: &Option<Vec<f64>>) -> Option<Bound<'py, PyArray1<f64>>> {
    values.as_ref().map(|values| to_numpy(py, values))
}
