//! Cycles that are not closed, and such that repeat their first sample at the end.

use super::{Finding, Survey};
use crate::demonstration::{Demonstration, Sampling, turn_of};
use crate::numerics::rotation::dot;

/// Minimum step from the end of a cycle to its start, relative to the largest step within it, that is reported.
const MIN_RATIO: f64 = 4.0;
/// Minimum step from the end of a cycle to its start, relative to the range of the degree of freedom, that is reported.
const MIN_SHARE: f64 = 0.05;
/// Maximum step from the last sample to the first one of a repeated sample, relative to the steps at both ends.
const MAX_REPETITION: f64 = 0.1;
/// Minimum steps at both ends, relative to the mean step: a cycle may rest at its ends.
const MIN_MOTION: f64 = 0.2;

/// Returns the rhythmic demonstrations whose ends do not meet in one sampling interval. Those with time stamps are left
/// out: their period is given.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling};
/// # use pdmp_core::preprocessing::inspection::{Finding, cycle_ends};
/// # fn main() -> pdmp_core::Result<()> {
/// // 100 intervals of 0.01 s close a cycle of 1 s: sample 100 is the first one of the next cycle.
/// let cycle = Array2::from_shape_fn((101, 1), |(c, _)| (0.02 * std::f64::consts::PI * c as f64).sin());
/// let demo = Demonstration::new(cycle, Sampling::Uniform { dt: 0.01 })?;
/// assert!(matches!(cycle_ends(&[demo])[..], [Finding::RepeatedEnd { demo: 0 }]));
/// # Ok(())
/// # }
/// ```
pub fn cycle_ends(demos: &[Demonstration]) -> Vec<Finding> {
    demos.iter().enumerate().filter_map(|(m, demo)| ends_of(m, &Survey::new(demo, None))).collect()
}

/// Returns the finding of one cycle: its widest opening, or its repeated sample.
fn ends_of(demo: usize, survey: &Survey) -> Option<Finding> {
    if let Sampling::Stamped { .. } = survey.demo.sampling() {
        return None;
    }
    let last = survey.n_samples() - 1;
    let rounding = survey.rounding();
    let mut worst = None;
    let mut max_share = MIN_SHARE;
    // Squared steps from end to start, at both ends, and on average, each relative to the range of its degree of freedom.
    let mut squares = [0.0; 4];
    for d in 0..survey.n_dofs {
        let (column, turn) = (survey.column(d), turn_of(survey.demo.units().map_or("", |units| &units[d])));
        let range = survey.ranges[d];
        if range <= rounding {
            continue;
        }
        let opening = closing_sign(survey, d) * column[0] - column[last];
        let opening = turn.map_or(opening, |turn| opening - (opening / turn).round() * turn).abs();
        let (largest, share) = (survey.steps[d], opening / range);
        if opening > MIN_RATIO * largest && share > max_share {
            max_share = share;
            let (dof, ratio) = (survey.name(d), opening / largest);
            worst = Some(Finding::OpenCycle { demo, dof, opening, ratio });
        }
        let mean = (1..=last).map(|c| (column[c] - column[c - 1]).powi(2)).sum::<f64>() / last as f64;
        let ends = [opening.powi(2), (column[1] - column[0]).powi(2), (column[last] - column[last - 1]).powi(2), mean];
        squares.iter_mut().zip(ends).for_each(|(sum, square)| *sum += square / (range * range));
    }
    let [opening, first, last, mean] = squares.map(f64::sqrt);
    let motion = first.min(last);
    let repeated = opening <= MAX_REPETITION * motion && motion >= MIN_MOTION * mean && mean > 0.0;
    worst.or_else(|| repeated.then_some(Finding::RepeatedEnd { demo }))
}

/// Returns −1 for a component of a quaternion that is closed by its negative, and otherwise 1.
fn closing_sign(survey: &Survey, d: usize) -> f64 {
    let rotation = survey.demo.rotations().iter().find(|rotation| (rotation.column..rotation.column + 4).contains(&d));
    let Some(rotation) = rotation else { return 1.0 };
    let position = survey.demo.position();
    let [first, last] = [0, survey.n_samples() - 1].map(|c| rotation.read(&position.row(c).to_vec()));
    if dot(first, last) < 0.0 { -1.0 } else { 1.0 }
}
