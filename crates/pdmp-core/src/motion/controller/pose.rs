//! Motion in the coordinates of a primitive with rotations.
//!
//! The control loop moves degrees of freedom δ; commands and measurements are converted to them, and its motion to
//! q = q̄(u) ⊗ exp(δ) once per tick. The mean rotation moves with the clock of the phase, u̇ = κρ. Where κ changes, δ takes
//! up the difference of its velocity, as the output system does for that of the frame, so that ω stays continuous.

use super::Controller;
use super::step::first_element;
use crate::model::Conditions;
use crate::model::coordinates::Coordinates;
use crate::motion::command::{Command, Coupling};
use crate::motion::perturbation::largest_range;
use crate::numerics::rotation::{Turning, Vector, dot, exp, inverse_jacobian, jacobian, log_near};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute, unpack};
use crate::numerics::state::clone_in_place;

/// Residual rotation in rad from which a goal is taken by the shorter way to the mean, not to the goal before it: a whole
/// turn has no direction.
const MAX_WINDING: f64 = 1.5 * std::f64::consts::PI;

/// Motion in coordinates, and memory for the conversion of commands.
#[derive(Debug)]
pub(super) struct Pose {
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    /// Motion of the rotations, in the body frame.
    pub(super) turns: Vec<Turning>,
    /// Goal or anchor in force.
    pub(super) centre: Vec<f64>,
    /// Commanded final velocity.
    pub(super) goal_velocity: Vec<f64>,
    /// DoFs of a commanded goal or anchor.
    command: Vec<f64>,
    /// DoFs of a measured position.
    measured: Vec<f64>,
    /// Coupling terms c_v and c_a of the DoFs.
    coupling: [Vec<f64>; 2],
}

clone_in_place!(Pose { position, velocity, acceleration, turns, centre, goal_velocity, command, measured, coupling });

impl Pose {
    /// Returns the memory for a primitive; `None` where its coordinates are its degrees of freedom.
    pub(super) fn of(coordinates: Option<&Coordinates>) -> Option<Box<Self>> {
        let coordinates = coordinates?;
        let (n, n_dofs) = (coordinates.n_coordinates(), coordinates.dofs().n_dofs());
        let [velocity, acceleration, goal_velocity, command, measured, c_v, c_a] = [(); 7].map(|()| vec![0.0; n_dofs]);
        let [position, centre] = [(); 2].map(|()| vec![0.0; n]);
        let coupling = [c_v, c_a];
        Some(Box::new(Self {
            position,
            velocity,
            acceleration,
            turns: vec![Turning::REST; coordinates.rotations().len()],
            centre,
            goal_velocity,
            command,
            measured,
            coupling,
        }))
    }

    /// Computes the DoFs of a commanded goal or anchor, close to those of the goal before it. Returns whether the rotations of
    /// a movement must be expressed by others, because a residual rotation has wound up.
    fn set_centre(&mut self, coordinates: &Coordinates, centre: &[f64], before: &[f64]) -> bool {
        let u = coordinates.centre_clock();
        coordinates.to_dofs(u, centre, Some(before), &mut self.command);
        let wound = |dof: usize| {
            let delta: [f64; 3] = std::array::from_fn(|i| self.command[dof + i]);
            dot(delta, delta) > MAX_WINDING * MAX_WINDING
        };
        let is_wound = coordinates.rotations().iter().any(|rotation| wound(rotation.dof));
        if is_wound {
            coordinates.to_dofs(u, centre, None, &mut self.command);
        }
        is_wound
    }
}

/// Kernel of [`Controller::publish_pose`], whose numbers are not in registers.
struct Publish<'a>(&'a mut Controller);

