//! Interpolation of missing samples.

use std::f64::consts::TAU;

use ndarray::Array2;

use crate::demonstration::MIN_SAMPLES_PER_DEMONSTRATION;
use crate::error::{Error, Result};
use crate::numerics::spline::Knots;
use crate::numerics::statistics::{range, upper_median};
use crate::validate::{check_length, check_range, check_time};

/// Minimum interval between rows that are reported as missing, relative to the median one.
pub(super) const MIN_MISSING_INTERVALS: f64 = 5.0;
/// Relative margin that admits a gap of exactly `max_gap` between rounded time stamps.
const MARGIN: f64 = 1e-9;

/// Fills the gaps of `position` (T, D), samples that are NaN, by the cubic spline through the other samples of the column.
///
/// A gap extends from the sample before it to the sample after it. `time` (T,) is in seconds. `turns` (D,) is the full turn
/// in the unit of each column that is an angle, 0 for other columns and NaN for unknown units: an angle is interpolated
/// the shorter way round. `names` (D,) appear in errors.
///
/// ```
/// # use ndarray::array;
/// # use pdmp_core::preprocessing::fill_gaps;
/// # fn main() -> pdmp_core::Result<()> {
/// let time = [0.0, 0.1, 0.2, 0.3, 0.4];
/// let position = array![[0.0], [1.0], [f64::NAN], [3.0], [4.0]];
/// let filled = fill_gaps(position, &time, &["x".to_string()], &[0.0], 0.2)?;
/// assert!((filled[[2, 0]] - 2.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A gap longer than `max_gap` seconds, or at either end; an interval between `time` longer than a positive `max_gap` and
/// than five usual ones, where rows are missing; a change by about a full turn through a gap of a column of
/// unknown unit; a column with fewer than four samples; times that do not increase.
pub fn fill_gaps(
    mut position: Array2<f64>,
    time: &[f64],
    names: &[String],
    turns: &[f64],
    max_gap: f64,
) -> Result<Array2<f64>> {
    check_range("max_gap", max_gap, max_gap >= 0.0, "must not be negative; 0 fills none")?;
    let (n_samples, n_dofs) = position.dim();
    check_length("names", names.len(), n_dofs, "DoF")?;
    check_length("turns", turns.len(), n_dofs, "DoF")?;
    if max_gap > 0.0 && time.len() > 1 {
        check_rows(time, max_gap)?;
    }
    if !position.iter().any(|y| y.is_nan()) {
        return Ok(position);
    }
    check_time(time, n_samples)?;
    for ((mut column, name), &turn) in position.columns_mut().into_iter().zip(names).zip(turns) {
        let present: Vec<usize> = (0..n_samples).filter(|&c| !column[c].is_nan()).collect();
        if present.len() == n_samples {
            continue;
        }
        check_gaps(&present, time, name, max_gap)?;
        let mut values: Vec<f64> = present.iter().map(|&c| column[c]).collect();
        if turn > 0.0 {
            unwrap(&mut values, turn);
        } else if turn.is_nan()
            && let Some(k) = find_wrap(&values, &present)
        {
            let (column, [from, to]) = (name.clone(), [k, k + 1].map(|k| time[present[k]]));
            return Err(Error::WrapInGap { column, from, to, change: values[k + 1] - values[k] });
        }
        let knots = Knots::not_a_knot(present.iter().map(|&c| time[c]).collect());
        let mut slopes = vec![0.0; values.len()];
        knots.slopes(&values, &mut slopes);
        let missing: Vec<usize> = (0..n_samples).filter(|&c| column[c].is_nan()).collect();
        let mut filled = vec![0.0; missing.len()];
        knots.sample(&values, &slopes, missing.iter().map(|&c| time[c]), &mut filled);
        missing.iter().zip(filled).for_each(|(&c, y)| column[c] = y);
    }
    Ok(position)
}

/// Checks the intervals between rows.
fn check_rows(time: &[f64], max_gap: f64) -> Result<()> {
    let length = |pair: &[f64]| pair[1] - pair[0];
    let limit = max_gap.max(MIN_MISSING_INTERVALS * upper_median(time.windows(2).map(length)));
    match time.windows(2).find(|pair| length(pair) > limit * (1.0 + MARGIN)) {
        Some(pair) => Err(Error::Gap { column: String::new(), from: pair[0], to: pair[1], max_gap }),
        None => Ok(()),
    }
}

/// Checks the gaps between the present samples and at both ends.
fn check_gaps(present: &[usize], time: &[f64], name: &str, max_gap: f64) -> Result<()> {
    let gap = |from, to| Error::Gap { column: name.to_string(), from, to, max_gap };
    let [Some(&first), Some(&last)] = [present.first(), present.last()] else {
        return Err(gap(f64::NEG_INFINITY, f64::INFINITY));
    };
    if first > 0 {
        return Err(gap(f64::NEG_INFINITY, time[first]));
    }
    if last + 1 < time.len() {
        return Err(gap(time[last], f64::INFINITY));
    }
    let limit = max_gap * (1.0 + MARGIN);
    match present.windows(2).find(|pair| pair[1] > pair[0] + 1 && time[pair[1]] - time[pair[0]] > limit) {
        Some(pair) => Err(gap(time[pair[0]], time[pair[1]])),
        None if present.len() < MIN_SAMPLES_PER_DEMONSTRATION => {
            Err(Error::Samples { found: present.len(), least: MIN_SAMPLES_PER_DEMONSTRATION })
        }
        None => Ok(()),
    }
}

/// Range of the values of a column that may be a wrapped angle, in turns.
const WRAPPED_RANGE: [f64; 2] = [0.9, 1.02];
/// Minimum change through a gap that may be a wrap, in turns.
const MIN_WRAP: f64 = 0.5;
/// Minimum ratio of that change to the largest change between neighbouring samples times the length of the gap.
const MIN_RATIO: f64 = 3.0;

/// Returns the present sample before the first gap through which the values change like those of a wrapped angle.
fn find_wrap(values: &[f64], present: &[usize]) -> Option<usize> {
    let may_wrap = |turn: f64| (WRAPPED_RANGE[0] * turn..=WRAPPED_RANGE[1] * turn).contains(&range(values));
    let turn = [TAU, 360.0].into_iter().find(|turn| may_wrap(*turn))?;
    let change = |k: usize| (values[k + 1] - values[k]).abs();
    let steps = |k: usize| present[k + 1] - present[k];
    // Wraps between neighbouring samples are excluded from the comparison.
    let neighbours = (0..values.len() - 1).filter(|&k| steps(k) == 1 && change(k) < MIN_WRAP * turn);
    let fastest = neighbours.map(change).fold(0.0, f64::max);
    (0..values.len() - 1)
        .find(|&k| steps(k) > 1 && change(k) > MIN_WRAP * turn && change(k) > MIN_RATIO * fastest * steps(k) as f64)
}

/// Subtracts the full turns between each angle and the one before it.
fn unwrap(angles: &mut [f64], turn: f64) {
    for c in 1..angles.len() {
        angles[c] -= turn * ((angles[c] - angles[c - 1]) / turn).round();
    }
}
