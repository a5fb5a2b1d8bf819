//! Vector-Jacobian products of batches.

use ndarray::{Array3, ArrayView3, Axis, Ix3};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pdmp_core::motion::{TimeGrid, WithRespectTo, batch};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

use crate::batch_conditions::batch_conditions_of;
use crate::choice::Choice;
use crate::convert::{array, items, threads};
use crate::error::interruptible;
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};

/// Conditions with respect to which movements are differentiated, by name.
pub(crate) const VARIABLES: [(&str, WithRespectTo); 8] = [
    ("style", WithRespectTo::Style),
    ("goal", WithRespectTo::Goal),
    ("anchor", WithRespectTo::Anchor),
    ("start", WithRespectTo::Start),
    ("velocity", WithRespectTo::Velocity),
    ("goal_velocity", WithRespectTo::GoalVelocity),
    ("amplitude", WithRespectTo::Amplitude),
    ("tau", WithRespectTo::Tau),
];

#[pymethods]
impl Model {
    /// Computes the gradients of a function of many movements with respect to their conditions.
    ///
    /// For a function L of the results of `rollouts`, with the cotangents v = ∂L/∂y, returns the vector-Jacobian products
    /// ∂L/∂x = Σ_t v(t)·∂y(t)/∂x of the conditions x. A movement is linear in all conditions but tau, so that the products
    /// are exact; no Jacobian is formed, and a call takes about as long as `rollouts`, also of movements that differ in tau,
    /// phase or segment durations. With respect to tau, they hold at fixed times, for accelerations as in `jacobian`.
    /// `pdmp.autodiff` wraps both calls for torch and jax.
    ///
    /// In a model with rotations, the gradient by a unit quaternion q of a goal, anchor or start is that of L as a function of
    /// q/|q|, orthogonal to q, and the part of a cotangent along its quaternion has no effect. Velocities are angular
    /// velocities in the frame of the model.
    ///
    /// Parameters
    /// ----------
    /// wrt : str or sequence of str
    ///     Conditions x: "style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude" or "tau".
    /// cotangents : array_like, (B, T, D), or tuple of array_like
    ///     ∂L/∂y of the positions, or of positions, velocities and accelerations as far as L depends on them, of the shapes
    ///     that `rollouts` returns: with rotations, positions have a column for each coordinate.
    /// conditions : Conditions, or B Conditions, optional
    ///     As in `rollouts`.
    /// context : array_like or list, (Q,) or (B, Q), optional
    ///     As in `rollouts`.
    /// dt, duration : float, optional
    ///     As in `rollouts`.
    /// threads : int, optional
    ///     As in `rollouts`.
    /// **changes
    ///     As in `rollouts`.
    ///
    /// Returns
    /// -------
    /// tuple of ndarray
    ///     ∂L/∂x in the order of `wrt`, of the shape of B of these conditions: (B, J) for the style, (B,) for amplitude and
    ///     tau, else (B, D). Row b is the gradient by the condition of movement b; the gradient by a condition that all share
    ///     is the sum of the rows.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An argument that `rollouts` rejects; cotangents of another shape, or not finite; a condition of the other kind of
    ///     primitive; a velocity or start of which there is none to differentiate by; or tau with `segment_durations`, which
    ///     are given in place of it, or with accelerations of a model with rotations.
    /// TypeError
    ///     As in `rollouts`.
    ///
    /// Examples
    /// --------
    /// >>> goals = model.goals + 0.1
    /// >>> (positions,) = model.rollouts(goal=goals, style=model.styles, dt=0.1, derivatives=0)
    /// >>> loss, cotangents = 0.5 * (positions**2).sum(), positions
    /// >>> by_style, by_goal = model.rollouts_vjp(
    /// ...     ["style", "goal"], cotangents, goal=goals, style=model.styles, dt=0.1
    /// ... )
    /// >>> by_style.shape, by_goal.shape
    /// ((5, 2), (5, 2))
    #[pyo3(
        signature = (
            wrt, cotangents, conditions=None, *, dt=Scalar::Number(0.01), duration=None, context=None, threads=None,
            **changes
        ),
        text_signature = "($self, wrt, cotangents, conditions=None, *, dt=0.01, duration=None, context=None, \
                          threads=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn rollouts_vjp<'py>(
        &self,
        py: Python<'py>,
        wrt: &Bound<'py, PyAny>,
        cotangents: &Bound<'py, PyAny>,
        conditions: Option<&Bound<'py, PyAny>>,
        dt: Scalar<'py>,
        duration: Option<Scalar<'py>>,
        context: Option<&Bound<'py, PyAny>>,
        threads: Option<Scalar<'py>>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let variable = |name: &str, item: &Bound<'py, PyAny>| item.extract::<Choice>()?.of(name, &VARIABLES);
        let is_name = wrt.is_instance_of::<PyString>();
        let variables = if is_name { vec![variable("wrt", wrt)?] } else { items("wrt", wrt, variable)? };
        let cotangents = match cotangents {
            several if several.is_instance_of::<PyTuple>() => items("cotangents", several, Cotangents::of)?,
            one => vec![Cotangents::of("cotangents", one)?],
        };
        let grid = TimeGrid { dt: dt.number("dt")?, duration: optional_number("duration", duration)? };
        let (threads, conditions) =
            (self::threads(threads)?, batch_conditions_of(py, &self.0, conditions, context, changes)?);
        let views: Vec<_> = cotangents.iter().map(Cotangents::view).collect();
        let gradients = interruptible(py, |progress| {
            let batch = batch(self.0.primitive(), conditions, grid, &mut *progress)?;
            batch.vector_jacobian(0..batch.shape().0, &variables, &views, threads, progress)
        })?;
        let arrays = gradients.into_iter().zip(variables).map(|(rows, variable)| match variable {
            WithRespectTo::Amplitude | WithRespectTo::Tau => {
                rows.index_axis_move(Axis(1), 0).into_pyarray(py).into_any()
            }
            _ => rows.into_pyarray(py).into_any(),
        });
        PyTuple::new(py, arrays.collect::<Vec<_>>())
    }
}

/// Cotangents (B, T, D): those of numpy, read without a copy if they are doubles, or converted ones.
enum Cotangents<'py> {
    Borrowed(PyReadonlyArray3<'py, f64>),
    Owned(Array3<f64>),
}

impl<'py> Cotangents<'py> {
    fn of(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = value.cast_exact::<PyArray3<f64>>()
            && array.is_aligned()
            && let Ok(borrowed) = array.try_readonly()
        {
            return Ok(Self::Borrowed(borrowed));
        }
        let array = array(name, value)?;
        let shape = array.shape().to_vec();
        let expected = "expected (movements, samples, coordinates or degrees of freedom)";
        let wrong = |_| PyValueError::new_err(format!("{name} has shape {shape:?}, {expected}"));
        array.into_dimensionality::<Ix3>().map(Self::Owned).map_err(wrong)
    }

    fn view(&self) -> ArrayView3<'_, f64> {
        match self {
            Self::Borrowed(array) => array.as_array(),
            Self::Owned(array) => array.view(),
        }
    }
}
