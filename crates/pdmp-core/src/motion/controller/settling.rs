//! Settling of a discrete movement on its goal, past its end.

use super::group::ForcingSample;
use super::{Controller, Status};
use crate::dynamics::output_system::{Attractor, CubicSample, State};
use crate::motion::perturbation::largest_range;
use crate::numerics::simd::{F64x4, unpack};

impl Controller {
    /// Sets the lengths that the tolerance is relative to, for the present distances from the goal.
    pub(super) fn update_lengths(&mut self) {
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        // Per tick of length h the attractor moves by ωh of the distance, which rounding stops below about ε|y|/(ωh).
        let relative = 8.0 * f64::EPSILON * (1.0 + self.conditions.tau / ((alpha_z * beta_z).sqrt() * self.dt));
        let largest = largest_range(self.primitive.ranges());
        let distances = self.centre.target().iter().zip(&self.position);
        for (group, (&centre, &position)) in self.groups.iter_mut().zip(distances) {
            group.rounding = centre.abs().max(position.abs()) * relative;
            group.length = group.length_at((centre - position).abs(), largest);
        }
        if self.pose.is_some() {
            self.share_lengths();
            self.publish_centre(None);
        }
    }

    /// Returns [`Status::Finished`] past the end if every DoF is within its tolerance of the goal and will stay there.
    ///
    /// The deviation from the goal is bounded by the sum of those of the frame, of the braking along its closed form, of the
    /// homogeneous rest (e, z) of the output system, |e| + |z|·exp(−ζa)/ω, and of a style in transition, whose forcing Δw
    /// deviates by about |Δw|/β_z. With immediate transport, and while the phase is slowed, the forcing counts as a whole.
    pub(super) fn settled(&self) -> Status {
        let (forcing_table, clock) = (self.primitive.forcing_table(), self.clock.value());
        let Some(fade) = forcing_table.fade(clock).filter(|_| !self.is_pending()) else { return Status::Working };
        let attractor = self.primitive.attractor();
        let (by_flow, by_forcing) = (attractor.impulse_peak(), 1.0 / attractor.beta_z);
        let target = unpack(self.style.target(), self.primitive.n_styles());
        let (bound, table_index) = (forcing_table.bound(clock), forcing_table.index(clock));
        let braked = forcing_table.braked_motion(clock).filter(|_| self.perturbation.phase_rate() == 1.0);
        // Deviations of the output system and the forcing that they come from, as vectors of a group.
        let homogeneous = |index: usize| {
            let (group, frame) = (&self.groups[index], self.centre.value()[index] + self.goal_transition.value[index]);
            let ForcingSample { value, slope, .. } = group.forcing;
            let (e, forcing) = (self.position[index] - frame, CubicSample { value, slope });
            match &braked {
                Some(braked) => {
                    let own = braked.state(forcing);
                    (State { e: e - own.e, z: group.z - own.z }, forcing)
                }
                None => (State { e, z: group.z + value * fade.r }, forcing),
            }
        };
        let change = |index: usize, forcing: CubicSample<F64x4>| {
            let CubicSample { value, slope } = forcing_table.sample::<F64x4>(table_index, index, target);
            CubicSample { value: value - forcing.value, slope: slope - forcing.slope }
        };
        let sum = |[e, z]: [F64x4; 2], forcing: CubicSample<F64x4>, change: Option<CubicSample<F64x4>>| {
            let mut deviation = match &braked {
                Some(braked) => e + z * by_flow + braked.max_displacement(forcing.slope),
                None => e + z * by_flow + bound.of(forcing) * by_forcing,
            };
            if let Some(change) = change {
                deviation += bound.of(change) * by_forcing;
            }
            deviation
        };
        let is_changing = !self.style.is_settled();
        let bounded = |index: usize| {
            let (group, (State { e, z }, forcing)) = (&self.groups[index], homogeneous(index));
            let change = is_changing.then(|| change(index, forcing));
            let deviation = sum([e.abs(), z.abs()], forcing, change) + self.frame_deviation(index);
            [deviation, (group.length * self.tolerance).max(group.rounding)]
        };
        // The sizes of the vectors of a rotation, which depend on no frame.
        let of_rotation = |dof: usize| {
            let size = |vector: &dyn Fn(usize) -> F64x4| F64x4::splat(self.size_of(dof, vector));
            let forcing = |of: &dyn Fn(usize) -> CubicSample<F64x4>| CubicSample {
                value: size(&|index| of(index).value),
                slope: size(&|index| of(index).slope),
            };
            let state = [size(&|index| homogeneous(index).0.e), size(&|index| homogeneous(index).0.z)];
            let own = forcing(&|index| homogeneous(index).1);
            let change = is_changing.then(|| forcing(&|index| change(index, homogeneous(index).1)));
            sum(state, own, change).as_array()[0] + self.size_of(dof, &|index| self.frame_deviation(index))
        };
        let settled = match &self.pose {
            None => (0..self.groups.len()).map(bounded).all(|[deviation, bound]| deviation.simd_le(bound).all()),
            Some(_) => self.is_within(bounded, of_rotation),
        };
        if settled { Status::Finished } else { Status::Working }
    }

    /// Returns an upper bound of the distance between frame and commanded goal from now on.
    fn frame_deviation(&self, index: usize) -> F64x4 {
        if !self.has_frame() {
            return self.command_gains.max_displacement(&self.centre, index);
        }
        let transition = &self.goal_transition;
        let end = if transition.is_active() { transition.goal(index) } else { self.centre.value()[index] };
        (end - self.centre.target()[index]).abs() + transition.max_deviation(index, self.clock.value())
    }
}
