//! Inspection of demonstrations for samples that no movement makes: what is found is reported, with its place.
//!
//! | module | finding |
//! |---|---|
//! | `stamps` | two time stamps far closer than the others |
//! | `dropouts` | samples that were lost and written as exact zeros |
//! | `padding` | rows appended to bring recordings to one length |
//! | `counters` | a column that counts samples, or repeats the time stamps |
//! | `turns` | angles that jump by a full turn, or lie whole turns apart in different demonstrations |
//!
//! One pass over the samples collects the ranges and steps of each degree of freedom; what they exclude is not examined
//! further. A fit adds its own finding, gains whose transients the samples do not resolve, in `fit/stiffness.rs`.

mod counters;
mod dropouts;
mod finding;
mod padding;
mod stamps;
mod turns;

use ndarray::ArrayView1;

use crate::demo::{Demonstration, Sampling};

pub use finding::{Finding, Padding, Place};
pub use turns::{turn_of, unwound};

/// Fewest samples of which the usual step of a degree of freedom is known.
const MIN_SAMPLES: usize = 10;

/// Returns what is implausible about the samples of demonstrations of one skill.
///
/// `dt` in seconds is the sampling interval of those that carry none; without it places are given by sample alone.
pub fn inspect(demos: &[Demonstration], dt: Option<f64>) -> Vec<Finding> {
    let surveys: Vec<Survey> = demos.iter().map(|demo| Survey::new(demo, dt)).collect();
    let mut findings = Vec::new();
    for (m, survey) in surveys.iter().enumerate() {
        findings.extend(stamps::close(m, survey));
        findings.extend(dropouts::zeros(m, survey));
        findings.extend(turns::wraps(m, survey));
    }
    findings.extend(padding::rows(&surveys));
    findings.extend(counters::columns(&surveys));
    findings.extend(turns::apart(&surveys));
    findings
}

/// A demonstration with the ranges and steps of its degrees of freedom.
struct Survey<'a> {
    demo: &'a Demonstration,
    dt: Option<f64>,
    dofs: Vec<Extent>,
}

/// The values of one degree of freedom.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: f64,
    high: f64,
    /// Largest step from one sample to the next.
    step: f64,
    /// Whether a sample is exactly zero.
    zero: bool,
}

impl<'a> Survey<'a> {
    fn new(demo: &'a Demonstration, dt: Option<f64>) -> Self {
        let position = demo.position();
        let first = position.row(0);
        let start = |&y: &f64| Extent { low: y, high: y, step: 0.0, zero: y == 0.0 };
        let mut dofs: Vec<Extent> = first.iter().map(start).collect();
        let mut before = first;
        for row in position.rows().into_iter().skip(1) {
            for ((dof, &y), &last) in dofs.iter_mut().zip(row).zip(before) {
                let step = (y - last).abs();
                dof.low = if y < dof.low { y } else { dof.low };
                dof.high = if y > dof.high { y } else { dof.high };
                dof.step = if step > dof.step { step } else { dof.step };
                dof.zero |= y == 0.0;
            }
            before = row;
        }
        Self { demo, dt, dofs }
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
