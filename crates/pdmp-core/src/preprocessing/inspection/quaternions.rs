//! Columns that are probably unit quaternions, and are not declared as such.

use super::{Finding, Survey};
use crate::demonstration::MAX_NORM_DEVIATION;

/// Smallest range of a column that changes. A rotation changes at least two of its four components.
const MIN_RANGE: f64 = 1e-3;

/// Finds groups of four columns that have unit norm in every sample of every demonstration.
pub(super) fn undeclared(surveys: &[Survey]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let n = surveys.iter().map(|survey| survey.n_dofs).min().unwrap_or(0);
    let mut column = 0;
    while column + 4 <= n {
        let declared = surveys[0].demo.rotations().iter().any(|rotation| {
            let first = rotation.column;
            first < column + 4 && column < first + 4
        });
        if !declared && surveys.iter().all(|survey| has_unit_norm(survey, column)) && turns(surveys, column) {
            findings.push(Finding::Quaternion { column, name: surveys[0].name(column) });
            column += 4;
        } else {
            column += 1;
        }
    }
    findings
}

fn has_unit_norm(survey: &Survey, column: usize) -> bool {
    survey.demo.position().rows().into_iter().all(|row| {
        let norm = (column..column + 4).map(|d| row[d] * row[d]).sum::<f64>().sqrt();
        (norm - 1.0).abs() <= MAX_NORM_DEVIATION
    })
}

/// Returns whether at least two of four columns change.
fn turns(surveys: &[Survey], column: usize) -> bool {
    let changes = |d: &usize| {
        let first = surveys[0].column(*d)[0];
        surveys.iter().any(|survey| survey.column(*d).iter().any(|y| (y - first).abs() > MIN_RANGE))
    };
    (column..column + 4).filter(changes).count() >= 2
}
