//! Inspection of demonstrations for implausible samples, which are reported with their location.
//!
//! | module | finding |
//! |---|---|
//! | `time_stamps` | two time stamps far closer than the others |
//! | `dropouts` | lost samples that were written as exact zeros |
//! | `padding` | rows that were appended to make recordings equally long |
//! | `counters` | a column that counts samples, or repeats the time stamps |
//! | `jumps` | outliers, jumps, and sensors that are stuck in motion |
//! | `missing_rows` | intervals between time stamps within which the movement is not determined |
//! | `magnitudes` | demonstrations whose ranges or duration are of another order of magnitude, as in another unit |
//! | `turns` | angles that jump by a full turn, or that are offset by whole turns between demonstrations |
//! | `cycle_ends` | cycles that are not closed, or repeat their first sample |
//!
//! One pass over the samples computes ranges and largest steps and detects zeros, which rules out most faults cheaply. A fit adds
//! its own findings, such as gains whose transients the samples do not resolve (`learning/stiffness.rs`).

mod counters;
mod cycle_ends;
mod dropouts;
mod jumps;
mod magnitudes;
mod missing_rows;
mod padding;
mod quaternions;
mod time_stamps;
mod turns;

use ndarray::ArrayView1;

use crate::demonstration::{Demonstration, Sampling};
use crate::model::finding::SampleLocation;
pub use crate::model::finding::{Finding, Padding};
use crate::validate::row_major;

pub use cycle_ends::cycle_ends;
pub(crate) use magnitudes::apart;
pub use turns::unwound;
pub(crate) use turns::{REFERENCE_SAMPLES, reference, unwound_from};

/// Minimum number of samples for an estimate of the usual step of a degree of freedom.
const MIN_SAMPLES: usize = 10;

/// Largest rounding error relative to the largest coordinate of a demonstration. A constant computed from others, such as an
/// angle of a joint that is not tracked, has errors of 3e-16 in recorded BVH files; products of many rotations have more.
const ROUNDING: f64 = 1e-12;

/// Approximate number of values that are processed together.
const LANES: usize = 64;

/// Returns the implausible samples of demonstrations of one skill.
///
/// `dt` is the sampling interval in seconds of demonstrations without times; locations lack the time if it is `None`.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling};
/// # use pdmp_core::preprocessing::inspection::{Finding, inspect};
/// # fn main() -> pdmp_core::Result<()> {
/// let mut position = Array2::from_shape_fn((100, 1), |(c, _)| 2.0 + (0.05 * c as f64).sin());
/// position[[40, 0]] = 0.0;
/// let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// assert!(matches!(inspect(&[demo], None)[..], [Finding::Zeros { demo: 0, .. }]));
/// # Ok(())
/// # }
/// ```
pub fn inspect(demos: &[Demonstration], dt: Option<f64>) -> Vec<Finding> {
    let Inspected { mut findings, magnitudes } = inspect_block(demos, dt);
    let n_coordinates = demos.first().map_or(0, Demonstration::n_coordinates);
    let units = demos.iter().find_map(Demonstration::units);
    findings.extend(apart(&magnitudes, &units.map_or_else(|| vec![String::new(); n_coordinates], <[String]>::to_vec)));
    findings
}

/// Result of an inspection of a block of demonstrations.
pub(crate) struct Inspected {
    /// Findings but those of [`apart`], which need all demonstrations.
    pub(crate) findings: Vec<Finding>,
    /// Ranges of the coordinates and duration in seconds of each demonstration (M, D + 1); 0 where unknown.
    pub(crate) magnitudes: Vec<Vec<f64>>,
}

/// Inspects a block of demonstrations.
pub(crate) fn inspect_block(demos: &[Demonstration], dt: Option<f64>) -> Inspected {
    let surveys: Vec<Survey> = demos.iter().map(|demo| Survey::new(demo, dt)).collect();
    let padded = padding::rows(&surveys);
    let (mut findings, mut magnitudes) = (Vec::new(), Vec::new());
    for (m, survey) in surveys.iter().enumerate() {
        findings.extend(time_stamps::close(m, survey));
        findings.extend(missing_rows::interval(m, survey));
        let mut known = dropouts::zeros(m, survey);
        known.extend(turns::wraps(m, survey));
        let n_own = known.len();
        known.extend(padded.iter().cloned());
        let (steps, unusual) = jumps::steps(m, survey, &known);
        magnitudes.push(magnitudes::magnitudes_of(m, survey, &known, &unusual));
        findings.extend(known.into_iter().take(n_own).chain(steps));
    }
    findings.extend(padded);
    findings.extend(counters::columns(&surveys));
    findings.extend(turns::apart(&surveys));
    findings.extend(quaternions::undeclared(&surveys));
    Inspected { findings, magnitudes }
}

