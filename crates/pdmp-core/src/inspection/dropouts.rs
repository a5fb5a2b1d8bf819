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
    if n < MIN_SAMPLES {
        return Vec::new();
    }
    let some = |d: &usize| survey.dofs[*d].zero && survey.dofs[*d].step > 0.0;
    let mut runs: Vec<Run> = (0..survey.dofs.len()).filter(some).flat_map(|d| runs(d, survey.column(d))).collect();
    // Rows of zeros at the end are padding.
    let all = runs.iter().filter(|run| run.to == n - 1).count() == survey.dofs.len();
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
    let (mut largest, mut moving, mut steps) = (0.0f64, 0, 0);
    let mut found: Vec<Run> = Vec::new();
    for c in 0..n {
        if column[c] == 0.0 {
            match found.last_mut() {
                Some(run) if run.to + 1 == c => run.to = c,
                _ => found.push(Run { dof, from: c, to: c, ratio: 0.0 }),
            }
        } else if c > 0 && column[c - 1] != 0.0 {
            let step = (column[c] - column[c - 1]).abs();
            largest = largest.max(step);
            moving += usize::from(step > 0.0);
            steps += 1;
        }
    }
    if steps < MIN_SAMPLES / 2 || (moving as f64) < MIN_MOVING * steps as f64 {
        return Vec::new();
    }
    found.retain_mut(|run| {
        let before = (run.from > 0).then(|| column[run.from - 1].abs());
        let after = (run.to + 1 < n).then(|| column[run.to + 1].abs());
        let jump = match (before, after) {
            (Some(before), Some(after)) => before.min(after),
            // A movement may start or end with one sample at zero.
            (Some(jump), None) | (None, Some(jump)) if run.to > run.from => jump,
            _ => 0.0,
        };
        run.ratio = jump / largest;
        run.ratio > MAX_RATIO
    });
    found
}
