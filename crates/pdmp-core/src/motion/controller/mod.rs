//! Real-time control loop: one tick of the primitive per call, with every command adjustable between ticks.
//!
//! Over a tick the forcing w, the centre and the clock are given by values and slopes at both ends; the cubics between them
//! are propagated exactly ([`crate::dynamics::Attractor`]). Style, anchor and amplitude pass critically damped filters on
//! the clock, the rate ρ = 1/τ one in seconds, so that position and velocity stay continuous: ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′
//! with y′ = z + w + c′. The frame c, transport, transition to a new goal (`goal`) and additional forcing (`forcing`), is
//! evaluated exactly at both ends of a tick and is not propagated. A perturbation ([`Command::measured`], [`Command::coupling`]) slows
//! the clock of the phase relative to that of the output system, and adds to ẏ and ÿ.
//!
//! [`Controller::update`] and the setters neither allocate nor lock nor panic. A tick costs O(J·D): one step if shorter than
//! 1/500 of the movement and 1/95 of each transition in progress, else proportionally many substeps, at most 1000.

mod coupling;
mod forcing;
mod forecast;
mod getters;
mod goal;
mod governor;
mod group;
mod jerk;
mod limiter;
mod limiting;
mod path_ahead;
mod path_sampling;
mod phase;
mod pose;
mod setters;
mod settling;
mod snapshot;
mod start;
pub(in crate::motion) mod steady;
mod step;
pub(in crate::motion) mod substeps;
mod synchronous;
pub(in crate::motion) mod third_derivative;
mod turning;

use std::sync::Arc;

use crate::dynamics::canonical::CompensatedSum;
use crate::dynamics::command_filter::{CommandFilter, FilterGains, FilterStep};
use crate::dynamics::goal_transition::{GoalTransition, MinDurations};
use crate::dynamics::output_system::Propagator;
use crate::dynamics::propagator_series::Series;
use crate::dynamics::transport::TransportSegment;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, ResolvedConditions};
use crate::model::primitive::Primitive;
use crate::motion::command::{Command, Motion};
use crate::motion::perturbation::{Perturbation, largest_range};
use crate::numerics::simd::{F64x4, copy};
use crate::numerics::state::clone_in_place;
use crate::validate::check_positive;
use governor::Governor;
use group::Group;
use limiter::Limiter;
use pose::Pose;
use substeps::max_clock_step;

/// Default tolerance of a settled movement, relative to the range of each DoF. On the recordings of `docs/transport.md`,
/// movements settle to it within 1.0 to 1.3 durations (medians), to 1e-3 within up to 1.5.
const DEFAULT_TOLERANCE: f64 = 5e-3;
/// Rate of an unlimited speed, relative to the nominal one.
const MAX_SPEED: f64 = 100.0;
/// Flush level, relative to the largest range: values 1e-16 of it become zero. It lies far below the last digit of every
/// movement, and its square is a normal number.
const FLUSH_RATIO: f64 = 1e-150;

/// Status of a movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// In progress. A rhythmic movement never finishes.
    Working,
    /// Past the demonstrated end, with position and velocity settled on the goal; see [`Controller::set_tolerance`].
    Finished,
}

/// Running primitive: the primitive, its commands and its state.
///
/// ```
/// use pdmp_core::{Conditions, Controller, Status};
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
/// controller.set_goal(&[1.2, 0.1])?;
/// while controller.step()? == Status::Working {}
/// assert!((controller.position()[0] - 1.2).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Controller {
    primitive: Arc<Primitive>,
    dt: f64,
    /// Transition of commands, in seconds.
    transition: f64,
    conditions: ResolvedConditions,
    started: bool,
    status: Status,
    time: CompensatedSum,
    /// Clock u, or the polar phase φ in [0, 2π).
    clock: CompensatedSum,
    /// Amplitude r; 1 for a discrete movement.
    r: f64,
    /// Filter gains of style, anchor and amplitude, on the clock.
    command_gains: FilterGains,
    style: CommandFilter,
    /// Filter gains of ρ, in seconds.
    rate_gains: FilterGains,
    /// ρ = 1/τ.
    rate: CommandFilter,
    /// Goal or anchor. With learnt transport the value is the goal before `goal_transition`.
    centre: CommandFilter,
    /// Transition of the frame to a commanded goal and final velocity.
    goal_transition: GoalTransition,
    min_durations: MinDurations,
    /// True while the transition ends with the final velocity.
    approaching: bool,
    /// y′ at the end of a transition to the final velocity.
    arrival_slope: Vec<F64x4>,
    /// r₀.
    amplitude: CommandFilter,
    /// Largest τ commanded since the start.
    max_tau: f64,
    /// Factor of the rate 1/τ.
    speed: f64,
    /// Tolerance of a settled movement, relative to the range of each DoF.
    tolerance: f64,
    groups: Vec<Group>,
    /// Phase rate κ for which w′ of the groups was computed.
    forcing_phase_rate: f64,
    /// ℓ = m − 1 at the clock: the frame is at g + (g − y₀)·ℓ.
    frame_lag: f64,
    /// Interval of the transport profile that contains the clock.
    transport_segment: TransportSegment,
    position: Vec<F64x4>,
    velocity: Vec<F64x4>,
    acceleration: Vec<F64x4>,
    /// Level relative to which tiny states are flushed to zero.
    flush_level: f64,
    perturbation: Perturbation,
    limiter: Limiter,
    /// Governor of the commands, if limits bound the rate of the path.
    governor: Option<Box<Governor>>,
    /// Memory of a governor that is no longer in force.
    idle_governor: Option<Box<Governor>>,
    /// ρ̇ of the next substep where the limits determine it.
    rate_slope: Option<f64>,
    phase_gain: f64,
    /// Maximum clock step of a substep.
    max_clock_step: f64,
    /// Filter step of the rate over the last substep, reused for the next one of that length.
    rate_step: FilterStep,
    /// Filter step of style, anchor and amplitude over the last substep.
    command_step: FilterStep,
    propagator: Propagator,
    series: Series,
    /// Number of ticks by which the forcing table is prefetched.
    prefetch_ticks: f64,
    /// Motion in coordinates, of a primitive with rotations.
    pose: Option<Box<Pose>>,
}

