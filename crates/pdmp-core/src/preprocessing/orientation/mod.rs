//! Conversions of orientations: rotation matrices, rotation vectors, axes and angles, Euler angles and homogeneous
//! transforms to unit quaternions, and back.
//!
//! All of them rotate from the body frame to the world frame. Rows are samples along time: the signs of quaternions are
//! continuous from w ≥ 0 in the first sample, and so are rotation vectors and Euler angles, which grow past a half turn.

mod euler;
mod matrices;

use ndarray::{Array2, ArrayView2, aview1};

use crate::demonstration::{QuaternionOrder, RotationColumns};
use crate::error::{Error, Result, RotationError};
use crate::numerics::rotation::{Quaternion, Vector, dot, exp, log, log_near, normalised, on_side_of};
use crate::validate::{check_length, check_matrix, check_vector};

pub use euler::{EulerAngles, EulerSequence, euler_to_quaternions, quaternions_to_euler};
pub use matrices::{matrices_to_quaternions, poses_to_transforms, quaternions_to_matrices, transforms_to_poses};

/// Norm of an axis below which its direction is mostly rounding.
const MIN_AXIS: f64 = 1e-9;

/// Converts rotation vectors (T, 3), in rad about the axes x, y and z, to unit quaternions (T, 4).
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::{quaternions_to_rotation_vectors, rotation_vectors_to_quaternions};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let vectors = ndarray::array![[0.0, 0.0, 3.0], [0.0, 0.0, 3.5]];
/// let quaternions = rotation_vectors_to_quaternions(vectors.view(), QuaternionOrder::Wxyz)?;
/// let again = quaternions_to_rotation_vectors(quaternions.view(), QuaternionOrder::Wxyz)?;
/// assert!((again - vectors).iter().all(|difference| difference.abs() < 1e-14));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Rows that are no vector, or a number that is not finite.
pub fn rotation_vectors_to_quaternions(vectors: ArrayView2<f64>, order: QuaternionOrder) -> Result<Array2<f64>> {
    check_length("vectors", vectors.ncols(), 3, "axis")?;
    check_matrix("vectors", vectors)?;
    Ok(written(vectors.rows().into_iter().map(|row| exp([row[0], row[1], row[2]])), order))
}

/// Converts unit quaternions (T, 4) to rotation vectors (T, 3) in rad.
///
/// The first is that of the shortest rotation; of the others, that closest to the sample before, with whole turns added
/// about its axis. A path that passes half a turn therefore has no jump.
///
/// # Errors
/// As for [`quaternions_to_matrices`].
pub fn quaternions_to_rotation_vectors(quaternions: ArrayView2<f64>, order: QuaternionOrder) -> Result<Array2<f64>> {
    let rotations = read("quaternions", quaternions, 0, order)?;
    let mut vectors = Array2::zeros((rotations.len(), 3));
    let mut before: Option<Vector> = None;
    for (mut row, q) in vectors.rows_mut().into_iter().zip(rotations) {
        let vector = before.map_or_else(|| log(q), |before| log_near(q, before));
        row.assign(&aview1(&vector));
        before = Some(vector);
    }
    Ok(vectors)
}

/// Converts axes (T, 3) of any length and angles (T,) in rad to unit quaternions (T, 4).
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::axis_angles_to_quaternions;
///
/// # fn main() -> pdmp_core::Result<()> {
/// let axes = ndarray::array![[0.0, 0.0, 2.0]];
/// let quaternions = axis_angles_to_quaternions(axes.view(), &[std::f64::consts::FRAC_PI_2], QuaternionOrder::Wxyz)?;
/// assert!((quaternions[[0, 3]] - 0.5f64.sqrt()).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Rows that are no vector, a number that is not finite, an axis of norm below 1e-9 with an angle other than 0.
pub fn axis_angles_to_quaternions(
    axes: ArrayView2<f64>,
    angles: &[f64],
    order: QuaternionOrder,
) -> Result<Array2<f64>> {
    check_length("axes", axes.ncols(), 3, "axis")?;
    check_matrix("axes", axes)?;
    check_vector("angles", angles, axes.nrows(), "axis")?;
    let turns = axes.rows().into_iter().zip(angles).enumerate().map(|(index, (axis, &angle))| {
        let axis = [axis[0], axis[1], axis[2]];
        let norm = dot(axis, axis).sqrt();
        if angle != 0.0 && norm < MIN_AXIS {
            return Err(Error::Rotation(RotationError::ZeroAxis { index, norm, angle }));
        }
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let scale = if angle == 0.0 { 0.0 } else { sine / norm };
        Ok([cosine, scale * axis[0], scale * axis[1], scale * axis[2]])
    });
    Ok(written(turns.collect::<Result<Vec<_>>>()?.into_iter(), order))
}

/// Returns the unit quaternions in the columns of an array from `column`.
fn read(name: &'static str, rows: ArrayView2<f64>, column: usize, order: QuaternionOrder) -> Result<Vec<Quaternion>> {
    let per = if column == 0 { "component" } else { "component of position and quaternion" };
    check_length(name, rows.ncols(), column + 4, per)?;
    check_matrix(name, rows)?;
    RotationColumns { column, order }.units(name, rows)
}

/// Returns rotations as rows of unit quaternions, with signs that are continuous from w ≥ 0.
fn written(rotations: impl ExactSizeIterator<Item = Quaternion>, order: QuaternionOrder) -> Array2<f64> {
    let columns = RotationColumns { column: 0, order };
    let mut rows = Array2::zeros((rotations.len(), 4));
    let mut before = [1.0, 0.0, 0.0, 0.0];
    for (mut row, q) in rows.rows_mut().into_iter().zip(rotations) {
        before = on_side_of(normalised(q), before);
        let mut numbers = [0.0; 4];
        columns.write(before, &mut numbers);
        row.assign(&aview1(&numbers));
    }
    rows
}
