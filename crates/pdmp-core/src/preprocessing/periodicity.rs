//! How well a recording repeats itself after each lag, and the period that follows from it.
//!
//! Traits are what is compared: positions and velocities of all DoFs, each less its linear trend and over its standard
//! deviation, so that drift and units do not matter. Velocities tell cycles from slow wander, positions tell them from
//! their own harmonics. Trait f of a recording of n samples agrees with itself k samples later by Pearson's correlation
//! of the parts that overlap,
//!
//! ```text
//! ρ_f(k) = cov(y_f[0 … n−k), y_f[k … n)) / (σ(y_f[0 … n−k)) σ(y_f[k … n)))
//! ```
//!
//! and A(k) is its mean over all traits, velocities weighted by the share of the variance of their positions that
//! smoothing keeps: those of mere noise, smoothed, are few slow waves that agree with anything. The sums of products for all lags are one autocorrelation, which is a Fourier
//! transform of the power spectrum (Wiener–Khinchin).
//!
//! One cycle, two cycles and so on each make a peak of A, the highest lag of a lobe; half a cycle, or the period of a
//! harmonic, makes a lower one, as not every trait agrees there. The period is the first peak that is as high as the
//! highest but for what varies from cycle to cycle: both in A and in what is lacking half of the time,
//!
//! ```text
//! median over c of 1/(2F) Σ_f (y_f(c + k) − y_f(c))²
//! ```
//!
//! which is 1 − A for what is evenly distributed, but does not mind an odd cycle, and tells a harmonic. Peaks that chance
//! explains are none (see `significance`).
//!
//! P. McLeod, G. Wyvill, A smarter way to find pitch, ICMC 2005 (lobes, and the first of almost the highest peaks).

use std::f64::consts::TAU;
use std::ops::Range;

use faer::c64;
use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut1, Axis, concatenate};

use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::numerics::spline::{Knots, Splines};
use crate::preprocessing::Curve;
use crate::preprocessing::outliers::median;
use crate::preprocessing::significance::Chance;

pub(super) const STANDS_STILL: &str = "the recording stands still: it has no cycles";
/// Longest period, as a share of the recording: it must hold one cycle and a half.
const LONGEST: f64 = 2.0 / 3.0;
/// Least correlation of a recording with itself a period later: noise that a filter has cut off sharply rings with less.
const LEAST: f64 = 0.35;
/// Correlation above which there is a lobe.
const LOBE: f64 = 0.25;
/// A peak is as high as the highest if it keeps this share of its height,
const SHARE: f64 = 0.8;
/// and if half of the time it lacks at most this many times what the highest lacks,
const LACK: f64 = 2.0;
/// and this much for sampling.
const SLACK: f64 = 0.005;

/// The period of a cyclic recording, in seconds, to a small part of a sampling interval.
///
/// # Errors
/// A recording that does not repeat itself, or stands still, or without times.
pub fn period(demo: &Demonstration) -> Result<f64> {
    let curve = Curve::of(demo)?;
    Ok(period_of(traits(&curve)?.view(), curve.interval())? * curve.interval())
}

/// Traits (n, 2D) of a recording at n even times: positions of unit variance, then velocities whose variance is their
/// weight. Those that are constant are zero.
pub(super) fn traits(curve: &Curve) -> Result<Array2<f64>> {
    let n = curve.time.len();
    let time: Vec<f64> = (0..n).map(|c| c as f64).collect();
    let (first, last) = (curve.first(), curve.last());
    let mut position = curve.sample(first, last, n)?;
    // Noise would drown the velocities of a recording at a high rate.
    let mut smoothed = curve.smooth(first, last, n)?;
    let both = position.columns_mut().into_iter().zip(smoothed.columns_mut());
    let weights: Vec<f64> = both
        .map(|(position, smoothed)| [standardise(position), standardise(smoothed)])
        .map(|[all, kept]| if all > 0.0 { (kept / all).min(1.0) } else { 0.0 })
        .collect();
    let smoothed: Vec<f64> = smoothed.iter().copied().collect();
    let mut velocity = Splines::through(Knots::not_a_knot(time), &smoothed, position.ncols()).slopes();
    for (mut column, weight) in velocity.columns_mut().into_iter().zip(weights) {
        standardise(column.view_mut());
        column *= weight;
    }
    let traits = concatenate![Axis(1), position, velocity];
    if traits.iter().all(|x| *x == 0.0) {
        return Err(Error::Arguments(STANDS_STILL));
    }
    Ok(traits)
}

