//! Random settings of a case: its ticks, its commands, and its limits.

use std::sync::Arc;

use pdmp_core::motion::Limits;
use pdmp_core::{Conditions, Controller, Kind, Model};

use super::random::Random;

/// Shortest and longest tick, in seconds.
pub(crate) const TICKS: [f64; 2] = [1e-6, 0.1];

/// Lengths of the ticks of a case.
#[derive(Clone, Copy, Debug)]
enum TickMode {
    /// 1 ms.
    Usual,
    /// One length for all.
    Constant(f64),
    /// Any length from the shortest to a longest one.
    Varying(f64),
    /// The shortest, and at random the longest.
    Extreme,
}

/// Quantities that a case limits.
const LIMITED: [[bool; 3]; 8] = [
    [true, true, true],
    [true, true, true],
    [true, true, true],
    [true, false, true],
    [false, true, true],
    [true, true, false],
    [true, false, false],
    [false, true, false],
];

/// Share of synchronous cases, which look ahead along the path at every command.
const SYNCHRONOUS: f64 = 0.02;

/// Disturbance of every tick of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Push {
    None,
    /// Coupling accelerations of random sign.
    Random,
    /// Coupling accelerations and velocities towards one limit, until the sign changes.
    Steady,
    /// Positions measured anywhere.
    Measured,
}

/// Settings of a case.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) model: Arc<Model>,
    tick_mode: TickMode,
    /// Limited quantities: position, velocity, acceleration.
    limited: [bool; 3],
    /// Looseness of the limits: 0 is tight, 1 is loose.
    looseness: f64,
    /// Probability of a limit of one DoF that is left out.
    left_out: f64,
    /// Probability of each command in a tick.
    pub(crate) rarity: f64,
    /// Probability of new limits before a tick.
    pub(crate) online: f64,
    /// Size of goals and perturbations, relative to the range.
    pub(crate) size: f64,
    pub(crate) push: Push,
    /// True if a limit of the acceleration comes with one of the jerk.
    jerk: bool,
    /// True if limits slow all DoFs along the path.
    synchronous: bool,
}

impl Settings {
    pub(crate) fn new(model: &Arc<Model>, random: &mut Random) -> Self {
        let tick_mode = match random.index(8) {
            0 | 1 => TickMode::Usual,
            2 | 3 => TickMode::Constant(random.scale(TICKS[0], TICKS[1])),
            4 => TickMode::Extreme,
            _ => TickMode::Varying(*random.choose(&[TICKS[1], 0.01, 0.01])),
        };
        let push = *random.choose(&[Push::None, Push::None, Push::Random, Push::Steady, Push::Measured]);
        Self {
            model: Arc::clone(model),
            tick_mode,
            limited: *random.choose(&LIMITED),
            looseness: random.next(),
            left_out: if random.chance(0.3) { 0.3 } else { 0.0 },
            rarity: random.scale(1e-3, 0.5),
            online: if random.chance(0.5) { random.scale(1e-3, 0.1) } else { 0.0 },
            size: random.scale(0.03, 1000.0),
            push,
            jerk: random.chance(0.3),
            synchronous: random.chance(SYNCHRONOUS),
        }
    }

    pub(crate) fn is_discrete(&self) -> bool {
        self.model.kind() == Kind::Discrete
    }

    /// Returns the range of a DoF, of a stationary one the largest of the others or 1.
    pub(crate) fn range(&self, dof: usize) -> f64 {
        let ranges = self.model.ranges();
        let largest = ranges.iter().copied().fold(0.0, f64::max);
        if ranges[dof] > 1e-6 * largest {
            ranges[dof]
        } else if largest > 0.0 {
            largest
        } else {
            1.0
        }
    }

    pub(crate) fn tick(&self, random: &mut Random) -> f64 {
        match self.tick_mode {
            TickMode::Usual => 1e-3,
            TickMode::Constant(dt) => dt,
            TickMode::Varying(longest) => random.scale(TICKS[0], longest),
            TickMode::Extreme => TICKS[usize::from(random.chance(0.1))],
        }
    }

    /// Returns the default length of a tick of the controller: the longest, for which the limits are checked.
    fn nominal_tick(&self) -> f64 {
        match self.tick_mode {
            TickMode::Usual => 1e-3,
            TickMode::Constant(dt) | TickMode::Varying(dt) => dt,
            TickMode::Extreme => TICKS[1],
        }
    }

    /// Returns a controller at the start.
    pub(crate) fn controller(&self, random: &mut Random) -> Controller {
        let (dt, conditions, transition) = (self.nominal_tick(), self.start(random), self.transition(random));
        Controller::new(self.model.primitive(), dt, &conditions, transition).expect("valid conditions")
    }

