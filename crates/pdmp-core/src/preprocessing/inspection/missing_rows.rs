//! Long intervals between time stamps, within which the samples do not determine the movement.
//!
//! Interpolation over such an interval is tested on equally long parts elsewhere in the demonstration: the middle of each is
//! compared to the cubic polynomial through four samples, at ±g/2 and ±3g/4 from it for an interval of length g,
//!
//! ```text
//! y(0) ≈ 9/10·(y(−g/2) + y(g/2)) − 4/10·(y(−3g/4) + y(3g/4))
//! ```

use ndarray::ArrayView1;

use super::{Finding, Survey};
use crate::demonstration::Sampling;
use crate::numerics::statistics::upper_median;
use crate::preprocessing::gaps::MIN_MISSING_INTERVALS as MIN_INTERVALS;

/// Minimum error of interpolation relative to the range of a degree of freedom.
const MIN_ERROR: f64 = 0.1;
/// Minimum ratio of that error to that over a few samples, which is due to noise.
const MIN_ERROR_TO_NOISE: f64 = 3.0;
/// Interval of the error due to noise, relative to the median one.
const NOISE_INTERVALS: f64 = 4.0;
/// Maximum number of parts that are compared.
const MAX_PARTS: usize = 1000;

/// Finds the longest interval of a demonstration over which the samples do not determine the movement.
pub(super) fn interval(demo: usize, survey: &Survey) -> Option<Finding> {
    let Sampling::Stamped { time } = survey.demo.sampling() else { return None };
    let n = time.len();
    let length = |c: usize| time[c] - time[c - 1];
    let longest = (1..n).max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
    let short = (1..n).filter(|&c| MIN_INTERVALS * length(c) < length(longest)).count();
    if 2 * short < n - 1 {
        return None;
    }
    let usual = upper_median((1..n).map(length));
    let ratio = length(longest) / usual;
    if ratio <= MIN_INTERVALS {
        return None;
    }
    let mut parts = Parts { time, gaps: (1..n).filter(|&c| length(c) > MIN_INTERVALS * usual).collect() };
    parts.gaps.push(n);
    let rounding = survey.rounding();
    let mut error = None;
    let mut largest = MIN_ERROR;
    for d in (0..survey.n_dofs).filter(|d| survey.ranges[*d] > rounding) {
        let column = survey.column(d);
        let Some(deviation) = parts.largest_error(column, length(longest)) else { break };
        let noise = parts.largest_error(column, NOISE_INTERVALS * usual).unwrap_or(0.0);
        let share = deviation / survey.ranges[d];
        if share > largest && deviation > MIN_ERROR_TO_NOISE * noise {
            largest = share;
            error = Some((survey.name(d), share));
        }
    }
    let comparable = parts.middles(length(longest)).next().is_some();
    let [from, to] = [longest - 1, longest].map(|c| survey.place(c));
    (error.is_some() || !comparable).then_some(Finding::MissingRows { demo, from, to, ratio, error })
}

/// Parts of a recording between its long intervals.
struct Parts<'a> {
    time: &'a [f64],
    /// Samples after each long interval, and the number of samples.
    gaps: Vec<usize>,
}

impl Parts<'_> {
    /// Returns the samples in the middle of a stretch of one and a half times a length without a long interval, with the
    /// first and the last sample of the part.
    fn middles(&self, length: f64) -> impl Iterator<Item = (usize, [usize; 2])> + '_ {
        let firsts = std::iter::once(0).chain(self.gaps.iter().copied());
        let ends = firsts.zip(&self.gaps).map(|(first, end)| [first, end - 1]);
        ends.flat_map(move |[first, last]| {
            let inside = move |c: &usize| {
                let margin = 0.75 * length;
                self.time[*c] - self.time[first] >= margin && self.time[last] - self.time[*c] >= margin
            };
            (first..=last).filter(inside).map(move |c| (c, [first, last]))
        })
    }

    /// Returns the largest error of interpolation over parts of a length, or none if there is no such part.
    fn largest_error(&self, column: ArrayView1<f64>, length: f64) -> Option<f64> {
        let count = self.middles(length).count();
        let stride = count.div_ceil(MAX_PARTS).max(1);
        let error = |(c, ends): (usize, [usize; 2])| {
            let at = |offset: f64| self.value(column, self.time[c] + offset * length, ends);
            (column[c] - 0.9 * (at(-0.5) + at(0.5)) + 0.4 * (at(-0.75) + at(0.75))).abs()
        };
        self.middles(length).step_by(stride).map(error).reduce(f64::max)
    }

    /// Returns the value at a time, by linear interpolation between the samples of a part.
    fn value(&self, column: ArrayView1<f64>, at: f64, [first, last]: [usize; 2]) -> f64 {
        let c = (first + self.time[first..=last].partition_point(|time| *time <= at)).clamp(first + 1, last);
        let share = (at - self.time[c - 1]) / (self.time[c] - self.time[c - 1]);
        column[c - 1] + share * (column[c] - column[c - 1])
    }
}
