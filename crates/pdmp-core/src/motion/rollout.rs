//! One whole trajectory: the control loop run at once, in linear time or in that of a timing.

use std::sync::Arc;

use ndarray::Array2;

use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::model::conditions::{Conditions, check_tau};
use crate::model::primitive::Primitive;
use crate::motion::command::{Command, Motion};
use crate::motion::controller::Controller;
use crate::motion::trajectory::Trajectory;
use crate::validate::check_positive;
use crate::validate::zeros;

/// Samples between two questions whether to go on.
const PORTION: usize = 4096;
/// Ticks that pass, one right after the other, while memory answers.
const LEAD: f64 = 16.0;
/// Most samples of a rollout.
const MOST_STEPS: f64 = 1e7;

/// Times of a rollout, in seconds.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Interval between samples.
    pub dt: f64,
    /// Length of the rollout; otherwise the demonstrated duration scaled by τ, the sum of the timing, or one period.
    pub duration: Option<f64>,
}

impl Timing {
    /// Number of steps n = ⌊duration/dt·(1 + 1e-12) + 1e-9⌋: a whole multiple of dt keeps its last sample.
    pub(crate) fn steps(&self, primitive: &Primitive, tau: f64) -> Result<usize> {
        check_positive("dt", self.dt)?;
        check_tau(tau, primitive.tau)?;
        let duration = match self.duration {
            Some(duration) if duration.is_finite() && duration >= 0.0 => duration,
            Some(value) => {
                return Err(Error::Range { name: "duration", value, allowed: "must be finite and not negative" });
            }
            None => primitive.duration() * tau / primitive.tau,
        };
        let steps = (duration / self.dt * (1.0 + 1e-12) + 1e-9).floor();
        if steps > MOST_STEPS {
            return Err(Error::Range {
                name: "dt",
                value: self.dt,
                allowed: "gives more than 1e7 samples: enlarge it",
            });
        }
        Ok(steps as usize)
    }
}

/// The movement under constant conditions: n + 1 samples at t = 0, dt, …, start included.
///
/// # Errors
/// Conditions or times that do not fit the primitive.
pub fn rollout(primitive: &Arc<Primitive>, conditions: &Conditions, timing: Timing) -> Result<Trajectory> {
    rollout_with(primitive, conditions, timing, &mut |_| Ok(()))
}

/// [`rollout`] that can be stopped: `proceed` is told the share that is done.
///
/// # Errors
/// Conditions or times that do not fit the model, or whatever `proceed` returns.
pub fn rollout_with(
    primitive: &Arc<Primitive>,
    conditions: &Conditions,
    timing: Timing,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Trajectory> {
    let steps = timing.steps(primitive, conditions.time_constant(primitive)?)?;
    let mut clock = Clock::of(primitive, conditions)?;
    if conditions.phase.is_some() && matches!(clock, Clock::Warped { .. }) {
        return Err(Error::Arguments(
            "pass phase or a timing of several segments, not both: a timing starts at phase 0",
        ));
    }
    let conditions = clock.conditions(conditions);
    let mut controller = Controller::new(primitive, timing.dt, &conditions, Some(0.0))?.looking_ahead(LEAD);
    let shape = (steps + 1, primitive.n_dofs());
    let mut trajectory = Trajectory {
        time: (0..=steps).map(|k| k as f64 * timing.dt).collect(),
        position: zeros("rollout", shape)?,
        velocity: zeros("rollout", shape)?,
        acceleration: zeros("rollout", shape)?,
    };
    let Trajectory { time, position, velocity, acceleration } = &mut trajectory;
    let rows = |array| Array2::as_slice_mut(array).unwrap_or_default().chunks_exact_mut(primitive.n_dofs());
    let rows = rows(position).zip(rows(velocity)).zip(rows(acceleration));
    for (k, (time, ((position, velocity), acceleration))) in time.iter().zip(rows).enumerate() {
        if k % PORTION == 0 {
            proceed(k as f64 / (steps + 1) as f64)?;
        }
        if k > 0 {
            clock.step(&mut controller, *time)?;
        }
        let mut motion = Motion { position, velocity, acceleration };
        controller.read(&mut motion);
        clock.pace(&mut motion);
    }
    Ok(trajectory)
}

/// What drives a rollout: time itself, or time warped to the nominal demonstration's by a timing.
///
/// With u(t) in place of t/τ the movement is the same function of u, ẏ = y′u̇ and ÿ = y″u̇² + y′ü.
enum Clock {
    Linear,
    Warped {
        warp: WarpingFunction,
        /// Seconds of the nominal time per unit of phase.
        extent: f64,
        /// Phase p, ṗ and p̈.
        phase: [f64; 3],
    },
}

impl Clock {
    fn of(primitive: &Primitive, conditions: &Conditions) -> Result<Self> {
        let Some(timing) = conditions.timing.as_ref().filter(|timing| timing.len() > 1) else {
            return Ok(Self::Linear);
        };
        let warp = primitive.warping_function(timing)?;
        let phase = warp.phase(0.0);
        Ok(Self::Warped { warp, extent: primitive.tau * primitive.canonical().extent(), phase })
    }

    /// The conditions in the time of the controller.
    fn conditions(&self, given: &Conditions) -> Conditions {
        match self {
            Self::Linear => given.clone(),
            Self::Warped { extent, phase: [_, rate, _], .. } => Conditions {
                timing: None,
                velocity: given
                    .velocity
                    .as_ref()
                    .map(|velocity| velocity.iter().map(|v| v / (extent * rate)).collect()),
                ..given.clone()
            },
        }
    }

    /// Takes the controller to a time, in seconds.
    fn step(&mut self, controller: &mut Controller, time: f64) -> Result<()> {
        match self {
            Self::Linear => controller.step(),
            Self::Warped { warp, extent, phase } => {
                let before = phase[0];
                *phase = warp.phase(time);
                let dt = Some((phase[0] - before) * *extent);
                controller.step_with(&Command { dt, ..Command::default() })
            }
        }
        .map(drop)
    }

    /// Makes the motion of the controller that of the movement.
    fn pace(&self, motion: &mut Motion) {
        if let Self::Warped { extent, phase: [_, rate, bend], .. } = self {
            let (pace, change) = (extent * rate, extent * bend);
            for (velocity, acceleration) in motion.velocity.iter_mut().zip(motion.acceleration.iter_mut()) {
                *acceleration = *acceleration * pace * pace + *velocity * change;
                *velocity *= pace;
            }
        }
    }
}
