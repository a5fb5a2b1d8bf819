//! Coordinates of a primitive with rotations: unit quaternions outside, degrees of freedom inside.
//!
//! A rotation has four coordinates and three degrees of freedom δ, the rotation vector about the mean of the demonstrations:
//! q = q̄(u) ⊗ exp(δ). All other coordinates are degrees of freedom. The goal is relative to q̄ at the end of a discrete
//! movement, the start to q̄ where the movement starts, the anchor of a rhythmic movement to q̄ at phase 0.

use std::sync::Arc;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::demonstration::RotationColumns;
pub(crate) use crate::demonstration::layout;
use crate::dynamics::mean_rotation::MeanRotation;
use crate::error::Result;
use crate::kind::Kind;
use crate::model::primitive::Primitive;
use crate::numerics::rotation::{
    Quaternion, Turning, Vector, add_scaled, cross, dot, exp, inverse, inverse_jacobian, jacobian, log_near,
    on_side_of, product, rotate,
};
use crate::numerics::rotation_transpose::{JacobianPath, turn_cotangent};
use crate::validate::check_vector;

/// Frame in which angular velocities and accelerations are expressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// The frame that rotates, as of a tool.
    #[default]
    Body,
    /// The frame in which the orientation is measured, as of the base of a robot.
    World,
}

/// Linear map of vectors.
type Tangent = dyn Fn(Vector) -> Vector;

/// Layout of the coordinates of a primitive with rotations.
#[derive(Clone, Debug)]
pub struct Coordinates {
    names: Vec<String>,
    units: Vec<String>,
    frame: Frame,
    rotations: Vec<Rotation>,
    /// Column and DoF of each coordinate that is no part of a rotation.
    plain: Vec<[usize; 2]>,
    /// The primitive of the degrees of freedom.
    dofs: Arc<Primitive>,
}

/// A rotation among the coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Rotation {
    pub(crate) columns: RotationColumns,
    /// First of its three degrees of freedom.
    pub(crate) dof: usize,
    pub(crate) mean: MeanRotation,
}

impl Rotation {
    /// Returns δ in a vector of DoFs.
    #[inline(always)]
    pub(crate) fn read(&self, dofs: &[f64]) -> Vector {
        let own = &dofs[self.dof..self.dof + 3];
        [own[0], own[1], own[2]]
    }

    #[inline(always)]
    pub(super) fn write(&self, vector: Vector, dofs: &mut [f64]) {
        dofs[self.dof..self.dof + 3].copy_from_slice(&vector);
    }

    /// Returns the motion at clock `u`, with u̇ and ü, for that of the DoFs.
    #[inline(always)]
    pub(crate) fn motion(&self, u: f64, [rate, rate_change]: [f64; 2], dofs: [&[f64]; 3]) -> Turning {
        let mean = self.mean.at(u);
        let mean = Turning {
            velocity: mean.velocity.map(|x| x * rate),
            acceleration: std::array::from_fn(|i| {
                mean.acceleration[i] * (rate * rate) + mean.velocity[i] * rate_change
            }),
            ..mean
        };
        mean.times_exp(dofs.map(|dofs| self.read(dofs)))
    }

    /// Returns the velocity exp(δ)ᵀω̄ of the mean rotation in the body frame at clock `u`, per unit of the clock.
    pub(super) fn carried(&self, u: f64, delta: Vector) -> Vector {
        rotate(inverse(exp(delta)), self.mean.at(u).velocity)
    }

    /// Returns δ and δ̇ of a motion at clock `u`, for the rate of the mean rotation. δ is that closest to `near`.
    pub(crate) fn residual(&self, u: f64, rate: f64, motion: &Turning, near: Vector) -> [Vector; 2] {
        let delta = log_near(product(inverse(self.mean.at(u).rotation), motion.rotation), near);
        let carried = self.carried(u, delta);
        [delta, inverse_jacobian(delta, add_scaled(motion.velocity, -rate, carried))]
    }
}

impl Coordinates {
    /// Returns the coordinates of a primitive whose DoFs are those of the layout, with a mean of each rotation.
    pub(crate) fn new(
        dofs: Arc<Primitive>,
        names: Vec<String>,
        units: Vec<String>,
        frame: Frame,
        rotations: Vec<(RotationColumns, MeanRotation)>,
    ) -> Self {
        let columns: Vec<RotationColumns> = rotations.iter().map(|(columns, _)| *columns).collect();
        let (plain, firsts) = layout(names.len(), &columns);
        let rotations =
            rotations.into_iter().zip(firsts).map(|((columns, mean), dof)| Rotation { columns, dof, mean }).collect();
        Self { names, units, frame, rotations, plain, dofs }
    }

    /// Returns the primitive of the degrees of freedom.
    pub(crate) fn dofs(&self) -> &Arc<Primitive> {
        &self.dofs
    }

    pub(crate) fn rotations(&self) -> &[Rotation] {
        &self.rotations
    }

    /// Returns column and DoF of each coordinate outside of rotations.
    pub(crate) fn plain(&self) -> &[[usize; 2]] {
        &self.plain
    }

