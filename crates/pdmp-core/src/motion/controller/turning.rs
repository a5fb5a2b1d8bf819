//! Limits of angular velocity and acceleration in the control loop.
//!
//! After each tick the motion of every rotation is compared with its limits (`angular`). One that keeps them moves on bit for bit as
//! without limits. Any other one follows the closest admissible motion, and δ and δ̇ take the values with which the primitive
//! continues from there: δ = log(q̄⁻¹q), δ̇ = J⁻¹(δ)(ω − exp(δ)ᵀω̄). The excess of the angular acceleration slows the phase as that of a DoF.

use std::ops::Range;

use super::Controller;
use super::limiting::NEAR_LIMIT;
use super::pose::{Pose, place, set_vector, vector_at};
use super::step::first_element;
use crate::error::Result;
use crate::motion::angular::AngularLimits;
use crate::motion::limits::Limit;
use crate::motion::viability::MIN_TICK;
use crate::numerics::rotation::{Turning, Vector, add_scaled, dot};
use crate::numerics::simd::{F64x4, unpack};
use crate::numerics::state::Visitor;

/// Limits of a rotation, and its motion at the start of the tick that they apply to.
#[derive(Clone, Copy, Debug)]
pub(super) struct LimitedTurn {
    /// First of its three DoFs.
    pub(super) dof: usize,
    pub(super) limits: AngularLimits,
    pub(super) before: Turning,
    /// True if the limits determine the motion of the tick.
    is_limited: bool,
}

impl LimitedTurn {
    /// Returns no limits of the rotation whose first DoF is given.
    pub(super) fn none(dof: usize) -> Self {
        Self { dof, limits: AngularLimits::NONE, before: Turning::REST, is_limited: false }
    }

    pub(super) fn dofs(&self) -> Range<usize> {
        self.dof..self.dof + 3
    }

    /// Returns the limit that a motion over `dt` seconds is near.
    fn nearest(&self, to: &Turning, dt: f64) -> Option<Limit> {
        let [velocity, acceleration] =
            [self.limits.velocity, self.limits.acceleration * dt].map(|limit| NEAR_LIMIT * limit);
        let change = add_scaled(to.velocity, -1.0, self.before.velocity);
        if dot(to.velocity, to.velocity) > velocity * velocity {
            Some(Limit::Velocity)
        } else if dot(change, change) > acceleration * acceleration {
            Some(Limit::Acceleration)
        } else {
            None
        }
    }
}

impl Controller {
    /// Converts the motion to coordinates, with accelerations reduced to their limits, of which little belongs to this tick. Returns
    /// whether all rotations keep the other limits over the tick of `dt` seconds.
    #[inline(always)]
    pub(super) fn admits_turns(&mut self, dt: f64) -> bool {
        self.pose.is_none() || self.publishes_admissible_turns(dt)
    }

    fn publishes_admissible_turns(&mut self, dt: f64) -> bool {
        self.publish_pose();
        let Self { pose: Some(pose), limiter, .. } = self else { return true };
        let turns = limiter.turns.iter().zip(&pose.turns);
        turns
            .filter(|(limited, _)| limited.limits.are_finite())
            .all(|(limited, turn)| limited.limits.admits(&limited.before, turn, dt))
    }

    /// Limits the rotations that do not keep their limits over a tick of `dt` seconds, sets their excess, and returns the squares of
    /// the velocities wanted and limited, relative to the ranges, to be added to those of their DoFs.
    pub(super) fn limit_turns(&mut self, dt: f64) -> [f64; 2] {
        let mut squares = [0.0; 2];
        for index in 0..self.limiter.turns.len() {
            let Some(pose) = &mut self.pose else { break };
            let limited = &mut self.limiter.turns[index];
            limited.is_limited =
                limited.limits.are_finite() && !limited.limits.admits(&limited.before, &pose.turns[index], dt);
            if !limited.is_limited {
                continue;
            }
            let wanted = pose.turns[index];
            let (turn, limit) = limited.limits.follow(&limited.before, &wanted, dt);
            pose.turns[index] = turn;
            let dofs = limited.dofs();
            self.limiter.limited[dofs.clone()].fill(Some(limit));
            self.limiter.is_free = false;
            // Numbers near overflow have no excess.
            let change = add_scaled(wanted.velocity, -1.0, turn.velocity).map(|x| x / dt.max(MIN_TICK));
            let change = change.map(|x| if x.is_finite() { x } else { 0.0 });
            for (dof, excess) in
                dofs.clone().zip(self.excess_of(F64x4::new([change[0], change[1], change[2], 0.0])).to_array())
            {
                let (group, lane) = place(dof);
                self.limiter.excess[group].as_mut_array()[lane] = excess;
            }
            let (group, lane) = place(dofs.start);
            let scale = self.groups[group].range.as_array()[lane].powi(-2);
            let own = vector_at(&self.velocity, dofs.start);
            for (square, velocity) in squares.iter_mut().zip([wanted.velocity, turn.velocity]) {
                *square += (dot(velocity, velocity) - dot(own, own)) * scale;
            }
        }
        squares
    }

