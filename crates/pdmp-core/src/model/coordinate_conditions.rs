//! Conditions of a primitive with rotations, in its coordinates and in its degrees of freedom, and gradients by them.

use super::coordinates::{Coordinates, Frame};
use crate::dynamics::canonical::turn;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, ResolvedConditions};
use crate::numerics::rotation::{Vector, add_scaled, cross, inverse, normalised, rotate};
use crate::numerics::rotation_transpose::{inverse_jacobian_pull_back, log_pull_back, quaternion_gradient};
use crate::validate::check_vector;

/// Gradients of a function of a movement by its conditions.
pub(crate) struct ConditionGradients {
    /// That by goal or anchor.
    pub(crate) centre: Vec<f64>,
    pub(crate) start: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) goal_velocity: Vec<f64>,
    /// Products of the gradients by the velocities of the DoFs with these velocities, without those of the mean rotations.
    pub(crate) velocities: f64,
}

/// Start, goal or anchor of a movement.
struct Place<'a> {
    /// Clock of the mean rotations, and its rate.
    clock: [f64; 2],
    dofs: &'a [f64],
    /// Position and velocity, where given.
    position: Option<&'a Vec<f64>>,
    velocity: Option<&'a Vec<f64>>,
}

impl Coordinates {
    /// Converts conditions to those of the degrees of freedom, their start velocity at a constant τ.
    ///
    /// # Errors
    /// As for [`Self::in_dofs`], or a τ out of range.
    pub(crate) fn constant_in_dofs(&self, conditions: &Conditions) -> Result<Conditions> {
        let rate = 1.0 / conditions.time_constant(self.dofs())?;
        self.in_dofs_from(conditions, rate)
    }

    /// Converts conditions to those of the degrees of freedom, their start velocity at a rate of the clock at the start.
    ///
    /// # Errors
    /// As for [`Self::in_dofs`].
    pub(crate) fn in_dofs_from(&self, conditions: &Conditions, rate: f64) -> Result<Conditions> {
        let mut converted = self.in_dofs(conditions)?;
        let start = converted.start.as_ref().unwrap_or(&self.dofs().nominal.start);
        if let Some(velocity) = &mut converted.velocity {
            self.for_each_drift(self.start_clock(conditions), start, |dof, drift| {
                (0..3).for_each(|i| velocity[dof + i] -= drift[i] * rate);
            });
        }
        Ok(converted)
    }

    /// Returns the clock at which a movement starts, and to which its start is relative.
    fn start_clock(&self, conditions: &Conditions) -> f64 {
        match (self.dofs().kind(), conditions.phase) {
            (Kind::Rhythmic, Some(phase)) if phase.is_finite() => turn(phase),
            _ => 0.0,
        }
    }

    /// Converts conditions to those of the degrees of freedom. A start velocity lacks that of the mean rotations, which
    /// depends on τ.
    ///
    /// # Errors
    /// A vector of another length, a number that is not finite, or a quaternion whose norm is not 1.
    pub(crate) fn in_dofs(&self, conditions: &Conditions) -> Result<Conditions> {
        let (nominal, start_clock) = (&self.dofs().nominal, self.start_clock(conditions));
        let convert = |name, value: &Option<Vec<f64>>, u: f64, near: Option<&[f64]>| match value {
            Some(value) => self.check(name, value).map(|()| {
                let mut dofs = vec![0.0; self.dofs().n_dofs()];
                self.to_dofs(u, value, near, &mut dofs);
                Some(dofs)
            }),
            None => Ok(None),
        };
        let start = convert("start", &conditions.start, start_clock, None)?;
        // The residual rotation changes by the shorter way between start and goal.
        let near = start.as_deref().or(Some(&nominal.start)).filter(|_| self.dofs().kind() == Kind::Discrete);
        let centre_clock = self.centre_clock();
        let goal = convert("goal", &conditions.goal, centre_clock, near)?;
        let anchor = convert("anchor", &conditions.anchor, centre_clock, None)?;
        let relative = |name, velocity: &Option<Vec<f64>>, u: f64, dofs: Option<&[f64]>| match (velocity, dofs) {
            (None, _) => Ok(None),
            (Some(_), None) => Err(Error::Argument {
                name,
                problem: "needs a start: the rotation of a rhythmic movement has no angular velocity without one",
            }),
            (Some(velocity), Some(dofs)) => check_vector(name, velocity, dofs.len(), "DoF").map(|()| {
                let mut velocity = velocity.clone();
                self.relative_velocity(u, dofs, &mut velocity);
                Some(velocity)
            }),
        };
        let at_start = start.as_deref().or(near);
        let velocity = relative("velocity", &conditions.velocity, start_clock, at_start)?;
        let at_goal = goal.as_deref().or(Some(&nominal.centre));
        let goal_velocity = relative("goal_velocity", &conditions.goal_velocity, centre_clock, at_goal)?;
        Ok(Conditions { goal, anchor, start, velocity, goal_velocity, ..conditions.clone() })
    }

