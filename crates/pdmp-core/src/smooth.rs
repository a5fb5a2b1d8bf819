//! The cubic smoothing spline: what is taken off noisy samples before they are interpolated and differentiated.
//!
//! It minimises Σ(y_i − f(t_i))² + λ∫f̈². With Q (n, n−2) the second divided differences and R (n−2, n−2) the Gram
//! matrix of the hat functions, both banded, the second derivatives γ and the values f at the knots are
//!
//! ```text
//! M γ = Qᵀy,   M = R + λQᵀQ,   f = y − λQγ
//! ```
//!
//! solved in O(n) by LDLᵀ. On a uniform grid it is a low-pass filter without phase lag, 1/(1 + λω⁴) for slow signals,
//! which is why λ can be given as the frequency of half gain. Time is counted in mean intervals throughout.
//!
//! - C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10, 1967, doi:10.1007/BF02162161;
//! - P. Craven, G. Wahba, Smoothing noisy data with spline functions: generalised cross-validation, Numerische
//!   Mathematik 31, 1979, doi:10.1007/BF01404567;
//! - M. F. Hutchinson, F. R. de Hoog, Smoothing noisy data with spline functions, Numerische Mathematik 47, 1985,
//!   doi:10.1007/BF01389878 (the trace in O(n)).

use std::f64::consts::PI;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, check_positive};

/// How noise is taken off the demonstrations before they are differentiated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Smoothing {
    /// None: every sample is met.
    #[default]
    Interpolate,
    /// A sine of frequency `hz` keeps half its amplitude; the fall-off is of fourth order and without phase lag.
    CutOff {
        /// Cut-off frequency in Hz.
        hz: f64,
    },
    /// As much as generalised cross-validation finds, for each degree of freedom on its own. It takes the noise to be
    /// white and wants some fifty samples; with fewer it may see none.
    Auto,
}

/// Lowest cut-off, in cycles per sample. Rounding errors grow with λ, that is with the inverse fourth power of the
/// cut-off; here they are 1e-3 of the gain, and at ten times the cut-off 1e-7.
const LOWEST: f64 = 1e-4;

/// The least λ that is searched, where a sine at the Nyquist frequency loses 5e-9 of its amplitude.
const LIGHTEST: f64 = 1e-10;

/// Copies of a cycle on either side of it. A sample's influence decays as exp(−√2π·hz·|Δt|), that is to 1e-4 over two
/// periods at the lowest cut-off that is allowed, one cycle per period, and to 1e-13 at one of 3.4.
const COPIES: usize = 2;

/// The smoothed values (n, D) of `values` (n, D) at the same `time` (n,) [s], each column for itself.
///
/// With a `period` [s] they are one cycle, t_0 < … < t_{n−1} < t_0 + period. The caller has checked that n is at least
/// 4, that the times increase and that the values are finite.
///
/// # Errors
/// A cut-off that is not positive and finite, above the Nyquist frequency, below [`LOWEST`] or below one per period.
pub(crate) fn smooth(
    smoothing: Smoothing,
    time: &[f64],
    period: Option<f64>,
    values: ArrayView2<f64>,
) -> Result<Array2<f64>> {
    let mut smoothed = values.to_owned();
    let (n, periodic) = (time.len(), period.is_some());
    if smoothing == Smoothing::Interpolate {
        return Ok(smoothed);
    }
    let interval = period.map_or_else(|| (time[n - 1] - time[0]) / (n - 1) as f64, |period| period / n as f64);
    if let Smoothing::CutOff { hz } = smoothing {
        check_cut_off(hz, hz * interval, period.map(|_| n))?;
    }
    let copies = if periodic { COPIES } else { 0 };
    let knots: Vec<f64> =
        (0..n * (2 * copies + 1)).map(|k| (time[k % n] - time[0]) / interval + (k / n * n) as f64).collect();
    let roughness = Roughness::new(&knots);

    // A column is smoothed as its deviation from its first value over the largest one. Constant columns stay.
    let column = |d: usize| {
        let (y, first) = (values.column(d), values[[0, d]]);
        let scale = y.iter().map(|y| (y - first).abs()).fold(0.0, f64::max);
        let deviation: Vec<f64> = (0..knots.len()).map(|k| (y[k % n] - first) / scale).collect();
        (scale > 0.0).then(|| Column { d, scale, bend: roughness.bend(&deviation) })
    };
    let columns: Vec<Column> = (0..values.ncols()).filter_map(column).collect();
    let lambdas = match smoothing {
        Smoothing::CutOff { hz } => vec![lambda(hz * interval); columns.len()],
        _ => {
            // At least one cycle per period, or half a cycle in the whole of the recording.
            let lowest = if periodic { 1.0 } else { 0.5 } / n as f64;
            roughness.cross_validate(&columns, lambda(lowest.max(LOWEST)))
        }
    };
    for (column, lambda) in columns.iter().zip(lambdas) {
        let residual = roughness.residual(&roughness.factor(lambda), &column.bend);
        for (y, residual) in smoothed.column_mut(column.d).iter_mut().zip(&residual[copies * n..]) {
            *y -= column.scale * lambda * residual;
        }
    }
    Ok(smoothed)
}

