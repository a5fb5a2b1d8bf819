//! Outliers among the cycles of a recording.
//!
//! A period or a shape is an outlier if its modified z-score, the distance from the median over the median absolute
//! deviation scaled to a normal standard deviation, exceeds a limit, and the distance itself another one.
//!
//! B. Iglewicz, D. C. Hoaglin, How to detect and handle outliers, ASQC Quality Press 1993 (modified z-score and its limit
//! of 3.5).

use std::fmt;
use std::ops::Range;

use ndarray::{Array2, Axis, s};

use super::periodicity::NO_CYCLES;
use crate::error::Error;
use crate::numerics::statistics::median;

/// Maximum modified z-score.
const MAX_SCORE: f64 = 3.5;
/// Median absolute deviation of a normal distribution, relative to its standard deviation.
const NORMAL_DEVIATION: f64 = 0.6745;
/// Relative deviation from the median period that is always accepted.
const PERIOD_TOLERANCE: f64 = 0.1;
/// Distance from the median cycle that is always accepted, in standard deviations of the movement.
const SHAPE_TOLERANCE: f64 = 0.25;
/// Multiple of the median distance that is always accepted: the scatter is uncertain for few cycles.
const DISTANCE_TOLERANCE: f64 = 2.0;

/// Reason for which a cycle or a recording was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RejectionReason {
    /// Period that differs from the others.
    Period {
        /// Median period of the recording, in seconds.
        median: f64,
    },
    /// Path that differs from the others.
    Shape {
        /// Distance from the median cycle, in standard deviations of the movement.
        distance: f64,
        /// Median of that distance over the cycles of the recording.
        median: f64,
    },
    /// No complete cycle that begins in the phase of the first recording.
    Phase,
    /// No period.
    Aperiodic {
        /// Lag of the largest autocorrelation, in seconds.
        lag: f64,
        /// Mean autocorrelation of all DoFs at that lag.
        share: f64,
        /// Minimum autocorrelation of a periodic recording.
        least: f64,
    },
    /// No movement.
    Still,
}

impl RejectionReason {
    /// Returns the reason for which a whole recording is rejected, from the error of the search for its period; `None` for
    /// an error of another kind.
    pub(super) fn of(error: &Error) -> Option<Self> {
        match *error {
            Error::Aperiodic { lag, share, least } => Some(Self::Aperiodic { lag, share, least }),
            Error::Still { .. } => Some(Self::Still),
            _ => None,
        }
    }
}

impl fmt::Display for RejectionReason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            RejectionReason::Period { median } => write!(f, "the median period is {median:.3} s"),
            RejectionReason::Shape { distance, median } => {
                write!(f, "{distance:.2} standard deviations from the median cycle, the others {median:.2}")
            }
            RejectionReason::Phase => {
                write!(f, "the recording has no complete cycle that begins in the phase of the first recording")
            }
            RejectionReason::Aperiodic { lag, share, least } => Error::Aperiodic { lag, share, least }.fmt(f),
            RejectionReason::Still => Error::Still { consequence: NO_CYCLES }.fmt(f),
        }
    }
}

/// Returns for each cycle of a recording the reason of its rejection, if any, from the periods in seconds and the closed
/// positions (C, D) with the columns of each rotation.
pub(super) fn rejections(
    periods: &[f64],
    cycles: &[Array2<f64>],
    rotations: &[Range<usize>],
) -> Vec<Option<RejectionReason>> {
    let median_period = median(periods);
    let period_limit = f64::max(MAX_SCORE * deviation(periods, median_period), PERIOD_TOLERANCE * median_period);
    let distances = distances(cycles, rotations);
    let median_distance = median(&distances);
    let distance_limit = (median_distance + MAX_SCORE * deviation(&distances, median_distance))
        .max(DISTANCE_TOLERANCE * median_distance)
        .max(SHAPE_TOLERANCE);
    let rejection = |(&period, &distance): (&f64, &f64)| {
        if (period - median_period).abs() > period_limit {
            return Some(RejectionReason::Period { median: median_period });
        }
        (distance > distance_limit).then_some(RejectionReason::Shape { distance, median: median_distance })
    };
    periods.iter().zip(&distances).map(rejection).collect()
}

/// Returns the root mean square distance of each cycle from the median cycle, each DoF relative to its standard deviation,
/// the columns of a rotation relative to that of all of them.
fn distances(cycles: &[Array2<f64>], rotations: &[Range<usize>]) -> Vec<f64> {
    let Some(first) = cycles.first() else { return Vec::new() };
    let centred = |cycle: &Array2<f64>| cycle - &cycle.mean_axis(Axis(0)).unwrap_or_default();
    let cycles: Vec<Array2<f64>> = cycles.iter().map(centred).collect();
    let median_cycle = Array2::from_shape_fn(first.dim(), |index| {
        median(&cycles.iter().map(|cycle| cycle[index]).collect::<Vec<_>>())
    });
    let mut deviations = median_cycle.std_axis(Axis(0), 0.0);
    for columns in rotations {
        let mut own = deviations.slice_mut(s![columns.clone()]);
        let common = own.iter().map(|x| x * x).sum::<f64>() / own.len() as f64;
        own.fill(common.sqrt());
    }
    let distance = |cycle: &Array2<f64>| {
        let differences = (cycle - &median_cycle) / &deviations;
        // The quotient is not finite for a DoF at rest, which is left out.
        let moving: Vec<f64> = differences.iter().copied().filter(|x| x.is_finite()).collect();
        (moving.iter().map(|x| x * x).sum::<f64>() / moving.len().max(1) as f64).sqrt()
    };
    cycles.iter().map(distance).collect()
}

/// Returns the standard deviation of a normal distribution with the median absolute deviation of the numbers.
fn deviation(numbers: &[f64], middle: f64) -> f64 {
    median(&numbers.iter().map(|x| (x - middle).abs()).collect::<Vec<_>>()) / NORMAL_DEVIATION
}
