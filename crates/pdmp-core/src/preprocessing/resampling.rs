//! Uniform resampling of recordings, and splitting at given times.

use crate::demonstration::{Demonstration, MIN_SAMPLES_PER_DEMONSTRATION, Sampling};
use crate::error::{Error, Result};
use crate::preprocessing::Curve;
use crate::validate::{check_finite, check_positive, check_range};

/// Relative tolerance within which sampling intervals count as equal, for rounding and drifting clocks.
const INTERVAL_TOLERANCE: f64 = 1e-3;

/// Resamples a recording at intervals of `dt` seconds from its first sample on; the new clock starts at 0.
///
/// If `dt` is at least the sampling interval of the recording, the new samples carry the noise of the nearest recorded
/// ones, which stays white. On a denser grid they are those of the cubic spline through all samples, including the noise,
/// where a fit still detects it in thinned recordings. Smoothed samples would conceal the noise that remains in them: forty
/// noisy reaches with four styles were then fitted with five to ten.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling, preprocessing::resample};
/// # fn main() -> pdmp_core::Result<()> {
/// let time = vec![0.0, 0.11, 0.19, 0.32, 0.4];
/// let position = Array2::from_shape_fn((5, 1), |(c, _)| time[c] * 2.0);
/// let recording = Demonstration::new(position, Sampling::Stamped { time })?;
/// assert_eq!(resample(&recording, 0.1)?.sampling(), &Sampling::Uniform { dt: 0.1 });
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// An interval that is not positive or leaves fewer than four samples; a recording without times.
pub fn resample(demo: &Demonstration, dt: f64) -> Result<Demonstration> {
    check_positive("dt", dt)?;
    let curve = Curve::of(demo)?;
    let steps = ((curve.last() - curve.first()) / dt * (1.0 + 1e-12) + 1e-9).floor();
    let enough = steps >= (MIN_SAMPLES_PER_DEMONSTRATION - 1) as f64;
    check_range("dt", dt, enough, "leaves fewer than 4 samples; pass a shorter interval")?;
    // The bound avoids overflow; an allocation of that size fails with an error.
    let n = steps.min(1e18) as usize + 1;
    let (from, to) = (curve.first(), curve.first() + steps * dt);
    let denser = dt < curve.interval() * (1.0 - INTERVAL_TOLERANCE);
    let position = if denser { curve.interpolate(from, to, n) } else { curve.sample(from, to, n) }?;
    demo.sampled(position, Sampling::Uniform { dt })
}

/// Splits a recording into the parts between successive `times`, in seconds on its clock, each with both ends.
///
/// A part is resampled uniformly, at most as densely as the recording, so that it begins and ends exactly at the given
/// times. Its samples carry the noise of the nearest recorded ones, which stays white.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling, preprocessing::split_at};
/// # fn main() -> pdmp_core::Result<()> {
/// # let position = Array2::from_shape_fn((201, 1), |(c, _)| (0.05 * c as f64).sin());
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// let parts = split_at(&recording, &[0.0, 0.8, 2.0])?;
/// assert_eq!(parts.len(), 2);
/// assert_eq!(parts[0].n_samples(), 81);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Fewer than two times, times that do not increase or lie outside the recording, a part shorter than three sampling
/// intervals; a recording without times.
pub fn split_at(demo: &Demonstration, times: &[f64]) -> Result<Vec<Demonstration>> {
    let curve = Curve::of(demo)?;
    check_times("times", times, &curve)?;
    let part = |pair: &[f64]| {
        let duration = pair[1] - pair[0];
        let steps = (duration / curve.interval() * (1.0 + INTERVAL_TOLERANCE)).floor() as usize;
        let allowed = "a part must last at least three sampling intervals of the recording; leave the time out";
        check_range("times", pair[1], steps + 1 >= MIN_SAMPLES_PER_DEMONSTRATION, allowed)?;
        let dt = duration / steps as f64;
        demo.part(curve.sample(pair[0], pair[1], steps + 1)?, Sampling::Uniform { dt })
    };
    times.windows(2).map(part).collect()
}

/// Checks that there are at least two times in seconds, and that they increase within the recording.
pub(super) fn check_times(name: &'static str, times: &[f64], curve: &Curve) -> Result<()> {
    check_finite(name, times)?;
    if times.len() < 2 {
        let (found, expected) = (times.len(), 2);
        return Err(Error::Length { name, expected, found, per: "end of a part, at least" });
    }
    // Times that come from the clock of the recording may have been rounded.
    let tolerance = 1e-9 * (curve.last() - curve.first());
    for (k, &value) in times.iter().enumerate() {
        let allowed = if value < curve.first() - tolerance || value > curve.last() + tolerance {
            "must lie within the recording, on its clock"
        } else if k > 0 && value <= times[k - 1] {
            "must increase from one to the next"
        } else {
            continue;
        };
        return Err(Error::Range { name, value, allowed });
    }
    Ok(())
}
