//! Preprocessing of recordings to demonstrations.

use numpy::IntoPyArray;
use pdmp_core::preprocessing;
use pdmp_core::preprocessing::{CycleOutput, RejectionReason};
use pyo3::prelude::*;

use crate::choice::Choice;
use crate::convert::{Matrix, Vector, items, matrix, texts, to_numpy, vector};
use crate::demonstration::Demonstration;
use crate::error::raise;
use crate::fit::demonstrations;
use crate::instance;
use crate::scalar::Scalar;

/// Resamples a recording at even intervals.
///
/// The samples are at t₀, t₀ + dt, … up to the end of the recording; the returned clock starts at 0. On a grid no
/// denser than the recording, samples are those of the cubic smoothing spline of generalised cross-validation plus the
/// residuals of the nearest recorded samples: noise stays white, so that a fit can still smooth it. A denser grid
/// samples the spline through all samples. Remove frequencies above 1/(2 dt) with `lowpass` first.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// dt : float
///     Sampling interval in s.
///
/// Returns
/// -------
/// Demonstration
///     Recording with the same names, units, context and goal.
///
/// Raises
/// ------
/// ValueError
///     `dt` is not positive or leaves fewer than four samples, or the recording has no times.
#[pyfunction]
pub(crate) fn resample(py: Python<'_>, demo: &Bound<'_, PyAny>, dt: Scalar<'_>) -> PyResult<Demonstration> {
    let demo = instance::demonstration("demo", demo)?;
    let dt = dt.number("dt")?;
    py.detach(|| preprocessing::resample(demo, dt)).map(Demonstration).map_err(raise)
}

/// Trims the rests before and after the movement of a recording.
///
/// The movement extends from the first to the last sample with a speed of at least `threshold` times the peak speed,
/// where v² = Σ_d (ẏ_d / (max y_d − min y_d))² of the smoothed recording (generalised cross-validation). If noise
/// exceeds the threshold, only stretches above the threshold that also exceed the noise count. The samples remain as
/// recorded.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// threshold : float
///     Share of the peak speed, in (0, 1).
///
/// Returns
/// -------
/// Demonstration
///     Recording with the same names, units, context, goal and time stamps.
///
/// Raises
/// ------
/// ValueError
///     `threshold` is out of range, or the recording has no movement, fewer than four samples of it, or no times.
#[pyfunction]
#[pyo3(signature = (demo, threshold=Scalar::Number(0.05)), text_signature = "(demo, threshold=0.05)")]
pub(crate) fn trim(py: Python<'_>, demo: &Bound<'_, PyAny>, threshold: Scalar<'_>) -> PyResult<Demonstration> {
    let demo = instance::demonstration("demo", demo)?;
    let threshold = threshold.number("threshold")?;
    py.detach(|| preprocessing::trim(demo, threshold)).map(Demonstration).map_err(raise)
}

/// Cuts a recording at given times.
///
/// Each part extends from one time to the next, both included. It is sampled evenly, at most as densely as the
/// recording. As with `resample`, noise stays white.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// times : array_like, (K,)
///     Two or more increasing times in s on the clock of the recording.
///
/// Returns
/// -------
/// list of Demonstration
///     K − 1 parts with the same names, units and context.
///
/// Raises
/// ------
/// ValueError
///     `times` do not increase or lie outside the recording, a part is shorter than three sampling intervals, or the
///     recording has no times.
#[pyfunction]
pub(crate) fn split_at(
    py: Python<'_>,
    demo: &Bound<'_, PyAny>,
    times: &Bound<'_, PyAny>,
) -> PyResult<Vec<Demonstration>> {
    let demo = instance::demonstration("demo", demo)?;
    let times = vector("times", times)?;
    let parts = py.detach(|| preprocessing::split_at(demo, &times)).map_err(raise)?;
    Ok(parts.into_iter().map(Demonstration).collect())
}

