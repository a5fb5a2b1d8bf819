//! Positions with rotations relative to a reference: the rotation vector log(q̂⁻¹ ⊗ q) of each rotation, in the body frame of
//! the reference, beside the other coordinates as they are.

use ndarray::{Array2, ArrayView2, aview1};

use super::coordinates::layout;
use crate::demonstration::RotationColumns;
use crate::error::{Error, Result};
use crate::numerics::rotation::{Quaternion, exp, inverse, log, mean, product};
use crate::validate::{check_length, check_matrix};

/// Converts positions (T, n_q) to degrees of freedom (T, n_v), whose rotations are relative to those of a reference (T, n_q).
///
/// ```
/// # use ndarray::array;
/// use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
/// use pdmp_core::model::{from_tangent, to_tangent};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let rotations = [RotationColumns { column: 1, order: QuaternionOrder::Wxyz }];
/// let reference = array![[0.1, 1.0, 0.0, 0.0, 0.0]];
/// let turned = array![[0.2, 0.5f64.cos(), 0.0, 0.0, 0.5f64.sin()]];
/// let dofs = to_tangent(reference.view(), turned.view(), &rotations)?;
/// assert!((&dofs - &array![[0.2, 0.0, 0.0, 1.0]]).iter().all(|x| x.abs() < 1e-15));
/// let again = from_tangent(reference.view(), dofs.view(), &rotations)?;
/// assert!((again - turned).iter().all(|x| x.abs() < 1e-15));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Shapes that differ, a number that is not finite, or a quaternion whose norm deviates from 1 by more than 1e-3.
pub fn to_tangent(
    reference: ArrayView2<f64>,
    position: ArrayView2<f64>,
    rotations: &[RotationColumns],
) -> Result<Array2<f64>> {
    check_same(reference, position)?;
    let (plain, firsts) = layout(position.ncols(), rotations);
    let mut dofs = Array2::zeros((position.nrows(), position.ncols() - rotations.len()));
    plain.iter().for_each(|&[column, dof]| dofs.column_mut(dof).assign(&position.column(column)));
    for (columns, dof) in rotations.iter().zip(firsts) {
        let pairs = columns.units("reference", reference)?.into_iter().zip(columns.units("position", position)?);
        for (t, (from, to)) in pairs.enumerate() {
            let vector = log(product(inverse(from), to));
            (0..3).for_each(|i| dofs[[t, dof + i]] = vector[i]);
        }
    }
    Ok(dofs)
}

/// Converts degrees of freedom (T, n_v) relative to a reference (T, n_q) to positions (T, n_q).
///
/// # Errors
/// As for [`to_tangent`].
pub fn from_tangent(
    reference: ArrayView2<f64>,
    dofs: ArrayView2<f64>,
    rotations: &[RotationColumns],
) -> Result<Array2<f64>> {
    check_matrix("dofs", dofs)?;
    check_matrix("reference", reference)?;
    check_length("dofs", dofs.ncols(), reference.ncols() - rotations.len(), "DoF")?;
    check_length("dofs", dofs.nrows(), reference.nrows(), "row of the reference")?;
    let (plain, firsts) = layout(reference.ncols(), rotations);
    let mut position = Array2::zeros(reference.dim());
    plain.iter().for_each(|&[column, dof]| position.column_mut(column).assign(&dofs.column(dof)));
    for (columns, dof) in rotations.iter().zip(firsts) {
        for (t, q) in columns.units("reference", reference)?.into_iter().enumerate() {
            let turned = product(q, exp(std::array::from_fn(|i| dofs[[t, dof + i]])));
            write(turned, *columns, t, &mut position);
        }
    }
    Ok(position)
}

/// Returns the mean (T, n_q) of positions: the Karcher mean of each rotation, and the mean of the other coordinates.
///
/// ```
/// use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
/// use pdmp_core::model::mean_positions;
///
/// # fn main() -> pdmp_core::Result<()> {
/// // Turns by ±1 rad about z, beside a coordinate.
/// let turns = [-0.5f64, 0.5].map(|half| ndarray::array![[half, half.cos(), 0.0, 0.0, half.sin()]]);
/// let rotations = [RotationColumns { column: 1, order: QuaternionOrder::Wxyz }];
/// let mean = mean_positions(&[turns[0].view(), turns[1].view()], &rotations)?;
/// assert!((mean - ndarray::array![[0.0, 1.0, 0.0, 0.0, 0.0]]).iter().all(|x| x.abs() < 1e-15));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// No positions, or as for [`to_tangent`].
pub fn mean_positions(positions: &[ArrayView2<f64>], rotations: &[RotationColumns]) -> Result<Array2<f64>> {
    let first = positions.first().ok_or(Error::NoDemonstrations)?;
    let mut sum = Array2::zeros(first.dim());
    for position in positions {
        check_same(*first, *position)?;
        sum += position;
    }
    let mut means = sum / positions.len() as f64;
    for columns in rotations {
        let all = positions.iter().map(|position| columns.units("position", *position)).collect::<Result<Vec<_>>>()?;
        let mut near = all[0].first().copied();
        for t in 0..first.nrows() {
            let start = near.unwrap_or([1.0, 0.0, 0.0, 0.0]);
            let q = mean(start, all.iter().map(|rotations| rotations[t]));
            write(q, *columns, t, &mut means);
            near = Some(q);
        }
    }
    Ok(means)
}

fn check_same(reference: ArrayView2<f64>, position: ArrayView2<f64>) -> Result<()> {
    check_length("position", position.ncols(), reference.ncols(), "coordinate")?;
    check_length("position", position.nrows(), reference.nrows(), "row of the reference")?;
    check_matrix("reference", reference)?;
    check_matrix("position", position)
}

fn write(q: Quaternion, columns: RotationColumns, row: usize, position: &mut Array2<f64>) {
    let mut coordinates = position.row(row).to_vec();
    columns.write(q, &mut coordinates);
    position.row_mut(row).assign(&aview1(&coordinates));
}
