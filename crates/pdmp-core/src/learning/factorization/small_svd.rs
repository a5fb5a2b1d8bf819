//! Singular value decomposition of a small square matrix, with a fallback that always converges.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{ColRef, Mat, MatRef, Par};

use super::householder::orthonormal;

/// Decomposition A = U·diag(σ)·Vᵀ with decreasing σ.
pub(super) struct Svd {
    pub(super) u: Mat<f64>,
    pub(super) sigma: Vec<f64>,
    pub(super) v: Mat<f64>,
}

impl Svd {
    /// Decomposes a matrix by bidiagonalisation, or by Jacobi rotations if that iteration does not converge.
    pub(super) fn of(a: MatRef<f64>) -> Self {
        let largest = largest(a);
        if largest == 0.0 {
            let (u, v) = (Mat::identity(a.nrows(), a.ncols()), Mat::identity(a.ncols(), a.ncols()));
            return Self { u, sigma: vec![0.0; a.ncols()], v };
        }
        // Neither method scales its input; division by a power of two is exact.
        let scale = largest.log2().floor().exp2();
        let scaled = Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] / scale);
        let Self { u, sigma, v } = Self::bidiagonal(scaled.as_ref()).unwrap_or_else(|| Self::rotated(scaled));
        Self { u, sigma: sigma.into_iter().map(|s| s * scale).collect(), v }
    }

    /// Decomposes a matrix by bidiagonalisation; `None` if the result is not sound.
    pub(super) fn bidiagonal(a: MatRef<f64>) -> Option<Self> {
        let k = a.nrows();
        let (mut u, mut sigma, mut v) = (Mat::zeros(k, k), Diag::zeros(k), Mat::zeros(k, k));
        let thin = ComputeSvdVectors::Thin;
        // One thread, explicitly: faer's default is a setting of the whole process.
        let par = Par::Seq;
        let mut memory = MemBuffer::new(svd_scratch::<f64>(k, k, thin, thin, par, Default::default()));
        let stack = MemStack::new(&mut memory);
        svd(a, sigma.as_mut(), Some(u.as_mut()), Some(v.as_mut()), par, stack, Default::default()).ok()?;
        let sigma: Vec<f64> = sigma.column_vector().iter().copied().collect();
        let sound = largest(u.as_ref()) <= 2.0 && largest(v.as_ref()) <= 2.0 && sigma.iter().all(|s| s.is_finite());
        sound.then_some(Self { u, sigma, v })
    }

    /// Decomposes a matrix by one-sided Jacobi rotations of pairs of columns until all are orthogonal (Hestenes 1958).
    ///
    /// Slow, but every rotation reduces the inner products, and the number of sweeps is bounded.
    pub(super) fn rotated(mut a: Mat<f64>) -> Self {
        let k = a.ncols();
        let mut v = Mat::identity(k, k);
        for _ in 0..60 {
            let mut converged = true;
            for q in 1..k {
                for p in 0..q {
                    let (x, y) = (a.col(p), a.col(q));
                    let (xx, yy, xy) = (dot(x, x), dot(y, y), dot(x, y));
                    if xy.abs() <= 1e-15 * (xx * yy).sqrt() || xy.abs() < f64::MIN_POSITIVE {
                        continue;
                    }
                    converged = false;
                    let zeta = (yy - xx) / (2.0 * xy);
                    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                    let cosine = 1.0 / tangent.hypot(1.0);
                    rotate(&mut a, p, q, cosine, cosine * tangent);
                    rotate(&mut v, p, q, cosine, cosine * tangent);
                }
            }
            if converged {
                break;
            }
        }
        let norms: Vec<f64> = (0..k).map(|j| a.col(j).norm_l2()).collect();
        let mut order: Vec<usize> = (0..k).collect();
        order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
        let sorted = |matrix: &Mat<f64>| Mat::from_fn(k, k, |i, j| matrix[(i, order[j])]);
        // Orthonormalisation in decreasing order gives zero columns a direction, and keeps that of the others.
        let (mut u, r) = orthonormal(sorted(&a));
        for j in (0..k).filter(|&j| r[(j, j)] < 0.0) {
            u.col_mut(j).iter_mut().for_each(|x| *x = -*x);
        }
        Self { u, sigma: order.iter().map(|&j| norms[j]).collect(), v: sorted(&v) }
    }
}

fn dot(x: ColRef<f64>, y: ColRef<f64>) -> f64 {
    x.iter().zip(y.iter()).map(|(x, y)| x * y).sum()
}

fn rotate(matrix: &mut Mat<f64>, p: usize, q: usize, cosine: f64, sine: f64) {
    for i in 0..matrix.nrows() {
        let (x, y) = (matrix[(i, p)], matrix[(i, q)]);
        matrix[(i, p)] = cosine * x - sine * y;
        matrix[(i, q)] = sine * x + cosine * y;
    }
}

/// Returns the largest magnitude; infinity if an element is NaN.
fn largest(a: MatRef<f64>) -> f64 {
    let magnitudes = a.col_iter().flat_map(|column| column.iter().map(|x| x.abs()));
    magnitudes.fold(0.0, |most, x| if x.is_nan() { f64::INFINITY } else { most.max(x) })
}
