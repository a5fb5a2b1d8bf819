//! Movements within limits that do not bind.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use pdmp_core::motion::Limits;
use pdmp_core::{Controller, Error, Model};

use super::attack::{Attack, Observer};
use super::random::Random;
use super::report::parallel;
use super::settings::Settings;

/// Shares by which limits exceed the extremes of the motion.
const MARGINS: [f64; 4] = [1e-9, 1e-3, 1.0, 1e3];
/// Largest number of ticks of a rollout.
const MAX_TICKS: usize = 30;

/// Bits of the motion after every tick, and its extremes.
struct Recorder {
    bits: Vec<u64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Largest |ẏ| of the cubics between ticks, and of their means.
    velocity: Vec<f64>,
    /// Largest |ÿ| as published, of the cubics, and of the differences.
    acceleration: Vec<f64>,
    last: [Vec<f64>; 2],
    limited: usize,
    joint_ticks: usize,
    /// Default length of a tick.
    dt: f64,
}

impl Recorder {
    fn new(controller: &Controller) -> Self {
        let n_dofs = controller.position().len();
        let mut recorder = Self {
            bits: Vec::new(),
            lower: vec![f64::INFINITY; n_dofs],
            upper: vec![f64::NEG_INFINITY; n_dofs],
            velocity: vec![0.0; n_dofs],
            acceleration: vec![0.0; n_dofs],
            last: [controller.position().to_vec(), controller.velocity().to_vec()],
            limited: 0,
            joint_ticks: 0,
            dt: controller.dt(),
        };
        recorder.restarted(controller);
        recorder
    }

    /// Records the bits of the published motion.
    fn record(&mut self, controller: &Controller) {
        for vector in [controller.position(), controller.velocity(), controller.acceleration()] {
            self.bits.extend(vector.iter().map(|value| value.to_bits()));
        }
        self.bits.extend([controller.phase().to_bits(), controller.status() as u64]);
        self.limited += controller.limited().iter().flatten().count();
        self.extend(controller);
    }

    /// Extends the extremes by the present state and goal.
    fn extend(&mut self, controller: &Controller) {
        for (dof, (y, goal)) in controller.position().iter().zip(controller.centre()).enumerate() {
            self.lower[dof] = self.lower[dof].min(*y).min(*goal);
            self.upper[dof] = self.upper[dof].max(*y).max(*goal);
            self.velocity[dof] = self.velocity[dof].max(controller.velocity()[dof].abs());
            self.acceleration[dof] = self.acceleration[dof].max(controller.acceleration()[dof].abs());
        }
    }

    /// Returns limits beyond the extremes by a share of them. A DoF can brake inside from its largest velocity.
    fn limits(&self, margin: f64) -> Limits {
        let beyond = |values: &[f64]| values.iter().map(|value| (1.0 + margin) * value + f64::MIN_POSITIVE).collect();
        let (velocity, acceleration): (Vec<f64>, Vec<f64>) = (beyond(&self.velocity), beyond(&self.acceleration));
        let way = |dof: usize| {
            let size = (self.upper[dof] - self.lower[dof]).max(self.upper[dof].abs()).max(self.lower[dof].abs());
            // A DoF brakes over two ticks or more.
            let braking = velocity[dof] * velocity[dof] / (2.0 * acceleration[dof]) + 2.0 * velocity[dof] * self.dt;
            braking + margin * size + f64::MIN_POSITIVE
        };
        let mut limits = Limits {
            lower: Some((0..velocity.len()).map(|dof| self.lower[dof] - way(dof)).collect()),
            upper: Some((0..velocity.len()).map(|dof| self.upper[dof] + way(dof)).collect()),
            velocity: Some(velocity),
            // Margins of the path ahead slow the clock before a limit binds.
            synchronous: false,
            ..Limits::default()
        };
        limits.acceleration = Some(acceleration);
        limits
    }
}

impl Observer for Recorder {
    fn limited(&mut self, _: &Controller, _: &Limits) {}

    fn restarted(&mut self, controller: &Controller) {
        self.last = [controller.position().to_vec(), controller.velocity().to_vec()];
        self.record(controller);
    }

    // A command that changes the velocity without a tick exceeds any limit of the acceleration until the next tick.
    fn called(&mut self, controller: &Controller, _: &'static str) {
        self.extend(controller);
    }

