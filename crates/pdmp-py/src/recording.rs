//! From recordings to demonstrations.

use numpy::IntoPyArray;
use pdmp_core::preprocessing;
use pdmp_core::preprocessing::{CycleOutput, RejectionReason};
use pyo3::prelude::*;

use crate::convert::{Matrix, Vector, items, matrix, texts, to_numpy, vector};
use crate::demo::Demonstration;
use crate::error::raise;
use crate::fit::demonstrations;

/// Sample a recording anew, at even intervals.
///
/// Samples at t₀, t₀ + dt, … as far as the recording goes; the clock of what is returned starts at 0. Of irregular time
/// stamps it makes even ones. They are those of the cubic smoothing spline that generalised cross-validation chooses,
/// which meets clean samples. No denser than the recording, they also carry what smoothing takes off the nearest recorded
/// ones: noise stays white, and a fit can still smooth it. A denser grid is that of the spline through all samples. Frequencies above 1/(2 dt) are to be
/// taken off first, by `lowpass`.
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
///     With its names, units, context and goal.
///
/// Raises
/// ------
/// ValueError
///     An interval that is not positive or leaves fewer than four samples, or a recording without times.
#[pyfunction]
pub(crate) fn resample(py: Python<'_>, demo: &Demonstration, dt: f64) -> PyResult<Demonstration> {
    py.detach(|| preprocessing::resample(&demo.0, dt)).map(Demonstration).map_err(raise)
}

/// Keep the part of a recording in which there is movement.
///
/// That is from the first to the last sample whose speed is at least the share `threshold` of the largest, with the
/// speed of all degrees of freedom together, v² = Σ_d (ẏ_d / (max y_d − min y_d))², of the recording as generalised
/// cross-validation smooths it. Where noise is faster than the threshold, a movement counts that surpasses noise
/// somewhere, from where the threshold is passed. The samples stay as they were recorded.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// threshold : float
///     Share of the peak speed, between 0 and 1.
///
/// Returns
/// -------
/// Demonstration
///     With its names, units, context and goal. Time stamps stay as they are.
///
/// Raises
/// ------
/// ValueError
///     A threshold that is no share, or a recording that stands still, moves for fewer than four samples, or has no
///     times.
#[pyfunction]
#[pyo3(signature = (demo, threshold=0.05))]
pub(crate) fn trim(py: Python<'_>, demo: &Demonstration, threshold: f64) -> PyResult<Demonstration> {
    py.detach(|| preprocessing::trim(&demo.0, threshold)).map(Demonstration).map_err(raise)
}

/// Cut a recording at given times into one movement from each to the next.
///
/// Each is sampled evenly, as densely as the recording at most, with both ends: it begins and ends at the very times that
/// are given. As with `resample`, noise stays white.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording with `dt` or `time`.
/// times : (K,) array_like
///     At least two times in s of the recording's clock, increasing.
///
/// Returns
/// -------
/// list of Demonstration
///     K − 1 of them, with the names, units and context.
///
/// Raises
/// ------
/// ValueError
///     Times that do not increase or lie outside, a part shorter than three sampling intervals, or a recording without
///     times.
#[pyfunction]
pub(crate) fn cut(py: Python<'_>, demo: &Demonstration, times: &Bound<'_, PyAny>) -> PyResult<Vec<Demonstration>> {
    let times = vector("times", times)?;
    let parts = py.detach(|| preprocessing::split_at(&demo.0, &times)).map_err(raise)?;
    Ok(parts.into_iter().map(Demonstration).collect())
}

/// Filter a recording by a low-pass without phase lag.
///
/// It is the cubic smoothing spline: of a sine of frequency f the share 1/(1 + (f/f_c)⁴) is left, half at the cut-off
/// f_c. `pdmp.plot.cut_off` draws what helps to choose that.
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
///     At the same times, with its names, units, context and goal.
///
/// Raises
/// ------
/// ValueError
///     A cut-off that is not positive, not below half the sampling rate or below a ten-thousandth of it, or a recording
///     without times.
///
/// References
/// ----------
/// C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967), https://doi.org/10.1007/BF02162161
#[pyfunction]
pub(crate) fn lowpass(py: Python<'_>, demo: &Demonstration, cut_off: f64) -> PyResult<Demonstration> {
    py.detach(|| preprocessing::lowpass(&demo.0, cut_off)).map(Demonstration).map_err(raise)
}

