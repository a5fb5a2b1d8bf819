//! Prediction bands: the covariance of predicted conditions, propagated to positions, and the residual variance of the
//! styles.
//!
//! Movements are compared at equal fractions of their duration. With linear time scaling this is equal phase; a time warp
//! adds the sensitivity of the phase to the segment durations.
//!
//! The band of a rotation is one of rotation vectors φ from the predicted orientation, q = q̂ ⊗ exp(φ): to first order
//! φ = J(δ̂)(δ − δ̂), with the right Jacobian J of the exponential map, has the covariance JΣJᵀ, and a change of phase turns
//! by ω. The residuals of the three components of δ count as independent.

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
use crate::model::sensitivity::{Matrix, STEPS, Sensitivity};
use crate::motion::rollout::{TimeGrid, rollout};
use crate::motion::unit_responses::phases;
use crate::validate::check_range;

/// Maps of each rotation, with its first DoF, over the phase (S + 1,).
type Maps = Vec<Vec<(usize, Matrix)>>;

/// Computes the sensitivities ∂y/∂T_k (S, D) of the positions to each segment duration, in DoF units per second, at equal
/// fractions s of the duration: y′ ∂p/∂T_k with the phase p and ∂p/∂T_k = −(∂s/∂T_k)/(∂s/∂p). Empty for linear time.
/// The DoFs of a rotation include the motion of the mean rotation. Also returns the maps from changes of the DoFs to small
/// rotations.
fn over_phase(
    primitive: &Arc<Primitive>,
    conditions: &Conditions,
    segment_durations: &[f64],
) -> Result<(Vec<Array2<f64>>, Maps)> {
    let coordinates = primitive.coordinates();
    let inside = primitive.inside();
    if segment_durations.len() == 1 && coordinates.is_none() {
        return Ok((Vec::new(), Vec::new()));
    }
    let duration = primitive.duration();
    let nominal = Conditions { segment_durations: None, ..conditions.clone() };
    let mut movement = rollout(inside, &nominal, TimeGrid { dt: duration / STEPS as f64, duration: None })?;
    let mut maps = Vec::new();
    if let Some(coordinates) = coordinates {
        let rate = 1.0 / nominal.time_constant(inside)?;
        for (k, (dofs, mut velocity)) in
            movement.position.rows().into_iter().zip(movement.velocity.rows_mut()).enumerate()
        {
            let (u, dofs) = (k as f64 / STEPS as f64 * inside.canonical().extent(), dofs.to_vec());
            coordinates.for_each_drift(u, &dofs, |dof, drift| {
                (0..3).for_each(|i| velocity[dof + i] += rate * drift[i]);
            });
            let mut own = Vec::new();
            coordinates.for_each_tangent(u, &dofs, |dof, forward, _| {
                let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(forward);
                own.push((dof, std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))));
            });
            maps.push(own);
        }
    }
    if segment_durations.len() == 1 {
        return Ok((Vec::new(), maps));
    }
    let velocity = movement.velocity;
    let time = primitive.warping_function(segment_durations)?;
    let sensitivity = |segment: usize| {
        let step = 1e-4 * segment_durations[segment];
        let [below, above] = [-step, step].map(|change| {
            let mut segment_durations = segment_durations.to_vec();
            segment_durations[segment] += change;
            primitive.warping_function(&segment_durations)
        });
        let (below, above) = (below?, above?);
        Ok(Array2::from_shape_fn(velocity.dim(), |(k, d)| {
            let phase = k as f64 / STEPS as f64;
            let slope = (above.share(phase) - below.share(phase)) / (2.0 * step);
            -velocity[[k, d]] * duration * slope * time.duration() / time.slope(phase)
        }))
    };
    let by_duration = (0..segment_durations.len()).map(sensitivity).collect::<Result<_>>()?;
    Ok((by_duration, maps))
}

/// Pointwise prediction band of a new movement, in the unit of each DoF. The bounds of a rotation are those of the components
/// of the rotation vector in rad from the predicted orientation, in the frame of its angular velocities.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionBand {
    /// Lower bounds (T, D).
    pub lower: Array2<f64>,
    /// Upper bounds (T, D).
    pub upper: Array2<f64>,
}