// A copy moves as the original does, to the bit. `clone_from` allocates nothing if the destination is an earlier copy, unless
// a later reset added a start or a start velocity, or later limits a governor.
clone_in_place!(Controller {
    primitive,
    dt,
    transition,
    conditions,
    started,
    status,
    time,
    clock,
    r,
    command_gains,
    style,
    rate_gains,
    rate,
    centre,
    goal_transition,
    min_durations,
    approaching,
    arrival_slope,
    amplitude,
    max_tau,
    speed,
    tolerance,
    groups,
    forcing_phase_rate,
    frame_lag,
    transport_segment,
    position,
    velocity,
    acceleration,
    flush_level,
    perturbation,
    limiter,
    governor,
    idle_governor,
    rate_slope,
    phase_gain,
    max_clock_step,
    rate_step,
    command_step,
    propagator,
    series,
    prefetch_ticks,
    pose,
});

impl Controller {
    /// Starts a movement.
    ///
    /// `dt` is the length of a tick and `transition` the time to 99 % of a changed style, τ, goal, anchor or amplitude,
    /// both in seconds. The transition of the rate 1/τ takes this time; the others take the equivalent clock interval at the
    /// model's τ, so that the path does not depend on the rate. 0 is the paper's immediate switch. The default is a tenth of
    /// the nominal duration of a discrete movement, a quarter of the nominal period of a rhythmic one. With learnt transport
    /// a new goal takes the rest of the movement instead; see [`Controller::set_goal`].
    ///
    /// # Errors
    /// Conditions that do not fit the primitive, a `dt` that is not positive, or a `transition` that is negative or longer
    /// than 1e6 durations.
    pub fn new(primitive: &Arc<Primitive>, dt: f64, conditions: &Conditions, transition: Option<f64>) -> Result<Self> {
        check_positive("dt", dt)?;
        let share = if primitive.kind() == Kind::Discrete { 0.1 } else { 0.25 };
        let transition = transition.unwrap_or(share * primitive.duration());
        if !(0.0..=1e6 * primitive.duration()).contains(&transition) {
            let allowed = "must lie between 0, an immediate switch, and a million durations";
            return Err(Error::Range { name: "transition", value: transition, allowed });
        }
        let given = conditions;
        let conditions = given.complete(primitive)?;
        let rate_gains = FilterGains::new(transition);
        let command_gains = rate_gains.on_clock(primitive.tau());
        let groups = Group::all(primitive.ranges());
        let zeros = vec![F64x4::ZERO; groups.len()];
        let max_clock_step = max_clock_step(primitive);
        let series = Series::new(primitive.attractor(), max_clock_step);
        let mut controller = Self {
            dt,
            transition,
            started: false,
            status: Status::Working,
            time: CompensatedSum::default(),
            clock: CompensatedSum::default(),
            r: 1.0,
            command_gains,
            style: CommandFilter::new(&conditions.style),
            rate_gains,
            rate: CommandFilter::new(&[1.0 / conditions.tau]),
            centre: CommandFilter::new(&conditions.centre),
            goal_transition: GoalTransition::inactive(groups.len()),
            min_durations: MinDurations::new(primitive.attractor(), transition / primitive.tau()),
            approaching: false,
            arrival_slope: zeros.clone(),
            amplitude: CommandFilter::new(&[conditions.amplitude]),
            max_tau: conditions.tau,
            speed: 1.0,
            tolerance: DEFAULT_TOLERANCE,
            groups,
            forcing_phase_rate: 1.0,
            frame_lag: 0.0,
            transport_segment: primitive.transport.segment_at(0.0),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            flush_level: FLUSH_RATIO * largest_range(primitive.ranges()),
            perturbation: Perturbation::new(primitive),
            limiter: Limiter::none(primitive),
            governor: None,
            idle_governor: None,
            rate_slope: None,
            phase_gain: phase::PHASE_GAIN,
            max_clock_step,
            rate_step: rate_gains.step_with_integral(dt),
            command_step: FilterStep::IDENTITY,
            propagator: series.propagator::<F64x4>(0.0),
            series,
            prefetch_ticks: 1.0,
            pose: Pose::of(primitive.coordinates()),
            conditions,
            primitive: Arc::clone(primitive),
        };
        controller.keep_final_velocity(given);
        controller.begin();
        Ok(controller)
    }