/// Filters a recording with a low-pass of zero phase.
///
/// The filter is the cubic smoothing spline, with gain 1/(1 + (f/f_c)⁴) at frequency f: one half at the cut-off f_c.
/// `pdmp.plot.cut_off` plots residuals over the cut-off.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`, even or not.
/// cut_off : float
///     Cut-off frequency in Hz.
///
/// Returns
/// -------
/// Demonstration
///     Recording at the same times, with the same names, units, context and goal.
///
/// Raises
/// ------
/// ValueError
///     `cut_off` is not between a ten-thousandth and half of the sampling rate, or the recording has no times.
///
/// References
/// ----------
/// C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967), https://doi.org/10.1007/BF02162161
#[pyfunction]
pub(crate) fn lowpass(py: Python<'_>, demo: &Bound<'_, PyAny>, cut_off: Scalar<'_>) -> PyResult<Demonstration> {
    let demo = instance::demonstration("demo", demo)?;
    let cut_off = cut_off.number("cut_off")?;
    py.detach(|| preprocessing::lowpass(demo, cut_off)).map(Demonstration).map_err(raise)
}

/// Computes the residuals of `lowpass` over its cut-off.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// cut_offs : array_like, (K,)
///     Cut-off frequencies in Hz.
///
/// Returns
/// -------
/// ndarray, (K, D)
///     Root mean square of the residual, in the unit of each degree of freedom.
///
/// Raises
/// ------
/// ValueError
///     A cut-off that `lowpass` rejects, or a recording without times.
#[pyfunction]
pub(crate) fn residuals<'py>(
    py: Python<'py>,
    demo: &Bound<'_, PyAny>,
    cut_offs: &Bound<'py, PyAny>,
) -> PyResult<Matrix<'py>> {
    let demo = instance::demonstration("demo", demo)?;
    let cut_offs = vector("cut_offs", cut_offs)?;
    let residuals = py.detach(|| preprocessing::residuals(demo, &cut_offs)).map_err(raise)?;
    Ok(residuals.into_pyarray(py))
}

/// Returns a full turn in a unit of angles, "rad", "deg", "°" or their names, and None for other units.
///
/// Parameters
/// ----------
/// unit : str
///     Unit of a degree of freedom.
///
/// Raises
/// ------
/// TypeError
///     `unit` is not a string.
#[pyfunction]
pub(crate) fn turn_of(unit: &str) -> Option<f64> {
    pdmp_core::demonstration::turn_of(unit)
}

/// Estimates the period of a cyclic recording by autocorrelation.
///
/// A(k) is the mean autocorrelation at lag k of the positions and velocities of all degrees of freedom, after removal
/// of linear trends. The period is the first peak of A that equals the highest peak within the variation between
/// cycles, at the vertex of the parabola through three samples; peaks at half a cycle and at periods of harmonics are
/// lower. A peak must exceed the significance level for noise of the same autocorrelation, which rises as fewer
/// independent samples overlap.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording of one and a half cycles or more, with `dt` or `time`.
///
/// Returns
/// -------
/// float
///     Period in s.
///
/// Raises
/// ------
/// ValueError
///     All peaks are below 0.35 or not significant, or the recording has no movement or no times.
///
/// References
/// ----------
/// P. McLeod, G. Wyvill, A smarter way to find pitch, International Computer Music Conference 2005
#[pyfunction]
pub(crate) fn period(py: Python<'_>, demo: &Bound<'_, PyAny>) -> PyResult<f64> {
    let demo = instance::demonstration("demo", demo)?;
    py.detach(|| preprocessing::period(demo)).map_err(raise)
}

