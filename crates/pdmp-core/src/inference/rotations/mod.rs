//! Observed rotations in the coordinates in which a movement is linear in its parameters.
//!
//! The degrees of freedom of a rotation are δ about the mean rotation q̄ of the demonstrations, q = q̄(u) ⊗ exp(δ). They depend
//! on the clock u, but neither on start nor on goal: under each hypothesis of the time an observed rotation is another δ, and
//! with it three observed positions.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use std::sync::Arc;

use super::movement_table::Place;
use crate::dynamics::mean_rotation::MeanRotation;
use crate::error::Result;
use crate::model::coordinates::Rotation;
use crate::model::primitive::Primitive;
use crate::model::{Coordinates, Frame};
use crate::numerics::rotation::{
    Quaternion, Vector, add_scaled, distance, exp, inverse, jacobian, log, normalised, on_side_of, product, rotate,
};
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute};
use crate::validate::{check_length, check_number};

/// Number of terms of the series of the arc tangent up to tan(π/16): the next one is below 2e-17 of the first.
const N_TERMS: usize = 11;

/// Columns of the coordinates and their degrees of freedom. Without rotations they are the same.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) n_coordinates: usize,
    pub(crate) n_dofs: usize,
    /// Column and DoF of each coordinate outside of rotations.
    pub(crate) plain: Vec<[usize; 2]>,
    /// Coordinates with rotations, if there are any.
    coordinates: Option<Arc<Coordinates>>,
    /// First DoF of each rotation, and of the point of each pose: single components depend on the frame.
    pub(crate) vectors: Vec<usize>,
    frame: Frame,
    /// Clock at the end of the movement or period.
    extent: f64,
    /// Clock at which goals or anchors are relative to the mean rotation.
    centre_clock: f64,
}

/// Position in degrees of freedom, but rotations as unit quaternions.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Positions (D,). Those of a rotation are 0; missing ones are NaN.
    pub(crate) dofs: Vec<f64>,
    rotations: Vec<Quaternion>,
}

impl Sample {
    /// Returns a sample of which everything is missing.
    pub(crate) fn missing(layout: &Layout) -> Self {
        Self { dofs: vec![f64::NAN; layout.n_dofs], rotations: vec![[f64::NAN; 4]; layout.rotations().len()] }
    }

    /// Copies another sample of the same layout.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.dofs.copy_from_slice(&other.dofs);
        self.rotations.copy_from_slice(&other.rotations);
    }
}

/// A 3×3 matrix by rows.
pub(crate) type Matrix = [Vector; 3];

impl Layout {
    pub(crate) fn new(primitive: &Arc<Primitive>) -> Self {
        let n_dofs = primitive.n_dofs();
        let coordinates = primitive.coordinates.clone();
        let (plain, frame, centre_clock) = match &coordinates {
            None => ((0..n_dofs).map(|d| [d, d]).collect(), Frame::Body, 0.0),
            Some(own) => (own.plain().to_vec(), own.frame(), own.centre_clock()),
        };
        let (n_coordinates, extent) = (primitive.n_coordinates(), primitive.canonical().extent());
        let vectors = primitive.vector_dofs();
        Self { n_coordinates, n_dofs, plain, coordinates, vectors, frame, extent, centre_clock }
    }

    /// Returns the rotations.
    pub(crate) fn rotations(&self) -> &[Rotation] {
        self.coordinates.as_ref().map_or(&[], |coordinates| coordinates.rotations())
    }

