//! From cyclic recordings to closed cycles in one phase.

use ndarray::{Array1, Array2, Axis, s};

use super::cut::check_times;
use super::odd::{Reason, median, odd};
use super::repetition::{period_of, traits};
use super::track::Track;
use crate::demo::{Demonstration, LEAST_SAMPLES, Sampling};
use crate::error::{Error, Result};
use crate::recording::Curve;

/// What becomes of the cycles of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Each is a demonstration.
    Each,
    /// Their mean is one.
    Mean,
}

/// The cycles of one or several recordings.
#[derive(Clone, Debug)]
pub struct Cycles {
    /// Those that are kept, in the order of the recordings.
    pub kept: Vec<Cycle>,
    /// Those that are unlike the others of their recording.
    pub rejected: Vec<Rejected>,
}

/// One cycle, or the mean of those of a recording.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Index of the recording.
    pub recording: usize,
    /// Its period, in seconds.
    pub period: f64,
    /// C samples `period`/C apart, closed: the next would be the first again.
    pub demo: Demonstration,
}

/// A cycle that is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejected {
    /// Index of the recording.
    pub recording: usize,
    /// When it begins, in seconds on the recording's clock.
    pub start: f64,
    /// Its period, in seconds.
    pub period: f64,
    /// What is odd about it.
    pub reason: Reason,
}

/// Cuts cyclic recordings into cycles.
///
/// Without `events`, the period of each recording is found by [`super::period`], and its cycles by a template. They
/// begin in the phase of the first recording's first sample. With `events`, one list for each recording, they begin at
/// the times [s] that are given, and end where the next begins.
///
/// A cycle is C samples of the recording's spline, C as the first recording has in a period. Where it ends elsewhere
/// than it began, at y(T) rather than y(0), the drift is distributed over it, and its mean stays:
///
/// ```text
/// y_c = y(cT/C) − (c/C − 1/2)(y(T) − y(0))
/// ```
///
/// Cycles unlike the others of their recording, in period or shape, are rejected. Names, units and context go along.
///
/// # Errors
/// No recording, a recording that does not repeat itself or has no times, events that do not increase or lie outside.
pub fn cycles(recordings: &[Demonstration], events: Option<&[Vec<f64>]>, keep: Keep) -> Result<Cycles> {
    let n_dofs = recordings.first().ok_or(Error::NoDemonstrations)?.n_dofs();
    if let Some(found) = events.map(<[_]>::len).filter(|&found| found != recordings.len()) {
        return Err(Error::Length { name: "events", expected: recordings.len(), found, per: "recording" });
    }
    let mut cycles = Cycles { kept: Vec::new(), rejected: Vec::new() };
    let (mut nominal, mut n_samples) = (None, None);
    for (recording, demo) in recordings.iter().enumerate() {
        let mut cut = || {
            if demo.n_dofs() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_dofs() });
            }
            let curve = Curve::of(demo)?;
            let (period, bounds) = match events {
                Some(events) => given(&curve, &events[recording])?,
                None => found(&curve, &mut nominal)?,
            };
            let n_samples = n_samples.get_or_insert((period / curve.interval()).round().max(LEAST_SAMPLES as f64));
            if bounds.len() < 2 {
                let start = bounds.first().copied().unwrap_or(curve.first());
                cycles.rejected.push(Rejected { recording, start, period, reason: Reason::Phase });
            }
            cycles.add(recording, demo, &closed(&curve, &bounds, *n_samples as usize)?, &bounds, keep)
        };
        cut().map_err(|error| error.in_demo(recording))?;
    }
    Ok(cycles)
}

/// Median period and bounds of the cycles between given events, in seconds.
fn given(curve: &Curve, events: &[f64]) -> Result<(f64, Vec<f64>)> {
    check_times("events", events, curve)?;
    Ok((median(&intervals(events)), events.to_vec()))
}

/// Period and bounds of the cycles that are found in the phase of the `nominal` mean cycle, in seconds.
fn found(curve: &Curve, nominal: &mut Option<Array2<f64>>) -> Result<(f64, Vec<f64>)> {
    let traits = traits(curve)?;
    let period = period_of(traits.view(), curve.interval())?;
    let (bounds, mean) = Track { traits: traits.view(), period }.bounds(nominal.as_ref());
    nominal.get_or_insert(mean);
    let seconds = bounds.iter().map(|bound| curve.first() + bound * curve.interval()).collect();
    Ok((period * curve.interval(), seconds))
}

/// The cycles (C, D) between successive bounds [s], their drift distributed.
fn closed(curve: &Curve, bounds: &[f64], n_samples: usize) -> Result<Vec<Array2<f64>>> {
    let close = |pair: &[f64]| {
        let whole = curve.sample(pair[0], pair[1], n_samples + 1)?;
        let drift = &whole.row(n_samples) - &whole.row(0);
        let ramp = Array1::from_shape_fn(n_samples, |c| c as f64 / n_samples as f64 - 0.5).insert_axis(Axis(1));
        Ok(&whole.slice(s![..n_samples, ..]) - &(ramp * drift))
    };
    bounds.windows(2).map(close).collect()
}

fn intervals(bounds: &[f64]) -> Vec<f64> {
    bounds.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

impl Cycles {
    /// Adds the cycles of a recording, those that are odd to the rejected.
    fn add(
        &mut self,
        recording: usize,
        demo: &Demonstration,
        closed: &[Array2<f64>],
        bounds: &[f64],
        keep: Keep,
    ) -> Result<()> {
        let periods = intervals(bounds);
        let mut kept = Vec::new();
        for (k, reason) in odd(&periods, closed).into_iter().enumerate() {
            match reason {
                Some(reason) => {
                    let (start, period) = (bounds[k], periods[k]);
                    self.rejected.push(Rejected { recording, start, period, reason });
                }
                None => kept.push((periods[k], closed[k].clone())),
            }
        }
        if keep == Keep::Mean && !kept.is_empty() {
            let n = kept.len() as f64;
            let mean = kept.iter().skip(1).fold(kept[0].1.clone(), |sum, (_, cycle)| sum + cycle) / n;
            kept = vec![(kept.iter().map(|(period, _)| period).sum::<f64>() / n, mean)];
        }
        for (period, position) in kept {
            let dt = period / position.nrows() as f64;
            let demo = demo.part(position, Sampling::Uniform { dt })?;
            self.kept.push(Cycle { recording, period, demo });
        }
        Ok(())
    }
}