    /// Returns the number of coordinates.
    pub fn n_coordinates(&self) -> usize {
        self.names.len()
    }

    /// Returns the names of the coordinates.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the units of the coordinates; an unknown unit is "".
    pub fn units(&self) -> &[String] {
        &self.units
    }

    /// Returns the columns that are unit quaternions.
    pub fn columns(&self) -> Vec<RotationColumns> {
        self.rotations.iter().map(|rotation| rotation.columns).collect()
    }

    /// Returns the coordinates with another frame.
    pub(crate) fn in_frame(&self, frame: Frame) -> Self {
        Self { frame, ..self.clone() }
    }

    /// Returns the frame of angular velocities and accelerations.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Checks a position: its length, numbers and the norms of its quaternions.
    pub(crate) fn check(&self, name: &'static str, position: &[f64]) -> Result<()> {
        check_vector(name, position, self.n_coordinates(), "coordinate")?;
        self.rotations.iter().try_for_each(|rotation| rotation.columns.unit(name, None, position).map(drop))
    }

    /// Converts a valid position to DoFs at clock `u`. A residual rotation is that closest to `near`.
    pub(crate) fn to_dofs(&self, u: f64, position: &[f64], near: Option<&[f64]>, dofs: &mut [f64]) {
        self.plain.iter().for_each(|&[column, dof]| dofs[dof] = position[column]);
        for rotation in &self.rotations {
            let q = crate::numerics::rotation::normalised(rotation.columns.read(position));
            let off = product(inverse(rotation.mean.at(u).rotation), q);
            let near = near.map_or([0.0; 3], |near| rotation.read(near));
            rotation.write(log_near(off, near), dofs);
        }
    }

    /// Converts DoFs at clock `u` to a position. A quaternion has the sign closer to that in `position` on entry.
    pub(crate) fn to_position(&self, u: f64, dofs: &[f64], position: &mut [f64]) {
        self.plain.iter().for_each(|&[column, dof]| position[column] = dofs[dof]);
        for rotation in &self.rotations {
            let q = product(rotation.mean.at(u).rotation, exp(rotation.read(dofs)));
            rotation.columns.write(on_side_of(q, rotation.columns.read(position)), position);
        }
    }

    /// Converts rows of DoFs at clock `u` to positions.
    pub(crate) fn positions(&self, u: f64, dofs: &Array2<f64>) -> Array2<f64> {
        let mut positions = Array2::zeros((dofs.nrows(), self.n_coordinates()));
        for (row, mut position) in dofs.rows().into_iter().zip(positions.rows_mut()) {
            let mut to = vec![0.0; self.n_coordinates()];
            self.to_position(u, &row.to_vec(), &mut to);
            position.assign(&ndarray::aview1(&to));
        }
        positions
    }

    /// Returns the clock at which goals and anchors are relative to the mean rotation.
    pub(crate) fn centre_clock(&self) -> f64 {
        match self.dofs.kind() {
            Kind::Discrete => self.dofs.canonical().extent(),
            Kind::Rhythmic => 0.0,
        }
    }

    /// Converts the motion of the DoFs at clock `u`, with u̇ and ü, to position, velocity and acceleration.
    ///
    /// A quaternion has the sign closer to that in `position` on entry.
    #[inline(always)]
    pub(crate) fn motion(
        &self,
        u: f64,
        rates: [f64; 2],
        dofs: [&[f64]; 3],
        position: &mut [f64],
        velocity: &mut [f64],
        acceleration: &mut [f64],
    ) {
        self.write_plain(dofs, position, velocity, acceleration);
        for rotation in &self.rotations {
            self.write(rotation, rotation.motion(u, rates, dofs), position, velocity, acceleration);
        }
    }

    /// Writes the motion of the DoFs that are no part of a rotation.
    #[inline(always)]
    pub(crate) fn write_plain(
        &self,
        dofs: [&[f64]; 3],
        position: &mut [f64],
        velocity: &mut [f64],
        acceleration: &mut [f64],
    ) {
        for &[column, dof] in &self.plain {
            position[column] = dofs[0][dof];
            velocity[dof] = dofs[1][dof];
            acceleration[dof] = dofs[2][dof];
        }
    }

    /// Writes the motion of a rotation, in the body frame, to position, velocity and acceleration in that of the coordinates.
    ///
    /// A quaternion has the sign closer to that in `position` on entry.
    #[inline(always)]
    pub(crate) fn write(
        &self,
        rotation: &Rotation,
        mut moved: Turning,
        position: &mut [f64],
        velocity: &mut [f64],
        acceleration: &mut [f64],
    ) {
        if self.frame == Frame::World {
            moved.velocity = rotate(moved.rotation, moved.velocity);
            moved.acceleration = rotate(moved.rotation, moved.acceleration);
        }
        rotation.columns.write(on_side_of(moved.rotation, rotation.columns.read(position)), position);
        rotation.write(moved.velocity, velocity);
        rotation.write(moved.acceleration, acceleration);
    }