/// Takes off the linear trend, by least squares, and makes the standard deviation 1; what is constant becomes 0. Returns
/// what the deviation was.
fn standardise(mut column: ArrayViewMut1<f64>) -> f64 {
    let n = column.len() as f64;
    let largest = column.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    column.mapv_inplace(|y| y / largest);
    let (mean, middle) = (column.sum() / n, (n - 1.0) / 2.0);
    let along = |column: &ArrayViewMut1<f64>| -> f64 {
        column.iter().enumerate().map(|(c, y)| (c as f64 - middle) * (y - mean)).sum()
    };
    let slope = along(&column) * 12.0 / (n * (n * n - 1.0));
    column.iter_mut().enumerate().for_each(|(c, y)| *y -= mean + slope * (c as f64 - middle));
    let deviation = (column.iter().map(|y| y * y).sum::<f64>() / n).sqrt();
    // What is left of a constant, or of a straight line, is rounding.
    let moves = deviation > 1e-9;
    column.mapv_inplace(|y| if moves { y / deviation } else { 0.0 });
    if moves { deviation * largest } else { 0.0 }
}

/// The period in samples of a recording with such traits (n, F), sampled each `interval` seconds.
pub(super) fn period_of(traits: ArrayView2<f64>, interval: f64) -> Result<f64> {
    let agreement = agreement(traits);
    let fallen = agreement.iter().position(|a| *a <= LOBE).unwrap_or(agreement.len() - 1);
    let best = |lags: Range<usize>| lags.max_by(|&a, &b| agreement[a].total_cmp(&agreement[b])).unwrap_or(fallen);
    let peaks: Vec<(f64, f64)> = lobes(&agreement, fallen)
        .into_iter()
        .map(best)
        // A lobe that the longest lag cuts has its peak beyond.
        .filter(|&k| k + 1 < agreement.len())
        .map(|k| vertex(k, [agreement[k - 1], agreement[k], agreement[k + 1]]))
        .collect();
    let chance = Chance::of(traits, &agreement, fallen);
    let significant: Vec<(f64, f64)> =
        peaks.iter().copied().filter(|&(lag, peak)| peak >= chance.least(lag).max(LEAST)).collect();
    let higher = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
    let Some(highest) = significant.iter().copied().max_by(higher) else {
        // That which is nearest to being one.
        let short = |&(lag, peak): &(f64, f64)| peak - chance.least(lag).max(LEAST);
        let (lag, share) = peaks.into_iter().max_by(|a, b| short(a).total_cmp(&short(b))).unwrap_or_else(|| {
            let k = best(fallen..agreement.len());
            (k as f64, agreement[k].min(LOBE))
        });
        return Err(Error::Aperiodic { lag: lag * interval, share, least: chance.least(lag).max(LEAST) });
    };
    let most = LACK * lack(traits, highest.0) + SLACK;
    let as_high = |&(lag, peak): &(f64, f64)| peak >= SHARE * highest.1 && lack(traits, lag) <= most;
    Ok(significant.into_iter().find(as_high).unwrap_or(highest).0)
}

/// Runs of lags, from `first` on, at which the agreement makes a lobe.
fn lobes(agreement: &[f64], first: usize) -> Vec<Range<usize>> {
    let mut lobes: Vec<Range<usize>> = Vec::new();
    for k in (first..agreement.len()).filter(|&k| agreement[k] > LOBE) {
        match lobes.last_mut() {
            Some(lobe) if lobe.end == k => lobe.end = k + 1,
            _ => lobes.push(k..k + 1),
        }
    }
    lobes
}

