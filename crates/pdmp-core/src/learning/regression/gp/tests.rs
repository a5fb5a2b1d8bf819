use super::posterior::Posterior;
use super::*;
use crate::learning::regression::Regression;
use crate::learning::regression::hyperparameter_search::Score;
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
    let empty = vec![f64::NAN; posterior.n_outputs];
    let mut both = (empty.clone(), empty);
    posterior.evaluate(u, &mut both.0, &mut both.1);
    both
}

/// Returns two smooth outputs that are periodic on the circle.
fn waves(domain: Domain, u: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((u.len(), 2), |(i, o)| {
        let phase = TAU * u[i] / domain.extent();
        if o == 0 { (phase + 0.4).sin().exp() } else { (2.0 * phase).cos() }
    })
}

/// Returns independent normal numbers, equal at every call: Box-Muller on a linear congruential generator.
fn normal(rows: usize, columns: usize) -> Array2<f64> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    Array2::from_shape_simple_fn((rows, columns), || (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos())
}

/// Returns the kernel by the textbook formula.
fn plain(kernel: Kernel, x: f64) -> f64 {
    let x = x.abs();
    match kernel {
        Kernel::Matern32 => (1.0 + 3f64.sqrt() * x) * (-(3f64.sqrt()) * x).exp(),
        Kernel::Matern52 => (1.0 + 5f64.sqrt() * x + 5.0 / 3.0 * x * x) * (-(5f64.sqrt()) * x).exp(),
    }
}

/// Returns its derivative with respect to ln ℓ.
fn plain_by_length(kernel: Kernel, x: f64) -> f64 {
    let x = x.abs();
    match kernel {
        Kernel::Matern32 => 3.0 * x * x * (-(3f64.sqrt()) * x).exp(),
        Kernel::Matern52 => 5.0 / 3.0 * x * x * (1.0 + 5f64.sqrt() * x) * (-(5f64.sqrt()) * x).exp(),
    }
}

/// Returns the kernel and its derivative with respect to ln ℓ; on the circle, of the normalised sum over all images.
fn kernel_at(kernel: Kernel, domain: Domain, length: f64, r: f64) -> (f64, f64) {
    let images = (40.0 * length / TAU) as i32 + 2;
    let sum = |f: fn(Kernel, f64) -> f64, r: f64| {
        (-images..=images).map(|n| f(kernel, (r + TAU * n as f64) / length)).sum::<f64>()
    };
    match domain {
        Domain::Interval { .. } => (plain(kernel, r / length), plain_by_length(kernel, r / length)),
        Domain::Circle => {
            let (r, norm) = (r.rem_euclid(TAU), sum(plain, 0.0));
            let k = sum(plain, r) / norm;
            (k, (sum(plain_by_length, r) - k * sum(plain_by_length, 0.0)) / norm)
        }
    }
}

fn covariances(kernel: Kernel, domain: Domain, length: f64, a: &[f64], b: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(a.len(), b.len(), |i, j| kernel_at(kernel, domain, length, a[i] - b[j]).0)
}

/// Samples at uneven intervals, some of them repeated; on the circle over up to one and a half turns.
#[derive(Clone, Debug)]
struct Problem {
    kernel: Kernel,
    domain: Domain,
    u: Vec<f64>,
    targets: Array2<f64>,
}

fn problems() -> impl Strategy<Value = Problem> {
    let gap = prop_oneof![1 => Just(0.0), 3 => 0.0..1.0];
    let sample = (gap, prop::array::uniform5(-1.0..1.0));
    let samples = prop::collection::vec(sample, 2..15);
    (prop::sample::select(&Kernel::ALL[..]), samples, 1..5_usize, prop::bool::ANY, 0.5..1.5).prop_map(
        |(kernel, samples, n_outputs, circle, stretch)| {
            let domain = if circle { Domain::Circle } else { INTERVAL };
            let total = samples.iter().map(|(gap, _)| gap).sum::<f64>().max(0.1);
            let sample_at = |reached: &mut f64, gap: f64| {
                *reached += gap;
                Some(stretch * domain.extent() * *reached / total)
            };
            let u = samples.iter().map(|(gap, _)| *gap).scan(0.0, sample_at).collect();
            let targets = Array2::from_shape_fn((samples.len(), n_outputs), |(i, o)| samples[i].1[o]);
            Problem { kernel, domain, u, targets }
        },
    )
}

