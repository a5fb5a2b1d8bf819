//! Truncated singular value decomposition of the stacked targets (step 3 of Section 3.2).
//!
//! Everything works on the short side of F: K = min(M, C·D) singular vectors of length K, found in one of four ways.
//!
//! | way | when | cost | residuals ‖F·v − σ·u‖ of the J kept |
//! |---|---|---|---|
//! | `krylov` | J is given, and J + 8, rounded up to a multiple of 8, is at most K/16 | 4·M·C·D·(J + 8) a step, 2 to 10 steps | 1e-12·σ₁ |
//! | `gram` | σ_J ≥ σ₁/10 000, else nothing is lost but the time | K·M·C·D + 10·K³ | 1e-11·σ₁ |
//! | `gram`, twice | cosines between the images of its vectors have squares that sum up to 0.1 or less | 3·K·M·C·D + 30·K³ more, all of it products | 1e-15·σ₁ times a modest factor |
//! | `reflect` | always | 2·K·M·C·D + 30·K³ | the same |
//!
//! They are tried in this order. Each but the last measures what it found, and leaves the work to the next where it is
//! not good enough; the last cannot fail. No random numbers, no threads: the same answer every time.

mod gram;
mod householder;
mod krylov;
mod small_svd;
#[cfg(test)]
mod tests;

use faer::linalg::matmul::matmul;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, ColRef, Mat, MatMut, MatRef, Par};
use ndarray::{Array2, ArrayView2, CowArray, Ix2};

use crate::error::{Error, Result};
use crate::validate::{check_matrix, zeros};

/// Residuals, and products of different basis targets, that a quick way may leave, in shares of σ₁ and of σ₁·σ_j.
const ACCURACY: f64 = 1e-11;

/// F ≈ S·F_basis (Eq. 7): of all products of this shape, the one nearest to F (Eckart and Young 1936).
///
/// F = U·Σ·Vᵀ. The text takes S from the first J rows of U and F_basis from the columns of ΣVᵀ; their shapes ask for
/// the first J *columns* of U and *rows* of ΣVᵀ, which is what is done here. A singular vector's sign is free; it is
/// fixed so that the entry of largest magnitude in each column of S is positive (the first of them, where several are
/// equal).
///
/// SᵀS = I to 1e-12, and F_basis = SᵀF to rounding, so that ‖F − S·F_basis‖² = ‖F‖² − Σ_{j≤J} σ_j² (Frobenius norms).
/// Residuals ‖F·v_j − σ_j·u_j‖ are at most 1e-11·σ₁; a singular vector is off by that over the distance of its singular
/// value from the next one, and a singular value by no more than that.
///
/// Halko, Martinsson, Tropp, SIAM Review 53 (2011) 217–288; Musco, Musco, NIPS 28 (2015) 1396–1404.
#[derive(Clone, Debug)]
pub struct Factors {
    /// Styles S (M, J), the columns of U.
    pub styles: Array2<f64>,
    /// Basis targets F_basis (J, C·D), the rows of ΣVᵀ.
    pub basis: Array2<f64>,
    /// Singular values in decreasing order: all K = min(M, C·D), of which those after the first J may be off by
    /// √(K·ε)·σ₁, ε = 2.2e-16; or the first J alone, where J was given and is small beside K, so that the others were
    /// never computed.
    pub singular_values: Vec<f64>,
    /// Upper bound of the Frobenius norm ‖F − S·F_basis‖, not more than 1e-6·‖F‖ above it.
    pub error: f64,
}

/// How many style dimensions to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truncation {
    /// Exactly so many.
    Rank(usize),
    /// The fewest whose singular values make up more than this share of the sum of all.
    Share(f64),
    /// The same share of the singular values that exceed `noise`, and at least five of these, or as many as half of the
    /// demonstrations.
    AboveNoise {
        /// Largest singular value of the measurement noise in the targets.
        noise: f64,
        /// Share of the sum, in (0, 1].
        share: f64,
    },
}

/// Styles that are kept as far as they exceed the noise, even where fewer make up the share: so few cost nothing, and a
/// mean with three styles has four, of which the largest two or three often make up nine tenths. Fewer than ten
/// demonstrations do not support so many: predictions from contexts then became worse.
const MIN_STYLES: usize = 5;

/// Smallest singular value, in shares of the largest, that is no rounding error of the targets or of the decomposition.
const MIN_RATIO: f64 = 1e-6;

