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
    /// The displacement is bounded by about |y − g| + 2|y′|/α_z, the distance from the goal and the overshoot at critical
    /// damping without forcing, and the effect of the forcing, at most max|w|/β_z with the larger forcing of the present and
    /// the commanded style. For constant commands there is a closer bound: the movement is the braking curve y_b and a
    /// deviation from it that the output system damps, so that |y − g| + 2|y′|/α_z remains below about its largest value on
    /// the curve plus |y − y_b| + 2|y′ − y_b′|/α_z. The remaining displacement of the goal is added.
    pub(super) fn settled(&self) -> Status {
        let (forcing_table, clock) = (self.primitive.forcing_table(), self.clock.value());
        let fade = forcing_table.fade(clock);
        let Some(fade) = fade.filter(|_| !self.goal_transition.is_active()) else { return Status::Working };
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let target = unpack(self.style.target(), self.primitive.n_styles());
        let (bound, table_index) = (forcing_table.bound(clock), forcing_table.index(clock));
        let follows_curve = self.style.is_settled() && self.perturbation.phase_rate() == 1.0;
        let curve = forcing_table.braking_curve(clock).filter(|_| follows_curve);
        let settled = self.groups.iter().enumerate().all(|(index, group)| {
            let distance = self.position[index] - self.centre.target()[index];
            let ForcingSample { value, slope, .. } = group.forcing;
            let velocity = group.z + value * fade.r;
            let bound = if let Some(curve) = curve {
                // The slope of the forcing past the end is the velocity at the end.
                let (off, relative) = (distance - slope * curve.distance, velocity - slope * curve.velocity);
                slope.abs() * curve.farthest + off.abs() + relative.abs() * (2.0 / alpha_z)
            } else {
                let mut residual = bound.of(CubicSample { value, slope });
                if !self.style.is_settled() {
                    residual = residual.max(bound.of(forcing_table.sample(table_index, index, target)));
                }
                distance.abs() + velocity.abs() * (2.0 / alpha_z) + residual * (1.0 / beta_z)
            };
            let displacement = bound + self.command_gains.max_displacement(&self.centre, index);
            displacement.simd_le((group.length * self.tolerance).max(group.rounding)).all()
        });
        if settled { Status::Finished } else { Status::Working }
    }
}
