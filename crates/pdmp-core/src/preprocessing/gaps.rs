//! Samples that are missing.

use std::f64::consts::TAU;

use ndarray::Array2;

use crate::demonstration::LEAST_SAMPLES;
use crate::error::{Error, Result};
use crate::numerics::spline::Knots;
use crate::validate::check_time;

/// The `position` (T, D) with its gaps, samples that are NaN, interpolated by the cubic spline through the others of the
/// same column.
///
/// A gap lasts from the sample before it to the one after it. `time` (T,) is in seconds, and `turns` (D,) tells what a
/// full turn is where a column is an angle, 0 where it is none and NaN where that is not known: an angle goes the shorter
/// way round through a gap. `names` (D,) are those that errors tell.
///
/// # Errors
/// A change by about a full turn through a gap of a column that may be an angle. A gap longer than `max_gap` seconds, or at either end; a column with fewer than four samples; times that do not
/// increase.
pub fn fill(
    mut position: Array2<f64>,
    time: &[f64],
    names: &[String],
    turns: &[f64],
    max_gap: f64,
) -> Result<Array2<f64>> {
    if max_gap.is_nan() || max_gap < 0.0 {
        return Err(Error::Range { name: "max_gap", value: max_gap, allowed: "must not be negative; 0 fills none" });
    }
    let (n_samples, n_dofs) = position.dim();
    for (name, found) in [("names", names.len()), ("turns", turns.len())] {
        if found != n_dofs {
            return Err(Error::Length { name, expected: n_dofs, found, per: "DoF" });
        }
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
        check(&present, time, name, max_gap)?;
        let mut values: Vec<f64> = present.iter().map(|&c| column[c]).collect();
        if turn > 0.0 {
            unwrap(&mut values, turn);
        } else if turn.is_nan()
            && let Some(k) = wrap(&values, &present)
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

/// Checks the gaps between the samples that are present, and at both ends.
fn check(present: &[usize], time: &[f64], name: &str, max_gap: f64) -> Result<()> {
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
    // Rounding of the stamps must not decide.
    let longest = max_gap * (1.0 + 1e-9);
    match present.windows(2).find(|pair| pair[1] > pair[0] + 1 && time[pair[1]] - time[pair[0]] > longest) {
        Some(pair) => Err(gap(time[pair[0]], time[pair[1]])),
        None if present.len() < LEAST_SAMPLES => Err(Error::Samples { found: present.len(), least: LEAST_SAMPLES }),
        None => Ok(()),
    }
}

/// Ranges that look like those of a wrapped angle, in turns.
const WRAPPED: [f64; 2] = [0.9, 1.02];
/// Least change through a gap that looks like a wrap, in turns, and over what the fastest change between neighbours makes of
/// the length of the gap.
const MIN_WRAP: f64 = 0.5;
const MIN_RATIO: f64 = 3.0;

/// The present sample before the first gap through which the values change as a wrapped angle does.
fn wrap(values: &[f64], present: &[usize]) -> Option<usize> {
    let [low, high] = values.iter().fold([f64::MAX, f64::MIN], |[low, high], &y| [low.min(y), high.max(y)]);
    let range = |turn: f64| (WRAPPED[0] * turn..=WRAPPED[1] * turn).contains(&(high - low));
    let turn = [TAU, 360.0].into_iter().find(|turn| range(*turn))?;
    let change = |k: usize| (values[k + 1] - values[k]).abs();
    let samples = |k: usize| present[k + 1] - present[k];
    // Wraps between neighbours are none of the changes to compare with.
    let usual = (0..values.len() - 1).filter(|&k| samples(k) == 1 && change(k) < MIN_WRAP * turn);
    let fastest = usual.map(change).fold(0.0, f64::max);
    (0..values.len() - 1)
        .find(|&k| samples(k) > 1 && change(k) > MIN_WRAP * turn && change(k) > MIN_RATIO * fastest * samples(k) as f64)
}

/// Takes off the full turns between one angle and the next.
fn unwrap(angles: &mut [f64], turn: f64) {
    for c in 1..angles.len() {
        angles[c] -= turn * ((angles[c] - angles[c - 1]) / turn).round();
    }
}
