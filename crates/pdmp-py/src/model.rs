//! The model in Python, and how it moves.

use std::path::PathBuf;
use std::sync::Arc;

use ndarray::Array3;
use numpy::IntoPyArray;
use pdmp_core::learning::style_of;
use pdmp_core::motion::{TimeGrid, prediction_band, rollout_with};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};

use crate::conditions::{Conditions, conditions_of};
use crate::controller::Controller;
use crate::convert::{Cube, Matrix, Reduced, Vector, optional, to_numpy, vector};
use crate::demo::{Demonstration, Trajectory};
use crate::error::{ascii, interruptible, raise};
use crate::prediction::Prediction;

/// A parametric dynamic movement primitive: immutable, picklable, saved by `save`.
///
/// Made by `fit` and `load`.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct Model(pub(crate) Arc<pdmp_core::Model>);

/// Read a model file.
///
/// Parameters
/// ----------
/// path : path-like
///     A `.safetensors` file written by `Model.save`. A file from elsewhere is data: it runs no code and names no other
///     file, takes memory and time in proportion to its size, and moves in finite numbers or not at all. Its checksum
///     finds damage, not intent: the movement itself, and all texts in it, are whatever its author wrote.
///
/// Returns
/// -------
/// Model
///
/// Raises
/// ------
/// OSError
///     A file that cannot be read.
/// ModelFileError
///     A file that is damaged, not a model, or of another version.
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<Model> {
    py.detach(|| pdmp_core::Model::load(&path)).map(|model| Model(Arc::new(model))).map_err(raise)
}

