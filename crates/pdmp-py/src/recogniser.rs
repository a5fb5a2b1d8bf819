//! Recognition of a movement while it is observed.

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pdmp_core::Kind;
use pdmp_core::inference::Timing;
use pyo3::prelude::*;

use crate::conditions::Conditions;
use crate::convert::{refill, to_numpy, vector};
use crate::error::raise;
use crate::instance;
use crate::model::Model;
use crate::named_contexts::context_for;
use crate::scalar::{Scalar, optional_number};

/// Estimate of a movement from a part of it, returned by `Recogniser.estimate`.
///
/// Standard deviations are scaled so that 90 % of the held-out demonstrations lie within 1.645 of them.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Estimate {
    /// Conditions of the whole movement: style, goal and start, or anchor and present phase, and duration.
    conditions: Py<Conditions>,
    /// Style (J,).
    style: Py<PyArray1<f64>>,
    /// Standard deviations (J,) of the style.
    style_deviation: Py<PyArray1<f64>>,
    /// Goal (nq,), or the anchor of a rhythmic movement.
    goal: Py<PyArray1<f64>>,
    /// Standard deviations (D,) of the goal or anchor; those of a rotation are of the components of the rotation vector in rad
    /// from it, in the frame of angular velocities.
    goal_deviation: Py<PyArray1<f64>>,
    /// Duration or period in s.
    duration: f64,
    /// Standard deviation of the logarithm of the duration.
    duration_deviation: f64,
    /// Time of arrival at the goal in s, on the clock of the observations; None for a rhythmic movement.
    arrival: Option<f64>,
    /// Time from the start to the last observation over the estimated duration, more than 1 after the end of the movement;
    /// fraction of the cycle, in [0, 1), for a rhythmic one.
    fraction: f64,
    /// Standard deviation of `fraction`.
    fraction_deviation: f64,
    /// Probability that the movement is stopped. From 0.9 on, its clock rests until it is below 0.5: fraction and
    /// continuation are those of a movement that goes on at once, and the arrival is later by the pause.
    stopped: f64,
    /// Mean squared residual, relative to that which one in ten held-out demonstrations exceeds. Above 1 the movement is
    /// unlike the demonstrations.
    surprise: f64,
}

impl Estimate {
    fn new(py: Python<'_>, estimate: &pdmp_core::inference::Estimate, kind: Kind) -> PyResult<Self> {
        let array = |values: &[f64]| to_numpy(py, values).unbind();
        Ok(Self {
            conditions: Py::new(py, Conditions(estimate.conditions()))?,
            style: array(estimate.style()),
            style_deviation: array(&estimate.deviations[..estimate.n_styles]),
            goal: array(estimate.goal()),
            goal_deviation: array(estimate.goal_deviation()),
            duration: estimate.duration,
            duration_deviation: estimate.duration_deviation,
            arrival: (kind == Kind::Discrete).then_some(estimate.arrival),
            fraction: estimate.fraction,
            fraction_deviation: estimate.fraction_deviation,
            stopped: estimate.stopped,
            surprise: estimate.surprise,
        })
    }
}

#[pymethods]
impl Estimate {
    fn __repr__(&self) -> String {
        let Self { fraction, duration, surprise, .. } = self;
        format!("<pdmp.Estimate: {fraction:.2} of a movement of {duration:.3} s, surprise {surprise:.2}>")
    }
}

/// Positions to come, returned by `Recogniser.continuation`.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Continuation {
    /// Times (T,) in s, on the clock of the observations.
    time: Py<PyArray1<f64>>,
    /// Mean positions (T, nq), with unit quaternions of continuous signs.
    position: Py<PyArray2<f64>>,
    /// Standard deviations (T, D): 90 % of held-out positions lie within 1.645 of them. Those of a rotation are of the
    /// components of the rotation vector in rad from the mean, in the frame of angular velocities, as in a prediction band.
    deviation: Py<PyArray2<f64>>,
}

#[pymethods]
impl Continuation {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let n = self.time.bind(py).len()?;
        Ok(format!("<pdmp.Continuation: {n} samples>"))
    }
}

/// Filter that estimates style, goal, start and duration of a movement while it is observed.
///
/// At a given clock a movement is linear in style, goal and start, or anchor. Each of 64 hypotheses of the duration has the
/// posterior of these under the mixture of the prior, in closed form, and is weighed by its likelihood. An observation
/// takes the same time and memory at any time. A rotation counts as three degrees of freedom, the rotation vector about the
/// mean of the demonstrations at the clock of each hypothesis.
///
/// The movement may pause: where it is slow against its prediction, the clock of all hypotheses rests until it goes on.
#[pyclass(module = "pdmp")]
pub(crate) struct Recogniser {
    inner: pdmp_core::inference::Recogniser,
    kind: Kind,
    position: Vec<f64>,
}