/// Joint normal density, by a dense matrix.
struct Exact {
    inverse: DMatrix<f64>,
    /// K⁻¹f.
    weights: DMatrix<f64>,
    signal: f64,
    log_likelihood: f64,
}

impl Exact {
    fn new(kernel: Kernel, domain: Domain, at: (f64, f64), u: &[f64], targets: &Array2<f64>) -> Self {
        let (n, p) = targets.dim();
        let k = covariances(kernel, domain, at.0, u, u) + DMatrix::identity(n, n) * at.1;
        let factor = k.cholesky().unwrap();
        let f = DMatrix::from_fn(n, p, |i, o| targets[[i, o]]);
        let weights = factor.solve(&f);
        let signal = f.dot(&weights) / (n * p) as f64;
        let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum();
        let log_likelihood = -0.5 * p as f64 * (n as f64 * ((TAU * signal).ln() + 1.0) + log_determinant);
        Self { inverse: factor.inverse(), weights, signal, log_likelihood }
    }
}

fn quietly<T>(work: impl FnOnce(&mut Progress) -> Result<T>) -> T {
    work(&mut Progress { progress: &mut |_| Ok(()), share: 0.0 }).unwrap()
}

fn score(kernel: Kernel, domain: Domain, u: &[f64], targets: &Array2<f64>, at: Hyperparameters) -> Score {
    let samples = Samples::new(u, targets.view());
    let found = quietly(|progress| match kernel {
        Kernel::Matern32 => StateSpace::<2>::new(domain, &samples).gradient(at, progress),
        Kernel::Matern52 => StateSpace::<3>::new(domain, &samples).gradient(at, progress),
    });
    let (profile, slope) = found.unwrap();
    Score { value: profile.value(), gradient: profile.gradient(&slope) }
}

