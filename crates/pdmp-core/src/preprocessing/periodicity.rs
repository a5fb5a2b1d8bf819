//! Autocorrelation of a recording, and its period.
//!
//! The traits of a recording are the positions and velocities of all DoFs, detrended linearly and scaled to unit standard
//! deviation, which removes drift and units; a rotation has the elements of its matrix, with a common scale. Velocities distinguish cycles from slow wander, and positions distinguish cycles
//! from their harmonics. The autocorrelation of trait f of n samples at lag k is Pearson's correlation of the overlapping
//! parts,
//!
//! ```text
//! ρ_f(k) = cov(y_f[0 … n−k), y_f[k … n)) / (σ(y_f[0 … n−k)) σ(y_f[k … n)))
//! ```
//!
//! and A(k) is its mean over all traits. The weight of a velocity is the share of the variance of its position that
//! smoothing preserves: smoothed noise consists of a few slow waves, which correlate with anything. The sums of products for
//! all lags are the Fourier transform of the power spectrum (Wiener–Khinchin).
//!
//! Each multiple of the period has a peak of A, the highest lag of a lobe. Half a cycle and the period of a harmonic have
//! lower peaks, as some traits do not agree there. The period is the first peak as high as the highest up to the variation
//! between cycles, both in A and in the median mismatch
//!
//! ```text
//! median over c of 1/(2F) Σ_f (y_f(c + k) − y_f(c))²
//! ```
//!
//! which is 1 − A for evenly distributed errors, but robust against single outlying cycles and sensitive to harmonics.
//! Peaks below the significance threshold are ignored (see `significance`).
//!
//! P. McLeod, G. Wyvill, A smarter way to find pitch, ICMC 2005 (lobes, and the first of the almost highest peaks).

use std::f64::consts::TAU;
use std::ops::Range;

use faer::c64;
use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut1, ArrayViewMut2, Axis, concatenate};

use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::numerics::spline::{Knots, Splines};
use crate::numerics::statistics::median;
use crate::preprocessing::Curve;
use crate::preprocessing::significance::SignificanceThreshold;

/// Consequence of a recording without motion.
pub(super) const NO_CYCLES: &str = "it has no cycles";
/// Longest period relative to the recording, which then contains one and a half cycles.
const MAX_PERIOD: f64 = 2.0 / 3.0;
/// Least autocorrelation at the period. Noise with a sharp cut-off rings with less.
const MIN_AUTOCORRELATION: f64 = 0.35;
/// Autocorrelation above which lags belong to a lobe.
const LOBE_THRESHOLD: f64 = 0.25;
/// Least height of the peak at the period, relative to the highest peak.
const MIN_RELATIVE_HEIGHT: f64 = 0.8;
/// Largest median mismatch at the period, relative to that at the highest peak.
const MAX_RELATIVE_MISMATCH: f64 = 2.0;
/// Least standard deviation of an element of a rotation matrix, relative to that of all elements together.
const MIN_SHARE: f64 = 0.05;
/// Median mismatch due to sampling, in addition.
const SAMPLING_MISMATCH: f64 = 0.005;

/// Estimates the period of a cyclic recording in seconds, with a resolution of a fraction of the sampling interval.
///
/// ```
/// use ndarray::Array2;
/// use pdmp_core::preprocessing::period;
/// use pdmp_core::{Demonstration, Sampling};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let position = Array2::from_shape_fn((440, 1), |(c, _)| (std::f64::consts::TAU * c as f64 / 80.5).sin());
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// assert!((period(&recording)? - 0.805).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A recording that does not repeat itself, stands still, or has no times.
pub fn period(demo: &Demonstration) -> Result<f64> {
    let curve = Curve::with_matrices(demo)?;
    Ok(period_of(traits(&curve)?.view(), curve.interval())? * curve.interval())
}

/// Computes the traits (n, 2D) of a recording at n even times: positions of unit variance, and velocities whose variance is
/// their weight. Constant traits are zero.
///
/// # Errors
/// A recording without motion.
pub(super) fn traits(curve: &Curve) -> Result<Array2<f64>> {
    let n = curve.time.len();
    let time: Vec<f64> = (0..n).map(|c| c as f64).collect();
    let (first, last) = (curve.first(), curve.last());
    let mut position = curve.sample(first, last, n)?;
    // At a high sampling rate noise dominates unsmoothed velocities.
    let mut smoothed = curve.smooth(first, last, n)?;
    let [total, preserved] =
        [&mut position, &mut smoothed].map(|values| standardise_all(values.view_mut(), &curve.rotations));
    let weight = |(&total, preserved): (&f64, f64)| if total > 0.0 { (preserved / total).min(1.0) } else { 0.0 };
    let weights: Vec<f64> = total.iter().zip(preserved).map(weight).collect();
    let smoothed: Vec<f64> = smoothed.iter().copied().collect();
    let mut velocity = Splines::through(Knots::not_a_knot(time), &smoothed, position.ncols()).slopes();
    standardise_all(velocity.view_mut(), &curve.rotations);
    for (mut column, weight) in velocity.columns_mut().into_iter().zip(weights) {
        column *= weight;
    }
    let traits = concatenate![Axis(1), position, velocity];
    if traits.iter().all(|x| *x == 0.0) {
        return Err(Error::Still { consequence: NO_CYCLES });
    }
    Ok(traits)
}

