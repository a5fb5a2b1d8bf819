//! The real-time loop: one tick of the primitive per call, with every command open to change.
//!
//! Over a tick the forcing w, the goal and the clock are known at both ends with their slopes; a cubic between them is
//! propagated exactly ([`crate::Attractor::propagator`]). Style, rate ρ = 1/τ and goal or anchor pass critically damped
//! filters, so that position and velocity stay continuous: ẏ = ρ(z + w), ÿ = ρ²(z′ + w′) + ρ̇(z + w). A perturbation
//! ([`Command::measured`], [`Command::coupling`]) slows the phase's clock against the output system's, and adds to ẏ and
//! ÿ.
//!
//! Nothing in [`Controller::update`] or in a setter allocates, locks or panics. A tick takes O(J·D), whatever the model was
//! learnt from: once if it is shorter than a 500th of the movement and than a 95th of a transition under way, and as many
//! times as it is longer otherwise, a thousand at most.

#[cfg(target_arch = "x86_64")]
mod avx;
mod commands;
mod tick;

use std::sync::Arc;

use crate::attractor::{Jet, Propagator, State};
use crate::command::{Command, Motion};
use crate::conditions::{Complete, Conditions};
use crate::error::{Error, Result, check_positive};
use crate::follower::{Filter, Follower, Glide};
use crate::lanes::{Lanes, copy, groups, repack, unpack};
use crate::model::Model;
use crate::perturbation::{Held, STILL, widest};
use crate::phase::{CompensatedSum, Kind};
use crate::series::Series;
use tick::Forcing;

/// A tick is divided so that the clock moves by no more than this share of the movement at once.
const FINEST: f64 = 1.0 / 500.0;
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
    model: Arc<Model>,
    dt: f64,
    conditions: Complete,
    started: bool,
    status: Status,
    time: CompensatedSum,
    /// Clock u, or the polar phase φ in [0, 2π).
    clock: CompensatedSum,
    /// Amplitude r; 1 where discrete.
    r: f64,
    filter: Filter,
    style: Follower,
    /// ρ = 1/τ.
    rate: Follower,
    /// Goal or anchor.
    centre: Follower,
    /// By groups of DoFs, as all that follows.
    forcing: Vec<Forcing>,
    /// Forcing at the start of the stretch at work, taken before anything moves: kept as numbers for the loop over the
    /// groups, it would not stay in registers.
    from: Vec<Jet<Lanes>>,
    z: Vec<Lanes>,
    position: Vec<Lanes>,
    velocity: Vec<Lanes>,
    acceleration: Vec<Lanes>,
    /// Distance from the goal at which each DoF has settled.
    tolerance: Vec<Lanes>,
    /// Far below the last digit of every movement.
    rest: f64,
    held: Held,
    /// A stretch of the clock that is not divided.
    finest: f64,
    /// Of the last tick, and good for the next if it is as long.
    glide: Glide,
    propagator: Propagator,
    series: Series,
    /// Ticks from now for which the landscape is fetched.
    lead: f64,
}

