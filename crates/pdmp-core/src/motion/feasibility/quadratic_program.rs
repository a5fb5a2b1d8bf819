//! Quadratic programs over half-spaces, by Clarabel's interior-point method.
//!
//! P. J. Goulart, Y. Chen, *Clarabel: an interior-point solver for conic programs with quadratic objectives*, 2024,
//! arXiv:2405.12762.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Tolerance of the solver.
const TOLERANCE: f64 = 1e-10;
/// Distance that points keep from each half-space, relative to its distance from the origin, or to 1 if larger: above the
/// tolerance of the solver.
const MARGIN: f64 = 1e-7;
/// Length of a gradient up to which an excess does not depend on x.
const MIN_LENGTH: f64 = 1e-9;
/// Weight of ½|x|² against the excess in the search for the smallest excess: it selects one of several points.
const MIN_WEIGHT: f64 = 1e-6;

/// Half-spaces of x (n,).
#[derive(Default)]
pub(super) struct HalfSpaces {
    /// Normals of unit length.
    normals: Vec<Vec<f64>>,
    /// Signed distances from the origin.
    distances: Vec<f64>,
    /// Excess per distance from the half-space.
    lengths: Vec<f64>,
}

impl HalfSpaces {
    /// Adds the half-space in which an excess at `x` with a given gradient is not positive; returns false if this is zero.
    pub(super) fn add(&mut self, mut gradient: Vec<f64>, excess: f64, x: &[f64]) -> bool {
        let length = gradient.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        if length <= MIN_LENGTH {
            return false;
        }
        gradient.iter_mut().for_each(|slope| *slope /= length);
        let here: f64 = gradient.iter().zip(x).map(|(slope, x)| slope * x).sum();
        let distance = here - excess / length;
        self.normals.push(gradient);
        self.distances.push(distance - MARGIN * distance.abs().max(1.0));
        self.lengths.push(length);
        true
    }

    /// Returns the point nearest to the origin, or `None` if the half-spaces have none in common.
    pub(super) fn nearest(&self) -> Option<Vec<f64>> {
        let n = self.normals.first()?.len();
        // The point is proportional to the distances, which are scaled for the tolerance of the solver.
        let scale = self.distances.iter().fold(1.0f64, |scale, distance| scale.max(distance.abs()));
        let distances = self.distances.iter().map(|distance| distance / scale).collect();
        let columns = (0..n).map(|j| self.column(j).collect()).collect();
        let x = solve(vec![1.0; n], vec![0.0; n], columns, distances)?;
        Some(x.into_iter().map(|x| x * scale).collect())
    }

    /// Returns the point with the smallest maximum excess, and that excess.
    pub(super) fn least_excess(&self) -> Option<(Vec<f64>, f64)> {
        let n = self.normals.first()?.len();
        let offsets = self.distances.iter().zip(&self.lengths).map(|(distance, length)| distance * length);
        // Limits far tighter than the movement are exceeded by many times, which the tolerance of the solver does not suit.
        let scale =
            offsets.clone().chain(self.lengths.iter().copied()).fold(1.0f64, |scale, size| scale.max(size.abs()));
        let slopes =
            |j: usize| self.column(j).zip(&self.lengths).map(|(slope, length)| slope * length / scale).collect();
        let mut columns: Vec<Vec<f64>> = (0..n).map(slopes).collect();
        columns.push(vec![-1.0; self.normals.len()]);
        let (mut weights, mut costs) = (vec![MIN_WEIGHT; n], vec![0.0; n]);
        weights.push(0.0);
        costs.push(1.0);
        let mut x = solve(weights, costs, columns, offsets.map(|offset| offset / scale).collect())?;
        let excess = x.pop()? * scale;
        Some((x, excess))
    }

    fn column(&self, j: usize) -> impl Iterator<Item = f64> {
        self.normals.iter().map(move |normal| normal[j])
    }
}

/// Minimises ½Σ weightⱼxⱼ² + Σ costⱼxⱼ subject to Ax ≤ b, with A by columns; returns `None` without a solution.
fn solve(weights: Vec<f64>, costs: Vec<f64>, columns: Vec<Vec<f64>>, b: Vec<f64>) -> Option<Vec<f64>> {
    let (m, n) = (b.len(), weights.len());
    let quadratic = CscMatrix::new(n, n, (0..=n).collect(), (0..n).collect(), weights);
    let pointers = (0..=n).map(|j| j * m).collect();
    let rows = (0..n).flat_map(|_| 0..m).collect();
    let constraints = CscMatrix::new(m, n, pointers, rows, columns.concat());
    let settings = DefaultSettings {
        verbose: false,
        tol_feas: TOLERANCE,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        ..DefaultSettings::default()
    };
    let cones = [SupportedConeT::NonnegativeConeT(m)];
    let mut solver = DefaultSolver::new(&quadratic, &costs, &constraints, &b, &cones, settings).ok()?;
    solver.solve();
    let solved = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
    (solved && solver.solution.x.iter().all(|x| x.is_finite())).then_some(solver.solution.x)
}