impl Truncation {
    /// Checks the count against the number of things that limit it.
    pub(crate) fn check(self, most: usize, of: &'static str) -> Result<()> {
        match self {
            Truncation::Rank(n_styles) if n_styles < 1 || n_styles > most => Err(Error::Styles { n_styles, most, of }),
            Truncation::Share(value) | Truncation::AboveNoise { share: value, .. }
                if !(value > 0.0 && value <= 1.0) =>
            {
                Err(Error::Range { name: "singular_value_share", value, allowed: "must lie in (0, 1]" })
            }
            _ => Ok(()),
        }
    }

    /// J for these singular values of so many demonstrations.
    pub(crate) fn among(self, singular_values: &[f64], n_demos: usize) -> usize {
        match self {
            Truncation::Rank(n_styles) => n_styles,
            Truncation::Share(share) => leading(singular_values, share),
            Truncation::AboveNoise { noise, share } => {
                let least = MIN_STYLES.min(n_demos / 2);
                let floor = noise.max(MIN_RATIO * singular_values.first().copied().unwrap_or(0.0));
                let above = singular_values.iter().take_while(|&&sigma| sigma > floor).count().max(1);
                leading(&singular_values[..above], share).max(least).min(above)
            }
        }
    }
}

/// The smallest J with Σⱼσ_j/Σσ_m > share, and all that are not zero where rounding leaves none.
fn leading(singular_values: &[f64], share: f64) -> usize {
    let Some(&largest) = singular_values.first().filter(|&&s| s > 0.0) else { return 1 };
    let total: f64 = singular_values.iter().map(|s| s / largest).sum();
    let mut sum = 0.0;
    for (j, s) in singular_values.iter().enumerate() {
        sum += s / largest;
        if sum > share * total {
            return j + 1;
        }
    }
    let rounding = singular_values.len() as f64 * f64::EPSILON * largest;
    singular_values.iter().filter(|&&s| s > rounding).count().max(1)
}

impl Factors {
    /// Share of the targets, by root mean square, that the factors leave out: ‖F − S·F_basis‖/‖F‖.
    pub fn truncation_error(&self) -> f64 {
        let first = self.singular_values[0];
        if first == 0.0 {
            return 0.0;
        }
        let kept = self.singular_values.iter().take(self.styles.ncols()).map(|s| (s / first).powi(2)).sum::<f64>();
        let left = self.error / first;
        left / left.hypot(kept.sqrt())
    }

    /// The first J of these factors, where more were had.
    pub(crate) fn leading(mut self, n_styles: usize) -> Self {
        self.error =
            self.singular_values[n_styles..self.styles.ncols()].iter().fold(self.error, |sum, s| sum.hypot(*s));
        self.styles = self.styles.slice(ndarray::s![.., ..n_styles]).to_owned();
        self.basis = self.basis.slice(ndarray::s![..n_styles, ..]).to_owned();
        self
    }

    /// The leading J factors of the targets F (M, C·D).
    ///
    /// `progress` is asked between the passes over F whether to go on, and told the share that is done.
    ///
    /// # Errors
    /// A J below 1 or above K, a share outside (0, 1], no targets, or ones that are not finite or beyond [`crate::validate::LARGEST`];
    /// or whatever `progress` returns.
    pub fn of(
        targets: ArrayView2<f64>,
        styles: Truncation,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Self> {
        if targets.is_empty() {
            return Err(Error::Arguments("targets is empty: pass one row per demonstration, one column per value"));
        }
        styles.check(targets.nrows(), "demonstrations")?;
        styles.check(targets.ncols(), "target values")?;
        let Some(library) = Library::of(targets)? else { return Ok(Self::still(targets.dim(), styles)) };
        library.factors(styles, progress)
    }

    /// The factors of targets that are zero throughout.
    fn still((rows, columns): (usize, usize), styles: Truncation) -> Self {
        let singular_values = vec![0.0; rows.min(columns)];
        let n_styles = styles.among(&singular_values, rows);
        let styles = Array2::from_shape_fn((rows, n_styles), |(i, j)| if i == j { 1.0 } else { 0.0 });
        Self { styles, basis: Array2::zeros((n_styles, columns)), singular_values, error: 0.0 }
    }
}

/// The targets F, times a power of two that keeps their fourth powers within the range of numbers.
struct Library<'a> {
    targets: CowArray<'a, f64, Ix2>,
    scale: f64,
    /// ‖F‖².
    squares: f64,
}

