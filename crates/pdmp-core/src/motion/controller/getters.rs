//! State and commands of the control loop, read between ticks.

use std::sync::Arc;

use super::{Controller, Status};
use crate::model::primitive::Primitive;
use crate::motion::perturbation::Compliance;
use crate::numerics::simd::unpack;

impl Controller {
    /// Returns the status after the last tick.
    pub fn status(&self) -> Status {
        self.status
    }

    /// Returns the primitive.
    pub fn primitive(&self) -> &Arc<Primitive> {
        &self.primitive
    }

    /// Returns the default length of a tick, in seconds.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Returns the time since the start, in seconds.
    pub fn time(&self) -> f64 {
        self.time.value()
    }

    /// Returns the phase: x in [0, 1] for a discrete movement, φ in [0, 2π) for a rhythmic one.
    pub fn phase(&self) -> f64 {
        self.primitive.canonical().phase(self.clock.value())
    }

    /// Returns the position y (D,), in the unit of each DoF, or (nq,) in coordinates.
    pub fn position(&self) -> &[f64] {
        if let Some(pose) = &self.pose {
            return &pose.position;
        }
        unpack(&self.position, self.primitive.n_dofs())
    }

    /// Returns the velocity ẏ (D,), in the unit of each DoF per second.
    pub fn velocity(&self) -> &[f64] {
        if let Some(pose) = &self.pose {
            return &pose.velocity;
        }
        unpack(&self.velocity, self.primitive.n_dofs())
    }

    /// Returns the acceleration ÿ (D,), in the unit of each DoF per second squared.
    pub fn acceleration(&self) -> &[f64] {
        if let Some(pose) = &self.pose {
            return &pose.acceleration;
        }
        unpack(&self.acceleration, self.primitive.n_dofs())
    }

    /// Returns the commanded style s (J,).
    pub fn style(&self) -> &[f64] {
        &self.conditions.style
    }

    /// Returns the goal g or anchor y_a (D,) in force, in the unit of each DoF: the commanded one, moved inside the limits of
    /// [`Controller::set_limits`].
    pub fn centre(&self) -> &[f64] {
        if let Some(pose) = &self.pose {
            return &pose.centre;
        }
        unpack(self.centre.target(), self.primitive.n_dofs())
    }

    /// Returns the commanded final velocity (D,), per second; `None` for that of the demonstrations.
    pub fn goal_velocity(&self) -> Option<&[f64]> {
        let velocity = self.pose.as_ref().map_or(&self.conditions.goal_velocity, |pose| &pose.goal_velocity);
        self.conditions.has_goal_velocity.then_some(&**velocity)
    }

    /// Returns the commanded time constant τ, in seconds.
    pub fn tau(&self) -> f64 {
        self.conditions.tau
    }

    /// Returns the commanded speed, a factor of the rate 1/τ.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Returns the tolerance of a settled movement; see [`Controller::set_tolerance`].
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Returns the gains k_s and k_t of a measured position; see [`Controller::set_compliance`].
    pub fn compliance(&self) -> Compliance {
        self.perturbation.compliance()
    }

    /// Returns the commanded amplitude r₀; 1 for a discrete movement.
    pub fn amplitude(&self) -> f64 {
        self.conditions.amplitude
    }
}
