//! Fixed-interval smoother: the state given all samples, by a backward pass over the filter steps.
//!
//! For each sample it yields the adjoint r of the predicted state and its precision N. All samples together correct the
//! prediction x of a state with covariance P to x + P·r, and its covariance to P − P·N·P. No matrix is inverted.
//!
//! A. E. Bryson and M. Frazier, 1963; J. Durbin and S. J. Koopman, Time Series Analysis by State Space Methods, 2nd
//! edition, Oxford 2012, Section 4.4.

use super::kalman_filter::{FilterSteps, States, Transitions, have_settled, transposed};
use super::matern_sde::Square;
use crate::numerics::simd::F64x4;

/// State of the backward pass.
pub(super) struct Smoother<'a, const D: usize> {
    transitions: &'a Transitions<D>,
    steps: &'a FilterSteps<D>,
    /// Adjoints r of the groups.
    pub(super) adjoint: Vec<States<D>>,
    /// Precision N.
    pub(super) precision: Square<D>,
    /// (K⁻¹)ᵢᵢ of the sample last visited.
    pub(super) inverse: f64,
    /// N has converged; it stays constant while the filter steps are equal.
    converged: bool,
}

impl<'a, const D: usize> Smoother<'a, D> {
    /// Begins the backward pass at the end of the process.
    pub(super) fn new(
        transitions: &'a Transitions<D>,
        steps: &'a FilterSteps<D>,
        adjoint: Vec<States<D>>,
        precision: Square<D>,
    ) -> Self {
        Self { transitions, steps, adjoint, precision, inverse: 0.0, converged: false }
    }

    /// Steps back to sample i from the sample after it, and calls `visit` with each group and its (K⁻¹f)ᵢ.
    pub(super) fn back(
        &mut self,
        i: usize,
        means: &[States<D>],
        targets: &[F64x4],
        mut visit: impl FnMut(usize, F64x4),
    ) {
        let (step, matrix) = (self.steps.at(i), &self.transitions.after(i).matrix);
        let inverse_variance = 1.0 / step.variance;
        let groups = self.adjoint.len();
        let row = i * groups..(i + 1) * groups;
        for (group, ((r, x), y)) in self.adjoint.iter_mut().zip(&means[row.clone()]).zip(&targets[row]).enumerate() {
            *r = transposed(matrix, r);
            let ahead = (0..D).fold(F64x4::ZERO, |sum, k| sum + r[k] * step.gain[k]);
            let weight = (*y - x[0]) * inverse_variance - ahead;
            r[0] += weight;
            visit(group, weight);
        }
        let settled = i >= self.steps.settled();
        if self.converged && settled {
            return;
        }
        let n = matrix.transpose() * self.precision * matrix;
        let gained = n * step.gain;
        self.inverse = inverse_variance + step.gain.dot(&gained);
        let mut next = n;
        for k in 0..D {
            next[(k, 0)] -= gained[k];
            next[(0, k)] -= gained[k];
        }
        next[(0, 0)] += self.inverse;
        self.converged = self.transitions.are_even() && settled && have_settled(&self.precision, &next);
        self.precision = 0.5 * (next + next.transpose());
    }
}