impl Kernel for Publish<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Controller {
            pose, primitive, position, velocity, acceleration, rate, perturbation, clock, limiter, ..
        } = self.0;
        let (Some(pose), Some(coordinates)) = (pose, primitive.coordinates()) else { return };
        let phase_rate = perturbation.phase_rate();
        let rates = [rate.value(), rate.rate()].map(|rate| phase_rate * first_element(rate));
        let dofs = [&*position, velocity, acceleration].map(|lanes| unpack(lanes, primitive.n_dofs()));
        let Pose { position, velocity, acceleration, turns, .. } = &mut **pose;
        coordinates.write_plain(dofs, position, velocity, acceleration);
        for ((rotation, turn), limited) in coordinates.rotations().iter().zip(turns).zip(&limiter.turns) {
            *turn = rotation.motion(clock.value(), rates, dofs);
            if limited.limits.are_finite() {
                turn.acceleration = limited.limits.reduced(turn.acceleration);
            }
            coordinates.write(rotation, *turn, position, velocity, acceleration);
        }
    }
}

impl Controller {
    /// Converts the motion of the DoFs to coordinates.
    #[inline]
    pub(super) fn publish_pose(&mut self) {
        if self.pose.is_some() {
            compute(Publish(self));
        }
    }

    /// Converts the goal or anchor in force to coordinates, with the sign of the commanded quaternion.
    pub(super) fn publish_centre(&mut self, commanded: Option<&[f64]>) {
        let Self { pose, primitive, centre, .. } = self;
        let (Some(pose), Some(coordinates)) = (pose, primitive.coordinates()) else { return };
        if let Some(commanded) = commanded {
            pose.centre.copy_from_slice(commanded);
        }
        let dofs = unpack(centre.target(), primitive.n_dofs());
        coordinates.to_position(coordinates.centre_clock(), dofs, &mut pose.centre);
    }

    /// Keeps the final velocity of conditions in coordinates.
    pub(super) fn keep_final_velocity(&mut self, conditions: &Conditions) {
        if let (Some(pose), Some(velocity)) = (&mut self.pose, &conditions.goal_velocity) {
            pose.goal_velocity.copy_from_slice(velocity);
        }
    }

    /// Sets the final velocity of the DoFs for that of the coordinates at the commanded goal.
    pub(super) fn set_final_velocity(&mut self) {
        let Self { pose, primitive, conditions, .. } = self;
        let (Some(pose), Some(coordinates)) = (pose, primitive.coordinates()) else { return };
        conditions.goal_velocity.copy_from_slice(&pose.goal_velocity);
        let u = coordinates.centre_clock();
        coordinates.relative_velocity(u, &conditions.centre, &mut conditions.goal_velocity);
    }

    /// Sets the perturbation of a tick of `dt` seconds and `h` on the clock.
    pub(super) fn perturb(&mut self, command: &Command, dt: f64, h: f64) {
        // The terms fade where the rate is below 1/max_tau, while the pull of a measurement is one on the clock.
        let full = dt.min(h * self.max_tau);
        if !self.perturb_pose(command, full, h) {
            self.perturbation.set(command, &self.position, full, h, self.started);
        }
    }

    /// Sets the perturbation of a tick by a command in coordinates; returns false for a primitive without rotations.
    fn perturb_pose(&mut self, command: &Command, full: f64, h: f64) -> bool {
        let Self { pose, primitive, position, clock, perturbation, started, .. } = self;
        let (Some(pose), Some(coordinates)) = (pose, primitive.coordinates()) else { return false };
        let (u, dofs) = (clock.value(), unpack(position, primitive.n_dofs()));
        let Pose { measured, coupling: [c_v, c_a], .. } = &mut **pose;
        if let Some(coordinates_measured) = command.measured {
            coordinates.to_dofs(u, coordinates_measured, Some(dofs), measured);
        }
        if let Some(Coupling { velocity, acceleration }) = command.coupling {
            for (of_dofs, given) in [(&mut *c_v, velocity), (&mut *c_a, acceleration)] {
                of_dofs.copy_from_slice(given);
                coordinates.relative_velocity(u, dofs, of_dofs);
            }
        }
        let of_dofs = Command {
            measured: command.measured.map(|_| measured.as_slice()),
            coupling: command.coupling.map(|_| Coupling { velocity: c_v, acceleration: c_a }),
            ..*command
        };
        perturbation.set(&of_dofs, position, full, h, *started);
        true
    }

