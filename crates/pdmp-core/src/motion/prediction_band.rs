//! How a predicted movement may turn out: the covariance of its conditions, seen through the responses to each, and what
//! its styles leave out.
//!
//! A movement is compared with another at an equal share of its duration: where time is scaled linearly that is equal
//! phase, and else the timing moves the phase.

use std::sync::Arc;

use ndarray::{Array1, Array2};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Model;
use crate::model::conditions::Conditions;
use crate::model::prediction::Prediction;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::model::sensitivity::{STEPS, Sensitivity};
use crate::motion::rollout::{Timing, rollout};
use crate::motion::unit_responses::phases;

/// Positions (S, D) of a predicted movement per second of the time in each of its segments, at an equal share of its
/// duration: y′ ∂p/∂T_k, with ∂p/∂T_k = −(∂s/∂T_k)/(∂s/∂p) of that share s(p). None where time is linear.
fn paces(primitive: &Arc<Primitive>, conditions: &Conditions, timing: &[f64]) -> Result<Vec<Array2<f64>>> {
    if timing.len() == 1 {
        return Ok(Vec::new());
    }
    let duration = primitive.duration();
    let nominal = Conditions { timing: None, ..conditions.clone() };
    let velocity = rollout(primitive, &nominal, Timing { dt: duration / STEPS as f64, duration: None })?.velocity;
    let time = primitive.warping_function(timing)?;
    let pace = |segment: usize| {
        let step = 1e-4 * timing[segment];
        let [less, more] = [-step, step].map(|by| {
            let mut timing = timing.to_vec();
            timing[segment] += by;
            primitive.warping_function(&timing)
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
/// probability `level` for each number by itself: the samples of [`rollout`] with the prediction's conditions,
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
pub fn prediction_band(model: &Model, prediction: &Prediction, level: f64, timing: Timing) -> Result<[Array2<f64>; 2]> {
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::Range { name: "level", value: level, allowed: "must lie between 0 and 1" });
    }
    let covariance = prediction.covariance.as_ref().ok_or(Error::Arguments(
        "the demonstrations leave nothing from which a band could be told: show more, or more contexts",
    ))?;
    let left_over = model.learnt.left_over.as_ref().ok_or(Error::Arguments("the model knows no contexts"))?;
    let primitive = model.primitive();
    let conditions = &prediction.conditions;
    let timing_of = conditions.timing.as_deref().unwrap_or(&primitive.nominal.timing);
    let centre = rollout(primitive, conditions, timing)?.position;
    let responses = phases(primitive)?;
    let (curves, kind) = (responses.of(Derivative::Position), model.kind());
    let sensitivity = Sensitivity::new(kind, curves, paces(primitive, conditions, timing_of)?);
    // Of a cycle, the last of the responses is the first of the next one.
    let variances = &sensitivity.variances(covariance).slice(ndarray::s![..left_over.nrows(), ..]) + left_over;
    let time = model.warping_function(timing_of)?;
    let mut width = Array2::zeros(centre.dim());
    for (k, mut width) in width.rows_mut().into_iter().enumerate() {
        let [phase, ..] = time.phase(k as f64 * timing.dt);
        width.assign(&at(&variances, phase * STEPS as f64, model.kind()));
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
