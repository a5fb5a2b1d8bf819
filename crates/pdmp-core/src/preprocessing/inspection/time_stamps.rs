//! Time stamps that are far closer than the others.

use super::{Finding, Survey};
use crate::demonstration::Sampling;
use crate::numerics::statistics::upper_median;

/// Maximum interval of two close stamps, relative to the median interval.
const CLOSE_INTERVAL: f64 = 0.1;
/// Maximum rate of change of a movement between close stamps, relative to the largest elsewhere. The rate due to noise is
/// inversely proportional to the interval.
const MAX_RATIO: f64 = 5.0;

/// Finds the close pair of stamps of a demonstration with the largest relative rate of change.
pub(super) fn close(demo: usize, survey: &Survey) -> Option<Finding> {
    let Sampling::Stamped { time } = survey.demo.sampling() else { return None };
    let intervals: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let shortest = intervals.iter().fold(f64::INFINITY, |min, &interval| min.min(interval));
    let mean = (time[time.len() - 1] - time[0]) / intervals.len() as f64;
    if shortest > CLOSE_INTERVAL * mean {
        return None;
    }
    let usual = upper_median(intervals.iter().copied());
    let mut worst: Option<Finding> = None;
    let mut max_ratio = MAX_RATIO;
    for d in 0..survey.n_dofs {
        let column = survey.column(d);
        let (mut usual_rate, mut close_rate, mut at) = (0.0f64, 0.0f64, 0);
        for (c, &interval) in intervals.iter().enumerate() {
            let rate = ((column[c + 1] - column[c]) / interval).abs();
            if interval >= CLOSE_INTERVAL * usual {
                usual_rate = usual_rate.max(rate);
            } else if rate > close_rate {
                (close_rate, at) = (rate, c + 1);
            }
        }
        if usual_rate > 0.0 && close_rate > max_ratio * usual_rate {
            max_ratio = close_rate / usual_rate;
            let (dof, place, interval) = (survey.name(d), survey.place(at), intervals[at - 1]);
            worst = Some(Finding::CloseStamps { demo, dof, place, interval, usual, ratio: max_ratio });
        }
    }
    worst
}