    /// Adds the velocity of the mean rotations times a change of the phase rate to that of the DoFs.
    pub(super) fn take_up_drift(&mut self, change: f64) {
        let Self { primitive, groups, position, clock, .. } = self;
        let Some(coordinates) = primitive.coordinates() else { return };
        let dofs = unpack(position, primitive.n_dofs());
        coordinates.for_each_drift(clock.value(), dofs, |dof, velocity| {
            for (i, velocity) in velocity.into_iter().enumerate() {
                let (group, lane) = place(dof + i);
                groups[group].z.as_mut_array()[lane] += velocity * change;
            }
        });
    }

    /// Expresses the rotations about the mean at another clock, before the clock is set to it: they and their angular
    /// velocities stay.
    pub(super) fn move_rotations(&mut self, to: f64) {
        let Self { primitive, groups, position, velocity, clock, rate, perturbation, .. } = self;
        let Some(coordinates) = primitive.coordinates() else { return };
        let rate = first_element(rate.value());
        if rate <= 0.0 {
            // In a pause nothing moves, but the state changes its place.
            move_still(coordinates, [clock.value(), to], position);
            return self.limiter.place_turns(&self.position);
        }
        let phase_rate = perturbation.phase_rate();
        for rotation in coordinates.rotations() {
            let scale = 1.0 / rate;
            let before = [vector_at(position, rotation.dof), vector_at(velocity, rotation.dof).map(|x| x * scale)];
            let after = Coordinates::moved(rotation, [clock.value(), to], phase_rate, before);
            for i in 0..3 {
                let (group, lane) = place(rotation.dof + i);
                position[group].as_mut_array()[lane] = after[0][i];
                groups[group].z.as_mut_array()[lane] += after[1][i] - before[1][i];
            }
        }
        self.limiter.place_turns(&self.position);
    }

    /// Takes up a commanded goal or anchor in coordinates; returns whether it has changed.
    pub(super) fn command_centre(&mut self, command: &Command) -> bool {
        let Self { pose, primitive, conditions, started, .. } = self;
        let (Some(pose), Some(coordinates)) = (pose, primitive.coordinates()) else { return false };
        let Some(centre) = command.goal.or(command.anchor) else { return false };
        // Before the first tick a residual rotation changes by the shorter way from the start.
        let start = conditions.start.as_ref().filter(|_| !*started && command.goal.is_some());
        let is_wound = pose.set_centre(coordinates, centre, start.unwrap_or(&conditions.centre));
        if pose.command == conditions.centre {
            return false;
        }
        conditions.centre.copy_from_slice(&pose.command);
        if is_wound && self.started {
            self.unwind();
        }
        true
    }

    /// Expresses wound-up rotations by the residuals closest to the commanded goal. They and their angular velocities stay;
    /// the frame moves with them.
    fn unwind(&mut self) {
        let Self { primitive, conditions, groups, position, velocity, centre, rate, .. } = self;
        let Some(coordinates) = primitive.coordinates() else { return };
        let rate = first_element(rate.value());
        for rotation in coordinates.rotations() {
            let (delta, goal) = (vector_at(position, rotation.dof), rotation.read(&conditions.centre));
            let new = log_near(exp(delta), goal);
            let slope = vector_at(velocity, rotation.dof).map(|x| if rate > 0.0 { x / rate } else { 0.0 });
            let new_slope = inverse_jacobian(new, jacobian(delta, slope));
            for i in 0..3 {
                let (group, lane) = place(rotation.dof + i);
                position[group].as_mut_array()[lane] = new[i];
                groups[group].z.as_mut_array()[lane] += new_slope[i] - slope[i];
                let mut frame = centre.value()[group];
                frame.as_mut_array()[lane] += new[i] - delta[i];
                centre.set_value(group, frame);
            }
        }
        self.limiter.place_turns(&self.position);
    }

