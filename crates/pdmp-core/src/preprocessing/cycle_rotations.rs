//! Rotations in cyclic recordings.
//!
//! A rotation that makes a full turn per cycle changes the sign of its quaternion. Cycles are therefore found and compared by
//! the elements of rotation matrices. The gain of a rotation over a cycle is the rotation vector γ = log(q(0)⁻¹ ⊗ q(T)) of the
//! smoothed recording, which has no full turns; it is removed in the body frame,
//!
//! ```text
//! q_c = q(cT/C) ⊗ exp(−(c/C − 1/2)γ).
//! ```

use std::ops::Range;

use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::demonstration::{RotationColumns, layout};
use crate::numerics::rotation::{
    Quaternion, Vector, distance, dot, exp, inverse, log, mean, normalised, on_side_of, product, rotate,
};

/// Returns positions with the nine elements of rotation matrices in place of quaternions, and their columns.
pub(super) fn with_matrices(
    position: ArrayView2<f64>,
    rotations: &[RotationColumns],
) -> (Array2<f64>, Vec<Range<usize>>) {
    let (plain, _) = layout(position.ncols(), rotations);
    let mut values = Array2::zeros((position.nrows(), plain.len() + 9 * rotations.len()));
    for (k, &[column, _]) in plain.iter().enumerate() {
        values.column_mut(k).assign(&position.column(column));
    }
    for (r, columns) in rotations.iter().enumerate() {
        let first = plain.len() + 9 * r;
        for (mut row, q) in values.rows_mut().into_iter().zip(quaternions(position, *columns)) {
            for (k, axis) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
                let turned = rotate(q, axis);
                (0..3).for_each(|i| row[first + 3 * k + i] = turned[i]);
            }
        }
    }
    let columns = (0..rotations.len()).map(|r| plain.len() + 9 * r..plain.len() + 9 * (r + 1)).collect();
    (values, columns)
}

/// Removes the gain of a rotation between its smoothed `ends` (2, D) from a cycle (C, D), and returns it.
pub(super) fn close(cycle: &mut ArrayViewMut2<f64>, ends: ArrayView2<f64>, columns: RotationColumns) -> Vector {
    let [first, last] = [0, 1].map(|end| normalised(columns.read(&ends.row(end).to_vec())));
    let gain = log(product(inverse(first), last));
    let n = cycle.nrows() as f64;
    for (c, mut row) in cycle.rows_mut().into_iter().enumerate() {
        let share = c as f64 / n - 0.5;
        let mut coordinates = row.to_vec();
        let q = normalised(columns.read(&coordinates));
        columns.write(product(q, exp(gain.map(|x| -share * x))), &mut coordinates);
        row.assign(&ndarray::aview1(&coordinates));
    }
    gain
}

/// Returns the largest turn of a rotation from the start of a cycle.
pub(super) fn range(cycle: ArrayView2<f64>, columns: RotationColumns) -> f64 {
    let mut rotations = quaternions(cycle, columns);
    let Some(first) = rotations.next() else { return 0.0 };
    rotations.map(|q| distance(first, q)).fold(0.0, f64::max)
}

/// Writes the mean of the rotations of cycles (C, D) to `mean_cycle`, with continuous signs.
pub(super) fn average(cycles: &[Array2<f64>], columns: RotationColumns, mean_cycle: &mut Array2<f64>) {
    let mut near: Option<Quaternion> = None;
    for (c, mut row) in mean_cycle.rows_mut().into_iter().enumerate() {
        let of_cycles = cycles.iter().map(|cycle| normalised(columns.read(&cycle.row(c).to_vec())));
        let start = near.or_else(|| of_cycles.clone().next()).unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let q = on_side_of(mean(start, of_cycles), start);
        let mut coordinates = row.to_vec();
        columns.write(q, &mut coordinates);
        row.assign(&ndarray::aview1(&coordinates));
        near = Some(q);
    }
}

/// Returns the length of a vector.
pub(super) fn length(vector: Vector) -> f64 {
    dot(vector, vector).sqrt()
}

fn quaternions(position: ArrayView2<'_, f64>, columns: RotationColumns) -> impl Iterator<Item = Quaternion> + use<'_> {
    (0..position.nrows()).map(move |c| normalised(columns.read(&position.row(c).to_vec())))
}