proptest! {
    #[test]
    fn mean_variance_and_likelihood_are_those_of_the_joint_normal_density(
        problem in problems(), length in -1.3..0.7, noise in -6.0..0.0,
    ) {
        let Problem { kernel, domain, u, targets } = problem;
        let (length, noise) = (10f64.powf(length) * domain.extent(), 10f64.powf(noise));
        let posterior = fit(&Gp { kernel, length: Some(length), noise: Some(noise) }, domain, &u, &targets);
        let exact = Exact::new(kernel, domain, (length, noise), &u, &targets);
        prop_assert!((posterior.log_likelihood() - exact.log_likelihood).abs() < 1e-8 * (1.0 + exact.log_likelihood.abs()));
        prop_assert!((posterior.signal_variance() / exact.signal - 1.0).abs() < 1e-8);

        let query: Vec<f64> = [-0.3, 0.0, 0.31, 0.5, 0.9, 1.2].map(|q| q * domain.extent()).into_iter().chain(u.clone()).collect();
        let GpPrediction { mean, variance } = posterior.predict(&query);
        let cross = covariances(kernel, domain, length, &query, &u);
        let (expected, known) = (&cross * &exact.weights, &cross * &exact.inverse * cross.transpose());
        for q in 0..query.len() {
            let share = 1.0 - known[(q, q)];
            prop_assert!((variance[[q, 0]] / exact.signal - share).abs() < 1e-8);
            for o in 0..targets.ncols() {
                prop_assert!((mean[[q, o]] - expected[(q, o)]).abs() < 1e-8);
                prop_assert_eq!(mean[[q, o]], at(&posterior, query[q]).0[o]);
                prop_assert_eq!(variance[[q, o]], variance[[q, 0]]);
            }
        }
    }

    #[test]
    fn the_gradient_is_that_of_the_joint_normal_density(
        problem in problems(), length in -1.3..0.7, noise in -6.0..0.0,
    ) {
        let Problem { kernel, domain, u, targets } = problem;
        let (length, noise) = (10f64.powf(length) * domain.extent(), 10f64.powf(noise));
        let found = score(kernel, domain, &u, &targets, Hyperparameters { length, noise });
        let exact = Exact::new(kernel, domain, (length, noise), &u, &targets);
        let by_length = DMatrix::from_fn(u.len(), u.len(), |i, j| kernel_at(kernel, domain, length, u[i] - u[j]).1);
        let by_noise = DMatrix::identity(u.len(), u.len()) * noise;
        for (derivative, found) in [by_length, by_noise].into_iter().zip(found.gradient) {
            let data_fit = (exact.weights.transpose() * &derivative * &exact.weights).trace() / exact.signal;
            let complexity = targets.ncols() as f64 * (&exact.inverse * &derivative).trace();
            let expected = 0.5 * (data_fit - complexity);
            prop_assert!((found - expected).abs() < 1e-6 * (1.0 + data_fit.abs() + complexity.abs()), "{found} is not {expected}");
        }
        // And of the likelihood function.
        let profile = |d: f64, e: f64| {
            let at = Hyperparameters { length: length * d.exp(), noise: noise * e.exp() };
            score(kernel, domain, &u, &targets, at).value
        };
        let h = 1e-4;
        let difference = [profile(h, 0.0) - profile(-h, 0.0), profile(0.0, h) - profile(0.0, -h)].map(|d| d / (2.0 * h));
        for (difference, found) in difference.into_iter().zip(found.gradient) {
            prop_assert!((found - difference).abs() < 1e-4 * (1.0 + found.abs()), "{found} is not {difference}");
        }
    }

    #[test]
    fn the_steady_state_equals_the_full_recursion(
        length in -2.0..1.0, noise in -10.0..0.0, n_samples in 2..400_usize, circle: bool,
    ) {
        let domain = if circle { Domain::Circle } else { INTERVAL };
        let u = grid(domain, n_samples);
        let samples = Samples::new(&u, waves(domain, &u).view());
        let hyperparameters = Hyperparameters { length: 10f64.powf(length) * domain.extent(), noise: 10f64.powf(noise) };
        let even = StateSpace::<3>::new(domain, &samples);
        let mut uneven = StateSpace::<3>::new(domain, &samples);
        uneven.forget_evenness();
        let score = |process: &StateSpace<3>| {
            let (profile, slope) = quietly(|progress| process.gradient(hyperparameters, progress)).unwrap();
            Score { value: profile.value(), gradient: profile.gradient(&slope) }
        };
        let variances = |process: &StateSpace<3>| {
            let (_, found) = quietly(|progress| process.fit(hyperparameters, progress)).unwrap();
            (0..40).map(|k| found.variance(domain.extent() * (f64::from(k) + 0.37) / 40.0)).collect::<Vec<f64>>()
        };
        for (a, b) in variances(&even).into_iter().zip(variances(&uneven)) {
            prop_assert!((a - b).abs() < 1e-9, "variance {a} is not {b}");
        }
        let (even, uneven) = (score(&even), score(&uneven));
        let close = |a: f64, b: f64| (a - b).abs() < 1e-7 * (n_samples as f64 + a.abs());
        prop_assert!(close(even.value, uneven.value), "{} is not {}", even.value, uneven.value);
        for k in 0..2 {
            prop_assert!(close(even.gradient[k], uneven.gradient[k]), "{even:?} {uneven:?}");
        }
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

/// Weak outputs of pure noise do not increase the noise of a strong, smooth output.
#[test]
fn weak_noise_does_not_determine_the_noise_of_a_strong_signal() {
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
fn no_hyperparameters_on_a_grid_are_likelier_than_the_estimates() {
    let u = grid(INTERVAL, 60);
    for noise in [0.0, 1e-3, 0.3, 10.0] {
        let targets = waves(INTERVAL, &u) + noise * normal(60, 2);
        for kernel in Kernel::ALL {
            let gp = Gp { kernel, ..Gp::default() };
            for within in [NoiseBound::NONE, NoiseBound::LANDSCAPE] {
                let found = gp.regress_within(within, INTERVAL, &u, targets.view(), &mut |_| Ok(())).unwrap();
                let mean_square = targets.iter().map(|f| f * f).sum::<f64>() / 120.0;
                let most = within.share.map_or(f64::INFINITY, |share| share * mean_square);
                assert!(found.noise() * found.signal_variance() < 1.06 * most);
                assert!((MIN_NOISE..=within.ratio).contains(&found.noise()));
                for i in 0..30 {
                    for j in 0..21 {
                        let ratio = within.ratio * (MIN_NOISE / within.ratio).powf(f64::from(j) / 20.0);
                        let length = 0.017 * 1.17_f64.powi(i);
                        let other = Gp { kernel, length: Some(length), noise: Some(ratio.max(MIN_NOISE)) };
                        let other = fit(&other, INTERVAL, &u, &targets);
                        let gain = other.log_likelihood() - found.log_likelihood();
                        assert!(
                            gain < 0.1 || other.noise() * other.signal_variance() > most,
                            "{kernel}, noise {noise}, {within:?}: {length}, {ratio:e} gains {gain}"
                        );
                    }
                }
            }
        }
    }
}

/// A regression without a bound estimates the noise of its targets; in a landscape the noise is bounded.
#[test]
fn noise_is_estimated_and_bounded_in_a_landscape() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 400);
        for deviation in [1e-3, 0.03, 0.3] {
            let targets = waves(domain, &u) + deviation * normal(400, 2);
            for kernel in Kernel::ALL {
                let gp = Gp { kernel, ..Gp::default() };
                let found = fit(&gp, domain, &u, &targets);
                let noise = (found.noise() * found.signal_variance()).sqrt();
                assert_relative_eq!(noise, deviation, max_relative = 0.15);
                let worst =
                    (0..400).map(|i| (at(&found, u[i]).0[0] - waves(domain, &u)[[i, 0]]).abs()).fold(0.0, f64::max);
                assert!(worst < 2.0 * deviation, "{kernel}: off by {worst}, noise {deviation}");
            }
            let targets = targets.view();
            let landscape = Gp::default().regress_within(NoiseBound::LANDSCAPE, domain, &u, targets, &mut |_| Ok(()));
            assert!(landscape.unwrap().noise() <= 1e-6);
        }
    }
}

