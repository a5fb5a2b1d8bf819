//! Leading singular vectors of a large matrix from block Krylov subspaces.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use super::householder::orthonormal;
use super::product;
use super::small_svd::Svd;
use crate::error::Result;
use crate::numerics::statistics::pseudo_random;

/// Residual relative to σ₁ at which a singular vector has converged.
const TOLERANCE: f64 = 1e-12;

/// Computes the leading J left singular vectors (K, J) of A (K, L), K ≤ L; `None` where the Gram matrix is cheaper.
///
/// Block Golub-Kahan bidiagonalisation with full orthogonalisation, from a fixed pseudo-random block of J + 8 vectors,
/// rounded up to a multiple of 8. After q steps Q spans the Krylov space of A·Aᵀ, and Aᵀ·Q = P·T with orthonormal P.
/// From T = X·Σ·Yᵀ follow u = Q·y and v = P·x with Aᵀu = σv. The remainder A·v − σu lies in the block that the next step
/// adds to Q; its norm is the measured residual (Golub, Luk, Overton 1981; Musco and Musco 2015). A·Aᵀ is never formed,
/// so that small singular values keep their accuracy.
///
/// A step takes 4·K·L multiplications per vector of the block, the Gram matrix K²·L. The iteration ends when it has cost
/// as much as the Gram matrix, and does not begin where that allows fewer than four steps.
pub(super) fn leading(
    wide: MatRef<f64>,
    n_styles: usize,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Option<Mat<f64>>> {
    let (k, length) = wide.shape();
    // Products are fastest for multiples of the register width.
    let block = (n_styles + 8).next_multiple_of(8);
    let steps = k / (4 * block);
    if steps < 4 {
        return Ok(None);
    }
    let (mut left, mut right) = (OrthonormalBasis::new(k), OrthonormalBasis::new(length));
    let mut projected = Mat::<f64>::zeros(0, 0);
    let mut state = 0;
    left.extend(Mat::from_fn(k, block, |_, _| pseudo_random(&mut state) as f64 / 2f64.powi(63)));
    for step in 0..steps {
        progress(step as f64 / steps as f64)?;
        let size = step * block;
        let coefficients = right.extend(product(wide.transpose(), left.last(block)));
        projected.resize_with(size + block, size + block, |_, _| 0.0);
        projected.subcols_mut(size, block).copy_from(&coefficients);
        let remainder = left.extend(product(wide, right.last(block)));
        let remainder = remainder.subrows(size + block, block);

        let Svd { u: x, sigma, v: y } = Svd::of(projected.as_ref());
        let residuals = product(remainder, x.submatrix(size, 0, block, n_styles));
        if residuals.col_iter().all(|residual| residual.norm_l2() <= TOLERANCE * sigma[0]) {
            let basis = left.vectors.subcols(0, size + block);
            return Ok(Some(product(basis, y.subcols(0, n_styles))));
        }
    }
    Ok(None)
}

/// Orthonormal vectors, extended block by block.
struct OrthonormalBasis {
    vectors: Mat<f64>,
}

impl OrthonormalBasis {
    fn new(length: usize) -> Self {
        Self { vectors: Mat::zeros(length, 0) }
    }

    fn last(&self, block: usize) -> MatRef<'_, f64> {
        self.vectors.subcols(self.vectors.ncols() - block, block)
    }

    /// Adds the orthogonal complement of a block, and returns the block's coefficients in the extended basis.
    ///
    /// Orthogonalising twice is enough (Giraud, Langou, Rozložník, van den Eshof 2005).
    fn extend(&mut self, block: Mat<f64>) -> Mat<f64> {
        let (size, added) = (self.vectors.ncols(), block.ncols());
        let (first, rest) = self.reduce(block);
        let (once, r) = orthonormal(rest);
        let (second, rest) = self.reduce(once);
        let (twice, q) = orthonormal(rest);
        self.vectors.resize_with(twice.nrows(), size + added, |i, j| twice[(i, j - size)]);
        let mut coefficients = Mat::zeros(size + added, added);
        coefficients.subrows_mut(0, size).copy_from(first + product(second.as_ref(), r.as_ref()));
        coefficients.subrows_mut(size, added).copy_from(product(q.as_ref(), r.as_ref()));
        coefficients
    }

    /// Returns the coefficients of a block in the basis, and its orthogonal complement.
    fn reduce(&self, mut block: Mat<f64>) -> (Mat<f64>, Mat<f64>) {
        let mut within = Mat::zeros(self.vectors.ncols(), block.ncols());
        matmul(within.as_mut(), Accum::Replace, self.vectors.transpose(), &block, 1.0, Par::Seq);
        matmul(block.as_mut(), Accum::Add, &self.vectors, &within, -1.0, Par::Seq);
        (within, block)
    }
}
