//! Random commands, perturbations, limits and ticks.

use pdmp_core::motion::{Compliance, Coupling, Limits};
use pdmp_core::{Command, Controller};

use super::random::Random;
use super::settings::{Push, Settings};

/// Sees everything that happens to a controller.
pub(crate) trait Observer {
    /// New limits are in force.
    fn limited(&mut self, controller: &Controller, limits: &Limits);
    /// The movement has begun again.
    fn restarted(&mut self, controller: &Controller);
    /// The named command without a tick has been given.
    fn called(&mut self, controller: &Controller, command: &'static str);
    /// A tick of `dt` seconds has passed.
    fn ticked(&mut self, controller: &Controller, dt: f64);
}

/// Counts of what was tried and accepted.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) commands: usize,
    pub(crate) limits: usize,
    pub(crate) refused_limits: usize,
    pub(crate) refused_ticks: usize,
    pub(crate) restarts: usize,
    /// Snapshots that are rejected.
    pub(crate) lost: usize,
}

/// Commands of a case.
pub(crate) struct Attack {
    pub(crate) settings: Settings,
    random: Random,
    pub(crate) tally: Tally,
    /// False for a control of the oracle: the controller then does not get the limits by which it is judged.
    pub(crate) sets_limits: bool,
    sign: f64,
    vectors: [Vec<f64>; 5],
    style: Vec<f64>,
}

impl Attack {
    pub(crate) fn new(settings: Settings, random: Random) -> Self {
        let n_dofs = settings.model.n_dofs();
        let style = vec![0.0; settings.model.n_styles()];
        Self {
            settings,
            random,
            tally: Tally::default(),
            sets_limits: true,
            sign: 1.0,
            vectors: [(); 5].map(|()| vec![0.0; n_dofs]),
            style,
        }
    }

    /// Sets new limits, less tight ones where a tick is too long for them.
    pub(crate) fn limit(&mut self, controller: &mut Controller, observer: &mut impl Observer) {
        for attempt in 0..20 {
            let mut limits = self.settings.limits(controller, &mut self.random);
            if attempt > 10 {
                limits.acceleration = None;
                limits.jerk = None;
            }
            if self.random.chance(0.05) {
                limits = Limits::default();
            }
            self.tally.limits += 1;
            if !self.sets_limits || controller.set_limits(&limits).is_ok() {
                observer.limited(controller, &limits);
                // Before the first tick the movement begins again.
                return self.after_call(controller, "set_limits", observer);
            }
            self.tally.refused_limits += 1;
        }
    }

    /// Gives commands that take no time.
    pub(crate) fn between_ticks(&mut self, controller: &mut Controller, observer: &mut impl Observer) {
        let (online, rarity) = (self.settings.online, 0.2 * self.settings.rarity);
        if self.random.chance(online) {
            self.limit(controller, observer);
        }
        if self.random.chance(rarity) {
            controller.release();
            self.after_call(controller, "release", observer);
        }
        if self.random.chance(rarity) {
            let speed = *self.random.choose(&[0.0, 0.0, 1.0, 1.0, 0.3, 3.0]);
            controller.set_speed(speed).expect("a valid speed");
            self.after_call(controller, "set_speed", observer);
        }
        if !self.settings.is_discrete() && self.random.chance(rarity) {
            controller.set_phase(self.random.between(0.0, 6.3)).expect("a valid phase");
            controller.set_phase_gain(self.random.scale(0.01, 100.0)).expect("a valid gain");
            self.after_call(controller, "set_phase", observer);
        }
        if self.random.chance(rarity) {
            let compliance =
                Compliance { stopping: self.random.scale(0.1, 1e5), tracking: self.random.scale(0.01, 1e3) };
            controller.set_compliance(compliance).expect("valid gains");
            self.after_call(controller, "set_compliance", observer);
        }
        if self.random.chance(0.02 * rarity) {
            match Controller::restore(self.settings.model.primitive(), &controller.snapshot()) {
                Ok(restored) => *controller = restored,
                Err(_) => self.tally.lost += 1,
            }
            self.after_call(controller, "restore", observer);
        }
        if self.random.chance(0.02 * rarity) {
            let conditions = self.settings.start(&mut self.random);
            controller.reset(&conditions).expect("valid conditions");
            self.tally.restarts += 1;
            observer.restarted(controller);
        }
    }

