//! QR decomposition by Householder reflections, for matrices of any rank.
//!
//! faer's own QR treats a column as dependent, and drops its remainder, below 16·n·ε of its norm: 1e-10 for targets of
//! 28 000 values. Here no remainder is dropped.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::householder::{
    apply_block_householder_on_the_left_in_place_scratch, apply_block_householder_on_the_left_in_place_with_conj,
    apply_block_householder_transpose_on_the_left_in_place_with_conj, make_householder_in_place,
};
use faer::linalg::matmul::{matmul, triangular};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Conj, Mat, MatMut, MatRef, Par};

/// Returns orthonormal columns Q and the triangle R with Q·R = A, for A with no fewer rows than columns.
pub(super) fn orthonormal(mut a: Mat<f64>) -> (Mat<f64>, Mat<f64>) {
    let (rows, columns) = a.shape();
    let mut factor = Mat::zeros(columns, columns);
    let mut memory = scratch(rows, columns);
    reflect(a.as_mut(), factor.as_mut(), MemStack::new(&mut memory));
    let mut q = Mat::identity(rows, columns);
    apply_block_householder_on_the_left_in_place_with_conj(
        a.as_ref(),
        factor.as_ref(),
        Conj::No,
        q.as_mut(),
        Par::Seq,
        MemStack::new(&mut memory),
    );
    let r = upper(a.as_ref());
    (q, r)
}

/// Returns the triangle R (K, K) with RᵀR = A·Aᵀ for A (K, L), by blocks of columns, so that A is not copied.
///
/// `progress` is called before each block.
pub(super) fn triangle<E>(wide: MatRef<f64>, progress: &mut dyn FnMut(f64) -> Result<(), E>) -> Result<Mat<f64>, E> {
    let (k, length) = wide.shape();
    let most = (4 * k).max(2048).min(length);
    let mut work = Mat::zeros(k + most, k);
    let mut factor = Mat::zeros(k, k);
    let mut memory = scratch(k + most, k);
    for start in (0..length).step_by(most) {
        progress(start as f64 / length as f64)?;
        let taken = most.min(length - start);
        let mut rows = work.subrows_mut(0, k + taken);
        for j in 0..k {
            rows.rb_mut().col_mut(j).subrows_mut(j + 1, k - j - 1).fill(0.0);
        }
        rows.rb_mut().subrows_mut(k, taken).copy_from(wide.transpose().subrows(start, taken));
        reflect(rows, factor.as_mut(), MemStack::new(&mut memory));
    }
    Ok(upper(work.as_ref()))
}

fn scratch(rows: usize, columns: usize) -> MemBuffer {
    MemBuffer::new(apply_block_householder_on_the_left_in_place_scratch::<f64>(rows, columns, columns))
}

fn upper(a: MatRef<f64>) -> Mat<f64> {
    Mat::from_fn(a.ncols(), a.ncols(), |i, j| if i <= j { a[(i, j)] } else { 0.0 })
}

/// Overwrites A with R above the diagonal and the reflections below.
///
/// Recursion on halves of the columns, so that nearly all work is matrix products (Elmroth and Gustavson 2000).
fn reflect(mut a: MatMut<f64>, mut factor: MatMut<f64>, stack: &mut MemStack) {
    let columns = a.ncols();
    if columns == 1 {
        let (mut head, tail) = a.split_at_row_mut(1);
        factor[(0, 0)] = make_householder_in_place(&mut head[(0, 0)], tail.col_mut(0)).tau;
        return;
    }
    let half = columns / 2;
    let (mut left, mut right) = a.rb_mut().split_at_col_mut(half);
    let (first, mut coupling, _, second) = factor.rb_mut().split_at_mut(half, half);
    let mut first = first;
    reflect(left.rb_mut(), first.rb_mut(), stack);
    apply_block_householder_transpose_on_the_left_in_place_with_conj(
        left.rb(),
        first.rb(),
        Conj::No,
        right.rb_mut(),
        Par::Seq,
        stack,
    );
    let mut below = right.subrows_mut(half, left.nrows() - half);
    reflect(below.rb_mut(), second, stack);
    // Products of the reflection vectors couple both halves into one block reflection.
    let (left_top, left_rest) = left.rb().subrows(half, left.nrows() - half).split_at_row(columns - half);
    let (top, rest) = below.rb().split_at_row(columns - half);
    let (dense, unit) = (triangular::BlockStructure::Rectangular, triangular::BlockStructure::UnitTriangularLower);
    triangular::matmul(coupling.rb_mut(), dense, Accum::Replace, left_top.transpose(), dense, top, unit, 1.0, Par::Seq);
    matmul(coupling, Accum::Add, left_rest.transpose(), rest, 1.0, Par::Seq);
}
