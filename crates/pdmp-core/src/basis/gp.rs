//! Gaussian process regression, with hyperparameters by marginal likelihood.

use std::f64::consts::TAU;

use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use ndarray::{Array2, ArrayView2};

use super::kernel::{Covariance, Kernel};
use super::search::{Axis, maximise};
use super::{Domain, Regression, magnitude};
use crate::error::{Error, Result, check_positive};

/// Smallest ratio of noise to signal variance: below, rounding makes the covariance matrix indefinite.
const LEAST_NOISE: f64 = 1e-10;
/// Largest ratio that the search considers: a thousandth of the signal's deviation.
///
/// What the landscape takes for noise, no style brings back, and noise on the demonstrations is what smoothing is for.
/// With ratios up to 1 the likelihood took the impact in recorded walking forces for noise, and with it half of the
/// signal: reproductions were off by 23 % of the range, against 6 % with three styles and 3 % with all below 1e-4.
/// Handwriting is met to 1e-4 at worst below 1e-6.
const MOST_NOISE: f64 = 1e-6;
/// Largest ratio that a failing factorisation is helped with.
const MOST_HELP: f64 = 1.0;
/// Samples that the search for hyperparameters looks at; the fit itself uses all.
const SEARCH_SAMPLES: usize = 400;
/// Most samples: their covariance matrix is dense.
const MOST_SAMPLES: usize = 10_000;
/// Points whose covariances with the samples are held in memory at once.
const CHUNK: usize = 256;

/// Gaussian process regression.
///
/// The P outputs are independent Gaussian processes of mean zero over the clock with one covariance σ²K,
/// K = k(u, u′; ℓ) + νI. The signal variance has the maximum-likelihood value σ̂² = Σ fᵀK⁻¹f/(CP). Length ℓ and noise
/// ratio ν, where not given, maximise the log marginal likelihood with that value put in, −CP/2·ln σ̂² − P/2·ln|K|,
/// over ν from 1e-10 to 1e-6 and ℓ from the distance of the samples to twice the extent of the clock.
///
/// The variance is shared because basis targets share their noise: S has orthonormal columns, so equal noise on the
/// demonstrations is equal noise on every row of ΣVᵀ, strong or weak. With a variance each, the weak factors of real
/// recordings, which are mostly noise, would choose the hyperparameters of the strong ones.
///
/// The factorisation costs O(C³) and is shared by all outputs. The search runs it up to some two hundred times, on at
/// most 400 samples, evenly thinned.
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Sections 2.2 and 5.4.1,
/// <https://gaussianprocess.org/gpml>.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gp {
    /// The covariance function.
    pub kernel: Kernel,
    /// Length scale ℓ in units of u, from 1e-6 to 1e6 times the extent of the clock.
    pub length: Option<f64>,
    /// Ratio ν of noise to signal variance, from 1e-10 to 1e6.
    pub noise: Option<f64>,
}

