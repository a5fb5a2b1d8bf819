//! Trimming of a recording to its movement.

use ndarray::{ArrayView1, s};

use super::Curve;
use crate::demonstration::{Demonstration, MIN_SAMPLES_PER_DEMONSTRATION, Sampling};
use crate::error::{Error, Result};
use crate::numerics::statistics::range;
use crate::validate::check_range;

/// Threshold of the squared speed above its mean under noise, in standard deviations: noise in one degree of freedom
/// exceeds it once in thirty thousand samples.
const MIN_DEVIATIONS: f64 = 11.0;
/// Variance of the slope of a smoothing spline at an end, relative to the middle.
const END_VARIANCE_RATIO: f64 = 4.0;
/// Maximum of the noise threshold, relative to the peak speed: rather keep some rest than remove movement.
const MAX_NOISE_THRESHOLD: f64 = 0.25;
/// Minimum ratio of the step at a jump to all but [`MAX_JUMPS`] other steps.
const MIN_JUMP: f64 = 10.0;
/// Maximum number of jumps that are detected; a movement has more large steps than that.
const MAX_JUMPS: usize = 3;
/// Number of samples over which the ringing of a spline next to a jump decays to a hundredth of its speed.
const RINGING: usize = 4;

/// Trims a recording to its movement: from the first to the last sample whose speed is at least the fraction `threshold`
/// of the peak speed.
///
/// The speed of the smoothed recording is v² = Σ_d (ẏ_d / (max y_d − min y_d))². If the speed of noise exceeds the
/// threshold, the movement must also exceed the noise, or a quarter of the peak speed, somewhere; it then extends to where
/// the speed falls below the threshold. The peak speed excludes jumps from one sample to the next.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling, preprocessing::trim};
/// # fn main() -> pdmp_core::Result<()> {
/// // A reach of one second after one second of rest.
/// let position = Array2::from_shape_fn((201, 1), |(c, _)| {
///     let s = (c as f64 / 100.0 - 1.0).max(0.0);
///     s * s * (3.0 - 2.0 * s)
/// });
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// assert!((95..=101).contains(&trim(&recording, 0.05)?.n_samples()));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A threshold outside (0, 1); a recording that stands still, moves for fewer than four samples, or has no times.
pub fn trim(demo: &Demonstration, threshold: f64) -> Result<Demonstration> {
    let allowed = "must lie between 0 and 1: it is a fraction of the peak speed";
    check_range("threshold", threshold, threshold > 0.0 && threshold < 1.0, allowed)?;
    let (position, curve) = (demo.position(), Curve::of(demo)?);
    let slopes = curve.splines.slopes() * curve.interval();
    let (mut speeds, mut steps, mut noise) = (vec![0.0; slopes.nrows()], vec![0.0; slopes.nrows() - 1], Vec::new());
    for (d, column) in position.columns().into_iter().enumerate() {
        let range = range(column);
        if range > 0.0 {
            let slopes = &slopes.column(d) / range;
            speeds.iter_mut().zip(&slopes).for_each(|(speed, slope)| *speed += slope * slope);
            let (residual, samples) = (&curve.noise.column(d) / range, &column / range);
            let step = |pair: ArrayView1<f64>| (pair[1] - pair[0]).powi(2);
            steps.iter_mut().zip(samples.windows(2)).for_each(|(sum, pair)| *sum += step(pair));
            let variance = slope_variance(residual.view(), (&samples - &residual).view(), slopes.view());
            noise.push(END_VARIANCE_RATIO * variance);
        }
    }
    // All speeds and thresholds are squared from here on.
    let jumps = jumps(&steps);
    let far_from_jumps = |c: &usize| jumps.iter().all(|jump| c.abs_diff(*jump) > RINGING);
    let peak = (0..speeds.len()).filter(far_from_jumps).map(|c| speeds[c]).fold(0.0, f64::max);
    let min_speed = threshold * threshold * peak;
    let deviation = (2.0 * noise.iter().map(|x| x * x).sum::<f64>()).sqrt();
    let noise_speed = noise.iter().sum::<f64>() + MIN_DEVIATIONS * deviation;
    let moves = |speed: &f64, min_speed: f64| *speed > 0.0 && *speed >= min_speed;
    let certain_speed = min_speed.max(noise_speed.min(MAX_NOISE_THRESHOLD * MAX_NOISE_THRESHOLD * peak));
    let surely_moves = |speed: &f64| moves(speed, certain_speed);
    let (Some(first), Some(last)) = (speeds.iter().position(surely_moves), speeds.iter().rposition(surely_moves))
    else {
        return Err(Error::Still { consequence: "there is no movement to trim it to" });
    };
    let first = speeds[..first].iter().rposition(|v| !moves(v, min_speed)).map_or(0, |rest| rest + 1);
    let last = speeds[last..].iter().position(|v| !moves(v, min_speed)).map_or(speeds.len(), |rest| last + rest) - 1;
    let enough = last - first + 1 >= MIN_SAMPLES_PER_DEMONSTRATION;
    check_range("threshold", threshold, enough, "leaves fewer than 4 samples; pass a lower one")?;
    let sampling = match demo.sampling() {
        Sampling::Stamped { time } => Sampling::Stamped { time: time[first..=last].to_vec() },
        uniform => uniform.clone(),
    };
    demo.sampled(position.slice(s![first..=last, ..]).to_owned(), sampling)
}

/// Returns the intervals whose squared `steps` are jumps. Relative to their speed, all movement would appear as rest.
fn jumps(steps: &[f64]) -> Vec<usize> {
    let mut sorted = steps.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let limit = MIN_JUMP * MIN_JUMP * sorted.get(MAX_JUMPS).copied().unwrap_or(f64::INFINITY);
    (0..steps.len()).filter(|&c| limit > 0.0 && steps[c] > limit).collect()
}

/// Returns the variance of the slopes of a smoothing spline in its middle due to noise, per sample².
///
/// The spline attenuates frequency ω of noise of variance σ² by 1/(1 + λω⁴). The residual r and the slope have the
/// variances
///
/// ```text
/// r² = σ²(1 − λ^(−1/4)/2√2),   ẏ² = σ²/π ∫₀^∞ ω²/(1 + λω⁴)² dω = 0.0884 σ² λ^(−3/4)
/// ```
///
/// and λ = Σr·f/∫f̈² follows from r = λQγ and fᵀQγ = γᵀRγ for the smoothed samples f.
fn slope_variance(residual: ArrayView1<f64>, smoothed: ArrayView1<f64>, slopes: ArrayView1<f64>) -> f64 {
    let n = residual.len() as f64;
    let squares = residual.dot(&residual) / n;
    let mean = smoothed.sum() / n;
    let product = residual.iter().zip(&smoothed).map(|(r, f)| r * (f - mean)).sum::<f64>();
    let roughness = slopes.windows(2).into_iter().map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let lambda = product / roughness;
    if !(squares > 0.0 && lambda.is_finite()) {
        return 0.0;
    }
    // For little smoothing the asymptotic formulas fail: the residual has at least a twentieth of the variance of the noise,
    // and the slope at most twice.
    let lambda = lambda.max(1e-10);
    let variance = squares / (1.0 - 0.125f64.sqrt() * lambda.powf(-0.25)).max(0.05);
    variance * (0.0884 * lambda.powf(-0.75)).min(2.0)
}