/// What the leading vectors of the short side make of the targets: S, and the first J rows of SᵀF.
struct Projection {
    styles: Mat<f64>,
    basis: Array2<f64>,
}

/// Products of the rows of SᵀF with those before them, below the diagonal.
struct Products(Mat<f64>);

impl<'a> Library<'a> {
    /// None where all are zero.
    fn of(targets: ArrayView2<'a, f64>) -> Result<Option<Self>> {
        let squares = targets.as_slice().map(squares).filter(|squares| (1e-40..1e40).contains(squares));
        if let Some(squares) = squares {
            return Ok(Some(Self { targets: targets.into(), scale: 1.0, squares }));
        }
        check_matrix("targets", targets)?;
        let largest = targets.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        if largest == 0.0 {
            return Ok(None);
        }
        // A power of two changes no digit.
        let scale = if (1e-20..1e20).contains(&largest) { 1.0 } else { largest.log2().floor().exp2() };
        let mut scaled = zeros("targets", targets.dim())?;
        scaled.zip_mut_with(&targets, |to, from| *to = from / scale);
        let squares = self::squares(crate::validate::row_major(&scaled));
        Ok(Some(Self { targets: scaled.into(), scale, squares }))
    }

    fn matrix(&self) -> MatRef<'_, f64> {
        let (rows, columns) = self.targets.dim();
        MatRef::from_row_major_slice(crate::validate::row_major(&self.targets), rows, columns)
    }

    /// F or Fᵀ, (K, L) with K ≤ L.
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
                let left = self.squares - values.iter().map(|s| s * s).sum::<f64>();
                return Ok(self.finish(projection, n_styles, values, left + ROUNDING * self.squares));
            }
        }
        if let Some(gram) = gram::Gram::of(wide, &mut |share| progress((1.0 + share) / 3.0))? {
            let n_styles = styles.among(&gram.values, self.targets.nrows());
            // Of few demonstrations all factors cost little, and give all singular values their digits.
            let kept = if k <= 64 { k } else { n_styles };
            if let Some(vectors) = gram.leading(n_styles, kept) {
                let (projection, products) = self.measured(vectors, n_styles)?;
                if products.are_sound(&projection.styles, n_styles) {
                    let mut values = products.norms();
                    values.extend(&gram.values[kept..]);
                    let left = self.squares - values[..n_styles].iter().map(|s| s * s).sum::<f64>();
                    return Ok(self.finish(projection, n_styles, values, left + ROUNDING * self.squares));
                }
            }
            if let Some(triangle) = gram.triangle(wide, &mut |share| progress((2.0 + share) / 3.0))? {
                return self.of_triangle(styles, triangle.as_ref(), Some(gram.vectors.as_ref()));
            }
        }
        self.exact(styles, &mut |share| progress((2.0 + share) / 3.0))
    }

    /// The way that cannot fail.
    fn exact(&self, styles: Truncation, progress: &mut dyn FnMut(f64) -> Result<()>) -> Result<Factors> {
        let triangle = householder::triangle(self.wide(), progress)?;
        self.of_triangle(styles, triangle.as_ref(), None)
    }

    /// All singular values to the last digits, and factors to match: Aᵀ·X = Q·R, R = U·Σ·Vᵀ, of which Q and U are not
    /// needed; X is a `frame` of orthonormal columns, or one.
    fn of_triangle(&self, styles: Truncation, triangle: MatRef<f64>, frame: Option<MatRef<f64>>) -> Result<Factors> {
        let small_svd::Svd { sigma: values, v, .. } = small_svd::Svd::of(triangle);
        let n_styles = styles.among(&values, self.targets.nrows());
        let v = v.subcols(0, n_styles);
        let vectors = frame.map_or_else(|| v.to_owned(), |frame| product(frame, v));
        let projection = self.project(vectors, n_styles, |_| ())?;
        let left = values[n_styles..].iter().map(|s| s * s).sum::<f64>();
        Ok(self.finish(projection, n_styles, values, left + ROUNDING * ROUNDING * self.squares))
    }

    /// S and F_basis = SᵀF from the singular vectors of the short side, and the products of all rows of SᵀF.
    fn measured(&self, vectors: Mat<f64>, n_styles: usize) -> Result<(Projection, Products)> {
        let mut products = Mat::zeros(vectors.ncols(), vectors.ncols());
        let projection = self.project(vectors, n_styles, |rows| gram::add_square(products.as_mut(), rows))?;
        Ok((projection, Products(products)))
    }

    /// S and F_basis = SᵀF from the singular vectors of the short side; `look` sees all rows of SᵀF, of which the first
    /// J are kept, some columns at a time.
    fn project(&self, vectors: Mat<f64>, n_styles: usize, mut look: impl FnMut(MatRef<f64>)) -> Result<Projection> {
        let targets = self.matrix();
        let (rows, columns) = targets.shape();
        // F·v = σ·u: in decreasing order, as they come, dividing by σ is no more than making them orthonormal.
        let mut styles = match rows > columns {
            true => householder::orthonormal(product(targets, vectors.as_ref())).0,
            false => vectors,
        };
        for mut style in styles.col_iter_mut() {
            let peak = style.rb().iter().fold(0.0f64, |peak, &x| if x.abs() > peak.abs() { x } else { peak });
            if peak < 0.0 {
                style.rb_mut().iter_mut().for_each(|x| *x = -*x);
            }
        }
        let found = styles.ncols();
        let mut basis = zeros("basis", (n_styles, columns))?;
        let mut part = vec![0.0; found * PANEL.min(columns)];
        for start in (0..columns).step_by(PANEL) {
            let width = PANEL.min(columns - start);
            let part = &mut part[..found * width];
            // A target that is zero throughout stays so: a DoF at rest is not moved by what rounding leaves of it.
            look(turned(part, styles.as_ref(), targets.subcols(start, width)));
            let whole = crate::validate::row_major_mut(&mut basis).chunks_exact_mut(columns);
            whole.zip(part.chunks_exact(width)).for_each(|(row, part)| row[start..start + width].copy_from_slice(part));
        }
        Ok(Projection { styles, basis })
    }

    /// Undoes the scale; `left` is the square of what they do not tell of F.
    fn finish(&self, projection: Projection, n_styles: usize, values: Vec<f64>, left: f64) -> Factors {
        let Projection { styles, mut basis } = projection;
        if self.scale != 1.0 {
            basis *= self.scale;
        }
        // Equal ones may come in any order after rounding.
        let mut least = f64::INFINITY;
        let decreasing = values.into_iter().map(|value| {
            least = value.min(least);
            least * self.scale
        });
        Factors {
            styles: Array2::from_shape_fn((styles.nrows(), n_styles), |(i, j)| styles[(i, j)]),
            singular_values: decreasing.collect(),
            error: left.max(0.0).sqrt() * self.scale,
            basis,
        }
    }
}

