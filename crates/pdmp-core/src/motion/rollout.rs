//! Rollouts: trajectories under constant conditions, by the control loop, in linear or warped time.

use std::sync::Arc;

use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::model::conditions::{Conditions, check_tau};
use crate::model::primitive::Primitive;
use crate::motion::command::{Command, Motion};
use crate::motion::controller::Controller;
use crate::motion::trajectory::{Trajectory, sampling_times, step_count};

/// Number of ticks by which the forcing table is prefetched: about the latency of main memory.
const PREFETCH_TICKS: f64 = 16.0;

/// Sampling times 0, dt, 2dt, … of a rollout.
#[derive(Clone, Copy, Debug)]
pub struct TimeGrid {
    /// Sampling interval, in seconds.
    pub dt: f64,
    /// Duration of the rollout, in seconds. The default is the nominal duration or period scaled by τ, which is the sum of
    /// the segment durations if these are given.
    pub duration: Option<f64>,
}

impl TimeGrid {
    /// Returns the number of steps.
    pub(crate) fn steps(&self, primitive: &Primitive, tau: f64) -> Result<usize> {
        check_tau(tau, primitive.tau)?;
        let name = self.duration.map(|_| "duration");
        step_count(name, self.duration.unwrap_or(primitive.duration() * tau / primitive.tau), self.dt)
    }
}

/// Computes the movement under constant conditions: n + 1 samples at t = 0, dt, …, n·dt.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit, rollout};
/// # use pdmp_core::motion::TimeGrid;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let conditions = Conditions { goal: Some(vec![1.2, 0.1]), ..Conditions::default() };
/// let trajectory = rollout(model.primitive(), &conditions, TimeGrid { dt: 0.01, duration: Some(2.0) })?;
/// assert_eq!(trajectory.position.dim(), (201, 2));
/// assert!((trajectory.position[[200, 0]] - 1.2).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or times that do not fit the primitive, or a trajectory that does not fit into memory.
pub fn rollout(primitive: &Arc<Primitive>, conditions: &Conditions, grid: TimeGrid) -> Result<Trajectory> {
    rollout_with(primitive, conditions, grid, &mut |_| Ok(()))
}

