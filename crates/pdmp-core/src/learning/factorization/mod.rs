//! Truncated singular value decomposition of the stacked targets (step 3 of Section 3.2).
//!
//! Only the K = min(M, C·D) singular vectors of the short side of F are computed, by one of four methods.
//!
//! | method | used for | multiplications | residuals ‖F·v − σ·u‖ of the first J |
//! |---|---|---|---|
//! | `krylov` | a given J for which J + 8, rounded up to a multiple of 8, is at most K/16 | 4·M·C·D·(J + 8) a step, 2 to 10 steps | 1e-12·σ₁ |
//! | `gram` | σ_J ≥ σ₁/10 000 | K·M·C·D + 10·K³ | 1e-11·σ₁ |
//! | `gram`, twice | squared cosines between the rows VᵀF that sum to 0.1 or less | 3·K·M·C·D + 30·K³ more | 1e-15·σ₁ times a modest factor |
//! | `householder` | any targets | 2·K·M·C·D + 30·K³ | 1e-15·σ₁ times a modest factor |
//!
//! They are tried in this order. Each but the last measures its accuracy, and the next method is used where it does not
//! suffice; the last always succeeds. No random numbers and no threads are involved: results are reproducible.
//!
//! Their gain, as the time in ms of five styles of M demonstrations with 1001 samples of 7 DoFs, on one core:
//!
//! | M | `krylov` | `gram` | `householder` |
//! |---:|---:|---:|---:|
//! | 20 | – | 0.5 | 0.9 |
//! | 100 | – | 2.6 | 13 |
//! | 500 | 60 | 121 | 323 |
//! | 1000 | 99 | 652 | 1412 |
//!
//! For all factors of M = 20 the second Gram pass takes 0.5 ms, and `householder` 1.0 ms.

mod gram;
mod householder;
mod krylov;
mod small_svd;
#[cfg(test)]
mod tests;
mod truncation;

use faer::linalg::matmul::matmul;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, ColRef, Mat, MatMut, MatRef, Par};
use ndarray::{Array2, ArrayView2, CowArray, Ix2};

pub use self::truncation::Truncation;
use crate::error::{Error, Result};
use crate::validate::{check_matrix, zeros};

/// Largest residual of a fast method relative to σ₁, and largest product of two basis targets relative to σ₁·σ_j.
const ACCURACY: f64 = 1e-11;

/// Factors S·F_basis ≈ F (Eq. 7), the best approximation of rank J in the Frobenius norm (Eckart and Young 1936).
///
/// F = U·Σ·Vᵀ. The paper's text takes S from the first J rows of U and F_basis from the columns of ΣVᵀ; the shapes
/// require the first J *columns* of U and *rows* of ΣVᵀ, which are used here. The sign of a singular vector is arbitrary:
/// it is fixed so that the entry of largest magnitude in each column of S (the first of equal ones) is positive.
///
/// SᵀS = I to 1e-12, and F_basis = SᵀF to rounding, so that ‖F − S·F_basis‖² = ‖F‖² − Σ_{j≤J} σ_j² (Frobenius norms).
/// Residuals ‖F·v_j − σ_j·u_j‖ are at most 1e-11·σ₁. The error of a singular value is at most the residual, that of a
/// singular vector the residual over the gap to the next singular value.
///
/// Halko, Martinsson, Tropp, SIAM Review 53 (2011) 217–288; Musco, Musco, NIPS 28 (2015) 1396–1404.
///
/// ```
/// # use ndarray::array;
/// use pdmp_core::learning::{Factors, Truncation};
///
/// let targets = array![[1.0, 2.0, 2.0], [2.0, 4.0, 4.0]];
/// let factors = Factors::of(targets.view(), Truncation::Rank(1), &mut |_| Ok(()))?;
/// assert!((factors.styles.dot(&factors.basis_targets) - targets).iter().all(|x| x.abs() < 1e-12));
/// assert!(factors.truncation_error() < 1e-6);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Factors {
    /// Styles S (M, J), the columns of U.
    pub styles: Array2<f64>,
    /// Basis targets F_basis (J, C·D), the rows of ΣVᵀ.
    pub basis_targets: Array2<f64>,
    /// Singular values in decreasing order. With a given J much smaller than K = min(M, C·D), the first J; otherwise all
    /// K, with an error of up to √(K·ε)·σ₁, ε = 2.2e-16, after the first J.
    pub singular_values: Vec<f64>,
    /// Upper bound of the Frobenius norm ‖F − S·F_basis‖, not more than 1e-6·‖F‖ above it.
    pub error: f64,
}