    fn after_call(&mut self, controller: &Controller, command: &'static str, observer: &mut impl Observer) {
        self.tally.commands += 1;
        if controller.time() == 0.0 { observer.restarted(controller) } else { observer.called(controller, command) }
    }

    /// Performs a tick under random commands.
    pub(crate) fn tick(&mut self, controller: &mut Controller, observer: &mut impl Observer) {
        let Self { settings, random, tally, vectors, style, .. } = self;
        // A command before the first tick restarts the movement, which is seen in a tick without length.
        let starts = controller.time() == 0.0;
        let dt = if starts || random.chance(1e-3) { 0.0 } else { settings.tick(random) };
        let rarity = settings.rarity;
        let [centre, goal_velocity, measured, velocity, acceleration] = vectors;
        let discrete = settings.is_discrete();
        let mut command = Command { dt: Some(dt), ..Command::default() };
        if random.chance(rarity) {
            settings.around(controller.centre(), settings.size, random, centre);
            if discrete {
                command.goal = Some(centre);
            } else {
                command.anchor = Some(centre);
            }
        }
        let duration = settings.model.duration();
        let has_frame = discrete && settings.model.primitive().transport(0.0).is_ok_and(|share| share == 0.0);
        if has_frame && random.chance(0.3 * rarity) {
            for (dof, value) in goal_velocity.iter_mut().enumerate() {
                *value = settings.range(dof) / duration * random.between(-3.0, 3.0);
            }
            command.goal_velocity = Some(goal_velocity);
        }
        if random.chance(rarity) {
            style.iter_mut().for_each(|s| *s = random.between(-2.0, 2.0));
            command.style = Some(style);
        }
        if random.chance(0.3 * rarity) {
            command.tau = Some(settings.model.tau() * random.scale(0.05, 20.0));
        }
        if !discrete && random.chance(rarity) {
            command.amplitude = Some(random.between(0.0, 5.0));
        }
        if !discrete && random.chance(rarity) {
            command.phase = Some(random.between(0.0, 6.3));
        }
        if settings.push == Push::Measured || random.chance(0.3 * rarity) {
            settings.around(controller.position(), settings.size.min(10.0), random, measured);
            command.measured = Some(measured);
        }
        if random.chance(0.02) {
            self.sign = -self.sign;
        }
        let pushed = matches!(settings.push, Push::Random | Push::Steady);
        if pushed || random.chance(0.3 * rarity) {
            for dof in 0..settings.model.n_dofs() {
                let sign = if settings.push == Push::Steady { self.sign } else { random.between(-1.0, 1.0) };
                let speed = settings.range(dof) / duration * settings.size;
                velocity[dof] = if random.chance(0.5) { sign * speed } else { 0.0 };
                acceleration[dof] = sign * 100.0 * speed / duration;
            }
            command.coupling = Some(Coupling { velocity, acceleration });
        }
        tally.commands += usize::from(command.goal.or(command.anchor).is_some())
            + usize::from(command.goal_velocity.is_some())
            + usize::from(command.style.is_some())
            + usize::from(command.tau.or(command.amplitude).or(command.phase).is_some())
            + usize::from(command.measured.is_some())
            + usize::from(command.coupling.is_some());
        match controller.step_with(&command) {
            Ok(_) if starts => {
                observer.restarted(controller);
                self.free_tick(controller, observer);
            }
            Ok(_) if dt == 0.0 => observer.called(controller, "tick without length"),
            Ok(_) => observer.ticked(controller, dt),
            Err(_) => self.tally.refused_ticks += 1,
        }
    }

    /// Performs a tick without command.
    fn free_tick(&mut self, controller: &mut Controller, observer: &mut impl Observer) {
        let dt = self.settings.tick(&mut self.random);
        match controller.step_with(&Command { dt: Some(dt), ..Command::default() }) {
            Ok(_) => observer.ticked(controller, dt),
            Err(_) => self.tally.refused_ticks += 1,
        }
    }
}
