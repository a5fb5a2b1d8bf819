//! Segmentation of cyclic recordings into closed cycles of common phase.

use ndarray::{Array1, Array2, s};

use super::cycle_growth::{Growth, exceeds_movement, median_gain, turns};
use super::cycle_onsets::CycleSearch;
use super::cycle_rotations::{self, with_matrices};
use super::outliers::{RejectionReason, rejections};
use super::periodicity::{period_of, traits};
use super::resampling::check_times;
use crate::demonstration::{
    Demonstration, MIN_SAMPLES_PER_DEMONSTRATION, RotationColumns, Sampling, check_rotations, layout,
};
use crate::error::{Error, Result};
use crate::numerics::statistics::median;
use crate::preprocessing::Curve;
use crate::validate::check_length;

/// Gain of a rotation per cycle in rad that is always accepted: rounding.
const MIN_TURN: f64 = 1e-9;

/// Demonstrations that are made from the cycles of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleOutput {
    /// One for each cycle.
    Each,
    /// One for each recording, the mean of its cycles.
    Mean,
}

/// Cycles of one or several recordings.
#[derive(Clone, Debug)]
pub struct Cycles {
    /// Accepted cycles, in the order of the recordings.
    pub kept: Vec<Cycle>,
    /// Cycles that differ from the others of their recording, and whole recordings without a period.
    pub rejected: Vec<Rejected>,
    /// Degrees of freedom whose gain per cycle exceeds their movement, or that turn; closed cycles lack the gain.
    pub growths: Vec<Growth>,
}

/// One cycle, or the mean cycle of a recording.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Index of the recording.
    pub recording: usize,
    /// Period, in seconds.
    pub period: f64,
    /// Gain of each DoF (D,) per cycle before it was closed, in the unit of the DoF.
    pub gain: Vec<f64>,
    /// C samples at intervals of `period`/C; the next sample would be the first one again.
    pub demo: Demonstration,
}

/// Rejected cycle, or rejected recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejected {
    /// Index of the recording.
    pub recording: usize,
    /// Start of the cycle, in seconds on the clock of the recording.
    pub start: f64,
    /// Period of the cycle, or duration of the recording, in seconds.
    pub period: f64,
    /// Reason of the rejection.
    pub reason: RejectionReason,
}

/// Segments cyclic recordings into cycles.
///
/// Without `onsets`, [`super::period`] estimates the period of each recording, and template matching the onsets of its
/// cycles, which begin in the phase of the first sample of the first recording. With `onsets`, one list of times in seconds
/// per recording, cycles extend from each onset to the next.
///
/// A cycle has C samples at the sampling rate of the recording, with the noise of the nearest recorded samples, which stays
/// white. The gain of the smoothed recording over the cycle, from f(0) to f(T), is removed linearly, which preserves the
/// mean:
///
/// ```text
/// y_c = y(cT/C) − (c/C − 1/2)(f(T) − f(0))
/// ```
///
/// For an angle that gains whole turns per cycle, such as that of a wheel, the turns of all previous cycles are subtracted
/// too, so that all cycles have a common mean. Angles are recognised by their unit; without a unit, by a gain of one turn in
/// radians or degrees to within a hundredth.
///
/// Cycles that differ from the others of their recording, in period or shape, are rejected, and so are recordings without a
/// period, unless all are. Names, units and context are kept.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling};
/// # use pdmp_core::preprocessing::{CycleOutput, cycles};
/// # fn main() -> pdmp_core::Result<()> {
/// // Five and a half periods of 0.8 s.
/// let position = Array2::from_shape_fn((440, 1), |(c, _)| (std::f64::consts::TAU * c as f64 / 80.0).sin());
/// let recording = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// let cycles = cycles(&[recording], None, CycleOutput::Each)?;
/// assert_eq!(cycles.kept.len(), 5);
/// assert!((cycles.kept[2].period - 0.8).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// No recording, no recording with a period, a recording without times, onsets that do not increase or lie outside their
/// recording.
pub fn cycles(recordings: &[Demonstration], onsets: Option<&[Vec<f64>]>, keep: CycleOutput) -> Result<Cycles> {
    let n_dofs = recordings.first().ok_or(Error::NoDemonstrations)?.n_coordinates();
    if let Some(onsets) = onsets {
        check_length("onsets", onsets.len(), recordings.len(), "recording")?;
    }
    let mut cycles = Cycles { kept: Vec::new(), rejected: Vec::new(), growths: Vec::new() };
    let (mut nominal, mut errors) = (None, Vec::new());
    for (recording, demo) in recordings.iter().enumerate() {
        let mut segment = || {
            check_rotations(demo.rotations(), recordings[0].rotations(), "recording 0")?;
            if demo.n_coordinates() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_coordinates() });
            }
            let curve = Curve::of(demo)?;
            let bounds = match onsets {
                Some(onsets) => bounds_at_onsets(&curve, &onsets[recording]),
                None => find_bounds(demo, &mut nominal),
            };
            match bounds {
                Ok((period, bounds)) => cycles.add(recording, demo, &curve, period, &bounds, keep),
                Err(error) => {
                    let Some(reason) = RejectionReason::of(&error) else { return Err(error) };
                    let (start, period) = (curve.first(), curve.last() - curve.first());
                    cycles.rejected.push(Rejected { recording, start, period, reason });
                    errors.push(error.in_demo(recording));
                    Ok(())
                }
            }
        };
        segment().map_err(|error| error.in_demo(recording))?;
    }
    if errors.len() == recordings.len() { Err(errors.swap_remove(0)) } else { Ok(cycles) }
}

