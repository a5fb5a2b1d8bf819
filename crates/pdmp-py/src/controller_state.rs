//! Phase, forecasts, copies and pickles of a control loop.

use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::controller::Controller;
use crate::convert::Reduced;
use crate::error::{interruptible, raise};
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};
use crate::trajectory::Trajectory;

#[pymethods]
impl Controller {
    /// Phase: x in (0, 1] of a discrete movement, φ in [0, 2π) rad of a rhythmic one.
    ///
    /// Assigning the phase of a rhythmic movement resets it, for example at the heel strike of a gait. Position and
    /// velocity are continuous, the acceleration jumps, and the deviation from the cycle at the new phase decays. Before
    /// the first tick the movement starts at this phase. A discrete movement rejects it.
    ///
    /// Examples
    /// --------
    /// Reset the phase at each heel strike, and adapt the frequency by the measured stride:
    ///
    /// >>> walk = np.sin(2 * np.pi * np.arange(100) / 100)[:, None]
    /// >>> gait = pdmp.fit([pdmp.Demonstration(walk, dt=0.01)], kind="rhythmic")
    /// >>> controller = gait.controller(dt=0.01)
    /// >>> stride, heel, gain = 1.25, 0.0, 0.5
    /// >>> for _ in range(12):
    /// ...     for _ in range(125):
    /// ...         _ = controller.step()
    /// ...     controller.phase = heel
    /// ...     omega = 1 / controller.tau
    /// ...     controller.tau = 1 / (omega + gain * (2 * np.pi / stride - omega))
    /// >>> round(2 * np.pi * controller.tau, 2)
    /// 1.25
    ///
    /// References
    /// ----------
    /// Nakanishi, Morimoto, Endo, Cheng, Schaal, Kawato, Robotics and Autonomous Systems 47 (2004) 79-91 (the rule).
    /// The same authors, IROS 2004, doi:10.1109/IROS.2004.1389470 (phase resetting).
    #[getter]
    fn phase(&self) -> f64 {
        self.inner.phase()
    }

    #[setter]
    fn set_phase(&mut self, phase: Scalar<'_>) -> PyResult<()> {
        let result = self.inner.set_phase(phase.number("phase")?);
        self.command(result)
    }

    /// Gain k_phi of a measured phase in `step`, per unit of u, from 0 to 1000; 1 by default, 0 disables the pull.
    ///
    /// An error of the phase decays with exp(-k_phi t / tau). A movement whose frequency differs from the measured one
    /// by the share e lags by asin(e / k_phi), and is synchronised for e < k_phi. The gain stays in force after `reset`.
    #[getter]
    fn phase_gain(&self) -> f64 {
        self.inner.phase_gain()
    }

    #[setter]
    fn set_phase_gain(&mut self, gain: Scalar<'_>) -> PyResult<()> {
        self.inner.set_phase_gain(gain.number("phase_gain")?).map_err(raise)
    }

    /// Computes the motion over the next seconds under the present commands, without a change of the controller.
    ///
    /// Commands in transition continue. A measured position remains in force as in `step`; coupling terms and a measured
    /// phase, which apply to one tick, do not. Ticks are exact for any length, so that a coarse `dt` is as accurate as a
    /// fine one, except for a measured position, whose terms are constant over a tick. The call allocates and belongs
    /// outside the real-time loop, which another thread may step meanwhile.
    ///
    /// Parameters
    /// ----------
    /// horizon : float
    ///     Length in s.
    /// dt : float, optional
    ///     Interval between samples in s; by default that of the controller, for which the samples are those of the loop
    ///     to the bit.
    ///
    /// Returns
    /// -------
    /// Trajectory
    ///     n + 1 samples, where n is horizon / dt rounded down. Times are from now, and the first sample is the present
    ///     motion.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `horizon` is negative or not finite, `dt` is not positive or longer than 1000 tau, or there are more than 1e7
    ///     samples.
    ///
    /// Examples
    /// --------
    /// >>> controller = model.controller(dt=0.01)
    /// >>> controller.goal = [1.1, 0.0]
    /// >>> ahead = controller.forecast(0.5)
    /// >>> for _ in range(50):
    /// ...     _ = controller.step()
    /// >>> np.array_equal(ahead.position[-1], controller.position)
    /// True
    #[pyo3(signature = (horizon, dt=None))]
    fn forecast(slf: &Bound<'_, Self>, horizon: Scalar<'_>, dt: Option<Scalar<'_>>) -> PyResult<Trajectory> {
        let (horizon, dt) = (horizon.number("horizon")?, optional_number("dt", dt)?);
        // A copy, so that a loop in another thread may step the controller meanwhile.
        let (inner, model) = (slf.borrow().inner.clone(), Arc::clone(&slf.borrow().model));
        let trajectory = interruptible(slf.py(), |progress| inner.forecast_with(horizon, dt, progress))?;
        Trajectory::new(slf.py(), trajectory, model.primitive())
    }

    /// Returns an independent controller in the same state, with the same model.
    fn __copy__(&self, py: Python<'_>) -> PyResult<Self> {
        Self::new(py, Arc::clone(&self.model), self.inner.clone())
    }

    /// Rebuilds a pickled controller.
    #[staticmethod]
    fn _of(py: Python<'_>, model: &Model, state: &[u8]) -> PyResult<Self> {
        let (numbers, rest) = state.as_chunks::<8>();
        if !rest.is_empty() {
            let length = state.len();
            return Err(PyValueError::new_err(format!("state has {length} bytes, which is no multiple of 8")));
        }
        let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let inner = pdmp_core::Controller::restore(model.0.primitive(), &numbers).map_err(raise)?;
        Self::new(py, Arc::clone(&model.0), inner)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let state: Vec<u8> = self.inner.snapshot().into_iter().flat_map(f64::to_le_bytes).collect();
        let arguments = (Model(Arc::clone(&self.model)), PyBytes::new(py, &state)).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("_of")?, arguments))
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.__copy__(py)
    }
}
