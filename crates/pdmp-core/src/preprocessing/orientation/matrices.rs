//! Rotation matrices and homogeneous transforms.
//!
//! A matrix that deviates from a rotation by rounding is replaced by the closest one, its polar factor, by the iteration
//! R ← R(3 − RᵀR)/2, which squares the deviation. The quaternion follows from the largest of its components:
//!
//! - S. W. Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control 1, 1978.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, s};

use super::{read, written};
use crate::demonstration::QuaternionOrder;
use crate::error::{Error, Result, RotationError};
use crate::numerics::rotation::{Quaternion, cross, dot, rotate};
use crate::validate::{check_length, check_matrix};

/// Three rows.
type Matrix = [[f64; 3]; 3];

/// Largest element of MᵀM − 1 of a rotation matrix: rounding to three digits is mended, other data are no rotation.
const MAX_DEVIATION: f64 = 1e-3;
/// Number of iterations to the closest rotation: the deviation of 1e-3 is squared to below 1e-20.
const N_ITERATIONS: usize = 4;
/// Largest deviation of the last row of a transform from 0, 0, 0, 1, such as of text with six digits.
const MAX_LAST_ROW_DEVIATION: f64 = 1e-6;

/// Converts rotation matrices (T, 3, 3) to unit quaternions (T, 4).
///
/// The columns of a matrix are the axes of the body in the world frame. Matrices whose MᵀM deviates from the identity by at
/// most 1e-3 are replaced by the closest rotation.
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::matrices_to_quaternions;
///
/// # fn main() -> pdmp_core::Result<()> {
/// // A quarter turn about z.
/// let matrices = ndarray::array![[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]];
/// let quaternions = matrices_to_quaternions(matrices.view(), QuaternionOrder::Xyzw)?;
/// assert!((quaternions[[0, 2]] - 0.5f64.sqrt()).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Another shape, a number that is not finite, a larger deviation, or a reflection.
pub fn matrices_to_quaternions(matrices: ArrayView3<f64>, order: QuaternionOrder) -> Result<Array2<f64>> {
    check_square("matrices", matrices, 3)?;
    let rotations = matrices.outer_iter().enumerate().map(|(t, matrix)| rotation("matrices", t, matrix));
    Ok(written(rotations.collect::<Result<Vec<_>>>()?.into_iter(), order))
}

/// Converts unit quaternions (T, 4) to rotation matrices (T, 3, 3).
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::quaternions_to_matrices;
///
/// # fn main() -> pdmp_core::Result<()> {
/// // Half a turn about x.
/// let matrices = quaternions_to_matrices(ndarray::array![[0.0, 1.0, 0.0, 0.0]].view(), QuaternionOrder::Wxyz)?;
/// assert_eq!(matrices, ndarray::array![[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]]);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Rows that are no quaternion, a number that is not finite, or a norm that deviates from 1 by more than 1e-3.
pub fn quaternions_to_matrices(quaternions: ArrayView2<f64>, order: QuaternionOrder) -> Result<Array3<f64>> {
    let rotations = read("quaternions", quaternions, 0, order)?;
    let mut matrices = Array3::zeros((rotations.len(), 3, 3));
    for (mut matrix, q) in matrices.outer_iter_mut().zip(rotations) {
        write(q, &mut matrix);
    }
    Ok(matrices)
}

/// Converts homogeneous transforms (T, 4, 4) from the body frame to the world frame to poses (T, 7) of position x, y, z and
/// unit quaternion.
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::{poses_to_transforms, transforms_to_poses};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let poses = ndarray::array![[0.4, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0]];
/// let transforms = poses_to_transforms(poses.view(), QuaternionOrder::Wxyz)?;
/// assert_eq!(transforms_to_poses(transforms.view(), QuaternionOrder::Wxyz)?, poses);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As for [`matrices_to_quaternions`], or a last row other than 0, 0, 0, 1.
pub fn transforms_to_poses(transforms: ArrayView3<f64>, order: QuaternionOrder) -> Result<Array2<f64>> {
    check_square("transforms", transforms, 4)?;
    let rotations = transforms.outer_iter().enumerate().map(|(index, transform)| {
        let row: [f64; 4] = std::array::from_fn(|i| transform[[3, i]]);
        let off = row.iter().zip([0.0, 0.0, 0.0, 1.0]).map(|(x, expected)| (x - expected).abs());
        if off.fold(0.0, f64::max) > MAX_LAST_ROW_DEVIATION {
            return Err(Error::Rotation(RotationError::LastRow { index, row }));
        }
        rotation("transforms", index, transform.slice(s![..3, ..3]))
    });
    let mut poses = Array2::zeros((transforms.dim().0, 7));
    poses.slice_mut(s![.., 3..]).assign(&written(rotations.collect::<Result<Vec<_>>>()?.into_iter(), order));
    poses.slice_mut(s![.., ..3]).assign(&transforms.slice(s![.., ..3, 3]));
    Ok(poses)
}

