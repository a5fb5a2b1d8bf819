//! Most probable movement through scalar constraints.
//!
//! A movement is y(v) = c(v) + a(v)ᵀθ + δ(v) with θ ~ N(θ₀, Σ) and, for each DoF d, an independent process δ of variance σ_d² that
//! vanishes at its ends (`residual`). Constraints are values of y or of its derivatives. With the residuals r of the prior mean
//! and
//!
//! ```text
//! K = AΣAᵀ + cov(δ) + diag(tolerance²),     Kλ = r,
//! ```
//!
//! the posterior means are θ = θ₀ + ΣAᵀλ and δ(v) = Σᵢ λᵢ cov(δ(v), δᵢ). Rasmussen and Williams, Gaussian Processes for Machine
//! Learning (2006), Sections 2.2 and 9.4.
//!
//! A displacement that carries the change of the parameters vanishes at the ends E, too: a(E)ᵀΔθ + δ(E) = 0. Given that, with
//! B = cov(δ(E)) of the process without ends,
//!
//! ```text
//! Σ → (Σ⁻¹ + a(E)B⁻¹a(E)ᵀ)⁻¹,     a(v) → a(v) − a(E)k(E, E)⁻¹k(E, v),
//! ```
//!
//! and the rest remains: δ is what it is between ends at zero.

use nalgebra::{DMatrix, DVector};

use super::linear_path::{LinearPath, Samples};
use super::residual::{Bridge, Factor, Functional, Residual};
use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::numerics::simd::{F64x4, pack};

/// Error of a constraint, relative to its scale, at which the refinement stops.
const ACCURACY: f64 = 1e-11;
/// Error from the known response of a table at which weights are refined no further.
const WEIGHT_ACCURACY: f64 = 1e-13;
/// Maximum number of refinements. Each removes the error that rounding and interpolation leave.
const MAX_REFINEMENTS: usize = 20;
/// Variance of a parameter given the others, relative to its own, below which it is rounding.
const MIN_PIVOT: f64 = 1e-12;

/// Distribution of movements.
pub(super) struct Prior<'a> {
    pub(super) path: &'a LinearPath<'a>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) residual: Residual,
    /// σ² (D,).
    pub(super) variances: Vec<f64>,
    /// Clock over the share v.
    pub(super) extent: f64,
    /// True if the displacement carries the change of the parameters, which then remain.
    pub(super) carries: bool,
}

/// Derivative of all DoFs at a place.
pub(super) struct Jet {
    pub(super) functional: Functional,
    /// Coefficients a (width, D).
    pub(super) rows: Vec<f64>,
    /// Prior mean (D,).
    pub(super) mean: Vec<f64>,
}

/// Constraint on a derivative of one DoF.
pub(super) struct Constraint {
    /// Index of the derivative.
    pub(super) jet: usize,
    pub(super) dof: usize,
    /// Difference from the prior mean.
    pub(super) residual: f64,
    /// Standard deviation of the target.
    pub(super) tolerance: f64,
    /// Size of an error that counts.
    pub(super) scale: f64,
}

/// Constraints and the derivatives that they are about.
#[derive(Default)]
pub(super) struct Constraints {
    pub(super) jets: Vec<Jet>,
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

/// Equations of the weights λ.
struct System<'a> {
    prior: &'a Prior<'a>,
    constraints: &'a Constraints,
    functionals: Vec<Functional>,
    bridge: Bridge,
    /// a(E) (width, D) of each end that carries; empty if the conditions do.
    ends: Vec<Vec<f64>>,
    /// Coefficients (width, n) of the constraints in the movement that results.
    rows: DMatrix<f64>,
    /// ΣAᵀ (P, n).
    spread: DMatrix<f64>,
    factor: Factor,
}

