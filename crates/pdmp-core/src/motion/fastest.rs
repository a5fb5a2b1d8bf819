//! Fastest movements along a learnt path within limits of velocity and acceleration.

use std::sync::Arc;

use crate::error::{Error, LimitError, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::controller::Controller;
use crate::motion::limits::Limits;
use crate::motion::rollout::follow;
use crate::motion::time_law::{RateCurve, RateLimits, SampledPath, TimeLaw, max_constant};
use crate::motion::trajectory::Trajectory;
use crate::numerics::simd::groups;

/// Number of intervals of the path. Durations then are within 1e-3 of those of ten times this number.
const N_INTERVALS: usize = 1000;
/// Number of halvings of the first and the last interval.
const N_HALVINGS: i32 = 12;
/// Distance of the last knot from the end, where y″ is not continuous, relative to the path.
const KINK: f64 = 1e-9;
/// Maximum rate relative to the nominal one, where no limit bounds it.
const MAX_RATE: f64 = 1e4;

/// Returns the limits of velocity and acceleration, infinite where there is none.
///
/// # Errors
/// Limits that do not fit, or neither of both.
fn rate_limits(limits: &Limits, primitive: &Primitive) -> Result<Vec<RateLimits>> {
    limits.check_rotations(primitive)?;
    let n_dofs = primitive.n_dofs();
    if !limits.bound_rates(n_dofs) {
        let problem = "bound neither velocity nor acceleration: give one of them, or the movement takes no time";
        return Err(Error::Argument { name: "limits", problem });
    }
    Ok(limits.rates(n_dofs))
}

/// Returns the conditions at the τ of the primitive on the same path.
///
/// # Errors
/// A rhythmic primitive, or a warped time.
fn on_path(primitive: &Primitive, conditions: &Conditions) -> Result<Conditions> {
    if primitive.kind() == Kind::Rhythmic {
        let instead = ": it has no end; limit its controller instead";
        return Err(Error::Kind { name: "fastest", kind: Kind::Rhythmic, instead });
    }
    let mut conditions = conditions.clone();
    // Velocities are per second at the commanded τ.
    let scale = conditions.time_constant(primitive)? / primitive.tau();
    for velocity in [&mut conditions.velocity, &mut conditions.goal_velocity] {
        velocity.iter_mut().flatten().for_each(|v| *v *= scale);
    }
    (conditions.tau, conditions.segment_durations) = (None, None);
    Ok(conditions)
}

/// Returns the path under conditions of [`on_path`]. The first and the last interval are halved again and again towards the
/// ends, where the rate of a movement from rest to rest changes without bound per clock.
fn path(primitive: &Arc<Primitive>, conditions: &Conditions) -> Result<SampledPath> {
    let extent = primitive.canonical().extent();
    let interval = extent / N_INTERVALS as f64;
    let halved = |k: i32| interval * 0.5f64.powi(k);
    let knots = std::iter::once(0.0)
        .chain((1..=N_HALVINGS).rev().map(halved))
        .chain((1..N_INTERVALS).map(|i| interval * i as f64))
        .chain((1..=N_HALVINGS).map(|k| extent - halved(k)))
        .chain(std::iter::once(extent * (1.0 - KINK)));
    let mut path = SampledPath::at(knots.collect(), groups(primitive.n_dofs()));
    Controller::new(primitive, primitive.tau(), conditions, Some(0.0))?.sample_path(&mut path);
    Ok(path)
}

/// Returns the smallest constant τ with which the movement keeps its limits of velocity and acceleration, in seconds:
/// max(max|y′|/V, √(max|y″|/A)) over samples and DoFs.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit, rollout};
/// # use pdmp_core::motion::{Limits, TimeGrid, fastest_tau};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let limits = Limits { velocity: Some(vec![0.5; 2]), ..Limits::default() };
/// let tau = fastest_tau(model.primitive(), &limits, &Conditions::default())?;
/// let conditions = Conditions { tau: Some(tau), ..Conditions::default() };
/// let movement = rollout(model.primitive(), &conditions, TimeGrid { dt: 1e-3, duration: None })?;
/// let peak = movement.velocity.fold(0.0f64, |peak, v| peak.max(v.abs()));
/// assert!((peak - 0.5).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or limits that do not fit the primitive, or no limit of velocity or acceleration.
pub fn fastest_tau(primitive: &Arc<Primitive>, limits: &Limits, conditions: &Conditions) -> Result<f64> {
    let bounds = rate_limits(limits, primitive)?;
    let path = path(primitive, &on_path(primitive, conditions)?)?;
    let knots =
        (0..path.clock.len() - 1).flat_map(|i| [0.0, 0.5, 1.0].map(|t| max_constant(path.within(i, t), &bounds)));
    let most = knots.fold(f64::INFINITY, f64::min);
    Ok(most.sqrt().recip())
}

/// Computes the movement that follows the path of the conditions as fast as the limits allow, sampled every `dt` seconds.
///
/// It begins and ends at rest; with a `velocity` or `goal_velocity` in the conditions it begins or ends with that.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::motion::{Limits, fastest};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let limits = Limits { velocity: Some(vec![1.5; 2]), acceleration: Some(vec![8.0; 2]), ..Limits::default() };
/// let movement = fastest(model.primitive(), &limits, &Conditions::default(), 1e-3)?;
/// assert!(movement.velocity.iter().all(|v| v.abs() < 1.5 * 1.001));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or limits that do not fit the primitive, no limit of velocity or acceleration, a path that leaves the limits
/// of the position, or a velocity at the start from which the limits cannot be kept.
pub fn fastest(primitive: &Arc<Primitive>, limits: &Limits, conditions: &Conditions, dt: f64) -> Result<Trajectory> {
    let bounds = rate_limits(limits, primitive)?;
    let given =
        |velocity: &Option<Vec<f64>>| velocity.as_ref().is_some_and(|velocity| velocity.iter().any(|v| *v != 0.0));
    let commanded = conditions.time_constant(primitive)?.powi(-2);
    let [start, end] =
        [&conditions.velocity, &conditions.goal_velocity].map(|v| if given(v) { commanded } else { 0.0 });
    let conditions = on_path(primitive, conditions)?;
    let path = path(primitive, &conditions)?;
    check_positions(&path, limits, primitive)?;
    let mut curve = RateCurve::new(path.clock.len(), bounds.len());
    curve.compute(&path, &bounds, end, (MAX_RATE / primitive.tau()).powi(2));
    if start > curve.max[0] * (1.0 + 1e-9) {
        return Err(Error::Limits(LimitError::StartTooFast { ratio: (start / curve.max[0]).sqrt() }));
    }
    let start = start.min(curve.max[0]);
    curve.reach(&path, &bounds, start);
    follow(primitive, &conditions, TimeLaw::new(path.clock, &curve.max), dt)
}

/// Checks that the path keeps the limits of the position.
///
/// # Errors
/// The first position outside.
fn check_positions(path: &SampledPath, limits: &Limits, primitive: &Primitive) -> Result<()> {
    let [lower, upper] = limits.position(primitive.n_dofs());
    for (i, u) in path.clock.iter().enumerate() {
        let positions = path.knot(i).iter().flat_map(|[position, ..]| position.to_array());
        for (dof, value) in positions.take(primitive.n_dofs()).enumerate() {
            if value < lower[dof] || value > upper[dof] {
                let phase = u / primitive.canonical().extent();
                let (lower, upper) = (lower[dof], upper[dof]);
                return Err(Error::Limits(LimitError::LeftByPath { dof, value, lower, upper, phase }));
            }
        }
    }
    Ok(())
}
