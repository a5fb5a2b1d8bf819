//! Periodic boundary condition of processes on the circle.
//!
//! The process with the wrapped kernel Σₙ k(r + 2πn) is driven by noise of period 2π, so that its state is periodic. It
//! equals the process on the line that starts in a state ξ at the first sample, conditioned on ending in ξ one turn
//! later. With A and Q of the whole turn, the states have the joint density
//!
//! ```text
//! |det(I − A)|·N(x₁; A₀x₀, Q₀)·…·N(x_C; A_{C−1}x_{C−1}, Q_{C−1}),   x₀ = x_C = ξ
//! ```
//!
//! without a prior on ξ. The filter starts from ξ with zero covariance, its predictions m + Φξ are linear in ξ, and the
//! end of the process is an observation of ξ. Least squares over all innovations yields ξ̂ for each output, and the
//! precision Ω of ξ. With a root W of Ω⁻¹, the columns of Φ·W are treated as further outputs, of weight 1, along which
//! ξ stays uncertain.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, RowSVector, SVector};

use super::kalman_filter::{FilterSteps, States, Transitions, product};
use super::matern_sde::{Square, rate};
use super::{PORTION, Progress};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};

/// Matérn process on the circle.
#[derive(Clone, Copy, Debug)]
pub(super) struct CircularProcess {
    /// Rate λ of the scaled clock a = λu.
    pub(super) rate: f64,
    /// Norm Σₙ k(2πn), by which the wrapped kernel is divided.
    pub(super) norm: f64,
    /// d ln norm/d ln ℓ.
    pub(super) log_norm_slope: f64,
}

impl CircularProcess {
    /// Returns the process of length scale ℓ.
    ///
    /// The share of the first harmonic in the variance falls with λ^{2D}. Where it vanishes in rounding, the kernel is
    /// constant, and a longer length changes nothing: the rate is bounded there.
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
        Self { rate, norm, log_norm_slope: slope / norm }
    }

    /// Returns ln det(I − A) = D·ln(1 − e^{−T}) and its derivative with respect to ln ℓ.
    pub(super) fn log_determinant<const D: usize>(&self) -> (f64, f64) {
        let turn = TAU * self.rate;
        let decayed = -(-turn).exp_m1();
        (D as f64 * decayed.ln(), -(D as f64) * turn * (-turn).exp() / decayed)
    }
}

/// Initial state that equals the final one.
pub(super) struct PeriodicBoundary<const D: usize> {
    /// Initial states ξ̂ of the outputs, followed by the columns of W, one entry per group.
    pub(super) initial: Vec<States<D>>,
    /// Inverse of the covariance P of the final state given ξ.
    pub(super) precision: Square<D>,
    /// ln|P| + ln|Ω|.
    pub(super) log_determinant: f64,
}

impl<const D: usize> PeriodicBoundary<D> {
    /// Estimates the initial states and corrects the predicted `means` for them.
    ///
    /// Returns `None` if rounding makes a covariance indefinite.
    pub(super) fn new(
        transitions: &Transitions<D>,
        steps: &FilterSteps<D>,
        targets: &[F64x4],
        means: &mut [States<D>],
        n_outputs: usize,
        progress: &mut Progress,
    ) -> Result<Option<Self>> {
        let (n_samples, groups) = (transitions.n_samples(), targets.len() / transitions.n_samples());
        let mut sensitivities: Vec<Square<D>> = Vec::with_capacity(n_samples + 1);
        let mut sensitivity = Square::identity();
        let mut information = Square::zeros();
        let mut scores = vec![[F64x4::ZERO; D]; groups];
        for i in 0..n_samples {
            if (i + 1) % PORTION == 0 {
                progress.report()?;
            }
            let step = steps.at(i);
            sensitivities.push(sensitivity);
            let row: RowSVector<f64, D> = sensitivity.row(0).into();
            let weighted = row / step.variance;
            information += row.transpose() * weighted;
            let at = i * groups..(i + 1) * groups;
            for ((score, x), y) in scores.iter_mut().zip(&means[at.clone()]).zip(&targets[at]) {
                let innovation = *y - x[0];
                (0..D).for_each(|k| score[k] += innovation * weighted[k]);
            }
            sensitivity = transitions.after(i).matrix * (sensitivity - step.gain * row);
        }
        sensitivities.push(sensitivity);

        let Some((root, of_covariance)) = inverse_root(&steps.at(n_samples).covariance) else { return Ok(None) };
        let precision = root * root.transpose();
        let gap = Square::identity() - sensitivity;
        let weighted_gap = precision * gap;
        information += gap.transpose() * weighted_gap;
        let Some((root, of_information)) = inverse_root(&information) else { return Ok(None) };
        let covariance = root * root.transpose();
        let mut initial = Vec::with_capacity(groups);
        for (score, x) in scores.iter_mut().zip(&means[n_samples * groups..]) {
            let end = product(&weighted_gap.transpose(), x);
            (0..D).for_each(|k| score[k] += end[k]);
            initial.push(product(&covariance, score));
        }
        for k in 0..D {
            let column = n_outputs + k;
            (0..D).for_each(|i| set(&mut initial[column / WIDTH][i], column % WIDTH, root[(i, k)]));
        }
        for (i, sensitivity) in sensitivities.iter().enumerate() {
            for (x, initial) in means[i * groups..].iter_mut().zip(&initial) {
                let correction = product(sensitivity, initial);
                (0..D).for_each(|k| x[k] += correction[k]);
            }
        }
        Ok(Some(Self { initial, precision, log_determinant: of_covariance + of_information }))
    }
}

/// Sets one lane of a vector.
fn set(lanes: &mut F64x4, lane: usize, value: f64) {
    let mut array = lanes.to_array();
    array[lane] = value;
    *lanes = F64x4::from(array);
}

/// Returns W with M⁻¹ = WWᵀ, and ln|M|; `None` if M is not positive definite.
///
/// The components of a state differ in magnitude by powers of the step, so M is first scaled to a unit diagonal.
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
        let circle = CircularProcess::new::<D>(length);
        assert_relative_eq!(circle.norm, norm(D, length), max_relative = 1e-12);
        let [less, more] = [-1e-5_f64, 1e-5].map(|h| CircularProcess::new::<D>(length * h.exp()));
        assert!((circle.log_norm_slope - (more.norm.ln() - less.norm.ln()) / 2e-5).abs() < 1e-9);
        let slope = (more.log_determinant::<D>().0 - less.log_determinant::<D>().0) / 2e-5;
        assert!((circle.log_determinant::<D>().1 - slope).abs() < 1e-8);
        let matrix = crate::learning::regression::gp::matern_sde::Transition::<D>::new(TAU * circle.rate).matrix;
        let determinant = (0..D).map(|i| 1.0 - matrix[(i, i)]).product::<f64>();
        assert_relative_eq!(circle.log_determinant::<D>().0.exp(), determinant, max_relative = 1e-10);
    }

    proptest! {
        #[test]
        fn the_norm_sums_all_images(e in -3.0..2.0) {
            check::<2>(10f64.powf(e));
            check::<3>(10f64.powf(e));
        }

        #[test]
        fn the_inverse_root_whitens_its_matrix(entries in prop::array::uniform9(-1.0..1.0), e in 0.0..40.0) {
            // Graded like covariances of states.
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
