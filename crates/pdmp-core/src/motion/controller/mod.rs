//! The real-time loop: one tick of the primitive per call, with every command open to change.
//!
//! Over a tick the forcing w, the goal and the clock are known at both ends with their slopes; a cubic between them is
//! propagated exactly ([`crate::Attractor::propagator`]). Style, goal or anchor and amplitude pass critically damped
//! filters on the clock, the rate ρ = 1/τ one in seconds, so that position and velocity stay continuous: ẏ = ρy′ and
//! ÿ = ρ²y″ + ρ̇y′ with y′ = z + w + c′. The frame c of a discrete movement is known exactly at both ends of a tick
//! (`transport`), and outside what is propagated. A perturbation
//! ([`Command::measured`], [`Command::coupling`]) slows the phase's clock against the output system's, and adds to ẏ and
//! ÿ.
//!
//! Nothing in [`Controller::update`] or in a setter allocates, locks or panics. A tick takes O(J·D), whatever the model was
//! learnt from: once if it is shorter than a 500th of the movement and than a 95th of a transition under way, and as many
//! times as it is longer otherwise, a thousand at most.

#[cfg(target_arch = "x86_64")]
mod avx;
mod group;
mod setters;
mod step;

use std::sync::Arc;

use crate::dynamics::canonical::CompensatedSum;
use crate::dynamics::command_filter::{CommandFilter, FilterGains, FilterStep};
use crate::dynamics::output_system::{Propagator, State};
use crate::dynamics::propagator_series::Series;
use crate::dynamics::transport::Stretch;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, ResolvedConditions};
use crate::model::primitive::Primitive;
use crate::motion::command::{Command, Motion};
use crate::motion::perturbation::{Perturbation, widest};
use crate::numerics::simd::{F64x4, WIDTH, copy, padded, repack, unpack};
use crate::validate::check_positive;
use group::Group;

/// A tick is divided so that the clock moves by no more than this share of the movement at once.
const MAX_CLOCK_STEP: f64 = 1.0 / 500.0;
/// A movement has settled within this share of its range.
const SETTLED: f64 = 1e-3;

/// A share of the range at which a movement is at rest.
const REST: f64 = 1e-150;

/// Whether a movement goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The movement goes on; a rhythmic one always does.
    Working,
    /// The demonstrated time is over, and position and velocity have settled on the goal.
    Finished,
}

/// A running primitive: a model, its commands and its state.
#[derive(Clone, Debug)]
pub struct Controller {
    primitive: Arc<Primitive>,
    dt: f64,
    conditions: ResolvedConditions,
    started: bool,
    status: Status,
    time: CompensatedSum,
    /// Clock u, or the polar phase φ in [0, 2π).
    clock: CompensatedSum,
    /// Amplitude r; 1 where discrete.
    r: f64,
    /// How style and amplitude are followed, on the clock.
    filter: FilterGains,
    style: CommandFilter,
    /// How ρ is followed, in seconds.
    rate_filter: FilterGains,
    /// ρ = 1/τ.
    rate: CommandFilter,
    /// Goal or anchor.
    centre: CommandFilter,
    /// How a commanded goal is followed, on the clock: [`Controller::centre_filter`].
    centre_filter: FilterGains,
    /// r₀.
    amplitude: CommandFilter,
    /// Share of the rate 1/τ at which the path is followed.
    speed: f64,
    groups: Vec<Group>,
    /// Pace of the phase for which the groups' w holds.
    paced: f64,
    /// The share m − 1 of the way by which the frame is off the goal at the clock.
    lag: f64,
    /// Where it is read.
    stretch: Stretch,
    /// By groups of DoFs.
    position: Vec<F64x4>,
    velocity: Vec<F64x4>,
    acceleration: Vec<F64x4>,
    /// Far below the last digit of every movement.
    rest: f64,
    held: Perturbation,
    /// A stretch of the clock that is not divided.
    finest: f64,
    /// Of the last tick, and good for the next if it is as long.
    glide: FilterStep,
    /// The same of the filters on the clock.
    course: FilterStep,
    centre_course: FilterStep,
    propagator: Propagator,
    series: Series,
    /// Ticks from now for which the landscape is fetched.
    lead: f64,
}

