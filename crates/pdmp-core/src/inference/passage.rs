//! Most probable movement through scalar constraints.
//!
//! A movement is y(v) = c(v) + a(v)ᵀθ + δ(v) with θ ~ N(θ₀, Σ) and, for each DoF d, an independent Matérn-5/2 process δ of
//! variance σ_d². Constraints are values of y, of its derivatives, or of δ alone. With the residuals r of the prior mean and
//!
//! ```text
//! K = AΣAᵀ + cov(δ) + diag(tolerance²),     Kλ = r,
//! ```
//!
//! the posterior means are θ = θ₀ + ΣAᵀλ and δ(v) = Σᵢ λᵢ cov(δ(v), δᵢ). Rasmussen and Williams, Gaussian Processes for Machine
//! Learning (2006), Sections 2.2 and 9.4.

use nalgebra::{DMatrix, DVector};

use super::linear_path::LinearPath;
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::dynamics::canonical::Canonical;
use crate::numerics::matern::Matern52;

/// Number of cells of a displacement: 13 per length scale.
pub(super) const CELLS: usize = 64;
/// Error of a constraint, relative to its scale, at which the refinement stops.
const ACCURACY: f64 = 1e-11;
/// Maximum number of refinements. Each removes the error that rounding and interpolation leave.
const MAX_REFINEMENTS: usize = 20;
/// Addition to the diagonal of the scaled matrix where rounding makes it indefinite.
const JITTER: f64 = 1e-13;

/// Distribution of movements.
pub(super) struct Prior<'a> {
    pub(super) path: &'a LinearPath,
    pub(super) covariance: DMatrix<f64>,
    pub(super) kernel: Matern52,
    /// σ² (D,).
    pub(super) variances: Vec<f64>,
    pub(super) canonical: Canonical,
}

/// Constraint on the derivative of order `order` of one DoF.
pub(super) struct Constraint {
    /// Index of its place.
    pub(super) place: usize,
    pub(super) order: usize,
    pub(super) dof: usize,
    /// a (P,); zero for one on δ alone.
    pub(super) row: Vec<f64>,
    /// Difference from the prior mean.
    pub(super) residual: f64,
    /// Standard deviation of the target.
    pub(super) tolerance: f64,
    /// Size of an error that counts.
    pub(super) scale: f64,
}

/// Constraints and their places v.
#[derive(Default)]
pub(super) struct Constraints {
    pub(super) places: Vec<f64>,
    pub(super) rows: Vec<Constraint>,
}

/// Posterior mean.
pub(super) struct Passed {
    /// Change θ − θ₀.
    pub(super) change: DVector<f64>,
    pub(super) forcing: AdditionalForcing,
    /// Mahalanobis distance √(rᵀK⁻¹r) of the constraints from the prior.
    pub(super) distance: f64,
    /// Largest error of a constraint, relative to its scale.
    pub(super) error: f64,
}

impl Constraints {
    /// Returns the residuals of the prior mean.
    fn residuals(&self) -> DVector<f64> {
        DVector::from_iterator(self.rows.len(), self.rows.iter().map(|row| row.residual))
    }
}

