//! From a condition to a movement (Section 4.1.2): the linear map U: h ↦ β[h, 1]ᵀ.
//!
//! The paper predicts the style alone. Goal, start, anchor and timing vary with the condition too, so one least squares
//! problem predicts them together. Times enter by their logarithms and so stay positive.

use faer::Mat;
use faer::linalg::solvers::Svd;
use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate};

use crate::error::{Error, Result, check_vector};
use crate::phase::Kind;

/// A linear map from contexts (Q,) to all that a movement needs (P,).
#[derive(Clone, Debug, PartialEq)]
pub struct ContextMap {
    /// Mean context of the demonstrations (Q,).
    pub(crate) centre: Array1<f64>,
    /// Outputs at the mean context (P,).
    pub(crate) intercept: Array1<f64>,
    /// Slopes β (P, Q).
    pub(crate) slopes: Array2<f64>,
    /// Inverse of the contexts' scatter matrix (Q, Q).
    pub(crate) inverse_scatter: Array2<f64>,
    /// Covariance of the residuals (P, P), where more demonstrations than coefficients leave any.
    pub(crate) residual: Option<Array2<f64>>,
    /// Number of demonstrations M.
    pub(crate) n_demos: usize,
}

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
}

/// The outputs of the map (M, P): style, goal and start or anchor, logarithms of the timing (M, K).
pub(crate) fn outputs(
    kind: Kind,
    styles: ArrayView2<f64>,
    [goals, starts, anchors]: [ArrayView2<f64>; 3],
    timings: ArrayView2<f64>,
) -> Array2<f64> {
    let logarithms = timings.mapv(f64::ln);
    let parts = match kind {
        Kind::Discrete => vec![styles, goals, starts, logarithms.view()],
        Kind::Rhythmic => vec![styles, anchors, logarithms.view()],
    };
    // Row counts are equal by construction.
    concatenate(Axis(1), &parts).unwrap_or_default()
}

impl ContextMap {
    /// Least squares of minimum norm: a context that was never varied has no influence.
    pub(crate) fn fit(contexts: ArrayView2<f64>, outputs: ArrayView2<f64>) -> Result<Self> {
        let (n_demos, n_inputs) = contexts.dim();
        let mean = |matrix: ArrayView2<f64>| matrix.mean_axis(Axis(0)).unwrap_or_default();
        let (centre, intercept) = (mean(contexts), mean(outputs));
        let (inputs, residuals) = (&contexts - &centre, &outputs - &intercept);

        // Columns to unit size, so that metres and labels weigh alike in what counts as rank.
        let sizes = inputs.map_axis(Axis(0), |column| column.iter().fold(0.0f64, |m, x| m.max(x.abs())));
        if let Some(&value) = sizes.iter().find(|&&size| size > 0.0 && !(1e-100..=1e100).contains(&size)) {
            let allowed = "each must vary by 1e-100 to 1e100; give them in another unit";
            return Err(Error::Range { name: "contexts", value, allowed });
        }
        let sizes = sizes.mapv(|size| if size > 0.0 { size } else { 1.0 });
        let scaled = Mat::from_fn(n_demos, n_inputs, |m, q| inputs[[m, q]] / sizes[q]);
        let svd = Svd::new_thin(scaled.as_ref())
            .map_err(|_| Error::Fit(format!("the SVD of the {n_demos} × {n_inputs} contexts did not converge")))?;
        let sigma: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let floor = sigma.first().copied().unwrap_or(0.0) * f64::EPSILON * n_demos.max(n_inputs) as f64;
        let rank = sigma.iter().filter(|&&s| s > floor).count();
        // V/σ, from which both β = (V/σ)Uᵀy and (HᵀH)⁺ = (V/σ)(V/σ)ᵀ follow.
        let whitening = Array2::from_shape_fn((n_inputs, rank), |(q, k)| svd.V()[(q, k)] / sigma[k] / sizes[q]);
        let left = Array2::from_shape_fn((n_demos, rank), |(m, k)| svd.U()[(m, k)]);
        let slopes = whitening.dot(&left.t().dot(&residuals)).reversed_axes();

        let residuals = residuals - inputs.dot(&slopes.t());
        let freedom = n_demos.saturating_sub(rank + 1);
        let residual = (freedom > 0).then(|| residuals.t().dot(&residuals) / freedom as f64);
        let inverse_scatter = whitening.dot(&whitening.t());
        Ok(Self { centre, intercept, slopes, inverse_scatter, residual, n_demos })
    }

    /// Number of context values Q.
    pub fn n_inputs(&self) -> usize {
        self.centre.len()
    }

