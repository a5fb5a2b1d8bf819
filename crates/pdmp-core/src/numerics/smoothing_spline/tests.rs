use super::cross_validation::{Decimated, Scores};
use super::*;
use approx::{assert_abs_diff_eq, assert_relative_eq};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Returns a generator of standard normal numbers: the Box–Muller transform of a linear congruential generator.
pub(super) fn noise(mut state: u64) -> impl FnMut() -> f64 {
    let mut uniform = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    move || (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos()
}

pub(super) fn minimum_jerk(s: f64) -> f64 {
    s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
}

pub(super) fn uniform(n: usize, step: f64) -> Vec<f64> {
    (0..n).map(|i| i as f64 * step).collect()
}

/// Returns times with steps between half and three halves of `step`.
pub(super) fn irregular(n: usize, step: f64) -> Vec<f64> {
    let mut normal = noise(11);
    (0..n).map(|i| (i as f64 + 0.25 * normal().clamp(-1.0, 1.0)) * step).collect()
}

fn smooth_column(smoothing: Smoothing, time: &[f64], period: Option<f64>, y: &[f64]) -> Vec<f64> {
    let values = Array2::from_shape_fn((y.len(), 1), |(i, _)| y[i]);
    smooth(smoothing, time, period, values.view(), &[]).unwrap().into_raw_vec_and_offset().0
}

/// Computes the root mean square difference.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Computes the gain of a cosine of `hz`, sampled at 100 Hz for 20 s, between 5 and 15 s.
fn gain(hz: f64, cut_off: f64) -> f64 {
    let time = uniform(2001, 0.01);
    let sine: Vec<f64> = time.iter().map(|t| (TAU * hz * t).cos()).collect();
    let smoothed = smooth_column(Smoothing::CutOff { hz: cut_off }, &time, None, &sine);
    let product = |a: &[f64]| (500..1500).map(|i| a[i] * sine[i]).sum::<f64>();
    product(&smoothed) / product(&sine)
}

#[test]
fn a_sine_at_the_cut_off_is_halved() {
    for hz in [0.8, 2.0, 10.0, 25.0, 49.0] {
        assert_abs_diff_eq!(gain(hz, hz), 0.5, epsilon = 1e-9);
    }
}

#[test]
fn the_gain_falls_with_the_fourth_power_of_frequency() {
    for ratio in [0.25f64, 0.5, 2.0, 4.0, 8.0] {
        assert_relative_eq!(gain(2.0 * ratio, 2.0), 1.0 / (1.0 + ratio.powi(4)), max_relative = 0.03);
    }
}

#[test]
fn irregular_time_stamps_have_the_gain_of_uniform_ones() {
    let slow = |t: f64| (TAU * t).sin();
    for time in [uniform(1000, 0.01), irregular(1000, 0.01)] {
        let y: Vec<f64> = time.iter().map(|&t| slow(t) + 0.1 * (TAU * 17.0 * t).sin()).collect();
        let smoothed = smooth_column(Smoothing::CutOff { hz: 4.0 }, &time, None, &y);
        let expected: Vec<f64> = time.iter().map(|&t| slow(t) / (1.0 + 0.25f64.powi(4))).collect();
        let error = distance(&smoothed[100..900], &expected[100..900]);
        assert!(error < 1e-2, "{error}");
    }
}

/// Computes f = (I + λQR⁻¹Qᵀ)⁻¹y with dense matrices, and the score n‖y − f‖²/tr(I − A)².
fn dense(knots: &[f64], y: &[f64], lambda: f64) -> (DVector<f64>, f64) {
    let (n, h) = (knots.len(), |i: usize| knots[i + 1] - knots[i]);
    let (mut q, mut r) = (DMatrix::zeros(n, n - 2), DMatrix::zeros(n - 2, n - 2));
    for i in 0..n - 2 {
        q[(i, i)] = 1.0 / h(i);
        q[(i + 1, i)] = -1.0 / h(i) - 1.0 / h(i + 1);
        q[(i + 2, i)] = 1.0 / h(i + 1);
        r[(i, i)] = (h(i) + h(i + 1)) / 3.0;
        if i + 3 < n {
            r[(i, i + 1)] = h(i + 1) / 6.0;
            r[(i + 1, i)] = h(i + 1) / 6.0;
        }
    }
    let penalty = &q * r.try_inverse().unwrap() * q.transpose();
    let hat = (DMatrix::identity(n, n) + penalty * lambda).try_inverse().unwrap();
    let y = DVector::from_column_slice(y);
    let f = &hat * &y;
    let score = n as f64 * (y - &f).norm_squared() / (n as f64 - hat.trace()).powi(2);
    (f, score)
}

/// Computes the scores of one recording with all samples.
fn scores(samples: &Samples, cut_offs: &[f64]) -> Scores {
    Scores::compute(&[Decimated::new(samples, usize::MAX)], &[0], &[], cut_offs, Threads::ONE).unwrap()
}

#[test]
fn values_and_scores_are_those_of_the_dense_formulas() {
    let (time, mut normal) = (irregular(40, 0.01), noise(1));
    let y = Array2::from_shape_fn((40, 1), |(i, _)| (time[i] / 0.06).sin() + 0.1 * normal());
    let samples = Samples { time: &time, period: None, values: y.view() };
    let knots: Vec<f64> = time.iter().map(|t| t / samples.interval()).collect();
    let grid = [0.8, 3.0, 20.0, 60.0];
    let scores = scores(&samples, &grid);
    let mut constant = None;
    for (k, hz) in grid.into_iter().enumerate() {
        let (f, score) = dense(&knots, &y.column(0).to_vec(), lambda(hz * samples.interval()));
        let smoothed = samples.smoothed(&[Some(hz)], &[NATURAL]);
        for i in 0..40 {
            assert_abs_diff_eq!(smoothed[[i, 0]], f[i], epsilon = 1e-10);
        }
        // Logarithmic scores are defined up to a constant.
        let offset = scores.logarithms[[0, k]] - score.ln();
        assert_abs_diff_eq!(offset, *constant.get_or_insert(offset), epsilon = 1e-8);
        let squares = (0..40).map(|i| (y[[i, 0]] - f[i]).powi(2)).sum::<f64>();
        assert_relative_eq!(scores.squares[[0, k]], squares, max_relative = 1e-8);
        assert_relative_eq!(scores.traces[[0, k]], (40.0 * squares / score).sqrt(), max_relative = 1e-8);
    }
    let of = |hz: f64| dense(&knots, &y.column(0).to_vec(), lambda(hz * samples.interval())).1;
    let least = (0..400).map(|k| of(0.5 * 10f64.powf(k as f64 / 160.0))).fold(f64::MAX, f64::min);
    let noise = Noise::estimate(Smoothing::Auto, &[samples], &[], MIN_DECIMATED, Threads::ONE).unwrap();
    assert_relative_eq!(of(noise.cut_offs()[0].unwrap()), least, max_relative = 1e-2);
}

/// For uniform periodic samples the penalty is diagonal in the Fourier basis, with the eigenvalues that [`lambda`] inverts.
#[test]
fn scores_of_a_cycle_are_those_of_its_fourier_components() {
    let (n, mut normal) = (48, noise(5));
    let time = uniform(n, 0.02);
    let y = Array2::from_shape_fn((n, 1), |(i, _)| (TAU * i as f64 / n as f64).cos() + 0.2 * normal());
    let period = Some(n as f64 * 0.02);
    let samples = Samples { time: &time, period, values: y.view() };
    let grid = [4.0, 8.0, 15.0, 24.0];
    let scores = scores(&samples, &grid);
    for (k, hz) in grid.into_iter().enumerate() {
        let (mut squares, mut trace) = (0.0, 0.0);
        for j in 0..n {
            let angle = |i: usize| TAU * (j * i) as f64 / n as f64;
            let (re, im) = (0..n)
                .fold((0.0, 0.0), |(re, im), i| (re + y[[i, 0]] * angle(i).cos(), im + y[[i, 0]] * angle(i).sin()));
            let sine = (PI * j as f64 / n as f64).sin().powi(2);
            let penalty = lambda(hz * 0.02) * 16.0 * sine * sine / (1.0 - sine / 1.5);
            let off = penalty / (1.0 + penalty);
            squares += off * off * (re * re + im * im) / n as f64;
            trace += off;
        }
        assert_relative_eq!(scores.squares[[0, k]], squares, max_relative = 1e-6);
        assert_relative_eq!(scores.traces[[0, k]], trace, max_relative = 1e-6);
    }
}

/// The level is estimated for few and many recordings and samples, discrete and rhythmic.
#[test]
fn the_level_of_white_noise_is_estimated() {
    for (n, n_recordings) in [(101, 1), (101, 30), (1001, 10), (5001, 2)] {
        for periodic in [false, true] {
            let time = uniform(n, 1.0 / (n - 1) as f64);
            let period = periodic.then_some(n as f64 / (n - 1) as f64);
            let mut normal = noise(n as u64);
            let recordings: Vec<Array2<f64>> = (0..n_recordings)
                .map(|_| {
                    Array2::from_shape_fn((n, 2), |(i, d)| {
                        let s = time[i] / period.unwrap_or(1.0);
                        let clean = if periodic { (TAU * s).sin() } else { minimum_jerk(s) };
                        [clean + 0.01 * normal(), 50.0][d]
                    })
                })
                .collect();
            let samples: Vec<Samples> =
                recordings.iter().map(|y| Samples { time: &time, period, values: y.view() }).collect();
            let estimate = Noise::estimate(Smoothing::Auto, &samples, &[], MIN_DECIMATED, Threads::ONE).unwrap();
            let case = format!("{n} samples, {n_recordings} recordings, periodic {periodic}: {estimate:?}");
            // Four standard errors, for the 64 samples that decimated recordings have at least.
            let accuracy = 4.0 / (2.0 * (n.min(64) * n_recordings.min(24)) as f64).sqrt();
            assert!((estimate.levels()[0] / 0.01 - 1.0).abs() < accuracy, "{case}");
            assert!(estimate.cut_offs()[0].is_some_and(|hz| (1.0..15.0).contains(&hz)), "{case}");
            assert_eq!((estimate.levels()[1], estimate.cut_offs()[1]), (0.0, None), "{case}");
        }
    }
}

#[test]
fn auto_removes_more_than_half_of_white_noise() {
    let n = 200;
    let time = uniform(n, 0.01);
    let reach: Vec<f64> = time.iter().map(|t| minimum_jerk(t / time[n - 1])).collect();
    let cycle: Vec<f64> = time.iter().map(|t| (TAU * t / 2.0).sin()).collect();
    for seed in 0..10 {
        for (clean, period) in [(&reach, None), (&cycle, Some(2.0))] {
            let mut normal = noise(seed);
            let noisy: Vec<f64> = clean.iter().map(|y| y + 0.01 * normal()).collect();
            let smoothed = smooth_column(Smoothing::Auto, &time, period, &noisy);
            let remaining = distance(&smoothed, clean) / distance(&noisy, clean);
            assert!(remaining < 0.5, "seed {seed}, period {period:?}: {remaining}");
        }
    }
}

#[test]
fn auto_leaves_clean_samples_bitwise_unchanged() {
    for n in [20, 31, 100, 1000] {
        let time = uniform(n, 0.01);
        let share = |t: f64, steps: usize| t / (steps as f64 * 0.01);
        let reach: Vec<f64> = time.iter().map(|&t| minimum_jerk(share(t, n - 1))).collect();
        assert_eq!(smooth_column(Smoothing::Auto, &time, None, &reach), reach);
        let wave = |t: &f64| (TAU * share(*t, n)).sin() + 0.3 * (3.0 * TAU * share(*t, n)).cos();
        let cycle: Vec<f64> = time.iter().map(wave).collect();
        assert_eq!(smooth_column(Smoothing::Auto, &time, Some(n as f64 * 0.01), &cycle), cycle);
    }
}

#[test]
fn the_phase_of_the_first_sample_does_not_matter() {
    let (n, mut normal) = (60, noise(3));
    let time = irregular(n, 0.02);
    let (period, first) = (n as f64 * 0.02, 23);
    let y: Vec<f64> = time.iter().map(|t| (TAU * t / period).cos() + 0.1 * normal()).collect();
    let rotated_time: Vec<f64> = (0..n).map(|i| time[(i + first) % n] + ((i + first) / n) as f64 * period).collect();
    let rotated_y: Vec<f64> = (0..n).map(|i| y[(i + first) % n]).collect();
    for (cycles, tolerance) in [(1.0, 2e-3), (4.0, 1e-12)] {
        let smoothing = Smoothing::CutOff { hz: cycles / period };
        let smoothed = smooth_column(smoothing, &time, Some(period), &y);
        let rotated = smooth_column(smoothing, &rotated_time, Some(period), &rotated_y);
        for i in 0..n {
            assert_abs_diff_eq!(rotated[i], smoothed[(i + first) % n], epsilon = tolerance);
        }
    }
}

#[test]
fn samples_at_almost_the_same_time_are_averaged() {
    let mut time = uniform(20, 1.0);
    time.insert(10, 9.0 + 1e-7);
    let mut y = vec![0.0; 21];
    (y[9], y[10]) = (-1.0, 1.0);
    for smoothing in [Smoothing::CutOff { hz: 0.1 }, Smoothing::Auto] {
        let smoothed = smooth_column(smoothing, &time, None, &y);
        assert!(smoothed.iter().all(|y| y.abs() < 1e-3), "{smoothed:?}");
    }
}

#[test]
fn columns_are_independent_and_constant_ones_unchanged() {
    let (n, mut normal) = (80, noise(9));
    let time = uniform(n, 0.01);
    let noisy: Vec<f64> = time.iter().map(|t| t * t + 0.01 * normal()).collect();
    let both = Array2::from_shape_fn((n, 2), |(i, d)| [1e-150 / 3.0, noisy[i]][d]);
    for smoothing in [Smoothing::Auto, Smoothing::CutOff { hz: 5.0 }, Smoothing::Interpolate] {
        let smoothed = smooth(smoothing, &time, None, both.view(), &[]).unwrap();
        assert_eq!(smoothed.column(0), both.column(0));
        assert_eq!(smoothed.column(1).to_vec(), smooth_column(smoothing, &time, None, &noisy));
    }
}

proptest! {
    #[test]
    fn a_straight_line_is_unchanged_at_every_cut_off(per_sample in -4.0..-0.302, a in -1.0..1.0, b in -1.0..1.0) {
        let time = irregular(50, 0.01);
        let line: Vec<f64> = time.iter().map(|t| a + b * t).collect();
        let hz = 10f64.powf(per_sample) * 49.0 / (time[49] - time[0]);
        for smoothing in [Smoothing::CutOff { hz }, Smoothing::Auto] {
            prop_assert!(distance(&smooth_column(smoothing, &time, None, &line), &line) < 1e-12);
        }
    }

    #[test]
    fn the_units_of_values_and_time_do_not_matter(
        unit in -150..150, second in -6..6, periodic: bool, auto: bool, seed: u64,
    ) {
        let (unit, second, mut normal) = (10f64.powi(unit), 10f64.powi(second), noise(seed));
        let (time, period) = (irregular(60, 0.01), periodic.then_some(0.6));
        let y: Vec<f64> = time.iter().map(|t| (TAU * t / 0.6).sin() + 0.05 * normal()).collect();
        let of = |hz| if auto { Smoothing::Auto } else { Smoothing::CutOff { hz } };
        let expected = smooth_column(of(8.0), &time, period, &y);
        let scaled_time: Vec<f64> = time.iter().map(|t| t * second).collect();
        let scaled: Vec<f64> = y.iter().map(|y| y * unit).collect();
        let rescaled = smooth_column(of(8.0 / second), &scaled_time, period.map(|p| p * second), &scaled);
        let rescaled: Vec<f64> = rescaled.iter().map(|y| y / unit).collect();
        prop_assert!(distance(&rescaled, &expected) < 1e-6);
    }
}

#[test]
fn invalid_cut_offs_are_rejected() {
    let time = uniform(100, 0.01);
    let values = Array2::zeros((100, 1));
    let message =
        |hz: f64, period| smooth(Smoothing::CutOff { hz }, &time, period, values.view(), &[]).unwrap_err().to_string();
    for hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(message(hz, None).contains("must be positive and finite"));
    }
    assert_eq!(message(51.0, None), "smoothing = 51 Hz: must lie below half the sampling rate of 100 Hz");
    assert!(message(0.009, None).contains("ten-thousandth of the sampling rate"));
    assert!(message(0.9, Some(1.0)).contains("at least one cycle per period"));
}

#[test]
fn names_in_files_are_lower_case() {
    let json = [Smoothing::Interpolate, Smoothing::CutOff { hz: 5.0 }, Smoothing::Auto]
        .map(|smoothing| serde_json::to_string(&smoothing).unwrap());
    assert_eq!(json, ["\"interpolate\"", "{\"cutoff\":{\"hz\":5.0}}", "\"auto\""]);
}
