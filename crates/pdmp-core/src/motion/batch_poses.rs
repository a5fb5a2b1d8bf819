//! Batches of a primitive with rotations: movements of the degrees of freedom, converted to coordinates sample by sample, and
//! cotangents converted back.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayView3, ArrayViewMut1, ArrayViewMut3, Axis, aview1, s};

use crate::error::{Error, Result};
use crate::model::Coordinates;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::motion::batch::Batch;
use crate::motion::batch_conditions::BatchConditions;
use crate::motion::jacobian::WithRespectTo;
use crate::motion::response_products::Product;
use crate::motion::superposition;
use crate::validate::{row_major, row_major_mut};

/// Primitive with rotations, and the conditions of the movements of a batch in its coordinates.
#[derive(Clone, Debug)]
pub(super) struct Poses {
    pub(super) primitive: Arc<Primitive>,
    pub(super) conditions: BatchConditions,
}

/// Function of the motion at a sample.
type Visit<'a> = dyn FnMut(&Coordinates, [usize; 2], [&[f64]; 3], &[Vec<f64>; 3]) + 'a;

/// Cotangents of the motion of the DoFs of consecutive movements.
pub(super) struct DofCotangents {
    /// Those of positions, velocities and accelerations (n, T, D).
    pub(super) orders: Vec<Array3<f64>>,
    /// Σₖ k⟨v⁽ᵏ⁾, y⁽ᵏ⁾⟩ + Σₖ⟨t·v⁽ᵏ⁾, y⁽ᵏ⁺¹⁾⟩ of each movement in coordinates.
    pub(super) scaled_times: Vec<f64>,
}

impl Poses {
    /// Refuses a variable for cotangents of several orders.
    pub(super) fn check(&self, variable: WithRespectTo, n_orders: usize) -> Result<()> {
        if variable != WithRespectTo::Tau || n_orders < 3 {
            return Ok(());
        }
        let problem = "does not apply to accelerations of a model with rotations: their derivative by tau needs the angular \
                       jerk; use velocities";
        Err(Error::Argument { name: "tau", problem })
    }
}

impl Batch {
    /// Writes movements that share responses from `first` on, in coordinates.
    pub(super) fn write_poses(&self, poses: &Poses, first: usize, mut outputs: Vec<ArrayViewMut3<f64>>) -> Result<()> {
        let (n, n_orders) = (outputs.first().map_or(0, |output| output.len_of(Axis(0))), outputs.len());
        self.for_each_pose(poses, first..first + n, n_orders, &mut |_, [b, k], _, moved| {
            for (output, moved) in outputs.iter_mut().zip(moved) {
                output.slice_mut(s![b, k, ..]).assign(&aview1(moved));
            }
        })
    }

    /// Converts the cotangents of movements from `first` on to those of the DoFs.
    pub(super) fn pull_back(
        &self,
        poses: &Poses,
        first: usize,
        cotangents: &[ArrayView3<f64>],
        by_tau: bool,
    ) -> Result<DofCotangents> {
        let ((_, n_samples, n_dofs), n) = (self.shape(), cotangents[0].len_of(Axis(0)));
        let mut found = DofCotangents {
            orders: vec![Array3::zeros((n, n_samples, n_dofs)); cotangents.len()],
            scaled_times: vec![0.0; n],
        };
        let cotangents: Vec<_> = cotangents.iter().map(|array| array.as_standard_layout()).collect();
        // A change of τ moves each order along the next.
        let n_orders = (cotangents.len() + usize::from(by_tau)).min(3);
        let zeros = vec![0.0; n_dofs];
        let mut by_dofs = [(); 3].map(|()| zeros.clone());
        self.for_each_pose(poses, first..first + n, n_orders, &mut |coordinates, [b, k], dofs, moved| {
            let sample = b * n_samples + k;
            let mut given = [&zeros[..]; 3];
            for (given, array) in given.iter_mut().zip(&cotangents) {
                let n = array.len_of(Axis(2));
                *given = &row_major(array)[sample * n..][..n];
            }
            let moved = moved.each_ref().map(|row| &row[..]);
            let [slopes, velocities] = coordinates.pull_back(dofs, moved, given, &mut by_dofs);
            found.scaled_times[b] += k as f64 * self.dt * slopes + velocities;
            for (array, row) in found.orders.iter_mut().zip(&by_dofs) {
                row_major_mut(array)[sample * n_dofs..][..n_dofs].copy_from_slice(row);
            }
        })?;
        Ok(found)
    }