impl Factors {
    /// Returns the relative truncation error ‖F − S·F_basis‖/‖F‖ in the Frobenius norm.
    pub fn truncation_error(&self) -> f64 {
        let first = self.singular_values[0];
        if first == 0.0 {
            return 0.0;
        }
        let kept = self.singular_values.iter().take(self.styles.ncols()).map(|s| (s / first).powi(2)).sum::<f64>();
        let error = self.error / first;
        error / error.hypot(kept.sqrt())
    }

    /// Truncates the factors to the first `n_styles`.
    pub(crate) fn leading(mut self, n_styles: usize) -> Self {
        self.error =
            self.singular_values[n_styles..self.styles.ncols()].iter().fold(self.error, |sum, s| sum.hypot(*s));
        self.styles = self.styles.slice(ndarray::s![.., ..n_styles]).to_owned();
        self.basis_targets = self.basis_targets.slice(ndarray::s![..n_styles, ..]).to_owned();
        self
    }

    /// Computes the leading J factors of the targets F (M, C·D).
    ///
    /// `progress` is called between the passes over F with the completed fraction; an error it returns cancels the call.
    ///
    /// # Errors
    /// J below 1 or above K, a share outside (0, 1], empty targets, targets that are not finite or exceed 1e150 in
    /// magnitude, or the error that `progress` returned.
    pub fn of(
        targets: ArrayView2<f64>,
        styles: Truncation,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        Self::of_compressed(targets, targets.nrows(), styles, progress)
    }

    /// Computes the factors of A (K, C·D), such as a triangular factor, with AᵀA = FᵀF for the targets F of `n_demos`
    /// demonstrations. F_basis and the singular values are those of F.
    ///
    /// # Errors
    /// As for [`Self::of`].
    pub(crate) fn of_compressed(
        targets: ArrayView2<f64>,
        n_demos: usize,
        styles: Truncation,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        if targets.is_empty() {
            return Err(Error::Argument {
                name: "targets",
                problem: "is empty: pass one row per demonstration, one column per value",
            });
        }
        styles.check(n_demos, "demonstrations")?;
        styles.check(targets.ncols(), "target values")?;
        let Some(scaled) = ScaledTargets::of(targets, n_demos)? else {
            return Ok(Self::zero(targets.dim(), n_demos, styles));
        };
        scaled.factors(styles, progress)
    }

    /// Returns the factors of targets that are all zero.
    fn zero((rows, columns): (usize, usize), n_demos: usize, styles: Truncation) -> Self {
        let singular_values = vec![0.0; rows.min(columns)];
        let n_styles = styles.among(&singular_values, n_demos);
        let styles = Array2::from_shape_fn((rows, n_styles), |(i, j)| if i == j { 1.0 } else { 0.0 });
        Self { styles, basis_targets: Array2::zeros((n_styles, columns)), singular_values, error: 0.0 }
    }
}

/// Targets F, divided by a power of two so that their fourth powers neither overflow nor underflow.
struct ScaledTargets<'a> {
    targets: CowArray<'a, f64, Ix2>,
    n_demos: usize,
    scale: f64,
    /// ‖F‖².
    squares: f64,
}

/// S, and the first J rows of SᵀF.
struct Projection {
    styles: Mat<f64>,
    basis_targets: Array2<f64>,
}

/// Inner products of the rows of SᵀF, in the lower triangle.
struct Products(Mat<f64>);

impl<'a> ScaledTargets<'a> {
    /// Scales the targets; returns `None` if all are zero.
    fn of(targets: ArrayView2<'a, f64>, n_demos: usize) -> Result<Option<Self>> {
        let squares = targets.as_slice().map(squares).filter(|squares| (1e-40..1e40).contains(squares));
        if let Some(squares) = squares {
            return Ok(Some(Self { targets: targets.into(), n_demos, scale: 1.0, squares }));
        }
        check_matrix("targets", targets)?;
        let largest = targets.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        if largest == 0.0 {
            return Ok(None);
        }
        // Division by a power of two is exact.
        let scale = if (1e-20..1e20).contains(&largest) { 1.0 } else { largest.log2().floor().exp2() };
        let mut scaled = zeros("targets", targets.dim())?;
        scaled.zip_mut_with(&targets, |to, from| *to = from / scale);
        let squares = self::squares(crate::validate::row_major(&scaled));
        Ok(Some(Self { targets: scaled.into(), n_demos, scale, squares }))
    }