/// Converts poses (T, 7) of position x, y, z and unit quaternion to homogeneous transforms (T, 4, 4).
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::poses_to_transforms;
///
/// # fn main() -> pdmp_core::Result<()> {
/// let pose = ndarray::array![[0.4, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]];
/// let transforms = poses_to_transforms(pose.view(), QuaternionOrder::Wxyz)?;
/// assert_eq!(transforms.slice(ndarray::s![0, .., 3]), ndarray::array![0.4, 0.0, 0.3, 1.0]);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As for [`quaternions_to_matrices`].
pub fn poses_to_transforms(poses: ArrayView2<f64>, order: QuaternionOrder) -> Result<Array3<f64>> {
    let rotations = read("poses", poses, 3, order)?;
    let mut transforms = Array3::zeros((rotations.len(), 4, 4));
    for ((mut transform, q), pose) in transforms.outer_iter_mut().zip(rotations).zip(poses.rows()) {
        write(q, &mut transform.slice_mut(s![..3, ..3]));
        transform.slice_mut(s![..3, 3]).assign(&pose.slice(s![..3]));
        transform[[3, 3]] = 1.0;
    }
    Ok(transforms)
}

fn check_square(name: &'static str, matrices: ArrayView3<f64>, size: usize) -> Result<()> {
    let (_, rows, columns) = matrices.dim();
    check_length(name, rows, size, "row of a matrix")?;
    check_length(name, columns, size, "column of a matrix")?;
    matrices.outer_iter().try_for_each(|matrix| check_matrix(name, matrix))
}

/// Returns the rotation that is closest to a matrix.
fn rotation(name: &'static str, index: usize, matrix: ArrayView2<f64>) -> Result<Quaternion> {
    let mut rows: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| matrix[[i, j]]));
    let product = gram(&rows);
    let off = |k: usize| (product[k / 3][k % 3] - f64::from(u8::from(k / 3 == k % 3))).abs();
    let deviation = (0..9).map(off).fold(0.0, f64::max);
    if deviation > MAX_DEVIATION {
        return Err(Error::Rotation(RotationError::Matrix { name, index, deviation }));
    }
    if dot(rows[0], cross(rows[1], rows[2])) < 0.0 {
        return Err(Error::Rotation(RotationError::Reflection { name, index }));
    }
    for _ in 0..N_ITERATIONS {
        let gram = gram(&rows);
        rows = rows
            .map(|row| std::array::from_fn(|j| 1.5 * row[j] - 0.5 * (0..3).map(|k| row[k] * gram[k][j]).sum::<f64>()));
    }
    Ok(quaternion(&rows))
}

/// Returns MᵀM.
fn gram(rows: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| rows.iter().map(|row| row[i] * row[j]).sum()))
}

/// Returns the quaternion of a rotation matrix, not normalised, from the largest of its components.
fn quaternion(m: &Matrix) -> Quaternion {
    let squares = [
        1.0 + m[0][0] + m[1][1] + m[2][2],
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
    ];
    let [w, x, y, z] = squares;
    let (a, b, c) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (d, e, f) = (m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    match squares.iter().copied().fold(0.0, f64::max) {
        largest if largest == w => [w, a, b, c],
        largest if largest == x => [a, x, d, e],
        largest if largest == y => [b, d, y, f],
        _ => [c, e, f, z],
    }
}

/// Writes a rotation as a matrix (3, 3), whose columns are the rotated axes.
fn write(q: Quaternion, matrix: &mut ndarray::ArrayViewMut2<f64>) {
    for j in 0..3 {
        let axis = rotate(q, std::array::from_fn(|i| f64::from(u8::from(i == j))));
        (0..3).for_each(|i| matrix[[i, j]] = axis[i]);
    }
}