    /// Checks conditions and completes them in degrees of freedom.
    ///
    /// # Errors
    /// As for [`Conditions::complete`], or a quaternion whose norm is not 1.
    pub(crate) fn complete(&self, conditions: &Conditions) -> Result<ResolvedConditions> {
        let mut resolved = self.in_dofs(conditions)?.complete(self.dofs())?;
        if let (Some(_), Some(start)) = (&resolved.velocity, &resolved.start) {
            let mut drift = vec![0.0; start.len()];
            self.for_each_drift(resolved.phase, start, |dof, velocity| {
                drift[dof..dof + 3].copy_from_slice(&velocity);
            });
            resolved.drift = Some(drift);
        }
        Ok(resolved)
    }

    /// Passes gradients by the conditions of the DoFs, whose start velocity is that of [`Self::in_dofs_from`], to those by the
    /// conditions.
    ///
    /// The gradient by a quaternion q is that of the function of q/|q|, orthogonal to q.
    ///
    /// # Errors
    /// As for [`Self::in_dofs`].
    pub(crate) fn pull_back_conditions(
        &self,
        conditions: &Conditions,
        rate: f64,
        by_dofs: [&[f64]; 4],
    ) -> Result<ConditionGradients> {
        let [by_centre, by_start, by_velocity, by_goal_velocity] = by_dofs;
        let of_dofs = self.in_dofs(conditions)?;
        let product = |velocity: &Option<Vec<f64>>, by: &[f64]| {
            velocity.iter().flatten().zip(by).fold(0.0, |sum, (v, by)| sum + v * by)
        };
        let velocities = product(&of_dofs.velocity, by_velocity) + product(&of_dofs.goal_velocity, by_goal_velocity);
        let nominal = &self.dofs().nominal;
        let start = Place {
            clock: [self.start_clock(conditions), rate],
            dofs: of_dofs.start.as_ref().unwrap_or(&nominal.start),
            position: conditions.start.as_ref(),
            velocity: conditions.velocity.as_ref(),
        };
        let centre = Place {
            clock: [self.centre_clock(), 0.0],
            dofs: of_dofs.goal.as_ref().or(of_dofs.anchor.as_ref()).unwrap_or(&nominal.centre),
            position: conditions.goal.as_ref().or(conditions.anchor.as_ref()),
            velocity: conditions.goal_velocity.as_ref(),
        };
        let [start, velocity] = self.pull_back_place(&start, [by_start, by_velocity]);
        let [centre, goal_velocity] = self.pull_back_place(&centre, [by_centre, by_goal_velocity]);
        Ok(ConditionGradients { centre, start, velocity, goal_velocity, velocities })
    }

    /// Passes gradients by a position and a velocity of the DoFs to those by position and velocity.
    fn pull_back_place(&self, place: &Place, [by_position, by_velocity]: [&[f64]; 2]) -> [Vec<f64>; 2] {
        let [u, rate] = place.clock;
        let mut position = place.position.cloned().unwrap_or_else(|| {
            let mut position = vec![0.0; self.n_coordinates()];
            self.to_position(u, place.dofs, &mut position);
            position
        });
        let mut velocity = by_velocity.to_vec();
        for rotation in self.rotations() {
            let (q, delta) = (rotation.columns.read(&position), rotation.read(place.dofs));
            let mut by_delta = rotation.read(by_position);
            let mut turn = [0.0; 3];
            if let Some(given) = place.velocity {
                let (body, is_world) = (normalised(q), self.frame() == Frame::World);
                let to_body = |v: Vector| if is_world { rotate(inverse(body), v) } else { v };
                let carried = rotation.carried(u, delta).map(|x| rate * x);
                let own = add_scaled(to_body(rotation.read(given)), -1.0, carried);
                let [by_own, by_residual] = inverse_jacobian_pull_back(delta, own, rotation.read(by_velocity));
                by_delta = add_scaled(by_delta, 1.0, by_residual);
                // In the world frame the given velocity turns with the body: both of its parts have the same derivative.
                turn = if is_world { cross(by_own, own) } else { cross(carried, by_own) };
                rotation.write(if is_world { rotate(body, by_own) } else { by_own }, &mut velocity);
            }
            let turn = add_scaled(turn, 1.0, log_pull_back(delta, by_delta));
            rotation.columns.write(quaternion_gradient(q, turn), &mut position);
        }
        self.plain().iter().for_each(|&[column, dof]| position[column] = by_position[dof]);
        [position, velocity]
    }

    /// Converts conditions of the degrees of freedom to those of the coordinates, without velocities.
    pub(crate) fn of_dofs(&self, conditions: Conditions) -> Conditions {
        let position = |u: f64, dofs: Option<Vec<f64>>| {
            dofs.map(|dofs| {
                let mut position = vec![0.0; self.n_coordinates()];
                self.to_position(u, &dofs, &mut position);
                position
            })
        };
        let Conditions { goal, anchor, start, .. } = conditions.clone();
        let u = self.centre_clock();
        Conditions { goal: position(u, goal), anchor: position(u, anchor), start: position(0.0, start), ..conditions }
    }
}
