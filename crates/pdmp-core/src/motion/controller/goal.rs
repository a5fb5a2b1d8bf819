//! Transition of the moving frame to a commanded goal and final velocity.
//!
//! The frame c(u) = g + (g − y₀)ℓ(u) + q(u) has a displacement q (`goal_transition`) that begins when a goal is commanded
//! and ends, with rest, at the new goal. A final velocity is reached at u_end: q there compensates for the position and
//! velocity at which the output system would arrive,
//!
//! ```text
//! [e; z](u_end) = exp(A(u_end − u))·([e; z](u) − sᵀX(u)) + sᵀX(u_end),
//! ```
//!
//! with the states X of unit styles from rest. From u_end on the attractor brakes: z takes up the velocity of the frame.

use super::Controller;
use crate::dynamics::canonical::Canonical;
use crate::dynamics::goal_transition::MinDurations;
use crate::dynamics::output_system::{CubicSample, State};
use crate::numerics::simd::{F64x4, WIDTH, padded, unpack};

impl Controller {
    /// Returns whether the movement has a moving frame.
    pub(super) fn has_frame(&self) -> bool {
        !self.primitive.transport.is_immediate()
    }

    /// Returns whether a final velocity is in force and the end lies ahead.
    pub(super) fn approaches_goal_velocity(&self) -> bool {
        self.conditions.has_goal_velocity && !self.primitive.forcing_table().is_past(self.clock.value())
    }

    /// Starts the transition to the commanded goal and final velocity from the present motion of the frame.
    ///
    /// It ends with the movement if the rest is long enough. With a final velocity, a goal commanded later is taken up by
    /// [`Controller::end_goal_transition`].
    pub(super) fn start_goal_transition(&mut self) {
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else { return };
        let (u, MinDurations { by_velocity, by_acceleration }) = (self.clock.value(), self.min_durations);
        if !self.approaches_goal_velocity() {
            let to = if u_end - u < by_velocity { u + by_velocity } else { u_end };
            let (goal, present) = (self.centre.target(), self.centre.value());
            return self.goal_transition.start(u, to, |i, _| [goal[i], goal[i] - present[i], F64x4::ZERO]);
        }
        if u_end - u < by_acceleration {
            return;
        }
        let (primitive, table, tau) = (&self.primitive, self.primitive.forcing_table(), self.conditions.tau);
        let [here, end] = [u, u_end].map(|u| table.demonstrated_index(u));
        let [since_knot, at_knot, rest] = [here.t, end.t, u_end - u].map(|h| primitive.attractor().propagator(h));
        let style = unpack(self.style.target(), primitive.n_styles());
        let (goal, present) = (self.centre.target(), self.centre.value());
        let ends = |i: usize, displacement: F64x4| {
            let group = &self.groups[i];
            let frame = present[i] + group.displacement * self.frame_lag + displacement;
            let (own, own_end) =
                (primitive.state(here, &since_knot, i, style), primitive.state(end, &at_knot, i, style));
            let deviation = State { e: self.position[i] - frame - own.e, z: group.z - own.z };
            let State { e, z } = rest.advance(deviation, [CubicSample::default(); 2]);
            let flow = z + own_end.z + table.sample::<F64x4>(end, i, style).value;
            let velocity = padded(&self.conditions.goal_velocity[i * WIDTH..]);
            [goal[i], goal[i] - present[i] - (e + own_end.e), velocity * tau - flow]
        };
        self.goal_transition.start(u, u_end, ends);
    }

    /// Ends the transition once the clock has reached its end.
    pub(super) fn end_goal_transition(&mut self) {
        if !self.goal_transition.has_reached_end(self.clock.value()) {
            return;
        }
        let phase_rate = self.perturbation.phase_rate();
        for (index, group) in self.groups.iter_mut().enumerate() {
            let frame = self.goal_transition.sample::<F64x4>(index, self.clock.value());
            group.z += frame.motion(phase_rate).value;
        }
        self.centre.set_value(&self.goal_transition.goal);
        self.goal_transition.clear();
        if self.centre.value() != self.centre.target() {
            self.start_goal_transition();
        }
    }
}
