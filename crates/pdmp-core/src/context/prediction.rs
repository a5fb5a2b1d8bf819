//! The movement that a map predicts.

use std::ops::RangeInclusive;

use ndarray::{Array2, ArrayView2, Axis, concatenate};

use super::Expected;
use crate::error::{Error, Result};
use crate::kind::Kind;

/// The movement predicted for a condition. What the kind of primitive does not have is `None`.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Style (J,).
    pub style: Vec<f64>,
    /// Goal (D,), discrete.
    pub goal: Option<Vec<f64>>,
    /// Start (D,), discrete.
    pub start: Option<Vec<f64>>,
    /// Anchor (D,), rhythmic.
    pub anchor: Option<Vec<f64>>,
    /// Time in each segment of the movement (K,), in seconds.
    pub timing: Vec<f64>,
    /// Duration or period, in seconds: the sum of the timing.
    pub duration: f64,
    /// Covariance (P, P) of a new movement's style, goal and start or anchor, and timing, in this order; `None` where the
    /// demonstrations leave no degree of freedom to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// Degrees of freedom from which the covariance is known.
    pub freedom: usize,
    /// How far each value of the context lies outside of those demonstrated, in their range (Q,): 0 inside, infinite
    /// where a value that was never varied differs.
    pub outside: Vec<f64>,
}

/// The outputs of the map (M, P): style, goal and start or anchor, and the timing (M, K) as logarithms: that of the
/// duration, and those of each segment's time relative to the last one's.
pub(crate) fn outputs(
    kind: Kind,
    styles: ArrayView2<f64>,
    [goals, starts, anchors]: [ArrayView2<f64>; 3],
    timings: ArrayView2<f64>,
) -> Array2<f64> {
    let last = timings.ncols() - 1;
    let logarithms = Array2::from_shape_fn(timings.dim(), |(m, k)| match k {
        0 => timings.row(m).sum().ln(),
        _ => (timings[[m, k - 1]] / timings[[m, last]]).ln(),
    });
    let parts = match kind {
        Kind::Discrete => vec![styles, goals, starts, logarithms.view()],
        Kind::Rhythmic => vec![styles, anchors, logarithms.view()],
    };
    // Row counts are equal by construction.
    concatenate(Axis(1), &parts).unwrap_or_default()
}

/// Relative change of each time (K,) in a timing per unit of the outputs that it is foreseen by (K,).
pub(crate) fn relative_changes(timing: &[f64]) -> Array2<f64> {
    let duration: f64 = timing.iter().sum();
    Array2::from_shape_fn((timing.len(), timing.len()), |(k, output)| match output {
        0 => 1.0,
        i => f64::from(u8::from(k == i - 1)) - timing[i - 1] / duration,
    })
}

impl Prediction {
    /// The movement whose outputs are expected, its duration within a range.
    ///
    /// # Errors
    /// Times that overflow.
    pub(crate) fn of(
        expected: Expected,
        freedom: usize,
        kind: Kind,
        n_styles: usize,
        n_dofs: usize,
        durations: RangeInclusive<f64>,
    ) -> Result<Self> {
        let Expected { mean, mut covariance, outside } = expected;
        let first = n_styles + n_dofs * if kind == Kind::Discrete { 2 } else { 1 };
        let duration = mean[first].exp().clamp(*durations.start(), *durations.end());
        let weights: Vec<f64> = mean[first + 1..].iter().chain(&[0.0]).map(|logarithm| logarithm.exp()).collect();
        let whole: f64 = weights.iter().sum();
        let timing: Vec<f64> = weights.iter().map(|weight| duration * weight / whole).collect();
        if let Some(covariance) = &mut covariance {
            let changes = relative_changes(&timing);
            let mut seconds = Array2::eye(mean.len());
            for ((k, i), change) in changes.indexed_iter() {
                seconds[[first + k, first + i]] = timing[k] * change;
            }
            *covariance = seconds.dot(covariance).dot(&seconds.t());
        }
        let finite = covariance.iter().flatten().all(|x| x.is_finite());
        if !(finite && duration.is_finite() && timing.iter().all(|&time| time > 0.0)) {
            return Err(Error::Arguments("context is so far from the demonstrations that the prediction overflows"));
        }
        let part = |k: usize| Some(mean[n_styles + k * n_dofs..n_styles + (k + 1) * n_dofs].to_vec());
        let (goal, start, anchor) = match kind {
            Kind::Discrete => (part(0), part(1), None),
            Kind::Rhythmic => (None, None, part(0)),
        };
        let style = mean[..n_styles].to_vec();
        Ok(Self { style, goal, start, anchor, timing, duration, covariance, freedom, outside })
    }
}
