//! Inspection of demonstrations for samples that no movement makes: what is found is reported, with its place.
//!
//! | module | finding |
//! |---|---|
//! | `time_stamps` | two time stamps far closer than the others |
//! | `dropouts` | samples that were lost and written as exact zeros |
//! | `padding` | rows appended to bring recordings to one length |
//! | `counters` | a column that counts samples, or repeats the time stamps |
//! | `turns` | angles that jump by a full turn, or lie whole turns apart in different demonstrations |
//!
//! One pass over the samples finds the largest step and whether there are zeros; what these exclude is not examined
//! further. A fit adds its own finding, gains whose transients the samples do not resolve, in `learning/stiffness.rs`.

mod counters;
mod dropouts;
mod padding;
mod time_stamps;
mod turns;

use ndarray::ArrayView1;

use crate::demonstration::{Demonstration, Sampling};
use crate::model::finding::Place;
pub use crate::model::finding::{Finding, Padding};

pub use turns::{turn_of, unwound};

/// Fewest samples of which the usual step of a degree of freedom is known.
const MIN_SAMPLES: usize = 10;

/// Values that are examined side by side.
const LANES: usize = 8;

/// Returns what is implausible about the samples of demonstrations of one skill.
///
/// `dt` in seconds is the sampling interval of those that carry none; without it places are given by sample alone.
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
    findings
}

/// A demonstration with what one pass over all samples tells.
struct Survey<'a> {
    demo: &'a Demonstration,
    dt: Option<f64>,
    n_dofs: usize,
    /// Largest step of any degree of freedom from one sample to the next.
    step: f64,
    /// Whether any sample is exactly zero.
    zero: bool,
}

/// The values of one degree of freedom.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: f64,
    high: f64,
    /// Largest step from one sample to the next.
    step: f64,
}

impl<'a> Survey<'a> {
    fn new(demo: &'a Demonstration, dt: Option<f64>) -> Self {
        let n_dofs = demo.n_dofs();
        let position = demo.position();
        let position = position.as_standard_layout();
        let values = position.as_slice().unwrap_or_default();
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

    fn extent(&self, d: usize) -> Extent {
        let column = self.column(d);
        let start = Extent { low: column[0], high: column[0], step: 0.0 };
        (1..column.len()).fold(start, |Extent { low, high, step }, c| Extent {
            low: low.min(column[c]),
            high: high.max(column[c]),
            step: step.max((column[c] - column[c - 1]).abs()),
        })
    }

    fn n_samples(&self) -> usize {
        self.demo.n_samples()
    }

    fn column(&self, d: usize) -> ArrayView1<'a, f64> {
        // A view lives as long as the demonstration.
        self.demo.position().index_axis_move(ndarray::Axis(1), d)
    }

    /// Name of a degree of freedom, that of a model where it has none.
    fn name(&self, d: usize) -> String {
        self.demo.names().map_or_else(|| format!("y{d}"), |names| names[d].clone())
    }

    /// The time of a sample in seconds, where it is known.
    fn time(&self, sample: usize) -> Option<f64> {
        match self.demo.sampling() {
            Sampling::Unknown => self.dt.map(|dt| dt * sample as f64),
            Sampling::Uniform { dt } => Some(dt * sample as f64),
            Sampling::Stamped { time } => Some(time[sample]),
        }
    }

    fn place(&self, sample: usize) -> Place {
        Place { sample, time: self.time(sample) }
    }
}
