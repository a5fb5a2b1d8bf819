//! Unit responses: movements for a unit of one condition and zero for the others.
//!
//! For constant style, goal and τ a movement is linear in its conditions,
//!
//! ```text
//! y(t) = y⁰(t) + (y(0) − y⁰(0))·E(t) + (ẏ(0) − ẏ⁰(0))·V(t) + ẏ_g·G(t),   y⁰(t) = g + r₀ Σⱼ sⱼRⱼ(t),
//! ```
//!
//! where Rⱼ is the movement of the j-th unit style about zero, from zero (discrete) or on its limit cycle (rhythmic), E the
//! movement from a start of one to a goal of zero, which is 1 − m(u) for learnt transport, V the response to a start velocity
//! of one, and G that to a final velocity of one. With a final velocity the other responses end at a final velocity of zero.
//! Without a given start velocity its term is zero, and for a rhythmic movement without a given start that of the start, too.
//! Velocities and accelerations are sums of the derivatives of the responses. All responses are rollouts, so that they agree
//! with the control loop.

use std::sync::Arc;

use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::{Curves, Key, Responses};
use crate::model::sensitivity::STEPS;
use crate::motion::rollout::{TimeGrid, rollout_with};
use crate::motion::trajectory::Trajectory;

/// Returns the responses at the times of a grid, from the cache of the primitive if present.
///
/// # Errors
/// Times that do not fit the primitive, responses that do not fit into memory, or the error of `progress`.
pub(crate) fn responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    has_goal_velocity: bool,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Arc<Responses>> {
    let primitive = primitive.inside();
    let key = Key { dt: grid.dt, tau, steps: grid.steps(primitive, tau)?, has_goal_velocity };
    if let Some(responses) = primitive.responses.find(key) {
        return Ok(responses);
    }
    // The cache is not locked during the computation; concurrent calls compute equal responses.
    let responses = Arc::new(compute_responses(primitive, tau, has_goal_velocity, grid, progress)?);
    primitive.responses.insert(key, &responses);
    Ok(responses)
}

/// Returns the responses over the demonstrated duration in [`STEPS`] steps, over which errors are averaged.
pub(crate) fn phases(primitive: &Arc<Primitive>) -> Result<Arc<Responses>> {
    let grid = TimeGrid { dt: primitive.duration() / STEPS as f64, duration: None };
    responses(primitive, primitive.tau, false, grid, &mut |_| Ok(()))
}

fn compute_responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    has_goal_velocity: bool,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Responses> {
    let (n_dofs, n_styles) = (primitive.n_dofs(), primitive.n_styles());
    let n_runs = (n_styles + 3) as f64;
    let mut run = |n_completed: usize, conditions: Conditions| {
        let mut progress = |share| progress((n_completed as f64 + share) / n_runs);
        let Trajectory { position, velocity, acceleration, .. } =
            rollout_with(primitive, &conditions, grid, &mut progress)?;
        Ok([position, velocity, acceleration])
    };
    let vector = |value: f64| Some(vec![value; n_dofs]);
    let style = Some(vec![0.0; n_styles]);
    let goal_velocity = vector(0.0).filter(|_| has_goal_velocity);
    let base = Conditions { goal_velocity, tau: Some(tau), ..about_zero(primitive) };
    let zero = Conditions { style, start: vector(0.0), ..base.clone() };
    let [start, start_slope, start_bend] = run(0, Conditions { start: vector(1.0), ..zero.clone() })?;
    let [velocity, velocity_slope, velocity_bend] = run(1, Conditions { velocity: vector(1.0), ..zero.clone() })?;
    let curves =
        |start, velocity| Curves { styles: Vec::with_capacity(n_styles), start, velocity, goal_velocity: None };
    let mut responses =
        Responses([curves(start, velocity), curves(start_slope, velocity_slope), curves(start_bend, velocity_bend)]);
    if has_goal_velocity {
        let unit = run(2, Conditions { goal_velocity: vector(1.0), ..zero })?;
        responses.0.iter_mut().zip(unit).for_each(|(curves, curve)| curves.goal_velocity = Some(curve));
    }
    for j in 0..n_styles {
        let style = (0..n_styles).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
        let unit = run(j + 3, Conditions { style: Some(style), ..base.clone() })?;
        responses.0.iter_mut().zip(unit).for_each(|(curves, curve)| curves.styles.push(curve));
    }
    Ok(responses)
}

/// Returns conditions with goal and start, or anchor, of zero.
fn about_zero(primitive: &Primitive) -> Conditions {
    let zeros = Some(vec![0.0; primitive.n_dofs()]);
    match primitive.kind() {
        Kind::Discrete => Conditions { goal: zeros.clone(), start: zeros, ..Conditions::default() },
        Kind::Rhythmic => Conditions { anchor: zeros, ..Conditions::default() },
    }
}