/// Returns the median period and the bounds of the cycles between onsets, in seconds.
fn bounds_at_onsets(curve: &Curve, onsets: &[f64]) -> Result<(f64, Vec<f64>)> {
    check_times("onsets", onsets, curve)?;
    Ok((median(&intervals(onsets)), onsets.to_vec()))
}

/// Returns the period and the bounds of the cycles, in seconds, in phase with the `nominal` mean cycle, which the first
/// recording defines.
fn find_bounds(demo: &Demonstration, nominal: &mut Option<Array2<f64>>) -> Result<(f64, Vec<f64>)> {
    let curve = Curve::with_matrices(demo)?;
    let traits = traits(&curve)?;
    let period = period_of(traits.view(), curve.interval())?;
    let (bounds, mean) = CycleSearch { traits: traits.view(), period }.bounds(nominal.as_ref());
    nominal.get_or_insert(mean);
    let seconds = bounds.iter().map(|bound| curve.first() + bound * curve.interval()).collect();
    Ok((period * curve.interval(), seconds))
}

/// Closed cycles of one recording.
struct ClosedCycles {
    /// Positions (C, D) of each cycle.
    cycles: Vec<Array2<f64>>,
    /// Gain of each DoF in each cycle.
    gains: Vec<Array1<f64>>,
}

impl ClosedCycles {
    /// Samples and closes the cycles between successive bounds in seconds.
    fn between(curve: &Curve, bounds: &[f64], n_samples: usize, rotations: &[RotationColumns]) -> Result<Self> {
        let (mut cycles, mut gains) = (Vec::new(), Vec::new());
        for pair in bounds.windows(2) {
            let whole = curve.sample(pair[0], pair[1], n_samples + 1)?;
            let ends = curve.smooth(pair[0], pair[1], 2)?;
            let (plain, dofs) = layout(whole.ncols(), rotations);
            let mut cycle = whole.slice(s![..n_samples, ..]).to_owned();
            let mut gain = Array1::zeros(whole.ncols() - rotations.len());
            for [column, dof] in plain {
                gain[dof] = ends[[1, column]] - ends[[0, column]];
                for (c, y) in cycle.column_mut(column).iter_mut().enumerate() {
                    *y -= (c as f64 / n_samples as f64 - 0.5) * gain[dof];
                }
            }
            for (&columns, dof) in rotations.iter().zip(dofs) {
                let turned = cycle_rotations::close(&mut cycle.view_mut(), ends.view(), columns);
                gain.slice_mut(s![dof..dof + 3]).assign(&ndarray::aview1(&turned));
            }
            cycles.push(cycle);
            gains.push(gain);
        }
        Ok(Self { cycles, gains })
    }

