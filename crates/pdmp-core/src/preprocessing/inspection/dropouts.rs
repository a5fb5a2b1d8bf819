//! Samples that were lost and written as exact zeros.
//!
//! A movement that passes through exactly zero does so with steps like the others. Where a sample was lost, the steps to
//! zero and back are many times the largest between the others.

use ndarray::ArrayView1;

use super::{Finding, MIN_SAMPLES, Survey};

/// Steps to and from zero this many times the largest elsewhere are no movement.
const MAX_RATIO: f64 = 4.0;
/// Share of the steps between other samples that are not zero: a gripper that opens and closes rests most of the time.
const MIN_MOVING: f64 = 0.5;

/// Exact zeros of one degree of freedom.
struct Run {
    dof: usize,
    from: usize,
    to: usize,
    ratio: f64,
}

/// The runs of zeros of a demonstration; degrees of freedom that are lost together are reported together.
pub(super) fn zeros(demo: usize, survey: &Survey) -> Vec<Finding> {
    let n = survey.n_samples();
    if n < MIN_SAMPLES || !survey.zero || survey.step == 0.0 {
        return Vec::new();
    }
    let mut runs: Vec<Run> = (0..survey.n_dofs).flat_map(|d| runs(d, survey.column(d))).collect();
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
        ratio: runs.iter().fold(0.0, |most, run| most.max(run.ratio)),
    };
    together.map(finding).collect()
}

/// Runs of zeros in a column with steps to and from them that are far larger than those elsewhere.
fn runs(dof: usize, column: ArrayView1<f64>) -> Vec<Run> {
    let n = column.len();
    let mut found: Vec<Run> = Vec::new();
    for (c, _) in column.iter().enumerate().filter(|(_, y)| **y == 0.0) {
        match found.last_mut() {
            Some(run) if run.to + 1 == c => run.to = c,
            _ => found.push(Run { dof, from: c, to: c, ratio: 0.0 }),
        }
    }
    // A movement may start or end with one sample at zero, or rest there.
    let inside = |run: &Run| run.from > 0 && run.to + 1 < n;
    found.retain(|run| inside(run) || (run.from < run.to && run.to - run.from + 1 < n));
    if found.is_empty() {
        return found;
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
    found.retain_mut(|run| {
        let before = (run.from > 0).then(|| column[run.from - 1].abs());
        let after = (run.to + 1 < n).then(|| column[run.to + 1].abs());
        let jump = before.into_iter().chain(after).fold(f64::INFINITY, f64::min);
        run.ratio = jump / largest;
        run.ratio > MAX_RATIO
    });
    found
}
