//! Lost samples that were written as exact zeros.
//!
//! A movement that passes through exactly zero has steps of usual size there. At a lost sample the steps to zero and back
//! are many times the largest step elsewhere.

use ndarray::ArrayView1;

use super::{Finding, MIN_SAMPLES, Survey};

/// Maximum step to or from zero in a movement, relative to the largest step elsewhere.
const MAX_RATIO: f64 = 4.0;
/// Minimum fraction of non-zero steps between the other samples: a gripper that opens and closes rests most of the time.
const MIN_MOVING: f64 = 0.5;

/// Consecutive exact zeros of one degree of freedom.
struct Run {
    dof: usize,
    from: usize,
    to: usize,
    ratio: f64,
}

/// Finds the runs of zeros of a demonstration; degrees of freedom that were lost simultaneously share one finding.
pub(super) fn zeros(demo: usize, survey: &Survey) -> Vec<Finding> {
    let n = survey.n_samples();
    if n < MIN_SAMPLES || !survey.zero || survey.largest_step() == 0.0 {
        return Vec::new();
    }
    let rounding = survey.rounding();
    let mut runs: Vec<Run> = (0..survey.n_dofs).flat_map(|d| runs(d, survey.column(d), rounding)).collect();
    // Rows of zeros at the end are padding.
    let all = runs.iter().filter(|run| run.to == n - 1).count() == survey.n_dofs;
    if all {
        runs.retain(|run| run.to != n - 1);
    }
    runs.sort_by_key(|run| (run.from, run.to, run.dof));
    let together = runs.chunk_by(|a, b| (a.from, a.to) == (b.from, b.to));
    let finding = |runs: &[Run]| Finding::Zeros {
        demo,
        dofs: runs.iter().map(|run| survey.name(run.dof)).collect(),
        from: survey.place(runs[0].from),
        to: survey.place(runs[0].to),
        ratio: runs.iter().fold(0.0, |max, run| max.max(run.ratio)),
    };
    together.map(finding).collect()
}

/// Returns the runs of zeros in a column whose steps to and from them are far larger than those elsewhere, and than rounding
/// errors.
fn runs(dof: usize, column: ArrayView1<f64>, rounding: f64) -> Vec<Run> {
    let n = column.len();
    let mut zero_runs: Vec<Run> = Vec::new();
    for (c, _) in column.iter().enumerate().filter(|(_, y)| **y == 0.0) {
        match zero_runs.last_mut() {
            Some(run) if run.to + 1 == c => run.to = c,
            _ => zero_runs.push(Run { dof, from: c, to: c, ratio: 0.0 }),
        }
    }
    // A movement may start or end with one sample at zero, or be zero throughout.
    let inside = |run: &Run| run.from > 0 && run.to + 1 < n;
    zero_runs.retain(|run| inside(run) || (run.from < run.to && run.to - run.from + 1 < n));
    if zero_runs.is_empty() {
        return zero_runs;
    }
    let (mut largest, mut moving, mut steps) = (0.0f64, 0, 0);
    for c in (1..n).filter(|&c| column[c] != 0.0 && column[c - 1] != 0.0) {
        let step = (column[c] - column[c - 1]).abs();
        largest = largest.max(step);
        moving += usize::from(step > 0.0);
        steps += 1;
    }
    if steps < MIN_SAMPLES / 2 || (moving as f64) < MIN_MOVING * steps as f64 {
        return Vec::new();
    }
    zero_runs.retain_mut(|run| {
        let before = (run.from > 0).then(|| column[run.from - 1].abs());
        let after = (run.to + 1 < n).then(|| column[run.to + 1].abs());
        let jump = before.into_iter().chain(after).fold(f64::INFINITY, f64::min);
        run.ratio = jump / largest;
        run.ratio > MAX_RATIO && jump > rounding
    });
    zero_runs
}
