//! The smoother: what all samples say, by a pass back along the path.
//!
//! For each sample it yields the adjoint r of the expected state and its precision N: all samples together move the
//! expectation x of a state of covariance P by P·r, and lower its covariance by P·N·P. No matrix is inverted.
//!
//! A. E. Bryson and M. Frazier, 1963; J. Durbin and S. J. Koopman, Time Series Analysis by State Space Methods, 2nd
//! edition, Oxford 2012, Section 4.4.

use super::kalman_filter::{Path, States, Steps, have_settled, transposed};
use super::matern_sde::Square;
use crate::numerics::simd::Lanes;

/// On its way back along a path.
pub(super) struct Smoother<'a, const D: usize> {
    path: &'a Path<D>,
    steps: &'a Steps<D>,
    /// r of each group.
    pub(super) adjoint: Vec<States<D>>,
    /// N.
    pub(super) precision: Square<D>,
    /// (K⁻¹)ᵢᵢ of the sample just passed.
    pub(super) inverse: f64,
    /// Whether N changes no more while the steps are alike.
    resting: bool,
}

impl<'a, const D: usize> Smoother<'a, D> {
    /// At the end of the path.
    pub(super) fn new(path: &'a Path<D>, steps: &'a Steps<D>, adjoint: Vec<States<D>>, precision: Square<D>) -> Self {
        Self { path, steps, adjoint, precision, inverse: 0.0, resting: false }
    }

    /// Steps back to sample i, from the one after it. `visit` is told the group and (K⁻¹f)ᵢ of its outputs.
    pub(super) fn back(
        &mut self,
        i: usize,
        means: &[States<D>],
        targets: &[Lanes],
        mut visit: impl FnMut(usize, Lanes),
    ) {
        let (step, matrix) = (self.steps.at(i), &self.path.after(i).matrix);
        let certainty = 1.0 / step.spread;
        let groups = self.adjoint.len();
        let all = i * groups..(i + 1) * groups;
        for (group, ((r, x), y)) in self.adjoint.iter_mut().zip(&means[all.clone()]).zip(&targets[all]).enumerate() {
            *r = transposed(matrix, r);
            let taken = (0..D).fold(Lanes::ZERO, |sum, k| sum + r[k] * step.gain[k]);
            let weight = (*y - x[0]) * certainty - taken;
            r[0] += weight;
            visit(group, weight);
        }
        let settled = i >= self.steps.settled();
        if self.resting && settled {
            return;
        }
        let n = matrix.transpose() * self.precision * matrix;
        let lever = n * step.gain;
        self.inverse = certainty + step.gain.dot(&lever);
        let mut next = n;
        for k in 0..D {
            next[(k, 0)] -= lever[k];
            next[(0, k)] -= lever[k];
        }
        next[(0, 0)] += self.inverse;
        self.resting = self.path.is_even() && settled && have_settled(&self.precision, &next);
        self.precision = 0.5 * (next + next.transpose());
    }
}
