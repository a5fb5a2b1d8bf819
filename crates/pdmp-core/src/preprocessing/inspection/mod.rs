//! Inspection of demonstrations for implausible samples, which are reported with their location.
//!
//! | module | finding |
//! |---|---|
//! | `time_stamps` | two time stamps far closer than the others |
//! | `dropouts` | lost samples that were written as exact zeros |
//! | `padding` | rows that were appended to make recordings equally long |
//! | `counters` | a column that counts samples, or repeats the time stamps |
//! | `turns` | angles that jump by a full turn, or that are offset by whole turns between demonstrations |
//! | `cycle_ends` | cycles that are not closed, or repeat their first sample |
//!
//! One pass over the samples computes the largest step and detects zeros, which rules out most faults cheaply. A fit adds
//! its own findings, such as gains whose transients the samples do not resolve (`learning/stiffness.rs`).

mod counters;
mod cycle_ends;
mod dropouts;
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
pub use turns::unwound;
pub(crate) use turns::{REFERENCE_SAMPLES, reference, unwound_from};

/// Minimum number of samples for an estimate of the usual step of a degree of freedom.
const MIN_SAMPLES: usize = 10;

/// Largest rounding error relative to the largest coordinate of a demonstration. A constant computed from others, such as an
/// angle of a joint that is not tracked, has errors of 3e-16 in recorded BVH files; products of many rotations have more.
const ROUNDING: f64 = 1e-12;

/// Number of values that are processed in parallel, for vector registers.
const LANES: usize = 8;

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
    let surveys: Vec<Survey> = demos.iter().map(|demo| Survey::new(demo, dt)).collect();
    let mut findings = Vec::new();
    for (m, survey) in surveys.iter().enumerate() {
        findings.extend(time_stamps::close(m, survey));
        findings.extend(dropouts::zeros(m, survey));
        findings.extend(turns::wraps(m, survey));
    }
    findings.extend(padding::rows(&surveys));
    findings.extend(counters::columns(&surveys));
    findings.extend(turns::apart(&surveys));
    findings.extend(quaternions::undeclared(&surveys));
    findings
}

/// Demonstration with statistics from one pass over its samples.
struct Survey<'a> {
    demo: &'a Demonstration,
    dt: Option<f64>,
    n_dofs: usize,
    /// Largest step of any degree of freedom from one sample to the next.
    step: f64,
    /// True if any sample is exactly zero.
    zero: bool,
}

impl<'a> Survey<'a> {
    fn new(demo: &'a Demonstration, dt: Option<f64>) -> Self {
        let n_dofs = demo.n_coordinates();
        let position = demo.position();
        let position = position.as_standard_layout();
        let values = row_major(&position);
        let (mut steps, mut zero) = ([0.0f64; LANES], false);
        let mut add = |lane: usize, value: f64, before: f64| {
            let step = (value - before).abs();
            steps[lane] = if step > steps[lane] { step } else { steps[lane] };
            zero |= value == 0.0;
        };
        let (later, earlier) = (&values[n_dofs..], &values[..values.len() - n_dofs]);
        let (whole, rest) = (later.chunks_exact(LANES), later.len() / LANES * LANES);
        for (later, earlier) in whole.zip(earlier.chunks_exact(LANES)) {
            (0..LANES).for_each(|lane| add(lane, later[lane], earlier[lane]));
        }
        later[rest..].iter().zip(&earlier[rest..]).for_each(|(later, earlier)| add(0, *later, *earlier));
        zero |= values[..n_dofs].contains(&0.0);
        Self { demo, dt, n_dofs, step: steps.into_iter().fold(0.0, f64::max), zero }
    }

    /// Returns the largest step between neighbouring samples of a degree of freedom.
    fn largest_step(&self, d: usize) -> f64 {
        let column = self.column(d);
        (1..column.len()).fold(0.0, |step, c| step.max((column[c] - column[c - 1]).abs()))
    }

    /// Returns the size of steps that are rounding errors.
    fn rounding(&self) -> f64 {
        ROUNDING * self.demo.position().iter().fold(0.0f64, |most, value| most.max(value.abs()))
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
