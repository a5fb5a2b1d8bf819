//! Rows that bring recordings of different length to one.
//!
//! Zeros are recognised by the jump to them. Copies of the last row are not so certain, as a robot may rest: they are
//! reported where the movement stops dead, or where demonstrations of equal length end in different numbers of such rows
//! and the longest in none.

use super::{MIN_SAMPLES, Survey};
use crate::model::finding::{Finding, Padding};

/// A step to zeros this many times the largest elsewhere is no movement.
const MAX_RATIO: f64 = 4.0;
/// Fewest copies of the last row that are reported.
const MIN_COPIES: usize = 5;
/// A movement stops dead where its last step is this share of the largest of its degree of freedom.
const DEAD: f64 = 0.2;

/// The demonstrations that end in padding.
pub(super) fn rows(surveys: &[Survey]) -> Vec<Finding> {
    let copies: Vec<usize> = surveys.iter().map(copies).collect();
    let even = surveys.iter().all(|survey| survey.n_samples() == surveys[0].n_samples());
    let stacked = even && copies.contains(&0);
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
        let padded = copies >= MIN_COPIES && (stacked || stops_dead(survey, n - copies - 1));
        let finding = || {
            let from = survey.place(n - copies);
            Finding::Padded { demo, from, rows: copies, padding: Padding::LastRow }
        };
        padded.then(finding)
    };
    surveys.iter().zip(&copies).enumerate().filter_map(finding).collect()
}

/// How many rows at the end are like the one before them.
fn copies(survey: &Survey) -> usize {
    let position = survey.demo.position();
    let last = position.row(survey.n_samples() - 1);
    position.rows().into_iter().rev().skip(1).take_while(|row| *row == last).count()
}

/// Whether so many rows at the end are zero, and a degree of freedom jumps there.
fn ends_in_zeros(survey: &Survey, rows: usize) -> bool {
    let (position, n) = (survey.demo.position(), survey.n_samples());
    if position.row(n - 1).iter().any(|&y| y != 0.0) {
        return false;
    }
    let movement = n - rows;
    (0..survey.n_dofs).any(|d| {
        let column = survey.column(d);
        let largest = (1..movement).fold(0.0f64, |most, c| most.max((column[c] - column[c - 1]).abs()));
        largest > 0.0 && column[movement - 1].abs() > MAX_RATIO * largest
    })
}

/// Whether a degree of freedom still moves fast in its step to the sample `last`.
fn stops_dead(survey: &Survey, last: usize) -> bool {
    last > 0
        && (0..survey.n_dofs).any(|d| {
            let column = survey.column(d);
            let step = (column[last] - column[last - 1]).abs();
            step > 0.0 && step > DEAD * survey.extent(d).step
        })
}
