//! Control loops of many movements.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pdmp_core::Status;
use pdmp_core::motion::{Commands, Motions};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::controller::Controller;
use crate::controllers_arguments::{Buffers, conditions_of_each, mask, movements};
use crate::convert::{Matrix, Vector, quoted, to_numpy};
use crate::error::raise;

/// Running movements of one model, returned by `Model.controllers`.
///
/// `step` advances B movements by one tick and writes `position`, `velocity` and `acceleration`, which are arrays of numpy
/// that remain the same. Each movement is that of a `Controller` of its own, to the bit: `controllers[b]` is a copy of it,
/// and `controllers[b] = controller` puts one in its place.
#[pyclass(module = "pdmp")]
pub(crate) struct Controllers {
    inner: pdmp_core::motion::Controllers,
    model: Arc<pdmp_core::Model>,
    position: Py<PyArray2<f64>>,
    velocity: Py<PyArray2<f64>>,
    acceleration: Py<PyArray2<f64>>,
    working: Py<PyArray1<bool>>,
    buffers: Buffers,
}

#[pymethods]
impl Controllers {
    /// Advances movements by one tick.
    ///
    /// Commands are those of a `Controller`: an absent one leaves its quantity unchanged, a repeated one has no effect. Each
    /// has one row for each movement, or is one vector or number for all. Movements that `mask` leaves out neither move nor
    /// take commands, and their rows of the outputs keep their values.
    ///
    /// Parameters
    /// ----------
    /// style : array_like, (B, J) or (J,), optional
    ///     New styles.
    /// goal, anchor : array_like, (B, D) or (D,), optional
    ///     New goals of discrete, anchors of rhythmic movements.
    /// goal_velocity : array_like, (B, D) or (D,), optional
    ///     New final velocities of discrete movements, per s.
    /// tau : array_like, (B,), or float, optional
    ///     New time constants in s.
    /// amplitude : array_like, (B,), or float, optional
    ///     New amplitudes of rhythmic movements.
    /// speed : array_like, (B,), or float, optional
    ///     New speeds along the path, see `Controller.speed`.
    /// measured : array_like, (B, D), optional
    ///     Measured positions, see `Controller.step`.
    /// phase : array_like, (B,), optional
    ///     Measured phases of rhythmic movements in rad, see `Controller.step`.
    /// mask : array_like of bool, (B,), optional
    ///     True for the movements of this tick; by default all.
    ///
    /// Returns
    /// -------
    /// ndarray of bool, (B,)
    ///     `working`: False for movements that have settled on their goals.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A shape is wrong, a number is not finite, or `Controller` rejects a command. No movement is changed then.
    ///
    /// Examples
    /// --------
    /// >>> controllers = model.controllers(4, dt=0.01)
    /// >>> _ = controllers.step(goal=model.goals[:4], tau=[0.8, 1.0, 1.2, 1.4])
    /// >>> _ = controllers.step(mask=[True, True, False, True])
    /// >>> controllers.time.round(2)
    /// array([0.02, 0.02, 0.01, 0.02])
    #[pyo3(signature = (
        *, style=None, goal=None, goal_velocity=None, anchor=None, tau=None, amplitude=None, speed=None, measured=None,
        phase=None, mask=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        style: Option<&Bound<'py, PyAny>>,
        goal: Option<&Bound<'py, PyAny>>,
        goal_velocity: Option<&Bound<'py, PyAny>>,
        anchor: Option<&Bound<'py, PyAny>>,
        tau: Option<&Bound<'py, PyAny>>,
        amplitude: Option<&Bound<'py, PyAny>>,
        speed: Option<&Bound<'py, PyAny>>,
        measured: Option<&Bound<'py, PyAny>>,
        phase: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let n = self.inner.len();
        let mask = mask.map(|value| self::mask(value, n)).transpose()?;
        let (model, buffers) = (&self.model, &mut self.buffers);
        let (n_dofs, n_coordinates) = (model.n_dofs(), model.n_coordinates());
        for (slot, name, value, columns) in [
            (0, "style", style, model.n_styles()),
            (1, "goal", goal, n_coordinates),
            (2, "goal_velocity", goal_velocity, n_dofs),
            (3, "anchor", anchor, n_coordinates),
            (4, "measured", measured, n_coordinates),
        ] {
            buffers.read_rows(slot, name, value, [n, columns])?;
        }
        for (slot, name, value) in
            [(0, "tau", tau), (1, "amplitude", amplitude), (2, "phase", phase), (3, "speed", speed)]
        {
            buffers.read_numbers(slot, name, value, n)?;
        }
        let commands = [style, goal, goal_velocity, anchor, measured, tau, amplitude, phase, speed];
        let has_commands = commands.iter().any(Option::is_some);
        let [mut position, mut velocity, mut acceleration] =
            [&self.position, &self.velocity, &self.acceleration].map(|array| array.bind(py).try_readwrite());
        let mut slices = [&mut position, &mut velocity, &mut acceleration]
            .map(|array| array.as_mut().ok().and_then(|array| array.as_slice_mut().ok()));
        let [Some(position), Some(velocity), Some(acceleration)] = &mut slices else {
            return Err(PyValueError::new_err("out: arrays in use by another call, or no longer writable"));
        };
        let mut motions = Motions { position, velocity, acceleration };
        let buffers = &self.buffers;
        let commands = Commands {
            style: buffers.rows(0),
            goal: buffers.rows(1),
            goal_velocity: buffers.rows(2),
            anchor: buffers.rows(3),
            measured: buffers.rows(4),
            tau: buffers.numbers(0),
            amplitude: buffers.numbers(1),
            phase: buffers.numbers(2),
            speed: buffers.numbers(3),
        };
        if has_commands {
            let updated = self.inner.update(&commands, mask.as_deref(), &mut motions);
            updated.map_err(|error| match self.inner.first_rejected(&commands, mask.as_deref()) {
                Some(b) => PyValueError::new_err(format!("movement {b}: {}", raise(error).value(py))),
                None => raise(error),
            })?;
        } else {
            self.inner.step(mask.as_deref(), &mut motions).map_err(raise)?;
        }
        self.publish_statuses(py)
    }

    /// Restarts movements.
    ///
    /// Parameters
    /// ----------
    /// movements : array_like of int or bool, optional
    ///     Indices of the N movements to restart, or a mask (B,); by default all.
    /// conditions : Conditions, or N Conditions, optional
    ///     Conditions of these movements at the start, or of each, as in `Controller.reset`.
    /// context : array_like or list, (Q,) or (N, Q), optional
    ///     Context of these movements, or of each, whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name; each may have a leading axis, with one row for each of these movements.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A movement that does not exist, or conditions that `Model.controllers` rejects. No movement is changed then.
    ///
    /// Examples
    /// --------
    /// >>> controllers = model.controllers(4, dt=0.01)
    /// >>> for _ in range(1000):
    /// ...     working = controllers.step(mask=controllers.working)
    /// >>> controllers.reset(~working, goal=[1.1, 0.0])
    /// >>> bool(controllers.working.all())
    /// True
    #[pyo3(
        signature = (movements=None, conditions=None, *, context=None, **changes),
        text_signature = "($self, movements=None, conditions=None, *, context=None, **changes)"
    )]
    fn reset(
        &mut self,
        py: Python<'_>,
        movements: Option<&Bound<'_, PyAny>>,
        conditions: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let movements = self::movements(movements, self.inner.len())?;
        if movements.is_empty() {
            return Ok(());
        }
        let conditions = conditions_of_each(py, &self.model, movements.len(), conditions, context, changes)?;
        self.inner.reset(&movements, &conditions).map_err(raise)?;
        self.publish(py, &movements)
    }

    /// Discards measured positions.
    ///
    /// Parameters
    /// ----------
    /// movements : array_like of int or bool, optional
    ///     Indices of movements, or a mask (B,); by default all.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A movement that does not exist.
    #[pyo3(signature = (movements=None))]
    fn release(&mut self, py: Python<'_>, movements: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let movements = self::movements(movements, self.inner.len())?;
        movements.iter().try_for_each(|&b| self.inner.release(b)).map_err(raise)?;
        self.publish(py, &movements)
    }

    /// Positions y (B, D), or (B, nq) in coordinates; the array that every tick writes.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.position.bind(py).clone()
    }

    /// Velocities (B, D) per s; the array that every tick writes.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.velocity.bind(py).clone()
    }

    /// Accelerations (B, D) per s²; the array that every tick writes.
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.acceleration.bind(py).clone()
    }

    /// False for movements that have settled on their goals (B,); the array that every tick writes.
    #[getter]
    fn working<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.working.bind(py).clone()
    }

    /// Times (B,) since the start in s.
    #[getter]
    fn time<'py>(&mut self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.numbers(py, pdmp_core::Controller::time)
    }

    /// Phases (B,): x in (0, 1] of discrete movements, φ in [0, 2π) rad of rhythmic ones.
    #[getter]
    fn phase<'py>(&mut self, py: Python<'py>) -> PyResult<Vector<'py>> {
        self.numbers(py, pdmp_core::Controller::phase)
    }

    /// Length of a tick in s.
    #[getter]
    fn dt(&self) -> f64 {
        self.inner.dt()
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __getitem__(&mut self, py: Python<'_>, movement: isize) -> PyResult<Controller> {
        let b = self.index(movement)?;
        let controller = self.inner.get(b).map_err(raise)?.clone();
        Controller::new(py, Arc::clone(&self.model), controller)
    }

    fn __setitem__(&mut self, py: Python<'_>, movement: isize, controller: &Bound<'_, PyAny>) -> PyResult<()> {
        let b = self.index(movement)?;
        let expected =
            |_| PyTypeError::new_err(format!("controller = {}: expected pdmp.Controller", quoted(controller)));
        let controller = controller.cast::<Controller>().map_err(expected)?;
        self.inner.replace(b, &controller.try_borrow()?.inner).map_err(raise)?;
        self.publish(py, &[b])
    }

    fn __repr__(&self) -> String {
        let (model, n) = (&self.model, self.inner.len());
        format!("<pdmp.Controllers: {n} movements, {}, {} DoFs>", model.kind(), model.n_dofs())
    }
}