impl Controller {
    /// Starts a movement.
    ///
    /// `dt` is the length of a tick and `transition` the time to 99 % of a changed style, τ, goal or anchor, both in
    /// seconds; 0 is the paper's immediate switch, and without it a tenth of the nominal duration (discrete) or a
    /// quarter of the nominal period (rhythmic) serves.
    ///
    /// # Errors
    /// Conditions that do not fit the model, `dt` that is not positive, or a negative `transition`.
    pub fn new(model: Arc<Model>, dt: f64, conditions: &Conditions, transition: Option<f64>) -> Result<Self> {
        check_positive("dt", dt)?;
        let share = if model.kind() == Kind::Discrete { 0.1 } else { 0.25 };
        let transition = transition.unwrap_or(share * model.duration());
        if !(0.0..=1e6 * model.duration()).contains(&transition) {
            let allowed = "must lie between 0, an immediate switch, and a million durations";
            return Err(Error::Range { name: "transition", value: transition, allowed });
        }
        let conditions = conditions.complete(&model)?;
        let (filter, zeros) = (Filter::new(transition), vec![Lanes::ZERO; groups(model.n_dofs())]);
        // A tick of just this length is not divided for a rounding error.
        let finest = FINEST * model.canonical().extent() * (1.0 + 1e-9);
        let series = Series::new(model.attractor(), finest);
        let mut controller = Self {
            dt,
            started: false,
            status: Status::Working,
            time: CompensatedSum::default(),
            clock: CompensatedSum::default(),
            r: 1.0,
            filter,
            style: Follower::new(&conditions.style),
            rate: Follower::new(&[1.0 / conditions.tau]),
            centre: Follower::new(&conditions.centre),
            forcing: vec![Forcing::default(); zeros.len()],
            from: vec![Jet::default(); zeros.len()],
            z: zeros.clone(),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros.clone(),
            tolerance: zeros,
            rest: REST * widest(model.ranges()),
            held: Held::new(model.ranges(), model.canonical().extent()),
            finest,
            glide: filter.glide(dt),
            propagator: series.propagator::<Lanes>(0.0),
            series,
            lead: 1.0,
            conditions,
            model,
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
        self.conditions = conditions.complete(&self.model)?;
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
        self.rate.jump(&[1.0 / conditions.tau]);
        self.centre.jump(&conditions.centre);
        self.read_forcing();
        self.place();
        self.set_tolerance();
        self.read_out();
    }

    /// Puts position and z where the movement starts: at rest in z, or on the limit cycle of this style.
    fn place(&mut self) {
        let Self { model, conditions, r, .. } = self;
        for (group, (position, z)) in self.position.iter_mut().zip(&mut self.z).enumerate() {
            let cycle = &model.cycle[group * model.n_styles()..];
            let on_cycle = conditions.style.iter().zip(cycle).fold(State::<Lanes>::default(), |sum, (s, cycle)| {
                State { e: sum.e + cycle.e * (*r * s), z: sum.z + cycle.z * (*r * s) }
            });
            *position = self.centre.value()[group] + on_cycle.e;
            *z = on_cycle.z;
        }
        if let Some(start) = &conditions.start {
            repack(&mut self.position, start);
        }
        if let Some(velocity) = &conditions.velocity {
            repack(&mut self.z, velocity);
            for (z, forcing) in self.z.iter_mut().zip(&self.forcing) {
                *z = *z * conditions.tau - forcing.shape * *r;
            }
        }
    }

    /// Sets the distances at which the way from here to the goal counts as gone, not below what rounding leaves of it.
    pub(super) fn set_tolerance(&mut self) {
        let ranges = self.model.ranges();
        let least = Lanes::splat(STILL * widest(ranges));
        repack(&mut self.tolerance, ranges);
        for tolerance in &mut self.tolerance {
            *tolerance = tolerance.max(least) * SETTLED;
        }
        let ends = self.centre.target().iter().zip(&self.position);
        for (tolerance, (&centre, &position)) in self.tolerance.iter_mut().zip(ends) {
            let rounding = centre.abs().max(position.abs()) * (8.0 * f64::EPSILON);
            *tolerance = tolerance.max(((centre - position).abs() * SETTLED).max(rounding));
        }
    }

    /// One tick of the length given at the start, with nothing new commanded.
    ///
    /// # Errors
    /// A tick longer than 1000 τ; the state then stays as it was.
    pub fn step(&mut self) -> Result<Status> {
        self.check_length(self.dt, None)?;
        self.held.release();
        let h = self.stretch(self.dt);
        Ok(self.tick(self.dt, h))
    }

    /// One tick under a command, with the motion written where the caller wants it.
    ///
    /// What is refused is refused as a whole: no part of the command takes effect, and no time passes. A perturbation is
    /// held over the tick:
    ///
    /// ```text
    /// τẏ = z + w(u) + k_t(ỹ − y) + τc_v
    /// τż = α_z(β_z(g − y) − z) + τ²c_a
    /// τu̇ = κ = 1/(1 + k_s‖(ỹ − y)/range‖²)
    /// ```
    ///
    /// `measured` ỹ stops the phase as the robot falls behind and pulls the movement towards it, with the gains of
    /// [`Controller::set_compliance`]; `coupling` adds c_v to the velocity and c_a to the acceleration. Over the tick the
    /// pull is the velocity (1 − exp(−k_t h))/dt of the error at its start, h being the tick on the clock: however long
    /// the tick, it pulls no further than ỹ.
    ///
    /// Phase stopping and the pull: Ijspeert, Nakanishi and Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739; Schaal,
    /// Mohajerian and Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9. Terms in ż:
    /// Pastor, Hoffmann, Asfour and Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385.
    ///
    /// # Errors
    /// A vector of a wrong length, a number that is not finite, τ, amplitude or goal that a setter refuses, or a tick
    /// that is negative or longer than 1000 τ.
    pub fn update(&mut self, command: &Command, motion: &mut Motion) -> Result<Status> {
        motion.check(self.model.n_dofs())?;
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
        command.check(&self.model)?;
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
    pub fn model(&self) -> &Arc<Model> {
        &self.model
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
        self.model.canonical().phase(self.clock.value())
    }

    /// Position y (D,), in the unit of each DoF.
    pub fn position(&self) -> &[f64] {
        unpack(&self.position, self.model.n_dofs())
    }

    /// Velocity ẏ (D,), per second.
    pub fn velocity(&self) -> &[f64] {
        unpack(&self.velocity, self.model.n_dofs())
    }

    /// Acceleration ÿ (D,), per second squared.
    pub fn acceleration(&self) -> &[f64] {
        unpack(&self.acceleration, self.model.n_dofs())
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

    /// Gains k_s and k_t of a measured position.
    pub fn compliance(&self) -> (f64, f64) {
        self.held.compliance()
    }

    /// Amplitude r₀ commanded; 1 where discrete.
    pub fn amplitude(&self) -> f64 {
        self.conditions.amplitude
    }
}
