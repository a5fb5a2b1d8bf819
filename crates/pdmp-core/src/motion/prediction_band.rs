//! How a predicted movement may turn out: the covariance of its conditions, seen through the responses to each, and what
//! its styles leave out.
//!
//! A movement is compared with another at an equal share of its duration: where time is scaled linearly that is equal
//! phase, and else the timing moves the phase.

use std::sync::Arc;

use ndarray::{Array1, Array2};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::context::{Prediction, outputs};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::Aligned;
use crate::model::Model;
use crate::model::conditions::Conditions;
use crate::model::responses::{Derivative, Responses};
use crate::model::sensitivity::{STEPS, Sensitivity};
use crate::motion::rollout::Timing;

impl Model {
    /// What a map is to predict (M, P).
    pub(crate) fn outputs(&self) -> Array2<f64> {
        let shown = &self.demonstrated;
        let places = [shown.goals.view(), shown.starts.view(), shown.anchors.view()];
        outputs(self.kind(), shown.styles.view(), places, shown.timings.view())
    }

    /// The matrix (P, P) that makes errors of the outputs into those of the movement.
    pub(crate) fn metric(self: &Arc<Self>) -> Result<Array2<f64>> {
        let responses = self.phases()?;
        let sensitivity = Sensitivity::new(self.kind(), responses.of(Derivative::Position), Vec::new());
        Ok(sensitivity.metric(self.outputs().view(), self.demonstrated.timings.view()))
    }

    /// Variance (S, D) over the phase of what the styles leave out of the demonstrations, measurement noise included.
    pub(crate) fn left_over(self: &Arc<Self>, aligned: Aligned) -> Result<Array2<f64>> {
        let (kind, outputs) = (self.kind(), self.outputs());
        let responses = self.phases()?;
        let sensitivity = Sensitivity::new(kind, responses.of(Derivative::Position), Vec::new());
        let n_samples = kind.samples(STEPS);
        let aligned = aligned.resampled(n_samples);
        let mut sum = Array2::zeros((n_samples, self.n_dofs()));
        let mut shown = Array2::zeros(sum.dim());
        for (m, outputs) in outputs.rows().into_iter().enumerate() {
            aligned.sample(m, shown.as_slice_mut().unwrap_or_default());
            let made = sensitivity.positions(outputs);
            sum.zip_mut_with(&(&shown - &made.slice(ndarray::s![..n_samples, ..])), |sum, error| *sum += error * error);
        }
        let noise = self.learnt.noise.levels().iter().map(|level| level * level).collect::<Array1<f64>>();
        Ok(sum / (outputs.nrows() - 1).max(1) as f64 + noise)
    }

    /// Responses over the demonstrated duration, in as many steps as errors are averaged over.
    fn phases(self: &Arc<Self>) -> Result<Arc<Responses>> {
        self.responses(self.tau, Timing { dt: self.duration() / STEPS as f64, duration: None }, &mut |_| Ok(()))
    }

    /// Positions (S, D) of a predicted movement per second of the time in each of its segments, at an equal share of its
    /// duration: y′ ∂p/∂T_k, with ∂p/∂T_k = −(∂s/∂T_k)/(∂s/∂p) of that share s(p). None where time is linear.
    fn paces(self: &Arc<Self>, conditions: &Conditions, timing: &[f64]) -> Result<Vec<Array2<f64>>> {
        if timing.len() == 1 {
            return Ok(Vec::new());
        }
        let duration = self.duration();
        let nominal = Conditions { timing: None, ..conditions.clone() };
        let velocity = self.rollout(&nominal, Timing { dt: duration / STEPS as f64, duration: None })?.velocity;
        let time = self.warping_function(timing)?;
        let pace = |segment: usize| {
            let step = 1e-4 * timing[segment];
            let [less, more] = [-step, step].map(|by| {
                let mut timing = timing.to_vec();
                timing[segment] += by;
                self.warping_function(&timing)
            });
            let (less, more) = (less?, more?);
            Ok(Array2::from_shape_fn(velocity.dim(), |(k, d)| {
                let phase = k as f64 / STEPS as f64;
                let share = (more.share(phase) - less.share(phase)) / (2.0 * step);
                -velocity[[k, d]] * duration * share * time.duration() / time.slope(phase)
            }))
        };
        (0..timing.len()).map(pace).collect()
    }

    /// Bounds (T, D) within which a new movement of the predicted condition lies at each share of its duration, with the
    /// probability `level` for each number by itself: the samples of [`Model::rollout`] with the prediction's conditions,
    ///
    /// ```text
    /// y ± t·√(aᵀΣa + v),
    /// ```
    ///
    /// with the covariance Σ of the prediction, a = ∂y/∂(style, goal, start, timing), the variance v that the styles leave
    /// out of the demonstrations, and Student's quantile t for the prediction's degrees of freedom.
    ///
    /// # Errors
    /// A prediction without covariance, or a level that is no probability; else as for a rollout.
    pub fn band(self: &Arc<Self>, prediction: &Prediction, level: f64, timing: Timing) -> Result<[Array2<f64>; 2]> {
        if !(level > 0.0 && level < 1.0) {
            return Err(Error::Range { name: "level", value: level, allowed: "must lie between 0 and 1" });
        }
        let covariance = prediction.covariance.as_ref().ok_or(Error::Arguments(
            "the demonstrations leave nothing from which a band could be told: show more, or more contexts",
        ))?;
        let left_over = self.learnt.left_over.as_ref().ok_or(Error::Arguments("the model knows no contexts"))?;
        let conditions = self.conditions(prediction);
        let centre = self.rollout(&conditions, timing)?.position;
        let responses = self.phases()?;
        let (curves, kind) = (responses.of(Derivative::Position), self.kind());
        let sensitivity = Sensitivity::new(kind, curves, self.paces(&conditions, &prediction.timing)?);
        // Of a cycle, the last of the responses is the first of the next one.
        let variances = &sensitivity.variances(covariance).slice(ndarray::s![..left_over.nrows(), ..]) + left_over;
        let time = self.warping_function(&prediction.timing)?;
        let mut width = Array2::zeros(centre.dim());
        for (k, mut width) in width.rows_mut().into_iter().enumerate() {
            let [phase, ..] = time.phase(k as f64 * timing.dt);
            width.assign(&at(&variances, phase * STEPS as f64, self.kind()));
        }
        let student = StudentsT::new(0.0, 1.0, prediction.freedom.max(1) as f64)
            .map_err(|_| Error::Arguments("no degree of freedom is left"))?;
        let quantile = student.inverse_cdf(0.5 * (1.0 + level));
        let width = width.mapv(|variance| quantile * variance.sqrt());
        let bounds = [&centre - &width, &centre + &width];
        if bounds.iter().flatten().any(|bound| !bound.is_finite()) {
            return Err(Error::Arguments("the prediction varies so much that its band overflows"));
        }
        Ok(bounds)
    }
}

/// Curves (S, D) at a place between two samples: the last one past the end, or around.
fn at(curves: &Array2<f64>, place: f64, kind: Kind) -> Array1<f64> {
    let n = curves.nrows();
    let (low, share) = (place.floor(), place.fract());
    let row = |k: f64| match kind {
        Kind::Discrete => curves.row((k as usize).min(n - 1)),
        Kind::Rhythmic => curves.row(k as usize % n),
    };
    &row(low) * (1.0 - share) + &row(low + 1.0) * share
}
