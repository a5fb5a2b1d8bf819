//! Jacobians of movements with respect to their conditions, from unit responses.

use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayViewMut2, Axis, s};

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Coordinates;
use crate::model::conditions::{Conditions, ResolvedConditions, reject_for_kind, reject_goal_velocity};
use crate::model::primitive::Primitive;
use crate::model::responses::{Derivative, Responses};
use crate::motion::controller::third_derivative::third_derivative;
use crate::motion::rollout::{TimeGrid, rollout};
use crate::motion::unit_responses::responses;
use crate::numerics::rotation::dot;
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
    /// Start velocity ẏ(0) (D,).
    Velocity,
    /// Final velocity ẏ_g (D,) of a discrete movement.
    GoalVelocity,
    /// Amplitude r₀ of a rhythmic movement.
    Amplitude,
    /// Time constant τ, at fixed times.
    Tau,
}

impl WithRespectTo {
    /// Refuses a condition that this kind of primitive does not have.
    pub(crate) fn check(self, kind: Kind) -> Result<()> {
        reject_for_kind(kind, "goal", self == Self::Goal && kind == Kind::Rhythmic)?;
        reject_for_kind(kind, "anchor", self == Self::Anchor && kind == Kind::Discrete)?;
        reject_for_kind(kind, "amplitude", self == Self::Amplitude && kind == Kind::Discrete)
    }
}