impl Prior<'_> {
    /// Computes the posterior mean. A displacement that carries the change of the parameters leaves these as they are.
    ///
    /// Returns `None` if the constraints contradict each other.
    pub(super) fn pass(&self, constraints: &Constraints) -> Option<Passed> {
        let system = self.system(constraints)?;
        let mut errors = DMatrix::from_fn(constraints.rows.len(), 1, |i, _| constraints.rows[i].residual);
        let mut white = errors.clone();
        system.factor.whiten(&mut white);
        let distance = white.norm();
        let (mut weights, mut change) = (DVector::zeros(errors.len()), DVector::zeros(self.covariance.nrows()));
        // Large weights of opposite sign leave a rounding error in a sum of products with them, but not in the sum of its
        // corrections.
        let mut sum: Option<AdditionalForcing> = None;
        for refinement in 0.. {
            let (step, step_change) = system.solve(&errors);
            let correction = system.displacement(&step, &step_change);
            let forcing = match sum {
                Some(sum) => sum.plus(&correction).ok()?,
                None => correction,
            };
            weights += step;
            change += step_change;
            system.errors(&forcing, &weights, &change, &mut errors);
            let error = system.largest(&errors);
            if !(error > ACCURACY && error.is_finite()) || refinement == MAX_REFINEMENTS {
                return Some(Passed { change, forcing, distance, error });
            }
            sum = Some(forcing);
        }
        None
    }

    /// Returns the equations of constraints; `None` if they are singular.
    fn system<'a>(&'a self, constraints: &'a Constraints) -> Option<System<'a>> {
        let (path, width) = (self.path, self.path.width());
        let functionals: Vec<Functional> = constraints.jets.iter().map(|jet| jet.functional).collect();
        let bridge = self.residual.bridge(&functionals);
        let ends: Vec<Vec<f64>> = self.residual.ends().filter(|_| self.carries).map(|end| self.rows_at(end)).collect();
        let covariance = if self.carries { self.given_ends(&ends)? } else { self.covariance.clone() };
        let less = |mut rows: Vec<f64>, gains: &DMatrix<f64>, jet: usize| {
            for (end, gain) in ends.iter().zip(gains.column(jet).iter()) {
                rows.iter_mut().zip(end).for_each(|(x, end)| *x -= gain * end);
            }
            rows
        };
        let jets = constraints.jets.iter().enumerate();
        let exact: Vec<Vec<f64>> = jets.map(|(i, jet)| less(jet.rows.clone(), &bridge.gains, i)).collect();
        let tabulated = |i: usize| {
            let knots = self.residual.knots(functionals[i]).map(|(v, weights)| (v - v.floor(), weights));
            less(path.rows(&Samples::between(&knots)).0, &bridge.tabulated_gains, i)
        };
        let table: Vec<Vec<f64>> = (0..functionals.len()).filter(|_| self.carries).map(tabulated).collect();
        let (n, n_dofs) = (constraints.rows.len(), self.variances.len());
        let compact = |all: &[Vec<f64>]| {
            let row = |i: usize| &constraints.rows[i];
            DMatrix::from_fn(width, n, |c, i| all[row(i).jet][c * n_dofs + row(i).dof])
        };
        let rows = compact(&exact);
        let mut spread = DMatrix::zeros(covariance.nrows(), n);
        for (i, (row, mut to)) in constraints.rows.iter().zip(spread.column_iter_mut()).enumerate() {
            for (c, a) in column(&rows, i).iter().enumerate() {
                to.iter_mut().zip(column(&covariance, path.parameter(c, row.dof))).for_each(|(to, x)| *to += a * x);
            }
        }
        let mut matrix = DMatrix::zeros(n, n);
        for (i, a) in constraints.rows.iter().enumerate() {
            matrix[(i, i)] = a.tolerance * a.tolerance;
            for (j, b) in constraints.rows.iter().enumerate().skip(i) {
                let own = if a.dof == b.dof { self.variances[a.dof] * bridge.covariance[(a.jet, b.jet)] } else { 0.0 };
                matrix[(j, i)] += own + path.row_product(column(&rows, j), b.dof, column(&spread, i));
            }
        }
        let factor = Factor::new(matrix)?;
        let rows = if self.carries { compact(&table) } else { rows };
        Some(System { prior: self, constraints, functionals, bridge, ends, rows, spread, factor })
    }

    /// Returns the coefficients a (width, D) of a derivative.
    fn rows_at(&self, Functional { place, order }: Functional) -> Vec<f64> {
        self.path.rows(&Samples::at(place, order)).0
    }

    /// Returns the covariance of the parameters given that the movement vanishes at the ends, with a(E) of each.
    fn given_ends(&self, ends: &[Vec<f64>]) -> Option<DMatrix<f64>> {
        let (n, n_dofs, width) = (self.covariance.nrows(), self.variances.len(), self.path.width());
        let mut precision = DMatrix::<f64>::zeros(n, n);
        let mut root = semidefinite_root(&self.covariance);
        for dof in 0..n_dofs {
            let mut own = DMatrix::from_fn(ends.len(), width, |e, c| ends[e][c * n_dofs + dof]);
            self.residual.factor().whiten(&mut own);
            let square = own.transpose() * own / self.variances[dof];
            for i in 0..width {
                for j in 0..width {
                    precision[(self.path.parameter(i, dof), self.path.parameter(j, dof))] += square[(i, j)];
                }
            }
        }
        let mut own: DMatrix<f64> = &root * (precision * root.transpose());
        (0..n).for_each(|i| own[(i, i)] += 1.0);
        Factor::new(own)?.whiten(&mut root);
        Some(root.transpose() * root)
    }
}

