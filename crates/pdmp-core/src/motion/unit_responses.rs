//! Unit responses: movements for a unit of one condition and zero for the others.
//!
//! For constant style, goal and τ a movement is linear in its conditions,
//!
//! ```text
//! y(t) = y⁰(t) + (y(0) − y⁰(0))·E(t) + (ẏ(0) − ẏ⁰(0))·V(t),   y⁰(t) = g + r₀ Σⱼ sⱼRⱼ(t),
//! ```
//!
//! where Rⱼ is the movement of the j-th unit style about zero, from zero (discrete) or on its limit cycle (rhythmic), E the
//! movement from a start of one to a goal of zero, which is 1 − m(u) for learnt transport, and V the response to a start
//! velocity of one. Without a given start velocity the last term is zero, and for a rhythmic movement without a given start
//! the one before it, too. Velocities and accelerations are sums of the derivatives of the responses. All responses are
//! rollouts, so that they agree with the control loop.

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
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Arc<Responses>> {
    let key = Key { dt: grid.dt, tau, steps: grid.steps(primitive, tau)? };
    if let Some(responses) = primitive.responses.find(key) {
        return Ok(responses);
    }
    // The cache is not locked during the computation; concurrent calls compute equal responses.
    let responses = Arc::new(compute_responses(primitive, tau, grid, progress)?);
    primitive.responses.insert(key, &responses);
    Ok(responses)
}

/// Returns the responses over the demonstrated duration in [`STEPS`] steps, over which errors are averaged.
pub(crate) fn phases(primitive: &Arc<Primitive>) -> Result<Arc<Responses>> {
    let grid = TimeGrid { dt: primitive.duration() / STEPS as f64, duration: None };
    responses(primitive, primitive.tau, grid, &mut |_| Ok(()))
}

fn compute_responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Responses> {
    let (n_dofs, n_styles) = (primitive.n_dofs(), primitive.n_styles());
    let n_runs = (n_styles + 2) as f64;
    let mut run = |n_completed: usize, conditions: Conditions| {
        let mut progress = |share| progress((n_completed as f64 + share) / n_runs);
        let Trajectory { position, velocity, acceleration, .. } =
            rollout_with(primitive, &conditions, grid, &mut progress)?;
        Ok([position, velocity, acceleration])
    };
    let vector = |value: f64| Some(vec![value; n_dofs]);
    let style = Some(vec![0.0; n_styles]);
    let zero = Conditions { style, start: vector(0.0), tau: Some(tau), ..about_zero(primitive) };
    let start = run(0, Conditions { start: vector(1.0), ..zero.clone() })?;
    let velocity = run(1, Conditions { velocity: vector(1.0), ..zero })?;
    let mut curves = std::iter::zip(start, velocity).map(|(start, velocity)| Curves {
        styles: Vec::with_capacity(n_styles),
        start,
        velocity,
    });
    let mut responses = Responses(std::array::from_fn(|_| curves.next().expect("three derivatives of each")));
    for j in 0..n_styles {
        let style = (0..n_styles).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
        let unit = Conditions { style: Some(style), tau: Some(tau), ..about_zero(primitive) };
        for (curves, curve) in responses.0.iter_mut().zip(run(j + 2, unit)?) {
            curves.styles.push(curve);
        }
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
