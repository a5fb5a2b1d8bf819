//! Transition of the moving frame to a commanded goal and final velocity.
//!
//! The frame c(u) = g₁ + (g₀ − y₀)ℓ(u) + q(u) has a displacement q (`goal_transition`) that begins when a goal is
//! commanded and ends, with rest, at the new goal; g₀ is the goal at the start, g₁ that before the transition. A
//! final velocity is reached at u_end: q there compensates for the position and velocity at which the output system
//! would arrive,
//!
//! ```text
//! [e; z](u_end) = exp(A(u_end − u))·([e; z](u) − sᵀX(u)) + sᵀX(u_end),
//! ```
//!
//! with the states X of unit styles from rest. From u_end on the attractor brakes: z takes up the velocity of the frame.

use super::Controller;
use super::group::Group;
use crate::dynamics::canonical::Canonical;
use crate::dynamics::goal_transition::TransitionEnd;
use crate::dynamics::output_system::{CubicSample, State};
use crate::numerics::simd::{F64x4, WIDTH, padded, unpack};

/// Clock before the end, relative to its extent, from which a change of the final velocity has no effect: a later one would
/// need an acceleration that grows without bound.
const VELOCITY_DEADLINE: f64 = 0.1;
/// Shortest transition relative to that from rest.
const MIN_SHARE: f64 = 1e-9;

impl Controller {
    /// Returns whether the movement has a moving frame.
    pub(super) fn has_frame(&self) -> bool {
        !self.primitive.transport.is_immediate()
    }

    /// Starts the transition to the commanded goal and final velocity from the present motion of the frame.
    ///
    /// It ends with the movement if the rest is long enough. On the way to a final velocity, a goal commanded later is taken
    /// up by [`Controller::end_goal_transition`]; a final velocity or τ changed then changes the slope of q at the end alone,
    /// and in the last tenth of the movement it has no effect.
    pub(super) fn start_goal_transition(&mut self) {
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else { return };
        let rest = u_end - self.clock.value();
        let late = self.started && rest < self.min_durations.by_acceleration;
        let fixed = self.started && rest < VELOCITY_DEADLINE * u_end;
        let has_goal_velocity = self.conditions.has_goal_velocity;
        if self.approaching && late {
            if has_goal_velocity && !fixed {
                self.change_final_velocity();
            }
            return;
        }
        // A transition that ends past u_end would have to be shortened.
        let prolonged = self.goal_transition.is_active() && self.goal_transition.end() > u_end;
        let reachable = rest > 0.0 && !fixed && !(late && prolonged);
        if has_goal_velocity && (self.approaching || reachable) {
            self.approach(u_end, late);
        } else {
            self.move_frame(u_end);
        }
    }

    /// Plans the transition again while perturbations or a style in transition change the arrival.
    pub(super) fn correct_arrival(&mut self) {
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else { return };
        if u_end - self.clock.value() >= self.min_durations.by_acceleration {
            self.approach(u_end, false);
        }
    }

    /// Starts a transition to the goal with rest at its end.
    ///
    /// Near and past the end it takes the shortest duration. A goal that changes by less than the displacement of a
    /// transition in progress prolongs this in proportion, as its present velocity would otherwise overshoot the goal.
    fn move_frame(&mut self, u_end: f64) {
        let u = self.clock.value();
        let (goal, present, transition) = (self.centre.target(), self.centre.value(), &self.goal_transition);
        let min_end = u + self.min_durations.by_velocity;
        let (mut to, mut share) = (u_end, 1.0);
        if transition.is_active() {
            let norm = |difference: &dyn Fn(usize) -> F64x4| {
                let square = |(i, group): (usize, &Group)| {
                    let scaled = difference(i) / group.range;
                    (scaled * scaled).reduce_add()
                };
                self.groups.iter().enumerate().map(square).sum::<f64>().sqrt()
            };
            let change = norm(&|i| goal[i] - transition.goal(i));
            let rest = norm(&|i| transition.goal(i) - present[i] - transition.value[i]);
            to = transition.end();
            share = if change > 0.0 { change / (change + rest) } else { 0.0 };
        }
        if to < min_end {
            let to_now = to.max(u + MIN_SHARE * self.min_durations.by_velocity);
            to = to_now + share * (min_end - to_now);
        }
        self.approaching = false;
        self.goal_transition.start(u, to, |i, _, _| TransitionEnd {
            goal: goal[i],
            value: goal[i] - present[i],
            slope: F64x4::ZERO,
        });
    }

    /// Starts a transition to the final velocity at u_end, and to the goal unless it is too `late` for a new one.
    fn approach(&mut self, u_end: f64, late: bool) {
        let (primitive, table, tau) = (&self.primitive, self.primitive.forcing_table(), self.conditions.tau);
        let u = self.clock.value();
        let [here, end] = [u, u_end].map(|u| table.demonstrated_index(u));
        let [since_knot, at_knot, rest] = [here.t, end.t, u_end - u].map(|h| primitive.attractor().propagator(h));
        let style = unpack(self.style.target(), primitive.n_styles());
        let present = self.centre.value();
        let (commanded, active) = (self.centre.target(), self.goal_transition.is_active());
        for (group, velocity) in self.conditions.goal_velocity.chunks(WIDTH).enumerate() {
            self.arrival_slope[group] = padded(velocity) * tau;
        }
        let ends = |i: usize, displacement: F64x4, planned: TransitionEnd| {
            let group = &self.groups[i];
            let frame = present[i] + group.displacement * self.frame_lag + displacement + group.shift;
            let (own, own_end) =
                (primitive.state(here, &since_knot, i, style), primitive.state(end, &at_knot, i, style));
            let deviation = State { e: self.position[i] - frame - own.e, z: group.z - own.z };
            let State { e, z } = rest.advance(deviation, [CubicSample::default(); 2]);
            let flow = z + own_end.z + table.sample::<F64x4>(end, i, style).value;
            let goal = match (late, active) {
                (false, _) => commanded[i],
                (true, true) => planned.goal,
                (true, false) => present[i],
            };
            let value = goal - present[i] - (e + own_end.e);
            TransitionEnd { goal, value, slope: self.arrival_slope[i] - flow }
        };
        self.goal_transition.start(u, u_end, ends);
        self.approaching = true;
    }

    /// Changes the slope of the transition at its end by that of the final velocity, and leaves its displacement there.
    fn change_final_velocity(&mut self) {
        let Self { arrival_slope, conditions, goal_transition, clock, .. } = self;
        let slope = |i: usize| padded(&conditions.goal_velocity[i * WIDTH..]) * conditions.tau;
        goal_transition.start(clock.value(), goal_transition.end(), |i, _, planned| TransitionEnd {
            slope: planned.slope + (slope(i) - arrival_slope[i]),
            ..planned
        });
        arrival_slope.iter_mut().enumerate().for_each(|(i, arrival)| *arrival = slope(i));
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
        (0..self.groups.len()).for_each(|group| self.centre.set_value(group, self.goal_transition.goal(group)));
        self.goal_transition.clear();
        self.approaching = false;
        if self.centre.value() != self.centre.target() {
            self.start_goal_transition();
        }
    }
}