/// The sum of the squares of some numbers.
fn squares(numbers: &[f64]) -> f64 {
    ColRef::from_slice(numbers).squared_norm_l2()
}

/// A·X, as Xᵀ·Aᵀ: twice as fast for few columns, as the large factor is then the one that is not repacked.
fn product(a: MatRef<f64>, x: MatRef<f64>) -> Mat<f64> {
    let mut transposed = Mat::zeros(x.ncols(), a.nrows());
    matmul(transposed.as_mut(), Accum::Replace, x.transpose(), a.transpose(), 1.0, Par::Seq);
    transposed.transpose().to_owned()
}

/// Xᵀ·A, row by row, in a place that is large enough.
fn turned<'a>(part: &'a mut [f64], x: MatRef<f64>, a: MatRef<f64>) -> MatRef<'a, f64> {
    let (rows, columns) = (x.ncols(), a.ncols());
    let part = &mut part[..rows * columns];
    matmul(MatMut::from_row_major_slice_mut(part, rows, columns), Accum::Replace, x.transpose(), a, 1.0, Par::Seq);
    MatRef::from_row_major_slice(part, rows, columns)
}

/// Columns of F that are projected at once, which stay at hand for both products.
const PANEL: usize = 1024;

/// Relative rounding of a sum of squares, with a margin.
const ROUNDING: f64 = 1e-13;

impl Products {
    fn norms(&self) -> Vec<f64> {
        (0..self.0.nrows()).map(|j| self.0[(j, j)].sqrt()).collect()
    }

    /// Whether the J leading columns of S are orthonormal and the rows of F_basis orthogonal.
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
