//! Movements of a model: rollouts, controllers and Jacobians.

use std::sync::Arc;

use numpy::IntoPyArray;
use pdmp_core::model::Derivative;
use pdmp_core::motion::{TimeGrid, fastest, fastest_tau, jacobian, rollout_with};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::choice::Choice;
use crate::conditions::conditions_of;
use crate::controller::Controller;
use crate::convert::Cube;
use crate::error::{interruptible, raise, warn};
use crate::gradients::VARIABLES;
use crate::instance;
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};
use crate::trajectory::Trajectory;

/// Warns about a tick that is longer than the whole movement, or than a period.
///
/// It is no error: the first tick of a loop of events may be long, and a tick of any length is exact.
pub(crate) fn warn_of_long_tick(py: Python<'_>, controller: &pdmp_core::Controller) -> PyResult<()> {
    let (dt, primitive) = (controller.dt(), controller.primitive());
    let duration = primitive.duration() * controller.tau() / primitive.tau();
    if dt <= duration {
        return Ok(());
    }
    let hint = if dt >= 1.0 { format!("; for a loop of {dt} Hz pass dt={}", 1.0 / dt) } else { String::new() };
    let text =
        format!("dt = {dt} s is longer than the movement of {duration:.4} s: a tick performs all of it at once{hint}");
    warn(py, &text)
}