    /// Returns the owner of an element of a position, in an error text.
    pub(crate) fn per_coordinate(&self) -> &'static str {
        if self.rotations().is_empty() { "DoF" } else { "coordinate" }
    }

    /// Reads a position (n_q,), in which a rotation with a component that is NaN is missing.
    ///
    /// # Errors
    /// A wrong length, an infinite number, or a quaternion whose norm is not 1. The sample then remains as it was.
    pub(crate) fn read(&self, position: &[f64], sample: &mut Sample) -> Result<()> {
        check_length("position", position.len(), self.n_coordinates, self.per_coordinate())?;
        let mut observed = position.iter().enumerate().filter(|(_, y)| !y.is_nan());
        observed.try_for_each(|(k, &y)| check_number("position", k, y))?;
        let missing = |rotation: &Rotation| rotation.columns.read(position).iter().any(|x| x.is_nan());
        for rotation in self.rotations().iter().filter(|rotation| !missing(rotation)) {
            rotation.columns.unit("position", None, position)?;
        }
        self.plain.iter().for_each(|&[column, dof]| sample.dofs[dof] = position[column]);
        for (rotation, q) in self.rotations().iter().zip(&mut sample.rotations) {
            let missing = missing(rotation);
            sample.dofs[rotation.dof..rotation.dof + 3].fill(if missing { f64::NAN } else { 0.0 });
            *q = normalised(rotation.columns.read(position));
        }
        Ok(())
    }

    /// Writes the positions of the DoFs outside of rotations (D,) in four equal lanes.
    pub(crate) fn spread(&self, sample: &Sample, lanes: &mut [F64x4]) {
        lanes.iter_mut().zip(&sample.dofs).for_each(|(lanes, y)| *lanes = F64x4::splat(*y));
    }

    /// Writes δ of each observed rotation at four places, among the DoFs (D,). Its angle is at most π.
    pub(crate) fn about_means(&self, sample: &Sample, places: &[Place; WIDTH], lanes: &mut [F64x4]) {
        for (rotation, &q) in self.rotations().iter().zip(&sample.rotations) {
            if !q[0].is_nan() {
                let (clocks, lanes) =
                    (places.map(|place| self.clock(place)), &mut lanes[rotation.dof..rotation.dof + 3]);
                compute(AboutMean { mean: &rotation.mean, clocks, rotation: q, lanes });
            }
        }
    }

    fn clock(&self, place: Place) -> f64 {
        place.share() * self.extent
    }

    /// Returns the clock at the end of the movement or period.
    #[cfg(test)]
    pub(crate) fn extent(&self) -> f64 {
        self.extent
    }

    /// Returns δ of a lane of the DoFs (D,) of four hypotheses, and the rotation at a place.
    pub(crate) fn turned(
        &self,
        rotation: &Rotation,
        place: Place,
        dofs: &[F64x4],
        lane: usize,
    ) -> (Vector, Quaternion) {
        let delta = [0, 1, 2].map(|i| dofs[rotation.dof + i].as_array()[lane]);
        (delta, product(normalised(rotation.mean.direction(self.clock(place)).to_array()), exp(delta)))
    }

    /// Writes the change (D,) between two positions: a rotation vector in rad in the frame of `from` for rotations.
    pub(crate) fn change(&self, from: &Sample, to: &Sample, change: &mut [f64]) {
        change.iter_mut().zip(from.dofs.iter().zip(&to.dofs)).for_each(|(change, (from, to))| *change = to - from);
        for (rotation, (&from, &to)) in self.rotations().iter().zip(from.rotations.iter().zip(&to.rotations)) {
            change[rotation.dof..rotation.dof + 3].copy_from_slice(&log(product(inverse(from), to)));
        }
    }

    /// Adds the changes (D,) of four hypotheses between two places and the DoFs there, by weight.
    pub(crate) fn add_changes(
        &self,
        places: [[Place; WIDTH]; 2],
        [from, to]: &[Vec<F64x4>; 2],
        weight: F64x4,
        changes: &mut [f64],
    ) {
        for &[_, dof] in &self.plain {
            changes[dof] += (weight * (to[dof] - from[dof])).reduce_add();
        }
        for rotation in self.rotations() {
            for (lane, weight) in weight.to_array().into_iter().enumerate().filter(|(_, weight)| *weight > 0.0) {
                let (_, before) = self.turned(rotation, places[0][lane], from, lane);
                let (_, after) = self.turned(rotation, places[1][lane], to, lane);
                for (change, x) in changes[rotation.dof..].iter_mut().zip(log(product(inverse(before), after))) {
                    *change += weight * x;
                }
            }
        }
    }

    /// Returns the turn from one rotation to another, a rotation vector in rad in the frame of angular velocities.
    pub(crate) fn turn(&self, from: Quaternion, to: Quaternion) -> Vector {
        let turn = log(product(inverse(from), to));
        if self.frame == Frame::World { rotate(from, turn) } else { turn }
    }

    /// Writes the DoFs (D,) of a position (n_q,) at a fraction of the duration or period.
    pub(crate) fn dofs(&self, share: f64, position: &[f64], dofs: &mut [f64]) {
        self.plain.iter().for_each(|&[column, dof]| dofs[dof] = position[column]);
        for rotation in self.rotations() {
            let mean = normalised(rotation.mean.direction(share * self.extent).to_array());
            let delta = log(product(inverse(mean), rotation.columns.read(position)));
            dofs[rotation.dof..rotation.dof + 3].copy_from_slice(&delta);
        }
    }

    /// Replaces the variances of the components of each rotation by those of rotation vectors from the mean of all positions.
    pub(crate) fn set_variances(&self, positions: &[Vec<f64>], variances: &mut [f64]) {
        for rotation in self.rotations() {
            let all = positions.iter().map(|position| rotation.columns.read(position));
            let sum = all.clone().fold([0.0; 4], |sum, q| add_scaled(sum, 1.0, on_side_of(q, sum)));
            let centre = normalised(sum);
            let square: f64 = all.map(|q| distance(centre, q).powi(2)).sum();
            variances[rotation.dof..rotation.dof + 3].fill(square / (3 * positions.len()) as f64);
        }
    }

    /// Writes the errors (D,) of a predicted position (n_q,), in the frame of angular velocities for rotations.
    pub(crate) fn errors(&self, predicted: &[f64], position: &[f64], errors: &mut [f64]) {
        self.plain.iter().for_each(|&[column, dof]| errors[dof] = position[column] - predicted[column]);
        for rotation in self.rotations() {
            let [from, to] = [predicted, position].map(|position| normalised(rotation.columns.read(position)));
            errors[rotation.dof..rotation.dof + 3].copy_from_slice(&self.turn(from, to));
        }
    }

    /// Replaces numbers (D,) by their means over the components of each vector.
    pub(crate) fn share(&self, numbers: &mut [f64]) {
        for &dof in &self.vectors {
            let mean = numbers[dof..dof + 3].iter().sum::<f64>() / 3.0;
            numbers[dof..dof + 3].fill(mean);
        }
    }

    /// Returns the map from changes of δ to small rotations of `rotation` in the frame of angular velocities, by rows.
    pub(crate) fn tangent(&self, delta: Vector, rotation: Quaternion) -> Matrix {
        let column = |i: usize| {
            let unit: Vector = std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
            let turn = jacobian(delta, unit);
            if self.frame == Frame::World { rotate(rotation, turn) } else { turn }
        };
        let columns = [0, 1, 2].map(column);
        std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))
    }

    /// Returns the clocks of goal and start, or of the anchor.
    pub(crate) fn clocks(&self) -> [f64; 2] {
        [self.centre_clock, 0.0]
    }

    /// Writes a position (n_q,) for DoFs (D,) at a clock. Quaternions have the sign of the mean rotation, so that they are
    /// continuous along the movement.
    pub(crate) fn write(&self, u: f64, dofs: &[f64], position: &mut [f64]) {
        self.plain.iter().for_each(|&[column, dof]| position[column] = dofs[dof]);
        for rotation in self.rotations() {
            let mean = normalised(rotation.mean.direction(u).to_array());
            rotation.columns.write(product(mean, exp(rotation.read(dofs))), position);
        }
    }
}

