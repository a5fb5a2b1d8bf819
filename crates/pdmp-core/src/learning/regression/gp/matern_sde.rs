//! Stochastic differential equation of a Matérn process.
//!
//! A Matérn process of order D − ½ is white noise passed through D equal first-order filters in series. On the scaled
//! clock a = λu, λ = √(2D−1)/ℓ, its state is v₀ = f, vₖ = (d/da + 1)ᵏf. It obeys v̇ = Fv + noise on v_{D−1}, where F has
//! −1 on the diagonal and 1 above it. Over a step a the state becomes A·v + η, η ~ N(0, Q):
//!
//! ```text
//! A_ij(a) = e^{−a}·a^{j−i}/(j−i)!         Q(a) = ∫₀ᵃ q(s)q(s)ᵀ ds,   q_i(s) = √c·e^{−s}·s^{D−1−i}/(D−1−i)!
//! ```
//!
//! with c such that Q₀₀(∞) = k(0) = 1. Only a depends on the length. Every entry is a sum of positive terms, so that no
//! step is too short for full accuracy.
//!
//! J. Hartikainen and S. Särkkä, Kalman filtering and smoothing solutions to temporal Gaussian process regression
//! models, MLSP 2010, <https://doi.org/10.1109/MLSP.2010.5589113>.

use nalgebra::{SMatrix, SVector};

/// Matrix on states.
pub(super) type Square<const D: usize> = SMatrix<f64, D, D>;

/// Bound of a step: e^{−a} is zero there, and its products with powers of a stay numbers.
const MAX_STEP: f64 = 1e3;
const FACTORIAL: [f64; 3] = [1.0, 1.0, 2.0];

/// Returns the rate λ of the scaled clock a = λu.
pub(super) fn rate<const D: usize>(length: f64) -> f64 {
    ((2 * D - 1) as f64).sqrt() / length
}

/// Returns the stationary covariance of the state, Q(∞).
pub(super) fn stationary<const D: usize>() -> Square<D> {
    Transition::new(MAX_STEP).noise
}

/// Returns F·v.
pub(super) fn drift<const D: usize, const N: usize>(v: &SMatrix<f64, D, N>) -> SMatrix<f64, D, N> {
    SMatrix::from_fn(|i, j| if i + 1 < D { v[(i + 1, j)] - v[(i, j)] } else { -v[(i, j)] })
}

/// Transition over a step of the clock.
#[derive(Clone, Debug)]
pub(super) struct Transition<const D: usize> {
    /// Length a of the step on the scaled clock.
    pub(super) a: f64,
    /// A(a), upper triangular.
    pub(super) matrix: Square<D>,
    /// Q(a).
    pub(super) noise: Square<D>,
    /// q(a), so that dQ/da = qqᵀ.
    pub(super) diffusion: SVector<f64, D>,
}

impl<const D: usize> Transition<D> {
    /// Returns the transition over a ≥ 0.
    pub(super) fn new(a: f64) -> Self {
        let a = a.min(MAX_STEP);
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
            diffusion: SVector::from_fn(|i, _| c.sqrt() * decay * powers[D - 1 - i] / FACTORIAL[D - 1 - i]),
        }
    }
}

/// Returns ∫₀^∞ sᵏe^{−2s} ds = k!/2^{k+1}.
fn moment(k: usize) -> f64 {
    (1..=k).fold(0.5, |m, k| 0.5 * k as f64 * m)
}

/// Returns mₖ = ∫₀ᵃ sᵏe^{−2s} ds for k up to 2D − 2.
///
/// The recurrence mₖ = k/2·mₖ₋₁ − ½aᵏe^{−2a} runs upwards for long steps; for short ones it runs downwards from a series
/// of positive terms, so that no digits cancel.
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

    /// Compares relative to the standard deviations: component i of a state grows as a^{D−1−i} over a short step.
    fn close<const D: usize>(a: &Square<D>, b: &Square<D>) -> bool {
        let size = |i: usize| a[(i, i)].max(b[(i, i)]).sqrt();
        (0..D).all(|i| (0..D).all(|j| (a[(i, j)] - b[(i, j)]).abs() <= 1e-13 * size(i) * size(j)))
    }

    fn check<const D: usize>(a: f64, b: f64, kernel: impl Fn(f64) -> f64) {
        let [first, second, both] = [a, b, a + b].map(Transition::<D>::new);
        // Two steps compose to one.
        assert_relative_eq!(second.matrix * first.matrix, both.matrix, max_relative = 1e-12, epsilon = 1e-300);
        let noise = second.matrix * first.noise * second.matrix.transpose() + second.noise;
        assert!(close(&noise, &both.noise), "{noise} {}", both.noise);
        // The process is stationary, and its covariance is the kernel.
        let p = stationary::<D>();
        assert!(close(&p, &(first.matrix * p * first.matrix.transpose() + first.noise)));
        assert!(((first.matrix * p)[(0, 0)] - kernel(a)).abs() < 1e-14);
        // dQ/da = FQ + QFᵀ + q(0)q(0)ᵀ, which is q(a)q(a)ᵀ.
        let moved = drift(&first.noise);
        let mut rate = moved + moved.transpose();
        let white = Transition::<D>::new(0.0).diffusion;
        rate += white * white.transpose();
        let diffusion = first.diffusion * first.diffusion.transpose();
        assert!((rate - diffusion).amax() < 1e-13, "{rate} {diffusion}");
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
    fn zero_and_infinite_steps_have_their_limits() {
        let (none, endless) = (Transition::<3>::new(0.0), Transition::<3>::new(f64::INFINITY));
        assert_eq!((none.matrix, none.noise), (Square::identity(), Square::zeros()));
        assert_eq!((endless.matrix, endless.noise), (Square::zeros(), stationary()));
        assert_eq!(endless.noise[(0, 0)], 1.0);
    }
}
