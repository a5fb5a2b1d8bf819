//! Truncated singular value decomposition of the stacked targets (step 3 of Section 3.2).

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{Mat, MatRef, Par};
use ndarray::{Array2, ArrayView2, Axis, s};

use crate::error::{Error, Result};

/// F ≈ S·F_basis (Eq. 7).
///
/// The text takes S from the first J rows of U and F_basis from the columns of ΣVᵀ; their shapes ask for the first J
/// *columns* of U and *rows* of ΣVᵀ, which is what is done here.
#[derive(Clone, Debug)]
pub struct Factors {
    /// Styles S (M, K), the columns of U.
    pub styles: Array2<f64>,
    /// Basis targets F_basis (K, C·D), the rows of ΣVᵀ.
    pub basis: Array2<f64>,
    /// Singular values (K,), in decreasing order.
    pub singular_values: Vec<f64>,
}

/// How many style dimensions to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StyleCount {
    /// Exactly so many.
    Given(usize),
    /// The fewest whose singular values make up more than this share of the sum of all.
    Spectrum(f64),
}

impl StyleCount {
    /// Checks the count against the number of things that limit it.
    pub(crate) fn check(self, most: usize, of: &'static str) -> Result<()> {
        match self {
            StyleCount::Given(n_styles) if n_styles < 1 || n_styles > most => Err(Error::Styles { n_styles, most, of }),
            StyleCount::Spectrum(value) if !(value > 0.0 && value <= 1.0) => {
                Err(Error::Range { name: "spectrum", value, allowed: "must lie in (0, 1]" })
            }
            _ => Ok(()),
        }
    }
}

impl Factors {
    /// Decomposes the targets F (M, C·D), K = min(M, C·D).
    ///
    /// A singular vector's sign is free; it is fixed so that the entry of largest magnitude in each column of S is
    /// positive (the first of them, where several are equal).
    ///
    /// # Errors
    /// No convergence, neither of F nor of its transpose.
    pub fn of(targets: ArrayView2<f64>) -> Result<Self> {
        let (rows, columns) = targets.dim();
        let k = rows.min(columns);
        let largest = targets.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if largest == 0.0 {
            return Ok(Self {
                styles: Array2::eye(rows).slice_move(s![.., ..k]),
                basis: Array2::zeros((k, columns)),
                singular_values: vec![0.0; k],
            });
        }
        // faer does not scale its input; a power of two changes no digit.
        let scale = largest.log2().floor().exp2();
        let scaled = Mat::from_fn(rows, columns, |i, j| targets[[i, j]] / scale);
        let (u, sigma, v) = thin_svd(scaled.as_ref())
            .or_else(|| thin_svd(scaled.transpose()).map(|(u, sigma, v)| (v, sigma, u)))
            .ok_or_else(|| Error::Fit(format!("the SVD of the {rows} × {columns} targets did not converge")))?;

        let mut styles = Array2::from_shape_fn((rows, k), |(i, j)| u[(i, j)]);
        let mut basis = Array2::from_shape_fn((k, columns), |(i, j)| sigma[i] * v[(j, i)] * scale);
        // A target that is zero throughout stays so: a DoF at rest is not moved by what rounding leaves of it.
        for (mut column, target) in basis.columns_mut().into_iter().zip(targets.columns()) {
            if target.iter().all(|&f| f == 0.0) {
                column.fill(0.0);
            }
        }
        for (mut style, mut row) in styles.axis_iter_mut(Axis(1)).zip(basis.axis_iter_mut(Axis(0))) {
            let peak = style.iter().fold(0.0f64, |peak, &x| if x.abs() > peak.abs() { x } else { peak });
            if peak < 0.0 {
                style.mapv_inplace(|x| -x);
                row.mapv_inplace(|x| -x);
            }
        }
        Ok(Self { styles, basis, singular_values: sigma.iter().map(|s| s * scale).collect() })
    }