#[pymethods]
impl Model {
    /// Compute the movement under constant conditions.
    ///
    /// Integrates τż = α_z(β_z(c − y) − z), τẏ = z + w about the frame c, with w = x·sᵀb (discrete) or r·sᵀb (rhythmic),
    /// exactly. Conditions that are not given are those of the nominal demonstration.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, optional
    ///     Conditions at the start.
    /// dt : float
    ///     Interval between samples in s.
    /// duration : float, optional
    ///     Length in s; otherwise the demonstrated duration scaled by `tau`, or the sum of `segment_durations`; one period if
    ///     rhythmic.
    /// context : array_like, (Q,), optional
    ///     Context whose prediction supplies style, goal, start or anchor, and duration where they are not given.
    /// **changes
    ///     Single conditions by name (see `Conditions`), in place of those of `conditions`.
    ///
    /// Returns
    /// -------
    /// Trajectory
    ///     n + 1 samples, n = duration / dt rounded down.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A wrong length, a number that is not finite, or a condition that this kind of primitive does not have.
    /// TypeError
    ///     An unknown keyword, or conditions of another type.
    ///
    /// Examples
    /// --------
    /// >>> model.rollout(goal=[0.4, 0.1], tau=2.0, dt=0.001).position.shape
    /// (2001, 2)
    #[pyo3(
        signature = (conditions=None, *, dt=0.01, duration=None, context=None, **changes),
        text_signature = "($self, conditions=None, *, dt=0.01, duration=None, context=None, **changes)"
    )]
    fn rollout(
        &self,
        py: Python<'_>,
        conditions: Option<&Bound<'_, PyAny>>,
        dt: f64,
        duration: Option<f64>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Trajectory> {
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let trajectory = interruptible(py, |progress| {
            rollout_with(self.0.primitive(), &conditions, TimeGrid { dt, duration }, progress)
        })?;
        Ok(Trajectory::new(py, trajectory, self.0.names(), self.0.units()))
    }

    /// Return the conditions of one demonstration, or the mean of several.
    ///
    /// Parameters
    /// ----------
    /// demos : int or sequence of int
    ///     Indices of demonstrations, from 0 to M - 1.
    ///
    /// Returns
    /// -------
    /// Conditions
    ///     Style, goal and start or anchor, and segment durations.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     No index, one that is no whole number, or one outside the demonstrations.
    ///
    /// Examples
    /// --------
    /// >>> trajectory = model.rollout(model.conditions(3))
    fn conditions(&self, demos: &Bound<'_, PyAny>) -> PyResult<Conditions> {
        let whole = |item: &Bound<'_, PyAny>| {
            item.extract::<isize>()
                .ok()
                .filter(|_| item.getattr("ndim").is_err() || item.get_type().name().is_ok_and(|name| name != "ndarray"))
        };
        let indices: Option<Vec<isize>> = match whole(demos) {
            Some(index) => Some(vec![index]),
            None if demos.is_instance_of::<PyString>() => None,
            None => demos.try_iter().ok().and_then(|items| items.map(|item| whole(&item.ok()?)).collect()),
        };
        let Some(indices) = indices else {
            let text = format!("demos = {}: pass the index of a demonstration, or a list of them", demos.repr()?);
            return Err(PyValueError::new_err(text));
        };
        let last = self.0.n_demos() - 1;
        let index = |index: isize| {
            let text = || format!("demos: {index} must lie between 0 and {last}");
            usize::try_from(index).ok().filter(|index| *index <= last).ok_or_else(|| PyValueError::new_err(text()))
        };
        let indices = indices.into_iter().map(index).collect::<PyResult<Vec<usize>>>()?;
        self.0.conditions(&indices).map(Conditions).map_err(raise)
    }

    /// The style (J,) of a new demonstration: the likeliest given its target.
    ///
    /// Minimises ‖f − As‖²/σ² + Σ s_j²/v_j, with A the forcing of the styles, σ² what least squares leave of the target f
    /// and v_j the largest square of the demonstrations' styles. A cycle that begins in another phase than those of the
    /// model is turned to theirs first. The demonstration is inspected as in `fit`, with the same warnings.
    ///
    /// Parameters
    /// ----------
    /// demonstration : Demonstration
    ///     A movement of the same degrees of freedom.
    /// dt, period : float, optional
    ///     As in `fit`.
    /// events : array_like, (E,), optional
    ///     Times of its events in s, if the model was fitted with events; where time was warped, its own is too.
    ///
    /// Returns
    /// -------
    /// ndarray, (J,)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Names or units other than those of the model; a demonstration that it does not describe, where the movement of
    ///     the closest style deviates by more than half of the demonstration's own and its forcing by more than three times
    ///     what is left out of those fitted, or where the style is more than ten times as large as any of theirs.
    #[pyo3(signature = (demonstration, *, dt=None, period=None, events=None))]
    fn style_of<'py>(
        &self,
        py: Python<'py>,
        demonstration: &Demonstration,
        dt: Option<f64>,
        period: Option<f64>,
        events: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let events = optional("events", events)?;
        crate::inspection::warn(
            py,
            &pdmp_core::preprocessing::inspection::inspect(std::slice::from_ref(&demonstration.0), dt),
        )?;
        let style = py.detach(|| style_of(&self.0, &demonstration.0, dt, period, events.as_deref())).map_err(raise)?;
        Ok(to_numpy(py, &style))
    }

    /// The attractor landscape b(u) of each style dimension and degree of freedom.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock: t / tau where discrete, the phase in rad where rhythmic.
    ///
    /// Returns
    /// -------
    /// ndarray, (n, J, D)
    fn landscape<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<Cube<'py>> {
        let u = vector("u", u)?;
        let mut landscape = Array3::zeros((u.len(), self.0.n_styles(), self.0.n_dofs()));
        for (&u, mut at) in u.iter().zip(landscape.outer_iter_mut()) {
            let basis = self.0.landscape(u).map_err(raise)?;
            for (value, b) in at.iter_mut().zip(basis) {
                *value = b;
            }
        }
        Ok(landscape.into_pyarray(py))
    }

    /// Share m(u) of the way from start to goal that a discrete movement has covered, from 0 at the start to 1 from
    /// the end on.
    ///
    /// The output system moves about the frame c(u) = y₀ + (g − y₀)·m(u); m ≡ 1 where the model was fitted with
    /// ``transport="immediate"``.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock: t / tau.
    ///
    /// Returns
    /// -------
    /// ndarray, (n,)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A rhythmic primitive, or a clock that is negative or not finite.
    fn transport<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let share: PyResult<Vec<f64>> = vector("u", u)?.iter().map(|&u| self.0.transport(u).map_err(raise)).collect();
        Ok(share?.into_pyarray(py))
    }

    /// The time constant in s at a phase of a movement with the given timing.
    ///
    /// A control loop that sets it at every tick follows the timing, as `rollout` does:
    /// `controller.tau = model.tau_at(controller.phase, grid)`, with `transition=0`.
    ///
    /// Parameters
    /// ----------
    /// phase : float
    ///     Phase of a controller: x in (0, 1] where discrete, φ in rad where rhythmic.
    /// timing : array_like, (K,)
    ///     Time in s in each segment between `breaks`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A timing that does not fit the model, or a phase out of range.
    fn tau_at(&self, phase: f64, segment_durations: &Bound<'_, PyAny>) -> PyResult<f64> {
        self.0.tau_at(phase, &vector("segment_durations", segment_durations)?).map_err(raise)
    }

    /// The movement for a condition, as in Section 4.1.2.
    ///
    /// Parameters
    /// ----------
    /// context : array_like or list, (Q,)
    ///     The condition.
    ///
    /// Returns
    /// -------
    /// Prediction
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A model fitted without contexts, a wrong length, a label never shown, or a number that is not finite.
    fn predict(&self, py: Python<'_>, context: &Bound<'_, PyAny>) -> PyResult<Prediction> {
        let prediction = self.0.predict(&crate::convert::context("context", context)?).map_err(raise)?;
        Prediction::new(py, prediction)
    }

    /// Bounds within which a new movement of a condition lies, for each sample of `rollout(context=context, dt=dt)`.
    ///
    /// y ± t·√(aᵀΣa + v), with the covariance Σ of the prediction, the derivatives a of y with respect to what is
    /// predicted, the variance v that the styles leave out of the demonstrations, and Student's quantile t for the
    /// degrees of freedom. Movements are compared at equal shares of their durations: how these vary is in the
    /// prediction.
    ///
    /// Parameters
    /// ----------
    /// context : array_like or list, (Q,)
    ///     The condition.
    /// level : float
    ///     Probability that a number lies within its bounds.
    /// dt : float
    ///     Interval between samples in s.
    ///
    /// Returns
    /// -------
    /// lower, upper : (T, D) ndarray
    ///     In the unit of each degree of freedom.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A level that is no probability, what `predict` refuses, or demonstrations too few to tell a band.
    #[pyo3(signature = (context, *, level=0.9, dt=0.01))]
    fn band<'py>(
        &self,
        py: Python<'py>,
        context: &Bound<'_, PyAny>,
        level: f64,
        dt: f64,
    ) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let prediction = self.0.predict(&crate::convert::context("context", context)?).map_err(raise)?;
        let grid = TimeGrid { dt, duration: None };
        let [lower, upper] = py.detach(|| prediction_band(&self.0, &prediction, level, grid)).map_err(raise)?;
        Ok((lower.into_pyarray(py), upper.into_pyarray(py)))
    }

    /// Write a model file. It appears whole or not at all, whatever interrupts the writing; a process that is killed
    /// meanwhile leaves a draft `.pdmp-*.draft` beside it.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     Where to, by custom with the suffix `.safetensors`.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     A path that cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.0.save(&path)).map_err(raise)
    }

    /// Start a control loop.
    ///
    /// Parameters
    /// ----------
    /// dt : float
    ///     Length of a tick in s.
    /// conditions : Conditions, optional
    ///     Conditions at the start. Of segment durations the loop takes the total, and follows them where `tau_at` sets
    ///     its τ.
    /// transition : float, optional
    ///     Time in s to 99 % of a changed style, goal, anchor, amplitude, tau or speed, at the model's own tau; 0 is the
    ///     paper's immediate switch. By default a tenth of the nominal duration (discrete) or a quarter of the period
    ///     (rhythmic). A goal takes the remaining time of the movement if that is longer, unless transport is immediate.
    /// context, **changes
    ///     As in `rollout`.
    ///
    /// Returns
    /// -------
    /// Controller
    #[pyo3(
        signature = (dt=0.001, conditions=None, *, transition=None, context=None, **changes),
        text_signature = "($self, dt=0.001, conditions=None, *, transition=None, context=None, **changes)"
    )]
    fn controller(
        &self,
        py: Python<'_>,
        dt: f64,
        conditions: Option<&Bound<'_, PyAny>>,
        transition: Option<f64>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Controller> {
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let controller = pdmp_core::Controller::new(self.0.primitive(), dt, &conditions, transition).map_err(raise)?;
        Controller::new(py, Arc::clone(&self.0), controller)
    }

    /// The bytes of a model file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &py.detach(|| self.0.to_bytes()).map_err(raise)?))
    }

    /// A model from the bytes of a model file.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| pdmp_core::Model::from_bytes(data)).map(|model| Self(Arc::new(model))).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,).into_pyobject(py)?))
    }

    fn __repr__(&self) -> String {
        let model = &self.0;
        ascii(&format!(
            "<pdmp.Model: {}, {} demonstrations, {} DoFs, {} styles, tau {:.4} s{}; {}>",
            model.kind(),
            model.n_demos(),
            model.n_dofs(),
            model.n_styles(),
            model.tau(),
            noise(model),
            model.learnt().regression
        ))
    }
}

/// The noise of the degree of freedom that has most for its range, where any has.
fn noise(model: &pdmp_core::Model) -> String {
    let share = |d: usize| model.learnt().noise.levels()[d] / model.ranges()[d].max(f64::MIN_POSITIVE);
    let noisiest = (0..model.n_dofs()).max_by(|&a, &b| share(a).total_cmp(&share(b)));
    noisiest.filter(|&d| share(d) > 0.0).map_or_else(String::new, |d| {
        let (level, unit) = (model.learnt().noise.levels()[d], &model.units()[d]);
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        format!(
            "; measurement noise {level:.2e}{unit}, {:.2} % of the range, in {}",
            100.0 * share(d),
            model.names()[d]
        )
    })
}
