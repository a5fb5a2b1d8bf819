//! The part of a recording in which there is movement.

use ndarray::{ArrayView1, s};

use super::Curve;
use crate::demonstration::{Demonstration, LEAST_SAMPLES, Sampling};
use crate::error::{Error, Result};

/// How far above its mean the squared speed of noise counts as movement, in standard deviations: one degree of freedom
/// is then as fast by chance once in thirty thousand samples.
const MIN_DEVIATIONS: f64 = 11.0;
/// The variance of a smoothing spline's slope at an end, over that in the middle.
const END: f64 = 4.0;
/// Largest share of the peak speed that noise may take movement for rest: a rest too many is kept rather than movement cut.
const MAX_SHARE: f64 = 0.25;
/// A recording jumps where it goes this many times as far within one interval as in all but [`MAX_JUMPS`] others.
const MIN_JUMP: f64 = 10.0;
/// Jumps that are recognised; a movement has more intervals than that.
const MAX_JUMPS: usize = 3;
/// Samples over which a spline rings beside a jump, down to a hundredth of its speed.
const RINGING: usize = 4;

/// The part of the recording in which there is movement: from the first to the last sample whose speed is at least the
/// share `threshold` of the largest.
///
/// The speed is that of the smoothed recording, all DoFs together, v² = Σ_d (ẏ_d / (max y_d − min y_d))². Where noise
/// makes larger speeds than the threshold, a movement counts that surpasses noise or a quarter of the largest speed
/// somewhere, from where the threshold is passed. The largest speed is that beside jumps from one sample to the next.
///
/// # Errors
/// A threshold outside (0, 1), a recording that stands still or moves for fewer than four samples, or without times.
pub fn trim(demo: &Demonstration, threshold: f64) -> Result<Demonstration> {
    if !(threshold > 0.0 && threshold < 1.0) {
        let allowed = "must lie between 0 and 1: it is a share of the peak speed";
        return Err(Error::Range { name: "threshold", value: threshold, allowed });
    }
    let (position, curve) = (demo.position(), Curve::of(demo)?);
    let slopes = curve.splines.slopes() * curve.interval();
    let (mut speeds, mut steps, mut noise) = (vec![0.0; slopes.nrows()], vec![0.0; slopes.nrows() - 1], Vec::new());
    for (d, column) in position.columns().into_iter().enumerate() {
        let (low, high) = column.iter().fold((f64::MAX, f64::MIN), |(low, high), y| (y.min(low), y.max(high)));
        let range = high - low;
        if range > 0.0 {
            let slopes = &slopes.column(d) / range;
            speeds.iter_mut().zip(&slopes).for_each(|(speed, slope)| *speed += slope * slope);
            let (off, samples) = (&curve.noise.column(d) / range, &column / range);
            let step = |pair: ArrayView1<f64>| (pair[1] - pair[0]).powi(2);
            steps.iter_mut().zip(samples.windows(2)).for_each(|(sum, pair)| *sum += step(pair));
            noise.push(END * slope_variance(off.view(), (&samples - &off).view(), slopes.view()));
        }
    }
    let jumps = jumps(&steps);
    let calm = |c: &usize| jumps.iter().all(|jump| c.abs_diff(*jump) > RINGING);
    let peak = (0..speeds.len()).filter(calm).map(|c| speeds[c]).fold(0.0, f64::max);
    let least = threshold * threshold * peak;
    let deviation = (2.0 * noise.iter().map(|x| x * x).sum::<f64>()).sqrt();
    let limit = noise.iter().sum::<f64>() + MIN_DEVIATIONS * deviation;
    let moves = |speed: &f64, least: f64| *speed > 0.0 && *speed >= least;
    let surpasses = |speed: &f64| moves(speed, least.max(limit.min(MAX_SHARE * MAX_SHARE * peak)));
    let (Some(first), Some(last)) = (speeds.iter().position(surpasses), speeds.iter().rposition(surpasses)) else {
        return Err(Error::Arguments("the recording stands still: there is no movement to trim it to"));
    };
    let first = speeds[..first].iter().rposition(|v| !moves(v, least)).map_or(0, |rest| rest + 1);
    let last = speeds[last..].iter().position(|v| !moves(v, least)).map_or(speeds.len(), |rest| last + rest) - 1;
    if last - first + 1 < LEAST_SAMPLES {
        let allowed = "leaves fewer than 4 samples at which the recording moves as fast; pass a lower one";
        return Err(Error::Range { name: "threshold", value: threshold, allowed });
    }
    let sampling = match demo.sampling() {
        Sampling::Stamped { time } => Sampling::Stamped { time: time[first..=last].to_vec() },
        even => even.clone(),
    };
    demo.sampled(position.slice(s![first..=last, ..]).to_owned(), sampling)
}

/// Intervals whose squared steps stand out: beside the speed there all other movement would seem to rest.
fn jumps(steps: &[f64]) -> Vec<usize> {
    let mut sorted = steps.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let most = MIN_JUMP * MIN_JUMP * sorted.get(MAX_JUMPS).copied().unwrap_or(f64::INFINITY);
    (0..steps.len()).filter(|&c| most > 0.0 && steps[c] > most).collect()
}

/// The variance that noise leaves to the slopes of a smoothing spline in its middle, per sample².
///
/// Noise of variance σ² loses the share 1 − 1/(1 + λω⁴) of each frequency ω, so that on average
///
/// ```text
/// r² = σ²(1 − λ^(−1/4)/2√2),   ẏ² = σ²/π ∫₀^∞ ω²/(1 + λω⁴)² dω = 0.0884 σ² λ^(−3/4)
/// ```
///
/// and with r = λQγ and fᵀQγ = γᵀRγ the λ of the fit is Σr·f/∫f̈².
fn slope_variance(noise: ArrayView1<f64>, smoothed: ArrayView1<f64>, slopes: ArrayView1<f64>) -> f64 {
    let n = noise.len() as f64;
    let squares = noise.dot(&noise) / n;
    let middle = smoothed.sum() / n;
    let product = noise.iter().zip(&smoothed).map(|(r, f)| r * (f - middle)).sum::<f64>();
    let roughness = slopes.windows(2).into_iter().map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let lambda = product / roughness;
    if !(squares > 0.0 && lambda.is_finite()) {
        return 0.0;
    }
    // A spline that is hardly smoothed keeps at least a twentieth of the noise off, and has slopes as large as noise.
    let lambda = lambda.max(1e-10);
    let variance = squares / (1.0 - 0.125f64.sqrt() * lambda.powf(-0.25)).max(0.05);
    variance * (0.0884 * lambda.powf(-0.75)).min(2.0)
}
