//! Control loop of a discrete primitive with given D and J, for the benches of one tick.
//!
//! The measured ticks lie in the middle of a movement; the first tick and the end are excluded.
// Each bench uses only some of the items.
#![allow(dead_code, missing_docs)]

use std::env;
use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;

use ndarray::Array2;
use pdmp_core::learning::Truncation;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::motion::Limits;
use pdmp_core::{Command, Conditions, Controller, Demonstration, FitOptions, Kind, Model, Motion, Sampling, fit};

/// Numbers of degrees of freedom D.
pub(crate) const N_DOFS: [usize; 5] = [1, 4, 7, 14, 32];
/// Numbers of style dimensions J.
pub(crate) const N_STYLES: [usize; 3] = [1, 3, 8];
/// Number of ticks between two calls of [`ControlLoop::prepare`].
pub(crate) const TICKS_PER_BATCH: usize = 100;

/// Length of a tick, in seconds.
const DT: f64 = 1e-3;
/// Length of the movement, in seconds.
const DURATION: f64 = 1.0;

/// Returns true under `cargo bench`, false under `cargo test --benches`, which only checks that the bench runs.
pub(crate) fn is_benchmark() -> bool {
    env::args().any(|argument| argument == "--bench")
}

/// Commands of the measured ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommandLoad {
    /// No commands; style, goal and τ have settled.
    Settled,
    /// No commands; style, goal and τ are in transition to earlier commands.
    InTransition,
    /// New style, goal and τ at every tick, and an output for the motion.
    Commanded,
    /// As settled, within limits that do not bind.
    Limited,
    /// As settled, along a path that limits slow down.
    Slowed,
    /// As settled, within limits of single DoFs that bind in most ticks.
    Bound,
    /// As commanded, by a governor within limits.
    Governed,
    /// As governed, along paths that limits slow down.
    GovernedSlowed,
}

impl CommandLoad {
    pub(crate) const ALL: [Self; 8] = [
        Self::Settled,
        Self::InTransition,
        Self::Commanded,
        Self::Limited,
        Self::Slowed,
        Self::Bound,
        Self::Governed,
        Self::GovernedSlowed,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::InTransition => "in transition",
            Self::Commanded => "commanded",
            Self::Limited => "within limits",
            Self::Slowed => "slowed",
            Self::Bound => "at limits",
            Self::Governed => "governed",
            Self::GovernedSlowed => "governed, slowed",
        }
    }

    /// Returns the limit of the velocity, if there are limits. Without it, the velocity of a DoF reaches twenty.
    fn max_velocity(self) -> Option<f64> {
        match self {
            Self::Settled | Self::InTransition | Self::Commanded => None,
            Self::Limited | Self::Governed => Some(1e3),
            Self::Slowed | Self::Bound | Self::GovernedSlowed => Some(2.0),
        }
    }
}

/// Commanded style, goal and τ.
struct Target {
    style: Vec<f64>,
    goal: Vec<f64>,
    tau: f64,
}

/// A controller in the middle of its movement.
pub(crate) struct ControlLoop {
    controller: Controller,
    load: CommandLoad,
    /// Commanded alternately, so that each command is a change.
    targets: [Target; 2],
    next_target: usize,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl ControlLoop {
    pub(crate) fn new(model: &Arc<Model>, load: CommandLoad) -> Self {
        let mut controller =
            Controller::new(model.primitive(), DT, &Conditions::default(), None).expect("a controller");
        if let Some(velocity) = load.max_velocity() {
            let limits = Limits {
                lower: Some(vec![-1e3]),
                upper: Some(vec![1e3]),
                velocity: Some(vec![velocity]),
                acceleration: Some(vec![1e3]),
                synchronous: load != CommandLoad::Bound,
                ..Limits::default()
            };
            controller.set_limits(&limits).expect("limits");
        }
        // τ is at least that of the model, so that the measured second ends before the movement does.
        let target = |m: usize, tau: f64| Target {
            style: model.demonstrated().styles.row(m).to_vec(),
            goal: model.demonstrated().goals.row(m).iter().map(|g| g + 0.1 * m as f64).collect(),
            tau: tau * model.tau(),
        };
        let zeros = || vec![0.0; model.n_dofs()];
        let mut control_loop = Self {
            controller,
            load,
            targets: [target(0, 1.1), target(1, 1.2)],
            next_target: 0,
            position: zeros(),
            velocity: zeros(),
            acceleration: zeros(),
        };
        control_loop.restart();
        control_loop
    }

    /// Executes the measured tick.
    pub(crate) fn tick(&mut self) {
        if matches!(self.load, CommandLoad::Commanded | CommandLoad::Governed | CommandLoad::GovernedSlowed) {
            self.command();
        } else {
            black_box(self.controller.step().expect("a tick"));
        }
    }

    /// Prepares the loop for the next [`TICKS_PER_BATCH`] ticks; not measured.
    pub(crate) fn prepare(&mut self) {
        if self.controller.time() + TICKS_PER_BATCH as f64 * DT > DURATION - 10.0 * DT {
            self.restart();
        }
        if self.load == CommandLoad::InTransition {
            self.command();
        }
    }

    fn restart(&mut self) {
        self.controller.reset(&Conditions::default()).expect("a reset");
        // A command before the first tick takes effect without a transition.
        self.controller.step().expect("a tick");
    }

    fn command(&mut self) {
        self.next_target = 1 - self.next_target;
        let Target { style, goal, tau } = &self.targets[self.next_target];
        let command = Command { style: Some(style), goal: Some(goal), tau: Some(*tau), ..Command::default() };
        let Self { position, velocity, acceleration, .. } = self;
        let mut motion = Motion { position, velocity, acceleration };
        black_box(self.controller.update(&command, &mut motion).expect("a tick"));
    }
}

/// Fits a model with J styles to ten movements of one second, whose forcing terms have full rank.
pub(crate) fn model(n_dofs: usize, n_styles: usize) -> Arc<Model> {
    let shape = |m: usize, d: usize, s: f64| {
        let reach = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
        reach * (1.0 + d as f64) + (PI * s).sin().powi(2) * (PI * m as f64 * s + d as f64).cos()
    };
    let demonstration = |m: usize| {
        let position = Array2::from_shape_fn((101, n_dofs), |(c, d)| shape(m, d, c as f64 / 100.0));
        Demonstration::new(position, Sampling::Uniform { dt: DURATION / 100.0 }).expect("finite numbers")
    };
    let demos: Vec<_> = (0..10).map(demonstration).collect();
    let basis = Basis::NGnet(NGnet::default());
    let options = FitOptions::new(Kind::Discrete).n_styles(Truncation::Rank(n_styles)).basis(basis);
    Arc::new(fit(&demos, &options).expect("a fit"))
}