    /// Passes the cotangents of position, velocity and acceleration to those of the motion of the DoFs, of which
    /// [`Self::motion`] made them. Returns the products of the cotangents of position and velocity with their derivatives by
    /// time, and of that of the velocity with it.
    pub(crate) fn pull_back(
        &self,
        dofs: [&[f64]; 3],
        [position, velocity, acceleration]: [&[f64]; 3],
        [by_position, by_velocity, by_acceleration]: [&[f64]; 3],
        by_dofs: &mut [Vec<f64>; 3],
    ) -> [f64; 2] {
        let (mut slopes, mut velocities) = (0.0, 0.0);
        for &[column, dof] in &self.plain {
            let [v, flow, bend] = [by_position[column], by_velocity[dof], by_acceleration[dof]];
            by_dofs.iter_mut().zip([v, flow, bend]).for_each(|(to, v)| to[dof] = v);
            slopes += v * velocity[dof] + flow * acceleration[dof];
            velocities += flow * velocity[dof];
        }
        for rotation in &self.rotations {
            let q = rotation.columns.read(position);
            let mut turn = turn_cotangent(q, rotation.columns.read(by_position));
            let mut vectors = [velocity, acceleration, by_velocity, by_acceleration].map(|row| rotation.read(row));
            if self.frame == Frame::World {
                vectors = vectors.map(|v| rotate(inverse(q), v));
            }
            let [velocity, acceleration, mut flow, bend] = vectors;
            slopes += dot(turn, velocity) + dot(flow, acceleration);
            velocities += dot(flow, velocity);
            if self.frame == Frame::Body {
                turn = add_scaled(add_scaled(turn, 1.0, cross(flow, velocity)), 1.0, cross(bend, acceleration));
            }
            flow = add_scaled(flow, 1.0, cross(bend, velocity));
            let found = JacobianPath::new(dofs.map(|dofs| rotation.read(dofs))).pull_back([turn, flow, bend]);
            by_dofs.iter_mut().zip(found).for_each(|(to, v)| rotation.write(v, to));
        }
        [slopes, velocities]
    }

    /// Converts velocities to those of the DoFs at `dofs` and clock `u`, J⁻¹(δ)ω, without the motion of the mean rotation.
    pub(crate) fn relative_velocity(&self, u: f64, dofs: &[f64], velocity: &mut [f64]) {
        for rotation in &self.rotations {
            let (delta, mut omega) = (rotation.read(dofs), rotation.read(velocity));
            if self.frame == Frame::World {
                let q = product(rotation.mean.at(u).rotation, exp(delta));
                omega = rotate(inverse(q), omega);
            }
            rotation.write(inverse_jacobian(delta, omega), velocity);
        }
    }

    /// Calls a function with the first DoF of each rotation and the velocity J⁻¹(δ)exp(δ)ᵀω̄ of its DoFs, per unit of the
    /// clock, which offsets the motion of the mean rotation.
    pub(crate) fn for_each_drift(&self, u: f64, dofs: &[f64], mut visit: impl FnMut(usize, Vector)) {
        for rotation in &self.rotations {
            let delta = rotation.read(dofs);
            visit(rotation.dof, inverse_jacobian(delta, rotation.carried(u, delta)));
        }
    }

    /// Calls a function with the first DoF of each rotation at clock `u`, the map J(δ) from changes of δ to small rotations
    /// in the frame of the coordinates, and its inverse.
    pub(crate) fn for_each_tangent(&self, u: f64, dofs: &[f64], mut visit: impl FnMut(usize, &Tangent, &Tangent)) {
        for rotation in &self.rotations {
            let delta = rotation.read(dofs);
            let q = product(rotation.mean.at(u).rotation, exp(delta));
            let world = self.frame == Frame::World;
            let forward = move |v: Vector| if world { rotate(q, jacobian(delta, v)) } else { jacobian(delta, v) };
            let backward = move |v: Vector| inverse_jacobian(delta, if world { rotate(inverse(q), v) } else { v });
            visit(rotation.dof, &forward, &backward);
        }
    }

    /// Expresses the state of a rotation, δ and δ′ per unit of the clock at `from`, about the mean rotation at clock `to`.
    /// Rotation and angular velocity stay; `rate` is the rate of the mean rotation relative to the clock.
    pub(crate) fn moved(
        rotation: &Rotation,
        [from, to]: [f64; 2],
        rate: f64,
        [delta, slope]: [Vector; 2],
    ) -> [Vector; 2] {
        let [before, after] = [from, to].map(|u| rotation.mean.at(u));
        let q: Quaternion = product(before.rotation, exp(delta));
        let own = rotate(inverse(exp(delta)), before.velocity);
        let turn = jacobian(delta, slope);
        let omega: Vector = std::array::from_fn(|i| rate * own[i] + turn[i]);
        let new = log_near(product(inverse(after.rotation), q), delta);
        let carried = rotate(inverse(exp(new)), after.velocity);
        let rest: Vector = std::array::from_fn(|i| omega[i] - rate * carried[i]);
        [new, inverse_jacobian(new, rest)]
    }
}