impl Controllers {
    pub(crate) fn new(
        py: Python<'_>,
        model: Arc<pdmp_core::Model>,
        inner: pdmp_core::motion::Controllers,
        outputs: [Matrix<'_>; 3],
    ) -> PyResult<Self> {
        let (n, [position, velocity, acceleration]) = (inner.len(), outputs.map(Bound::unbind));
        let working = PyArray1::from_vec(py, vec![true; n]).unbind();
        let mut controllers =
            Self { inner, model, position, velocity, acceleration, working, buffers: Buffers::default() };
        controllers.publish(py, &(0..n).collect::<Vec<_>>())?;
        Ok(controllers)
    }

    fn index(&self, movement: isize) -> PyResult<usize> {
        let n = self.inner.len();
        let b = if movement < 0 { movement + n as isize } else { movement };
        let beyond = || PyIndexError::new_err(format!("movement = {movement}: there are {n}"));
        usize::try_from(b).ok().filter(|b| *b < n).ok_or_else(beyond)
    }

    fn numbers<'py>(&mut self, py: Python<'py>, of: fn(&pdmp_core::Controller) -> f64) -> PyResult<Vector<'py>> {
        let numbers = (0..self.inner.len()).map(|b| self.inner.get(b).map(of));
        Ok(to_numpy(py, &numbers.collect::<pdmp_core::Result<Vec<_>>>().map_err(raise)?))
    }

    /// Writes the motion of some movements and the statuses of all.
    fn publish(&mut self, py: Python<'_>, movements: &[usize]) -> PyResult<()> {
        let in_use = |_| PyValueError::new_err("out: arrays in use by another call, or no longer writable");
        for &b in movements {
            let controller = self.inner.get(b).map_err(raise)?;
            for (array, values) in [
                (&self.position, controller.position()),
                (&self.velocity, controller.velocity()),
                (&self.acceleration, controller.acceleration()),
            ] {
                let mut array = array.bind(py).try_readwrite().map_err(in_use)?;
                array.as_array_mut().row_mut(b).iter_mut().zip(values).for_each(|(to, from)| *to = *from);
            }
        }
        self.publish_statuses(py).map(drop)
    }

    fn publish_statuses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let working = self.working.bind(py);
        let mut array = working.try_readwrite();
        let Some(slice) = array.as_mut().ok().and_then(|array| array.as_slice_mut().ok()) else {
            return Err(PyValueError::new_err("working: the array is in use, or no longer writable"));
        };
        if self.inner.n_steady() == self.inner.len() {
            // A steady movement is working.
            slice.fill(true);
        } else {
            let statuses = slice.iter_mut().zip(self.inner.statuses());
            statuses.for_each(|(working, status)| *working = *status == Status::Working);
        }
        Ok(working.clone())
    }
}
