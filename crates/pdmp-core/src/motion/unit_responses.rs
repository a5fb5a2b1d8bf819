//! What whole movements are made of: responses to a unit of each condition.
//!
//! For constant style, goal and τ a movement is linear in its conditions,
//!
//! ```text
//! y(t) = y⁰(t) + (y(0) − y⁰(0))·E(t) + (ẏ(0) − ẏ⁰(0))·V(t),   y⁰(t) = g + r₀ Σⱼ sⱼRⱼ(t),
//! ```
//!
//! where Rⱼ is the movement of the j-th unit style about zero, from zero (discrete) or on its cycle (rhythmic), E the way
//! from a start of one to a goal of zero, 1 − m(u) where a transport was learnt, and V what a start velocity of one adds. Where no start velocity is given the last term
//! is missing, and the one before it where a rhythmic movement is given no start. Velocities and accelerations are
//! made of the curves' derivatives in the same way. All curves are rollouts, so that they repeat the control loop.

use std::sync::Arc;

use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::{Curves, Key, Responses};
use crate::model::sensitivity::STEPS;
use crate::motion::rollout::{Timing, rollout_with};
use crate::motion::trajectory::Trajectory;

/// The responses at these times, from the cache where they are found.
pub(crate) fn responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    timing: Timing,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Arc<Responses>> {
    let key = Key { dt: timing.dt, tau, steps: timing.steps(primitive, tau)? };
    if let Some(found) = primitive.responses.find(key) {
        return Ok(found);
    }
    // The cache is free meanwhile: whoever computes the same finds the same.
    let responses = Arc::new(compute_responses(primitive, tau, timing, proceed)?);
    primitive.responses.keep(key, &responses);
    Ok(responses)
}

/// Responses over the demonstrated duration, in as many steps as errors are averaged over.
pub(crate) fn phases(primitive: &Arc<Primitive>) -> Result<Arc<Responses>> {
    responses(primitive, primitive.tau, Timing { dt: primitive.duration() / STEPS as f64, duration: None }, &mut |_| {
        Ok(())
    })
}

fn compute_responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    timing: Timing,
    proceed: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Responses> {
    let (n_dofs, n_styles) = (primitive.n_dofs(), primitive.n_styles());
    let n_runs = (n_styles + 2) as f64;
    let mut run = |done: usize, conditions: Conditions| {
        let Trajectory { position, velocity, acceleration, .. } =
            rollout_with(primitive, &conditions, timing, &mut |share| proceed((done as f64 + share) / n_runs))?;
        Ok([position, velocity, acceleration])
    };
    let zeros = || Some(vec![0.0; n_dofs]);
    let ones = || Some(vec![1.0; n_dofs]);
    let still =
        Conditions { style: Some(vec![0.0; n_styles]), start: zeros(), tau: Some(tau), ..about_zero(primitive) };
    let start = run(0, Conditions { start: ones(), ..still.clone() })?;
    let velocity = run(1, Conditions { velocity: ones(), ..still.clone() })?;
    let mut curves = std::iter::zip(start, velocity).map(|(start, velocity)| Curves {
        styles: Vec::with_capacity(n_styles),
        start,
        velocity,
    });
    let mut responses = Responses(std::array::from_fn(|_| curves.next().expect("three of each")));
    for j in 0..n_styles {
        let style = (0..n_styles).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
        let unit = Conditions { style: Some(style), tau: Some(tau), ..about_zero(primitive) };
        for (curves, curve) in responses.0.iter_mut().zip(run(j + 2, unit)?) {
            curves.styles.push(curve);
        }
    }
    Ok(responses)
}

/// A goal and start, or an anchor, of zero.
fn about_zero(primitive: &Primitive) -> Conditions {
    let zeros = Some(vec![0.0; primitive.n_dofs()]);
    match primitive.kind() {
        Kind::Discrete => Conditions { goal: zeros.clone(), start: zeros, ..Conditions::default() },
        Kind::Rhythmic => Conditions { anchor: zeros, ..Conditions::default() },
    }
}
