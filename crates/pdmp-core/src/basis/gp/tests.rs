use super::*;
use crate::basis::Regression;
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

/// The textbook formula.
fn plain(kernel: Kernel, x: f64) -> f64 {
    let x = x.abs();
    match kernel {
        Kernel::Matern32 => (1.0 + 3f64.sqrt() * x) * (-(3f64.sqrt()) * x).exp(),
        Kernel::Matern52 => (1.0 + 5f64.sqrt() * x + 5.0 / 3.0 * x * x) * (-(5f64.sqrt()) * x).exp(),
        Kernel::SquaredExponential => (-x * x / 2.0).exp(),
    }
}

/// On the circle the sum over all images.
fn covariance(kernel: Kernel, domain: Domain, length: f64, r: f64) -> f64 {
    let images = (40.0 * length / TAU) as i32 + 2;
    let sum = |r: f64| (-images..=images).map(|n| plain(kernel, (r + TAU * n as f64) / length)).sum::<f64>();
    if domain == Domain::Circle { sum(r.rem_euclid(TAU)) / sum(0.0) } else { plain(kernel, r / length) }
}

fn covariances(kernel: Kernel, domain: Domain, length: f64, a: &[f64], b: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(a.len(), b.len(), |i, j| covariance(kernel, domain, length, a[i] - b[j]))
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
        if shares.len() < 40 { Ok(()) } else { Err(Error::Interrupted) }
    };
    let stopped = Gp::default().regress(INTERVAL, &u, waves(INTERVAL, &u).view(), &mut follow);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert_eq!(shares.len(), 40);
    assert!(shares.is_sorted() && shares[39] <= 1.0);
}

#[test]
fn it_says_what_was_chosen() {
    let gp = Gp { length: Some(0.123456), noise: Some(1e-10), ..Gp::default() };
    let posterior = fit(&gp, INTERVAL, &[0.0, 0.5], &Array2::ones((2, 1)));
    assert_eq!(posterior.describe(), "Gaussian process, Matérn-5/2, length 0.123, noise 1e-10");
}
