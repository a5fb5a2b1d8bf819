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

use ndarray::{Array2, Array3, Array4, s};

use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::{Curves, Derivative, Key, Responses};
use crate::model::sensitivity::STEPS;
use crate::motion::controller::third_derivative::third_derivative;
use crate::motion::rollout::{TimeGrid, rollout_with};
use crate::motion::trajectory::Trajectory;
use crate::validate::zeros;

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

/// Curves over the demonstrated duration or period, of which every movement under constant conditions consists.
///
/// With the derivative of order k with respect to the clock u, a movement is
///
/// ```text
/// y⁽ᵏ⁾(u) = [k = 0]·g + Σⱼ sⱼRⱼ⁽ᵏ⁾(u) + (y(0) − g)·E⁽ᵏ⁾(u)      discrete,
/// y⁽ᵏ⁾(u) = [k = 0]·y_a + r₀ Σⱼ sⱼRⱼ⁽ᵏ⁾(u)                     rhythmic, on its limit cycle,
/// ```
///
/// in degrees of freedom; those of a rotation are relative to its mean rotation q̄, q = q̄(u) ⊗ exp(δ).
#[derive(Clone, Debug)]
pub struct UnitCurves {
    /// Responses Rⱼ to the unit styles and their derivatives (3, J, T, D).
    pub styles: Array4<f64>,
    /// Response E to a start of one and its derivatives (3, T), equal for all degrees of freedom.
    pub start: Array2<f64>,
    /// Mean rotations (R, T, 10): q̄ as w, x, y, z, then ω̄ and ω̄′ in the body frame, per unit of the clock.
    pub mean_rotations: Array3<f64>,
    /// Index of the sample of `mean_rotations` to which goals or anchors are relative.
    pub centre: usize,
}

/// Computes the curves of a primitive at `steps` + 1 equidistant samples of its demonstrated duration or period.
///
/// ```
/// # use ndarray::s;
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit, rollout};
/// # use pdmp_core::motion::{TimeGrid, unit_curves};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let curves = unit_curves(model.primitive(), 100)?;
/// let (conditions, dt) = (model.conditions(&[0])?, model.primitive().duration() / 100.0);
/// let (style, goal, start) = (conditions.style.unwrap(), conditions.goal.unwrap(), conditions.start.unwrap());
/// let sum: f64 = style.iter().enumerate().map(|(j, s)| s * curves.styles[[0, j, 50, 1]]).sum();
/// let position = goal[1] + sum + (start[1] - goal[1]) * curves.start[[0, 50]];
/// let (style, goal, start) = (Some(style), Some(goal), Some(start));
/// let same = Conditions { style, goal, start, ..Conditions::default() };
/// let trajectory = rollout(model.primitive(), &same, TimeGrid { dt, duration: None })?;
/// assert!((trajectory.position[[50, 1]] - position).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// No step, or curves that do not fit into memory.
pub fn unit_curves(primitive: &Arc<Primitive>, steps: usize) -> Result<UnitCurves> {
    let inside = primitive.inside();
    let grid = TimeGrid { dt: inside.duration() / steps as f64, duration: None };
    let responses = compute_responses(inside, inside.tau, false, grid, &mut |_| Ok(()))?;
    let (n_samples, n_dofs) = responses.of(Derivative::Position).start.dim();
    let mut styles: Array4<f64> = zeros("curves", (3, inside.n_styles(), n_samples, n_dofs))?;
    let mut start: Array2<f64> = zeros("curves", (3, n_samples))?;
    for (k, derivative) in Derivative::ALL.into_iter().enumerate() {
        let (curves, unit) = (responses.of(derivative), inside.tau.powi(k as i32));
        start.row_mut(k).scaled_add(unit, &curves.start.column(0));
        for (j, curve) in curves.styles.iter().enumerate() {
            styles.slice_mut(s![k, j, .., ..]).scaled_add(unit, curve);
        }
    }
    let rotations = primitive.coordinates().map(|coordinates| coordinates.rotations()).unwrap_or_default();
    let mut mean_rotations: Array3<f64> = zeros("curves", (rotations.len(), n_samples, 10))?;
    let step = inside.canonical().extent() / steps as f64;
    for (rotation, mut rows) in rotations.iter().zip(mean_rotations.outer_iter_mut()) {
        for (k, mut row) in rows.rows_mut().into_iter().enumerate() {
            let mean = rotation.mean.at(k as f64 * step);
            let values = mean.rotation.iter().chain(&mean.velocity).chain(&mean.acceleration);
            row.iter_mut().zip(values).for_each(|(to, from)| *to = *from);
        }
    }
    let centre = if inside.kind() == Kind::Discrete { n_samples - 1 } else { 0 };
    Ok(UnitCurves { styles, start, mean_rotations, centre })
}

