//! Columns of demonstrations that are unit quaternions.

use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::{Demonstration, Sampling, turn_of};
use crate::error::{Error, Result, RotationError};

/// Quaternion [w, x, y, z].
type Quaternion = [f64; 4];

/// Order of the components of a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QuaternionOrder {
    /// Scalar part first.
    Wxyz,
    /// Scalar part last.
    Xyzw,
}

/// Four columns that are a unit quaternion, which rotates from the body frame to the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationColumns {
    /// First of the four columns.
    pub column: usize,
    /// Order of the components.
    pub order: QuaternionOrder,
}

/// Largest deviation of the norm of a quaternion from 1: rounding to three digits is mended, other data are not a rotation.
pub(crate) const MAX_NORM_DEVIATION: f64 = 1e-3;

impl RotationColumns {
    /// Returns the quaternion [w, x, y, z] in a row of coordinates.
    #[inline]
    pub(crate) fn read(self, coordinates: &[f64]) -> Quaternion {
        let own = &coordinates[self.column..self.column + 4];
        let [a, b, c, d] = [own[0], own[1], own[2], own[3]];
        match self.order {
            QuaternionOrder::Wxyz => [a, b, c, d],
            QuaternionOrder::Xyzw => [d, a, b, c],
        }
    }

    /// Writes a quaternion [w, x, y, z] to a row of coordinates.
    #[inline]
    pub(crate) fn write(self, [w, x, y, z]: Quaternion, coordinates: &mut [f64]) {
        coordinates[self.column..self.column + 4].copy_from_slice(&match self.order {
            QuaternionOrder::Wxyz => [w, x, y, z],
            QuaternionOrder::Xyzw => [x, y, z, w],
        });
    }

    /// Returns the columns of x, y and z.
    pub(crate) fn vector_columns(self) -> [usize; 3] {
        let first = self.column + usize::from(self.order == QuaternionOrder::Wxyz);
        [first, first + 1, first + 2]
    }

    /// Returns the quaternion [w, x, y, z] of a row with its norm made 1.
    ///
    /// # Errors
    /// A norm that deviates from 1 by more than 1e-3.
    pub(crate) fn unit(self, name: &'static str, row: Option<usize>, coordinates: &[f64]) -> Result<Quaternion> {
        let q = self.read(coordinates);
        let norm = size(q);
        if (norm - 1.0).abs() <= MAX_NORM_DEVIATION {
            return Ok(q.map(|x| x / norm));
        }
        Err(Error::Rotation(RotationError::Norm { name, row, column: self.column, norm }))
    }

    /// Returns the quaternions of rows as [`RotationColumns::unit`].
    pub(crate) fn units(self, name: &'static str, rows: ArrayView2<f64>) -> Result<Vec<Quaternion>> {
        rows.rows().into_iter().enumerate().map(|(t, row)| self.unit(name, Some(t), &row.to_vec())).collect()
    }
}

/// Returns the columns and DoFs (column, DoF) of the coordinates that are no part of a rotation, and the first DoF of each
/// rotation.
pub(crate) fn layout(n_coordinates: usize, rotations: &[RotationColumns]) -> (Vec<[usize; 2]>, Vec<usize>) {
    let (mut plain, mut firsts, mut column, mut dof) = (Vec::new(), Vec::new(), 0, 0);
    while column < n_coordinates {
        if rotations.iter().any(|rotation| rotation.column == column) {
            firsts.push(dof);
            (column, dof) = (column + 4, dof + 3);
        } else {
            plain.push([column, dof]);
            (column, dof) = (column + 1, dof + 1);
        }
    }
    (plain, firsts)
}

/// Returns the DoFs of the point of each pose: the three columns before a rotation, else after it, with one unit that is none
/// of an angle.
pub(crate) fn points(units: &[String], rotations: &[RotationColumns]) -> Vec<Range<usize>> {
    let (mut plain, _) = layout(units.len(), rotations);
    let mut points = Vec::new();
    for rotation in rotations {
        let dof = |column: usize| plain.iter().find(|[other, _]| *other == column).map(|[_, dof]| *dof);
        let is_point = |&column: &usize| {
            let other = (column..column + 3).find(|&c| dof(c).is_none() || units[c] != units[column]);
            other.is_none() && turn_of(&units[column]).is_none()
        };
        let sides = [rotation.column.checked_sub(3), Some(rotation.column + 4)];
        let Some(column) = sides.into_iter().flatten().find(is_point) else { continue };
        points.extend(dof(column).map(|dof| dof..dof + 3));
        plain.retain(|[other, _]| !(column..column + 3).contains(other));
    }
    points
}

