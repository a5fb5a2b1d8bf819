//! Which cycles of a recording are unlike the others.
//!
//! A number is odd where it lies further from the median than so many times the median absolute deviation, scaled to a
//! normal standard deviation, and further than what never matters.
//!
//! B. Iglewicz, D. C. Hoaglin, How to detect and handle outliers, ASQC Quality Press 1993 (the modified z-score, and the
//! limit of 3.5).

use std::fmt;

use ndarray::{Array2, Axis};

use super::periodicity::STANDS_STILL;
use crate::error::Error;

/// Largest modified z-score.
const LARGEST_SCORE: f64 = 3.5;
/// The median absolute deviation of a normal distribution, over its standard deviation.
const NORMAL: f64 = 0.6745;
/// Periods may always differ from their median by this share,
const PERIODS: f64 = 0.1;
/// and shapes from the median cycle by this many standard deviations of the movement,
const SHAPES: f64 = 0.25;
/// and by this many times what is usual: of few cycles, the scatter is known badly.
const USUAL: f64 = 2.0;

/// Why a cycle was left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// It lasts longer or shorter than the others.
    Period {
        /// Median of the recording's cycles, in seconds.
        median: f64,
    },
    /// It takes another path.
    Shape {
        /// Its distance from the median cycle, over the standard deviation of the movement.
        distance: f64,
        /// The median of that distance over the recording's cycles.
        median: f64,
    },
    /// The recording ends before a whole cycle that begins in the phase of the first recording's.
    Phase,
    /// The recording does not repeat itself.
    Aperiodic {
        /// Where it resembles itself most, in seconds.
        lag: f64,
        /// The mean correlation of all DoFs there.
        share: f64,
        /// The least correlation that chance does not explain.
        least: f64,
    },
    /// The recording stands still.
    Still,
}

impl Reason {
    /// The reason for which a whole recording is left out, from what the search for its period says.
    pub(super) fn of(error: &Error) -> Option<Self> {
        match *error {
            Error::Aperiodic { lag, share, least } => Some(Self::Aperiodic { lag, share, least }),
            Error::Arguments(STANDS_STILL) => Some(Self::Still),
            _ => None,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Reason::Period { median } => write!(f, "the median period is {median:.3} s"),
            Reason::Shape { distance, median } => {
                write!(f, "{distance:.2} standard deviations from the median cycle, the others {median:.2}")
            }
            Reason::Phase => write!(f, "the recording holds no whole cycle from the phase in which the first begins"),
            Reason::Aperiodic { lag, share, least } => Error::Aperiodic { lag, share, least }.fmt(f),
            Reason::Still => write!(f, "{STANDS_STILL}"),
        }
    }
}

/// What is odd about each cycle of one recording, of such periods [s] and closed positions (C, D).
pub(super) fn odd(periods: &[f64], cycles: &[Array2<f64>]) -> Vec<Option<Reason>> {
    let middle = median(periods);
    let deviation = spread(periods, middle);
    let distances = distances(cycles);
    let usual = median(&distances);
    let scatter = spread(&distances, usual);
    let judge = |(&period, &distance): (&f64, &f64)| {
        if (period - middle).abs() > f64::max(LARGEST_SCORE * deviation, PERIODS * middle) {
            return Some(Reason::Period { median: middle });
        }
        let limit = (usual + LARGEST_SCORE * scatter).max(USUAL * usual).max(SHAPES);
        (distance > limit).then_some(Reason::Shape { distance, median: usual })
    };
    periods.iter().zip(&distances).map(judge).collect()
}

/// Root mean square distance of each cycle from the median one, each DoF over its standard deviation.
fn distances(cycles: &[Array2<f64>]) -> Vec<f64> {
    let Some(first) = cycles.first() else { return Vec::new() };
    let centred = |cycle: &Array2<f64>| cycle - &cycle.mean_axis(Axis(0)).unwrap_or_default();
    let cycles: Vec<Array2<f64>> = cycles.iter().map(centred).collect();
    let usual = Array2::from_shape_fn(first.dim(), |place| {
        median(&cycles.iter().map(|cycle| cycle[place]).collect::<Vec<_>>())
    });
    let deviations = usual.std_axis(Axis(0), 0.0);
    let off = |cycle: &Array2<f64>| {
        let off = (cycle - &usual) / &deviations;
        // A DoF at rest tells nothing.
        let moving: Vec<f64> = off.iter().copied().filter(|x| x.is_finite()).collect();
        (moving.iter().map(|x| x * x).sum::<f64>() / moving.len().max(1) as f64).sqrt()
    };
    cycles.iter().map(off).collect()
}

/// The standard deviation of a normal distribution of the same median absolute deviation.
fn spread(numbers: &[f64], middle: f64) -> f64 {
    median(&numbers.iter().map(|x| (x - middle).abs()).collect::<Vec<_>>()) / NORMAL
}

pub(super) fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { 0.0 } else { (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0 }
}
