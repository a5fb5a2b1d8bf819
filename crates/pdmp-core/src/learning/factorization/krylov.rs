//! The leading singular vectors of a large matrix, from products with it alone.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use super::householder::orthonormal;
use super::product;
use super::small_svd::Svd;
use crate::error::Result;

/// Residual, as a share of σ₁, at which a singular vector is found.
const FOUND: f64 = 1e-12;

/// The J leading left singular vectors (K, J) of A (K, L), K ≤ L, or none where the Gram matrix would be cheaper.
///
/// Block Golub-Kahan bidiagonalisation from a fixed pseudo-random block of J + 8 vectors or a few more, with full
/// orthogonalisation: after q steps Q spans the Krylov space of A·Aᵀ, and Aᵀ·Q = P·T with orthonormal P. From
/// T = X·Σ·Yᵀ follow u = Q·y and v = P·x, for which Aᵀu = σv holds, and A·v − σu is what the next step adds to Q: its
/// length is the measured residual (Golub, Luk, Overton 1981; Musco and Musco 2015). No product A·Aᵀ is formed, so
/// small singular values keep their digits.
///
/// A step costs 4·K·L products for every vector of the block, the Gram matrix K²·L; the steps end where it would have
/// been had, and are not begun where that leaves fewer than four.
pub(super) fn leading(
    wide: MatRef<f64>,
    n_styles: usize,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Option<Mat<f64>>> {
    let (k, length) = wide.shape();
    // Products are fastest for multiples of the width of the registers.
    let block = (n_styles + 8).next_multiple_of(8);
    let steps = k / (4 * block);
    if steps < 4 {
        return Ok(None);
    }
    let (mut left, mut right) = (Span::new(k), Span::new(length));
    let mut projected = Mat::<f64>::zeros(0, 0);
    left.extend(start(k, block));
    for step in 0..steps {
        proceed(step as f64 / steps as f64)?;
        let known = step * block;
        let coefficients = right.extend(product(wide.transpose(), left.last(block)));
        projected.resize_with(known + block, known + block, |_, _| 0.0);
        projected.subcols_mut(known, block).copy_from(&coefficients);
        let beyond = left.extend(product(wide, right.last(block)));
        let beyond = beyond.subrows(known + block, block);

        let Svd { u: x, sigma, v: y } = Svd::of(projected.as_ref());
        let residuals = product(beyond, x.submatrix(known, 0, block, n_styles));
        if residuals.col_iter().all(|residual| residual.norm_l2() <= FOUND * sigma[0]) {
            let basis = left.vectors.subcols(0, known + block);
            return Ok(Some(product(basis, y.subcols(0, n_styles))));
        }
    }
    Ok(None)
}

/// Orthonormal vectors, block after block.
struct Span {
    vectors: Mat<f64>,
}

impl Span {
    fn new(length: usize) -> Self {
        Self { vectors: Mat::zeros(length, 0) }
    }

    fn last(&self, block: usize) -> MatRef<'_, f64> {
        self.vectors.subcols(self.vectors.ncols() - block, block)
    }

    /// Adds what a block holds beyond the span, and tells the block in terms of the vectors there are then.
    ///
    /// Twice is enough (Giraud, Langou, Rozložník, van den Eshof 2005).
    fn extend(&mut self, block: Mat<f64>) -> Mat<f64> {
        let (known, added) = (self.vectors.ncols(), block.ncols());
        let (first, rest) = self.reduce(block);
        let (once, r) = orthonormal(rest);
        let (second, rest) = self.reduce(once);
        let (twice, q) = orthonormal(rest);
        self.vectors.resize_with(twice.nrows(), known + added, |i, j| twice[(i, j - known)]);
        let mut coefficients = Mat::zeros(known + added, added);
        coefficients.subrows_mut(0, known).copy_from(first + product(second.as_ref(), r.as_ref()));
        coefficients.subrows_mut(known, added).copy_from(product(q.as_ref(), r.as_ref()));
        coefficients
    }

    /// The part of a block within the span, and the rest.
    fn reduce(&self, mut block: Mat<f64>) -> (Mat<f64>, Mat<f64>) {
        let mut within = Mat::zeros(self.vectors.ncols(), block.ncols());
        matmul(within.as_mut(), Accum::Replace, self.vectors.transpose(), &block, 1.0, Par::Seq);
        matmul(block.as_mut(), Accum::Add, &self.vectors, &within, -1.0, Par::Seq);
        (within, block)
    }
}

/// Numbers between -1 and 1, always the same (the generator SplitMix64).
fn start(rows: usize, columns: usize) -> Mat<f64> {
    let mut state = 0u64;
    Mat::from_fn(rows, columns, |_, _| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as i64 as f64 / 2f64.powi(63)
    })
}
