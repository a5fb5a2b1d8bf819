//! Columns that count samples or repeat the time stamps, instead of a degree of freedom.

use super::{Finding, MIN_SAMPLES, Survey};
use crate::demonstration::Sampling;

/// Finds the columns that are a counter or a clock in every demonstration, unless there is only one column.
pub(super) fn columns(surveys: &[Survey]) -> Vec<Finding> {
    let n_dofs = surveys.first().map_or(0, |survey| survey.n_dofs);
    let enough = surveys.iter().all(|survey| survey.n_samples() >= MIN_SAMPLES && survey.n_dofs == n_dofs);
    if n_dofs < 2 || !enough {
        return Vec::new();
    }
    let finding = |d: usize| {
        let dof = surveys[0].name(d);
        if surveys.iter().all(|survey| counts(survey, d)) {
            return Some(Finding::Counter { dof });
        }
        surveys.iter().all(|survey| repeats_time(survey, d)).then_some(Finding::Clock { dof })
    };
    (0..n_dofs).filter_map(finding).collect()
}

/// Returns whether a column increases by exactly 1 per sample.
fn counts(survey: &Survey, d: usize) -> bool {
    let column = survey.column(d);
    (1..column.len()).all(|c| column[c] - column[c - 1] == 1.0)
}

/// Returns whether a column equals the time stamps up to an offset. A uniform ramp may be a movement, unless its name says
/// that it is a time; the jitter of a clock is not.
fn repeats_time(survey: &Survey, d: usize) -> bool {
    let Sampling::Stamped { time } = survey.demo.sampling() else { return false };
    let column = survey.column(d);
    let duration = time[time.len() - 1] - time[0];
    let interval = duration / (time.len() - 1) as f64;
    let jitter = (1..time.len()).fold(0.0f64, |max, c| max.max((time[c] - time[0] - interval * c as f64).abs()));
    let difference = |(y, t): (&f64, &f64)| (y - column[0] - (t - time[0])).abs();
    let named = matches!(survey.name(d).to_ascii_lowercase().as_str(), "t" | "time" | "timestamp" | "stamp");
    (named || jitter > 1e-3 * interval) && column.iter().zip(time).all(|pair| difference(pair) <= 1e-9 * duration)
}
