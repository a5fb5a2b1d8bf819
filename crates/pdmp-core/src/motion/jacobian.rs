//! Derivatives of whole movements with respect to their conditions: the responses, put together.

use std::sync::Arc;

use ndarray::{Array3, Axis};

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::{Complete, Conditions, refuse};
use crate::model::primitive::Primitive;
use crate::model::responses::{Derivative, Responses};
use crate::motion::rollout::Timing;
use crate::motion::unit_responses::responses;
use crate::validate::zeros;

/// The condition with respect to which a movement is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    /// Style s (J,).
    Style,
    /// Goal g (D,), discrete.
    Goal,
    /// Anchor y_a (D,), rhythmic.
    Anchor,
    /// Start position y(0) (D,), where one is given.
    Start,
}

/// Jacobian of a rollout, (T, D, J) with respect to the style and (T, D, D) otherwise; exact, and the same wherever
/// it is taken, since a movement is linear in all of these:
///
/// ```text
/// ∂y/∂sⱼ = r₀(Rⱼ − Rⱼ(0)·E − Ṙⱼ(0)·V)
/// ∂y/∂g = 1 − E
/// ∂y/∂y_a = 1, or 1 − E if a start is given
/// ∂y/∂y(0) = E
/// ```
///
/// with the curves R of the unit styles, E of a unit start, and V of a unit start velocity, where the terms with E and
/// V belong to a given start and a given start velocity. Which of the two are given matters, their values do not.
/// `derivative` asks for the same of ẏ or ÿ. `proceed` is told now and then the share that is done.
///
/// # Errors
/// A variable of the other kind of primitive, a timing of several segments, conditions or times that do not fit the
/// model, or whatever `proceed` returns.
pub fn jacobian(
    primitive: &Arc<Primitive>,
    variable: Variable,
    derivative: Derivative,
    conditions: &Conditions,
    timing: Timing,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Array3<f64>> {
    refuse(primitive.kind(), "goal", variable == Variable::Goal && primitive.kind() == Kind::Rhythmic)?;
    refuse(primitive.kind(), "anchor", variable == Variable::Anchor && primitive.kind() == Kind::Discrete)?;
    if conditions.timing.as_ref().is_some_and(|timing| timing.len() > 1) {
        return Err(Error::Arguments("a Jacobian is that of a movement in linear time: pass tau in place of timing"));
    }
    let conditions = conditions.complete(primitive)?;
    let responses = responses(primitive, conditions.tau, timing, proceed)?;
    let still = if derivative == Derivative::Position { 1.0 } else { 0.0 };
    match variable {
        Variable::Style => by_style(&responses, derivative, &conditions),
        Variable::Goal | Variable::Anchor if conditions.start.is_some() => {
            by_dof(&responses, derivative, |response| still - response)
        }
        Variable::Goal | Variable::Anchor => by_dof(&responses, derivative, |_| still),
        Variable::Start => by_dof(&responses, derivative, |response| response),
    }
}

fn by_style(responses: &Responses, derivative: Derivative, conditions: &Complete) -> Result<Array3<f64>> {
    let curves = responses.of(derivative);
    let (n_samples, n_dofs) = curves.start.dim();
    let mut jacobian = zeros("jacobian", (n_samples, n_dofs, curves.styles.len()))?;
    for (j, mut jacobian) in jacobian.axis_iter_mut(Axis(2)).enumerate() {
        jacobian.scaled_add(conditions.amplitude, &curves.styles[j]);
        let mut take_away = |at: Derivative, curve| {
            let at_start = &responses.of(at).styles[j].row(0) * conditions.amplitude;
            jacobian -= &(&at_start * curve);
        };
        if conditions.start.is_some() {
            take_away(Derivative::Position, &curves.start);
        }
        if conditions.velocity.is_some() {
            take_away(Derivative::Velocity, &curves.velocity);
        }
    }
    Ok(jacobian)
}

/// A Jacobian of DoFs that do not know of each other, from the response of each to a unit start.
fn by_dof(responses: &Responses, derivative: Derivative, entry: impl Fn(f64) -> f64) -> Result<Array3<f64>> {
    let curve = &responses.of(derivative).start;
    let (n_samples, n_dofs) = curve.dim();
    let mut jacobian = zeros("jacobian", (n_samples, n_dofs, n_dofs))?;
    for (mut jacobian, responses) in jacobian.outer_iter_mut().zip(curve.rows()) {
        for (value, &response) in jacobian.diag_mut().iter_mut().zip(responses) {
            *value = entry(response);
        }
    }
    Ok(jacobian)
}
