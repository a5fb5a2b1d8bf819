//! Input and output of a control tick, in memory of the caller.

use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::{
    check_amplitude, check_phase, check_style, check_tau, reject_for_kind, reject_goal_velocity,
};
use crate::model::primitive::Primitive;
use crate::validate::{check_length, check_range, check_vector};

/// Command of one tick. A field that is `None` leaves its quantity unchanged.
///
/// Style, goal, final velocity, anchor, τ and amplitude remain in force until the next command, and a repeated command has
/// no further effect. `measured` remains in force until the next measurement or [`crate::Controller::release`]. `dt`,
/// `coupling` and `phase` apply to this tick only.
///
/// ```
/// use pdmp_core::Command;
///
/// let goal = [0.4, 0.1];
/// let command = Command { goal: Some(&goal), tau: Some(0.8), ..Command::default() };
/// assert!(command.style.is_none());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Command<'a> {
    /// Length of this tick, in seconds; the default is that of the controller. A tick of length zero applies the command
    /// without moving.
    pub dt: Option<f64>,
    /// New style s (J,).
    pub style: Option<&'a [f64]>,
    /// New goal g (D,) of a discrete movement, in the unit of each DoF.
    pub goal: Option<&'a [f64]>,
    /// New final velocity (D,) of a discrete movement, per second.
    pub goal_velocity: Option<&'a [f64]>,
    /// New anchor y_a (D,) of a rhythmic movement, in the unit of each DoF.
    pub anchor: Option<&'a [f64]>,
    /// New time constant τ, in seconds.
    pub tau: Option<f64>,
    /// New amplitude r₀ of a rhythmic movement.
    pub amplitude: Option<f64>,
    /// Measured position ỹ (D,) of the robot, in the unit of each DoF; `None` without a new measurement.
    pub measured: Option<&'a [f64]>,
    /// Coupling terms.
    pub coupling: Option<Coupling<'a>>,
    /// Measured phase φ* of a rhythmic movement, in rad, which pulls the phase over this tick; see
    /// [`crate::Controller::set_phase_gain`]. A sensor slower than the loop passes its last phase plus the time since then
    /// over τ.
    pub phase: Option<f64>,
}

/// Coupling terms of the user, constant over the tick. A jump of c_v makes the velocity jump.
#[derive(Clone, Copy, Debug)]
pub struct Coupling<'a> {
    /// c_v (D,), added to the velocity, per second.
    pub velocity: &'a [f64],
    /// c_a (D,), added to the acceleration, per second squared.
    pub acceleration: &'a [f64],
}

/// Output of a tick: three vectors (D,) that the caller owns.
///
/// ```
/// # use pdmp_core::{Command, Conditions, Controller, Demonstration, FitOptions, Kind, Motion, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
/// let (mut y, mut v, mut a) = ([0.0; 2], [0.0; 2], [0.0; 2]);
/// let mut motion = Motion { position: &mut y, velocity: &mut v, acceleration: &mut a };
/// controller.update(&Command::default(), &mut motion)?;
/// assert_eq!(y, controller.position());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Motion<'a> {
    /// Position y, in the unit of each DoF.
    pub position: &'a mut [f64],
    /// Velocity ẏ, per second.
    pub velocity: &'a mut [f64],
    /// Acceleration ÿ, per second squared.
    pub acceleration: &'a mut [f64],
}

impl Command<'_> {
    /// Checks shapes, ranges and kind against the primitive.
    ///
    /// # Errors
    /// A vector of another length, a number out of range, or an argument of the other kind of primitive.
    pub(crate) fn check(&self, model: &Primitive) -> Result<()> {
        let (kind, n_dofs) = (model.kind(), model.n_dofs());
        let vector = |name, vector: Option<&[f64]>| match vector {
            Some(vector) => check_vector(name, vector, n_dofs, "DoF"),
            None => Ok(()),
        };
        if let Some(dt) = self.dt {
            check_range("dt", dt, (0.0..f64::INFINITY).contains(&dt), "must be finite and not negative")?;
        }
        if let Some(style) = self.style {
            check_style(style, model.n_styles())?;
        }
        if let Some(tau) = self.tau {
            check_tau(tau, model.tau())?;
        }
        if let Some(amplitude) = self.amplitude {
            reject_for_kind(kind, "amplitude", kind == Kind::Discrete)?;
            check_amplitude(amplitude)?;
        }
        let position =
            |name, vector: Option<&[f64]>| vector.map_or(Ok(()), |vector| model.check_position(name, vector));
        reject_for_kind(kind, "goal", kind == Kind::Rhythmic && self.goal.is_some())?;
        position("goal", self.goal)?;
        reject_goal_velocity(model, self.goal_velocity.is_some())?;
        vector("goal_velocity", self.goal_velocity)?;
        reject_for_kind(kind, "anchor", kind == Kind::Discrete && self.anchor.is_some())?;
        position("anchor", self.anchor)?;
        position("measured", self.measured)?;
        if let Some(Coupling { velocity, acceleration }) = self.coupling {
            vector("coupling velocity", Some(velocity))?;
            vector("coupling acceleration", Some(acceleration))?;
        }
        self.phase.map_or(Ok(()), |phase| check_phase(kind, phase))
    }
}

impl Motion<'_> {
    /// Checks that the position has one element per coordinate, and the other vectors one per DoF.
    pub(crate) fn check(&self, primitive: &Primitive) -> Result<()> {
        let (n_coordinates, n_dofs) = (primitive.n_coordinates(), primitive.n_dofs());
        check_length("position", self.position.len(), n_coordinates, primitive.per_coordinate())?;
        check_length("velocity", self.velocity.len(), n_dofs, "DoF")?;
        check_length("acceleration", self.acceleration.len(), n_dofs, "DoF")
    }
}