    /// The movement for a context (Q,).
    ///
    /// The covariance is that of a new movement: with h̃ the distance from the mean context, Σ(1 + 1/M + h̃ᵀ(HᵀH)⁻¹h̃).
    ///
    /// # Errors
    /// A context of another length, or with a number that is not finite.
    pub(crate) fn predict(&self, context: &[f64], kind: Kind, n_styles: usize, n_dofs: usize) -> Result<Prediction> {
        check_vector("context", context, self.n_inputs(), "context value")?;
        let offset = Array1::from_vec(context.to_vec()) - &self.centre;
        let output = (&self.intercept + self.slopes.dot(&offset)).to_vec();
        let first = n_styles + n_dofs * if kind == Kind::Discrete { 2 } else { 1 };
        let timing: Vec<f64> = output[first..].iter().map(|logarithm| logarithm.exp()).collect();
        let duration: f64 = timing.iter().sum();
        let covariance = self.residual.as_ref().map(|residual| {
            let leverage = 1.0 / self.n_demos as f64 + offset.dot(&self.inverse_scatter.dot(&offset));
            let mut covariance = residual * (1.0 + leverage);
            // dt = t d(ln t).
            for (k, seconds) in timing.iter().enumerate() {
                covariance.row_mut(first + k).mapv_inplace(|x| x * seconds);
                covariance.column_mut(first + k).mapv_inplace(|x| x * seconds);
            }
            covariance
        });
        let mut numbers = output.iter().chain(covariance.iter().flatten());
        if !(numbers.all(|x| x.is_finite()) && duration.is_finite() && timing.iter().all(|&t| t > 0.0)) {
            return Err(Error::Arguments("context is so far from the demonstrations that the prediction overflows"));
        }
        let part = |k: usize| Some(output[n_styles + k * n_dofs..n_styles + (k + 1) * n_dofs].to_vec());
        let (goal, start, anchor) = match kind {
            Kind::Discrete => (part(0), part(1), None),
            Kind::Rhythmic => (None, None, part(0)),
        };
        Ok(Prediction { style: output[..n_styles].to_vec(), goal, start, anchor, timing, duration, covariance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use ndarray::array;

    /// Data on a line are predicted exactly, inside the range and outside.
    #[test]
    fn linear_data_are_predicted_exactly() {
        let contexts = array![[0.0], [0.3], [0.45], [0.9]];
        let outputs =
            contexts.map_axis(Axis(1), |h| h[0]).insert_axis(Axis(1)).dot(&array![[2.0, -1.0, 0.5, 0.1]]) + 0.7;
        let map = ContextMap::fit(contexts.view(), outputs.view()).unwrap();
        let found = map.predict(&[0.6], Kind::Rhythmic, 2, 1).unwrap();
        assert_relative_eq!(found.style[0], 1.9, epsilon = 1e-12);
        assert_relative_eq!(found.style[1], 0.1, epsilon = 1e-12);
        assert_relative_eq!(found.anchor.unwrap()[0], 1.0, epsilon = 1e-12);
        assert_relative_eq!(found.duration, 0.76f64.exp(), epsilon = 1e-12);
        assert!(found.covariance.unwrap().iter().all(|c| c.abs() < 1e-20));
    }

    /// Slopes and covariance are those of the normal equations, solved here by Cramer's rule.
    #[test]
    fn regression_agrees_with_the_normal_equations() {
        let h: [f64; 5] = [0.1, 0.5, 0.7, 1.1, 1.9];
        let y = [1.0, 0.2, 0.9, -0.3, -1.0];
        let contexts = Array2::from_shape_fn((5, 1), |(m, _)| h[m]);
        let outputs = Array2::from_shape_fn((5, 2), |(m, p)| if p == 0 { y[m] } else { 0.0 });
        let map = ContextMap::fit(contexts.view(), outputs.view()).unwrap();
        let (n, sh, shh): (f64, f64, f64) = (5.0, h.iter().sum(), h.iter().map(|h| h * h).sum());
        let (sy, shy): (f64, f64) = (y.iter().sum(), h.iter().zip(y).map(|(h, y)| h * y).sum());
        let det = n * shh - sh * sh;
        let (slope, intercept) = ((n * shy - sh * sy) / det, (shh * sy - sh * shy) / det);
        let rss: f64 = h.iter().zip(y).map(|(h, y)| (y - intercept - slope * h).powi(2)).sum();
        let at = 0.85;
        let variance = rss / 3.0 * (1.0 + (shh - 2.0 * sh * at + n * at * at) / det);
        let found = map.predict(&[at], Kind::Rhythmic, 1, 0).unwrap();
        assert_relative_eq!(found.style[0], intercept + slope * at, epsilon = 1e-12);
        assert_relative_eq!(found.covariance.unwrap()[[0, 0]], variance, epsilon = 1e-12);
    }

    /// One context value for all demonstrations, or one demonstration, predicts their mean.
    #[test]
    fn unvaried_contexts_predict_the_mean() {
        let outputs = array![[1.0, 0.0], [3.0, 0.0]];
        let map = ContextMap::fit(array![[0.5], [0.5]].view(), outputs.view()).unwrap();
        assert_relative_eq!(map.predict(&[9.0], Kind::Rhythmic, 1, 0).unwrap().style[0], 2.0, epsilon = 1e-12);
        let map = ContextMap::fit(array![[0.5]].view(), outputs.slice(ndarray::s![..1, ..])).unwrap();
        let found = map.predict(&[9.0], Kind::Rhythmic, 1, 0).unwrap();
        assert_relative_eq!(found.style[0], 1.0, epsilon = 1e-12);
        assert!(found.covariance.is_none());
    }
}
