//! Singular values and leading singular vectors from the eigendecomposition of the Gram matrix.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, Mat, MatMut, MatRef, Par};

use super::{ACCURACY, PANEL, product, projected};
use crate::error::Result;

/// Smallest ratio σ/σ₁ for which the Gram matrix is accurate enough: the error of an eigenvector is ε·(σ₁/σ)².
pub(super) const SMALL: f64 = 1e-4;

/// Largest sum of squared cosines between the rows of VᵀA: the scaled product then has eigenvalues above one half.
const MAX_OFF_DIAGONAL: f64 = 0.1;

/// Eigendecomposition of the Gram matrix A·Aᵀ for A (K, L).
pub(super) struct Gram {
    matrix: Mat<f64>,
    /// Eigenvectors (K, K) by ascending eigenvalues.
    pub(super) vectors: Mat<f64>,
    /// Square roots of the eigenvalues in decreasing order, with an error of √(K·ε)·σ₁ where they vanish.
    pub(super) values: Vec<f64>,
}

impl Gram {
    /// Decomposes A·Aᵀ; returns `None` if the iteration does not converge.
    ///
    /// `progress` is called at least once every 10⁹ multiplications.
    pub(super) fn of(wide: MatRef<f64>, progress: &mut dyn FnMut(f64) -> Result<()>) -> Result<Option<Self>> {
        let (k, length) = wide.shape();
        let most = (1_000_000_000 / (k * k)).max(1024);
        let mut matrix = Mat::zeros(k, k);
        for start in (0..length).step_by(most) {
            progress(start as f64 / length as f64)?;
            add_square(matrix.as_mut(), wide.subcols(start, most.min(length - start)));
        }
        for j in 0..k {
            for i in 0..j {
                matrix[(i, j)] = matrix[(j, i)];
            }
        }
        let (mut ascending, mut vectors) = (Diag::zeros(k), Mat::zeros(k, k));
        let scratch = self_adjoint_evd_scratch::<f64>(k, ComputeEigenvectors::Yes, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        let into = Some(vectors.as_mut());
        if self_adjoint_evd(matrix.as_ref(), ascending.as_mut(), into, Par::Seq, stack, Default::default()).is_err() {
            return Ok(None);
        }
        let values: Vec<f64> = ascending.column_vector().iter().rev().map(|l| l.max(0.0).sqrt()).collect();
        Ok(Some(Self { matrix, vectors, values }))
    }

    /// Returns the triangle R with V·Rᵀ·R·Vᵀ = A·Aᵀ for the eigenvectors V, as accurate as by reflections, or `None` if V
    /// is too far from the singular vectors.
    ///
    /// The rows b of VᵀA are nearly orthogonal. P = VᵀA·AᵀV, scaled by their lengths to a unit diagonal, has eigenvalues
    /// close to one, and so a Cholesky factor to full accuracy, however much the lengths differ (CholeskyQR2: Yamamoto,
    /// Nakatsukasa, Yanagisawa, Fukaya, ETNA 44 (2015) 306–326).
    pub(super) fn triangle(
        &self,
        wide: MatRef<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Option<Mat<f64>>> {
        let (k, length) = wide.shape();
        let (mut products, mut part) = (Mat::zeros(k, k), vec![0.0; k * PANEL.min(length)]);
        for start in (0..length).step_by(PANEL) {
            progress(start as f64 / length as f64)?;
            let rows = projected(&mut part, self.vectors.as_ref(), wide.subcols(start, PANEL.min(length - start)));
            add_square(products.as_mut(), rows);
        }
        let lengths: Vec<f64> = (0..k).map(|j| products[(j, j)].sqrt()).collect();
        let mut scaled = Mat::from_fn(k, k, |i, j| products[(i.max(j), i.min(j))] / (lengths[i] * lengths[j]));
        let off: f64 = (0..k).flat_map(|j| (0..j).map(move |i| (i, j))).map(|at| scaled[at].powi(2)).sum();
        // NaN where a row vanishes.
        if off.is_nan() || off > MAX_OFF_DIAGONAL {
            return Ok(None);
        }
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(k, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        let factor = cholesky_in_place(scaled.as_mut(), Default::default(), Par::Seq, stack, Default::default());
        let upper = |i: usize, j: usize| if i <= j { scaled[(j, i)] * lengths[j] } else { 0.0 };
        Ok(factor.is_ok().then(|| Mat::from_fn(k, k, upper)))
    }

    /// Returns the first `kept` vectors, or `None` if one of the leading J is inaccurate: its singular value is below
    /// [`SMALL`]·σ₁, or its measured residual above [`ACCURACY`]·σ₁.
    pub(super) fn leading(&self, n_styles: usize, kept: usize) -> Option<Mat<f64>> {
        let (first, values) = (self.values[0], &self.values[..n_styles]);
        let vectors = self.vectors.as_ref().reverse_cols().subcols(0, kept).to_owned();
        let images = product(self.matrix.as_ref(), vectors.subcols(0, n_styles));
        let residual = |j: usize| {
            let pairs = images.col(j).iter().zip(vectors.col(j).iter());
            pairs.map(|(image, x)| (image - values[j].powi(2) * x).powi(2)).sum::<f64>().sqrt()
        };
        let sound = |j: usize| values[j] >= SMALL * first && residual(j) <= ACCURACY * first * values[j];
        (0..n_styles).all(sound).then_some(vectors)
    }
}

/// Adds A·Aᵀ to the lower triangle of a square matrix.
pub(super) fn add_square(square: MatMut<f64>, a: MatRef<f64>) {
    let (lower, dense) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    matmul(square, lower, Accum::Add, a, dense, a.transpose(), dense, 1.0, Par::Seq);
}