/// A degree of freedom that moves: its number, its largest deviation and Qᵀy.
struct Column {
    d: usize,
    scale: f64,
    bend: Vec<f64>,
}

fn check_cut_off(hz: f64, per_sample: f64, cycle: Option<usize>) -> Result<()> {
    check_positive("smoothing", hz)?;
    let allowed = if per_sample >= 0.5 {
        "must lie below half the sampling rate"
    } else if per_sample < LOWEST {
        "must be at least a ten-thousandth of the sampling rate"
    } else if cycle.is_some_and(|n| per_sample * (n as f64) < 1.0 - 1e-9) {
        "must be at least one cycle per period: a lower cut-off takes the movement away"
    } else {
        return Ok(());
    };
    Err(Error::Range { name: "smoothing", value: hz, allowed })
}

/// The λ that halves a sine of `frequency` cycles per sample on a uniform grid, where λQR⁻¹Qᵀ has the eigenvalue
/// λ(2 sin ω/2)⁴/(1 − ⅔sin² ω/2): the 1/(1 + λω⁴) of the continuous case up to terms of the order ω⁴.
fn lambda(frequency: f64) -> f64 {
    let sin_squared = (PI * frequency).sin().powi(2);
    (1.0 - sin_squared / 1.5) / (16.0 * sin_squared * sin_squared)
}

/// Columns of Q, and the upper bands of R and QᵀQ: (diagonal, first, second) in each row.
struct Roughness {
    q: Vec<[f64; 3]>,
    r: Vec<[f64; 2]>,
    qq: Vec<[f64; 3]>,
}

/// M = LDLᵀ: in row i, d_i and the elements of L in rows i + 1 and i + 2 of column i.
struct Factor(Vec<[f64; 3]>);

impl Roughness {
    fn new(knots: &[f64]) -> Self {
        let h: Vec<f64> = knots.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let q: Vec<[f64; 3]> = h.windows(2).map(|h| [1.0 / h[0], -1.0 / h[0] - 1.0 / h[1], 1.0 / h[1]]).collect();
        let r = h.windows(2).map(|h| [(h[0] + h[1]) / 3.0, h[1] / 6.0]).collect();
        let column = |i: usize| q.get(i).copied().unwrap_or_default();
        let qq = (0..q.len())
            .map(|i| {
                let [a, b, c] = q[i];
                let ([a1, b1, _], [a2, ..]) = (column(i + 1), column(i + 2));
                [a * a + b * b + c * c, b * a1 + c * b1, c * a2]
            })
            .collect();
        Self { q, r, qq }
    }

    /// Qᵀy.
    fn bend(&self, y: &[f64]) -> Vec<f64> {
        self.q.iter().zip(y.windows(3)).map(|(q, y)| q[0] * (y[0] - y[1]) + q[2] * (y[2] - y[1])).collect()
    }

    /// M = R + λQᵀQ, factorised.
    fn factor(&self, lambda: f64) -> Factor {
        let mut rows: Vec<[f64; 3]> = Vec::with_capacity(self.q.len());
        let [mut before, mut last] = [[0.0; 3]; 2];
        for (r, qq) in self.r.iter().zip(&self.qq) {
            let d = r[0] + lambda * qq[0] - last[0] * last[1] * last[1] - before[0] * before[2] * before[2];
            let first = (r[1] + lambda * qq[1] - last[0] * last[1] * last[2]) / d;
            (before, last) = (last, [d, first, lambda * qq[2] / d]);
            rows.push(last);
        }
        Factor(rows)
    }