impl Controller {
    /// Starts a movement.
    ///
    /// `dt` is the length of a tick and `transition` the time to 99 % of a changed style, τ, goal, anchor or amplitude,
    /// both in seconds. The rate 1/τ changes in so many seconds; the others on the clock, in so many seconds at the
    /// model's own τ, so that the path does not depend on how fast it is followed. 0 is the paper's immediate switch, and
    /// without it a tenth of the nominal duration (discrete) or a quarter of the nominal period (rhythmic) serves. A goal
    /// takes what remains of the movement if that is longer, unless transport is immediate.
    ///
    /// # Errors
    /// Conditions that do not fit the model, `dt` that is not positive, or a negative `transition`.
    pub fn new(primitive: &Arc<Primitive>, dt: f64, conditions: &Conditions, transition: Option<f64>) -> Result<Self> {
        check_positive("dt", dt)?;
        let share = if primitive.kind() == Kind::Discrete { 0.1 } else { 0.25 };
        let transition = transition.unwrap_or(share * primitive.duration());
        if !(0.0..=1e6 * primitive.duration()).contains(&transition) {
            let allowed = "must lie between 0, an immediate switch, and a million durations";
            return Err(Error::Range { name: "transition", value: transition, allowed });
        }
        let conditions = conditions.complete(primitive)?;
        let rate_filter = FilterGains::new(transition);
        let filter = rate_filter.on_clock(primitive.tau());
        let groups = Group::all(primitive.ranges());
        let zeros = vec![F64x4::ZERO; groups.len()];
        // A tick of just this length is not divided for a rounding error.
        let finest = MAX_CLOCK_STEP * primitive.canonical().extent() * (1.0 + 1e-9);
        let series = Series::new(primitive.attractor(), finest);
        let mut controller = Self {
            dt,
            started: false,
            status: Status::Working,
            time: CompensatedSum::default(),
            clock: CompensatedSum::default(),
            r: 1.0,
            filter,
            style: CommandFilter::new(&conditions.style),
            rate_filter,
            rate: CommandFilter::new(&[1.0 / conditions.tau]),
            centre: CommandFilter::new(&conditions.centre),
            centre_filter: filter,
            amplitude: CommandFilter::new(&[conditions.amplitude]),
            speed: 1.0,
            groups,
            paced: 1.0,
            lag: 0.0,
            stretch: primitive.transport.stretch(0.0),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            rest: REST * widest(primitive.ranges()),
            held: Perturbation::new(primitive.ranges(), primitive.units(), primitive.canonical().extent()),
            finest,
            glide: rate_filter.glide(dt),
            course: FilterStep::START,
            centre_course: FilterStep::START,
            propagator: series.propagator::<F64x4>(0.0),
            series,
            lead: 1.0,
            conditions,
            primitive: Arc::clone(primitive),
        };
        controller.begin();
        Ok(controller)
    }

    /// The same with the landscape fetched so many ticks ahead, for ticks that do not wait for one another.
    pub(crate) fn looking_ahead(self, lead: f64) -> Self {
        Self { lead, ..self }
    }

    /// Starts again under other conditions.
    ///
    /// # Errors
    /// As for [`Controller::new`]; the movement then goes on as it was.
    pub fn reset(&mut self, conditions: &Conditions) -> Result<()> {
        self.conditions = conditions.complete(&self.primitive)?;
        self.begin();
        Ok(())
    }

    fn begin(&mut self) {
        self.started = false;
        self.status = Status::Working;
        self.held.release();
        (self.time, self.clock) = (CompensatedSum::default(), CompensatedSum::default());
        let conditions = &self.conditions;
        self.r = conditions.amplitude;
        self.style.jump(&conditions.style);
        self.rate.jump(&[self.speed / conditions.tau]);
        self.amplitude.jump(&[conditions.amplitude]);
        self.centre.jump(&conditions.centre);
        if let (Kind::Discrete, Some(start)) = (self.primitive.kind(), &conditions.start) {
            for ((group, goal), start) in self.groups.iter_mut().zip(self.centre.value()).zip(start.chunks(WIDTH)) {
                group.way = *goal - padded(start);
            }
        }
        self.read_frame();
        self.read_forcing();
        self.place();
        self.set_tolerance();
        self.read_out();
    }

    /// Puts position and z where the movement starts: at rest in z, or on the limit cycle of this style.
    fn place(&mut self) {
        let Self { primitive, conditions, r, .. } = self;
        for (index, (position, group)) in self.position.iter_mut().zip(&mut self.groups).enumerate() {
            let cycle = &primitive.cycle[index * primitive.n_styles()..];
            let on_cycle = conditions.style.iter().zip(cycle).fold(State::<F64x4>::default(), |sum, (s, cycle)| {
                State { e: sum.e + cycle.e * (*r * s), z: sum.z + cycle.z * (*r * s) }
            });
            *position = self.centre.value()[index] + on_cycle.e;
            group.z = on_cycle.z;
        }
        let phase = conditions.phase;
        if phase > 0.0 {
            // The limit cycle is followed to where the movement starts, no phase of it being closer to a closed form.
            let parts = (phase / self.finest).ceil();
            (0..parts as u32).for_each(|_| self.advance(self.dt, phase / parts));
            self.clock = CompensatedSum::at(phase);
            self.read_forcing();
        }
        let Self { conditions, r, .. } = self;
        if let Some(start) = &conditions.start {
            repack(&mut self.position, start);
        }
        if let Some(velocity) = &conditions.velocity {
            for (group, velocity) in self.groups.iter_mut().zip(velocity.chunks(WIDTH)) {
                group.z = padded(velocity) * conditions.tau - group.forcing.shape * *r;
            }
        }
    }

