//! The movement that a map predicts.

use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate};

use super::Expected;
use crate::error::{Error, Result};
use crate::phase::Kind;

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
    /// Duration or period, in seconds.
    pub duration: f64,
    /// Covariance (P, P) of a new movement's style, goal and start or anchor, and duration, in this order; `None` where
    /// the demonstrations leave no degree of freedom to estimate it.
    pub covariance: Option<Array2<f64>>,
    /// Degrees of freedom from which the covariance is known.
    pub freedom: usize,
    /// How far each value of the context lies outside of those demonstrated, in their range (Q,): 0 inside, infinite
    /// where a value that was never varied differs.
    pub outside: Vec<f64>,
}

/// The outputs of the map (M, P): style, goal and start or anchor, logarithm of the duration.
pub(crate) fn outputs(
    kind: Kind,
    styles: ArrayView2<f64>,
    [goals, starts, anchors]: [ArrayView2<f64>; 3],
    durations: &[f64],
) -> Array2<f64> {
    let logarithm = Array1::from_iter(durations.iter().map(|t| t.ln())).insert_axis(Axis(1));
    let parts = match kind {
        Kind::Discrete => vec![styles, goals, starts, logarithm.view()],
        Kind::Rhythmic => vec![styles, anchors, logarithm.view()],
    };
    // Row counts are equal by construction.
    concatenate(Axis(1), &parts).unwrap_or_default()
}

impl Prediction {
    /// The movement whose outputs are expected.
    ///
    /// # Errors
    /// A duration that overflows.
    pub(crate) fn of(expected: Expected, freedom: usize, kind: Kind, n_styles: usize, n_dofs: usize) -> Result<Self> {
        let Expected { mean, mut covariance, outside } = expected;
        let n = mean.len();
        let duration = mean[n - 1].exp();
        if let Some(covariance) = &mut covariance {
            // dT = T d(ln T).
            covariance.row_mut(n - 1).mapv_inplace(|x| x * duration);
            covariance.column_mut(n - 1).mapv_inplace(|x| x * duration);
        }
        let finite = covariance.iter().flatten().all(|x| x.is_finite());
        if !(finite && duration.is_finite() && duration > 0.0) {
            return Err(Error::Arguments("context is so far from the demonstrations that the prediction overflows"));
        }
        let part = |k: usize| Some(mean[n_styles + k * n_dofs..n_styles + (k + 1) * n_dofs].to_vec());
        let (goal, start, anchor) = match kind {
            Kind::Discrete => (part(0), part(1), None),
            Kind::Rhythmic => (None, None, part(0)),
        };
        let style = mean[..n_styles].to_vec();
        Ok(Self { style, goal, start, anchor, duration, covariance, freedom, outside })
    }
}
