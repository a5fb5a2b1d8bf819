//! Movements predicted by a context map.

use std::ops::RangeInclusive;

use ndarray::Array2;

use super::conditions::Conditions;
use crate::context::stacking::TRANSITION as MAX_INTERPOLATED;
use crate::context::{ContextPrediction, log_duration_jacobian};
use crate::error::{Error, Result};
use crate::kind::Kind;

/// Movement predicted for a context.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Style, goal and start or anchor, and segment durations.
    pub conditions: Conditions,
    /// Duration or period, in seconds: the sum of the segment durations.
    pub duration: f64,
    /// Covariance (P, P) of style, goal and start or anchor, and segment durations of a new movement, in this order; `None`
    /// if the demonstrations leave no degrees of freedom for its estimate.
    pub covariance: Option<Array2<f64>>,
    /// Degrees of freedom of the estimate of the covariance.
    pub degrees_of_freedom: usize,
    /// Extrapolation (Q,): distance of each value of the context from the demonstrated range, relative to that range; 0
    /// inside the range, infinite for a value other than the only demonstrated one.
    pub extrapolation: Vec<f64>,
}

impl Prediction {
    /// Returns the index of the context value that lies farthest outside its demonstrated range, if by more than a tenth of
    /// it: beyond, the map has the weights of an extrapolation alone.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let contexts = (0..demos.len()).map(|m| vec![(m as f64).into()]).collect();
    /// let model = fit(&demos, &FitOptions::new(Kind::Discrete).contexts(contexts))?;
    /// assert_eq!([0.5, 2.1, 5.0].map(|h| model.predict(&[h]).unwrap().far_value()), [None, None, Some(0)]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn far_value(&self) -> Option<usize> {
        let farthest = self.extrapolation.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        farthest.filter(|(_, distance)| **distance > MAX_INTERPOLATED).map(|(column, _)| column)
    }

    /// Returns the movement for the outputs predicted by the map; its duration is clamped to a range in seconds.
    ///
    /// # Errors
    /// Durations or covariances that overflow.
    pub(crate) fn of(
        outputs: ContextPrediction,
        degrees_of_freedom: usize,
        kind: Kind,
        n_styles: usize,
        n_dofs: usize,
        durations: RangeInclusive<f64>,
    ) -> Result<Self> {
        let ContextPrediction { mean, mut covariance, extrapolation } = outputs;
        let first_duration = n_styles + n_dofs * if kind == Kind::Discrete { 2 } else { 1 };
        let duration = mean[first_duration].exp().clamp(*durations.start(), *durations.end());
        let weights: Vec<f64> =
            mean[first_duration + 1..].iter().chain(&[0.0]).map(|logarithm| logarithm.exp()).collect();
        let sum: f64 = weights.iter().sum();
        let segment_durations: Vec<f64> = weights.iter().map(|weight| duration * weight / sum).collect();
        if let Some(covariance) = &mut covariance {
            let changes = log_duration_jacobian(&segment_durations);
            // Jacobian of the segment durations in seconds with respect to the outputs.
            let mut jacobian = Array2::eye(mean.len());
            for ((k, i), change) in changes.indexed_iter() {
                jacobian[[first_duration + k, first_duration + i]] = segment_durations[k] * change;
            }
            *covariance = jacobian.dot(covariance).dot(&jacobian.t());
        }
        let finite = covariance.iter().flatten().all(|x| x.is_finite());
        if !(finite && duration.is_finite() && segment_durations.iter().all(|&time| time > 0.0)) {
            return Err(Error::Range {
                name: "distance of context from the demonstrations, in their range",
                value: extrapolation.iter().copied().fold(0.0, f64::max),
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
        Ok(Self { conditions, duration, covariance, degrees_of_freedom, extrapolation })
    }
}