/// Interpolates missing samples.
///
/// Parameters
/// ----------
/// position : array_like, (T, D)
///     Positions in the unit of each degree of freedom, NaN where missing.
/// time : array_like, (T,)
///     Time stamps in s.
/// names : sequence of str, (D,)
///     Names of the degrees of freedom.
/// turns : array_like, (D,)
///     Full turn of each angle in its unit, 0 for other units, NaN if the unit is unknown.
/// max_gap : float
///     Longest gap in s that is interpolated.
///
/// Returns
/// -------
/// ndarray, (T, D)
///     Positions without missing samples.
///
/// Raises
/// ------
/// ValueError
///     A gap is longer than `max_gap`, or lies at an end; or time stamps are further apart than a
///     positive `max_gap` and than five usual intervals.
#[pyfunction]
pub(crate) fn fill_gaps<'py>(
    py: Python<'py>,
    position: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
    names: &Bound<'py, PyAny>,
    turns: &Bound<'py, PyAny>,
    max_gap: Scalar<'py>,
) -> PyResult<Matrix<'py>> {
    let (position, time) = (matrix("position", "(T, D)", position)?, vector("time", time)?);
    let (names, turns) = (texts("names", names)?, vector("turns", turns)?);
    let max_gap = max_gap.number("max_gap")?;
    let filled = preprocessing::fill_gaps(position, &time, &names, &turns, max_gap).map_err(raise)?;
    Ok(filled.into_pyarray(py))
}

/// Rejected cycle or recording: index of the recording, start and period in s, the reason, and whether it is the whole
/// recording.
type Rejected = (usize, f64, f64, String, bool);
/// Indices of a recording and of a degree of freedom, its gain per cycle, and the number of full turns subtracted from
/// it.
type Growth = (usize, usize, f64, i32);
/// Cycles, their periods (K,) in s, their gains (K, D), the indices of their recordings, rejections and growths.
type CutCycles<'py> = (Vec<Demonstration>, Vector<'py>, Vec<Vec<f64>>, Vec<usize>, Vec<Rejected>, Vec<Growth>);

/// Cuts recordings into cycles, for `pdmp.preprocessing.cycles`.
///
/// Parameters
/// ----------
/// recordings : sequence of Demonstration
///     Recordings with `dt` or `time`.
/// onsets : list of array_like, (K,), or None
///     Times in s at which the cycles of each recording begin; the last ends the last cycle.
/// average : bool
///     Return one mean cycle of each recording.
///
/// Returns
/// -------
/// tuple
///     Cycles, their periods (K,) in s, their gains (K, D) in the unit of each degree of freedom, the indices of their
///     recordings, the rejected cycles and the growths.
///
/// Raises
/// ------
/// ValueError
///     Recordings without a period or without times, or invalid onsets.
#[pyfunction]
pub(crate) fn cycles<'py>(
    py: Python<'py>,
    recordings: &Bound<'py, PyAny>,
    onsets: Option<&Bound<'py, PyAny>>,
    average: Choice<'py>,
) -> PyResult<CutCycles<'py>> {
    let recordings = demonstrations("recordings", recordings)?;
    let onsets = onsets.map(|onsets| items("onsets", onsets, vector)).transpose()?;
    let output = if average.flag("average")? { CycleOutput::Mean } else { CycleOutput::Each };
    let cycles = py.detach(|| preprocessing::cycles(&recordings, onsets.as_deref(), output)).map_err(raise)?;
    let periods: Vec<f64> = cycles.kept.iter().map(|cycle| cycle.period).collect();
    let indices = cycles.kept.iter().map(|cycle| cycle.recording).collect();
    let rejected = cycles.rejected.iter().map(|cycle| {
        let whole = matches!(cycle.reason, RejectionReason::Aperiodic { .. } | RejectionReason::Still);
        (cycle.recording, cycle.start, cycle.period, cycle.reason.to_string(), whole)
    });
    let rejected = rejected.collect();
    let growths =
        cycles.growths.iter().map(|growth| (growth.recording, growth.dof, growth.gain, growth.turns)).collect();
    let gains = cycles.kept.iter().map(|cycle| cycle.gain.clone()).collect();
    let demos = cycles.kept.into_iter().map(|cycle| Demonstration(cycle.demo)).collect();
    Ok((demos, to_numpy(py, &periods), gains, indices, rejected, growths))
}