    /// Gives the three DoFs of each rotation the length of its distance from the goal, which depends on no frame.
    pub(super) fn share_lengths(&mut self) {
        let Self { primitive, groups, position, centre, .. } = self;
        let largest = largest_range(primitive.ranges());
        for dof in primitive.rotation_dofs() {
            let at = |i: usize| place(dof + i);
            let off: [f64; 3] = std::array::from_fn(|i| {
                let (group, lane) = at(i);
                (centre.target()[group] - position[group]).as_array()[lane]
            });
            let distance = dot(off, off).sqrt();
            let rounding = (0..3).map(|i| groups[at(i).0].rounding.as_array()[at(i).1]).fold(0.0f64, f64::max);
            for i in 0..3 {
                let (group, lane) = at(i);
                let length = groups[group].length_at(F64x4::splat(distance), largest);
                groups[group].length.as_mut_array()[lane] = length.as_array()[lane];
                groups[group].rounding.as_mut_array()[lane] = rounding;
            }
        }
    }

    /// Returns the size of the vector of a rotation, given the vector of each group.
    pub(super) fn size_of(&self, dof: usize, of_group: &dyn Fn(usize) -> F64x4) -> f64 {
        let vector: [f64; 3] = std::array::from_fn(|i| {
            let (group, lane) = place(dof + i);
            of_group(group).as_array()[lane]
        });
        dot(vector, vector).sqrt()
    }

    /// Returns whether every DoF is within its bound, given deviation and bound of a group, and the deviation of the rotation
    /// from a DoF on.
    pub(super) fn is_within(&self, of_group: impl Fn(usize) -> [F64x4; 2], of_rotation: impl Fn(usize) -> f64) -> bool {
        let at = |dof: usize| {
            let (group, lane) = place(dof);
            of_group(group).map(|lanes| lanes.as_array()[lane])
        };
        let in_rotation = |dof: usize| self.primitive.rotation_dofs().any(|first| (first..first + 3).contains(&dof));
        let plain = (0..self.primitive.n_dofs()).filter(|&dof| !in_rotation(dof)).all(|dof| {
            let [deviation, bound] = at(dof);
            deviation <= bound
        });
        plain && self.primitive.rotation_dofs().all(|dof| of_rotation(dof) <= at(dof)[1])
    }
}

/// Moves rotations without velocity as [`Controller::move_rotations`] does.
fn move_still(coordinates: &Coordinates, clocks: [f64; 2], position: &mut [F64x4]) {
    for rotation in coordinates.rotations() {
        let still = [vector_at(position, rotation.dof), [0.0; 3]];
        let [moved, _] = Coordinates::moved(rotation, clocks, 0.0, still);
        for (i, x) in moved.into_iter().enumerate() {
            let (group, lane) = place(rotation.dof + i);
            position[group].as_mut_array()[lane] = x;
        }
    }
}

/// Returns the group of a DoF and its lane.
pub(super) fn place(dof: usize) -> (usize, usize) {
    (dof / WIDTH, dof % WIDTH)
}

/// Returns the three DoFs from one on.
pub(super) fn vector_at(lanes: &[F64x4], dof: usize) -> Vector {
    std::array::from_fn(|i| {
        let (group, lane) = place(dof + i);
        lanes[group].as_array()[lane]
    })
}

/// Sets the three DoFs from one on.
pub(super) fn set_vector(lanes: &mut [F64x4], dof: usize, vector: Vector) {
    for (i, x) in vector.into_iter().enumerate() {
        let (group, lane) = place(dof + i);
        lanes[group].as_mut_array()[lane] = x;
    }
}
