//! The squared exponential on an interval and, wrapped, on the circle.

use std::f64::consts::TAU;

use crate::learning::regression::Domain;

/// exp(−r²/2ℓ²); on the circle Σₙ k(r + 2πn)/Σₙ k(2πn), which is positive definite, because its Fourier coefficients
/// are samples of the spectral density.
#[derive(Clone, Debug)]
pub(super) enum Bell {
    /// Of which the nearest image on either side counts if it is wrapped.
    Images { length: f64, wrapped: bool },
    /// Wrapped, Σ cⱼcos(jr), with Σcⱼ = 1; and dcⱼ/d ln ℓ.
    Cosines(Vec<(f64, f64)>),
}

impl Bell {
    pub(super) fn new(domain: Domain, length: f64) -> Self {
        let wrapped = domain == Domain::Circle;
        // Up to a length of 1 rad the second images, three half turns away or more, stay below 1e-19.
        if !wrapped || length < 1.0 {
            return Self::Images { length, wrapped };
        }
        // Poisson summation: the longer the length, the faster this series converges.
        let square = |j: i32| (j as f64 * length).powi(2);
        let coefficient = |j: i32| if j == 0 { 1.0 } else { 2.0 * (-0.5 * square(j)).exp() };
        let terms: Vec<(f64, f64)> = (0..10).map(|j| (coefficient(j), square(j))).filter(|(c, _)| *c > 1e-20).collect();
        let sum: f64 = terms.iter().map(|(c, _)| c).sum();
        let mean = terms.iter().map(|(c, square)| c * square).sum::<f64>() / sum;
        Self::Cosines(terms.iter().map(|(c, square)| (c / sum, c / sum * (mean - square))).collect())
    }

    /// k(r) and dk/dr.
    pub(super) fn at(&self, r: f64) -> (f64, f64) {
        match self {
            Self::Images { length, wrapped } => {
                let [k, dk, _] = images(r, *length, *wrapped);
                (k, dk)
            }
            Self::Cosines(cosines) => {
                let (mut k, mut dk) = (0.0, 0.0);
                waves(r, cosines, |j, (coefficient, _), cos, sin| {
                    k += coefficient * cos;
                    dk -= coefficient * j * sin;
                });
                (k, dk)
            }
        }
    }

    /// k(r) and dk/d ln ℓ.
    pub(super) fn by_length(&self, r: f64) -> (f64, f64) {
        match self {
            Self::Images { length, wrapped } => {
                let [k, _, by_length] = images(r, *length, *wrapped);
                (k, by_length)
            }
            Self::Cosines(cosines) => {
                let (mut k, mut by_length) = (0.0, 0.0);
                waves(r, cosines, |_, (coefficient, rise), cos, _| {
                    k += coefficient * cos;
                    by_length += rise * cos;
                });
                (k, by_length)
            }
        }
    }
}

/// k, dk/dr and dk/d ln ℓ.
fn images(r: f64, length: f64, wrapped: bool) -> [f64; 3] {
    if !wrapped {
        return plain(r, length);
    }
    let r = r - TAU * (r / TAU).round();
    let sum =
        [r - TAU, r, r + TAU].map(|r| plain(r, length)).iter().fold([0.0; 3], |s, k| [0, 1, 2].map(|i| s[i] + k[i]));
    let [far, _, rise] = plain(TAU, length);
    let norm = 1.0 + 2.0 * far;
    [sum[0] / norm, sum[1] / norm, (sum[2] - 2.0 * rise * sum[0] / norm) / norm]
}

fn plain(r: f64, length: f64) -> [f64; 3] {
    // Far out the exponential is zero, and x must not be infinite.
    let x = (r / length).clamp(-100.0, 100.0);
    let k = (-0.5 * x * x).exp();
    [k, -x / length * k, x * x * k]
}