    fn matrix(&self) -> MatRef<'_, f64> {
        let (rows, columns) = self.targets.dim();
        MatRef::from_row_major_slice(crate::validate::row_major(&self.targets), rows, columns)
    }

    /// Returns F or Fᵀ as (K, L) with K ≤ L.
    fn wide(&self) -> MatRef<'_, f64> {
        let targets = self.matrix();
        if targets.nrows() > targets.ncols() { targets.transpose() } else { targets }
    }

    fn factors(&self, styles: Truncation, progress: &mut dyn FnMut(f64) -> Result<()>) -> Result<Factors> {
        let wide = self.wide();
        let k = wide.nrows();
        if let Truncation::Rank(n_styles) = styles
            && let Some(vectors) = krylov::leading(wide, n_styles, &mut |share| progress(share / 3.0))?
        {
            let (projection, products) = self.measured(vectors, n_styles)?;
            if products.are_sound(&projection.styles, n_styles) {
                let values = products.norms();
                let rest = self.squares - values.iter().map(|s| s * s).sum::<f64>();
                return Ok(self.finish(projection, n_styles, values, rest + ROUNDING * self.squares));
            }
        }
        if let Some(gram) = gram::Gram::of(wide, &mut |share| progress((1.0 + share) / 3.0))? {
            let n_styles = styles.among(&gram.values, self.n_demos);
            // With few demonstrations all vectors cost little, and give every singular value full accuracy.
            let kept = if k <= 64 { k } else { n_styles };
            if let Some(vectors) = gram.leading(n_styles, kept) {
                let (projection, products) = self.measured(vectors, n_styles)?;
                if products.are_sound(&projection.styles, n_styles) {
                    let mut values = products.norms();
                    values.extend(&gram.values[kept..]);
                    let rest = self.squares - values[..n_styles].iter().map(|s| s * s).sum::<f64>();
                    return Ok(self.finish(projection, n_styles, values, rest + ROUNDING * self.squares));
                }
            }
            if let Some(triangle) = gram.triangle(wide, &mut |share| progress((2.0 + share) / 3.0))? {
                return self.of_triangle(styles, triangle.as_ref(), Some(gram.vectors.as_ref()));
            }
        }
        self.exact(styles, &mut |share| progress((2.0 + share) / 3.0))
    }

    /// Computes the factors to full accuracy by reflections.
    fn exact(&self, styles: Truncation, progress: &mut dyn FnMut(f64) -> Result<()>) -> Result<Factors> {
        let triangle = householder::triangle(self.wide(), progress)?;
        self.of_triangle(styles, triangle.as_ref(), None)
    }

    /// Computes the factors to full accuracy, from Aᵀ·X = Q·R and R = U·Σ·Vᵀ; Q and U are not needed. X holds
    /// orthonormal columns, `None` for the identity.
    fn of_triangle(&self, styles: Truncation, triangle: MatRef<f64>, frame: Option<MatRef<f64>>) -> Result<Factors> {
        let small_svd::Svd { sigma: values, v, .. } = small_svd::Svd::of(triangle);
        let n_styles = styles.among(&values, self.n_demos);
        let v = v.subcols(0, n_styles);
        let vectors = frame.map_or_else(|| v.to_owned(), |frame| product(frame, v));
        let projection = self.project(vectors, n_styles, |_| ())?;
        let rest = values[n_styles..].iter().map(|s| s * s).sum::<f64>();
        Ok(self.finish(projection, n_styles, values, rest + ROUNDING * ROUNDING * self.squares))
    }

    /// Projects the targets as [`Self::project`] does, and returns the products of all rows of SᵀF with it.
    fn measured(&self, vectors: Mat<f64>, n_styles: usize) -> Result<(Projection, Products)> {
        let mut products = Mat::zeros(vectors.ncols(), vectors.ncols());
        let projection = self.project(vectors, n_styles, |rows| gram::add_square(products.as_mut(), rows))?;
        Ok((projection, Products(products)))
    }

    /// Returns S and F_basis = SᵀF from the singular vectors of the short side.
    ///
    /// `visit` receives all rows of SᵀF, [`PANEL`] columns at a time; the first J rows are kept.
    fn project(&self, vectors: Mat<f64>, n_styles: usize, mut visit: impl FnMut(MatRef<f64>)) -> Result<Projection> {
        let targets = self.matrix();
        let (rows, columns) = targets.shape();
        // F·v = σ·u: orthonormalisation in decreasing order of σ divides by σ.
        let mut styles = match rows > columns {
            true => householder::orthonormal(product(targets, vectors.as_ref())).0,
            false => vectors,
        };
        fix_signs(styles.as_mut());
        let n_vectors = styles.ncols();
        let mut basis_targets = zeros("basis_targets", (n_styles, columns))?;
        let mut part = vec![0.0; n_vectors * PANEL.min(columns)];
        for start in (0..columns).step_by(PANEL) {
            let width = PANEL.min(columns - start);
            let part = &mut part[..n_vectors * width];
            // A column of zeros stays exactly zero, so that a DoF at rest is not moved by rounding errors.
            visit(projected(part, styles.as_ref(), targets.subcols(start, width)));
            let whole = crate::validate::row_major_mut(&mut basis_targets).chunks_exact_mut(columns);
            whole.zip(part.chunks_exact(width)).for_each(|(row, part)| row[start..start + width].copy_from_slice(part));
        }
        Ok(Projection { styles, basis_targets })
    }

    /// Undoes the scaling; `squared_error` is ‖F − S·F_basis‖² of the scaled targets.
    fn finish(&self, projection: Projection, n_styles: usize, values: Vec<f64>, squared_error: f64) -> Factors {
        let Projection { styles, mut basis_targets } = projection;
        if self.scale != 1.0 {
            basis_targets *= self.scale;
        }
        // Rounding may disorder equal values.
        let mut least = f64::INFINITY;
        let decreasing = values.into_iter().map(|value| {
            least = value.min(least);
            least * self.scale
        });
        Factors {
            styles: Array2::from_shape_fn((styles.nrows(), n_styles), |(i, j)| styles[(i, j)]),
            singular_values: decreasing.collect(),
            error: squared_error.max(0.0).sqrt() * self.scale,
            basis_targets,
        }
    }
}

