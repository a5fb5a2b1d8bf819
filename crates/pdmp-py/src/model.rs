//! Models: conditions, styles and predictions.

use std::sync::Arc;

use ndarray::Array3;
use numpy::IntoPyArray;
use pdmp_core::learning::{StyleOptions, style_of};
use pdmp_core::motion::{PredictionBand, TimeGrid, Vary, feasible_prediction, prediction_band};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::conditions::Conditions;
use crate::convert::{Cube, Matrix, Vector, optional, quoted, to_numpy, vector};
use crate::error::raise;
use crate::instance;
use crate::prediction::Prediction;
use crate::scalar::{Scalar, optional_number};

/// Parametric dynamic movement primitive, returned by `fit` and `load`.
///
/// Models are immutable, their arrays are read-only copies, and they can be pickled.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct Model(pub(crate) Arc<pdmp_core::Model>);

#[pymethods]
impl Model {
    /// Returns the conditions of one demonstration, or the mean of several.
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
    ///     `demos` is empty, not a whole number, or out of range.
    ///
    /// Examples
    /// --------
    /// >>> trajectory = model.rollout(model.conditions(2))
    /// >>> np.allclose(trajectory.position[0], model.starts[2])
    /// True
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
            let text = format!("demos = {}: pass the index of a demonstration, or a list of them", quoted(demos));
            return Err(PyValueError::new_err(text));
        };
        if indices.is_empty() {
            return Err(PyValueError::new_err("demos = []: pass the index of at least one demonstration"));
        }
        let last = self.0.n_demos() - 1;
        let index = |index: isize| {
            let text = || format!("demos = {index}: must lie between 0 and {last}");
            usize::try_from(index).ok().filter(|index| *index <= last).ok_or_else(|| PyValueError::new_err(text()))
        };
        let indices = indices.into_iter().map(index).collect::<PyResult<Vec<usize>>>()?;
        self.0.conditions(&indices).map(Conditions).map_err(raise)
    }

    /// Estimates the style of a new demonstration.
    ///
    /// The maximum a posteriori estimate minimises ‖f − As‖²/σ² + Σ s_j²/v_j, with the target f, the forcing terms A of
    /// the styles, the least-squares residual variance σ² and the largest square v_j of the demonstrations' styles. A
    /// cycle with another initial phase is first shifted to that of the model's. The demonstration is inspected as in
    /// `fit`, with the same warnings. A model with a time warp warps the demonstration too.
    ///
    /// Parameters
    /// ----------
    /// demonstration : Demonstration
    ///     A movement of the same degrees of freedom.
    /// dt : float, optional
    ///     Sampling interval in s of a demonstration without one.
    /// period : float, optional
    ///     Period in s of a time-stamped cycle.
    /// landmarks : array_like, (E,), optional
    ///     Times in s of its landmarks; required if the model was fitted with landmarks.
    ///
    /// Returns
    /// -------
    /// ndarray, (J,)
    ///     Style s.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Names or units differ from those of the model, or the model does not describe the demonstration: its closest
    ///     movement deviates by more than half of the demonstration's deviation from its mean while the forcing left
    ///     out exceeds three times that of the fitted demonstrations, or its style is more than ten times as large as
    ///     theirs.
    ///
    /// Examples
    /// --------
    /// >>> new = pdmp.Demonstration(model.rollout(model.conditions(1), dt=0.02))
    /// >>> np.allclose(model.style_of(new), model.styles[1], atol=0.01)
    /// True
    #[pyo3(signature = (demonstration, *, dt=None, period=None, landmarks=None))]
    fn style_of<'py>(
        &self,
        py: Python<'py>,
        demonstration: &Bound<'py, PyAny>,
        dt: Option<Scalar<'py>>,
        period: Option<Scalar<'py>>,
        landmarks: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let demonstration = instance::demonstration("demonstration", demonstration)?;
        let mut options = StyleOptions::default();
        options.dt = optional_number("dt", dt)?;
        options.period = optional_number("period", period)?;
        options.landmarks = optional("landmarks", landmarks)?;
        crate::inspection::warn(
            py,
            &pdmp_core::preprocessing::inspection::inspect(std::slice::from_ref(demonstration), options.dt),
        )?;
        let style = py.detach(|| style_of(&self.0, demonstration, &options)).map_err(raise)?;
        Ok(to_numpy(py, &style))
    }

    /// Computes the attractor landscape b(u) of each style dimension and degree of freedom.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock: t / tau of a discrete movement, phase in rad of a rhythmic one.
    ///
    /// Returns
    /// -------
    /// ndarray, (n, J, D)
    ///     In the unit of each degree of freedom.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A clock value is not finite, or negative for a discrete movement.
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

    /// Computes the transport m(u), the share of the distance from start to goal that a discrete movement has covered.
    ///
    /// The frame of the output system is c(u) = y₀ + (g − y₀)·m(u). m increases from 0 at the start to 1 at the end and
    /// stays 1; with `transport="immediate"`, m = 1 everywhere.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock t / tau.
    ///
    /// Returns
    /// -------
    /// ndarray, (n,)
    ///     Shares from 0 to 1.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The primitive is rhythmic, or a clock value is negative or not finite.
    fn transport<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let shares: PyResult<Vec<f64>> = vector("u", u)?.iter().map(|&u| self.0.transport(u).map_err(raise)).collect();
        Ok(shares?.into_pyarray(py))
    }

    /// Computes the time constant τ at a phase for given segment durations.
    ///
    /// A control loop follows segment durations, as `rollout` does, if it sets
    /// `controller.tau = model.tau_at(controller.phase, segment_durations)` before each tick, with `transition=0`.
    ///
    /// Parameters
    /// ----------
    /// phase : float
    ///     Phase of a controller: x in (0, 1] of a discrete movement, φ in rad of a rhythmic one.
    /// segment_durations : array_like, (K,)
    ///     Time in s in each segment between `breaks`.
    ///
    /// Returns
    /// -------
    /// float
    ///     Time constant τ in s.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `segment_durations` has a wrong length or is not positive, or `phase` is out of range.
    fn tau_at(&self, phase: Scalar<'_>, segment_durations: &Bound<'_, PyAny>) -> PyResult<f64> {
        let phase = phase.number("phase")?;
        self.0.tau_at(phase, &vector("segment_durations", segment_durations)?).map_err(raise)
    }

    /// Predicts the movement for a context (Section 4.1.2).
    ///
    /// Parameters
    /// ----------
    /// context : array_like, list or mapping, (Q,)
    ///     Numbers and labels, in the units of the demonstrations' contexts; by name where these had names.
    /// limits : Limits, optional
    ///     Limits of position, velocity and acceleration that the whole movement keeps; see `feasible`. Style and goal, or
    ///     anchor, of `conditions` are then the most probable ones of the prediction that keep them, as
    ///     `nearest_feasible(limits, context=context)` returns. The other attributes, and `band`, describe demonstrators
    ///     without these limits.
    ///
    /// Returns
    /// -------
    /// Prediction
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The model was fitted without contexts, `context` has a wrong length, an unknown label, or a number that
    ///     is not finite, or no style and goal keep the limits.
    /// TypeError
    ///     `limits` has another type.
    ///
    /// Examples
    /// --------
    /// >>> prediction = model.predict([0.05])
    /// >>> trajectory = model.rollout(prediction.conditions)
    /// >>> np.allclose(trajectory.position, model.rollout(context=[0.05]).position)
    /// True
    /// >>> limits = pdmp.Limits(velocity=0.9 * abs(trajectory.velocity).max())
    /// >>> model.feasible(limits, model.predict([0.05], limits=limits).conditions).feasible
    /// True
    #[pyo3(signature = (context, *, limits=None))]
    fn predict(
        &self,
        py: Python<'_>,
        context: &Bound<'_, PyAny>,
        limits: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Prediction> {
        let limits = limits.map(instance::limits).transpose()?;
        let mut prediction = self.0.predict(&crate::named_contexts::context_for(&self.0, context)?).map_err(raise)?;
        if let Some(limits) = limits {
            prediction = py.detach(|| feasible_prediction(&self.0, limits, prediction, Vary::Both)).map_err(raise)?;
        }
        Prediction::new(py, prediction)
    }

    /// Computes the prediction band of a new movement for a context.
    ///
    /// y ± t·√(aᵀΣa + v), with the covariance Σ of the prediction, the derivatives a of y with respect to the predicted
    /// conditions, the residual variance v of the demonstrations, and the quantile t of Student's distribution. The
    /// band compares movements at equal shares of their durations; `Prediction.covariance` has the variance of these. It
    /// describes demonstrators, whom limits of a robot do not bind.
    ///
    /// Parameters
    /// ----------
    /// context : array_like, list or mapping, (Q,)
    ///     Numbers and labels, in the units of the demonstrations' contexts; by name where these had names.
    /// level : float
    ///     Probability in (0, 1) that a position of the new movement lies within its bounds.
    /// dt : float
    ///     Interval between samples in s.
    ///
    /// Returns
    /// -------
    /// lower, upper : ndarray, (T, D)
    ///     Bounds at the samples of `rollout(context=context, dt=dt)`, in the unit of each degree of freedom. Those of a
    ///     rotation are bounds of the rotation vector in rad from the predicted orientation, in `rotation_frame`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `level` is not in (0, 1), `predict` rejects `context`, or the demonstrations are too few for a covariance.
    #[pyo3(
        signature = (context, *, level=Scalar::Number(0.9), dt=Scalar::Number(0.01)),
        text_signature = "($self, context, *, level=0.9, dt=0.01)"
    )]
    fn band<'py>(
        &self,
        py: Python<'py>,
        context: &Bound<'_, PyAny>,
        level: Scalar<'py>,
        dt: Scalar<'py>,
    ) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let (level, dt) = (level.number("level")?, dt.number("dt")?);
        let prediction = self.0.predict(&crate::named_contexts::context_for(&self.0, context)?).map_err(raise)?;
        let grid = TimeGrid { dt, duration: None };
        let PredictionBand { lower, upper } =
            py.detach(|| prediction_band(&self.0, &prediction, level, grid)).map_err(raise)?;
        Ok((lower.into_pyarray(py), upper.into_pyarray(py)))
    }
}