/// Visits j, its coefficients, cos(jr) and sin(jr), by rotation.
fn waves(r: f64, coefficients: &[(f64, f64)], mut visit: impl FnMut(f64, (f64, f64), f64, f64)) {
    let (sin, cos) = r.sin_cos();
    let (mut c, mut s) = (1.0, 0.0);
    for (j, coefficient) in coefficients.iter().enumerate() {
        visit(j as f64, *coefficient, c, s);
        (c, s) = (c * cos - s * sin, s * cos + c * sin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    const INTERVAL: Domain = Domain::Interval { end: 1.0 };

    fn plain(x: f64) -> f64 {
        (-x * x / 2.0).exp()
    }

    proptest! {
        #[test]
        fn the_kernel_is_the_textbook_one(length in 0.01..10.0, r in -3.0..3.0) {
            prop_assert!((Bell::new(INTERVAL, length).at(r).0 - plain(r / length)).abs() < 1e-14);
        }

        #[test]
        fn wrapping_sums_all_images(length in 0.01..13.0, r in -20.0..20.0) {
            let sum = |r: f64| (-100..=100).map(|n| plain((r + TAU * n as f64) / length)).sum::<f64>();
            let k = Bell::new(Domain::Circle, length).at(r).0;
            prop_assert!((k - sum(r) / sum(0.0)).abs() < 1e-13, "{k} is not {}", sum(r) / sum(0.0));
        }

        #[test]
        fn slopes_are_derivatives(length in 0.05..10.0, r in -7.0..7.0) {
            // The two forms of the wrapped kernel round differently.
            let length: f64 = length;
            prop_assume!((length - 1.0).abs() > 1e-4);
            for domain in [INTERVAL, Domain::Circle] {
                let bell = Bell::new(domain, length);
                let h = 1e-5 * length.min(1.0);
                let difference = (bell.at(r + h).0 - bell.at(r - h).0) / (2.0 * h);
                prop_assert!((bell.at(r).1 - difference).abs() * length.min(1.0) < 1e-4);
                let other = |h: f64| Bell::new(domain, length * h.exp()).at(r).0;
                let (k, by_length) = bell.by_length(r);
                prop_assert_eq!(k, bell.at(r).0);
                prop_assert!((by_length - (other(1e-5) - other(-1e-5)) / 2e-5).abs() < 1e-8);
            }
        }

        #[test]
        fn no_length_or_distance_gives_nan(e in -6.0..6.0, d in -30.0..300.0) {
            for domain in [INTERVAL, Domain::Circle] {
                let bell = Bell::new(domain, 10f64.powf(e));
                let ((k, dk), (_, by_length)) = (bell.at(10f64.powf(d)), bell.by_length(10f64.powf(d)));
                prop_assert!((-1e-15..=1.0 + 1e-15).contains(&k) && dk.is_finite() && by_length.is_finite());
            }
        }
    }

    #[test]
    fn the_wrapped_kernel_is_positive_definite() {
        for length in [0.1, 0.9, 1.1, 3.0, 12.0] {
            let bell = Bell::new(Domain::Circle, length);
            let k = nalgebra::DMatrix::from_fn(60, 60, |i, j| bell.at(0.1 * (i as f64 - j as f64)).0);
            assert!(k.symmetric_eigenvalues().min() > -1e-13, "length {length}");
        }
    }

    #[test]
    fn the_two_forms_meet() {
        let (short, long) = (Bell::new(Domain::Circle, 1.0 - 1e-15), Bell::new(Domain::Circle, 1.0));
        for r in [0.0, 0.5, 2.0, std::f64::consts::PI, 5.0] {
            assert_abs_diff_eq!(short.at(r).0, long.at(r).0, epsilon = 1e-14);
            assert_abs_diff_eq!(short.at(r).1, long.at(r).1, epsilon = 1e-14);
            assert_abs_diff_eq!(short.by_length(r).1, long.by_length(r).1, epsilon = 1e-13);
        }
    }
}
