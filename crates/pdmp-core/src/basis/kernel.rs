//! Stationary covariance functions on an interval and, wrapped, on the circle.

use std::f64::consts::TAU;
use std::fmt;

use super::Domain;

/// Covariance function of a Gaussian process, with x = |r|/length.
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 4.2.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// (1 + √3x)·exp(−√3x): once differentiable.
    Matern32,
    /// (1 + √5x + 5x²/3)·exp(−√5x): twice differentiable.
    #[default]
    Matern52,
    /// exp(−x²/2): infinitely differentiable.
    SquaredExponential,
}

impl Kernel {
    /// All kernels.
    pub const ALL: [Kernel; 3] = [Kernel::Matern32, Kernel::Matern52, Kernel::SquaredExponential];

    /// The name used in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kernel::Matern32 => "matern32",
            Kernel::Matern52 => "matern52",
            Kernel::SquaredExponential => "squared_exponential",
        }
    }

    /// The kernel of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kernel| kernel.name() == name)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Kernel::Matern32 => "Matérn-3/2",
            Kernel::Matern52 => "Matérn-5/2",
            Kernel::SquaredExponential => "squared exponential",
        })
    }
}

/// A kernel of given length on a given domain, with k(0) = 1.
///
/// On the circle it is wrapped, Σₙ k(r + 2πn)/Σₙ k(2πn): positive definite, because its Fourier coefficients are
/// samples of the spectral density.
#[derive(Clone, Debug)]
pub(super) enum Covariance {
    /// Matérn: a quadratic times an exponential.
    Matern {
        /// Derivative of a = λ|r|, λ = √(2ν)/length.
        rate: f64,
        /// p with k = p(a)·exp(−a).
        value: [f64; 3],
        /// p′ − p, so that dk/da = (p′ − p)(a)·exp(−a).
        slope: [f64; 3],
        /// How it is wrapped.
        images: Option<Images>,
    },
    /// Squared exponential, of which the nearest image on either side counts if it is wrapped.
    Gaussian { length: f64, wrapped: bool },
    /// Squared exponential, wrapped: Σ cⱼcos(jr), with Σcⱼ = 1.
    Cosines(Vec<f64>),
}

impl Covariance {
    pub(super) fn new(kernel: Kernel, domain: Domain, length: f64) -> Self {
        let wrapped = domain == Domain::Circle;
        match kernel {
            Kernel::Matern32 => Self::matern(3.0_f64.sqrt() / length, [1.0, 1.0, 0.0], wrapped),
            Kernel::Matern52 => Self::matern(5.0_f64.sqrt() / length, [1.0, 1.0, 1.0 / 3.0], wrapped),
            // Up to a length of 1 rad the second images, three half turns away or more, stay below 1e-19.
            Kernel::SquaredExponential if !wrapped || length < 1.0 => Self::Gaussian { length, wrapped },
            // Poisson summation: the longer the length, the faster this series converges.
            Kernel::SquaredExponential => {
                let coefficient = |j: i32| if j == 0 { 1.0 } else { 2.0 * (-0.5 * (j as f64 * length).powi(2)).exp() };
                let mut cosines: Vec<f64> = (0..10).map(coefficient).filter(|&c| c > 1e-20).collect();
                let sum: f64 = cosines.iter().sum();
                cosines.iter_mut().for_each(|c| *c /= sum);
                Self::Cosines(cosines)
            }
        }
    }

    fn matern(rate: f64, value: [f64; 3], wrapped: bool) -> Self {
        let slope = [value[1] - value[0], 2.0 * value[2] - value[1], -value[2]];
        Self::Matern { rate, value, slope, images: wrapped.then(|| Images::new(rate, &value)) }
    }

    /// k(r) and dk/dr.
    pub(super) fn at(&self, r: f64) -> (f64, f64) {
        match self {
            Self::Matern { rate, value, slope, images: None } => {
                // Far out exp(−a) is zero, and a² must not be infinite.
                let a = (rate * r.abs()).min(1e3);
                let decay = (-a).exp();
                (polynomial(value, a) * decay, r.signum() * rate * polynomial(slope, a) * decay)
            }
            Self::Matern { rate, value, slope, images: Some(images) } => {
                let a = rate * r.rem_euclid(TAU);
                let b = (images.turn - a).max(0.0);
                let k = images.sum(value, a) + images.sum(value, b);
                let dk = images.sum(slope, a) - images.sum(slope, b);
                (k / images.norm, rate * dk / images.norm)
            }
            Self::Gaussian { length, wrapped: false } => gaussian(r, *length),
            Self::Gaussian { length, wrapped: true } => {
                let r = r - TAU * (r / TAU).round();
                let images = [r - TAU, r, r + TAU].map(|r| gaussian(r, *length));
                let norm = 1.0 + 2.0 * gaussian(TAU, *length).0;
                (images.iter().map(|k| k.0).sum::<f64>() / norm, images.iter().map(|k| k.1).sum::<f64>() / norm)
            }
            Self::Cosines(cosines) => {
                // cos(jr) and sin(jr) by rotation.
                let (sin, cos) = r.sin_cos();
                let (mut c, mut s, mut k, mut dk) = (1.0, 0.0, 0.0, 0.0);
                for (j, coefficient) in cosines.iter().enumerate() {
                    k += coefficient * c;
                    dk -= coefficient * j as f64 * s;
                    (c, s) = (c * cos - s * sin, s * cos + c * sin);
                }
                (k, dk)
            }
        }
    }
}