#[pymethods]
impl Recogniser {
    /// Includes an observation.
    ///
    /// Parameters
    /// ----------
    /// time : float
    ///     Time in s, after that of the observation before; intervals are arbitrary.
    /// position : array_like, (nq,)
    ///     Position in the columns of the demonstrations; NaN where one is missing. A quaternion with a NaN is missing; its
    ///     sign does not matter.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The time is not after the one before, the positions have another number or are infinite, or the norm of a
    ///     quaternion is not 1. The recogniser then remains as it was.
    fn update(&mut self, time: Scalar<'_>, position: &Bound<'_, PyAny>) -> PyResult<()> {
        refill("position", position, &mut self.position)?;
        self.inner.update(time.number("time")?, &self.position).map_err(raise)
    }

    /// Returns the estimate from all observations so far.
    ///
    /// Returns
    /// -------
    /// Estimate
    ///     Style, goal, duration and phase, with standard deviations.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     There is no observation, or the observations are in another unit than the demonstrations.
    fn estimate(&mut self, py: Python<'_>) -> PyResult<Estimate> {
        let kind = self.kind;
        self.inner.estimate().map_err(raise).and_then(|estimate| Estimate::new(py, estimate, kind))
    }

    /// Predicts the positions at times from the last observation on. A movement that is stopped goes on at once.
    ///
    /// Parameters
    /// ----------
    /// time : array_like, (T,)
    ///     Times in s, on the clock of the observations.
    ///
    /// Returns
    /// -------
    /// Continuation
    ///     Means and standard deviations of the positions.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A time is before the last observation, and as for `estimate`.
    fn continuation(&mut self, py: Python<'_>, time: &Bound<'_, PyAny>) -> PyResult<Continuation> {
        let time = vector("time", time)?;
        let ahead = py.detach(|| self.inner.continuation(&time)).map_err(raise)?;
        let array = |matrix: Array2<f64>| matrix.into_pyarray(py).unbind();
        let time = to_numpy(py, &ahead.time).unbind();
        Ok(Continuation { time, position: array(ahead.position), deviation: array(ahead.deviation) })
    }

    /// Forgets all observations.
    fn reset(&mut self) {
        self.inner.reset();
    }

    /// Number of hypotheses of duration, and start or phase.
    #[getter]
    fn n_hypotheses(&self) -> usize {
        self.inner.n_hypotheses()
    }

    fn __repr__(&self) -> String {
        format!("<pdmp.Recogniser: {} hypotheses>", self.inner.n_hypotheses())
    }
}

#[pymethods]
impl Model {
    /// Creates a filter that estimates a movement while it is observed.
    ///
    /// Parameters
    /// ----------
    /// prior : Prior
    ///     Prior of the movement, from `prior`.
    /// context : array_like, (Q,), or mapping, optional
    ///     Context of the movement, if it is known: the prior is then that of movements in this context.
    /// starts : (float, float), optional
    ///     Earliest and latest start of a discrete movement, in s from the first observation; a negative one is a movement
    ///     joined on its way. By default it starts with the first observation. A rhythmic one is joined at any phase.
    /// duration : float, optional
    ///     Duration or period in s, if it is known.
    ///
    /// Returns
    /// -------
    /// Recogniser
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The prior is of another model or, with `context`, of a model without contexts; the context has another length or an
    ///     unknown label; or a time is out of range.
    /// TypeError
    ///     An argument has another type.
    ///
    /// Examples
    /// --------
    /// >>> recogniser = model.recogniser(model.prior(demos))
    /// >>> seen = demos[0].n_samples // 2
    /// >>> for time, position in zip(demos[0].time[:seen], demos[0].position[:seen]):
    /// ...     recogniser.update(time, position)
    /// >>> estimate = recogniser.estimate()
    /// >>> bool(np.abs(estimate.goal - demos[0].position[-1]).max() < 0.2)
    /// True
    /// >>> rest = model.rollout(dt=0.01, conditions=estimate.conditions)
    #[pyo3(signature = (prior, *, context=None, starts=None, duration=None))]
    fn recogniser(
        &self,
        prior: &Bound<'_, PyAny>,
        context: Option<&Bound<'_, PyAny>>,
        starts: Option<&Bound<'_, PyAny>>,
        duration: Option<Scalar<'_>>,
    ) -> PyResult<Recogniser> {
        let prior = instance::prior(prior)?;
        let mut timing = Timing { duration: optional_number("duration", duration)?, ..Timing::default() };
        if let Some(starts) = starts {
            let [earliest, latest] = instance::pair("starts", starts, "numbers")?;
            timing.starts =
                [crate::scalar::number("starts[0]", &earliest)?, crate::scalar::number("starts[1]", &latest)?];
        }
        let given = |context| prior.given(&self.0, &context_for(&self.0, context)?).map_err(raise);
        let given = context.map(given).transpose()?;
        let prior = given.as_ref().unwrap_or(prior);
        let inner = pdmp_core::inference::Recogniser::new(&self.0, prior, timing).map_err(raise)?;
        Ok(Recogniser { inner, kind: self.0.kind(), position: Vec::new() })
    }
}