/// Standardises each column, and returns the deviations before scaling. The columns of a rotation have one scale, by which
/// their variances add up to three, that of three degrees of freedom; those that vary little are noise and become zero.
fn standardise_all(mut values: ArrayViewMut2<f64>, rotations: &[Range<usize>]) -> Vec<f64> {
    let mut deviations: Vec<f64> = values.columns_mut().into_iter().map(standardise).collect();
    for columns in rotations {
        let own = deviations[columns.clone()].to_vec();
        let common = (own.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt();
        for (column, deviation) in columns.clone().zip(own) {
            let scale = if deviation > MIN_SHARE * common { deviation / common } else { 0.0 };
            values.column_mut(column).mapv_inplace(|y| y * scale);
            deviations[column] = common;
        }
    }
    deviations
}

/// Subtracts the linear trend by least squares, and scales to unit standard deviation. Returns the deviation before scaling.
///
/// A constant or linear column becomes zero.
fn standardise(mut column: ArrayViewMut1<f64>) -> f64 {
    let n = column.len() as f64;
    let largest = column.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    column.mapv_inplace(|y| y / largest);
    let (mean, middle) = (column.sum() / n, (n - 1.0) / 2.0);
    let covariation: f64 = column.iter().enumerate().map(|(c, y)| (c as f64 - middle) * (y - mean)).sum();
    let slope = covariation * 12.0 / (n * (n * n - 1.0));
    column.iter_mut().enumerate().for_each(|(c, y)| *y -= mean + slope * (c as f64 - middle));
    let deviation = (column.iter().map(|y| y * y).sum::<f64>() / n).sqrt();
    // The residuals of a constant or of a straight line are rounding errors.
    let moves = deviation > 1e-9;
    column.mapv_inplace(|y| if moves { y / deviation } else { 0.0 });
    if moves { deviation * largest } else { 0.0 }
}

/// Peak of the autocorrelation.
#[derive(Clone, Copy)]
struct Peak {
    /// Lag in samples.
    lag: f64,
    height: f64,
}

/// Returns the period in samples from the traits (n, F), sampled every `interval` seconds.
///
/// # Errors
/// An autocorrelation without a significant peak.
pub(super) fn period_of(traits: ArrayView2<f64>, interval: f64) -> Result<f64> {
    let autocorrelation = autocorrelation(traits);
    let n_lags = autocorrelation.len();
    let lobe_end = autocorrelation.iter().position(|a| *a <= LOBE_THRESHOLD).unwrap_or(n_lags - 1);
    let highest_lag = |lags: Range<usize>| {
        lags.max_by(|&a, &b| autocorrelation[a].total_cmp(&autocorrelation[b])).unwrap_or(lobe_end)
    };
    let peaks: Vec<Peak> = lobes(&autocorrelation, lobe_end)
        .into_iter()
        .map(highest_lag)
        // The peak of a truncated lobe lies beyond the longest lag.
        .filter(|&k| k + 1 < n_lags)
        .map(|k| vertex(k, [autocorrelation[k - 1], autocorrelation[k], autocorrelation[k + 1]]))
        .map(|(lag, height)| Peak { lag, height })
        .collect();
    let significance = SignificanceThreshold::new(traits, &autocorrelation, lobe_end);
    let threshold = |lag: f64| significance.at(lag).max(MIN_AUTOCORRELATION);
    let significant: Vec<Peak> = peaks.iter().copied().filter(|peak| peak.height >= threshold(peak.lag)).collect();
    let Some(highest) = significant.iter().copied().max_by(|a, b| a.height.total_cmp(&b.height)) else {
        // The error reports the peak closest to its threshold.
        let excess = |peak: &Peak| peak.height - threshold(peak.lag);
        let Peak { lag, height } =
            peaks.into_iter().max_by(|a, b| excess(a).total_cmp(&excess(b))).unwrap_or_else(|| {
                let k = highest_lag(lobe_end..n_lags);
                Peak { lag: k as f64, height: autocorrelation[k].min(LOBE_THRESHOLD) }
            });
        return Err(Error::Aperiodic { lag: lag * interval, share: height, least: threshold(lag) });
    };
    let max_mismatch = MAX_RELATIVE_MISMATCH * median_mismatch(traits, highest.lag) + SAMPLING_MISMATCH;
    let is_as_high = |peak: &Peak| {
        peak.height >= MIN_RELATIVE_HEIGHT * highest.height && median_mismatch(traits, peak.lag) <= max_mismatch
    };
    Ok(significant.into_iter().find(is_as_high).unwrap_or(highest).lag)
}

/// Returns the lobes of the autocorrelation, runs of lags from `first` on.
fn lobes(autocorrelation: &[f64], first: usize) -> Vec<Range<usize>> {
    let mut lobes: Vec<Range<usize>> = Vec::new();
    for k in (first..autocorrelation.len()).filter(|&k| autocorrelation[k] > LOBE_THRESHOLD) {
        match lobes.last_mut() {
            Some(lobe) if lobe.end == k => lobe.end = k + 1,
            _ => lobes.push(k..k + 1),
        }
    }
    lobes
}

/// Returns the weight of a trait, 0 if it is constant.
fn mean_square(column: &ArrayView1<f64>) -> f64 {
    column.dot(column) / column.len() as f64
}

/// Computes the median mismatch of traits (n, F) after a lag in samples, which may be fractional.
fn median_mismatch(traits: ArrayView2<f64>, lag: f64) -> f64 {
    let (whole, share) = (lag as usize, lag.fract());
    let weight = traits.columns().into_iter().map(|column| mean_square(&column)).sum::<f64>();
    let mismatch = |c: usize| {
        let later = traits.row(c + whole).into_iter().zip(traits.row(c + whole + 1));
        let square = |((a, b), y): ((&f64, &f64), &f64)| (a * (1.0 - share) + b * share - y).powi(2);
        later.zip(traits.row(c)).map(square).sum::<f64>() / (2.0 * weight)
    };
    median(&(0..traits.nrows() - whole - 1).map(mismatch).collect::<Vec<_>>())
}

/// Returns abscissa and height of the vertex of the parabola through three neighbours, the highest of which is at `k`.
pub(super) fn vertex(k: usize, [before, at, after]: [f64; 3]) -> (f64, f64) {
    let curvature = before - 2.0 * at + after;
    let shift = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
    (k as f64 + shift, at - 0.25 * (before - after) * shift)
}

/// Computes A(k) of traits (n, F) for each lag k up to the longest.
fn autocorrelation(traits: ArrayView2<f64>) -> Vec<f64> {
    let n = traits.nrows();
    let mut sum = vec![0.0; (MAX_PERIOD * n as f64) as usize + 1];
    let mut weights = 0.0;
    for column in traits.columns() {
        let weight = mean_square(&column);
        if weight == 0.0 {
            continue;
        }
        let products = lagged_products(column);
        // Sums of the first c samples and of their squares, by which each lag takes constant time.
        let mut sums = vec![[0.0; 2]; n + 1];
        for (c, y) in column.iter().enumerate() {
            sums[c + 1] = [sums[c][0] + y, sums[c][1] + y * y];
        }
        let [total, square] = sums[n];
        for (k, sum) in sum.iter_mut().enumerate() {
            let (m, [ahead, ahead_square], [left, left_square]) = ((n - k) as f64, sums[n - k], sums[k]);
            let [behind, behind_square] = [total - left, square - left_square];
            let variances = (ahead_square / m - (ahead / m).powi(2)) * (behind_square / m - (behind / m).powi(2));
            // A part at rest has no correlation.
            if variances > 1e-18 * weight * weight {
                *sum += weight * (products[k] / m - ahead * behind / (m * m)) / variances.sqrt();
            }
        }
        weights += weight;
    }
    sum.iter().map(|sum| sum / weights).collect()
}

/// Computes Σ_c y_c y_{c+k} for each lag k.
fn lagged_products(y: ArrayView1<f64>) -> Vec<f64> {
    let size = (2 * y.len()).next_power_of_two();
    let mut padded: Vec<c64> = y.iter().map(|&y| c64::new(y, 0.0)).collect();
    padded.resize(size, c64::new(0.0, 0.0));
    let power: Vec<c64> = fourier(&padded).iter().map(|x| c64::new(x.norm_sqr(), 0.0)).collect();
    // The power spectrum is real and even: its forward and inverse transforms are equal up to scale.
    fourier(&power).iter().take(y.len()).map(|x| x.re / size as f64).collect()
}

/// Computes the discrete Fourier transform of 2^m numbers by the algorithm of Cooley and Tukey.
fn fourier(x: &[c64]) -> Vec<c64> {
    let n = x.len();
    if n == 1 {
        return x.to_vec();
    }
    let [even, odd] = [0, 1].map(|first| fourier(&x.iter().skip(first).step_by(2).copied().collect::<Vec<_>>()));
    let rotated: Vec<c64> =
        odd.iter().enumerate().map(|(k, y)| y * c64::from_polar(1.0, -TAU * k as f64 / n as f64)).collect();
    let half = |sign: f64| even.iter().zip(&rotated).map(move |(x, y)| x + y * sign);
    half(1.0).chain(half(-1.0)).collect()
}