/// Computes a [`rollout`] and reports progress: `progress` is called periodically with the completed fraction; an error it
/// returns cancels the call.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, Error, FitOptions, Kind, fit};
/// # use pdmp_core::motion::{TimeGrid, rollout_with};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let grid = TimeGrid { dt: 1e-4, duration: Some(1.0) };
/// let mut cancel = |completed: f64| if completed < 0.5 { Ok(()) } else { Err(Error::Interrupted) };
/// let result = rollout_with(model.primitive(), &Conditions::default(), grid, &mut cancel);
/// assert!(matches!(result, Err(Error::Interrupted)));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As for [`rollout`], or the error of `progress`.
pub fn rollout_with(
    primitive: &Arc<Primitive>,
    conditions: &Conditions,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Trajectory> {
    let steps = grid.steps(primitive, conditions.time_constant(primitive)?)?;
    let clock = Clock::of(primitive, conditions)?;
    let conditions = clock.conditions(conditions);
    sample(primitive, &conditions, clock, grid.dt, sampling_times(steps, grid.dt), progress)
}

/// Computes the movement under constant conditions at the given times in seconds, which increase from 0.
///
/// # Errors
/// As for [`rollout`].
pub(crate) fn rollout_at(primitive: &Arc<Primitive>, conditions: &Conditions, time: Vec<f64>) -> Result<Trajectory> {
    let clock = Clock::of(primitive, conditions)?;
    let conditions = clock.conditions(conditions);
    let clock = if matches!(clock, Clock::Linear) { Clock::Unequal { time: 0.0 } } else { clock };
    sample(primitive, &conditions, clock, time[1], time, &mut |_| Ok(()))
}

/// Samples the movement on a clock at the given times; `dt` is the tick of the controller.
fn sample(
    primitive: &Arc<Primitive>,
    conditions: &Conditions,
    mut clock: Clock,
    dt: f64,
    time: Vec<f64>,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Trajectory> {
    let mut controller = Controller::new(primitive, dt, conditions, Some(0.0))?.with_prefetch(PREFETCH_TICKS);
    Trajectory::record_at("rollout", primitive, time, progress, |k, time, motion| {
        if k > 0 {
            clock.step(&mut controller, time)?;
        }
        controller.read(motion);
        clock.rescale(motion);
        Ok(())
    })
}

/// Clock of a rollout.
///
/// In warped time u(t) replaces t/τ: the movement is the same function of u, with ẏ = y′u̇ and ÿ = y″u̇² + y′ü.
pub(super) enum Clock {
    /// Time of the controller, in its ticks.
    Linear,
    /// Time of the controller, in ticks of any length; the time after the last one, in seconds.
    Unequal { time: f64 },
    /// Time warped by segment durations.
    Warped {
        function: WarpingFunction,
        /// Nominal time per unit of phase, in seconds.
        extent: f64,
        /// Phase p, ṗ and p̈.
        phase: [f64; 3],
    },
}

impl Clock {
    pub(super) fn of(primitive: &Primitive, conditions: &Conditions) -> Result<Self> {
        let Some(segment_durations) =
            conditions.segment_durations.as_ref().filter(|segment_durations| segment_durations.len() > 1)
        else {
            return Ok(Self::Linear);
        };
        if conditions.phase.is_some() {
            return Err(Error::Conflict {
                names: ["phase", "segment_durations"],
                reason: "warped time starts at phase 0",
            });
        }
        let warp = primitive.warping_function(segment_durations)?;
        let phase = warp.phase(0.0);
        let extent = primitive.tau * primitive.canonical().extent();
        Ok(Self::Warped { function: warp, extent, phase })
    }

    /// Converts conditions to the time of the controller.
    pub(super) fn conditions(&self, conditions: &Conditions) -> Conditions {
        let mut conditions = conditions.clone();
        if let Self::Warped { .. } = self {
            conditions.segment_durations = None;
            let [start, end] = self.velocity_units();
            conditions.velocity.iter_mut().flatten().for_each(|v| *v /= start);
            conditions.goal_velocity.iter_mut().flatten().for_each(|v| *v /= end);
        }
        conditions
    }

    /// Returns the seconds of the controller per second at the start, and at the end.
    pub(super) fn velocity_units(&self) -> [f64; 2] {
        match self {
            Self::Warped { function, extent, phase: [_, rate, _] } => [extent * rate, extent / function.slope(1.0)],
            _ => [1.0; 2],
        }
    }

    /// Advances the clock to a time in seconds, and returns the length of the tick, `None` for that of the controller.
    pub(super) fn tick(&mut self, time: f64) -> Option<f64> {
        match self {
            Self::Linear => None,
            Self::Unequal { time: before } => Some(time - std::mem::replace(before, time)),
            Self::Warped { function, extent, phase } => {
                let before = phase[0];
                *phase = function.phase(time);
                Some((phase[0] - before) * *extent)
            }
        }
    }

    /// Advances the controller to a time in seconds.
    fn step(&mut self, controller: &mut Controller, time: f64) -> Result<()> {
        match self.tick(time) {
            None => controller.step(),
            dt => controller.step_with(&Command { dt, ..Command::default() }),
        }
        .map(drop)
    }

    /// Returns the seconds of the controller per second, and their derivative with respect to time.
    pub(super) fn speed(&self) -> [f64; 2] {
        match self {
            Self::Warped { extent, phase: [_, rate, rate_change], .. } => [extent * rate, extent * rate_change],
            _ => [1.0, 0.0],
        }
    }

    /// Converts velocity and acceleration from the time of the controller to warped time.
    fn rescale(&self, motion: &mut Motion) {
        if let Self::Warped { .. } = self {
            let [speed, change] = self.speed();
            for (velocity, acceleration) in motion.velocity.iter_mut().zip(motion.acceleration.iter_mut()) {
                *acceleration = *acceleration * speed * speed + *velocity * change;
                *velocity *= speed;
            }
        }
    }
}
