//! Jacobians of movements with respect to their conditions, from unit responses.

use std::sync::Arc;

use ndarray::{Array2, Array3, Axis};

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Conditions, ResolvedConditions, reject_for_kind, reject_goal_velocity};
use crate::model::primitive::Primitive;
use crate::model::responses::{Derivative, Responses};
use crate::motion::rollout::TimeGrid;
use crate::motion::unit_responses::responses;
use crate::validate::zeros;

/// Condition with respect to which a movement is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithRespectTo {
    /// Style s (J,).
    Style,
    /// Goal g (D,) of a discrete movement.
    Goal,
    /// Anchor y_a (D,) of a rhythmic movement.
    Anchor,
    /// Start position y(0) (D,).
    Start,
    /// Final velocity ẏ_g (D,) of a discrete movement.
    GoalVelocity,
}

/// Computes the Jacobian of a rollout: (T, D, J) with respect to the style, (T, D, D) otherwise.
///
/// A movement is linear in these conditions, so that the Jacobian is exact and independent of their values:
///
/// ```text
/// ∂y/∂sⱼ = r₀(Rⱼ − Rⱼ(0)·E − Ṙⱼ(0)·V)
/// ∂y/∂g = 1 − E
/// ∂y/∂y_a = 1, or 1 − E if a start is given
/// ∂y/∂y(0) = E
/// ∂y/∂ẏ_g = G
/// ```
///
/// with the responses R to the unit styles, E to a unit start, V to a unit start velocity and G to a unit final velocity. If
/// a final velocity is given, all responses keep it. The terms with E and V apply
/// only if a start or a start velocity is given. `derivative` selects y, ẏ or ÿ. `progress` is called periodically with the
/// completed fraction; an error it returns cancels the call.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::model::Derivative;
/// # use pdmp_core::motion::{TimeGrid, WithRespectTo, jacobian};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let grid = TimeGrid { dt: 0.01, duration: None };
/// let (variable, derivative) = (WithRespectTo::Style, Derivative::Position);
/// let by_style = jacobian(model.primitive(), variable, derivative, &Conditions::default(), grid, &mut |_| Ok(()))?;
/// assert_eq!(by_style.dim(), (101, 2, model.n_styles()));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A variable of the other kind of primitive, durations of several segments, conditions or times that do not fit the
/// primitive, or the error of `progress`.
pub fn jacobian(
    primitive: &Arc<Primitive>,
    variable: WithRespectTo,
    derivative: Derivative,
    conditions: &Conditions,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Array3<f64>> {
    primitive.refuse_rotations("has rotations, for which Jacobians do not exist")?;
    let kind = primitive.kind();
    reject_for_kind(kind, "goal", variable == WithRespectTo::Goal && kind == Kind::Rhythmic)?;
    reject_for_kind(kind, "anchor", variable == WithRespectTo::Anchor && kind == Kind::Discrete)?;
    if conditions.segment_durations.as_ref().is_some_and(|segment_durations| segment_durations.len() > 1) {
        return Err(Error::Argument {
            name: "segment_durations",
            problem: "does not apply: Jacobians are available in linear time only; pass tau instead",
        });
    }
    let conditions = conditions.complete(primitive)?;
    let by_goal_velocity = variable == WithRespectTo::GoalVelocity;
    reject_goal_velocity(primitive, by_goal_velocity)?;
    let has_goal_velocity = conditions.has_goal_velocity || by_goal_velocity;
    let responses = responses(primitive, conditions.tau, has_goal_velocity, grid, progress)?;
    let curves = responses.of(derivative);
    // Derivative of the centre with respect to itself, and its derivatives with respect to time.
    let one = if derivative == Derivative::Position { 1.0 } else { 0.0 };
    match variable {
        WithRespectTo::Style => by_style(&responses, derivative, &conditions),
        WithRespectTo::Goal | WithRespectTo::Anchor if conditions.start.is_some() => {
            by_dof(&curves.start, |response| one - response)
        }
        WithRespectTo::Goal | WithRespectTo::Anchor => by_dof(&curves.start, |_| one),
        WithRespectTo::Start => by_dof(&curves.start, |response| response),
        WithRespectTo::GoalVelocity => {
            let curve = curves.goal_velocity.as_ref().expect("responses with a final velocity were computed above");
            by_dof(curve, |response| response)
        }
    }
}

/// Returns the Jacobian (T, D, J) with respect to the style.
fn by_style(responses: &Responses, derivative: Derivative, conditions: &ResolvedConditions) -> Result<Array3<f64>> {
    let curves = responses.of(derivative);
    let (n_samples, n_dofs) = curves.start.dim();
    let mut jacobian = zeros("jacobian", (n_samples, n_dofs, curves.styles.len()))?;
    for (j, mut jacobian) in jacobian.axis_iter_mut(Axis(2)).enumerate() {
        jacobian.scaled_add(conditions.amplitude, &curves.styles[j]);
        let mut subtract = |derivative: Derivative, response| {
            let at_start = &responses.of(derivative).styles[j].row(0) * conditions.amplitude;
            jacobian -= &(&at_start * response);
        };
        if conditions.start.is_some() {
            subtract(Derivative::Position, &curves.start);
        }
        if conditions.velocity.is_some() {
            subtract(Derivative::Velocity, &curves.velocity);
        }
    }
    Ok(jacobian)
}

/// Returns a Jacobian (T, D, D), diagonal in the DoFs, with entries as a function of a unit response.
fn by_dof(curve: &Array2<f64>, entry: impl Fn(f64) -> f64) -> Result<Array3<f64>> {
    let (n_samples, n_dofs) = curve.dim();
    let mut jacobian = zeros("jacobian", (n_samples, n_dofs, n_dofs))?;
    for (mut jacobian, responses) in jacobian.outer_iter_mut().zip(curve.rows()) {
        for (value, &response) in jacobian.diag_mut().iter_mut().zip(responses) {
            *value = entry(response);
        }
    }
    Ok(jacobian)
}
