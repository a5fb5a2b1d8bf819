//! The real-time loop: one step of the primitive per tick, with every command open to change.
//!
//! Over a tick the forcing w, the goal and the clock are known at both ends with their slopes; a cubic between them is
//! propagated exactly ([`crate::Attractor::propagator`]). Style, rate ρ = 1/τ and goal or anchor pass critically damped
//! filters, so that position and velocity stay continuous: ẏ = ρ(z + w), ÿ = ρ²(z′ + w′) + ρ̇(z + w). A perturbation
//! ([`Command::measured`], [`Command::coupling`]) slows the phase's clock against the output system's, and adds to ẏ and ÿ.
//!
//! Nothing in [`Controller::update`] or in a setter allocates, locks or panics.

mod commands;

use std::sync::Arc;

use crate::attractor::{Attractor, Jet, Propagator, State};
use crate::command::{Command, Motion};
use crate::error::{Error, Result, check_positive};
use crate::follower::Follower;
use crate::model::{Complete, Conditions, Model, blend};
use crate::perturbation::{Held, Push};
use crate::phase::{Canonical, Kind, amplitude};

/// A tick is divided so that the clock moves by no more than this share of the movement at once.
const FINEST: f64 = 1.0 / 500.0;
/// Most pieces of a tick; a longer one is still stable, only less exact.
const MOST_PIECES: f64 = 1000.0;
/// Longest tick, in units of τ.
const LONGEST_TICK: f64 = 1000.0;
/// A movement has settled within this share of its range.
const SETTLED: f64 = 1e-3;

/// Whether a movement goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The movement goes on; a rhythmic one always does.
    Working,
    /// The demonstrated time is over, and position and velocity have settled on the goal.
    Finished,
}

/// Distance at which a way from `position` to `centre` counts as gone, not below what rounding leaves.
fn reach_tolerance(centre: f64, position: f64) -> f64 {
    (SETTLED * (centre - position).abs()).max(8.0 * f64::EPSILON * centre.abs().max(position.abs()))
}

/// What drives one degree of freedom.
#[derive(Clone, Copy, Debug, Default)]
struct Drive {
    forcing: Jet,
    /// Goal or anchor.
    centre: Jet,
}

