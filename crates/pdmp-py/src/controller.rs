//! The real-time loop in Python.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use ndarray::ArrayView1;
use numpy::PyArray1;
use numpy::npyffi::{_PyArray_GET_ITEM_DATA, NPY_ARRAY_WRITEABLE};
use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Kind};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::conditions_of;
use crate::convert::{Reduced, Vector, read_only, refill};
use crate::error::raise;

/// Whether a movement goes on (`WORKING`, 1) or has settled on its goal (`FINISHED`, 2, and false).
#[pyclass(frozen, eq, hash, module = "pdmp")]
#[derive(PartialEq, Eq, Hash)]
pub(crate) enum Status {
    #[pyo3(name = "WORKING")]
    Working = 1,
    #[pyo3(name = "FINISHED")]
    Finished = 2,
}

#[pymethods]
impl Status {
    /// A loop runs `while controller.step()`.
    fn __bool__(&self) -> bool {
        *self == Self::Working
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let name = match self {
            Self::Working => "WORKING",
            Self::Finished => "FINISHED",
        };
        Ok((py.import("builtins")?.getattr("getattr")?, (py.get_type::<Self>(), name).into_pyobject(py)?))
    }
}

/// The bits of numbers that the loop writes while arrays over them are read.
#[pyclass(frozen, module = "pdmp._native")]
struct Memory(Box<[AtomicU64]>);

/// A vector that the loop writes and the user reads without a copy: each access gives a read-only array of its own, so
/// that who reshapes it changes it for nobody else, over memory that numpy does not own, so that it can neither be made
/// writable nor resized.
struct Output(Py<Memory>);

impl Output {
    fn new(py: Python<'_>, length: usize) -> PyResult<Self> {
        Py::new(py, Memory((0..length).map(|_| AtomicU64::new(0)).collect())).map(Self)
    }

    fn write(&self, values: &[f64]) {
        for (place, value) in self.0.get().0.iter().zip(values) {
            place.store(value.to_bits(), Relaxed);
        }
    }

    #[allow(unsafe_code)]
    fn view<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let memory = &self.0.get().0;
        // SAFETY: the memory has this length, is never moved, and lives as long as the array, whose base it is. Atomic
        // integers have the layout of doubles. The array is new, so that nobody has written through it.
        unsafe {
            let numbers = ArrayView1::from_shape_ptr(memory.len(), memory.as_ptr().cast::<f64>());
            let array = PyArray1::borrow_from_array(&numbers, self.0.bind(py).clone().into_any());
            (*_PyArray_GET_ITEM_DATA(array.as_ptr().cast())).flags &= !NPY_ARRAY_WRITEABLE;
            array
        }
    }
}