/// Returns the styles S (M, J) for targets projected to F·V·Σ⁻¹ (M, J), orthonormal to full accuracy and with the signs of
/// [`Factors`], and the signs (J,) by which they differ from the projections.
pub(crate) fn orthonormal_styles(projected: Array2<f64>) -> (Array2<f64>, Vec<f64>) {
    let columns = Mat::from_fn(projected.nrows(), projected.ncols(), |i, j| projected[[i, j]]);
    drop(projected);
    let (mut styles, r) = householder::orthonormal(columns);
    let turned: Vec<bool> = (0..r.ncols()).map(|j| r[(j, j)] < 0.0).collect();
    let fixed = fix_signs(styles.as_mut());
    let signs = turned.iter().zip(fixed).map(|(turned, fixed)| if *turned == fixed { 1.0 } else { -1.0 });
    (Array2::from_shape_fn((styles.nrows(), styles.ncols()), |(i, j)| styles[(i, j)]), signs.collect())
}

/// Changes the signs of columns so that their entries of largest magnitude are positive; returns which were changed.
fn fix_signs(mut columns: MatMut<f64>) -> Vec<bool> {
    let fix = |mut column: faer::ColMut<f64>| {
        let peak = column.rb().iter().fold(0.0f64, |peak, &x| if x.abs() > peak.abs() { x } else { peak });
        if peak < 0.0 {
            column.rb_mut().iter_mut().for_each(|x| *x = -*x);
        }
        peak < 0.0
    };
    columns.rb_mut().col_iter_mut().map(fix).collect()
}

/// Returns the sum of squares.
fn squares(numbers: &[f64]) -> f64 {
    ColRef::from_slice(numbers).squared_norm_l2()
}

/// Returns A·X, computed as Xᵀ·Aᵀ: twice as fast for few columns, because the large factor is not repacked.
fn product(a: MatRef<f64>, x: MatRef<f64>) -> Mat<f64> {
    let mut transposed = Mat::zeros(x.ncols(), a.nrows());
    matmul(transposed.as_mut(), Accum::Replace, x.transpose(), a.transpose(), 1.0, Par::Seq);
    transposed.transpose().to_owned()
}

/// Writes Xᵀ·A in row-major order to `part`, and returns it.
fn projected<'a>(part: &'a mut [f64], x: MatRef<f64>, a: MatRef<f64>) -> MatRef<'a, f64> {
    let (rows, columns) = (x.ncols(), a.ncols());
    let part = &mut part[..rows * columns];
    matmul(MatMut::from_row_major_slice_mut(part, rows, columns), Accum::Replace, x.transpose(), a, 1.0, Par::Seq);
    MatRef::from_row_major_slice(part, rows, columns)
}

/// Columns of F that are projected together, and stay in the cache for both products.
const PANEL: usize = 1024;

/// Relative rounding of a sum of squares, with a margin.
const ROUNDING: f64 = 1e-13;

impl Products {
    fn norms(&self) -> Vec<f64> {
        (0..self.0.nrows()).map(|j| self.0[(j, j)].sqrt()).collect()
    }

    /// Returns true if the leading J columns of S are orthonormal and the rows of F_basis orthogonal.
    fn are_sound(&self, styles: &Mat<f64>, n_styles: usize) -> bool {
        let sigma = self.norms();
        let styles = styles.subcols(0, n_styles);
        let gram = product(styles.transpose(), styles);
        (0..n_styles).all(|j| {
            (gram[(j, j)] - 1.0).abs() <= 1e-12
                && (0..j).all(|i| {
                    let floor = sigma[i].max(gram::SMALL * sigma[0]);
                    gram[(i, j)].abs() <= 1e-12 && self.0[(j, i)].abs() <= ACCURACY * sigma[0] * floor
                })
        })
    }
}
