//! Outliers, jumps and stuck sensors: steps from one sample to the next far beyond all others nearby.
//!
//! The size of a step is compared to the second largest of the steps nearby, since the largest may lead back from an outlier,
//! and to the 0.9 quantile of the non-zero steps of the degree of freedom, which noise and the steps of a quantised sensor
//! determine. The smaller one of the two ratios is that of the finding. A step is
//!
//! - that to an outlier, if a step back follows within [`NEARBY`] samples;
//! - the restart of a stuck sensor, if equal samples precede it;
//! - a jump otherwise.
//!
//! Of the recordings in `pdmp.datasets.REGISTRY`, 1284 with 11 000 curves, 23 of one set and one of another exceed the
//! limits, all with a jump: samples are missing between two that are one interval apart. Of 11 000 synthetic movements with
//! white, heavy-tailed, correlated and quantised noise at 30 to 1000 Hz, 11 do, in all of which fewer than three samples
//! resolve a fast motion or an impact.

use ndarray::ArrayView1;

use super::{Finding, Survey};
use crate::demonstration::Sampling;
use crate::numerics::statistics::upper_median;

/// Minimum number of samples of a demonstration whose steps are compared.
const MIN_COMPARED: usize = 20;
/// Number of steps before and after a step with which it is compared.
pub(super) const NEARBY: usize = 7;
/// Minimum number of steps before and after a step: a force may start with an impact.
const MIN_BESIDE: usize = 3;
/// Minimum ratio of a jump. The recordings without a fault reach 5.3.
const MIN_RATIO: f64 = 8.0;
/// Minimum ratio of the step after equal samples.
const MIN_RATIO_STUCK: f64 = 4.0;
/// Minimum number of equal samples of a stuck sensor.
const MIN_EQUAL: usize = 4;
/// Minimum step relative to the range of the degree of freedom.
const MIN_SHARE: f64 = 0.02;
/// Quantile of the usual steps.
const QUANTILE: f64 = 0.9;
/// Minimum fraction of non-zero steps: a gripper that opens and closes rests most of the time.
const MIN_MOVING: f64 = 0.5;
/// Minimum step back from an outlier, relative to that to it.
const MIN_RETURN: f64 = 0.5;

/// Place of a step far beyond all others nearby.
struct Event {
    kind: Kind,
    dof: usize,
    /// First and last sample of the outliers or of the equal samples, or twice the sample after a jump.
    samples: [usize; 2],
    step: f64,
    ratio: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Outlier,
    Jump,
    Stuck,
}

/// Finds the worst outlier, jump and stuck sensor of a demonstration, unless one of its known findings explains the step.
/// Returns also the degrees of freedom with any of them.
pub(super) fn steps(demo: usize, survey: &Survey, known: &[Finding]) -> (Vec<Finding>, Vec<usize>) {
    if survey.n_samples() < MIN_COMPARED {
        return Default::default();
    }
    let rounding = survey.rounding();
    let may_jump = |d: &usize| survey.steps[*d] > f64::max(MIN_SHARE * survey.ranges[*d], rounding);
    let mut events = Vec::new();
    for d in (0..survey.n_dofs).filter(may_jump) {
        let name = survey.name(d);
        let is_known = |c: usize| known.iter().any(|finding| explains(finding, demo, &name, c));
        events.extend(events_of(d, survey, is_known));
    }
    let worst = |kind: Kind| {
        let of_kind = || events.iter().filter(move |event| event.kind == kind);
        let worst = of_kind().max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
        let [from, to] = worst.samples.map(|c| survey.place(c));
        let (dof, step, ratio, others) = (survey.name(worst.dof), worst.step, worst.ratio, of_kind().count() - 1);
        Some(match kind {
            Kind::Outlier => Finding::Outlier { demo, dof, from, to, step, ratio, others },
            Kind::Jump => Finding::Jump { demo, dof, place: from, step, ratio, others },
            Kind::Stuck => Finding::Stuck { demo, dof, from, to, step, ratio, others },
        })
    };
    let findings = [Kind::Outlier, Kind::Stuck, Kind::Jump].into_iter().filter_map(worst).collect();
    (findings, events.iter().map(|event| event.dof).collect())
}

