//! Commands of adversarial loops.

use pdmp_core::motion::Coupling;
use pdmp_core::{Command, Kind, Model};

use super::Random;

/// Numbers that a command may have.
pub(crate) struct Numbers<'a> {
    /// Goal of a discrete movement, anchor of a rhythmic one.
    pub(crate) centre: &'a [f64],
    pub(crate) style: &'a [f64],
    pub(crate) measured: &'a [f64],
    /// Coupling terms of velocity and acceleration.
    pub(crate) terms: &'a [f64],
}

/// Returns true in one of a hundred draws.
pub(crate) fn rare(random: &mut Random) -> bool {
    random.next() < 0.01
}

/// Returns the command of a tick of `dt` seconds, each of whose members is rarely given.
pub(crate) fn rare_command<'a>(model: &Model, dt: f64, numbers: &Numbers<'a>, random: &mut Random) -> Command<'a> {
    let discrete = model.kind() == Kind::Discrete;
    let Numbers { centre, style, measured, terms } = *numbers;
    Command {
        dt: Some(dt),
        goal: (discrete && rare(random)).then_some(centre),
        anchor: (!discrete && rare(random)).then_some(centre),
        style: rare(random).then_some(style),
        tau: rare(random).then(|| model.tau() * random.scale(0.1, 10.0)),
        measured: rare(random).then_some(measured),
        coupling: rare(random).then_some(Coupling { velocity: terms, acceleration: terms }),
        ..Command::default()
    }
}