impl Gp {
    /// A process with the given kernel, and hyperparameters where they are not to be found.
    ///
    /// # Errors
    /// A length that is not positive, or noise outside [1e-10, 1e6].
    pub fn new(kernel: Kernel, length: Option<f64>, noise: Option<f64>) -> Result<Self> {
        length.map_or(Ok(()), |length| check_positive("length", length))?;
        check_noise(noise)?;
        Ok(Self { kernel, length, noise })
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must increase.
    ///
    /// `proceed` is asked before each evaluation of the likelihood, with the share done in [0, 1].
    ///
    /// If rounding makes K indefinite, ν is raised tenfold, up to 1 at most; [`GpPosterior::noise`] is what was used.
    ///
    /// # Errors
    /// Hyperparameters out of range, arrays that do not match, numbers that are not finite; a covariance matrix that
    /// stays indefinite; whatever `proceed` returns.
    pub fn regress(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<GpPosterior> {
        super::check(domain, u, targets)?;
        self.check(domain)?;
        if u.len() > MOST_SAMPLES {
            let allowed = "the Gaussian process takes at most 10000; pass a smaller n_samples, or basis=\"ngnet\"";
            return Err(Error::Range { name: "samples", value: u.len() as f64, allowed });
        }
        let (length, mut noise) = self.hyperparameters(domain, u, targets, proceed)?;
        let covariance = Covariance::new(self.kernel, domain, length);
        let samples = Samples::new(u, targets, 1);
        proceed(0.9)?;
        let fit = loop {
            match samples.fit(&covariance, noise) {
                Some(fit) => break fit,
                None if noise < MOST_HELP => noise = (10.0 * noise).min(MOST_HELP),
                None => {
                    let kernel = self.kernel;
                    return Err(Error::Fit(format!(
                        "the {kernel} covariance matrix of length {length} and noise {noise:e} is not positive \
                         definite: give a shorter length or more noise"
                    )));
                }
            }
        };
        proceed(1.0)?;

        let (n_samples, n_outputs) = targets.dim();
        let unscaled = fit.factor.solve(&samples.outputs);
        let weights = Array2::from_shape_fn((n_samples, n_outputs), |(i, o)| unscaled[(i, o)] * samples.scale);
        let deviation = fit.variance().sqrt() * samples.scale;
        // What the search may leave out: that the densities are per unit of the outputs.
        let constant = if deviation > 0.0 { (TAU.sqrt() * samples.scale).ln() + 0.5 } else { 0.0 };
        let log_likelihood = fit.profile() - targets.len() as f64 * constant;
        let (kernel, u, factor) = (self.kernel, samples.u, fit.factor);
        Ok(GpPosterior { kernel, covariance, length, noise, u, factor, weights, deviation, log_likelihood })
    }

    fn check(&self, domain: Domain) -> Result<()> {
        if let Some(value) = self.length
            && !(1e-6..=1e6).contains(&(value / domain.extent()))
        {
            let allowed = "must lie between 1e-6 and 1e6 times the extent of the clock";
            return Err(Error::Range { name: "length", value, allowed });
        }
        check_noise(self.noise)
    }

    /// Length and noise: what is given, and for the rest what makes the targets most likely.
    fn hyperparameters(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<(f64, f64)> {
        let samples = Samples::new(u, targets, u.len().div_ceil(SEARCH_SAMPLES));
        let extent = domain.extent();
        let lengths = (extent / samples.u.len() as f64, 2.0 * extent);
        if samples.are_zero() {
            // Nothing to learn, and nothing to learn from.
            return Ok((self.length.unwrap_or((lengths.0 * lengths.1).sqrt()), self.noise.unwrap_or(LEAST_NOISE)));
        }
        // The free ones among (ln ℓ, ln ν).
        let axis = |(low, high): (f64, f64), points| Axis { low: low.ln(), high: high.ln(), points };
        let mut axes = Vec::new();
        if self.length.is_none() {
            axes.push(axis(lengths, 10));
        }
        if self.noise.is_none() {
            axes.push(axis((LEAST_NOISE, MOST_NOISE), 12));
        }
        let unpack = |free: &[f64]| {
            let mut free = free.iter().map(|x| x.exp());
            let length = self.length.or_else(|| free.next());
            let noise = self.noise.or_else(|| free.next());
            (length.unwrap_or(extent), noise.unwrap_or(LEAST_NOISE).max(LEAST_NOISE))
        };
        if axes.is_empty() {
            return Ok(unpack(&[]));
        }
        let mut left = 1.0;
        let best = maximise(&axes, |free| {
            // How many evaluations there will be is open, but rarely more than 200.
            proceed(0.9 * (1.0 - left))?;
            left *= 0.985;
            let (length, noise) = unpack(free);
            let fit = samples.fit(&Covariance::new(self.kernel, domain, length), noise);
            Ok(fit.map_or(f64::NEG_INFINITY, |fit| fit.profile()))
        })?;
        Ok(unpack(&best))
    }
}

/// What is regressed, divided by its largest magnitude.
struct Samples {
    u: Vec<f64>,
    scale: f64,
    /// (C, outputs).
    outputs: Mat<f64>,
}

impl Samples {
    /// Every `step`-th sample.
    fn new(u: &[f64], targets: ArrayView2<f64>, step: usize) -> Self {
        let targets = targets.slice(ndarray::s![..;step, ..]);
        let scale = magnitude(targets);
        let outputs = Mat::from_fn(targets.nrows(), targets.ncols(), |i, o| targets[[i, o]] / scale);
        Self { u: u.iter().copied().step_by(step).collect(), scale, outputs }
    }

    fn are_zero(&self) -> bool {
        self.outputs.col_iter().all(|column| column.iter().all(|&value| value == 0.0))
    }

    /// Factorises K = LLᵀ and whitens the outputs; nothing if K is not positive definite.
    fn fit(&self, covariance: &Covariance, noise: f64) -> Option<Fit> {
        let n_samples = self.u.len();
        let mut k = Mat::zeros(n_samples, n_samples);
        for j in 0..n_samples {
            k[(j, j)] = 1.0 + noise;
            for i in j + 1..n_samples {
                k[(i, j)] = covariance.at(self.u[i] - self.u[j]).0;
            }
        }
        let factor = k.llt(Side::Lower).ok()?;
        let mut whitened = self.outputs.clone();
        factor.L().solve_lower_triangular_in_place(&mut whitened);
        Some(Fit { factor, whitened })
    }
}

/// The samples under one choice of hyperparameters.
struct Fit {
    /// K = LLᵀ.
    factor: Llt<f64>,
    /// L⁻¹f, (C, outputs).
    whitened: Mat<f64>,
}

impl Fit {
    /// σ̂² = Σ fᵀK⁻¹f/(CP).
    fn variance(&self) -> f64 {
        let n_values = (self.whitened.nrows() * self.whitened.ncols()) as f64;
        self.whitened.squared_norm_l2() / n_values.max(1.0)
    }

    /// −CP/2·ln σ̂² − P/2·ln|K|; nothing is said by outputs that are all zero.
    fn profile(&self) -> f64 {
        let (n_samples, n_outputs) = self.whitened.shape();
        let variance = self.variance();
        if variance == 0.0 {
            return 0.0;
        }
        let half_log_determinant: f64 = (0..n_samples).map(|i| self.factor.L()[(i, i)].ln()).sum();
        -(n_outputs as f64) * (0.5 * n_samples as f64 * variance.ln() + half_log_determinant)
    }
}

/// A Gaussian process given its samples.
#[derive(Clone, Debug)]
pub struct GpPosterior {
    kernel: Kernel,
    covariance: Covariance,
    length: f64,
    noise: f64,
    /// Clock of the samples (C,).
    u: Vec<f64>,
    /// K = LLᵀ.
    factor: Llt<f64>,
    /// K⁻¹f, (C, outputs).
    weights: Array2<f64>,
    /// σ̂, in the unit of the outputs.
    deviation: f64,
    log_likelihood: f64,
}

impl GpPosterior {
    /// Length scale ℓ in units of u.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Ratio ν of noise to signal variance.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// ln p(f | u, ℓ, ν, σ̂²), summed over the outputs; 0 where all are zero.
    pub fn log_likelihood(&self) -> f64 {
        self.log_likelihood
    }

    /// Mean and variance of the noise-free outputs at `u` (n,), each (n, outputs): kᵀK⁻¹f and σ̂²(1 − kᵀK⁻¹k),
    /// the same for every output.
    pub fn predict(&self, u: &[f64]) -> (Array2<f64>, Array2<f64>) {
        let shape = (u.len(), self.weights.ncols());
        let (mut mean, mut variance) = (Array2::zeros(shape), Array2::zeros(shape));
        for (chunk, points) in u.chunks(CHUNK).enumerate() {
            let k = Mat::from_fn(self.u.len(), points.len(), |i, j| self.covariance.at(points[j] - self.u[i]).0);
            let mut whitened = k.clone();
            self.factor.L().solve_lower_triangular_in_place(&mut whitened);
            for j in 0..points.len() {
                let row = chunk * CHUNK + j;
                for (i, weights) in self.weights.rows().into_iter().enumerate() {
                    mean.row_mut(row).scaled_add(k[(i, j)], &weights);
                }
                // Rounding may take a variance of nearly zero below it.
                let share = (1.0 - whitened.col(j).squared_norm_l2()).max(0.0);
                variance.row_mut(row).fill(self.deviation * share * self.deviation);
            }
        }
        (mean, variance)
    }
}

impl Regression for GpPosterior {
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]) {
        value.fill(0.0);
        slope.fill(0.0);
        for (sample, weights) in self.u.iter().zip(self.weights.rows()) {
            let (k, dk) = self.covariance.at(u - sample);
            for ((value, slope), weight) in value.iter_mut().zip(slope.iter_mut()).zip(weights) {
                *value += k * weight;
                *slope += dk * weight;
            }
        }
    }

    fn describe(&self) -> String {
        let (length, noise) = (significant(self.length), significant(self.noise));
        format!("Gaussian process, {}, length {length}, noise {noise:e}", self.kernel)
    }
}

/// Rounded to three significant digits, for printing.
fn significant(x: f64) -> f64 {
    let unit = 10f64.powi(2 - x.log10().floor() as i32);
    (x * unit).round() / unit
}

fn check_noise(noise: Option<f64>) -> Result<()> {
    match noise {
        Some(value) if !(LEAST_NOISE..=1e6).contains(&value) => {
            Err(Error::Range { name: "noise", value, allowed: "must lie between 1e-10 and 1e6" })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    const INTERVAL: Domain = Domain::Interval { end: 1.0 };

    fn grid(domain: Domain, n_samples: usize) -> Vec<f64> {
        let gaps = if domain == Domain::Circle { n_samples } else { n_samples - 1 };
        (0..n_samples).map(|i| domain.extent() * i as f64 / gaps as f64).collect()
    }

    fn fit(gp: &Gp, domain: Domain, u: &[f64], targets: &Array2<f64>) -> GpPosterior {
        gp.regress(domain, u, targets.view(), &mut |_| Ok(())).unwrap()
    }

    fn at(posterior: &GpPosterior, u: f64) -> (Vec<f64>, Vec<f64>) {
        let empty = vec![f64::NAN; posterior.weights.ncols()];
        let mut both = (empty.clone(), empty);
        posterior.evaluate(u, &mut both.0, &mut both.1);
        both
    }

    /// Two smooth outputs that close on the circle.
    fn waves(domain: Domain, u: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((u.len(), 2), |(i, o)| {
            let phase = TAU * u[i] / domain.extent();
            if o == 0 { (phase + 0.4).sin().exp() } else { (2.0 * phase).cos() }
        })
    }

    /// Independent normal numbers, the same at every call: Box and Muller on a linear congruential generator.
    fn normal(rows: usize, columns: usize) -> Array2<f64> {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        Array2::from_shape_simple_fn((rows, columns), || (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos())
    }

    fn covariances(kernel: Kernel, domain: Domain, length: f64, a: &[f64], b: &[f64]) -> DMatrix<f64> {
        let covariance = Covariance::new(kernel, domain, length);
        DMatrix::from_fn(a.len(), b.len(), |i, j| covariance.at(a[i] - b[j]).0)
    }

    proptest! {
        #[test]
        fn mean_variance_and_likelihood_are_those_of_the_joint_normal_density(
            kernel in prop::sample::select(&Kernel::ALL[..]), length in 0.05..0.5, noise in -3.0..0.0, circle: bool,
            gaps in prop::collection::vec(0.05..1.0, 16),
            values in prop::collection::vec(-1.0..1.0, 30),
        ) {
            // 15 samples, not at equal distances.
            let domain = if circle { Domain::Circle } else { INTERVAL };
            let (length, noise) = (length * domain.extent(), 10f64.powf(noise));
            let total: f64 = gaps.iter().sum();
            let mut reached = 0.0;
            let step = |gap: &f64| { reached += gap; domain.extent() * reached / total };
            let u: Vec<f64> = gaps[..15].iter().map(step).collect();
            let targets = Array2::from_shape_vec((15, 2), values).unwrap();
            let posterior = fit(&Gp { kernel, length: Some(length), noise: Some(noise) }, domain, &u, &targets);
            let query = [-0.1, 0.0, 0.31, 0.5, 0.9, 1.05].map(|q| q * domain.extent());
            let (mean, variance) = posterior.predict(&query);

            let k = covariances(kernel, domain, length, &u, &u) + DMatrix::identity(15, 15) * noise;
            let inverse = k.clone().lu().try_inverse().unwrap();
            let cross = covariances(kernel, domain, length, &query, &u);
            let share = DMatrix::identity(6, 6) - &cross * &inverse * cross.transpose();
            let all = DMatrix::from_fn(15, 2, |i, o| targets[[i, o]]);
            let signal = (all.transpose() * &inverse * &all).trace() / 30.0;
            let mut log_likelihood = 0.0;
            for o in 0..2 {
                let f = DMatrix::from_fn(15, 1, |i, _| targets[[i, o]]);
                let expected = &cross * &inverse * &f;
                let density = &k * (signal * TAU);
                let exponent = (f.transpose() * (&k * signal).lu().try_inverse().unwrap() * &f)[(0, 0)];
                log_likelihood -= 0.5 * (exponent + density.lu().determinant().ln());
                for q in 0..6 {
                    prop_assert!((mean[[q, o]] - expected[(q, 0)]).abs() < 1e-8);
                    prop_assert!((at(&posterior, query[q]).0[o] - expected[(q, 0)]).abs() < 1e-8);
                    prop_assert!((variance[[q, o]] - signal * share[(q, q)]).abs() < 1e-8 * signal.max(1.0));
                }
            }
            prop_assert!((posterior.log_likelihood() - log_likelihood).abs() < 1e-6 * log_likelihood.abs().max(1.0));
        }

        #[test]
        fn the_slope_is_the_derivative(
            kernel in prop::sample::select(&Kernel::ALL[..]), length in 0.1..2.0, u in -0.2..1.2, circle: bool,
        ) {
            let domain = if circle { Domain::Circle } else { INTERVAL };
            let samples = grid(domain, 20);
            let gp = Gp { kernel, length: Some(length), noise: Some(1e-4) };
            let posterior = fit(&gp, domain, &samples, &waves(domain, &samples));
            let (u, h) = (u * domain.extent(), 1e-5);
            for o in 0..2 {
                let difference = (at(&posterior, u + h).0[o] - at(&posterior, u - h).0[o]) / (2.0 * h);
                // Matérn-3/2 has a second derivative that jumps at the samples.
                prop_assert!((at(&posterior, u).1[o] - difference).abs() < 1e-2);
            }
        }

        #[test]
        fn outputs_of_any_magnitude_are_fitted_as_if_scaled(exponent in -290.0..145.0) {
            let u = grid(INTERVAL, 30);
            let plain = waves(INTERVAL, &u);
            let magnitude = 10f64.powf(exponent);
            // Output 2 is zero.
            let scaled = Array2::from_shape_fn((30, 3), |(i, o)| if o < 2 { magnitude * plain[[i, o]] } else { 0.0 });
            let (expected, found) = (fit(&Gp::default(), INTERVAL, &u, &plain), fit(&Gp::default(), INTERVAL, &u, &scaled));
            prop_assert!((found.length() / expected.length()).ln().abs() < 0.01);
            prop_assert!((found.noise() / expected.noise()).ln().abs() < 0.01);
            for u in [-0.1, 0.0, 0.4, 1.0, 1.1] {
                let ((value, slope), (expected, steepness)) = (at(&found, u), at(&expected, u));
                for o in 0..2 {
                    prop_assert!((value[o] / magnitude - expected[o]).abs() < 1e-3);
                    prop_assert!((slope[o] / magnitude - steepness[o]).abs() < 0.1);
                }
                prop_assert_eq!((value[2], slope[2]), (0.0, 0.0));
            }
        }
    }

    /// A weak output of nothing but noise does not make a strong, smooth one be taken for noise.
    #[test]
    fn weak_noise_beside_a_strong_signal_does_not_choose_for_it() {
        let u = grid(INTERVAL, 100);
        let noise = 1e-3 * normal(100, 8);
        let both = ndarray::concatenate![ndarray::Axis(1), waves(INTERVAL, &u), noise];
        let posterior = fit(&Gp::default(), INTERVAL, &u, &both);
        for (i, &at_sample) in u.iter().enumerate() {
            assert_abs_diff_eq!(at(&posterior, at_sample).0[0], both[[i, 0]], epsilon = 1e-2);
        }
        assert!(posterior.noise() < 1e-3, "{}", posterior.noise());
    }

    #[test]
    fn the_length_of_data_from_the_prior_is_recovered() {
        for kernel in Kernel::ALL {
            for domain in [INTERVAL, Domain::Circle] {
                for noise in [1e-3, 0.1] {
                    let (u, length) = (grid(domain, 150), 0.08 * domain.extent());
                    let k = covariances(kernel, domain, length, &u, &u) + DMatrix::identity(150, 150) * noise;
                    let root = k.cholesky().unwrap().l();
                    let white = normal(150, 6);
                    let drawn = root * DMatrix::from_fn(150, 6, |i, o| white[[i, o]]);
                    let targets = Array2::from_shape_fn((150, 6), |(i, o)| drawn[(i, o)]);
                    let posterior = fit(&Gp { kernel, length: None, noise: Some(noise) }, domain, &u, &targets);
                    assert_relative_eq!(posterior.length(), length, max_relative = 0.25);
                }
            }
        }
    }

    #[test]
    fn no_hyperparameters_are_likelier_than_those_found() {
        let u = grid(INTERVAL, 60);
        for noise in [0.0, 1e-3, 0.3, 10.0] {
            let targets = waves(INTERVAL, &u) + noise * normal(60, 2);
            for kernel in Kernel::ALL {
                let found = fit(&Gp { kernel, ..Gp::default() }, INTERVAL, &u, &targets);
                for i in 0..30 {
                    for j in 0..21 {
                        let ratio = (MOST_NOISE * 10f64.powf(-0.2 * j as f64)).max(LEAST_NOISE);
                        let length = 0.017 * 1.17_f64.powi(i);
                        let other = Gp { kernel, length: Some(length), noise: Some(ratio) };
                        let other = fit(&other, INTERVAL, &u, &targets);
                        let gain = other.log_likelihood() - found.log_likelihood();
                        assert!(gain < 0.1, "{kernel}, noise {noise}: {length}, {ratio:e} gains {gain}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_smooth_function_is_met_between_the_samples_with_its_slope() {
        // Relative to the range, and to the range over a radian; a rougher kernel is less sure next to an end.
        for (kernel, tolerance) in [(Kernel::Matern52, 1e-5), (Kernel::SquaredExponential, 1e-6)] {
            for domain in [INTERVAL, Domain::Circle] {
                let u = grid(domain, 200);
                let posterior = fit(&Gp { kernel, ..Gp::default() }, domain, &u, &waves(domain, &u));
                for i in 0..777 {
                    let (radian, h) = (domain.extent() / TAU, 1e-5);
                    let u = domain.extent() * i as f64 / 777.0;
                    let truth = waves(domain, &[u - h, u, u + h]);
                    let (value, slope) = at(&posterior, u);
                    for o in 0..2 {
                        let expected = (truth[[2, o]] - truth[[0, o]]) / (2.0 * h);
                        assert_abs_diff_eq!(value[o], truth[[1, o]], epsilon = 2.0 * tolerance);
                        assert_abs_diff_eq!(slope[o] * radian, expected * radian, epsilon = 400.0 * tolerance);
                    }
                }
            }
        }
    }

    #[test]
    fn the_mean_of_noisy_data_is_nearer_to_the_truth_than_the_data() {
        for domain in [INTERVAL, Domain::Circle] {
            let u = grid(domain, 200);
            let (truth, error) = (waves(domain, &u), 0.05 * normal(200, 2));
            let (mean, variance) = fit(&Gp::default(), domain, &u, &(&truth + &error)).predict(&u);
            let square = |a: &Array2<f64>| a.iter().map(|x| x * x).sum::<f64>();
            let missed = square(&(&mean - &truth));
            assert!(missed < 0.25 * square(&error), "{missed} of {}", square(&error));
            // And the posterior knows how near.
            assert!((0.3..3.0).contains(&(missed / variance.sum())));
        }
    }

    #[test]
    fn the_circle_closes() {
        let u = grid(Domain::Circle, 50);
        let posterior = fit(&Gp::default(), Domain::Circle, &u, &waves(Domain::Circle, &u));
        for u in [0.0, 1.0, 5.0] {
            let (here, there) = (at(&posterior, u), at(&posterior, u + TAU));
            for o in 0..2 {
                assert_abs_diff_eq!(here.0[o], there.0[o], epsilon = 1e-8);
                assert_abs_diff_eq!(here.1[o], there.1[o], epsilon = 1e-6);
            }
        }
    }

    #[test]
    fn nothing_to_learn_is_learnt() {
        for (n_samples, n_outputs) in [(1, 1), (20, 2), (20, 0)] {
            let u: Vec<f64> = (0..n_samples).map(|i| i as f64 / 20.0).collect();
            let posterior = fit(&Gp::default(), INTERVAL, &u, &Array2::zeros((n_samples, n_outputs)));
            assert_eq!(at(&posterior, 0.3), (vec![0.0; n_outputs], vec![0.0; n_outputs]));
            assert!(posterior.predict(&[0.3]).1.iter().all(|&variance| variance == 0.0));
            assert_eq!(posterior.log_likelihood(), 0.0);
        }
    }

    #[test]
    fn few_samples_are_interpolated() {
        for n_samples in [1, 2, 4] {
            let u: Vec<f64> = (0..n_samples).map(|i| i as f64 / 4.0).collect();
            let targets = waves(INTERVAL, &u);
            let posterior = fit(&Gp { noise: Some(1e-8), ..Gp::default() }, INTERVAL, &u, &targets);
            for (i, &u) in u.iter().enumerate() {
                assert_abs_diff_eq!(at(&posterior, u).0[0], targets[[i, 0]], epsilon = 1e-5);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_helped_with_noise() {
        // 300 nearly equal rows.
        let u = grid(INTERVAL, 300);
        for kernel in Kernel::ALL {
            let gp = Gp { kernel, length: Some(1e6), noise: Some(LEAST_NOISE) };
            let posterior = fit(&gp, INTERVAL, &u, &waves(INTERVAL, &u));
            assert!(posterior.noise() < 1e-6 && at(&posterior, 0.5).0[0].is_finite());
        }
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let regress = |gp: Gp| gp.regress(INTERVAL, &[0.0], Array2::zeros((1, 1)).view(), &mut |_| Ok(())).unwrap_err();
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
            let length = regress(Gp { length: Some(bad), ..Gp::default() });
            assert!(matches!(length, Error::Range { name: "length", .. }));
            let noise = regress(Gp { noise: Some(bad), ..Gp::default() });
            assert!(matches!(noise, Error::Range { name: "noise", .. }));
        }
    }

    #[test]
    fn the_caller_can_follow_and_stop_the_search() {
        let u = grid(INTERVAL, 20);
        let mut shares = vec![0.0];
        let mut follow = |share| {
            shares.push(share);
            if shares.len() < 50 { Ok(()) } else { Err(Error::Interrupted) }
        };
        let stopped = Gp::default().regress(INTERVAL, &u, waves(INTERVAL, &u).view(), &mut follow);
        assert!(matches!(stopped, Err(Error::Interrupted)));
        assert_eq!(shares.len(), 50);
        assert!(shares.is_sorted() && shares[49] <= 1.0);
    }

    #[test]
    fn it_says_what_was_chosen() {
        let gp = Gp { length: Some(0.123456), noise: Some(1e-10), ..Gp::default() };
        let posterior = fit(&gp, INTERVAL, &[0.0, 0.5], &Array2::ones((2, 1)));
        assert_eq!(posterior.describe(), "Gaussian process, Matérn-5/2, length 0.123, noise 1e-10");
    }
}