    /// Calls a function with the coordinates, index in the range and sample, and the motion of the DoFs and of the coordinates
    /// at each sample of a range of movements. Derivatives from `n_orders` on are not those of the movement.
    fn for_each_pose(&self, poses: &Poses, movements: Range<usize>, n_orders: usize, visit: &mut Visit) -> Result<()> {
        let Some(coordinates) = poses.primitive.coordinates() else { return Ok(()) };
        let (_, n_samples, n_dofs) = self.shape();
        let mut dofs = [(); 3].map(|()| Array2::zeros((n_samples, n_dofs)));
        let mut moved = [vec![0.0; coordinates.n_coordinates()], vec![0.0; n_dofs], vec![0.0; n_dofs]];
        let mut clock = Vec::new();
        for (index, b) in movements.enumerate() {
            if index == 0 || self.singles.is_some() {
                clock = self.clock(b, n_samples)?;
            }
            self.write_dofs(coordinates, b, &mut dofs[..n_orders])?;
            moved[0].fill(0.0);
            for (k, &[u, rates @ ..]) in clock.iter().enumerate() {
                let row = dofs.each_ref().map(|dofs| &row_major(dofs)[k * n_dofs..][..n_dofs]);
                let [position, velocity, acceleration] = &mut moved;
                coordinates.motion(u, rates, row, position, velocity, acceleration);
                visit(coordinates, [index, k], row, &moved);
            }
        }
        Ok(())
    }

    /// Writes the gradient by a condition of movement `b` that is a position or a velocity, or by τ.
    pub(super) fn write_pose_gradient(
        &self,
        poses: &Poses,
        b: usize,
        variable: WithRespectTo,
        product: &Product,
        mut gradient: ArrayViewMut1<f64>,
    ) -> Result<()> {
        let Some(coordinates) = poses.primitive.coordinates() else { return Ok(()) };
        let Product { centre, start, velocity, goal_velocity, .. } = product;
        let mut centre = centre.clone();
        if self.starts.is_some() {
            centre.iter_mut().zip(start).for_each(|(centre, start)| *centre -= start);
        }
        let rate = self.clock(b, 1)?[0][1];
        let by_dofs = [&centre, start, velocity, goal_velocity].map(|by| &by[..]);
        let found = coordinates.pull_back_conditions(&poses.conditions.movement(b), rate, by_dofs)?;
        let vector = match variable {
            WithRespectTo::Start => found.start,
            WithRespectTo::Velocity => found.velocity,
            WithRespectTo::GoalVelocity => found.goal_velocity,
            WithRespectTo::Tau => vec![(found.velocities - product.scaled_time) / self.tau_of(b)],
            _ => found.centre,
        };
        gradient.assign(&aview1(&vector));
        Ok(())
    }

    /// Writes the motion of the DoFs of movement `b`, up to an order.
    fn write_dofs(&self, coordinates: &Coordinates, b: usize, dofs: &mut [Array2<f64>]) -> Result<()> {
        if let Some(singles) = &self.singles {
            return singles.write_dofs(coordinates, b, dofs);
        }
        let combination = self.combination(b);
        for (derivative, dofs) in Derivative::ALL.into_iter().zip(dofs) {
            let curves = self.responses.of(derivative);
            let output = dofs.view_mut().insert_axis(Axis(0));
            superposition::write(std::slice::from_ref(&combination), curves, derivative, output);
        }
        Ok(())
    }

    /// Returns the clock u of movement `b` with u̇ and ü at the first `n` samples.
    fn clock(&self, b: usize, n: usize) -> Result<Vec<[f64; 3]>> {
        let rate = 1.0 / self.tau;
        match &self.singles {
            Some(singles) => singles.clock(b, n),
            None => Ok((0..n).map(|k| [k as f64 * self.dt * rate, rate, 0.0]).collect()),
        }
    }
}