#[test]
fn a_smooth_function_and_its_slope_are_interpolated() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 200);
        let posterior = fit(&Gp::default(), domain, &u, &waves(domain, &u));
        for i in 0..777 {
            let (radian, h) = (domain.extent() / TAU, 1e-5);
            let u = domain.extent() * i as f64 / 777.0;
            let truth = waves(domain, &[u - h, u, u + h]);
            let (value, slope) = at(&posterior, u);
            for o in 0..2 {
                let expected = (truth[[2, o]] - truth[[0, o]]) / (2.0 * h);
                assert_abs_diff_eq!(value[o], truth[[1, o]], epsilon = 2e-5);
                assert_abs_diff_eq!(slope[o] * radian, expected * radian, epsilon = 4e-3);
            }
        }
    }
}

#[test]
fn the_mean_of_noisy_data_is_closer_to_the_truth_than_the_data() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 200);
        let (truth, error) = (waves(domain, &u), 0.05 * normal(200, 2));
        let gp = Gp { noise: Some(1e-3), ..Gp::default() };
        let GpPrediction { mean, variance } = fit(&gp, domain, &u, &(&truth + &error)).predict(&u);
        let square = |a: &Array2<f64>| a.iter().map(|x| x * x).sum::<f64>();
        let missed = square(&(&mean - &truth));
        assert!(missed < 0.25 * square(&error), "{missed} of {}", square(&error));
        // And its variance states the error.
        assert!((0.3..3.0).contains(&(missed / variance.sum())));
    }
}