    /// Subtracts whole turns per cycle from all later cycles; returns the DoFs that turn or whose gain exceeds their movement.
    fn remove_turns(
        &mut self,
        recording: usize,
        units: Option<&[String]>,
        rotations: &[RotationColumns],
    ) -> Vec<Growth> {
        let mut growths = Vec::new();
        let (plain, dofs) = layout(self.cycles.first().map_or(0, Array2::ncols), rotations);
        for [column, dof] in plain {
            let mean = self.gains.iter().map(|gain| gain[dof]).sum::<f64>() / self.gains.len() as f64;
            let (turns, turn) = turns(mean, units.map_or("", |units| &units[column]));
            for (k, cycle) in self.cycles.iter_mut().enumerate().filter(|_| turns != 0) {
                cycle.column_mut(column).mapv_inplace(|y| y - (k as f64 * f64::from(turns)) * turn);
            }
            let gain = median_gain(&self.gains, dof);
            if turns != 0 || exceeds_movement(gain, &self.cycles, column) {
                growths.push(Growth { recording, dof, gain, turns });
            }
        }
        for (&columns, dof) in rotations.iter().zip(dofs) {
            let gain = [0, 1, 2].map(|i| median_gain(&self.gains, dof + i));
            let movement = self.cycles.iter().map(|cycle| cycle_rotations::range(cycle.view(), columns));
            if cycle_rotations::length(gain) > movement.fold(MIN_TURN, f64::max) {
                let largest = (0..3).max_by(|&i, &j| gain[i].abs().total_cmp(&gain[j].abs())).unwrap_or(0);
                growths.push(Growth { recording, dof: dof + largest, gain: gain[largest], turns: 0 });
            }
        }
        growths
    }

    /// Returns the reasons for which cycles are rejected.
    fn rejections(&self, periods: &[f64], rotations: &[RotationColumns]) -> Vec<Option<RejectionReason>> {
        if rotations.is_empty() {
            return rejections(periods, &self.cycles, &[]);
        }
        let columns = with_matrices(self.cycles[0].view(), rotations).1;
        let values: Vec<Array2<f64>> =
            self.cycles.iter().map(|cycle| with_matrices(cycle.view(), rotations).0).collect();
        rejections(periods, &values, &columns)
    }
}

/// Returns the differences of successive bounds.
fn intervals(bounds: &[f64]) -> Vec<f64> {
    bounds.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

impl Cycles {
    /// Adds the cycles of a recording between `bounds` in seconds to the accepted or the rejected ones.
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
        let rotations = demo.rotations();
        let mut closed = ClosedCycles::between(curve, bounds, n_samples as usize, rotations)?;
        self.growths.extend(closed.remove_turns(recording, demo.units(), rotations));
        let periods = intervals(bounds);
        let mut kept = Vec::new();
        for (k, reason) in closed.rejections(&periods, rotations).into_iter().enumerate() {
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
            let own: Vec<Array2<f64>> =
                if rotations.is_empty() { Vec::new() } else { kept.iter().map(|cycle| cycle.2.clone()).collect() };
            let sum = kept.into_iter().reduce(|a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
            kept = sum.into_iter().map(|(period, gain, cycle)| (period / n, gain / n, cycle / n)).collect();
            for (_, _, mean) in &mut kept {
                rotations.iter().for_each(|&columns| cycle_rotations::average(&own, columns, mean));
            }
        }
        for (period, gain, position) in kept {
            let dt = period / position.nrows() as f64;
            let demo = demo.part(position, Sampling::Uniform { dt })?;
            self.kept.push(Cycle { recording, period, gain: gain.to_vec(), demo });
        }
        Ok(())
    }
}
