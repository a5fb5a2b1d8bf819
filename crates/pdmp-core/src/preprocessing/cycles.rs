//! From cyclic recordings to closed cycles in one phase.

use ndarray::{Array1, Array2, Axis, s};

use super::cycle_growth::{Growth, surpasses, turns, typical};
use super::cycle_onsets::Track;
use super::outliers::{RejectionReason, median, odd};
use super::periodicity::{period_of, traits};
use super::resampling::check_times;
use crate::demonstration::{Demonstration, MIN_SAMPLES_PER_DEMONSTRATION, Sampling};
use crate::error::{Error, Result};
use crate::preprocessing::Curve;

/// What becomes of the cycles of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleOutput {
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
    /// Those that are unlike the others of their recording, and whole recordings that do not repeat themselves.
    pub rejected: Vec<Rejected>,
    /// What gains more in each cycle than it moves within, or turns: closed cycles lack it.
    pub growths: Vec<Growth>,
}

/// One cycle, or the mean of those of a recording.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Index of the recording.
    pub recording: usize,
    /// Its period, in seconds.
    pub period: f64,
    /// What each DoF (D,) gained from its beginning to its end before it was closed, in the unit of the DoF.
    pub gain: Vec<f64>,
    /// C samples `period`/C apart, closed: the next would be the first again.
    pub demo: Demonstration,
}

/// A cycle that is left out, or a whole recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejected {
    /// Index of the recording.
    pub recording: usize,
    /// When it begins, in seconds on the recording's clock.
    pub start: f64,
    /// Its period, or the duration of the recording, in seconds.
    pub period: f64,
    /// What is odd about it.
    pub reason: RejectionReason,
}

/// Cuts cyclic recordings into cycles.
///
/// Without `onsets`, the period of each recording is found by [`super::period`], and its cycles by a template. They
/// begin in the phase of the first recording's first sample. With `onsets`, one list for each recording, they begin at
/// the times [s] that are given, and end where the next begins.
///
/// A cycle is C samples of the recording, as many as that has in a period, with the noise of the nearest recorded
/// samples, which stays white. Where its smoothed course ends elsewhere than it began, at f(T) rather than f(0), the gain
/// is distributed over it, and its mean stays:
///
/// ```text
/// y_c = y(cT/C) − (c/C − 1/2)(f(T) − f(0))
/// ```
///
/// An angle that gains whole turns per cycle, such as that of a wheel, loses them from each cycle to the next too, so that
/// all cycles are about one mean. Units tell what is an angle; without units, a gain of one turn in radians or degrees to
/// a hundredth does.
///
/// Cycles unlike the others of their recording, in period or shape, are rejected, and so are recordings that do not
/// repeat themselves, unless none does. Names, units and context go along.
///
/// # Errors
/// No recording, none that repeats itself, one without times, onsets that do not increase or lie outside.
pub fn cycles(recordings: &[Demonstration], onsets: Option<&[Vec<f64>]>, keep: CycleOutput) -> Result<Cycles> {
    let n_dofs = recordings.first().ok_or(Error::NoDemonstrations)?.n_dofs();
    if let Some(found) = onsets.map(<[_]>::len).filter(|&found| found != recordings.len()) {
        return Err(Error::Length { name: "onsets", expected: recordings.len(), found, per: "recording" });
    }
    let mut cycles = Cycles { kept: Vec::new(), rejected: Vec::new(), growths: Vec::new() };
    let (mut nominal, mut refusals) = (None, Vec::new());
    for (recording, demo) in recordings.iter().enumerate() {
        let mut cut = || {
            if demo.n_dofs() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_dofs() });
            }
            let curve = Curve::of(demo)?;
            let found = match onsets {
                Some(onsets) => given(&curve, &onsets[recording]),
                None => found(&curve, &mut nominal),
            };
            match found {
                Ok((period, bounds)) => cycles.add(recording, demo, &curve, period, &bounds, keep),
                Err(error) => {
                    let Some(reason) = RejectionReason::of(&error) else { return Err(error) };
                    let (start, period) = (curve.first(), curve.last() - curve.first());
                    cycles.rejected.push(Rejected { recording, start, period, reason });
                    refusals.push(error.in_demo(recording));
                    Ok(())
                }
            }
        };
        cut().map_err(|error| error.in_demo(recording))?;
    }
    if refusals.len() == recordings.len() { Err(refusals.swap_remove(0)) } else { Ok(cycles) }
}