#[test]
fn processes_on_the_circle_are_periodic() {
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
fn zero_targets_are_fitted() {
    for (n_samples, n_outputs) in [(1, 1), (20, 2), (20, 0)] {
        let u: Vec<f64> = (0..n_samples).map(|i| i as f64 / 20.0).collect();
        let posterior = fit(&Gp::default(), INTERVAL, &u, &Array2::zeros((n_samples, n_outputs)));
        assert_eq!(at(&posterior, 0.3), (vec![0.0; n_outputs], vec![0.0; n_outputs]));
        assert!(posterior.predict(&[0.3]).variance.iter().all(|&variance| variance == 0.0));
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
fn an_indefinite_matrix_is_regularised_with_noise() {
    // A covariance matrix of 300 nearly equal rows.
    let u = grid(INTERVAL, 300);
    for kernel in Kernel::ALL {
        let gp = Gp { kernel, length: Some(1e6), noise: Some(MIN_NOISE) };
        let posterior = fit(&gp, INTERVAL, &u, &waves(INTERVAL, &u));
        assert!(posterior.noise() < 1e-6 && at(&posterior, 0.5).0[0].is_finite());
    }
}

/// Lengths from far below the sampling interval to far beyond the extent give finite results.
#[test]
fn extreme_lengths_and_noises_give_finite_results() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 200);
        let targets = waves(domain, &u);
        for kernel in Kernel::ALL {
            for exponent in -6..=6 {
                for noise in [1e-10, 1e-6, 1.0, 1e6] {
                    let length = 10f64.powi(exponent)
                        * domain.extent()
                        * if exponent.abs() == 6 { 0.999999_f64.powi(exponent.signum()) } else { 1.0 };
                    let gp = Gp { kernel, length: Some(length), noise: Some(noise) };
                    let posterior = fit(&gp, domain, &u, &targets);
                    assert!(posterior.log_likelihood().is_finite());
                    let GpPrediction { mean, variance } = posterior.predict(&[-1.0, 0.0, 0.3, 0.5, 1.0, 7.0]);
                    assert!(mean.iter().all(|value| value.is_finite()));
                    let inside = mean.slice(ndarray::s![1..5, ..]).fold(0.0_f64, |most, value| most.max(value.abs()));
                    assert!(inside < 3.0, "{kernel} {domain:?} {length} {noise:e}: {inside}");
                    assert!(variance.iter().all(|v| *v >= 0.0 && *v <= 1.001 * posterior.signal_variance()));
                    let (_, slope) = at(&posterior, 0.3);
                    assert!(slope.iter().all(|slope| slope.is_finite()));
                }
            }
        }
    }
}

/// A constant kernel returns the mean of the samples, shrunk towards zero by the noise.
#[test]
fn very_long_lengths_on_the_circle_return_the_mean() {
    let u = grid(Domain::Circle, 100);
    let targets = waves(Domain::Circle, &u);
    let mean = targets.column(0).mean().unwrap();
    for kernel in Kernel::ALL {
        for turns in [1e3, 1e4, 1e5] {
            let gp = Gp { kernel, length: Some(turns * TAU), noise: Some(1e-3) };
            let posterior = fit(&gp, Domain::Circle, &u, &targets);
            for u in [0.0, 1.0, 6.0] {
                assert_relative_eq!(at(&posterior, u).0[0], mean / (1.0 + 1e-5), max_relative = 1e-6);
            }
        }
    }
}

#[test]
fn many_samples_of_minimal_noise_are_interpolated() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 5000);
        let targets = waves(domain, &u);
        for kernel in Kernel::ALL {
            for length in [0.01, 0.2, 2.0] {
                let gp = Gp { kernel, length: Some(length * domain.extent()), noise: Some(1e-10) };
                let GpPrediction { mean, variance } = fit(&gp, domain, &u, &targets).predict(&u);
                let error = (mean - &targets).iter().fold(0.0_f64, |most, error| most.max(error.abs()));
                // Near an end a long length deflects the mean as far as the noise admits.
                assert!(error < 1e-4, "{kernel} {domain:?} {length}: {error:e}");
                assert!(variance.iter().all(|variance| variance.is_finite()));
            }
        }
    }
}

/// A dense covariance matrix would take 80 GB.
#[test]
fn a_hundred_thousand_samples_are_fitted() {
    for domain in [INTERVAL, Domain::Circle] {
        let u = grid(domain, 100_000);
        let targets = waves(domain, &u);
        let posterior = fit(&Gp::default(), domain, &u, &targets);
        for i in (0..u.len()).step_by(997) {
            assert_abs_diff_eq!(at(&posterior, u[i]).0[0], targets[[i, 0]], epsilon = 1e-3);
        }
    }
}