/// Computes the Jacobian of a rollout: (T, D, J) with respect to the style, (T, D, 1) to amplitude and τ, else (T, D, D).
///
/// A movement is linear in all conditions but τ, so that the Jacobian is exact and independent of their values:
///
/// ```text
/// ∂y/∂sⱼ = r₀(Rⱼ − Rⱼ(0)·E − Ṙⱼ(0)·V)
/// ∂y/∂g = 1 − E
/// ∂y/∂y_a = 1, or 1 − E if a start is given
/// ∂y/∂y(0) = E
/// ∂y/∂ẏ(0) = V
/// ∂y/∂ẏ_g = G
/// ∂y/∂r₀ = Σⱼ sⱼ(∂y/∂sⱼ)/r₀
/// ∂y⁽ᵏ⁾/∂τ = (−k·y⁽ᵏ⁾ − t·y⁽ᵏ⁺¹⁾ + ẏ(0)·V⁽ᵏ⁾ + ẏ_g·G⁽ᵏ⁾)/τ
/// ```
///
/// with the responses R to the unit styles, E to a unit start, V to a unit start velocity and G to a unit final velocity. If
/// a final velocity is given, all responses keep it. The terms with E and V apply only if a start or a start velocity is
/// given. τ scales time, and velocities given per second keep their values. `derivative` selects y, ẏ or ÿ.
///
/// With respect to τ it is the derivative wherever one exists. At samples that fall on a knot of the forcing table or of the
/// transport profile the slope of ÿ jumps, and its mean stands for it. A movement that ends with a velocity has no derivative
/// of ÿ at the sample of its end, where ÿ jumps.
///
/// `progress` is called periodically with the completed fraction; an error it returns cancels the call.
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
/// A variable of the other kind of primitive, durations of several segments, a phase other than 0, conditions or times that
/// do not fit the primitive, or the error of `progress`.
pub fn jacobian(
    primitive: &Arc<Primitive>,
    variable: WithRespectTo,
    derivative: Derivative,
    conditions: &Conditions,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Array3<f64>> {
    if let Some(coordinates) = primitive.coordinates() {
        return in_coordinates(coordinates, variable, derivative, conditions, grid, progress);
    }
    let kind = primitive.kind();
    variable.check(kind)?;
    if conditions.segment_durations.as_ref().is_some_and(|segment_durations| segment_durations.len() > 1) {
        return Err(Error::Argument {
            name: "segment_durations",
            problem: "does not apply: Jacobians are available in linear time only; pass tau instead",
        });
    }
    let given = conditions;
    let conditions = given.complete(primitive)?;
    if conditions.phase > 0.0 {
        return Err(Error::Argument {
            name: "phase",
            problem: "does not apply: Jacobians are those of a movement from phase 0; vector-Jacobian products take it",
        });
    }
    let by_goal_velocity = variable == WithRespectTo::GoalVelocity;
    reject_goal_velocity(primitive, by_goal_velocity)?;
    let has_goal_velocity = conditions.has_goal_velocity || by_goal_velocity;
    let responses = responses(primitive, conditions.tau, has_goal_velocity, grid, progress)?;
    let curves = responses.of(derivative);
    // Derivative of the centre with respect to itself, and its derivatives with respect to time.
    let one = if derivative == Derivative::Position { 1.0 } else { 0.0 };
    match variable {
        WithRespectTo::Style => by_style(&responses, derivative, &conditions),
        WithRespectTo::Amplitude => by_amplitude(&responses, derivative, conditions),
        WithRespectTo::Tau => {
            let movement = rollout(primitive, given, grid)?;
            let slopes = [&movement.velocity, &movement.acceleration];
            let (own, slope) = match derivative {
                Derivative::Position => (&movement.position, slopes[0]),
                Derivative::Velocity => (slopes[0], slopes[1]),
                Derivative::Acceleration => (slopes[1], &third_derivative(primitive, given, grid.dt, slopes)?),
            };
            by_tau(&responses, derivative, &conditions, [own, slope], grid)
        }
        WithRespectTo::Goal | WithRespectTo::Anchor if conditions.start.is_some() => {
            by_dof(&curves.start, |response| one - response)
        }
        WithRespectTo::Goal | WithRespectTo::Anchor => by_dof(&curves.start, |_| one),
        WithRespectTo::Start => by_dof(&curves.start, |response| response),
        WithRespectTo::Velocity => by_dof(&curves.velocity, |response| response),
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

/// Returns the Jacobian (T, D, 1) with respect to the amplitude.
fn by_amplitude(responses: &Responses, derivative: Derivative, conditions: ResolvedConditions) -> Result<Array3<f64>> {
    let conditions = ResolvedConditions { amplitude: 1.0, ..conditions };
    let by_style = by_style(responses, derivative, &conditions)?;
    let mut jacobian = zeros("jacobian", (by_style.dim().0, by_style.dim().1, 1))?;
    for (style, by_style) in conditions.style.iter().zip(by_style.axis_iter(Axis(2))) {
        jacobian.index_axis_mut(Axis(2), 0).scaled_add(*style, &by_style);
    }
    Ok(jacobian)
}

/// Returns the Jacobian (T, D, 1) with respect to τ of one order of a movement, from that order and the next.
fn by_tau(
    responses: &Responses,
    derivative: Derivative,
    conditions: &ResolvedConditions,
    [own, slope]: [&Array2<f64>; 2],
    grid: TimeGrid,
) -> Result<Array3<f64>> {
    let (order, curves, rate) = (derivative as usize, responses.of(derivative), 1.0 / conditions.tau);
    let (n_samples, n_dofs) = curves.start.dim();
    let mut jacobian = zeros("jacobian", (n_samples, n_dofs, 1))?;
    for ((k, d, _), value) in jacobian.indexed_iter_mut() {
        let time = k as f64 * grid.dt;
        let given = conditions.velocity.as_ref().map_or(0.0, |velocity| velocity[d] * curves.velocity[[k, d]]);
        let last = curves.goal_velocity.as_ref().map_or(0.0, |curve| conditions.goal_velocity[d] * curve[[k, d]]);
        let moved = -(order as f64) * own[[k, d]] - time * slope[[k, d]];
        *value = (moved + given + last) * rate;
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

/// Returns the Jacobian of a primitive with rotations, whose changes are rotation vectors.
fn in_coordinates(
    coordinates: &Coordinates,
    variable: WithRespectTo,
    derivative: Derivative,
    conditions: &Conditions,
    grid: TimeGrid,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Array3<f64>> {
    if derivative != Derivative::Position {
        let problem = "must be 0 for a model with rotations: Jacobians of angular velocities do not exist; compare rollouts of \
                       two conditions";
        return Err(Error::Argument { name: "derivative", problem });
    }
    if matches!(variable, WithRespectTo::Velocity | WithRespectTo::Tau) {
        let problem = "does not apply to a model with rotations, whose mean rotations move with the clock; compare rollouts \
                       of two conditions";
        return Err(Error::Argument { name: "wrt", problem });
    }
    let fixed = match variable {
        WithRespectTo::Start => &conditions.velocity,
        WithRespectTo::Goal | WithRespectTo::Anchor => &conditions.goal_velocity,
        _ => &None,
    };
    if fixed.is_some() {
        let problem = "does not apply: the Jacobian by a start or goal with rotations is that without its velocity";
        let name = if variable == WithRespectTo::Start { "velocity" } else { "goal_velocity" };
        return Err(Error::Argument { name, problem });
    }
    let (inside, conditions) = (coordinates.dofs(), coordinates.constant_in_dofs(conditions)?);
    let mut of_dofs = jacobian(inside, variable, derivative, &conditions, grid, progress)?;
    let resolved = conditions.complete(inside)?;
    let movement = rollout(inside, &conditions, grid)?;
    let rate = 1.0 / resolved.tau;
    for (k, mut rows) in of_dofs.outer_iter_mut().enumerate() {
        let position = movement.position.row(k).to_vec();
        coordinates.for_each_tangent(k as f64 * grid.dt * rate, &position, |dof, forward, _| {
            map_axis(rows.slice_mut(s![dof..dof + 3, ..]), forward);
        });
    }
    let (u, at) = match variable {
        WithRespectTo::Style | WithRespectTo::Amplitude => return Ok(of_dofs),
        WithRespectTo::Start => (0.0, resolved.start.as_ref().unwrap_or(&inside.nominal.start)),
        _ => (coordinates.centre_clock(), &resolved.centre),
    };
    coordinates.for_each_tangent(u, at, |dof, _, backward| {
        for mut rows in of_dofs.outer_iter_mut() {
            // Columns are multiplied by the inverse from the right: rows of the transpose by its transpose.
            let columns = rows.slice_mut(s![.., dof..dof + 3]);
            let unit = |i: usize| std::array::from_fn(|j| f64::from(u8::from(i == j)));
            let inverse: [[f64; 3]; 3] = [0, 1, 2].map(|i| backward(unit(i)));
            map_axis(columns.reversed_axes(), &|v| std::array::from_fn(|i| dot(inverse[i], v)));
        }
    });
    Ok(of_dofs)
}

/// Maps the columns of a matrix (3, N).
fn map_axis(mut columns: ArrayViewMut2<f64>, map: &dyn Fn([f64; 3]) -> [f64; 3]) {
    for mut column in columns.columns_mut() {
        let mapped = map(std::array::from_fn(|i| column[i]));
        (0..3).for_each(|i| column[i] = mapped[i]);
    }
}