impl Demonstration {
    /// Declares columns that are unit quaternions. Their norms become 1, and their signs continuous along time.
    ///
    /// ```
    /// # use ndarray::Array2;
    /// # use pdmp_core::{Demonstration, Sampling};
    /// use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
    ///
    /// # fn main() -> pdmp_core::Result<()> {
    /// // Height, and a turn about the vertical axis.
    /// let position = Array2::from_shape_fn((50, 5), |(c, d)| match d {
    ///     0 => c as f64 / 50.0,
    ///     1 => (0.01 * c as f64).cos(),
    ///     4 => (0.01 * c as f64).sin(),
    ///     _ => 0.0,
    /// });
    /// let rotation = RotationColumns { column: 1, order: QuaternionOrder::Wxyz };
    /// let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?.with_rotations(vec![rotation])?;
    /// assert_eq!((demo.n_coordinates(), demo.n_dofs()), (5, 4));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Columns that do not exist or overlap, or a quaternion in the positions or the goal whose norm deviates from 1 by more
    /// than 1e-3.
    pub fn with_rotations(mut self, mut rotations: Vec<RotationColumns>) -> Result<Self> {
        rotations.sort_by_key(|rotation| rotation.column);
        let n = self.n_coordinates();
        if let Some(last) = rotations.last().filter(|last| last.column.saturating_add(4) > n) {
            let allowed = "must leave room for the four columns of a quaternion";
            return Err(Error::Range { name: "rotations", value: last.column as f64, allowed });
        }
        if let Some(pair) = rotations.windows(2).find(|pair| pair[0].column + 4 > pair[1].column) {
            let allowed = "is a column of the rotation before it: each has four columns of its own";
            return Err(Error::Range { name: "rotations", value: pair[1].column as f64, allowed });
        }
        for rotation in &rotations {
            let mut before: Option<Quaternion> = None;
            for (c, mut row) in self.position.outer_iter_mut().enumerate() {
                let mut coordinates = row.to_vec();
                let unit = rotation.unit("position", Some(c), &coordinates)?;
                let q = before.map_or(unit, |before| on_side_of(unit, before));
                rotation.write(q, &mut coordinates);
                row.assign(&ndarray::aview1(&coordinates));
                before = Some(q);
            }
        }
        self.rotations = rotations;
        self.unit_goal()
    }

    /// Makes the norms of the quaternions of the goal 1.
    pub(super) fn unit_goal(mut self) -> Result<Self> {
        if let Some(goal) = &mut self.goal {
            for rotation in &self.rotations {
                let q = rotation.unit("goal", None, goal)?;
                rotation.write(q, goal);
            }
        }
        Ok(self)
    }

    /// Returns the movement with other samples; goal, context, names, units and rotations are kept. Quaternions that were
    /// interpolated or filtered by components are normalised.
    ///
    /// # Errors
    /// As for [`Demonstration::new`], or a quaternion that is nearly zero.
    pub(crate) fn sampled(&self, mut position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        /// Components whose signs are continuous have this norm between samples a third of a turn apart.
        const MIN_NORM: f64 = 0.5;
        for rotation in &self.rotations {
            for (c, mut row) in position.outer_iter_mut().enumerate() {
                let mut coordinates = row.to_vec();
                let q = rotation.read(&coordinates);
                let norm = size(q);
                if norm.is_nan() || norm < MIN_NORM {
                    return Err(Error::Rotation(RotationError::Norm {
                        name: "position",
                        row: Some(c),
                        column: rotation.column,
                        norm,
                    }));
                }
                rotation.write(q.map(|x| x / norm), &mut coordinates);
                row.assign(&ndarray::aview1(&coordinates));
            }
        }
        let Self { goal, context, names, units, rotations, .. } = self.clone();
        Ok(Self { goal, context, names, units, rotations, ..Self::new(position, sampling)? })
    }

    /// Returns the columns of each rotation, whose components belong together.
    pub(crate) fn quaternion_columns(&self) -> Vec<Range<usize>> {
        self.rotations.iter().map(|rotation| rotation.column..rotation.column + 4).collect()
    }

    /// Returns the columns that are unit quaternions, in increasing order.
    pub fn rotations(&self) -> &[RotationColumns] {
        &self.rotations
    }
}

fn size(q: Quaternion) -> f64 {
    q.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns q or −q, that closer to a reference.
fn on_side_of(q: Quaternion, reference: Quaternion) -> Quaternion {
    let product: f64 = q.iter().zip(reference).map(|(a, b)| a * b).sum();
    if product < 0.0 { q.map(|x| -x) } else { q }
}
