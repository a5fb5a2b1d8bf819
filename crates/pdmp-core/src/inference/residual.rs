//! Part of a movement that its styles leave: a process δ that vanishes where it begins and ends.
//!
//! Each DoF has an independent Matérn-5/2 process of variance σ_d², given that it vanishes with two derivatives at its ends E:
//!
//! ```text
//! cov(δ(v), δ(w)) = σ_d²·(k(v, w) − k(v, E)·k(E, E)⁻¹·k(E, w)).
//! ```
//!
//! Displacements are tables of polynomials between knots (`additional_forcing`), which interpolate its mean. Their own values
//! at a place are those of the polynomial, which `Bridge` has beside the covariances.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::linear_path::{Change, hermite};
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::canonical::Canonical;
use crate::numerics::matern::Matern52;
use crate::numerics::simd::{F64x4, Kernel, Register, compute, groups};

/// Number of cells of a displacement: 13 per length scale.
pub(super) const CELLS: usize = 64;
/// Addition to the diagonal of a scaled matrix where rounding makes it indefinite.
const JITTER: f64 = 1e-13;

/// Factor of a positive definite matrix, scaled to a diagonal of ones.
pub(super) struct Factor {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Factor {
    /// Returns the factor of a matrix, of which the lower triangle is read; `None` if it is singular or not finite.
    pub(super) fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let scale = DVector::from_fn(n, |i, _| matrix[(i, i)].sqrt().recip());
        if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return None;
        }
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            for (x, s) in column.iter_mut().zip(&scale).skip(j) {
                *x *= s * scale[j];
            }
        }
        let factor = match matrix.clone().cholesky() {
            Some(factor) => factor,
            None => {
                (0..n).for_each(|i| matrix[(i, i)] += JITTER);
                matrix.cholesky()?
            }
        };
        Some(Self { scale, factor })
    }

    /// Solves for the columns of a matrix in place.
    pub(super) fn solve(&self, columns: &mut DMatrix<f64>) {
        self.scale_rows(columns);
        self.factor.solve_mut(columns);
        self.scale_rows(columns);
    }

    /// Multiplies columns (n, m) by the inverse of the triangular factor, so that their products are those of the inverse
    /// matrix.
    pub(super) fn whiten(&self, columns: &mut DMatrix<f64>) {
        self.scale_rows(columns);
        self.factor.l_dirty().solve_lower_triangular_mut(columns);
    }

    fn scale_rows(&self, columns: &mut DMatrix<f64>) {
        for mut column in columns.column_iter_mut() {
            column.component_mul_assign(&self.scale);
        }
    }
}

/// Distribution of δ in units of its variances.
pub(super) struct Residual {
    canonical: Canonical,
    kernel: Matern52,
    /// Place at which displacements begin.
    from: f64,
    /// Places at which δ vanishes with two derivatives.
    ends: Vec<f64>,
    factor: Factor,
}

/// Derivative of order `order` at `place`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Functional {
    pub(super) place: f64,
    pub(super) order: usize,
}

/// Covariances of the values of functionals.
pub(super) struct Bridge {
    /// Covariance (n, n) of δ.
    pub(super) covariance: DMatrix<f64>,
    /// Covariance (n, n) of the table of δ, by rows, and δ.
    pub(super) tabulated: DMatrix<f64>,
    /// k(E, E)⁻¹k(E, ·) (E, n) of δ.
    pub(super) gains: DMatrix<f64>,
    /// That of the table.
    pub(super) tabulated_gains: DMatrix<f64>,
}

impl Residual {
    /// Returns the process of length scale ℓ whose displacements begin at a place, or act on all of a rhythmic movement.
    ///
    /// Returns `None` if the ends are too close to each other.
    pub(super) fn new(canonical: Canonical, length: f64, from: Option<f64>) -> Option<Self> {
        let (kernel, last) = match canonical {
            Canonical::Discrete { .. } => (Matern52::on_line(length), Some(1.0)),
            Canonical::Rhythmic { .. } => (Matern52::on_circle(length), None),
        };
        let first = if last.is_some() { Some(from.unwrap_or(0.0)) } else { from };
        let ends: Vec<f64> = first.into_iter().chain(last).collect();
        let of = |i: usize| Functional { place: ends[i / 3], order: i % 3 };
        let n = 3 * ends.len();
        let factor = Factor::new(DMatrix::from_fn(n, n, |i, j| covariance(&kernel, of(i), of(j))))?;
        Some(Self { canonical, kernel, from: from.unwrap_or(0.0), ends, factor })
    }

    /// Returns value and two derivatives at each place at which δ vanishes.
    pub(super) fn ends(&self) -> impl Iterator<Item = Functional> {
        self.ends.iter().flat_map(|place| (0..3).map(|order| Functional { place: *place, order }))
    }

    /// Returns the factor of k(E, E).
    pub(super) fn factor(&self) -> &Factor {
        &self.factor
    }

    /// Returns the length of a table of displacements.
    fn length(&self) -> f64 {
        if let Canonical::Discrete { .. } = self.canonical { 1.0 - self.from } else { 1.0 }
    }

    /// Returns the place of a knot.
    fn knot(&self, index: usize) -> f64 {
        self.from + self.length() * (index as f64 / CELLS as f64)
    }

    /// Returns the knots around a place, with the weights of value and two derivatives in a functional of a table.
    pub(super) fn knots(&self, functional: Functional) -> [(f64, [f64; 3]); 2] {
        let since = functional.place - self.from;
        let since = if let Canonical::Rhythmic { .. } = self.canonical { since - since.floor() } else { since };
        let per_unit = CELLS as f64 / self.length();
        let position = since * per_unit;
        let cell = (position as usize).min(CELLS - 1);
        let [a, b, c, d, e, f] = hermite(position - cell as f64, functional.order, per_unit);
        [(cell, [a, b, c]), (cell + 1, [d, e, f])]
            .map(|(knot, weights)| (self.knot(knot), if self.is_end(knot) { [0.0; 3] } else { weights }))
    }