/// Repeated samples are averaged.
#[test]
fn repeated_samples_equal_their_mean_with_less_noise() {
    let u = grid(INTERVAL, 30);
    let (targets, error) = (waves(INTERVAL, &u), normal(30, 2));
    let twice: Vec<f64> = u.iter().flat_map(|&u| [u, u]).collect();
    let both = Array2::from_shape_fn((60, 2), |(i, o)| {
        targets[[i / 2, o]] + if i % 2 == 0 { error[[i / 2, o]] } else { -error[[i / 2, o]] }
    });
    for kernel in Kernel::ALL {
        let gp = |noise| Gp { kernel, length: Some(0.3), noise: Some(noise) };
        let (once, twice) = (fit(&gp(0.01), INTERVAL, &u, &targets), fit(&gp(0.02), INTERVAL, &twice, &both));
        for u in [-0.1, 0.0, 0.4, 1.0] {
            for o in 0..2 {
                assert_abs_diff_eq!(at(&once, u).0[o], at(&twice, u).0[o], epsilon = 1e-9);
            }
        }
    }
}

#[test]
fn a_constant_likelihood_yields_valid_hyperparameters() {
    // One sample has the same likelihood at every length.
    for kernel in Kernel::ALL {
        for domain in [INTERVAL, Domain::Circle] {
            let posterior = fit(&Gp { kernel, ..Gp::default() }, domain, &[0.0], &Array2::ones((1, 1)));
            assert!(posterior.length() > 0.0 && posterior.noise() >= MIN_NOISE);
            assert_abs_diff_eq!(at(&posterior, 0.0).0[0], 1.0, epsilon = 1e-5);
        }
    }
}

/// A single evaluation of the likelihood of many samples can be cancelled.
#[test]
fn progress_is_reported_every_few_thousand_samples() {
    for kernel in Kernel::ALL {
        for domain in [INTERVAL, Domain::Circle] {
            let u = grid(domain, 100_000);
            let mut reports = 0;
            let mut stop = |_| {
                reports += 1;
                if reports > 3 { Err(Error::Interrupted) } else { Ok(()) }
            };
            let gp = Gp { kernel, length: Some(0.1), noise: Some(1e-6) };
            let stopped = gp.regress(domain, &u, waves(domain, &u).view(), &mut stop);
            assert!(matches!(stopped, Err(Error::Interrupted)));
        }
    }
}

#[test]
fn settings_out_of_range_are_rejected() {
    let regress = |gp: Gp| gp.regress(INTERVAL, &[0.0], Array2::zeros((1, 1)).view(), &mut |_| Ok(())).unwrap_err();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
        let length = regress(Gp { length: Some(bad), ..Gp::default() });
        assert!(matches!(length, Error::Range { name: "length", .. }));
        let noise = regress(Gp { noise: Some(bad), ..Gp::default() });
        assert!(matches!(noise, Error::Range { name: "noise", .. }));
    }
}

#[test]
fn the_search_reports_progress_and_can_be_cancelled() {
    let u = grid(INTERVAL, 20);
    let mut shares = vec![0.0];
    let mut follow = |share| {
        shares.push(share);
        if shares.len() < 40 { Ok(()) } else { Err(Error::Interrupted) }
    };
    let stopped = Gp::default().regress(INTERVAL, &u, waves(INTERVAL, &u).view(), &mut follow);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert_eq!(shares.len(), 40);
    assert!(shares.is_sorted() && shares[39] <= 1.0);
}

#[test]
fn the_description_states_the_hyperparameters() {
    let gp = Gp { length: Some(0.123456), noise: Some(1e-10), ..Gp::default() };
    let posterior = fit(&gp, INTERVAL, &[0.0, 0.5], &Array2::ones((2, 1)));
    assert_eq!(posterior.describe(), "Gaussian process, Matérn-5/2, length 0.123, noise 1e-10");
}
