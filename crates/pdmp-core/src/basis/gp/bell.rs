//! The squared exponential on an interval and, wrapped, on the circle.

use std::f64::consts::TAU;

use crate::basis::Domain;

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
