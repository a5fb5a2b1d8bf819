//! Dense decompositions of the context map.
//!
//! faer computes them in a build with learning. A build without learning has only nalgebra, whose results agree up to
//! rounding and which takes several times as long for the largest context maps.

use ndarray::{Array2, ArrayView2};

use crate::error::{Error, Result};

#[cfg(feature = "learning")]
use faer_backend as backend;
#[cfg(not(feature = "learning"))]
use nalgebra_backend as backend;

/// Returns the eigenvalues (n,) of a symmetric matrix in increasing order, and its eigenvectors (n, n) as columns.
///
/// # Errors
/// Eigenvalues that do not converge; `name` describes the matrix in the text.
pub(crate) fn symmetric_eigen(matrix: ArrayView2<f64>, name: &str) -> Result<(Vec<f64>, Array2<f64>)> {
    let n = matrix.nrows();
    backend::symmetric_eigen(matrix)
        .ok_or_else(|| Error::Fit(format!("the eigenvalues of the {name}, {n} by {n}, did not converge")))
}

/// Returns U (n, k), σ (k,) in decreasing order and V (m, k) of a matrix (n, m) = U·diag(σ)·Vᵀ, with k = min(n, m).
///
/// # Errors
/// Singular values that do not converge; `name` describes the matrix in the text.
pub(crate) fn thin_svd(matrix: ArrayView2<f64>, name: &str) -> Result<(Array2<f64>, Vec<f64>, Array2<f64>)> {
    let (n, m) = matrix.dim();
    backend::thin_svd(matrix)
        .ok_or_else(|| Error::Fit(format!("the singular values of the {name}, {n} by {m}, did not converge")))
}

/// Returns the inverse (n, n) of a matrix; that of a singular one contains numbers that are not finite.
pub(crate) fn inverse(matrix: ArrayView2<f64>) -> Array2<f64> {
    backend::inverse(matrix)
}

#[cfg(feature = "learning")]
mod faer_backend {
    use faer::linalg::solvers::{DenseSolveCore, Svd};
    use faer::{Mat, MatRef, Side};
    use ndarray::{Array2, ArrayView2};

    fn mat(matrix: ArrayView2<f64>) -> Mat<f64> {
        Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[[i, j]])
    }

    fn array(matrix: MatRef<f64>) -> Array2<f64> {
        Array2::from_shape_fn((matrix.nrows(), matrix.ncols()), |(i, j)| matrix[(i, j)])
    }

    pub(super) fn symmetric_eigen(matrix: ArrayView2<f64>) -> Option<(Vec<f64>, Array2<f64>)> {
        let eigen = mat(matrix).self_adjoint_eigen(Side::Lower).ok()?;
        Some((eigen.S().column_vector().iter().copied().collect(), array(eigen.U())))
    }

    pub(super) fn thin_svd(matrix: ArrayView2<f64>) -> Option<(Array2<f64>, Vec<f64>, Array2<f64>)> {
        let svd = Svd::new_thin(mat(matrix).as_ref()).ok()?;
        Some((array(svd.U()), svd.S().column_vector().iter().copied().collect(), array(svd.V())))
    }

    pub(super) fn inverse(matrix: ArrayView2<f64>) -> Array2<f64> {
        array(mat(matrix).partial_piv_lu().inverse().as_ref())
    }
}

#[cfg(any(test, not(feature = "learning")))]
mod nalgebra_backend {
    use nalgebra::{DMatrix, SVD, SymmetricEigen};
    use ndarray::{Array2, ArrayView2};

    /// Iteration limit, far above what a finite matrix needs: the decomposition of a matrix with NaN would not end.
    const MAX_SWEEPS: usize = 10_000;

    fn mat(matrix: ArrayView2<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[[i, j]])
    }

    fn array(matrix: &DMatrix<f64>) -> Array2<f64> {
        Array2::from_shape_fn(matrix.shape(), |index| matrix[index])
    }

    pub(super) fn symmetric_eigen(matrix: ArrayView2<f64>) -> Option<(Vec<f64>, Array2<f64>)> {
        let eigen = SymmetricEigen::try_new(mat(matrix), f64::EPSILON, MAX_SWEEPS)?;
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
        let values = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
        let vectors = Array2::from_shape_fn(matrix.dim(), |(i, k)| eigen.eigenvectors[(i, order[k])]);
        Some((values, vectors))
    }

    pub(super) fn thin_svd(matrix: ArrayView2<f64>) -> Option<(Array2<f64>, Vec<f64>, Array2<f64>)> {
        let svd = SVD::try_new(mat(matrix), true, true, f64::EPSILON, MAX_SWEEPS)?;
        Some((array(&svd.u?), svd.singular_values.iter().copied().collect(), array(&svd.v_t?.transpose())))
    }

    pub(super) fn inverse(matrix: ArrayView2<f64>) -> Array2<f64> {
        let inverse = mat(matrix).try_inverse();
        inverse.map_or_else(|| Array2::from_elem(matrix.dim(), f64::NAN), |inverse| array(&inverse))
    }
}

#[cfg(all(test, feature = "learning"))]
mod tests {
    use ndarray::{Array1, Array2, ArrayView2};

    use super::{faer_backend, nalgebra_backend};

    fn matrix(n: usize, m: usize) -> Array2<f64> {
        Array2::from_shape_fn((n, m), |(i, j)| (1.0 + (i * i + 3 * j) as f64).sin())
    }

    fn distance(a: &Array2<f64>, b: &ArrayView2<f64>) -> f64 {
        (a - b).iter().fold(0.0, |max, x| max.max(x.abs()))
    }

    /// The product of the factors is the matrix, for both backends.
    #[test]
    fn both_backends_reproduce_the_matrix() {
        let general = matrix(7, 4);
        let symmetric = general.dot(&general.t());
        for (values, vectors) in
            [faer_backend::symmetric_eigen(symmetric.view()), nalgebra_backend::symmetric_eigen(symmetric.view())]
                .map(Option::unwrap)
        {
            assert!(values.is_sorted());
            let product = (&vectors * &Array1::from_vec(values)).dot(&vectors.t());
            assert!(distance(&product, &symmetric.view()) < 1e-13);
        }
        for (u, sigma, v) in
            [faer_backend::thin_svd(general.view()), nalgebra_backend::thin_svd(general.view())].map(Option::unwrap)
        {
            assert!(sigma.iter().rev().is_sorted() && u.dim() == (7, 4) && v.dim() == (4, 4));
            assert!(distance(&(&u * &Array1::from_vec(sigma)).dot(&v.t()), &general.view()) < 1e-13);
        }
        let square = matrix(4, 4) + Array2::<f64>::eye(4) * 3.0;
        for inverse in [faer_backend::inverse(square.view()), nalgebra_backend::inverse(square.view())] {
            assert!(distance(&inverse.dot(&square), &Array2::eye(4).view()) < 1e-13);
        }
    }

    /// A singular matrix has no finite inverse, and a matrix with NaN no finite eigenvalues.
    #[test]
    fn singular_matrices_and_nan_give_no_finite_result() {
        let singular = Array2::ones((3, 3));
        assert!(nalgebra_backend::inverse(singular.view()).iter().any(|x| !x.is_finite()));
        assert!(faer_backend::inverse(singular.view()).iter().any(|x| !x.is_finite()));
        let nan = Array2::from_elem((3, 3), f64::NAN);
        assert!(nalgebra_backend::symmetric_eigen(nan.view()).is_none_or(|(values, _)| values[0].is_nan()));
    }
}
