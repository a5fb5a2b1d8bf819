//! Closing the chain to a circle.
//!
//! The process of the wrapped kernel, Σₙ k(r + 2πn), is driven by noise of period 2π: its state comes back to what it
//! was. So it is the chain from a state ξ at the first sample, once around, given that it ends in ξ; with A and Q of the
//! whole turn, all states together have the density
//!
//! ```text
//! |det(I − A)|·N(x₁; A₀x₀, Q₀)·…·N(x_C; A_{C−1}x_{C−1}, Q_{C−1}),   x₀ = x_C = ξ
//! ```
//!
//! without a prior on ξ. The filter starts from ξ with no uncertainty, and what it expects is linear in ξ, m + Φξ; the
//! end of the chain is an observation of ξ. Least squares over all innovations give ξ̂ and the precision Ω of ξ for each
//! output. With a root W of Ω⁻¹, the columns of Φ·W are further outputs, of weight 1: the directions in which ξ stays
//! uncertain.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, RowSVector, SVector};

use super::kalman_filter::{Path, States, Steps, product};
use super::matern_sde::{Square, rate};
use super::{PORTION, Progress};
use crate::error::Result;
use crate::numerics::simd::{Lanes, WIDTH};

/// A Matérn process on the circle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// Rate λ of the clock a = λu.
    pub(super) rate: f64,
    /// Σₙ k(2πn), by which the wrapped kernel is divided.
    pub(super) norm: f64,
    /// d ln norm/d ln ℓ.
    pub(super) rise: f64,
}

impl Turn {
    /// Of a process of length ℓ.
    ///
    /// The first harmonic has the share (λ/D)… of the variance that falls with λ^{2D}. Where it is lost to rounding, the
    /// kernel is 1 all around, and longer lengths change nothing.
    pub(super) fn new<const D: usize>(length: f64) -> Self {
        let rate = rate::<D>(length).max(f64::EPSILON.powf(0.5 / D as f64));
        // Sums of qⁿ, (nT)qⁿ, (nT)²qⁿ, (nT)³qⁿ over n ≥ 1, with T = 2πλ and q = exp(−T).
        let turn = TAU * rate;
        let q = (-turn).exp();
        let ratio = turn / -(-turn).exp_m1();
        let once = q / -(-turn).exp_m1();
        let [first, second] = [once * ratio, once * ratio * ratio * (1.0 + q)];
        let third = once * ratio.powi(3) * (1.0 + q * (4.0 + q));
        // k = (1 + a)e^{−a} or (1 + a + a²/3)e^{−a}; dk/dlnℓ = −a·dk/da = a²e^{−a} or a²(1 + a)e^{−a}/3.
        let [norm, slope] = match D {
            2 => [1.0 + 2.0 * (once + first), 2.0 * second],
            _ => [1.0 + 2.0 * (once + first + second / 3.0), 2.0 / 3.0 * (second + third)],
        };
        Self { rate, norm, rise: slope / norm }
    }

    /// ln det(I − A) = D·ln(1 − e^{−T}) and its derivative with respect to ln ℓ.
    pub(super) fn log_determinant<const D: usize>(&self) -> (f64, f64) {
        let turn = TAU * self.rate;
        let lost = -(-turn).exp_m1();
        (D as f64 * lost.ln(), -(D as f64) * turn * (-turn).exp() / lost)
    }
}

/// What closes the chain.
pub(super) struct Closure<const D: usize> {
    /// The first state of every output, ξ̂, and W in the columns after the outputs; one a group.
    pub(super) first: Vec<States<D>>,
    /// Inverse of the covariance P of the last state given ξ.
    pub(super) precision: Square<D>,
    /// ln|P| + ln|Ω|.
    pub(super) log_determinant: f64,
}

