//! The state of a Matérn process and how it moves along the clock.
//!
//! A Matérn process of order D − ½ is the output of D equal filters in a row that are driven by white noise. In units of
//! a = λu, λ = √(2D−1)/ℓ, its state is v₀ = f, vₖ = (d/da + 1)ᵏf, so that v̇ = Fv + noise on v_{D−1}, with −1 on the
//! diagonal of F and 1 above it. Over a step the state becomes A·v + η, η ~ N(0, Q):
//!
//! ```text
//! A_ij(a) = e^{−a}·a^{j−i}/(j−i)!         Q(a) = ∫₀ᵃ q(s)q(s)ᵀ ds,   q_i(s) = √c·e^{−s}·s^{D−1−i}/(D−1−i)!
//! ```
//!
//! with c such that Q₀₀(∞) = k(0) = 1. The length is in a alone: nothing else depends on it. No step is too short: every
//! entry is a sum of positive terms.
//!
//! J. Hartikainen and S. Särkkä, Kalman filtering and smoothing solutions to temporal Gaussian process regression
//! models, MLSP 2010, <https://doi.org/10.1109/MLSP.2010.5589113>.

use nalgebra::{SMatrix, SVector};

/// A matrix on states.
pub(super) type Square<const D: usize> = SMatrix<f64, D, D>;

/// Where e^{−a} is zero; its product with powers of a must not be infinity times zero.
const FAR: f64 = 1e3;
const FACTORIAL: [f64; 3] = [1.0, 1.0, 2.0];

/// Rate λ of the clock a = λu.
pub(super) fn rate<const D: usize>(length: f64) -> f64 {
    ((2 * D - 1) as f64).sqrt() / length
}

/// Covariance of the state without data, Q(∞).
pub(super) fn stationary<const D: usize>() -> Square<D> {
    Transition::new(FAR).noise
}

/// F·v, row by row, for matrices and states alike.
pub(super) fn drift<const D: usize, const N: usize>(v: &SMatrix<f64, D, N>) -> SMatrix<f64, D, N> {
    SMatrix::from_fn(|i, j| if i + 1 < D { v[(i + 1, j)] - v[(i, j)] } else { -v[(i, j)] })
}

/// A step along the clock.
#[derive(Clone, Debug)]
pub(super) struct Transition<const D: usize> {
    pub(super) a: f64,
    /// A(a), upper triangular.
    pub(super) matrix: Square<D>,
    /// Q(a).
    pub(super) noise: Square<D>,
    /// q(a), so that dQ/da = qqᵀ.
    pub(super) drive: SVector<f64, D>,
}

impl<const D: usize> Transition<D> {
    /// Over a ≥ 0.
    pub(super) fn new(a: f64) -> Self {
        let a = a.min(FAR);
        let decay = (-a).exp();
        let powers = [1.0, a, a * a];
        let c = FACTORIAL[D - 1].powi(2) / moment(2 * D - 2);
        let moments = moments::<D>(a, decay * decay);
        Self {
            a,
            matrix: SMatrix::from_fn(|i, j| if j < i { 0.0 } else { decay * powers[j - i] / FACTORIAL[j - i] }),
            noise: SMatrix::from_fn(|i, j| {
                c * moments[2 * D - 2 - i - j] / (FACTORIAL[D - 1 - i] * FACTORIAL[D - 1 - j])
            }),
            drive: SVector::from_fn(|i, _| c.sqrt() * decay * powers[D - 1 - i] / FACTORIAL[D - 1 - i]),
        }
    }
}

/// ∫₀^∞ sᵏe^{−2s} ds = k!/2^{k+1}.
fn moment(k: usize) -> f64 {
    (1..=k).fold(0.5, |m, k| 0.5 * k as f64 * m)
}

/// mₖ = ∫₀ᵃ sᵏe^{−2s} ds for k up to 2D − 2, of which mₖ = k/2·mₖ₋₁ − ½aᵏe^{−2a}: upwards where most of each integral
/// is done, else downwards from a series of positive terms, so that no digits are lost.
fn moments<const D: usize>(a: f64, decay: f64) -> [f64; 5] {
    let last = 2 * D - 2;
    let mut m = [0.0; 5];
    if a > 2.0 {
        m[0] = 0.5 * (1.0 - decay);
        let mut power = 1.0;
        for k in 1..=last {
            power *= a;
            m[k] = 0.5 * (k as f64 * m[k - 1] - power * decay);
        }
    } else {
        // ∫₀ᵃ sᵏe^{−2s} ds = aᵏ⁺¹e^{−2a}·Σⱼ (2a)ʲ/((k+1)…(k+1+j)).
        let mut n = (last + 1) as f64;
        let (mut term, mut sum) = (1.0 / n, 0.0);
        while term > f64::EPSILON / 8.0 * sum {
            sum += term;
            n += 1.0;
            term *= 2.0 * a / n;
        }
        let powers = [1.0, a, a * a, a * a * a, a * a * a * a];
        m[last] = a * powers[last] * decay * sum;
        for k in (1..=last).rev() {
            m[k - 1] = (2.0 * m[k] + powers[k] * decay) / k as f64;
        }
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// Of the same unit whatever the step: component i of a state grows as a^{D−1−i} in the short run.
    fn close<const D: usize>(a: &Square<D>, b: &Square<D>) -> bool {
        let size = |i: usize| a[(i, i)].max(b[(i, i)]).sqrt();
        (0..D).all(|i| (0..D).all(|j| (a[(i, j)] - b[(i, j)]).abs() <= 1e-13 * size(i) * size(j)))
    }

    fn check<const D: usize>(a: f64, b: f64, kernel: impl Fn(f64) -> f64) {
        let [first, second, both] = [a, b, a + b].map(Transition::<D>::new);
        // Two steps are one.
        assert_relative_eq!(second.matrix * first.matrix, both.matrix, max_relative = 1e-12, epsilon = 1e-300);
        let noise = second.matrix * first.noise * second.matrix.transpose() + second.noise;
        assert!(close(&noise, &both.noise), "{noise} {}", both.noise);
        // The process is stationary, and its covariance the kernel.
        let p = stationary::<D>();
        assert!(close(&p, &(first.matrix * p * first.matrix.transpose() + first.noise)));
        assert!(((first.matrix * p)[(0, 0)] - kernel(a)).abs() < 1e-14);
        // dQ/da = FQ + QFᵀ + q(0)q(0)ᵀ, which is q(a)q(a)ᵀ.
        let moved = drift(&first.noise);
        let mut rate = moved + moved.transpose();
        let white = Transition::<D>::new(0.0).drive;
        rate += white * white.transpose();
        let drive = first.drive * first.drive.transpose();
        assert!((rate - drive).amax() < 1e-13, "{rate} {drive}");
    }

    proptest! {
        #[test]
        fn steps_compose_and_keep_the_process_stationary(e in -9.0..2.0, f in -9.0..2.0) {
            let (a, b) = (10f64.powf(e), 10f64.powf(f));
            check::<2>(a, b, |a| (1.0 + a) * (-a).exp());
            check::<3>(a, b, |a| (1.0 + a + a * a / 3.0) * (-a).exp());
        }
    }

    #[test]
    fn no_step_is_too_short_or_too_long() {
        let (none, endless) = (Transition::<3>::new(0.0), Transition::<3>::new(f64::INFINITY));
        assert_eq!((none.matrix, none.noise), (Square::identity(), Square::zeros()));
        assert_eq!((endless.matrix, endless.noise), (Square::zeros(), stationary()));
        assert_eq!(endless.noise[(0, 0)], 1.0);
    }
}