    /// Returns the controller with another prefetch distance, for ticks without waiting time between them.
    pub(crate) fn with_prefetch(self, prefetch_ticks: f64) -> Self {
        Self { prefetch_ticks, ..self }
    }

    /// Performs one tick of length [`Controller::dt`] without a new command.
    ///
    /// # Errors
    /// A tick longer than 1000 τ. The state then remains unchanged.
    pub fn step(&mut self) -> Result<Status> {
        self.check_tick_length(self.dt, None)?;
        self.refresh_path();
        let h = self.clock_step(self.dt);
        if self.perturbation.has_measurement() {
            self.perturb(&Command::default(), self.dt, h);
        } else {
            self.perturbation.clear_terms();
        }
        Ok(self.tick(self.dt, h))
    }

    /// Performs one tick under a command and writes the motion to memory of the caller.
    ///
    /// A rejected command is rejected as a whole: no part of it takes effect, and no time passes. A perturbation is constant
    /// over the tick:
    ///
    /// ```text
    /// τẏ = z + w(u) + k_t d + τc_v
    /// τż = α_z(β_z(g − y) − z) + τ²c_a
    /// τu̇ = max(0, κ + k_φ sin(φ* − φ)),     κ = 1/(1 + k_s‖d/range‖²)
    /// τȯ = λκ(e − o)
    /// ```
    ///
    /// A measured position ỹ slows the phase by its tracking error e = ỹ − y and pulls the movement towards it, with the
    /// gains of [`Controller::set_compliance`]. Only the part d of the error in excess of the expected error o counts: e − o
    /// if o has the sign of e and is smaller, 0 if it is larger, and e if it has the other sign. A constant lag or sag of the
    /// robot therefore neither stops the movement nor keeps it from its goal. The error of a DoF in rad, deg or ° is wrapped
    /// to half a turn. A measurement remains in force, as its error e, until the next one or [`Controller::release`], so
    /// that a sensor may be slower than the loop. Coupling terms add c_v to the velocity and c_a to the acceleration. The
    /// pull over a tick of `dt` seconds and h on the clock is the velocity d(1 − exp(−k_t h))/dt, which never overshoots ỹ.
    ///
    /// A measured phase φ* pulls the phase of a rhythmic movement with the gain of [`Controller::set_phase_gain`]; the pull
    /// is the mean over the tick of the exact solution, so that it does not overshoot φ*.
    ///
    /// Phase stopping and tracking: Ijspeert, Nakanishi and Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739; Schaal,
    /// Mohajerian and Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9. Terms in ż:
    /// Pastor, Hoffmann, Asfour and Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385.
    ///
    /// # Errors
    /// A vector of a wrong length, a number that is not finite, a τ, amplitude or goal that its setter rejects, or a tick
    /// that is negative or longer than 1000 τ.
    pub fn update(&mut self, command: &Command, motion: &mut Motion) -> Result<Status> {
        motion.check(&self.primitive)?;
        let status = self.step_with(command)?;
        self.read(motion);
        Ok(status)
    }

    /// Writes the motion to vectors of one element for each coordinate or DoF.
    #[inline]
    pub(crate) fn read(&self, motion: &mut Motion) {
        if let Some(pose) = &self.pose {
            motion.position.copy_from_slice(&pose.position);
            motion.velocity.copy_from_slice(&pose.velocity);
            return motion.acceleration.copy_from_slice(&pose.acceleration);
        }
        copy(&self.position, motion.position);
        copy(&self.velocity, motion.velocity);
        copy(&self.acceleration, motion.acceleration);
    }

    /// Performs one tick as [`Controller::update`] without writing the motion, which can be read from the controller.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// # use pdmp_core::Command;
    /// controller.step()?;
    /// let measured = [0.0, 0.01];
    /// controller.step_with(&Command { measured: Some(&measured), ..Command::default() })?;
    /// assert!(controller.position()[1] > 0.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Controller::update`].
    pub fn step_with(&mut self, command: &Command) -> Result<Status> {
        command.check(&self.primitive)?;
        let dt = command.dt.unwrap_or(self.dt);
        self.check_tick_length(dt, command.tau)?;
        self.apply(command);
        // Two readings of a coarse system clock may be equal.
        if dt == 0.0 {
            return Ok(self.status);
        }
        self.refresh_path();
        let h = self.clock_step(dt);
        self.perturb(command, dt, h);
        if let Some(phase) = command.phase {
            self.pull_phase(phase, h);
        }
        Ok(self.tick(dt, h))
    }
}
