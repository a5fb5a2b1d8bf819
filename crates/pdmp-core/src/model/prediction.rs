//! The movement that a map predicts.

use std::ops::RangeInclusive;

use ndarray::Array2;

use super::conditions::Conditions;
use crate::context::{ContextPrediction, relative_changes};
use crate::error::{Error, Result};
use crate::kind::Kind;

/// The movement predicted for a condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Style, goal and start or anchor, and timing.
    pub conditions: Conditions,
    /// Duration or period, in seconds: the sum of the timing.
    pub duration: f64,
    /// Covariance (P, P) of a new movement's style, goal and start or anchor, and timing, in this order; `None` where the
    /// demonstrations leave no degree of freedom to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// Degrees of freedom from which the covariance is known.
    pub degrees_of_freedom: usize,
    /// How far each value of the context lies outside of those demonstrated, in their range (Q,): 0 inside, infinite
    /// where a value that was never varied differs.
    pub outside: Vec<f64>,
}

impl Prediction {
    /// The movement whose outputs are expected, its duration within a range.
    ///
    /// # Errors
    /// Times that overflow.
    pub(crate) fn of(
        expected: ContextPrediction,
        degrees_of_freedom: usize,
        kind: Kind,
        n_styles: usize,
        n_dofs: usize,
        durations: RangeInclusive<f64>,
    ) -> Result<Self> {
        let ContextPrediction { mean, mut covariance, outside } = expected;
        let first = n_styles + n_dofs * if kind == Kind::Discrete { 2 } else { 1 };
        let duration = mean[first].exp().clamp(*durations.start(), *durations.end());
        let weights: Vec<f64> = mean[first + 1..].iter().chain(&[0.0]).map(|logarithm| logarithm.exp()).collect();
        let whole: f64 = weights.iter().sum();
        let segment_durations: Vec<f64> = weights.iter().map(|weight| duration * weight / whole).collect();
        if let Some(covariance) = &mut covariance {
            let changes = relative_changes(&segment_durations);
            let mut seconds = Array2::eye(mean.len());
            for ((k, i), change) in changes.indexed_iter() {
                seconds[[first + k, first + i]] = segment_durations[k] * change;
            }
            *covariance = seconds.dot(covariance).dot(&seconds.t());
        }
        let finite = covariance.iter().flatten().all(|x| x.is_finite());
        if !(finite && duration.is_finite() && segment_durations.iter().all(|&time| time > 0.0)) {
            return Err(Error::Range {
                name: "distance of context from the demonstrations, in their range",
                value: outside.iter().copied().fold(0.0, f64::max),
                allowed: "the prediction overflows; pass a context closer to the demonstrations",
            });
        }
        let part = |k: usize| Some(mean[n_styles + k * n_dofs..n_styles + (k + 1) * n_dofs].to_vec());
        let (goal, start, anchor) = match kind {
            Kind::Discrete => (part(0), part(1), None),
            Kind::Rhythmic => (None, None, part(0)),
        };
        let style = Some(mean[..n_styles].to_vec());
        let conditions = Conditions {
            style,
            goal,
            start,
            anchor,
            segment_durations: Some(segment_durations),
            ..Conditions::default()
        };
        Ok(Self { conditions, duration, covariance, degrees_of_freedom, outside })
    }
}