/// Computes the pointwise prediction band of a new movement under predicted conditions, at the samples of [`rollout`],
///
/// ```text
/// y ± t·√(aᵀΣa + v),
/// ```
///
/// with the covariance Σ of the prediction, a = ∂y/∂(style, goal, start, segment durations), the residual variance v of the
/// demonstrations about their styles, and the quantile t of Student's distribution with the degrees of freedom of the
/// prediction. Each bound pair contains the position with probability `level`.
///
/// ```
/// # use pdmp_core::motion::{TimeGrid, prediction_band};
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let prediction = model.predict(&[0.25])?;
/// let band = prediction_band(&model, &prediction, 0.95, TimeGrid { dt: 0.01, duration: None })?;
/// assert!(band.lower.iter().zip(&band.upper).all(|(lower, upper)| lower <= upper));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A prediction without covariance, a `level` outside (0, 1), a band that overflows, or an error of the rollout.
pub fn prediction_band(model: &Model, prediction: &Prediction, level: f64, grid: TimeGrid) -> Result<PredictionBand> {
    check_range("level", level, level > 0.0 && level < 1.0, "must lie between 0 and 1")?;
    let covariance = prediction.covariance.as_ref().ok_or(Error::Argument {
        name: "prediction",
        problem: "has no covariance: a band needs more demonstrations, or more different contexts",
    })?;
    let residual_variance = model
        .learnt
        .residual_variance
        .as_ref()
        .ok_or(Error::Argument { name: "model", problem: "has no context map: fit demonstrations with contexts" })?;
    let primitive = model.primitive();
    let conditions = &prediction.conditions;
    let segment_durations = conditions.segment_durations.as_deref().unwrap_or(&primitive.nominal.segment_durations);
    let (inside, inner) = primitive.inside_with(conditions)?;
    // The DoFs of a rotation are relative to the prediction.
    let mut centre = rollout(inside, &inner, grid)?.position;
    for dof in primitive.rotation_dofs() {
        centre.slice_mut(ndarray::s![.., dof..dof + 3]).fill(0.0);
    }
    let responses = phases(inside)?;
    let (curves, kind) = (responses.of(Derivative::Position), model.kind());
    let (by_duration, maps) = over_phase(primitive, &inner, segment_durations)?;
    let sensitivity = Sensitivity::new(kind, curves, by_duration);
    // The last response of a cycle is the first of the next one.
    let mut variances = sensitivity.variances(covariance, &maps);
    for (k, (mut variances, residual)) in variances.rows_mut().into_iter().zip(residual_variance.rows()).enumerate() {
        for (d, variance) in variances.iter_mut().enumerate() {
            let map = maps.get(k).and_then(|maps| maps.iter().find(|(dof, _)| (*dof..dof + 3).contains(&d)));
            *variance += match map {
                None => residual[d],
                Some((dof, map)) => (0..3).map(|j| map[d - dof][j].powi(2) * residual[dof + j]).sum(),
            };
        }
    }
    let variances = variances.slice(ndarray::s![..residual_variance.nrows(), ..]).to_owned();
    let time = model.warping_function(segment_durations)?;
    let mut variance = Array2::zeros(centre.dim());
    for (k, mut variance) in variance.rows_mut().into_iter().enumerate() {
        let [phase, ..] = time.phase(k as f64 * grid.dt);
        variance.assign(&interpolate(&variances, phase * STEPS as f64, kind));
    }
    let student = StudentsT::new(0.0, 1.0, prediction.degrees_of_freedom.max(1) as f64).map_err(|_| {
        Error::Argument { name: "prediction", problem: "has no degree of freedom: a band needs at least one" }
    })?;
    let quantile = student.inverse_cdf(0.5 * (1.0 + level));
    let width = variance.mapv(|variance| quantile * variance.sqrt());
    let band = PredictionBand { lower: &centre - &width, upper: &centre + &width };
    if band.lower.iter().chain(&band.upper).any(|bound| !bound.is_finite()) {
        return Err(Error::Argument {
            name: "prediction",
            problem: "gives a band that overflows: pass a context closer to the demonstrations",
        });
    }
    Ok(band)
}

/// Interpolates curves (S, D) linearly at a fractional sample: constant past the end of a discrete movement, periodic for a
/// rhythmic one.
pub(crate) fn interpolate(curves: &Array2<f64>, sample: f64, kind: Kind) -> Array1<f64> {
    let n = curves.nrows();
    let (low, fraction) = (sample.floor(), sample.fract());
    let row = |k: f64| match kind {
        Kind::Discrete => curves.row((k as usize).min(n - 1)),
        Kind::Rhythmic => curves.row(k as usize % n),
    };
    &row(low) * (1.0 - fraction) + &row(low + 1.0) * fraction
}