impl<const D: usize> Closure<D> {
    /// Finds the first states, and corrects the `means` by what depends on them. None if rounding makes it impossible.
    pub(super) fn new(
        path: &Path<D>,
        steps: &Steps<D>,
        targets: &[Lanes],
        means: &mut [States<D>],
        n_outputs: usize,
        progress: &mut Progress,
    ) -> Result<Option<Self>> {
        let (n_samples, groups) = (path.n_samples(), targets.len() / path.n_samples());
        let mut responses: Vec<Square<D>> = Vec::with_capacity(n_samples + 1);
        let mut response = Square::identity();
        let mut information = Square::zeros();
        let mut scores = vec![[Lanes::ZERO; D]; groups];
        for i in 0..n_samples {
            if (i + 1) % PORTION == 0 {
                progress.ask()?;
            }
            let step = steps.at(i);
            responses.push(response);
            let row: RowSVector<f64, D> = response.row(0).into();
            let weighted = row / step.spread;
            information += row.transpose() * weighted;
            let all = i * groups..(i + 1) * groups;
            for ((score, x), y) in scores.iter_mut().zip(&means[all.clone()]).zip(&targets[all]) {
                let innovation = *y - x[0];
                (0..D).for_each(|k| score[k] += innovation * weighted[k]);
            }
            response = path.after(i).matrix * (response - step.gain * row);
        }
        responses.push(response);

        let Some((root, of_covariance)) = inverse_root(&steps.at(n_samples).covariance) else { return Ok(None) };
        let precision = root * root.transpose();
        let gap = Square::identity() - response;
        let lever = precision * gap;
        information += gap.transpose() * lever;
        let Some((root, of_information)) = inverse_root(&information) else { return Ok(None) };
        let covariance = root * root.transpose();
        let mut first = Vec::with_capacity(groups);
        for (score, x) in scores.iter_mut().zip(&means[n_samples * groups..]) {
            let end = product(&lever.transpose(), x);
            (0..D).for_each(|k| score[k] += end[k]);
            first.push(product(&covariance, score));
        }
        for k in 0..D {
            let column = n_outputs + k;
            (0..D).for_each(|i| set(&mut first[column / WIDTH][i], column % WIDTH, root[(i, k)]));
        }
        for (i, response) in responses.iter().enumerate() {
            for (x, first) in means[i * groups..].iter_mut().zip(&first) {
                let correction = product(response, first);
                (0..D).for_each(|k| x[k] += correction[k]);
            }
        }
        Ok(Some(Self { first, precision, log_determinant: of_covariance + of_information }))
    }
}

fn set(lanes: &mut Lanes, lane: usize, value: f64) {
    let mut array = lanes.to_array();
    array[lane] = value;
    *lanes = Lanes::from(array);
}

/// W with M⁻¹ = WWᵀ, and ln|M|. The components of a state differ in size by powers of the step: M is scaled to a
/// diagonal of ones first.
fn inverse_root<const D: usize>(matrix: &Square<D>) -> Option<(Square<D>, f64)> {
    let scale: SVector<f64, D> = SVector::from_fn(|i, _| matrix[(i, i)].sqrt());
    let scaled = Square::from_fn(|i, j| matrix[(i, j)] / (scale[i] * scale[j]));
    let lower: Square<D> = Cholesky::new(scaled)?.l();
    let inverse = lower.solve_lower_triangular(&Square::identity())?;
    let root = Square::from_fn(|i, j| inverse[(j, i)] / scale[i]);
    let log_determinant = 2.0 * (0..D).map(|i| (lower[(i, i)] * scale[i]).ln()).sum::<f64>();
    log_determinant.is_finite().then_some((root, log_determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn norm(d: usize, length: f64) -> f64 {
        let k = |a: f64| if d == 2 { (1.0 + a) * (-a).exp() } else { (1.0 + a + a * a / 3.0) * (-a).exp() };
        let turn = TAU * ((2 * d - 1) as f64).sqrt() / length;
        1.0 + 2.0 * (1..=(60.0 / turn) as i32 + 1).map(|n| k(n as f64 * turn)).sum::<f64>()
    }

    fn check<const D: usize>(length: f64) {
        let turn = Turn::new::<D>(length);
        assert_relative_eq!(turn.norm, norm(D, length), max_relative = 1e-12);
        let [less, more] = [-1e-5_f64, 1e-5].map(|h| Turn::new::<D>(length * h.exp()));
        assert!((turn.rise - (more.norm.ln() - less.norm.ln()) / 2e-5).abs() < 1e-9);
        let rise = (more.log_determinant::<D>().0 - less.log_determinant::<D>().0) / 2e-5;
        assert!((turn.log_determinant::<D>().1 - rise).abs() < 1e-8);
        let matrix = crate::learning::regression::gp::matern_sde::Transition::<D>::new(TAU * turn.rate).matrix;
        let determinant = (0..D).map(|i| 1.0 - matrix[(i, i)]).product::<f64>();
        assert_relative_eq!(turn.log_determinant::<D>().0.exp(), determinant, max_relative = 1e-10);
    }

    proptest! {
        #[test]
        fn a_turn_sums_all_images(e in -3.0..2.0) {
            check::<2>(10f64.powf(e));
            check::<3>(10f64.powf(e));
        }

        #[test]
        fn a_root_of_the_inverse_is_one(entries in prop::array::uniform9(-1.0..1.0), e in 0.0..40.0) {
            // Graded, as covariances of states are.
            let e: f64 = e;
            let grade = Square::<3>::from_diagonal(&SVector::from([-e, -0.5 * e, 0.0].map(|e| 10f64.powf(e))));
            let a = Square::<3>::from_iterator(entries);
            let matrix = grade * (a * a.transpose() + Square::identity()) * grade;
            let (root, log_determinant) = inverse_root(&matrix).unwrap();
            let unit = root.transpose() * matrix * root;
            prop_assert!((unit - Square::identity()).amax() < 1e-12);
            prop_assert!((log_determinant + 2.0 * root.determinant().abs().ln()).abs() < 1e-10);
        }
    }
}