fn compute_responses(
    primitive: &Arc<Primitive>,
    tau: f64,
    has_goal_velocity: bool,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Responses> {
    let units = unit_conditions(primitive, tau, has_goal_velocity, None);
    let mut orders = [(); 3].map(|()| Vec::with_capacity(units.len()));
    for (i, unit) in units.iter().enumerate() {
        let mut progress = |share| progress((i as f64 + share) / units.len() as f64);
        let Trajectory { position, velocity, acceleration, .. } = rollout_with(primitive, unit, grid, &mut progress)?;
        orders.iter_mut().zip([position, velocity, acceleration]).for_each(|(curves, curve)| curves.push(curve));
    }
    Ok(Responses::new(orders.map(|curves| Curves::new(curves, has_goal_velocity))))
}

/// Returns the third derivatives of responses with respect to time, at intervals `dt`; those of a batch with an additional
/// forcing have its displacement as their last style.
///
/// # Errors
/// Derivatives that do not fit into memory.
pub(crate) fn third_derivatives<'a>(
    primitive: &Arc<Primitive>,
    responses: &'a Responses,
    tau: f64,
    forcing: Option<&Arc<AdditionalForcing>>,
    dt: f64,
) -> Result<&'a Curves> {
    let third = responses.third(|| {
        let (velocities, accelerations) = (responses.of(Derivative::Velocity), responses.of(Derivative::Acceleration));
        let has_goal_velocity = velocities.goal_velocity.is_some();
        let units = unit_conditions(primitive, tau, has_goal_velocity, forcing);
        let slopes = velocities.iter().zip(accelerations.iter());
        let third = |(unit, (velocity, acceleration))| third_derivative(primitive, unit, dt, [velocity, acceleration]);
        Ok(Curves::new(units.iter().zip(slopes).map(third).collect::<Result<_>>()?, has_goal_velocity))
    });
    primitive.responses.evict_excess();
    third
}

/// Returns the conditions whose movements are the responses, in the order of [`Curves::iter`].
fn unit_conditions(
    primitive: &Primitive,
    tau: f64,
    has_goal_velocity: bool,
    forcing: Option<&Arc<AdditionalForcing>>,
) -> Vec<Conditions> {
    let (n_dofs, n_styles) = (primitive.n_dofs(), primitive.n_styles());
    let vector = |value: f64| Some(vec![value; n_dofs]);
    let goal_velocity = vector(0.0).filter(|_| has_goal_velocity);
    let base = Conditions { goal_velocity, tau: Some(tau), ..about_zero(primitive) };
    let zero = Conditions { style: Some(vec![0.0; n_styles]), start: vector(0.0), ..base.clone() };
    let first_style = 2 + usize::from(has_goal_velocity);
    let mut units = vec![zero.clone(); first_style];
    units[0].start = vector(1.0);
    units[1].velocity = vector(1.0);
    units[2..].iter_mut().for_each(|unit| unit.goal_velocity = vector(1.0));
    units.resize(first_style + n_styles, base);
    for (j, unit) in units[first_style..].iter_mut().enumerate() {
        unit.style = Some((0..n_styles).map(|i| if i == j { 1.0 } else { 0.0 }).collect());
    }
    units.extend(forcing.map(|forcing| Conditions { forcing: Some(Arc::clone(forcing)), ..zero }));
    units
}

/// Returns conditions with goal and start, or anchor, of zero.
fn about_zero(primitive: &Primitive) -> Conditions {
    let zeros = Some(vec![0.0; primitive.n_dofs()]);
    match primitive.kind() {
        Kind::Discrete => Conditions { goal: zeros.clone(), start: zeros, ..Conditions::default() },
        Kind::Rhythmic => Conditions { anchor: zeros, ..Conditions::default() },
    }
}