impl Prior<'_> {
    /// Computes the posterior mean. A displacement that `carries` the change of the parameters leaves these as they are.
    ///
    /// Returns `None` if the constraints contradict each other.
    pub(super) fn pass(&self, constraints: &Constraints, from: f64, carries: bool) -> Option<Passed> {
        let n = constraints.rows.len();
        let rows = DMatrix::from_fn(n, self.covariance.nrows(), |i, p| constraints.rows[i].row[p]);
        let spread = &self.covariance * rows.transpose();
        let matrix = &rows * &spread + self.residual_covariance(constraints);
        let scale = DVector::from_fn(n, |i, _| matrix[(i, i)].sqrt());
        if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return None;
        }
        let mut scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / (scale[i] * scale[j]));
        let factor = match scaled.clone().cholesky() {
            Some(factor) => factor,
            None => {
                (0..n).for_each(|i| scaled[(i, i)] += JITTER);
                scaled.cholesky()?
            }
        };
        let solve = |residual: &DVector<f64>| factor.solve(&residual.component_div(&scale)).component_div(&scale);
        let residuals = constraints.residuals();
        let mut weights = solve(&residuals);
        let distance = residuals.dot(&weights).max(0.0).sqrt();
        // Large weights of opposite sign leave a rounding error in ΣAᵀλ, but not in the sum of its corrections.
        let mut change = &spread * &weights;
        for refinement in 0.. {
            let forcing = self.displacement(constraints, &weights, carries.then_some(&change), from);
            let own = if carries { DVector::zeros(n) } else { &rows * &change };
            let errors = DVector::from_fn(n, |i, _| {
                let row = &constraints.rows[i];
                row.residual - own[i] - row.tolerance.powi(2) * weights[i] - self.moved(&forcing, constraints, i)
            });
            let relative = errors.iter().zip(&constraints.rows).map(|(error, row)| error.abs() / row.scale);
            let error = relative.fold(0.0, |largest: f64, x| if x > largest || x.is_nan() { x } else { largest });
            if !(error > ACCURACY && error.is_finite()) || refinement == MAX_REFINEMENTS {
                return Some(Passed { change, forcing, distance, error });
            }
            let correction = solve(&errors);
            change += &spread * &correction;
            weights += correction;
        }
        None
    }

    /// Returns the covariance of δ and of the targets at the constraints.
    fn residual_covariance(&self, Constraints { places, rows }: &Constraints) -> DMatrix<f64> {
        let n = places.len();
        let kernels: Vec<[f64; 5]> =
            (0..n * n).map(|ij| self.kernel.derivatives(places[ij / n] - places[ij % n])).collect();
        DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let (a, b) = (&rows[i], &rows[j]);
            let noise = if i == j { a.tolerance * a.tolerance } else { 0.0 };
            if a.dof != b.dof {
                return noise;
            }
            self.variances[a.dof] * signed(&kernels[a.place * n + b.place], a.order, b.order) + noise
        })
    }

    /// Returns the displacement for the weights λ, with the change of the parameters that it carries.
    fn displacement(
        &self,
        Constraints { places, rows }: &Constraints,
        weights: &DVector<f64>,
        change: Option<&DVector<f64>>,
        from: f64,
    ) -> AdditionalForcing {
        let (extent, n_dofs) = (self.canonical.extent(), self.variances.len());
        let length = if let Canonical::Discrete { .. } = self.canonical { 1.0 - from } else { 1.0 };
        let mut knots = vec![[0.0; 3]; (CELLS + 1) * n_dofs];
        let mut coefficients = vec![0.0; self.covariance.nrows()];
        for (k, jets) in knots.chunks_mut(n_dofs).enumerate() {
            let is_end = k == 0 || k == CELLS;
            // The constraints at the ends leave rounding errors, which would be steps.
            if is_end && (change.is_some() || matches!(self.canonical, Canonical::Discrete { .. })) {
                continue;
            }
            let v = from + length * (k as f64 / CELLS as f64);
            let kernels: Vec<[f64; 5]> = places.iter().map(|place| self.kernel.derivatives(v - place)).collect();
            for (row, weight) in rows.iter().zip(weights) {
                let scale = weight * self.variances[row.dof];
                for (order, x) in jets[row.dof].iter_mut().enumerate() {
                    *x += scale * signed(&kernels[row.place], order, row.order);
                }
            }
            if let Some(change) = change {
                for order in 0..3 {
                    let place = LinearPath::place(v.rem_euclid(1.0), order);
                    for (dof, jets) in jets.iter_mut().enumerate() {
                        self.path.row(&place, order, dof, &mut coefficients);
                        jets[order] += coefficients.iter().zip(change).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
            }
            for jet in jets {
                (jet[1], jet[2]) = (jet[1] / extent, jet[2] / (extent * extent));
            }
        }
        if let Canonical::Rhythmic { .. } = self.canonical {
            let (first, last) = knots.split_at_mut(CELLS * n_dofs);
            last.copy_from_slice(&first[..n_dofs]);
        }
        AdditionalForcing::from_knots(self.canonical, n_dofs, from * extent, &knots)
    }

    /// Returns the value of a displacement that a constraint is about.
    fn moved(&self, forcing: &AdditionalForcing, constraints: &Constraints, index: usize) -> f64 {
        let row = &constraints.rows[index];
        let extent = self.canonical.extent();
        let jets = forcing.displacement(constraints.places[row.place] * extent);
        jets[row.order][row.dof] * extent.powi(row.order as i32)
    }
}

/// Returns cov(y⁽ⁱ⁾, y⁽ʲ⁾) from the derivatives of the kernel.
fn signed(kernel: &[f64; 5], i: usize, j: usize) -> f64 {
    if j == 1 { -kernel[i + j] } else { kernel[i + j] }
}