    /// Qγ; λ times it is taken off the samples.
    fn residual(&self, factor: &Factor, bend: &[f64]) -> Vec<f64> {
        let mut residual = vec![0.0; bend.len() + 2];
        for (i, (q, gamma)) in self.q.iter().zip(factor.solve(bend)).enumerate() {
            for (k, q) in q.iter().enumerate() {
                residual[i + k] += q * gamma;
            }
        }
        residual
    }

    /// tr(Q M⁻¹ Qᵀ) = tr(I − A)/λ.
    fn trace(&self, factor: &Factor) -> f64 {
        let inverse = factor.central_bands_of_inverse();
        self.qq.iter().zip(inverse).map(|(q, m)| q[0] * m[0] + 2.0 * (q[1] * m[1] + q[2] * m[2])).sum()
    }

    /// Generalised cross-validation n‖y − f‖²/tr(I − A)² of each column. In n‖Qγ‖²/tr(QM⁻¹Qᵀ)² the λ is cancelled:
    /// there is no 0/0 where the spline interpolates.
    fn scores(&self, lambda: f64, columns: &[Column]) -> Vec<f64> {
        let factor = self.factor(lambda);
        let (n, trace) = ((self.q.len() + 2) as f64, self.trace(&factor));
        let squares = |column: &Column| self.residual(&factor, &column.bend).iter().map(|r| r * r).sum::<f64>();
        columns.iter().map(|column| n * squares(column) / (trace * trace)).collect()
    }

    /// The λ of least cross-validation score for each column, from `heaviest` to [`LIGHTEST`].
    ///
    /// The score may have several minima: a grid of half decades finds the lowest, and golden section narrows it down.
    fn cross_validate(&self, columns: &[Column], heaviest: f64) -> Vec<f64> {
        let decades = (heaviest / LIGHTEST).log10();
        let n_steps = (2.0 * decades).ceil();
        let grid: Vec<f64> = (0..=n_steps as usize).map(|k| heaviest.log10() - decades * k as f64 / n_steps).collect();
        let scores: Vec<Vec<f64>> = grid.iter().map(|&log| self.scores(10f64.powf(log), columns)).collect();
        let search = |d: usize| {
            let best = (0..grid.len()).min_by(|&a, &b| scores[a][d].total_cmp(&scores[b][d])).unwrap_or(0);
            let (lighter, heavier) = (grid[(best + 1).min(grid.len() - 1)], grid[best.saturating_sub(1)]);
            10f64.powf(golden_section(|log| self.scores(10f64.powf(log), &columns[d..=d])[0], lighter, heavier))
        };
        (0..columns.len()).map(search).collect()
    }
}

impl Factor {
    /// M⁻¹b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for (i, [_, first, second]) in self.0.iter().enumerate() {
            let xi = x[i];
            x.iter_mut().skip(i + 1).zip([first, second]).for_each(|(x, l)| *x -= l * xi);
        }
        let (mut next, mut after) = (0.0, 0.0);
        for (x, [d, first, second]) in x.iter_mut().zip(&self.0).rev() {
            *x = *x / d - first * next - second * after;
            (next, after) = (*x, next);
        }
        x
    }

    /// The elements (i, i), (i, i + 1) and (i, i + 2) of M⁻¹, from M⁻¹ = L⁻ᵀD⁻¹ + M⁻¹(I − L).
    fn central_bands_of_inverse(&self) -> Vec<[f64; 3]> {
        let mut rows = vec![[0.0; 3]; self.0.len()];
        let [mut next, mut after] = [[0.0; 3]; 2];
        for (row, [d, first, second]) in rows.iter_mut().zip(&self.0).rev() {
            let one = -first * next[0] - second * next[1];
            let two = -first * next[1] - second * after[0];
            *row = [1.0 / d - first * one - second * two, one, two];
            (next, after) = (*row, next);
        }
        rows
    }
}

