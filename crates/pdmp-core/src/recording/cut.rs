//! Recordings at even times, and parts of them.

use ndarray::s;

use crate::demo::{Demonstration, LEAST_SAMPLES, Sampling};
use crate::error::{Error, Result, check_finite, check_positive};
use crate::recording::Curve;

/// The recording at even intervals of `dt` seconds from its first sample on; its clock starts at 0.
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
    demo.sampled(curve.sample(curve.first(), curve.first() + steps * dt, n)?, Sampling::Uniform { dt })
}

/// The movements between successive `times` [s] of the recording's clock, each with both ends.
///
/// A part is sampled anew, evenly and about as densely as the recording, so that it begins and ends at the very times
/// that are given.
///
/// # Errors
/// Fewer than two times, times that do not increase or lie outside the recording, a part shorter than three intervals;
/// a recording without times.
pub fn cut(demo: &Demonstration, times: &[f64]) -> Result<Vec<Demonstration>> {
    let curve = Curve::of(demo)?;
    check_times("times", times, &curve)?;
    let part = |pair: &[f64]| {
        let duration = pair[1] - pair[0];
        let steps = (duration / curve.interval()).round() as usize;
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

/// The part of the recording in which there is movement: from the first to the last sample whose speed is at least the
/// share `threshold` of the largest.
///
/// The speed is that of all DoFs together, v² = Σ_d (ẏ_d / (max y_d − min y_d))².
///
/// # Errors
/// A threshold outside (0, 1), a recording that stands still or moves for fewer than four samples, or without times.
pub fn trim(demo: &Demonstration, threshold: f64) -> Result<Demonstration> {
    if !(threshold > 0.0 && threshold < 1.0) {
        let allowed = "must lie between 0 and 1: it is a share of the peak speed";
        return Err(Error::Range { name: "threshold", value: threshold, allowed });
    }
    let (position, slopes) = (demo.position(), Curve::of(demo)?.splines.slopes());
    let ranges: Vec<f64> = position
        .columns()
        .into_iter()
        .map(|y| y.iter().fold(f64::MIN, |m, y| m.max(*y)) - y.iter().fold(f64::MAX, |m, y| m.min(*y)))
        .collect();
    let moving = |(slope, range): (&f64, &f64)| if *range > 0.0 { (slope / range).powi(2) } else { 0.0 };
    let speeds: Vec<f64> =
        slopes.rows().into_iter().map(|row| row.iter().zip(&ranges).map(moving).sum::<f64>().sqrt()).collect();
    let least = threshold * speeds.iter().fold(0.0, |m: f64, v| m.max(*v));
    let first = speeds.iter().position(|v| *v > 0.0 && *v >= least);
    let last = speeds.iter().rposition(|v| *v > 0.0 && *v >= least);
    let (Some(first), Some(last)) = (first, last) else {
        return Err(Error::Arguments("the recording stands still: there is no movement to trim it to"));
    };
    let sampling = match demo.sampling() {
        Sampling::Stamped { time } => Sampling::Stamped { time: time[first..=last].to_vec() },
        even => even.clone(),
    };
    demo.sampled(position.slice(s![first..=last, ..]).to_owned(), sampling)
}