/// Vectors given, copied: they may be lists, strided, or the controller's own outputs.
#[derive(Default)]
struct Given {
    /// By a setter.
    command: Vec<f64>,
    /// For one tick.
    measured: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

/// A running primitive, made by `Model.controller`.
///
/// `step` moves on by one tick and writes into `position`, `velocity` and `acceleration`, which are read-only views
/// that stay valid. `goal`, `style`, `tau`, `amplitude`, `anchor` and `compliance` can be set at any tick; values that
/// are refused leave the last good ones in force.
#[pyclass(module = "pdmp")]
pub(crate) struct Controller {
    inner: pdmp_core::Controller,
    /// Predicts conditions from contexts.
    model: Arc<pdmp_core::Model>,
    given: Given,
    position: Output,
    velocity: Output,
    acceleration: Output,
    working: Py<PyAny>,
    finished: Py<PyAny>,
}

impl Controller {
    pub(crate) fn new(py: Python<'_>, model: Arc<pdmp_core::Model>, inner: pdmp_core::Controller) -> PyResult<Self> {
        let length = inner.position().len();
        let status = py.get_type::<Status>();
        let controller = Self {
            position: Output::new(py, length)?,
            velocity: Output::new(py, length)?,
            acceleration: Output::new(py, length)?,
            working: status.getattr("WORKING")?.unbind(),
            finished: status.getattr("FINISHED")?.unbind(),
            given: Given::default(),
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

    /// A command may hold from the start, and then changes what is shown.
    fn command(&mut self, result: pdmp_core::Result<()>) -> PyResult<()> {
        self.publish();
        result.map_err(raise)
    }
}

#[pymethods]
impl Controller {
    /// One tick, perturbed if the robot is measured or terms of one's own are given:
    ///
    ///     tau y' = z + w(u) + k_t d + tau c_v
    ///     tau z' = alpha_z (beta_z (g - y) - z) + tau**2 c_a
    ///     tau u' = k = 1 / (1 + k_s |d / range|**2)
    ///     tau o' = 5 k (e - o) / extent
    ///
    /// with the gains (k_s, k_t) of `compliance` and the phase x = exp(-alpha_x u) or phi = u. Of the error e = m - y
    /// counts d, what lies beyond the error o that is expected by now; extent is T / tau or 2 pi. All is evaluated at
    /// the start of the tick and held over it; however long it is, y is pulled no further than m. A robot that is held
    /// fast so holds the movement, all but stops its phase, and, let go, continues from there; one that always lags or
    /// sags by the same comes no further from the goal than that, and finishes.
    ///
    /// Parameters
    /// ----------
    /// dt : float, optional
    ///     Length of this tick in s, if it differs from the controller's. A tick of length zero changes nothing.
    /// measured : array_like (D,), optional
    ///     Position m at which the robot is, in the unit of each DoF; the error of an angle (rad, deg, °) is taken the
    ///     short way round. None is no new measurement: the last distance m - y stays in force until the next one or
    ///     `release`, so that a sensor may be slower than the loop.
    /// coupling : tuple of two array_like (D,), optional
    ///     Terms (c_v, c_a), per s and per s²: the velocity gains c_v, and jumps where it does; the acceleration c_a.
    ///
    /// Returns
    /// -------
    /// Status
    ///     `FINISHED` once a discrete movement's time is over and it has settled on its goal.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A tick that is negative or longer than 1000 tau, a wrong length, or a number that is not finite; the
    ///     state then stays as it was.
    ///
    /// References
    /// ----------
    /// Ijspeert, Nakanishi, Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739 (phase stopping, term in y').
    /// Schaal, Mohajerian, Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9.
    /// Pastor, Hoffmann, Asfour, Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385 (terms in z').
    #[pyo3(signature = (dt=None, *, measured=None, coupling=None))]
    fn step(
        &mut self,
        py: Python<'_>,
        dt: Option<f64>,
        measured: Option<&Bound<'_, PyAny>>,
        coupling: Option<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    ) -> PyResult<Py<PyAny>> {
        let Self { inner, given, .. } = self;
        if let Some(measured) = measured {
            refill("measured", measured, &mut given.measured)?;
        }
        if let Some((velocity, acceleration)) = &coupling {
            refill("coupling velocity", velocity, &mut given.velocity)?;
            refill("coupling acceleration", acceleration, &mut given.acceleration)?;
        }
        let terms = Coupling { velocity: &given.velocity, acceleration: &given.acceleration };
        let command = Command {
            dt,
            measured: measured.map(|_| given.measured.as_slice()),
            coupling: coupling.map(|_| terms),
            ..Command::default()
        };
        inner.step_with(&command).map_err(raise)?;
        self.publish();
        Ok(self.status(py))
    }

    /// Start again.
    ///
    /// Parameters
    /// ----------
    /// conditions : Conditions, optional
    ///     Conditions at the start. One that is not given is that of the nominal demonstration, not a command of before.
    /// context, **changes
    ///     As in `Model.rollout`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Conditions that `Model.rollout` rejects; the movement then continues.
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

    /// Position y (D,): a read-only view.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.position.view(py)
    }

    /// Velocity (D,) per s: a read-only view.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.velocity.view(py)
    }