/// The images of a Matérn kernel around the circle, in closed form.
///
/// With d = 2πλ, q = exp(−d) and a quadratic p, Σₙ p(a + nd)·exp(−a − nd) over n ≥ 0 is
/// exp(−a)·(p(a)Σqⁿ + p′(a)dΣnqⁿ + ½p″d²Σn²qⁿ), whose sums are 1/(1−q), q/(1−q)², q(1+q)/(1−q)³. The common factor
/// 1/(1−q) is left out: it cancels against the norm.
#[derive(Clone, Debug)]
pub(super) struct Images {
    /// d, one turn in units of a.
    turn: f64,
    /// dΣnqⁿ / Σqⁿ.
    first: f64,
    /// d²Σn²qⁿ / Σqⁿ.
    second: f64,
    /// The sum over all images at r = 0.
    norm: f64,
}

impl Images {
    fn new(rate: f64, value: &[f64; 3]) -> Self {
        let turn = TAU * rate;
        let q = (-turn).exp();
        let ratio = turn / -(-turn).exp_m1();
        let first = if q > 0.0 { ratio * q } else { 0.0 };
        let second = if q > 0.0 { ratio * ratio * q * (1.0 + q) } else { 0.0 };
        let mut images = Self { turn, first, second, norm: 1.0 };
        images.norm = images.sum(value, 0.0) + images.sum(value, turn);
        images
    }

    /// Sum over a and all its images farther out.
    fn sum(&self, p: &[f64; 3], a: f64) -> f64 {
        let a = a.min(1e3);
        let derivative = p[1] + 2.0 * p[2] * a;
        (-a).exp() * (polynomial(p, a) + derivative * self.first + p[2] * self.second)
    }
}

fn polynomial(p: &[f64; 3], a: f64) -> f64 {
    p[0] + a * (p[1] + a * p[2])
}

fn gaussian(r: f64, length: f64) -> (f64, f64) {
    // Far out the exponential is zero, and x must not be infinite.
    let x = (r / length).clamp(-100.0, 100.0);
    let k = (-0.5 * x * x).exp();
    (k, -x / length * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    const INTERVAL: Domain = Domain::Interval { end: 1.0 };

    /// The textbook formula.
    fn plain(kernel: Kernel, x: f64) -> f64 {
        let x = x.abs();
        match kernel {
            Kernel::Matern32 => (1.0 + 3f64.sqrt() * x) * (-(3f64.sqrt()) * x).exp(),
            Kernel::Matern52 => (1.0 + 5f64.sqrt() * x + 5.0 / 3.0 * x * x) * (-(5f64.sqrt()) * x).exp(),
            Kernel::SquaredExponential => (-x * x / 2.0).exp(),
        }
    }

    fn kernels() -> impl Strategy<Value = Kernel> {
        prop::sample::select(&Kernel::ALL[..])
    }

    proptest! {
        #[test]
        fn the_kernel_is_the_textbook_one(kernel in kernels(), length in 0.01..10.0, r in -3.0..3.0) {
            let k = Covariance::new(kernel, INTERVAL, length).at(r).0;
            prop_assert!((k - plain(kernel, r / length)).abs() < 1e-14);
        }

        #[test]
        fn wrapping_sums_all_images(kernel in kernels(), length in 0.01..13.0, r in -20.0..20.0) {
            let sum = |r: f64| (-100..=100).map(|n| plain(kernel, (r + TAU * n as f64) / length)).sum::<f64>();
            let k = Covariance::new(kernel, Domain::Circle, length).at(r).0;
            prop_assert!((k - sum(r) / sum(0.0)).abs() < 1e-13, "{k} is not {}", sum(r) / sum(0.0));
        }

        #[test]
        fn the_slope_is_the_derivative(kernel in kernels(), length in 0.05..10.0, r in -7.0..7.0) {
            for domain in [INTERVAL, Domain::Circle] {
                let covariance = Covariance::new(kernel, domain, length);
                let h = 1e-5 * length.min(1.0);
                let difference = (covariance.at(r + h).0 - covariance.at(r - h).0) / (2.0 * h);
                prop_assert!((covariance.at(r).1 - difference).abs() * length.min(1.0) < 1e-4);
            }
        }

        #[test]
        fn no_length_or_distance_gives_nan(kernel in kernels(), e in -6.0..6.0, d in -30.0..300.0) {
            for domain in [INTERVAL, Domain::Circle] {
                let (k, dk) = Covariance::new(kernel, domain, 10f64.powf(e)).at(10f64.powf(d));
                prop_assert!((-1e-15..=1.0 + 1e-15).contains(&k) && dk.is_finite());
            }
        }
    }

    #[test]
    fn the_wrapped_kernel_is_positive_definite() {
        for kernel in Kernel::ALL {
            for length in [0.1, 0.9, 1.1, 3.0, 12.0] {
                let covariance = Covariance::new(kernel, Domain::Circle, length);
                let k = nalgebra::DMatrix::from_fn(60, 60, |i, j| covariance.at(0.1 * (i as f64 - j as f64)).0);
                assert!(k.symmetric_eigenvalues().min() > -1e-13, "{kernel}, length {length}");
            }
        }
    }

    #[test]
    fn the_two_forms_of_the_squared_exponential_meet() {
        let short = Covariance::new(Kernel::SquaredExponential, Domain::Circle, 1.0 - 1e-15);
        let long = Covariance::new(Kernel::SquaredExponential, Domain::Circle, 1.0);
        for r in [0.0, 0.5, 2.0, std::f64::consts::PI, 5.0] {
            assert_abs_diff_eq!(short.at(r).0, long.at(r).0, epsilon = 1e-14);
            assert_abs_diff_eq!(short.at(r).1, long.at(r).1, epsilon = 1e-14);
        }
    }

    #[test]
    fn names_lead_back_to_their_kernels() {
        for kernel in Kernel::ALL {
            assert_eq!(Kernel::from_name(kernel.name()), Some(kernel));
        }
        assert_eq!(Kernel::from_name("rbf"), None);
    }
}
