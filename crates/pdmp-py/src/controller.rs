//! Control loops.

use std::sync::Arc;

use pdmp_core::motion::Compliance;
use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Kind};
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::conditions_of;
use crate::convert::{Vector, read_only, refill};
use crate::error::raise;
use crate::instance::pair;
use crate::labelled::refill_in_order;
use crate::output::Output;
use crate::scalar::{Scalar, number, optional_number};
use crate::status::Status;

/// Buffers for vector arguments, which may be lists, strided arrays or the controller's own outputs.
#[derive(Default)]
struct Arguments {
    /// Value of a setter.
    command: Vec<f64>,
    /// Arguments of one tick.
    measured: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

/// Running movement, returned by `Model.controller`.
///
/// `step` advances by one tick and updates `position`, `velocity` and `acceleration`, read-only views that remain
/// valid. `goal`, `goal_velocity`, `style`, `tau`, `amplitude`, `anchor`, `phase`, `speed`, `tolerance`, `limits`,
/// `compliance` and `phase_gain` can be set at any tick; a value that is rejected leaves the present one in force. A controller can be
/// copied (`copy`, `deepcopy`) and pickled, and continues from its state to the bit.
#[pyclass(module = "pdmp")]
pub(crate) struct Controller {
    pub(crate) inner: pdmp_core::Controller,
    /// Source of predictions for contexts in `reset`.
    pub(crate) model: Arc<pdmp_core::Model>,
    arguments: Arguments,
    position: Output,
    velocity: Output,
    acceleration: Output,
    working: Py<PyAny>,
    finished: Py<PyAny>,
}

impl Controller {
    pub(crate) fn new(py: Python<'_>, model: Arc<pdmp_core::Model>, inner: pdmp_core::Controller) -> PyResult<Self> {
        let (length, n_dofs) = (inner.position().len(), inner.velocity().len());
        let status = py.get_type::<Status>();
        let controller = Self {
            position: Output::new(py, length)?,
            velocity: Output::new(py, n_dofs)?,
            acceleration: Output::new(py, n_dofs)?,
            working: status.getattr("WORKING")?.unbind(),
            finished: status.getattr("FINISHED")?.unbind(),
            arguments: Arguments::default(),
            inner,
            model,
        };
        controller.publish();
        Ok(controller)
    }

    fn publish(&self) {
        self.position.write(self.inner.position());
        self.velocity.write(self.inner.velocity());
        self.acceleration.write(self.inner.acceleration());
    }

    /// Publishes the outputs after a command: one before the first tick may change them.
    pub(crate) fn command(&mut self, result: pdmp_core::Result<()>) -> PyResult<()> {
        self.publish();
        result.map_err(raise)
    }
}

#[pymethods]
impl Controller {
    /// Advances the movement by one tick.
    ///
    /// A measured position and coupling terms perturb the equations::
    ///
    ///     tau y' = z + w(u) + k_t d + tau c_v
    ///     tau z' = alpha_z (beta_z (c - y) - z) + tau**2 c_a
    ///     tau u' = max(0, k + k_phi sin(phase - phi))     k = 1 / (1 + k_s |d / range|**2)
    ///     tau o' = 5 k (e - o) / extent
    ///
    /// about the frame c, which is the goal or anchor with immediate transport, with the gains (k_s, k_t) of
    /// `compliance` and the phase x = exp(-alpha_x u) or phi = u. e = m - y is the tracking error, o its estimated systematic part, and d the part of e beyond o; extent is T / tau or 2 pi. All
    /// terms are evaluated at the start of the tick and constant over it. A tick of any length pulls y no further than
    /// m. A robot that is blocked thus holds the movement and nearly stops its phase; released, it continues from
    /// there. A robot with a constant tracking error ends no further from the goal than that error, and the movement
    /// finishes. A measured phase pulls the phase of a rhythmic movement with the gain k_phi of `phase_gain`, without
    /// overshoot for a tick of any length.
    ///
    /// Parameters
    /// ----------
    /// dt : float, optional
    ///     Length of this tick in s; by default that of the controller. A tick of length zero changes nothing.
    /// measured : array_like, (D,), optional
    ///     Measured position m in the unit of each degree of freedom. Errors of angles (rad, deg, °) are wrapped to
    ///     half a turn. None means no new measurement: the last error m - y stays in force until the next one or
    ///     `release`, so that a sensor may be slower than the loop.
    /// coupling : tuple of two array_like, (D,), optional
    ///     Terms (c_v, c_a), per s and per s². c_v adds to the velocity, including its jumps; c_a to the acceleration.
    /// phase : float, optional
    ///     Measured phase in rad of a rhythmic movement, for this tick only. A sensor slower than the loop passes its
    ///     last phase plus the time since then over tau.
    ///
    /// Returns
    /// -------
    /// Status
    ///     `FINISHED` once the time of a discrete movement is over and it has settled on its goal.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The tick is negative or longer than 1000 tau, a length is wrong, a number is not finite, or a phase is passed
    ///     to a discrete movement. The state then stays as it was.
    ///
    /// Examples
    /// --------
    /// >>> controller = model.controller(dt=0.01)
    /// >>> while controller.step():
    /// ...     command = controller.position
    /// >>> np.allclose(command, controller.goal, atol=0.01)
    /// True
    ///
    /// References
    /// ----------
    /// Ijspeert, Nakanishi, Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739 (phase stopping, term in y').
    /// Schaal, Mohajerian, Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9.
    /// Pastor, Hoffmann, Asfour, Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385 (terms in z').
    /// Acebrón, Bonilla, Pérez Vicente, Ritort, Spigler, Reviews of Modern Physics 77, 137, 2005 (pull of the phase).
    #[pyo3(signature = (dt=None, *, measured=None, coupling=None, phase=None))]
    fn step(
        &mut self,
        py: Python<'_>,
        dt: Option<Scalar<'_>>,
        measured: Option<&Bound<'_, PyAny>>,
        coupling: Option<&Bound<'_, PyAny>>,
        phase: Option<Scalar<'_>>,
    ) -> PyResult<Py<PyAny>> {
        let Self { inner, arguments, .. } = self;
        let (dt, phase) = (optional_number("dt", dt)?, optional_number("phase", phase)?);
        if let Some(measured) = measured {
            refill("measured", measured, &mut arguments.measured)?;
        }
        if let Some(coupling) = coupling {
            let [velocity, acceleration] = pair("coupling", coupling, "vectors (c_v, c_a)")?;
            refill("coupling velocity", &velocity, &mut arguments.velocity)?;
            refill("coupling acceleration", &acceleration, &mut arguments.acceleration)?;
        }
        let terms = Coupling { velocity: &arguments.velocity, acceleration: &arguments.acceleration };
        let command = Command {
            dt,
            measured: measured.map(|_| arguments.measured.as_slice()),
            coupling: coupling.map(|_| terms),
            phase,
            ..Command::default()
        };
        inner.step_with(&command).map_err(raise)?;
        self.publish();
        Ok(self.status(py))
    }