    fn transition(&self, random: &mut Random) -> Option<f64> {
        match random.index(4) {
            0 => Some(0.0),
            1 => Some(self.model.duration() * random.scale(0.01, 1.0)),
            _ => None,
        }
    }

    /// Returns a vector of positions around `centre`.
    pub(crate) fn around(&self, centre: &[f64], size: f64, random: &mut Random, vector: &mut [f64]) {
        for (dof, (value, centre)) in vector.iter_mut().zip(centre).enumerate() {
            *value = centre + self.range(dof) * size * random.between(-1.0, 1.0);
        }
    }

    /// Returns random conditions at the start.
    pub(crate) fn start(&self, random: &mut Random) -> Conditions {
        let n_dofs = self.model.n_dofs();
        let demonstrated = self.model.demonstrated();
        let mut around = |centre: &[f64], size: f64| {
            let mut vector = vec![0.0; n_dofs];
            self.around(centre, size, random, &mut vector);
            vector
        };
        let zeros = vec![0.0; n_dofs];
        let centre = if self.is_discrete() { demonstrated.goals.row(0) } else { demonstrated.anchors.row(0) }.to_vec();
        let centre = around(&centre, 0.5);
        let start = around(&demonstrated.starts.row(0).to_vec(), 0.5);
        let mut velocity = around(&zeros, 1.0);
        velocity.iter_mut().for_each(|v| *v /= self.model.duration());
        let discrete = self.is_discrete();
        let with_goal = random.chance(0.5);
        Conditions {
            style: random.chance(0.5).then(|| (0..self.model.n_styles()).map(|_| random.between(-1.0, 1.0)).collect()),
            goal: (discrete && with_goal).then(|| centre.clone()),
            anchor: (!discrete && with_goal).then_some(centre),
            start: random.chance(0.3).then_some(start),
            velocity: match random.index(3) {
                0 => Some(zeros),
                1 => Some(velocity),
                _ => None,
            },
            amplitude: (!discrete && random.chance(0.3)).then(|| random.scale(0.1, 10.0)),
            tau: random.chance(0.3).then(|| self.model.tau() * random.scale(0.1, 10.0)),
            phase: (!discrete && random.chance(0.3)).then(|| random.between(0.0, 6.0)),
            ..Conditions::default()
        }
    }

    /// Returns random limits, mostly around the present position.
    pub(crate) fn limits(&self, controller: &Controller, random: &mut Random) -> Limits {
        let n_dofs = self.model.n_dofs();
        let looseness = (self.looseness + random.between(-0.2, 0.2)).clamp(0.0, 1.0);
        // A number between tight and loose, on a logarithmic scale.
        let size = |tight: f64, loose: f64, random: &mut Random| {
            tight * (loose / tight).powf((looseness + random.between(-0.3, 0.3)).clamp(0.0, 1.0))
        };
        let outside = random.chance(0.15);
        let (mut lower, mut upper) = (vec![0.0; n_dofs], vec![0.0; n_dofs]);
        let [mut velocity, mut acceleration, mut jerk] = [(); 3].map(|()| vec![0.0; n_dofs]);
        for dof in 0..n_dofs {
            let range = self.range(dof);
            // Positions have at least twelve digits within the limits.
            let width = (range * size(0.02, 10.0, random)).max(1e-3 * controller.position()[dof].abs());
            // The share of the width below the present position is outside [0, 1] where this is outside the limits.
            let share = if outside && random.chance(0.5) { random.between(-1.0, 2.0) } else { random.next() };
            lower[dof] = controller.position()[dof] - share * width;
            upper[dof] = lower[dof] + width;
            velocity[dof] = range / self.model.duration() * size(0.02, 30.0, random);
            acceleration[dof] = range / self.model.duration().powi(2) * size(0.1, 1000.0, random);
            let mut none = |limit: &mut f64, value: f64| {
                if random.chance(self.left_out) {
                    *limit = value;
                }
            };
            none(&mut lower[dof], f64::NEG_INFINITY);
            none(&mut upper[dof], f64::INFINITY);
            none(&mut velocity[dof], f64::INFINITY);
            none(&mut acceleration[dof], f64::INFINITY);
            jerk[dof] = acceleration[dof] / (self.model.duration() * random.scale(1e-4, 1.0));
        }
        let [position, has_velocity, has_acceleration] = self.limited;
        let mut limits = Limits {
            lower: position.then_some(lower),
            upper: position.then_some(upper),
            velocity: has_velocity.then_some(velocity),
            synchronous: self.synchronous,
            ..Limits::default()
        };
        limits.acceleration = has_acceleration.then_some(acceleration);
        limits.jerk = (has_acceleration && self.jerk).then_some(jerk);
        limits
    }
}