    /// Keeps the leading style dimensions.
    ///
    /// # Errors
    /// A number below 1 or above K, or a share outside (0, 1].
    pub fn truncate(mut self, count: StyleCount) -> Result<Self> {
        count.check(self.styles.nrows(), "demonstrations")?;
        count.check(self.basis.ncols(), "target values")?;
        let n_styles = match count {
            StyleCount::Given(n_styles) => n_styles,
            StyleCount::Spectrum(share) => leading(&self.singular_values, share),
        };
        self.styles = self.styles.slice_move(s![.., ..n_styles]).as_standard_layout().into_owned();
        self.basis = self.basis.slice_move(s![..n_styles, ..]);
        Ok(self)
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
    singular_values.iter().filter(|&&s| s > f64::EPSILON * largest).count().max(1)
}

/// U, σ and V of the thin SVD, or nothing where faer's iteration does not converge.
fn thin_svd(matrix: MatRef<f64>) -> Option<(Mat<f64>, Vec<f64>, Mat<f64>)> {
    let (m, n) = matrix.shape();
    let k = m.min(n);
    let (mut u, mut sigma, mut v) = (Mat::zeros(m, k), Diag::zeros(k), Mat::zeros(n, k));
    let thin = ComputeSvdVectors::Thin;
    // One thread, named here: faer's own default belongs to the whole process.
    let par = Par::Seq;
    let mut memory = MemBuffer::new(svd_scratch::<f64>(m, n, thin, thin, par, Default::default()));
    let stack = MemStack::new(&mut memory);
    svd(matrix, sigma.as_mut(), Some(u.as_mut()), Some(v.as_mut()), par, stack, Default::default()).ok()?;
    let sigma: Vec<f64> = sigma.column_vector().iter().copied().collect();
    sigma.iter().all(|s| s.is_finite()).then_some((u, sigma, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
        (a - b).iter().fold(0.0, |most, x| most.max(x.abs()))
    }

    fn matrix(rows: usize, columns: usize, rank: usize) -> Array2<f64> {
        let left = Array2::from_shape_fn((rows, rank), |(i, j)| ((i * 7 + j * 3) as f64).sin());
        let right = Array2::from_shape_fn((rank, columns), |(i, j)| ((i * 5 + j * 11) as f64).cos());
        left.dot(&right)
    }

    /// S has orthonormal columns and S·F_basis is F, for wide and tall, full and deficient matrices of any scale.
    #[test]
    fn factors_reconstruct_the_targets() {
        for (rows, columns, rank) in [(5, 40, 5), (40, 5, 5), (6, 30, 2), (1, 9, 1)] {
            for scale in [1e-150, 1.0, 1e150] {
                let targets = matrix(rows, columns, rank) * scale;
                let factors = Factors::of(targets.view()).unwrap();
                assert!(distance(&(factors.styles.dot(&factors.basis) / scale), &(&targets / scale)) < 1e-12);
                let gram = factors.styles.t().dot(&factors.styles);
                assert!(distance(&gram, &Array2::eye(gram.nrows())) < 1e-12);
                assert!(factors.singular_values.windows(2).all(|pair| pair[0] >= pair[1]));
            }
        }
    }

    /// The largest entry of every style column is positive, whatever the sign of the data.
    #[test]
    fn signs_are_fixed() {
        let targets = matrix(5, 40, 4);
        for sign in [1.0, -1.0] {
            let styles = Factors::of((&targets * sign).view()).unwrap().styles;
            for column in styles.columns() {
                let peak = column.iter().fold(0.0f64, |p, &x| if x.abs() > p.abs() { x } else { p });
                assert!(peak > 0.0);
            }
        }
    }

    /// J is the smallest number of singular values above the share, and 1 where all targets vanish.
    #[test]
    fn spectrum_rule_is_the_papers() {
        assert_eq!(leading(&[8.0, 1.5, 0.5], 0.9), 2);
        assert_eq!(leading(&[9.0, 1.0], 0.9), 2);
        assert_eq!(leading(&[9.1, 0.9], 0.9), 1);
        assert_eq!(leading(&[3.0, 2.0, 0.0], 1.0), 2);
        assert_eq!(leading(&[0.0, 0.0], 0.9), 1);
        let still = Factors::of(Array2::zeros((3, 8)).view()).unwrap();
        assert_eq!(still.truncate(StyleCount::Spectrum(0.9)).unwrap().styles.dim(), (3, 1));
    }

    #[test]
    fn style_counts_outside_the_data_are_refused() {
        for count in
            [StyleCount::Given(0), StyleCount::Given(6), StyleCount::Spectrum(0.0), StyleCount::Spectrum(f64::NAN)]
        {
            assert!(Factors::of(matrix(5, 40, 5).view()).unwrap().truncate(count).is_err());
        }
    }
}
