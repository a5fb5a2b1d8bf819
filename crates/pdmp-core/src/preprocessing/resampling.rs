//! Recordings at even times, and parts of them.

use crate::demonstration::{Demonstration, LEAST_SAMPLES, Sampling};
use crate::error::{Error, Result};
use crate::preprocessing::Curve;
use crate::validate::{check_finite, check_positive};

/// Share of an interval by which another may be shorter and still count as equal: rounding, and drifting clocks.
const SLACK: f64 = 1e-3;

/// The recording at even intervals of `dt` seconds from its first sample on; its clock starts at 0.
///
/// No denser than it was recorded, the new samples carry the noise of the nearest ones, which stays white. On a denser
/// grid they are those of the cubic spline through all samples, noise included: a fit, which looks for noise in thinned
/// recordings, finds it there. Smoothed samples would hide what noise leaves in them: forty noisy reaches of four styles
/// then had five to ten.
///
/// # Errors
/// An interval that is not positive or leaves fewer than four samples; a recording without times.
pub fn resample(demo: &Demonstration, dt: f64) -> Result<Demonstration> {
    check_positive("dt", dt)?;
    let curve = Curve::of(demo)?;
    let steps = ((curve.last() - curve.first()) / dt * (1.0 + 1e-12) + 1e-9).floor();
    if steps < (LEAST_SAMPLES - 1) as f64 {
        return Err(Error::Range {
            name: "dt",
            value: dt,
            allowed: "leaves fewer than 4 samples; pass a shorter interval",
        });
    }
    // Numbers beyond any memory are refused where memory is asked for.
    let n = steps.min(1e18) as usize + 1;
    let (from, to) = (curve.first(), curve.first() + steps * dt);
    let denser = dt < curve.interval() * (1.0 - SLACK);
    let position = if denser { curve.interpolate(from, to, n) } else { curve.sample(from, to, n) }?;
    demo.sampled(position, Sampling::Uniform { dt })
}

/// The movements between successive `times`, in seconds of the recording's clock, each with both ends.
///
/// A part is sampled anew, evenly and as densely as the recording at most, so that it begins and ends at the very times
/// that are given. Its samples carry the noise of the nearest recorded ones, which stays white.
///
/// # Errors
/// Fewer than two times, times that do not increase or lie outside the recording, a part shorter than three intervals;
/// a recording without times.
pub fn cut(demo: &Demonstration, times: &[f64]) -> Result<Vec<Demonstration>> {
    let curve = Curve::of(demo)?;
    check_times("times", times, &curve)?;
    let part = |pair: &[f64]| {
        let duration = pair[1] - pair[0];
        let steps = (duration / curve.interval() * (1.0 + SLACK)).floor() as usize;
        if steps + 1 < LEAST_SAMPLES {
            let allowed = "a part must last at least three sampling intervals of the recording; leave the time out";
            return Err(Error::Range { name: "times", value: pair[1], allowed });
        }
        let dt = duration / steps as f64;
        demo.part(curve.sample(pair[0], pair[1], steps + 1)?, Sampling::Uniform { dt })
    };
    times.windows(2).map(part).collect()
}

/// Checks times [s] that divide a recording.
pub(super) fn check_times(name: &'static str, times: &[f64], curve: &Curve) -> Result<()> {
    check_finite(name, times)?;
    if times.len() < 2 {
        let (found, expected) = (times.len(), 2);
        return Err(Error::Length { name, expected, found, per: "end of a part, at least" });
    }
    // A time read off the clock may differ from it by rounding.
    let slack = 1e-9 * (curve.last() - curve.first());
    for (k, &value) in times.iter().enumerate() {
        let allowed = if value < curve.first() - slack || value > curve.last() + slack {
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