/// Demonstration with statistics from one pass over its samples.
struct Survey<'a> {
    demo: &'a Demonstration,
    dt: Option<f64>,
    n_dofs: usize,
    /// Range of each coordinate.
    ranges: Vec<f64>,
    /// Largest step of each coordinate from one sample to the next.
    steps: Vec<f64>,
    /// Largest magnitude of any coordinate.
    size: f64,
    /// True if any sample is exactly zero.
    zero: bool,
}

impl<'a> Survey<'a> {
    fn new(demo: &'a Demonstration, dt: Option<f64>) -> Self {
        let n_dofs = demo.n_coordinates();
        let position = demo.position();
        let position = position.as_standard_layout();
        let values = row_major(&position);
        // Many rows at a time, for vector registers.
        let length = n_dofs * (LANES / n_dofs).max(1);
        let first = || values[..n_dofs].iter().copied().cycle().take(length);
        let (mut low, mut high, mut steps): (Vec<f64>, Vec<f64>, _) =
            (first().collect(), first().collect(), vec![0.0f64; length]);
        for (rows, before) in values[n_dofs..].chunks(length).zip(values.chunks(length)) {
            let extremes = low.iter_mut().zip(&mut high).zip(&mut steps);
            for (((low, high), largest), (y, before)) in extremes.zip(rows.iter().zip(before)) {
                let step = (y - before).abs();
                *largest = if step > *largest { step } else { *largest };
                *low = if *y < *low { *y } else { *low };
                *high = if *y > *high { *y } else { *high };
            }
        }
        let of_columns = |all: &[f64], better: fn(f64, f64) -> f64| -> Vec<f64> {
            (0..n_dofs).map(|d| all[d..].iter().step_by(n_dofs).copied().reduce(better).unwrap_or(0.0)).collect()
        };
        let (low, high) = (of_columns(&low, f64::min), of_columns(&high, f64::max));
        let steps = of_columns(&steps, f64::max);
        let may_be_zero = low.iter().zip(&high).any(|(low, high)| *low <= 0.0 && *high >= 0.0);
        let has_zero = |part: &[f64]| part.iter().fold(false, |zero, y| zero | (*y == 0.0));
        let zero = may_be_zero && values.chunks(LANES).any(has_zero);
        let size = low.iter().chain(&high).fold(0.0f64, |most, y| most.max(y.abs()));
        let ranges = low.iter().zip(&high).map(|(low, high)| high - low).collect();
        Self { demo, dt, n_dofs, ranges, steps, size, zero }
    }

    /// Returns the largest step of any coordinate from one sample to the next.
    fn largest_step(&self) -> f64 {
        self.steps.iter().fold(0.0, |most, step| most.max(*step))
    }

    /// Returns the size of steps that are rounding errors.
    fn rounding(&self) -> f64 {
        ROUNDING * self.size
    }

    fn n_samples(&self) -> usize {
        self.demo.n_samples()
    }

    /// Returns the positions (T,) of a degree of freedom.
    fn column(&self, d: usize) -> ArrayView1<'a, f64> {
        // `column` of a temporary view would not live as long as the demonstration.
        self.demo.position().index_axis_move(ndarray::Axis(1), d)
    }

    /// Returns the name of a degree of freedom; the default is that of a model.
    fn name(&self, d: usize) -> String {
        self.demo.names().map_or_else(|| format!("y{d}"), |names| names[d].clone())
    }

    /// Returns the time of a sample in seconds, if known.
    fn time(&self, sample: usize) -> Option<f64> {
        match self.demo.sampling() {
            Sampling::Unknown => self.dt.map(|dt| dt * sample as f64),
            Sampling::Uniform { dt } => Some(dt * sample as f64),
            Sampling::Stamped { time } => Some(time[sample]),
        }
    }

    /// Returns the location of a sample.
    fn place(&self, sample: usize) -> SampleLocation {
        SampleLocation { sample, time: self.time(sample) }
    }
}
