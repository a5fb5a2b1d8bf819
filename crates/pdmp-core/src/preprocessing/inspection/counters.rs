//! Columns that count samples or repeat the time stamps, and are no degree of freedom.

use super::{Finding, MIN_SAMPLES, Survey};
use crate::demonstration::Sampling;

/// The columns that are a counter or a clock in every demonstration, where there are others beside them.
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

fn counts(survey: &Survey, d: usize) -> bool {
    let column = survey.column(d);
    (1..column.len()).all(|c| column[c] - column[c - 1] == 1.0)
}

/// Whether a column is the stamps themselves: a ramp may be a movement, but not the scatter of a clock.
fn repeats_time(survey: &Survey, d: usize) -> bool {
    let Sampling::Stamped { time } = survey.demo.sampling() else { return false };
    let column = survey.column(d);
    let duration = time[time.len() - 1] - time[0];
    let even = duration / (time.len() - 1) as f64;
    let scatter = (1..time.len()).fold(0.0f64, |most, c| most.max((time[c] - time[0] - even * c as f64).abs()));
    let off = |(y, t): (&f64, &f64)| (y - column[0] - (t - time[0])).abs();
    let named = matches!(survey.name(d).to_ascii_lowercase().as_str(), "t" | "time" | "timestamp" | "stamp");
    (named || scatter > 1e-3 * even) && column.iter().zip(time).all(|pair| off(pair) <= 1e-9 * duration)
}