/// The weight of a trait; 0 of one that is constant.
fn mean_square(column: &ArrayView1<f64>) -> f64 {
    column.dot(column) / column.len() as f64
}

/// What the agreement of traits (n, F) after a lag lacks half of the time.
fn lack(traits: ArrayView2<f64>, lag: f64) -> f64 {
    let (whole, share) = (lag as usize, lag.fract());
    let weight = traits.columns().into_iter().map(|column| mean_square(&column)).sum::<f64>();
    let distance = |c: usize| {
        let later = traits.row(c + whole).into_iter().zip(traits.row(c + whole + 1));
        let off = |((a, b), y): ((&f64, &f64), &f64)| (a * (1.0 - share) + b * share - y).powi(2);
        later.zip(traits.row(c)).map(off).sum::<f64>() / (2.0 * weight)
    };
    median(&(0..traits.nrows() - whole - 1).map(distance).collect::<Vec<_>>())
}

/// Abscissa and height of the parabola's vertex through three neighbours, the middle one at `k` and the highest.
pub(super) fn vertex(k: usize, [before, at, after]: [f64; 3]) -> (f64, f64) {
    let bend = before - 2.0 * at + after;
    let shift = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    (k as f64 + shift, at - 0.25 * (before - after) * shift)
}

/// A(k) for each lag k up to the longest, of traits (n, F).
fn agreement(traits: ArrayView2<f64>) -> Vec<f64> {
    let n = traits.nrows();
    let mut sum = vec![0.0; (LONGEST * n as f64) as usize + 1];
    let mut weights = 0.0;
    for column in traits.columns() {
        let weight = mean_square(&column);
        if weight == 0.0 {
            continue;
        }
        let products = products(column);
        // Sums of the first c samples, and of their squares.
        let mut sums = vec![[0.0; 2]; n + 1];
        for (c, y) in column.iter().enumerate() {
            sums[c + 1] = [sums[c][0] + y, sums[c][1] + y * y];
        }
        let [total, square] = sums[n];
        for (k, sum) in sum.iter_mut().enumerate() {
            let (m, [ahead, ahead_square], [left, left_square]) = ((n - k) as f64, sums[n - k], sums[k]);
            let [behind, behind_square] = [total - left, square - left_square];
            let variances = (ahead_square / m - (ahead / m).powi(2)) * (behind_square / m - (behind / m).powi(2));
            // A part at rest agrees with nothing.
            if variances > 1e-18 * weight * weight {
                *sum += weight * (products[k] / m - ahead * behind / (m * m)) / variances.sqrt();
            }
        }
        weights += weight;
    }
    sum.iter().map(|sum| sum / weights).collect()
}

/// Σ_c y_c y_{c+k} for each lag k.
fn products(y: ArrayView1<f64>) -> Vec<f64> {
    let size = (2 * y.len()).next_power_of_two();
    let mut padded: Vec<c64> = y.iter().map(|&y| c64::new(y, 0.0)).collect();
    padded.resize(size, c64::new(0.0, 0.0));
    let power: Vec<c64> = fourier(&padded).iter().map(|x| c64::new(x.norm_sqr(), 0.0)).collect();
    // A power spectrum is real and even: there and back are the same.
    fourier(&power).iter().take(y.len()).map(|x| x.re / size as f64).collect()
}

/// The discrete Fourier transform of 2^m numbers, by Cooley and Tukey's halves.
fn fourier(x: &[c64]) -> Vec<c64> {
    let n = x.len();
    if n == 1 {
        return x.to_vec();
    }
    let [even, odd] = [0, 1].map(|first| fourier(&x.iter().skip(first).step_by(2).copied().collect::<Vec<_>>()));
    let turned: Vec<c64> =
        odd.iter().enumerate().map(|(k, y)| y * c64::from_polar(1.0, -TAU * k as f64 / n as f64)).collect();
    let half = |sign: f64| even.iter().zip(&turned).map(move |(x, y)| x + y * sign);
    half(1.0).chain(half(-1.0)).collect()
}