impl System<'_> {
    /// Returns the largest error relative to its scale.
    fn largest(&self, errors: &DMatrix<f64>) -> f64 {
        let relative = errors.iter().zip(&self.constraints.rows).map(|(error, row)| error.abs() / row.scale);
        relative.fold(0.0, |largest: f64, x| if x > largest || x.is_nan() { x } else { largest })
    }

    /// Returns aᵀΔθ of a constraint.
    fn moved(&self, index: usize, change: &DVector<f64>) -> f64 {
        let dof = self.constraints.rows[index].dof;
        self.prior.path.row_product(column(&self.rows, index), dof, change.as_slice())
    }

    /// Returns the weights λ that remove errors, and ΣAᵀλ, by the known response of a table.
    fn solve(&self, errors: &DMatrix<f64>) -> (DVector<f64>, DVector<f64>) {
        let (mut weights, mut change) = (DVector::zeros(errors.len()), DVector::zeros(self.spread.nrows()));
        let (mut rest, mut last) = (errors.clone(), f64::INFINITY);
        for _ in 0..MAX_REFINEMENTS {
            self.factor.solve(&mut rest);
            weights += rest.column(0);
            change.gemv(1.0, &self.spread, &rest.column(0), 1.0);
            for (i, row) in self.constraints.rows.iter().enumerate() {
                let same = self.constraints.rows.iter().zip(&weights).filter(|(other, _)| other.dof == row.dof);
                let own: f64 = same.map(|(other, weight)| weight * self.bridge.tabulated[(row.jet, other.jet)]).sum();
                let displaced = self.prior.variances[row.dof] * own + self.moved(i, &change);
                rest[i] = errors[i] - displaced - row.tolerance * row.tolerance * weights[i];
            }
            let error = self.largest(&rest);
            if !(error > WEIGHT_ACCURACY && error < 0.5 * last) {
                break;
            }
            last = error;
        }
        (weights, change)
    }

    /// Computes the errors of a displacement.
    fn errors(
        &self,
        forcing: &AdditionalForcing,
        weights: &DVector<f64>,
        change: &DVector<f64>,
        errors: &mut DMatrix<f64>,
    ) {
        let extent = self.prior.extent;
        let value = |Functional { place, order }: &Functional| {
            let [value, slope, bend] = forcing.displacement(place * extent);
            ([value, slope, bend].into_iter().nth(*order).unwrap_or_default(), extent.powi(*order as i32))
        };
        let values: Vec<(Vec<f64>, f64)> = self.functionals.iter().map(value).collect();
        for (i, row) in self.constraints.rows.iter().enumerate() {
            let own = if self.prior.carries { 0.0 } else { self.moved(i, change) };
            let (values, scale) = &values[row.jet];
            errors[i] = row.residual - own - values[row.dof] * scale - row.tolerance * row.tolerance * weights[i];
        }
    }

    /// Returns the displacement for the weights λ, with the change of the parameters that it carries.
    fn displacement(&self, weights: &DVector<f64>, change: &DVector<f64>) -> AdditionalForcing {
        let Prior { path, residual, variances, .. } = self.prior;
        let n_dofs = variances.len();
        let mut own = DMatrix::zeros(self.functionals.len(), n_dofs);
        for (row, weight) in self.constraints.rows.iter().zip(weights) {
            own[(row.jet, row.dof)] += weight * variances[row.dof];
        }
        let mut end_weights = -(&self.bridge.gains * &own);
        if self.prior.carries {
            // a(E)ᵀΔθ.
            let mut ends = DMatrix::zeros(n_dofs, self.ends.len());
            for (rows, mut to) in self.ends.iter().zip(ends.column_iter_mut()) {
                path.products(rows, change.as_slice(), to.as_mut_slice());
            }
            let mut ends = ends.transpose();
            residual.factor().solve(&mut ends);
            end_weights -= ends;
        }
        let row = |matrix: &DMatrix<f64>, i: usize| pack(&matrix.row(i).iter().copied().collect::<Vec<_>>());
        let points = (0..own.nrows()).flat_map(|i| row(&own, i));
        let weights: Vec<F64x4> = points.chain((0..end_weights.nrows()).flat_map(|i| row(&end_weights, i))).collect();
        let carried = self.prior.carries.then(|| path.change(change.as_slice()));
        residual.displacement(n_dofs, &self.functionals, &weights, carried.as_ref())
    }
}

/// Returns a column of a matrix.
fn column(matrix: &DMatrix<f64>, index: usize) -> &[f64] {
    let n = matrix.nrows();
    &matrix.as_slice()[index * n..(index + 1) * n]
}

/// Returns U with UᵀU for a positive semidefinite matrix; rows of dependent columns are zero.
fn semidefinite_root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let mut root = DMatrix::zeros(n, n);
    for j in 0..n {
        let rest = |root: &DMatrix<f64>, i: usize| {
            let (own, other) = (&column(root, i)[..j], &column(root, j)[..j]);
            matrix[(i, j)] - own.iter().zip(other).map(|(a, b)| a * b).sum::<f64>()
        };
        let pivot = rest(&root, j);
        if pivot > MIN_PIVOT * matrix[(j, j)] {
            let inverse = pivot.sqrt().recip();
            for i in j..n {
                root[(j, i)] = rest(&root, i) * inverse;
            }
        }
    }
    root
}