/// Median period and bounds of the cycles between given onsets, in seconds.
fn given(curve: &Curve, onsets: &[f64]) -> Result<(f64, Vec<f64>)> {
    check_times("onsets", onsets, curve)?;
    Ok((median(&intervals(onsets)), onsets.to_vec()))
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

/// The cycles between successive bounds, closed.
struct Closed {
    /// Positions (C, D) of each.
    cycles: Vec<Array2<f64>>,
    /// What each DoF (D,) gains in each.
    gains: Vec<Array1<f64>>,
}

impl Closed {
    fn between(curve: &Curve, bounds: &[f64], n_samples: usize) -> Result<Self> {
        let (mut cycles, mut gains) = (Vec::new(), Vec::new());
        for pair in bounds.windows(2) {
            let whole = curve.sample(pair[0], pair[1], n_samples + 1)?;
            let ends = curve.smooth(pair[0], pair[1], 2)?;
            let gain = &ends.row(1) - &ends.row(0);
            let ramp = Array1::from_shape_fn(n_samples, |c| c as f64 / n_samples as f64 - 0.5).insert_axis(Axis(1));
            cycles.push(&whole.slice(s![..n_samples, ..]) - &(ramp * &gain));
            gains.push(gain);
        }
        Ok(Self { cycles, gains })
    }

    /// Takes whole turns off each cycle and all that follow; returns the growth of DoFs that turn or gain much.
    fn turn_back(&mut self, recording: usize, units: Option<&[String]>) -> Vec<Growth> {
        let mut growths = Vec::new();
        for dof in 0..self.gains.first().map_or(0, Array1::len) {
            let mean = self.gains.iter().map(|gain| gain[dof]).sum::<f64>() / self.gains.len() as f64;
            let (turns, turn) = turns(mean, units.map_or("", |units| &units[dof]));
            for (k, cycle) in self.cycles.iter_mut().enumerate().filter(|_| turns != 0) {
                cycle.column_mut(dof).mapv_inplace(|y| y - (k as f64 * f64::from(turns)) * turn);
            }
            let gain = typical(&self.gains, dof);
            if turns != 0 || surpasses(gain, &self.cycles, dof) {
                growths.push(Growth { recording, dof, gain, turns });
            }
        }
        growths
    }
}

fn intervals(bounds: &[f64]) -> Vec<f64> {
    bounds.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

impl Cycles {
    /// Adds the cycles of a recording between `bounds` [s], those that are odd to the rejected.
    fn add(
        &mut self,
        recording: usize,
        demo: &Demonstration,
        curve: &Curve,
        period: f64,
        bounds: &[f64],
        keep: CycleOutput,
    ) -> Result<()> {
        if bounds.len() < 2 {
            let start = bounds.first().copied().unwrap_or(curve.first());
            self.rejected.push(Rejected { recording, start, period, reason: RejectionReason::Phase });
            return Ok(());
        }
        let n_samples = (period / curve.interval()).round().max(MIN_SAMPLES_PER_DEMONSTRATION as f64);
        let mut closed = Closed::between(curve, bounds, n_samples as usize)?;
        self.growths.extend(closed.turn_back(recording, demo.units()));
        let periods = intervals(bounds);
        let mut kept = Vec::new();
        for (k, reason) in odd(&periods, &closed.cycles).into_iter().enumerate() {
            match reason {
                Some(reason) => {
                    let (start, period) = (bounds[k], periods[k]);
                    self.rejected.push(Rejected { recording, start, period, reason });
                }
                None => kept.push((periods[k], closed.gains[k].clone(), closed.cycles[k].clone())),
            }
        }
        if keep == CycleOutput::Mean {
            let n = kept.len() as f64;
            let sum = kept.into_iter().reduce(|a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
            kept = sum.into_iter().map(|(period, gain, cycle)| (period / n, gain / n, cycle / n)).collect();
        }
        for (period, gain, position) in kept {
            let dt = period / position.nrows() as f64;
            let demo = demo.part(position, Sampling::Uniform { dt })?;
            self.kept.push(Cycle { recording, period, gain: gain.to_vec(), demo });
        }
        Ok(())
    }
}
