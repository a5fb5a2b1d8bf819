//! Settling of a discrete movement on its goal, past its end.

use super::group::ForcingSample;
use super::{Controller, Status};
use crate::dynamics::output_system::{Attractor, CubicSample};
use crate::numerics::simd::unpack;

impl Controller {
    /// Sets the lengths that the tolerance is relative to, for the present distances from the goal.
    pub(super) fn update_lengths(&mut self) {
        let distances = self.centre.target().iter().zip(&self.position);
        for (group, (&centre, &position)) in self.groups.iter_mut().zip(distances) {
            group.rounding = centre.abs().max(position.abs()) * (8.0 * f64::EPSILON);
            group.length = group.range.max((centre - position).abs());
        }
    }

    /// Returns [`Status::Finished`] past the end if the remaining displacement of every DoF is within its tolerance.
    ///
    /// The displacement is bounded by about |y − g| + 2|z + w|/α_z + |w|/β_z: distance from the goal, overshoot at critical
    /// damping, and forcing, the larger of those of the present and the commanded style. The remaining displacement of the
    /// goal is added.
    pub(super) fn settled(&self) -> Status {
        let (forcing_table, clock) = (self.primitive.forcing_table(), self.clock.value());
        let fade = forcing_table.fade(clock);
        let Some(fade) = fade.filter(|_| !self.goal_transition.is_active()) else { return Status::Working };
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let target = unpack(self.style.target(), self.primitive.n_styles());
        let (bound, table_index) = (forcing_table.bound(clock), forcing_table.index(clock));
        let settled = self.groups.iter().enumerate().all(|(index, group)| {
            let distance = (self.position[index] - self.centre.target()[index]).abs();
            let ForcingSample { value, slope, .. } = group.forcing;
            let overshoot = (group.z + value * fade.r).abs() * (2.0 / alpha_z);
            let mut residual = bound.of(CubicSample { value, slope });
            if !self.style.is_settled() {
                residual = residual.max(bound.of(forcing_table.sample(table_index, index, target)));
            }
            let displacement = distance
                + overshoot
                + residual * (1.0 / beta_z)
                + self.command_gains.max_displacement(&self.centre, index);
            displacement.simd_le((group.length * self.tolerance).max(group.rounding)).all()
        });
        if settled { Status::Finished } else { Status::Working }
    }
}
