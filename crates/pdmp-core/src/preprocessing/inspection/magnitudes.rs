//! Demonstrations whose ranges or duration are of another order of magnitude than those of the others, such as one in degrees
//! among others in radians, or one with time stamps in ms.
//!
//! Over the recordings in `pdmp.datasets.REGISTRY`, the ratio of ranges is 0.18 to 3.0 and that of durations 0.15 to 6.5 within
//! a task, and 0.098 to 2.7 from a single stride to a walk of many.

use super::{Finding, Survey};

/// Minimum ratio, or inverse ratio, that is reported.
const MIN_RATIO: f64 = 15.0;

/// Returns the ranges of the coordinates and the duration in seconds (D + 1,) of a demonstration. They are 0 where unknown: a
/// range of columns with unusual steps, or with other findings, is not that of the movement.
pub(super) fn magnitudes_of(demo: usize, survey: &Survey, known: &[Finding], unusual: &[usize]) -> Vec<f64> {
    let is_wrong = |d: usize| {
        let is_about = |finding: &Finding| match finding {
            Finding::Zeros { demo: own, dofs, .. } => *own == demo && dofs.contains(&survey.name(d)),
            Finding::Wrap { demo: own, dof, .. } => *own == demo && *dof == survey.name(d),
            Finding::Padded { demo: own, .. } => *own == demo,
            _ => false,
        };
        unusual.contains(&d) || known.iter().any(is_about)
    };
    let ranges = survey.ranges.iter().enumerate().map(|(d, range)| if is_wrong(d) { 0.0 } else { *range });
    let ends = survey.time(survey.n_samples() - 1).zip(survey.time(0));
    ranges.chain([ends.map_or(0.0, |(last, first)| last - first)]).collect()
}

/// Finds the demonstrations of other magnitudes (M, D + 1), of columns with units (D,).
///
/// The reference is the median of all demonstrations, the smaller one of two. The ratio of a demonstration is the median over
/// the columns with the same unit: in one of them alone, movements may differ by any factor.
pub(crate) fn apart(magnitudes: &[Vec<f64>], units: &[String]) -> Vec<Finding> {
    let n_dofs = units.len();
    if magnitudes.len() < 2 || magnitudes.iter().any(|own| own.len() != n_dofs + 1) {
        return Vec::new();
    }
    let references: Vec<f64> = (0..=n_dofs).map(|k| lower_median(magnitudes.iter().map(|own| own[k]))).collect();
    let is_apart = |ratio: f64| ratio >= MIN_RATIO || ratio <= 1.0 / MIN_RATIO;
    let mut findings = Vec::new();
    let mut different: Vec<&String> = Vec::new();
    for unit in units {
        if !different.contains(&unit) {
            different.push(unit);
        }
    }
    for unit in &different {
        let columns: Vec<usize> = (0..n_dofs).filter(|&d| units[d] == **unit && references[d] > 0.0).collect();
        // A single column beside others, such as a gripper, may rest in most demonstrations.
        if columns.is_empty() || (columns.len() == 1 && n_dofs > 1) {
            continue;
        }
        for (demo, own) in magnitudes.iter().enumerate() {
            let ratios = || columns.iter().filter(|&&d| own[d] > 0.0).map(|&d| own[d] / references[d]);
            // Of two columns both must be apart.
            let (low, high) = (lower_median(ratios()), -lower_median(ratios().map(|ratio| -ratio)));
            let ratio = if low >= 1.0 { low } else { high };
            // A single degree of freedom may hardly move in some demonstrations.
            let is_rest = ratio < 1.0 && columns.len() == 1;
            if ratio > 0.0 && is_apart(ratio) && !is_rest {
                let unit = if different.len() > 1 { (*unit).clone() } else { String::new() };
                findings.push(Finding::OtherRange { demo, ratio, unit });
            }
        }
    }
    let median = references[n_dofs];
    for (demo, own) in magnitudes.iter().enumerate() {
        let (duration, ratio) = (own[n_dofs], own[n_dofs] / median);
        if median > 0.0 && duration > 0.0 && is_apart(ratio) {
            findings.push(Finding::OtherDuration { demo, duration, ratio });
        }
    }
    findings
}

/// Returns the median, or the lower one of two; 0 without numbers.
fn lower_median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    if numbers.is_empty() {
        return 0.0;
    }
    let middle = (numbers.len() - 1) / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}
