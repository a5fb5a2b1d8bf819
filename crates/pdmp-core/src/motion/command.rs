//! What the caller owns of a tick: what is commanded, and where the motion is written.

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{check_amplitude, check_style, check_tau, refuse};
use crate::model::primitive::Primitive;
use crate::validate::check_vector;

/// All that one tick is told; what is `None` stays as it was.
///
/// Style, goal, anchor, τ and amplitude stay in force until they are commanded again, so that the same command can be
/// given at every tick; `measured` until the next one or [`crate::Controller::release`]; `dt` and `coupling` hold for this
/// tick alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Command<'a> {
    /// Length of this tick, in seconds, if it differs from the controller's. In a tick of length zero commands take effect
    /// as between ticks, and nothing moves.
    pub dt: Option<f64>,
    /// Style s (J,) to go to.
    pub style: Option<&'a [f64]>,
    /// Goal g (D,) to go to, discrete.
    pub goal: Option<&'a [f64]>,
    /// Anchor y_a (D,) to go to, rhythmic.
    pub anchor: Option<&'a [f64]>,
    /// Time constant τ to go to, in seconds.
    pub tau: Option<f64>,
    /// Amplitude r₀ to go to, rhythmic.
    pub amplitude: Option<f64>,
    /// Position ỹ (D,) at which the robot is now, in the unit of each DoF; `None` if it was not measured anew.
    pub measured: Option<&'a [f64]>,
    /// The user's own terms.
    pub coupling: Option<Coupling<'a>>,
}

/// Terms of the user's own, constant over the tick. The velocity jumps where c_v does.
#[derive(Clone, Copy, Debug)]
pub struct Coupling<'a> {
    /// c_v (D,), added to the velocity, per second.
    pub velocity: &'a [f64],
    /// c_a (D,), added to the acceleration, per second squared.
    pub acceleration: &'a [f64],
}

/// Where a tick writes its motion: three vectors of the caller's, (D,) each.
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
    /// Checks every number against the model.
    pub(crate) fn check(&self, model: &Primitive) -> Result<()> {
        let (kind, n_dofs) = (model.kind(), model.n_dofs());
        let vector = |name, vector: Option<&[f64]>| match vector {
            Some(vector) => check_vector(name, vector, n_dofs, "DoF"),
            None => Ok(()),
        };
        if let Some(dt) = self.dt.filter(|dt| !(0.0..f64::INFINITY).contains(dt)) {
            return Err(Error::Range { name: "dt", value: dt, allowed: "must be finite and not negative" });
        }
        if let Some(style) = self.style {
            check_style(style, model.n_styles())?;
        }
        if let Some(tau) = self.tau {
            check_tau(tau, model.tau())?;
        }
        if let Some(amplitude) = self.amplitude {
            refuse(kind, "amplitude", kind == Kind::Discrete)?;
            check_amplitude(amplitude)?;
        }
        refuse(kind, "goal", kind == Kind::Rhythmic && self.goal.is_some())?;
        vector("goal", self.goal)?;
        refuse(kind, "anchor", kind == Kind::Discrete && self.anchor.is_some())?;
        vector("anchor", self.anchor)?;
        vector("measured", self.measured)?;
        if let Some(Coupling { velocity, acceleration }) = self.coupling {
            vector("coupling velocity", Some(velocity))?;
            vector("coupling acceleration", Some(acceleration))?;
        }
        Ok(())
    }
}

impl Motion<'_> {
    /// Checks that each vector has one place per DoF.
    pub(crate) fn check(&self, n_dofs: usize) -> Result<()> {
        let lengths = [
            ("position", self.position.len()),
            ("velocity", self.velocity.len()),
            ("acceleration", self.acceleration.len()),
        ];
        match lengths.into_iter().find(|(_, found)| *found != n_dofs) {
            Some((name, found)) => Err(Error::Length { name, expected: n_dofs, found, per: "DoF" }),
            None => Ok(()),
        }
    }
}