    /// Returns whether displacements vanish at a knot.
    fn is_end(&self, knot: usize) -> bool {
        !self.ends.is_empty() && (knot == 0 || knot == CELLS)
    }

    /// Returns the covariances of functionals; `None` if one of them is not finite.
    pub(super) fn bridge(&self, functionals: &[Functional]) -> Bridge {
        let (n, ends) = (functionals.len(), self.ends().collect::<Vec<_>>());
        let knots: Vec<_> = functionals.iter().map(|functional| self.knots(*functional)).collect();
        let tabulated = |knots: &[(f64, [f64; 3]); 2], other: Functional| -> f64 {
            let of = |(place, weights): &(f64, [f64; 3])| {
                let kernel = self.kernel.derivatives(place - other.place);
                (0..3).map(|order| weights[order] * signed(&kernel, order, other.order)).sum::<f64>()
            };
            of(&knots[0]) + of(&knots[1])
        };
        let own = |i: usize, j: usize| covariance(&self.kernel, functionals[i], functionals[j]);
        let mut gains = DMatrix::from_fn(ends.len(), n, |e, i| covariance(&self.kernel, ends[e], functionals[i]));
        let mut tabulated_gains = DMatrix::from_fn(ends.len(), n, |e, i| tabulated(&knots[i], ends[e]));
        let (mut exact, mut table) =
            (DMatrix::from_fn(n, n, own), DMatrix::from_fn(n, n, |i, j| tabulated(&knots[i], functionals[j])));
        if !ends.is_empty() {
            let (cross, table_cross) = (gains.clone(), tabulated_gains.clone());
            self.factor.solve(&mut gains);
            self.factor.solve(&mut tabulated_gains);
            exact.gemm_tr(-1.0, &cross, &gains, 1.0);
            table.gemm_tr(-1.0, &table_cross, &gains, 1.0);
        }
        Bridge { covariance: exact, tabulated: table, gains, tabulated_gains }
    }

    /// Returns the displacement with given weights (functionals, groups) of δ, and of the ends (E, groups), with a change of the
    /// movement that it carries.
    pub(super) fn displacement(
        &self,
        n_dofs: usize,
        functionals: &[Functional],
        weights: &[F64x4],
        change: Option<&Change>,
    ) -> AdditionalForcing {
        let all: Vec<Functional> = functionals.iter().copied().chain(self.ends()).collect();
        let knots = compute(Knots { residual: self, functionals: &all, weights, change, n_groups: groups(n_dofs) });
        AdditionalForcing::from_knots(self.canonical, n_dofs, self.from * self.canonical.extent(), &knots)
    }
}

/// Computes a displacement with two derivatives with respect to the clock, by knots and groups.
struct Knots<'a> {
    residual: &'a Residual,
    functionals: &'a [Functional],
    /// Weights by functional and group.
    weights: &'a [F64x4],
    change: Option<&'a Change<'a>>,
    n_groups: usize,
}

impl Kernel for Knots<'_> {
    type Output = Vec<[F64x4; 3]>;

    #[inline(always)]
    fn run<T: Register>(self) -> Self::Output {
        let Self { residual, functionals, weights, change, n_groups } = self;
        let extent = residual.canonical.extent();
        let mut knots = vec![[F64x4::ZERO; 3]; (CELLS + 1) * n_groups];
        let mut kernels = vec![[0.0; 5]; functionals.len()];
        for k in 0..CELLS + 1 {
            // The constraints at the ends leave rounding errors, which would be steps.
            if residual.is_end(k) {
                continue;
            }
            let v = residual.knot(k);
            let jets = &mut knots[k * n_groups..(k + 1) * n_groups];
            for i in 0..functionals.len() {
                let same = i > 0 && functionals[i].place == functionals[i - 1].place;
                kernels[i] = if same { kernels[i - 1] } else { residual.kernel.derivatives(v - functionals[i].place) };
            }
            for group in 0..n_groups {
                let mut sums = [T::default(); 3];
                for i in 0..functionals.len() {
                    let order = functionals[i].order;
                    let weight = T::load(&weights[i * n_groups + group]) * if order == 1 { -1.0 } else { 1.0 };
                    for derivative in 0..3 {
                        sums[derivative] = sums[derivative] + weight * kernels[i][order + derivative];
                    }
                }
                jets[group] = [sums[0].store(), sums[1].store(), sums[2].store()];
            }
            if let Some(change) = change {
                change.add_to::<T>(v - v.floor(), jets);
            }
            for jet in jets {
                jet[1] *= extent.recip();
                jet[2] *= (extent * extent).recip();
            }
        }
        if residual.ends.is_empty() {
            let (first, last) = knots.split_at_mut(CELLS * n_groups);
            last.copy_from_slice(&first[..n_groups]);
        }
        knots
    }
}

/// Returns the covariance of two functionals of δ without its ends.
fn covariance(kernel: &Matern52, a: Functional, b: Functional) -> f64 {
    signed(&kernel.derivatives(a.place - b.place), a.order, b.order)
}

/// Returns cov(y⁽ⁱ⁾, y⁽ʲ⁾) from the derivatives of the kernel.
fn signed(kernel: &[f64; 5], i: usize, j: usize) -> f64 {
    if j == 1 { -kernel[i + j] } else { kernel[i + j] }
}
