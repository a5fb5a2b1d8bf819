//! The control loop that the benches of one tick measure: a discrete primitive of any D and J, and what it is told.
//!
//! All of it lies in the middle of a movement: the first tick and the demonstrated end are never measured.
// Each bench takes its part.
#![allow(dead_code, missing_docs)]

use std::env;
use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;

use ndarray::Array2;
use pdmp_core::learning::Truncation;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::{Command, Conditions, Controller, Demonstration, FitOptions, Kind, Model, Motion, Sampling, fit};

/// Degrees of freedom D that are measured.
pub(crate) const N_DOFS: [usize; 5] = [1, 4, 7, 14, 32];
/// Style dimensions J that are measured.
pub(crate) const N_STYLES: [usize; 3] = [1, 3, 8];
/// Ticks from one [`ControlLoop::renew`] to the next.
pub(crate) const BOUT: usize = 100;

/// Length of a tick, in seconds.
const DT: f64 = 1e-3;
/// Length of the movement, in seconds.
const DURATION: f64 = 1.0;

/// Whether `cargo bench` has started this; `cargo test --benches` only wants to see that it works.
pub(crate) fn benching() -> bool {
    env::args().any(|argument| argument == "--bench")
}

/// What the loop is told while it is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Told {
    /// Nothing: style, goal and τ have settled.
    Settled,
    /// Nothing, but style, goal and τ are on their way to what they were told before.
    Live,
    /// Style, goal and τ anew at every tick, and where to write the motion.
    Commanded,
}

impl Told {
    pub(crate) const ALL: [Self; 3] = [Self::Settled, Self::Live, Self::Commanded];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::Live => "live",
            Self::Commanded => "commanded",
        }
    }
}

/// Where style, goal and τ are sent.
struct Target {
    style: Vec<f64>,
    goal: Vec<f64>,
    tau: f64,
}

/// A controller in the middle of its movement.
pub(crate) struct ControlLoop {
    controller: Controller,
    told: Told,
    /// Given in turn, so that each is news.
    targets: [Target; 2],
    turn: usize,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl ControlLoop {
    pub(crate) fn new(model: &Arc<Model>, told: Told) -> Self {
        let controller = Controller::new(model.primitive(), DT, &Conditions::default(), None).expect("a controller");
        // A τ that is never below the model's keeps the measured second within the demonstrations.
        let target = |m: usize, tau: f64| Target {
            style: model.demonstrated().styles.row(m).to_vec(),
            goal: model.demonstrated().goals.row(m).iter().map(|g| g + 0.1 * m as f64).collect(),
            tau: tau * model.tau(),
        };
        let zeros = || vec![0.0; model.n_dofs()];
        let mut started = Self {
            controller,
            told,
            targets: [target(0, 1.1), target(1, 1.2)],
            turn: 0,
            position: zeros(),
            velocity: zeros(),
            acceleration: zeros(),
        };
        started.restart();
        started
    }

    /// What is measured.
    pub(crate) fn tick(&mut self) {
        if self.told == Told::Commanded {
            self.command();
        } else {
            black_box(self.controller.step().expect("a tick"));
        }
    }

    /// What is not: readies the loop for another [`BOUT`] of ticks.
    pub(crate) fn renew(&mut self) {
        if self.controller.time() + BOUT as f64 * DT > DURATION - 10.0 * DT {
            self.restart();
        }
        if self.told == Told::Live {
            self.command();
        }
    }

    fn restart(&mut self) {
        self.controller.reset(&Conditions::default()).expect("the conditions of the start");
        // What is commanded before the first tick is no transition.
        self.controller.step().expect("a tick");
    }

    fn command(&mut self) {
        self.turn = 1 - self.turn;
        let Target { style, goal, tau } = &self.targets[self.turn];
        let command = Command { style: Some(style), goal: Some(goal), tau: Some(*tau), ..Command::default() };
        let Self { position, velocity, acceleration, .. } = self;
        let mut motion = Motion { position, velocity, acceleration };
        black_box(self.controller.update(&command, &mut motion).expect("a tick"));
    }
}

/// A primitive learnt from ten movements of one second, which differ in as many ways as J may be.
pub(crate) fn primitive(n_dofs: usize, n_styles: usize) -> Arc<Model> {
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