    fn ticked(&mut self, controller: &Controller, dt: f64) {
        for (dof, (y, v)) in controller.position().iter().zip(controller.velocity()).enumerate() {
            let [before, speed] = [self.last[0][dof], self.last[1][dof]];
            let mean = (y - before) / dt;
            // Accelerations of the cubic at both ends, and its velocity where they change sign.
            let [start, end] = [(6.0 * mean - 4.0 * speed - 2.0 * v) / dt, (2.0 * speed + 4.0 * v - 6.0 * mean) / dt];
            let share = if start * end < 0.0 { start / (start - end) } else { 0.0 };
            let peak = speed + 0.5 * start * share * dt;
            self.velocity[dof] = self.velocity[dof].max(mean.abs()).max(peak.abs());
            let change = (v - speed).abs() / dt;
            self.acceleration[dof] = self.acceleration[dof].max(change).max(start.abs()).max(end.abs());
            let way = peak * peak / (2.0 * self.acceleration[dof]);
            self.lower[dof] = self.lower[dof].min(before - (mean.abs() + peak.abs()) * dt - way);
            self.upper[dof] = self.upper[dof].max(before + (mean.abs() + peak.abs()) * dt + way);
        }
        self.last = [controller.position().to_vec(), controller.velocity().to_vec()];
        self.joint_ticks += self.last[0].len();
        self.record(controller);
    }
}

/// Counts of rollouts.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SlackReport {
    pub(crate) rollouts: usize,
    pub(crate) joint_ticks: usize,
    pub(crate) commands: usize,
    /// Limits that were refused as too tight for a tick.
    pub(crate) refused: usize,
    /// Rollouts whose motion differs from that without limits, and joint-ticks named as limited.
    pub(crate) changed: usize,
    pub(crate) limited: usize,
    pub(crate) first_changed: Option<u64>,
}

impl SlackReport {
    /// Runs rollouts from a seed on, on all processors, until the given number is reached.
    pub(crate) fn run(models: &[Arc<Model>], first_seed: u64, rollouts: usize) -> Self {
        let done = AtomicUsize::new(0);
        let run = |seed: u64, report: &mut Self| {
            let before = report.rollouts;
            report.add(models, seed);
            done.fetch_add(report.rollouts - before, Ordering::Relaxed) < rollouts
        };
        parallel(first_seed, run, Self::merge)
    }

    fn merge(&mut self, other: Self) {
        self.rollouts += other.rollouts;
        self.joint_ticks += other.joint_ticks;
        self.commands += other.commands;
        self.refused += other.refused;
        self.changed += other.changed;
        self.limited += other.limited;
        self.first_changed = self.first_changed.or(other.first_changed);
    }

    /// Adds the rollout of a seed.
    fn add(&mut self, models: &[Arc<Model>], seed: u64) {
        let mut random = Random::new(seed);
        let model = random.choose(models);
        let mut settings = Settings::new(model, &mut random);
        settings.online = 0.0;
        let start = settings.controller(&mut random);
        let n_ticks = 1 + random.index(MAX_TICKS);
        let margin = *random.choose(&MARGINS);
        let seeded = random.clone();
        let attack = || Attack::new(settings.clone(), seeded.clone());
        // Limits are in force from the start, or from some tick on.
        let since = if random.chance(0.5) { 0 } else { random.index(n_ticks) };
        let run = |mut controller: Controller, mut attack: Attack, limits: Option<&Limits>| {
            let mut recorder = Recorder::new(&controller);
            for tick in 0..n_ticks {
                if tick == since
                    && let Some(limits) = limits
                {
                    controller.set_limits(limits)?;
                }
                attack.between_ticks(&mut controller, &mut recorder);
                attack.tick(&mut controller, &mut recorder);
            }
            Ok::<_, Error>((recorder, attack.tally.commands))
        };
        let (free, commands) = run(start.clone(), attack(), None).expect("valid commands");
        let Ok((limited, _)) = run(start, attack(), Some(&free.limits(margin))) else {
            self.refused += 1;
            return;
        };
        self.rollouts += 1;
        self.joint_ticks += limited.joint_ticks;
        self.commands += commands;
        self.limited += limited.limited;
        if free.bits != limited.bits {
            self.changed += 1;
            self.first_changed = self.first_changed.or(Some(seed));
        }
    }

    /// Returns true if no rollout changed.
    pub(crate) fn holds(&self) -> bool {
        (self.changed, self.limited) == (0, 0)
    }

    pub(crate) fn print(&self) {
        let Self { rollouts, joint_ticks, commands, refused, changed, limited, first_changed } = self;
        println!("{rollouts} rollouts within limits that do not bind, {joint_ticks} joint-ticks, {commands} commands");
        println!("{refused} limits refused as too tight for a tick");
        println!("{changed} rollouts changed {first_changed:?}, {limited} joint-ticks named as limited");
    }
}