/// A running primitive: a model, its commands and its state.
#[derive(Clone, Debug)]
pub struct Controller {
    model: Arc<Model>,
    dt: f64,
    conditions: Complete,
    started: bool,
    status: Status,
    time: f64,
    /// Clock u, or the polar phase φ in [0, 2π).
    clock: f64,
    /// Amplitude r; 1 where discrete.
    r: f64,
    style: Follower,
    rate: Follower,
    centre: Follower,
    /// Basis w (J·D) and its slope at the clock.
    basis: Vec<f64>,
    basis_slope: Vec<f64>,
    z: Vec<f64>,
    /// Forcing and centre at the start of the stretch at work (D,).
    from: Vec<Drive>,
    propagator: Propagator,
    held: Held,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Distance from the goal at which each DoF has settled (D,).
    tolerance: Vec<f64>,
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
        let (n_dofs, n_outputs) = (model.n_dofs(), model.landscape().n_outputs());
        let mut controller = Self {
            dt,
            started: false,
            status: Status::Working,
            time: 0.0,
            clock: 0.0,
            r: 1.0,
            style: Follower::new(&conditions.style, transition),
            rate: Follower::new(&[1.0 / conditions.tau], transition),
            centre: Follower::new(&conditions.centre, transition),
            basis: vec![0.0; n_outputs],
            basis_slope: vec![0.0; n_outputs],
            z: vec![0.0; n_dofs],
            from: vec![Drive::default(); n_dofs],
            propagator: model.attractor().propagator(dt / conditions.tau),
            held: Held::new(model.ranges(), model.canonical().extent()),
            position: vec![0.0; n_dofs],
            velocity: vec![0.0; n_dofs],
            acceleration: vec![0.0; n_dofs],
            tolerance: vec![0.0; n_dofs],
            conditions,
            model,
        };
        controller.begin();
        Ok(controller)
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
        let Self { model, conditions, .. } = self;
        let n_dofs = model.n_dofs();
        self.started = false;
        self.status = Status::Working;
        self.held.release();
        (self.time, self.clock) = (0.0, 0.0);
        self.r = conditions.amplitude;
        self.style.jump(&conditions.style);
        self.rate.jump(&[1.0 / conditions.tau]);
        self.centre.jump(&conditions.centre);
        model.landscape().evaluate(0.0, &mut self.basis, &mut self.basis_slope);
        let widest = model.ranges().iter().fold(0.0f64, |widest, range| widest.max(*range));
        for d in 0..n_dofs {
            let centre = conditions.centre[d];
            // From rest in z, or on the limit cycle of this style.
            let (mut e, mut z) = (0.0, 0.0);
            for (j, s) in conditions.style.iter().enumerate().filter(|_| !model.cycle.is_empty()) {
                let cycle = model.cycle[j * n_dofs + d];
                e += self.r * s * cycle.e;
                z += self.r * s * cycle.z;
            }
            if let Some(velocity) = &conditions.velocity {
                z = conditions.tau * velocity[d] - self.r * blend(&conditions.style, &self.basis, n_dofs, d);
            }
            self.position[d] = conditions.start.as_ref().map_or(centre + e, |start| start[d]);
            self.z[d] = z;
            let range = model.ranges()[d].max(1e-6 * widest);
            self.tolerance[d] = (SETTLED * range).max(reach_tolerance(centre, self.position[d]));
        }
        self.read_out();
    }

    /// One tick of the length given at the start, with nothing new commanded.
    ///
    /// # Errors
    /// A tick longer than 1000 τ; the state then stays as it was.
    pub fn step(&mut self) -> Result<Status> {
        self.tick(&Command::default())
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
    /// that is not positive or longer than 1000 τ.
    pub fn update(&mut self, command: &Command, motion: &mut Motion) -> Result<Status> {
        motion.check(self.z.len())?;
        let status = self.tick(command)?;
        motion.position.copy_from_slice(&self.position);
        motion.velocity.copy_from_slice(&self.velocity);
        motion.acceleration.copy_from_slice(&self.acceleration);
        Ok(status)
    }

    fn tick(&mut self, command: &Command) -> Result<Status> {
        command.check(&self.model)?;
        let dt = command.dt.unwrap_or(self.dt);
        let rate = self.rate.value()[0].max(1.0 / command.tau.unwrap_or(self.conditions.tau));
        if dt * rate > LONGEST_TICK {
            return Err(Error::Range { name: "dt", value: dt, allowed: "must not exceed 1000 tau" });
        }
        self.obey(command);
        let h = self.rate.integral(dt);
        self.held.take(command, &self.position, dt, h);
        self.started = true;
        // A tick of just the finest length is not divided for a rounding error.
        let pieces = (h / (FINEST * self.model.canonical().extent()) - 1e-9).ceil().clamp(1.0, MOST_PIECES);
        for _ in 0..pieces as u32 {
            self.piece(dt / pieces);
        }
        self.time += dt;
        self.read_out();
        // What has settled stays settled, unless it is pushed or commanded.
        if self.status == Status::Working || self.held.push().is_some() {
            self.status = self.settled();
        }
        Ok(self.status)
    }

    /// Moves on by `dt` seconds, stopping at the demonstrated end, where the forcing has a kink.
    fn piece(&mut self, dt: f64) {
        let Canonical::Discrete { u_end, .. } = self.model.canonical() else {
            return self.advance(dt);
        };
        let pace = self.held.pace();
        let (left, h) = (u_end - self.clock, pace * self.rate.integral(dt));
        if left <= 0.0 || left >= h {
            return self.advance(dt);
        }
        let before = self.rate.time_to(left / pace, dt);
        // What rounding left of a tick that should have ended here is not worth a piece of its own.
        if left > 1e-9 * h {
            self.advance(before);
        }
        self.clock = u_end;
        self.model.landscape().evaluate(u_end, &mut self.basis, &mut self.basis_slope);
        self.advance(dt - before);
    }

    fn advance(&mut self, dt: f64) {
        let (h, pace) = (self.rate.integral(dt), self.held.pace());
        if h <= 0.0 {
            return;
        }
        let moving = !self.centre.settled();
        let canonical = self.model.canonical();
        let demonstrated = canonical.kind() == Kind::Discrete && self.clock < canonical.extent();
        let levers = self.held.push().map(|_| self.levers());
        for d in 0..self.z.len() {
            self.from[d] = self.drive(d);
        }
        self.style.advance(dt);
        self.rate.advance(dt);
        self.centre.advance(dt);
        match canonical {
            Canonical::Discrete { .. } => {
                self.clock += pace * h;
                let landscape = self.model.landscape();
                // At u_end itself the slope of the demonstrated side belongs to this piece.
                if demonstrated {
                    landscape.read(self.clock, &mut self.basis, &mut self.basis_slope);
                } else {
                    landscape.evaluate(self.clock, &mut self.basis, &mut self.basis_slope);
                }
            }
            Canonical::Rhythmic { mu } => {
                self.clock = canonical.phase(self.clock + pace * h);
                self.r = amplitude(mu, self.r, self.conditions.amplitude, h);
                self.model.landscape().evaluate(self.clock, &mut self.basis, &mut self.basis_slope);
            }
        }
        if h != self.propagator.step() {
            self.propagator = self.model.attractor().propagator(h);
        }
        for d in 0..self.z.len() {
            let (from, to) = (self.from[d], self.drive(d));
            let origin = from.centre.value;
            let state = State { e: self.position[d] - origin, z: self.z[d] };
            let mut next = self.propagator.advance(state, [from.forcing, to.forcing]);
            if moving {
                let relative = |jet: Jet| Jet { value: jet.value - origin, ..jet };
                let moved = self.propagator.follow([relative(from.centre), relative(to.centre)]);
                next.e += moved.e;
                next.z += moved.z;
            }
            self.position[d] = origin + next.e;
            self.z[d] = next.z;
        }
        // From the end on the forcing has the slope of its other side.
        if demonstrated && self.clock >= canonical.extent() {
            self.model.landscape().evaluate(self.clock, &mut self.basis, &mut self.basis_slope);
        }
        // The system is linear: what a perturbation does comes on top.
        if let (Some(from), Some(push)) = (levers, self.held.push()) {
            let to = self.levers();
            let by_velocity = self.propagator.advance(State::default(), [from[0], to[0]]);
            let by_acceleration = self.propagator.follow([from[1], to[1]]);
            for (d, Push { velocity, acceleration }) in push.iter().enumerate() {
                self.position[d] += by_velocity.e * velocity + by_acceleration.e * acceleration;
                self.z[d] += by_velocity.z * velocity + by_acceleration.z * acceleration;
            }
        }
    }

    /// What drives one DoF now, with slopes with respect to the clock.
    fn drive(&self, d: usize) -> Drive {
        let slope = self.centre.rate()[d] / self.rate.value()[0];
        Drive { forcing: self.force(d), centre: Jet { value: self.centre.value()[d], slope } }
    }

    /// What a unit of c_v adds to the forcing, τ, and a unit of c_a to the centre: τ²/(α_zβ_z), for that is how far the
    /// centre must move to add τ² to the row of Eq. (1).
    fn levers(&self) -> [Jet; 2] {
        let Attractor { alpha_z, beta_z } = self.model.attractor();
        let tau = 1.0 / self.rate.value()[0];
        // dτ/du = τ·dτ/dt.
        let slope = -self.rate.rate()[0] * tau.powi(3);
        let centre = tau / (alpha_z * beta_z);
        [Jet { value: tau, slope }, Jet { value: tau * centre, slope: 2.0 * slope * centre }]
    }

    /// Forcing w of one DoF with its slope along the motion: the landscape's, the style's and the amplitude's part.
    fn force(&self, d: usize) -> Jet {
        let n_dofs = self.z.len();
        let (style, rate) = (self.style.value(), self.rate.value()[0]);
        let shape = blend(style, &self.basis, n_dofs, d);
        // The landscape is read at the phase's pace; style and amplitude keep the output system's clock.
        let mut slope = self.held.pace() * blend(style, &self.basis_slope, n_dofs, d);
        if !self.style.settled() {
            slope += blend(self.style.rate(), &self.basis, n_dofs, d) / rate;
        }
        let growth = match self.model.canonical() {
            Canonical::Discrete { .. } => 0.0,
            Canonical::Rhythmic { mu } => mu * (self.conditions.amplitude - self.r),
        };
        Jet { value: self.r * shape, slope: self.r * slope + growth * shape }
    }

    fn read_out(&mut self) {
        let (rate, change) = (self.rate.value()[0], self.rate.rate()[0]);
        let attractor = self.model.attractor();
        for d in 0..self.z.len() {
            let w = self.force(d);
            let state = State { e: self.position[d] - self.centre.value()[d], z: self.z[d] };
            let flow = state.z + w.value;
            self.velocity[d] = rate * flow;
            self.acceleration[d] = rate * rate * (attractor.z_slope(state) + w.slope) + change * flow;
        }
        for (d, push) in self.held.push().into_iter().flatten().enumerate() {
            self.velocity[d] += push.velocity;
            self.acceleration[d] += push.acceleration;
        }
    }

    /// Whether a movement is over: how far a DoF may still go is at most about |e| + 2τ|ẏ|/α_z + |w|/β_z, what is left
    /// of its way, of its speed at critical damping, and of its forcing.
    fn settled(&self) -> Status {
        let Canonical::Discrete { u_end, .. } = self.model.canonical() else {
            return Status::Working;
        };
        let Attractor { alpha_z, beta_z } = self.model.attractor();
        let tau = 1.0 / self.rate.value()[0];
        let settled = |d: usize| {
            let way = (self.position[d] - self.centre.target()[d]).abs();
            let speed = 2.0 * tau * self.velocity[d].abs() / alpha_z;
            way + speed + self.force(d).value.abs() / beta_z <= self.tolerance[d]
        };
        let over = self.clock >= u_end && (0..self.z.len()).all(settled);
        if over { Status::Finished } else { Status::Working }
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
        self.time
    }

    /// Phase: x in (0, 1] where discrete, φ in [0, 2π) where rhythmic.
    pub fn phase(&self) -> f64 {
        self.model.canonical().phase(self.clock)
    }

    /// Position y (D,), in the unit of each DoF.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Velocity ẏ (D,), per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Acceleration ÿ (D,), per second squared.
    pub fn acceleration(&self) -> &[f64] {
        &self.acceleration
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