    /// Continues the primitive from the limited rotations.
    pub(super) fn follow_turns(&mut self) {
        let rate = self.finite_rate();
        let Self { pose: Some(pose), primitive, limiter, groups, position, velocity, clock, perturbation, .. } = self
        else {
            return;
        };
        let Some(coordinates) = primitive.coordinates() else { return };
        let mean_rate = perturbation.phase_rate() * first_element(self.rate.value());
        for ((rotation, limited), turn) in coordinates.rotations().iter().zip(&limiter.turns).zip(&pose.turns) {
            if !limited.is_limited {
                continue;
            }
            let before: Vector = std::array::from_fn(|i| {
                let (group, lane) = place(limited.dof + i);
                limiter.before[group][0].as_array()[lane]
            });
            let [delta, slope] = rotation.residual(clock.value(), mean_rate, turn, before);
            let own = vector_at(velocity, limited.dof);
            set_vector(position, limited.dof, delta);
            set_vector(velocity, limited.dof, slope);
            for i in 0..3 {
                let (group, lane) = place(limited.dof + i);
                let change = (slope[i] - own[i]) / rate;
                groups[group].z.as_mut_array()[lane] += if change.is_finite() { change } else { 0.0 };
            }
        }
    }

    /// Writes the motion of the DoFs and of the rotations to that in coordinates, after limits have changed it.
    pub(super) fn publish_limited(&mut self) {
        let Self { pose: Some(pose), primitive, position, velocity, acceleration, .. } = self else { return };
        let Some(coordinates) = primitive.coordinates() else { return };
        let dofs = [&*position, velocity, acceleration].map(|lanes| unpack(lanes, primitive.n_dofs()));
        let Pose { position, velocity, acceleration, turns, .. } = &mut **pose;
        coordinates.write_plain(dofs, position, velocity, acceleration);
        for (rotation, turn) in coordinates.rotations().iter().zip(turns) {
            coordinates.write(rotation, *turn, position, velocity, acceleration);
        }
    }

    /// Sets the motion of the rotations at the start of a tick to the present one.
    pub(super) fn begin_turns(&mut self) {
        let Self { pose: Some(pose), limiter, .. } = self else { return };
        limiter.turns.iter_mut().zip(&pose.turns).for_each(|(limited, turn)| limited.before = *turn);
    }

    /// Keeps the angular velocity and acceleration of the last tick after a command between ticks, where the new ones break a limit.
    pub(super) fn keep_turns(&mut self) {
        let Self { pose: Some(pose), limiter, started, .. } = self else { return };
        if !*started {
            return self.begin_turns();
        }
        if !limiter.is_active() {
            return;
        }
        let mut changed = false;
        for (limited, turn) in limiter.turns.iter().zip(&mut pose.turns) {
            let LimitedTurn { limits, before, .. } = limited;
            if !limits.are_finite() {
                continue;
            }
            let kept = turn.velocity == before.velocity || limits.admits_change(turn.velocity);
            if !kept {
                (turn.velocity, turn.acceleration) = (before.velocity, before.acceleration);
                changed = true;
            }
        }
        if changed {
            self.publish_limited();
        }
    }

    /// Names the rotations that are near a limit which slows the clock.
    pub(super) fn name_turns(&mut self, dt: f64) {
        let Self { pose: Some(pose), limiter, .. } = self else { return };
        for (limited, turn) in limiter.turns.iter().zip(&pose.turns).filter(|(limited, _)| limited.limits.are_finite())
        {
            let of_dofs = &mut limiter.limited[limited.dofs()];
            if of_dofs.iter().all(Option::is_none) {
                of_dofs.fill(limited.nearest(turn, dt));
            }
        }
    }

    /// Offsets a change of the rate of the mean rotations over the same motion of q by that of the DoFs: angular velocities stay.
    pub(super) fn hold_turns(&mut self, change: f64, rate: f64) {
        let Self { primitive, groups, position, velocity, clock, perturbation, .. } = self;
        let Some(coordinates) = primitive.coordinates() else { return };
        let change = change * perturbation.phase_rate();
        let dofs = unpack(position, primitive.n_dofs());
        coordinates.for_each_drift(clock.value(), dofs, |dof, drift| {
            for (i, drift) in drift.into_iter().enumerate() {
                let (group, lane) = place(dof + i);
                velocity[group].as_mut_array()[lane] -= drift * change;
                groups[group].z.as_mut_array()[lane] -= drift * (change / rate);
            }
        });
    }
}

/// Visits a rotation, with the bounds of its velocity and acceleration.
pub(super) fn walk_turning(visit: &mut Visitor, turning: &mut Turning, quantity: [f64; 2]) -> Result<()> {
    visit(&mut turning.rotation, [-1.0 - 1e-9, 1.0 + 1e-9])?;
    visit(&mut turning.velocity, quantity)?;
    visit(&mut turning.acceleration, quantity)
}