/// Returns whether a finding is about the step of a degree of freedom to the sample `c`.
fn explains(finding: &Finding, demo: usize, name: &String, c: usize) -> bool {
    match finding {
        Finding::Zeros { demo: own, dofs, from, to, .. } => {
            *own == demo && dofs.contains(name) && (from.sample..=to.sample + 1).contains(&c)
        }
        Finding::Wrap { demo: own, dof, .. } => *own == demo && dof == name,
        Finding::Padded { demo: own, from, .. } => *own == demo && c >= from.sample,
        _ => false,
    }
}

/// Returns the events of a degree of freedom.
fn events_of(dof: usize, survey: &Survey, is_known: impl Fn(usize) -> bool) -> Vec<Event> {
    let column = survey.column(dof);
    let n = column.len();
    // A bound of the ratio that most curves do not pass after a part of their samples.
    let (mut moving, mut large) = (0, 0);
    let most = (1.0 - QUANTILE) * n as f64 + 1.0;
    let mut before = column[0];
    for &y in column {
        let step = (y - before).abs();
        before = y;
        moving += usize::from(step > 0.0);
        large += usize::from(MIN_RATIO_STUCK * step > survey.steps[dof]);
        if large as f64 > most {
            return Vec::new();
        }
    }
    if large as f64 > (1.0 - QUANTILE) * moving as f64 + 1.0 || (moving as f64) < MIN_MOVING * (n - 1) as f64 {
        return Vec::new();
    }
    let steps = per_usual_interval(survey, column);
    let size = |c: usize| steps[c].abs();
    let mut nonzero: Vec<f64> = (1..n).map(size).filter(|size| *size > 0.0).collect();
    let k = (QUANTILE * nonzero.len() as f64) as usize;
    let usual = *nonzero.select_nth_unstable_by(k, f64::total_cmp).1;
    let (mut events, mut c) = (Vec::new(), MIN_BESIDE + 1);
    while c + MIN_BESIDE < n {
        let (sample, step) = (c, column[c] - column[c - 1]);
        c += 1;
        if size(sample) <= f64::max(MIN_RATIO_STUCK * usual, MIN_SHARE * survey.ranges[dof]) || is_known(sample) {
            continue;
        }
        let ratio = size(sample) / second_largest(sample, n, size).max(usual);
        let equal = (1..sample).rev().take_while(|c| steps[*c] == 0.0).count() + 1;
        let event = |kind, samples| Event { kind, dof, samples, step, ratio };
        if equal >= MIN_EQUAL && ratio >= MIN_RATIO_STUCK {
            events.push(event(Kind::Stuck, [sample - equal, sample - 1]));
        } else if ratio >= MIN_RATIO {
            let mut after = sample + 1..n.min(sample + 1 + NEARBY);
            match after.find(|c| steps[*c] * step < 0.0 && size(*c) >= MIN_RETURN * size(sample)) {
                Some(back) => {
                    events.push(event(Kind::Outlier, [sample, back - 1]));
                    c = back + 1;
                }
                None => events.push(event(Kind::Jump, [sample; 2])),
            }
        }
    }
    events
}

/// Returns the second largest size of the steps near that to the sample `c`, of `n` samples.
pub(super) fn second_largest(c: usize, n: usize, size: impl Fn(usize) -> f64) -> f64 {
    let nearby = (c.saturating_sub(NEARBY).max(1)..n.min(c + 1 + NEARBY)).filter(|other| *other != c);
    let [_, second] =
        nearby.map(size).fold(
            [0.0f64; 2],
            |[first, second], size| {
                if size > first { [size, first] } else { [first, second.max(size)] }
            },
        );
    second
}

/// Returns the steps (T,) to each sample, the first of which is 0; those over a longer interval than usual are reduced to it.
fn per_usual_interval(survey: &Survey, column: ArrayView1<f64>) -> Vec<f64> {
    let steps = (0..column.len()).map(|c| column[c] - column[c.saturating_sub(1)]);
    let Sampling::Stamped { time } = survey.demo.sampling() else { return steps.collect() };
    let usual = upper_median(time.windows(2).map(|pair| pair[1] - pair[0]));
    steps.enumerate().map(|(c, step)| step / ((time[c] - time[c.saturating_sub(1)]) / usual).max(1.0)).collect()
}
