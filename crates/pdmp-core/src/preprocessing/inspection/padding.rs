//! Padding rows that make recordings of different length equally long.
//!
//! Zeros are recognised by the jump to them. Copies of the last row may be rest: they are reported if the movement stops
//! abruptly, or if demonstrations of equal length end in different numbers of them and at least one in none.

use super::{MIN_SAMPLES, Survey};
use crate::model::finding::{Finding, Padding};

/// Maximum step to zero in a movement, relative to the largest step elsewhere.
const MAX_RATIO: f64 = 4.0;
/// Minimum number of copies of the last row that are reported.
const MIN_COPIES: usize = 5;
/// Minimum last step of a movement that stops abruptly, relative to the largest step of the degree of freedom.
const ABRUPT_STEP: f64 = 0.2;

/// Finds the demonstrations that end in padding.
pub(super) fn rows(surveys: &[Survey]) -> Vec<Finding> {
    let copies: Vec<usize> = surveys.iter().map(copies).collect();
    let equally_long = surveys.iter().all(|survey| survey.n_samples() == surveys[0].n_samples());
    let stacked = equally_long && copies.contains(&0);
    let finding = |(demo, (survey, &copies)): (usize, (&Survey, &usize))| {
        let n = survey.n_samples();
        if n < MIN_SAMPLES || copies + 2 > n {
            return None;
        }
        if ends_in_zeros(survey, copies + 1) {
            let rows = copies + 1;
            let from = survey.place(n - rows);
            return Some(Finding::Padded { demo, from, rows, padding: Padding::Zeros });
        }
        let padded = copies >= MIN_COPIES && (stacked || stops_abruptly(survey, n - copies - 1));
        let finding = || {
            let from = survey.place(n - copies);
            Finding::Padded { demo, from, rows: copies, padding: Padding::LastRow }
        };
        padded.then(finding)
    };
    surveys.iter().zip(&copies).enumerate().filter_map(finding).collect()
}

/// Returns the number of rows at the end that equal the row before them.
fn copies(survey: &Survey) -> usize {
    let position = survey.demo.position();
    let last = position.row(survey.n_samples() - 1);
    position.rows().into_iter().rev().skip(1).take_while(|row| *row == last).count()
}

/// Returns whether the given number of rows at the end is zero, and a degree of freedom jumps there.
fn ends_in_zeros(survey: &Survey, rows: usize) -> bool {
    let (position, n) = (survey.demo.position(), survey.n_samples());
    if position.row(n - 1).iter().any(|&y| y != 0.0) {
        return false;
    }
    let (movement, rounding) = (n - rows, survey.rounding());
    (0..survey.n_dofs).any(|d| {
        let column = survey.column(d);
        let largest = (1..movement).fold(0.0f64, |max, c| max.max((column[c] - column[c - 1]).abs()));
        largest > 0.0 && column[movement - 1].abs() > f64::max(MAX_RATIO * largest, rounding)
    })
}

/// Returns whether a degree of freedom still moves fast in its step to the sample `last`.
fn stops_abruptly(survey: &Survey, last: usize) -> bool {
    let rounding = survey.rounding();
    last > 0
        && (0..survey.n_dofs).any(|d| {
            let column = survey.column(d);
            let step = (column[last] - column[last - 1]).abs();
            step > rounding && step > ABRUPT_STEP * survey.steps[d]
        })
}