/// What `lowpass` takes off at each of K cut-offs [Hz]: root mean squares (K, D), in the unit of each degree of freedom.
#[pyfunction]
pub(crate) fn residuals<'py>(
    py: Python<'py>,
    demo: &Demonstration,
    cut_offs: &Bound<'py, PyAny>,
) -> PyResult<Matrix<'py>> {
    let cut_offs = vector("cut_offs", cut_offs)?;
    let residuals = py.detach(|| preprocessing::residuals(&demo.0, &cut_offs)).map_err(raise)?;
    Ok(residuals.into_pyarray(py))
}

/// Find the period of a cyclic recording.
///
/// Positions and velocities of all degrees of freedom, each less its linear trend, are correlated with themselves k
/// samples later; A(k) is the mean of these correlations. The period is the first peak of A that is as high as the
/// highest, but for what varies from cycle to cycle; half a cycle, and the period of a harmonic, make lower ones, and
/// an odd cycle is no matter. A parabola finds it to a part of a sample. Peaks that noise of the same memory makes by
/// chance are none: the fewer independent samples overlap, the higher a peak must be.
///
/// Parameters
/// ----------
/// demo : Demonstration
///     A recording of at least one cycle and a half, with `dt` or `time`.
///
/// Returns
/// -------
/// float
///     The period in s.
///
/// Raises
/// ------
/// ValueError
///     A recording whose peaks are all below 0.35 or by chance, that stands still, or has no times.
///
/// References
/// ----------
/// P. McLeod, G. Wyvill, A smarter way to find pitch, International Computer Music Conference 2005
#[pyfunction]
pub(crate) fn period(py: Python<'_>, demo: &Demonstration) -> PyResult<f64> {
    py.detach(|| preprocessing::period(&demo.0)).map_err(raise)
}

/// Positions (T, D) with NaN interpolated in gaps up to `max_gap` seconds; `turns` (D,) of angles, 0 of others, NaN where it is
/// not known.
#[pyfunction]
pub(crate) fn fill<'py>(
    py: Python<'py>,
    position: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
    names: &Bound<'py, PyAny>,
    turns: &Bound<'py, PyAny>,
    max_gap: f64,
) -> PyResult<Matrix<'py>> {
    let (position, time) = (matrix("position", "(T, D)", position)?, vector("time", time)?);
    let (names, turns) = (texts("names", names)?, vector("turns", turns)?);
    let filled = preprocessing::fill_gaps(position, &time, &names, &turns, max_gap).map_err(raise)?;
    Ok(filled.into_pyarray(py))
}

/// A cycle or a recording that was left out: index of the recording, start and period in s, the reason, and whether it is
/// the whole recording.
type Rejected = (usize, f64, f64, String, bool);
/// Index of a recording and of a degree of freedom, its gain per cycle, and how many of its turns were taken off.
type Growth = (usize, usize, f64, i32);
/// Cycles, their periods (K,) in s, their gains (K, D), the indices of their recordings, the rejected, and what grows.
type Found<'py> = (Vec<Demonstration>, Vector<'py>, Vec<Vec<f64>>, Vec<usize>, Vec<Rejected>, Vec<Growth>);

/// Cuts recordings into cycles: what `pdmp.preprocessing.cycles` calls.
#[pyfunction]
pub(crate) fn cycles<'py>(
    py: Python<'py>,
    recordings: &Bound<'py, PyAny>,
    events: Option<&Bound<'py, PyAny>>,
    average: bool,
) -> PyResult<Found<'py>> {
    let recordings = demonstrations("recordings", recordings)?;
    let events = events.map(|events| items("events", events, vector)).transpose()?;
    let keep = if average { CycleOutput::Mean } else { CycleOutput::Each };
    let found = py.detach(|| preprocessing::cycles(&recordings, events.as_deref(), keep)).map_err(raise)?;
    let periods: Vec<f64> = found.kept.iter().map(|cycle| cycle.period).collect();
    let of = found.kept.iter().map(|cycle| cycle.recording).collect();
    let rejected = found.rejected.iter().map(|cycle| {
        let whole = matches!(cycle.reason, RejectionReason::Aperiodic { .. } | RejectionReason::Still);
        (cycle.recording, cycle.start, cycle.period, cycle.reason.to_string(), whole)
    });
    let rejected = rejected.collect();
    let growths =
        found.growths.iter().map(|growth| (growth.recording, growth.dof, growth.gain, growth.turns)).collect();
    let gains = found.kept.iter().map(|cycle| cycle.gain.clone()).collect();
    let demos = found.kept.into_iter().map(|cycle| Demonstration(cycle.demo)).collect();
    Ok((demos, to_numpy(py, &periods), gains, of, rejected, growths))
}