/// Kernel that writes δ = log(q̄(u)⁻¹ ⊗ q) at four clocks to three lanes.
///
/// With s and c ≥ 0 for the size of the vector part and the scalar part of the quaternion and α = atan2(s, c),
/// tan(α/2) = s/(c + √(s² + c²)), and tan(α/2) = tan α/(1 + √(1 + tan²α)) halves α twice more.
struct AboutMean<'a> {
    mean: &'a MeanRotation,
    clocks: [f64; WIDTH],
    rotation: Quaternion,
    lanes: &'a mut [F64x4],
}

impl Kernel for AboutMean<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { mean, clocks, rotation: [a, b, c, d], lanes } = self;
        let mut means = [T::default(); WIDTH];
        for l in 0..WIDTH {
            means[l] = T::load(&mean.direction(clocks[l]));
        }
        let [w, x, y, z] = T::transpose(means);
        let scalar = w * a + x * b + y * c + z * d;
        let vector = [w * b - x * a - y * d + z * c, w * c - y * a - z * b + x * d, w * d - z * a - x * c + y * b];
        let square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2];
        let one = T::splat(1.0);
        let first = one / (scalar.abs() + (square + scalar * scalar).sqrt());
        let first_square = square * first * first;
        let second = one / (one + (one + first_square).sqrt());
        let second_square = first_square * second * second;
        let third = one / (one + (one + second_square).sqrt());
        let third_square = second_square * third * third;
        let mut series = T::splat(1.0 / (2 * N_TERMS - 1) as f64);
        for k in (0..N_TERMS - 1).rev() {
            series = T::splat(1.0 / (2 * k + 1) as f64) - series * third_square;
        }
        // 2α over the size of the vector part, with the sign of the scalar part.
        let sign = one - (scalar.simd_lt(T::default()) & T::splat(2.0));
        let factor = series * first * second * third * sign * 16.0;
        for i in 0..3 {
            lanes[i] = (vector[i] * factor).store();
        }
    }
}

#[cfg(all(test, feature = "learning"))]
mod tests;
