//! Random commands, for tests of states that any history may have led to.
#![allow(dead_code, missing_docs)]

use pdmp_core::{Command, Controller, Kind};

use crate::common::tick;
use crate::counting::Random;

/// Performs one tick under random commands that suit the primitive.
pub(crate) fn random_tick(controller: &mut Controller, random: &mut Random) {
    let (n_dofs, n_styles) = (controller.primitive().n_dofs(), controller.primitive().n_styles());
    let kind = controller.primitive().kind();
    let values: Vec<f64> = (0..n_dofs.max(n_styles)).map(|_| 2.0 * random.next() - 1.0).collect();
    let (vector, style) = (&values[..n_dofs], &values[..n_styles]);
    let rhythmic = kind == Kind::Rhythmic;
    let command = Command {
        style: random.rarely().then_some(style),
        goal: (random.rarely() && !rhythmic).then_some(vector),
        goal_velocity: (random.rarely() && random.rarely() && !rhythmic).then_some(vector),
        anchor: (random.rarely() && rhythmic).then_some(vector),
        tau: random.rarely().then_some(controller.primitive().tau() * (0.5 + random.next())),
        amplitude: (random.rarely() && rhythmic).then_some(values[0].abs()),
        measured: random.rarely().then_some(vector),
        phase: (random.rarely() && rhythmic).then_some(values[0]),
        ..Command::default()
    };
    tick(controller, &command).unwrap();
    if random.rarely() {
        controller.release();
    }
    if random.rarely() {
        controller.set_speed(random.next()).unwrap();
        controller.set_tolerance(0.1 * (1.0 - random.next())).unwrap();
    }
}

/// Returns position, velocity and acceleration.
pub(crate) fn motion(controller: &Controller) -> [&[f64]; 3] {
    [controller.position(), controller.velocity(), controller.acceleration()]
}