/// A minimum of `f` in [a, b], to a hundredth of its width.
fn golden_section(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    const SHARE: f64 = 0.618_033_988_749_894_8;
    let (mut left, mut right) = (b - SHARE * (b - a), a + SHARE * (b - a));
    let (mut f_left, mut f_right) = (f(left), f(right));
    for _ in 0..8 {
        if f_left <= f_right {
            (b, right, f_right) = (right, left, f_left);
            left = b - SHARE * (b - a);
            f_left = f(left);
        } else {
            (a, left, f_left) = (left, right, f_right);
            right = a + SHARE * (b - a);
            f_right = f(right);
        }
    }
    (a + b) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// Standard normal numbers: Box and Muller's from a linear congruential generator.
    fn noise(mut state: u64) -> impl FnMut() -> f64 {
        let mut uniform = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        };
        move || (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos()
    }

    fn minimum_jerk(s: f64) -> f64 {
        s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
    }

    fn uniform(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|i| i as f64 * step).collect()
    }

    /// Times whose steps vary by half to three halves of `step`.
    fn irregular(n: usize, step: f64) -> Vec<f64> {
        let mut normal = noise(11);
        (0..n).map(|i| (i as f64 + 0.25 * normal().clamp(-1.0, 1.0)) * step).collect()
    }

    fn smooth_column(smoothing: Smoothing, time: &[f64], period: Option<f64>, y: &[f64]) -> Vec<f64> {
        let values = Array2::from_shape_fn((y.len(), 1), |(i, _)| y[i]);
        smooth(smoothing, time, period, values.view()).unwrap().into_raw_vec_and_offset().0
    }

    /// Root mean square of the difference.
    fn distance(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }

    /// What is left of a sine of `hz`, sampled at 100 Hz for 20 s, between 5 and 15 s.
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
    fn slower_sines_pass_and_faster_ones_fall_off_with_the_fourth_power() {
        for ratio in [0.25f64, 0.5, 2.0, 4.0, 8.0] {
            assert_relative_eq!(gain(2.0 * ratio, 2.0), 1.0 / (1.0 + ratio.powi(4)), max_relative = 0.03);
        }
    }

    #[test]
    fn irregular_stamps_are_filtered_alike() {
        let slow = |t: f64| (TAU * t).sin();
        for time in [uniform(1000, 0.01), irregular(1000, 0.01)] {
            let y: Vec<f64> = time.iter().map(|&t| slow(t) + 0.1 * (TAU * 17.0 * t).sin()).collect();
            let smoothed = smooth_column(Smoothing::CutOff { hz: 4.0 }, &time, None, &y);
            let expected: Vec<f64> = time.iter().map(|&t| slow(t) / (1.0 + 0.25f64.powi(4))).collect();
            let error = distance(&smoothed[100..900], &expected[100..900]);
            assert!(error < 1e-2, "{error}");
        }
    }

    /// f = (I + λQR⁻¹Qᵀ)⁻¹y with dense matrices, and the score n‖y − f‖²/tr(I − A)² as it is defined.
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

    #[test]
    fn values_and_scores_are_those_of_the_dense_formulas() {
        let (knots, mut normal) = (irregular(40, 1.0), noise(1));
        let y: Vec<f64> = knots.iter().map(|t| (t / 6.0).sin() + 0.1 * normal()).collect();
        let roughness = Roughness::new(&knots);
        let columns = [Column { d: 0, scale: 1.0, bend: roughness.bend(&y) }];
        for lambda in [1e-3, 0.1, 10.0, 1e4] {
            let (f, score) = dense(&knots, &y, lambda);
            let residual = roughness.residual(&roughness.factor(lambda), &columns[0].bend);
            for i in 0..40 {
                assert_abs_diff_eq!(y[i] - lambda * residual[i], f[i], epsilon = 1e-10);
            }
            assert_relative_eq!(roughness.scores(lambda, &columns)[0], score, max_relative = 1e-9);
        }
        let least = (-100..500).map(|k| dense(&knots, &y, 10f64.powf(k as f64 / 100.0)).1).fold(f64::MAX, f64::min);
        let found = roughness.cross_validate(&columns, 1e6)[0];
        assert_relative_eq!(dense(&knots, &y, found).1, least, max_relative = 1e-4);
    }

    #[test]
    fn auto_takes_more_than_half_of_white_noise_off_whatever_its_seed() {
        let n = 200;
        let time = uniform(n, 0.01);
        let reach: Vec<f64> = time.iter().map(|t| minimum_jerk(t / time[n - 1])).collect();
        let cycle: Vec<f64> = time.iter().map(|t| (TAU * t / 2.0).sin()).collect();
        for seed in 0..10 {
            for (clean, period) in [(&reach, None), (&cycle, Some(2.0))] {
                let mut normal = noise(seed);
                let noisy: Vec<f64> = clean.iter().map(|y| y + 0.01 * normal()).collect();
                let smoothed = smooth_column(Smoothing::Auto, &time, period, &noisy);
                let left = distance(&smoothed, clean) / distance(&noisy, clean);
                assert!(left < 0.5, "seed {seed}, period {period:?}: {left}");
            }
        }
    }

    #[test]
    fn auto_leaves_clean_samples_alone() {
        for n in [20, 100, 1000] {
            let time = uniform(n, 0.01);
            let clean: Vec<f64> = time.iter().map(|t| minimum_jerk(t / time[n - 1])).collect();
            assert!(distance(&smooth_column(Smoothing::Auto, &time, None, &clean), &clean) < 1e-10);
        }
    }

    #[test]
    fn a_cycle_may_begin_anywhere() {
        let (n, mut normal) = (60, noise(3));
        let time = irregular(n, 0.02);
        let (period, first) = (n as f64 * 0.02, 23);
        let y: Vec<f64> = time.iter().map(|t| (TAU * t / period).cos() + 0.1 * normal()).collect();
        let turned_time: Vec<f64> = (0..n).map(|i| time[(i + first) % n] + ((i + first) / n) as f64 * period).collect();
        let turned_y: Vec<f64> = (0..n).map(|i| y[(i + first) % n]).collect();
        for (cycles, tolerance) in [(1.0, 2e-3), (4.0, 1e-12)] {
            let smoothing = Smoothing::CutOff { hz: cycles / period };
            let smoothed = smooth_column(smoothing, &time, Some(period), &y);
            let turned = smooth_column(smoothing, &turned_time, Some(period), &turned_y);
            for i in 0..n {
                assert_abs_diff_eq!(turned[i], smoothed[(i + first) % n], epsilon = tolerance);
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
    fn columns_do_not_mix_and_constant_ones_stay() {
        let (n, mut normal) = (80, noise(9));
        let time = uniform(n, 0.01);
        let noisy: Vec<f64> = time.iter().map(|t| t * t + 0.01 * normal()).collect();
        let both = Array2::from_shape_fn((n, 2), |(i, d)| [1e-150 / 3.0, noisy[i]][d]);
        for smoothing in [Smoothing::Auto, Smoothing::CutOff { hz: 5.0 }, Smoothing::Interpolate] {
            let smoothed = smooth(smoothing, &time, None, both.view()).unwrap();
            assert_eq!(smoothed.column(0), both.column(0));
            assert_eq!(smoothed.column(1).to_vec(), smooth_column(smoothing, &time, None, &noisy));
        }
    }

    proptest! {
        #[test]
        fn a_straight_line_passes_at_every_cut_off(per_sample in -4.0..-0.302, a in -1.0..1.0, b in -1.0..1.0) {
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
            let found = smooth_column(of(8.0 / second), &scaled_time, period.map(|p| p * second), &scaled);
            let found: Vec<f64> = found.iter().map(|y| y / unit).collect();
            prop_assert!(distance(&found, &expected) < 1e-6);
        }
    }

    #[test]
    fn impossible_cut_offs_are_refused_in_clear_words() {
        let time = uniform(100, 0.01);
        let values = Array2::zeros((100, 1));
        let refusal =
            |hz: f64, period| smooth(Smoothing::CutOff { hz }, &time, period, values.view()).unwrap_err().to_string();
        for hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(refusal(hz, None).contains("must be positive and finite"));
        }
        assert_eq!(refusal(51.0, None), "smoothing = 51: must lie below half the sampling rate");
        assert!(refusal(0.009, None).contains("ten-thousandth of the sampling rate"));
        assert!(refusal(0.9, Some(1.0)).contains("at least one cycle per period"));
    }

    #[test]
    fn the_names_in_files_are_lower_case() {
        let json = [Smoothing::Interpolate, Smoothing::CutOff { hz: 5.0 }, Smoothing::Auto]
            .map(|smoothing| serde_json::to_string(&smoothing).unwrap());
        assert_eq!(json, ["\"interpolate\"", "{\"cutoff\":{\"hz\":5.0}}", "\"auto\""]);
    }
}