    /// Restarts the movement.
    ///
    /// Speed, limits, tolerance and gains stay in force. With `start` and `velocity` of the present motion, position and
    /// velocity stay continuous, also in a pause; see `speed`.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, optional
    ///     Conditions at the start. One that is absent is that of the nominal demonstration, not an earlier command.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `Model.rollout`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Conditions that `Model.rollout` rejects. The movement then continues.
    #[pyo3(
        signature = (conditions=None, *, context=None, **changes),
        text_signature = "($self, conditions=None, *, context=None, **changes)"
    )]
    fn reset(
        &mut self,
        conditions: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let conditions = conditions_of(&self.model, conditions, context, changes)?;
        let result = self.inner.reset(&conditions);
        self.command(result)
    }

    /// Position y (D,) in the unit of each degree of freedom; a read-only view.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.position.view(py)
    }

    /// Velocity (D,) per s; a read-only view.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.velocity.view(py)
    }

    /// Acceleration (D,) per s²; a read-only view.
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.acceleration.view(py)
    }

    /// Result of the last `step`, or `WORKING` after a later command.
    #[getter]
    fn status(&self, py: Python<'_>) -> Py<PyAny> {
        match self.inner.status() {
            pdmp_core::Status::Working => self.working.clone_ref(py),
            pdmp_core::Status::Finished => self.finished.clone_ref(py),
        }
    }

    /// Length of a tick in s.
    #[getter]
    fn dt(&self) -> f64 {
        self.inner.dt()
    }

    /// Time since the start in s.
    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    /// Goal g (D,) of a discrete movement; a read-only copy. Assign all values at once.
    ///
    /// With learnt transport the movement goes to a new goal with minimum jerk, until its end, or for the shortest duration
    /// in which it is no faster than the paper's equations if less time is left. On the way to a final velocity, a goal
    /// that comes later than that is taken up past the end.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.centre(py, Kind::Discrete, "a rhythmic primitive has no goal; it has an anchor")
    }

    #[setter]
    fn set_goal(&mut self, goal: &Bound<'_, PyAny>) -> PyResult<()> {
        refill_in_order("goal", self.model.coordinate_names(), goal, &mut self.arguments.command)?;
        let result = self.inner.set_goal(&self.arguments.command);
        self.command(result)
    }

    /// Style s (J,); a read-only copy. Assign all values at once.
    #[getter]
    fn style<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, self.inner.style())
    }

    #[setter]
    fn set_style(&mut self, style: &Bound<'_, PyAny>) -> PyResult<()> {
        refill("style", style, &mut self.arguments.command)?;
        let result = self.inner.set_style(&self.arguments.command);
        self.command(result)
    }

    /// Final velocity (D,) per s with which a discrete movement passes its goal at the end, or None for that of the
    /// demonstrations; a read-only copy. Assign all values at once.
    ///
    /// It is met to rounding after any change of it or of tau before the last tenth of the movement, and of goal or style
    /// before the last third (at the default transition). Later changes do not affect the arrival.
    #[getter]
    fn goal_velocity<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.inner.goal_velocity().map(|velocity| read_only(py, velocity))
    }

    #[setter]
    fn set_goal_velocity(&mut self, velocity: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        if let Some(velocity) = velocity {
            refill_in_order("goal_velocity", self.model.names(), velocity, &mut self.arguments.command)?;
        }
        let result = self.inner.set_goal_velocity(velocity.map(|_| &*self.arguments.command));
        self.command(result)
    }

    /// Anchor y_a (D,) of a rhythmic movement; a read-only copy. Assign all values at once.
    #[getter]
    fn anchor<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.centre(py, Kind::Rhythmic, "a discrete primitive has no anchor; it has a goal")
    }

    #[setter]
    fn set_anchor(&mut self, anchor: &Bound<'_, PyAny>) -> PyResult<()> {
        refill_in_order("anchor", self.model.coordinate_names(), anchor, &mut self.arguments.command)?;
        let result = self.inner.set_anchor(&self.arguments.command);
        self.command(result)
    }

    /// Time constant τ in s.
    #[getter]
    fn tau(&self) -> f64 {
        self.inner.tau()
    }

    #[setter]
    fn set_tau(&mut self, tau: Scalar<'_>) -> PyResult<()> {
        let result = self.inner.set_tau(tau.number("tau")?);
        self.command(result)
    }

    /// Amplitude r₀ of a rhythmic movement; 1 of a discrete one.
    #[getter]
    fn amplitude(&self) -> f64 {
        self.inner.amplitude()
    }

    #[setter]
    fn set_amplitude(&mut self, amplitude: Scalar<'_>) -> PyResult<()> {
        let result = self.inner.set_amplitude(amplitude.number("amplitude")?);
        self.command(result)
    }

    /// Speed along the path relative to the rate 1 / tau: 0 pauses on the path, 1 resumes.
    ///
    /// A change passes the filter of tau and stays in force after `reset`. A movement that starts with a given `velocity`
    /// keeps it at any speed: ẏ = ρy′ with a rate ρ of at least max |ẏ|T / (k · range) at the start, up to 1 / tau, where
    /// k = 15/8 for a discrete and π for a rhythmic movement. From there ρ passes the filter to speed / tau, so that a robot
    /// in motion brakes into a pause, within the limits.
    #[getter]
    fn speed(&self) -> f64 {
        self.inner.speed()
    }

    #[setter]
    fn set_speed(&mut self, speed: Scalar<'_>) -> PyResult<()> {
        let result = self.inner.set_speed(speed.number("speed")?);
        self.command(result)
    }

    /// Tolerance within which the movement has settled on its goal, 0.005 by default, at most 1.
    ///
    /// It is relative to the larger of two lengths of each degree of freedom: its largest demonstrated range, and its
    /// distance from the goal when this was last set. It stays in force after `reset`.
    #[getter]
    fn tolerance(&self) -> f64 {
        self.inner.tolerance()
    }

    #[setter]
    fn set_tolerance(&mut self, tolerance: Scalar<'_>) -> PyResult<()> {
        let result = self.inner.set_tolerance(tolerance.number("tolerance")?);
        self.command(result)
    }

    /// Gains (k_s, k_t) of the tracking error: phase stopping, and pull per unit of u. 0 disables each.
    #[getter]
    fn compliance(&self) -> (f64, f64) {
        let Compliance { stopping, tracking } = self.inner.compliance();
        (stopping, tracking)
    }

    #[setter]
    fn set_compliance(&mut self, compliance: &Bound<'_, PyAny>) -> PyResult<()> {
        let [stopping, tracking] = pair("compliance", compliance, "gains (stopping, tracking)")?;
        let (stopping, tracking) = (number("stopping", &stopping)?, number("tracking", &tracking)?);
        self.inner.set_compliance(Compliance { stopping, tracking }).map_err(raise)
    }

    /// Discards the measured position.
    ///
    /// The movement is unperturbed until the next measurement.
    fn release(&mut self) {
        self.inner.release();
        self.publish();
    }

    fn __repr__(&self) -> String {
        let model = &self.model;
        format!("<pdmp.Controller: {}, {} DoFs, t = {:.4} s>", model.kind(), model.n_dofs(), self.inner.time())
    }
}

impl Controller {
    fn centre<'py>(&self, py: Python<'py>, kind: Kind, other: &'static str) -> PyResult<Vector<'py>> {
        if self.model.kind() != kind {
            return Err(PyAttributeError::new_err(other));
        }
        Ok(read_only(py, self.inner.centre()))
    }
}