    /// Acceleration (D,) per s²: a read-only view.
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.acceleration.view(py)
    }

    /// Phase: x in (0, 1] where discrete, φ in [0, 2π) where rhythmic.
    #[getter]
    fn phase(&self) -> f64 {
        self.inner.phase()
    }

    /// Whether the movement goes on: what the last `step` returned, or `WORKING` if something was commanded since.
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

    /// Goal g (D,), discrete: a read-only copy, to be set as a whole.
    #[getter]
    fn goal<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.centre(py, Kind::Discrete, "a rhythmic primitive has no goal; it has an anchor")
    }

    #[setter]
    fn set_goal(&mut self, goal: &Bound<'_, PyAny>) -> PyResult<()> {
        refill("goal", goal, &mut self.given.command)?;
        let result = self.inner.set_goal(&self.given.command);
        self.command(result)
    }

    /// Style s (J,): a read-only copy, to be set as a whole.
    #[getter]
    fn style<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        read_only(py, self.inner.style())
    }

    #[setter]
    fn set_style(&mut self, style: &Bound<'_, PyAny>) -> PyResult<()> {
        refill("style", style, &mut self.given.command)?;
        let result = self.inner.set_style(&self.given.command);
        self.command(result)
    }

    /// Anchor y_a (D,), rhythmic: a read-only copy, to be set as a whole.
    #[getter]
    fn anchor<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.centre(py, Kind::Rhythmic, "a discrete primitive has no anchor; it has a goal")
    }

    #[setter]
    fn set_anchor(&mut self, anchor: &Bound<'_, PyAny>) -> PyResult<()> {
        refill("anchor", anchor, &mut self.given.command)?;
        let result = self.inner.set_anchor(&self.given.command);
        self.command(result)
    }

    /// Time constant in s.
    #[getter]
    fn tau(&self) -> f64 {
        self.inner.tau()
    }

    #[setter]
    fn set_tau(&mut self, tau: f64) -> PyResult<()> {
        let result = self.inner.set_tau(tau);
        self.command(result)
    }

    /// Amplitude r₀, rhythmic; 1 where discrete.
    #[getter]
    fn amplitude(&self) -> f64 {
        self.inner.amplitude()
    }

    #[setter]
    fn set_amplitude(&mut self, amplitude: f64) -> PyResult<()> {
        let result = self.inner.set_amplitude(amplitude);
        self.command(result)
    }

    /// Speed: the share of the rate 1 / tau at which the path is followed. 0 pauses on the path, 1 goes on; a change
    /// passes the filter of tau, and stays in force over `reset`.
    #[getter]
    fn speed(&self) -> f64 {
        self.inner.speed()
    }

    #[setter]
    fn set_speed(&mut self, speed: f64) -> PyResult<()> {
        let result = self.inner.set_speed(speed);
        self.command(result)
    }

    /// Gains (k_s, k_t) of a measured position: how much it stops the phase, and pulls per unit of u. 0 is without.
    #[getter]
    fn compliance(&self) -> (f64, f64) {
        self.inner.compliance()
    }

    #[setter]
    fn set_compliance(&mut self, compliance: (f64, f64)) -> PyResult<()> {
        let (stopping, tracking) = compliance;
        self.inner.set_compliance(stopping, tracking).map_err(raise)
    }

    /// A controller of its own that goes on bit for bit as this one would; the model is shared.
    fn __copy__(&self, py: Python<'_>) -> PyResult<Self> {
        Self::new(py, Arc::clone(&self.model), self.inner.clone())
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.__copy__(py)
    }

    /// Forget the measured position: no robot follows any more, until the next one is measured.
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
            return Err(PyValueError::new_err(other));
        }
        read_only(py, self.inner.centre())
    }
}