    /// One tick of the length given at the start, with nothing new commanded.
    ///
    /// # Errors
    /// A tick longer than 1000 τ; the state then stays as it was.
    pub fn step(&mut self) -> Result<Status> {
        self.check_length(self.dt, None)?;
        let h = self.stretch(self.dt);
        if self.held.followed() {
            self.held.take(&Command::default(), &self.position, self.dt, h);
        } else {
            self.held.rest();
        }
        Ok(self.tick(self.dt, h))
    }

    /// One tick under a command, with the motion written where the caller wants it.
    ///
    /// What is refused is refused as a whole: no part of the command takes effect, and no time passes. A perturbation is
    /// held over the tick:
    ///
    /// ```text
    /// τẏ = z + w(u) + k_t d + τc_v
    /// τż = α_z(β_z(g − y) − z) + τ²c_a
    /// τu̇ = κ = 1/(1 + k_s‖d/range‖²)
    /// τȯ = λκ(e − o)
    /// ```
    ///
    /// `measured` ỹ stops the phase as the robot falls behind and pulls the movement towards it, with the gains of
    /// [`Controller::set_compliance`]. Of the error e = ỹ − y counts d, what lies beyond the error o that is expected by
    /// now: e − o where o is of the sign of e and smaller, 0 where it is larger, e where it is of the other sign. A robot
    /// that always lags or sags by the same so neither holds the movement up nor keeps it from its goal. The error of a
    /// DoF whose unit is rad, deg or ° is taken the short way round. A measurement stays in force, as the distance e, until
    /// the next one or [`Controller::release`], so that a sensor may be slower than the loop. `coupling` adds c_v to the
    /// velocity and c_a to the acceleration. Over the tick the pull is the velocity (1 − exp(−k_t h))/dt of d at its
    /// start, h being the tick on the clock: however long the tick, it pulls no further than ỹ.
    ///
    /// Phase stopping and the pull: Ijspeert, Nakanishi and Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739; Schaal,
    /// Mohajerian and Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9. Terms in ż:
    /// Pastor, Hoffmann, Asfour and Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385.
    ///
    /// # Errors
    /// A vector of a wrong length, a number that is not finite, τ, amplitude or goal that a setter refuses, or a tick
    /// that is negative or longer than 1000 τ.
    pub fn update(&mut self, command: &Command, motion: &mut Motion) -> Result<Status> {
        motion.check(self.primitive.n_dofs())?;
        let status = self.step_with(command)?;
        self.read(motion);
        Ok(status)
    }

    /// Writes the motion, whose vectors have been checked, where the caller wants it.
    #[inline]
    pub(crate) fn read(&self, motion: &mut Motion) {
        copy(&self.position, motion.position);
        copy(&self.velocity, motion.velocity);
        copy(&self.acceleration, motion.acceleration);
    }

    /// [`Controller::update`] whose motion is read from the controller afterwards.
    ///
    /// # Errors
    /// As for [`Controller::update`].
    pub fn step_with(&mut self, command: &Command) -> Result<Status> {
        command.check(&self.primitive)?;
        let dt = command.dt.unwrap_or(self.dt);
        self.check_length(dt, command.tau)?;
        self.apply(command);
        // Two readings of a coarse clock may be equal.
        if dt == 0.0 {
            return Ok(self.status);
        }
        let h = self.stretch(dt);
        self.held.take(command, &self.position, dt, h);
        Ok(self.tick(dt, h))
    }

    /// Whether the movement goes on.
    pub fn status(&self) -> Status {
        self.status
    }

    /// The model that is run.
    pub fn primitive(&self) -> &Arc<Primitive> {
        &self.primitive
    }

    /// Length of a tick given at the start, in seconds.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Seconds since the start.
    pub fn time(&self) -> f64 {
        self.time.value()
    }

    /// Phase: x in (0, 1] where discrete, φ in [0, 2π) where rhythmic.
    pub fn phase(&self) -> f64 {
        self.primitive.canonical().phase(self.clock.value())
    }

    /// Position y (D,), in the unit of each DoF.
    pub fn position(&self) -> &[f64] {
        unpack(&self.position, self.primitive.n_dofs())
    }

    /// Velocity ẏ (D,), per second.
    pub fn velocity(&self) -> &[f64] {
        unpack(&self.velocity, self.primitive.n_dofs())
    }

    /// Acceleration ÿ (D,), per second squared.
    pub fn acceleration(&self) -> &[f64] {
        unpack(&self.acceleration, self.primitive.n_dofs())
    }

    /// Style commanded (J,).
    pub fn style(&self) -> &[f64] {
        &self.conditions.style
    }

    /// Goal or anchor commanded (D,).
    pub fn centre(&self) -> &[f64] {
        &self.conditions.centre
    }

    /// Time constant commanded, in seconds.
    pub fn tau(&self) -> f64 {
        self.conditions.tau
    }

    /// Speed commanded: share of the rate 1/τ at which the path is followed.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Gains k_s and k_t of a measured position.
    pub fn compliance(&self) -> (f64, f64) {
        self.held.compliance()
    }

    /// Amplitude r₀ commanded; 1 where discrete.
    pub fn amplitude(&self) -> f64 {
        self.conditions.amplitude
    }
}