#[pymethods]
impl Model {
    /// Computes the movement under constant conditions.
    ///
    /// Integrates τż = α_z(β_z(c − y) − z), τẏ = z + w about the frame c exactly, with the forcing term w = x·sᵀb
    /// (discrete) or w = r·sᵀb (rhythmic). Conditions that are absent are those of the nominal demonstration.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, optional
    ///     Conditions at the start.
    /// dt : float
    ///     Interval between samples in s.
    /// duration : float, optional
    ///     Length in s. By default the demonstrated duration scaled by `tau`, the sum of `segment_durations`, or one
    ///     period of a rhythmic movement.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions: style, goal, start or anchor, and duration.
    /// **changes
    ///     Single conditions by name, which replace those of `conditions`; see `Conditions`. A mapping or a row of a data
    ///     frame whose elements have the names of the degrees of freedom may have them in any order.
    ///
    /// Returns
    /// -------
    /// Trajectory
    ///     n + 1 samples, where n is duration / dt rounded down.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A length is wrong, a number is not finite, or a condition belongs to the other kind of primitive.
    /// TypeError
    ///     A keyword is unknown, or `conditions` has another type.
    ///
    /// Warns
    /// -----
    /// UserWarning
    ///     The context lies outside the demonstrated ones by more than a tenth of their range, or `dt` is longer than the
    ///     movement.
    ///
    /// Examples
    /// --------
    /// >>> trajectory = model.rollout(goal=[1.1, 0.0], tau=2.0, dt=0.001)
    /// >>> trajectory.position.shape
    /// (2001, 2)
    /// >>> np.allclose(trajectory.position[-1], [1.1, 0.0], atol=1e-3)
    /// True
    #[pyo3(
        signature = (conditions=None, *, dt=Scalar::Number(0.01), duration=None, context=None, **changes),
        text_signature = "($self, conditions=None, *, dt=0.01, duration=None, context=None, **changes)"
    )]
    fn rollout(
        &self,
        py: Python<'_>,
        conditions: Option<&Bound<'_, PyAny>>,
        dt: Scalar<'_>,
        duration: Option<Scalar<'_>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Trajectory> {
        let grid = TimeGrid { dt: dt.number("dt")?, duration: optional_number("duration", duration)? };
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let trajectory = interruptible(py, |progress| rollout_with(self.0.primitive(), &conditions, grid, progress))?;
        if trajectory.time.len() == 1 && grid.duration != Some(0.0) {
            let TimeGrid { dt, duration } = grid;
            let length = duration.unwrap_or(
                self.0.duration() * conditions.time_constant(self.0.primitive()).map_err(raise)? / self.0.tau(),
            );
            warn(
                py,
                &format!("dt = {dt} s is longer than the movement of {length:.4} s: the only sample is the start"),
            )?;
        }
        Trajectory::new(py, trajectory, self.0.primitive())
    }

    /// Starts a movement that is computed tick by tick in a control loop.
    ///
    /// Parameters
    /// ----------
    /// dt : float
    ///     Length of a tick in s.
    /// conditions : Conditions, optional
    ///     Conditions at the start. The controller takes the sum of segment durations; see `tau_at` to follow them.
    /// limits : Limits, optional
    ///     Limits that every tick keeps, see `Controller.limits`.
    /// transition : float, optional
    ///     Time in s to 99 % of a change of style, anchor, amplitude, tau or speed, at the model's tau; 0 switches
    ///     immediately, as in the paper. By default a tenth of the nominal duration (discrete) or a quarter of the period
    ///     (rhythmic). It filters a new goal with immediate transport; with learnt transport a goal takes the time that
    ///     `Controller.goal` states, which grows with `transition`.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// Controller
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `dt` or `transition` is out of range, `rollout` rejects the conditions, or limits have a wrong length.
    /// TypeError
    ///     A keyword is unknown, or `conditions` or `limits` has another type.
    ///
    /// Warns
    /// -----
    /// UserWarning
    ///     The context lies outside the demonstrated ones by more than a tenth of their range, or `dt` is longer than the
    ///     movement.
    ///
    /// Examples
    /// --------
    /// >>> controller = model.controller(dt=0.01, goal=[1.0, 0.1])
    /// >>> controller.step()
    /// Status.WORKING
    /// >>> controller.goal = [1.1, 0.0]
    /// >>> while controller.step():
    /// ...     pass
    /// >>> np.allclose(controller.position, [1.1, 0.0], atol=0.01)
    /// True
    #[pyo3(
        signature = (dt=Scalar::Number(0.001), conditions=None, *, limits=None, transition=None, context=None, **changes),
        text_signature = "($self, dt=0.001, conditions=None, *, limits=None, transition=None, context=None, **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn controller(
        &self,
        py: Python<'_>,
        dt: Scalar<'_>,
        conditions: Option<&Bound<'_, PyAny>>,
        limits: Option<&Bound<'_, PyAny>>,
        transition: Option<Scalar<'_>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Controller> {
        let (dt, transition) = (dt.number("dt")?, optional_number("transition", transition)?);
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let mut controller =
            pdmp_core::Controller::new(self.0.primitive(), dt, &conditions, transition).map_err(raise)?;
        warn_of_long_tick(py, &controller)?;
        if let Some(limits) = limits {
            controller.set_limits(instance::limits(limits)?).map_err(raise)?;
        }
        Controller::new(py, Arc::clone(&self.0), controller)
    }

    /// Computes the smallest constant tau with which a discrete movement keeps limits of velocity and acceleration.
    ///
    /// The path y(u) over the clock u = t / tau does not depend on tau. With ẏ = y′ / tau and ÿ = y″ / tau², the smallest
    /// tau is max(max |y′| / V, √(max |y″| / A)) over degrees of freedom and time, until the movement rests past its end. Of a
    /// rotation, the sizes of angular velocity and acceleration count.
    ///
    /// Parameters
    /// ----------
    /// limits : Limits
    ///     Limits V of the velocity and A of the acceleration, at least one of them; those of the position do not count.
    /// conditions : Conditions, optional
    ///     Conditions at the start. Velocities among them are those at their tau, and scale with the result.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// float
    ///     tau in s.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `rollout` rejects the conditions, the model is rhythmic, a limit has a wrong length, or there is neither a
    ///     limit of the velocity nor of the acceleration.
    /// TypeError
    ///     A keyword is unknown, or `conditions` or `limits` has another type.
    ///
    /// Examples
    /// --------
    /// >>> tau = model.fastest_tau(pdmp.Limits(velocity=0.5))
    /// >>> bool(np.isclose(abs(model.rollout(tau=tau, dt=0.001).velocity).max(), 0.5, rtol=1e-3))
    /// True
    #[pyo3(
        signature = (limits, conditions=None, *, context=None, **changes),
        text_signature = "($self, limits, conditions=None, *, context=None, **changes)"
    )]
    fn fastest_tau(
        &self,
        py: Python<'_>,
        limits: &Bound<'_, PyAny>,
        conditions: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<f64> {
        let (limits, conditions) = (instance::limits(limits)?, conditions_of(&self.0, conditions, context, changes)?);
        py.detach(|| fastest_tau(self.0.primitive(), limits, &conditions)).map_err(raise)
    }

    /// Computes the discrete movement that follows its path as fast as limits allow.
    ///
    /// The path y(u) over the clock u does not depend on the rate ρ = du/dt, so that ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′. The
    /// rate is the largest with |ẏ| ≤ V and |ÿ| ≤ A for every degree of freedom, found by a pass from the end to the
    /// start and one back. The movement starts and ends at rest; with `velocity` or `goal_velocity` among the
    /// conditions, it starts or ends with that.
    ///
    /// Limits hold at the ends and in the middle of each thousandth of the path. In between, recordings exceed them by up to
    /// 0.5 %, paths with corners by 2 %; a controller with the limits keeps them at every tick. Where the axis of a rotation turns, up to
    /// 1.9 % of the limit of its angular acceleration remain unused.
    ///
    /// Parameters
    /// ----------
    /// limits : Limits
    ///     Limits V of the velocity and A of the acceleration, at least one of them, and of the position, which the path
    ///     has to keep.
    /// conditions : Conditions, optional
    ///     Conditions at the start. Their tau matters for velocities among them only.
    /// dt : float
    ///     Interval between samples in s.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// Trajectory
    ///     Samples from the start to the end of the movement.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `rollout` rejects the conditions, the model is rhythmic, a limit has a wrong length, there is neither a limit
    ///     of the velocity nor of the acceleration, the path leaves the limits of the position, or the start is too fast
    ///     for the limits.
    /// TypeError
    ///     A keyword is unknown, or `conditions` or `limits` has another type.
    ///
    /// Examples
    /// --------
    /// >>> limits = pdmp.Limits(velocity=1.5, acceleration=8.0)
    /// >>> fastest = model.fastest(limits, dt=0.001)
    /// >>> bool(fastest.time[-1] < model.fastest_tau(limits))
    /// True
    ///
    /// References
    /// ----------
    /// Pham, Pham, IEEE Transactions on Robotics 34(3), 2018, doi:10.1109/TRO.2018.2819195.
    #[pyo3(
        signature = (limits, conditions=None, *, dt=Scalar::Number(0.01), context=None, **changes),
        text_signature = "($self, limits, conditions=None, *, dt=0.01, context=None, **changes)"
    )]
    fn fastest(
        &self,
        py: Python<'_>,
        limits: &Bound<'_, PyAny>,
        conditions: Option<&Bound<'_, PyAny>>,
        dt: Scalar<'_>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Trajectory> {
        let (limits, dt) = (instance::limits(limits)?, dt.number("dt")?);
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let trajectory = py.detach(|| fastest(self.0.primitive(), limits, &conditions, dt)).map_err(raise)?;
        Trajectory::new(py, trajectory, self.0.primitive())
    }

    /// Computes the Jacobian ∂y/∂v of a rollout with respect to one of its conditions v.
    ///
    /// A movement is linear in all conditions but tau: y(v + Δv) = y(v) + (∂y/∂v)Δv exactly, with the same Jacobian for
    /// all values of v. It depends on tau, and on the presence of `start`, `velocity` and `goal_velocity`; that by the
    /// style also on the amplitude, and that by the amplitude on the style. With respect to tau it is the derivative at
    /// fixed times, with velocities among the conditions constant. `rollouts_vjp` gives gradients without a Jacobian.
    ///
    /// The derivative of accelerations with respect to tau contains the third derivative of y, which jumps where the clock
    /// passes a knot of the forcing table or of the transport profile: at such a sample, its mean is used. At the end of a
    /// movement that does not end at rest the accelerations jump, and the sample there has no derivative.
    ///
    /// Parameters
    /// ----------
    /// wrt : {"style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude", "tau"}
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
    /// ndarray, (T, D, J), (T, D, 1) or (T, D, D)
    ///     ∂y/∂v in the unit of y per unit of v, at the samples of `rollout`; (T, D, J) for the style, (T, D, 1) for
    ///     amplitude and tau.
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
        signature = (
            wrt, conditions=None, *, derivative=Scalar::Count(0), dt=Scalar::Number(0.01), duration=None, context=None,
            **changes
        ),
        text_signature = "($self, wrt, conditions=None, *, derivative=0, dt=0.01, duration=None, context=None, \
                          **changes)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        wrt: Choice<'py>,
        conditions: Option<&Bound<'py, PyAny>>,
        derivative: Scalar<'py>,
        dt: Scalar<'py>,
        duration: Option<Scalar<'py>>,
        context: Option<&Bound<'py, PyAny>>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Cube<'py>> {
        let wrt = wrt.of("wrt", &VARIABLES)?;
        let derivative = Derivative::of_order("derivative", derivative.count("derivative")?).map_err(raise)?;
        let grid = TimeGrid { dt: dt.number("dt")?, duration: optional_number("duration", duration)? };
        let conditions = conditions_of(&self.0, conditions, context, changes)?;
        let jacobian =
            interruptible(py, |progress| jacobian(self.0.primitive(), wrt, derivative, &conditions, grid, progress))?;
        Ok(jacobian.into_pyarray(py))
    }
}
