//! Fastest movements along a learnt path within limits of velocity and acceleration.

use std::sync::Arc;

use crate::error::{Error, LimitError, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::command::Motion;
use crate::motion::controller::Controller;
use crate::motion::feasibility::slowdown;
use crate::motion::limits::Limits;
use crate::motion::rate_limits::PathLimits;
use crate::motion::sampled_path::{Derivatives, SampledPath};
use crate::motion::time_law::{RateCurve, TimeLaw};
use crate::motion::trajectory::{Trajectory, step_count};
use crate::numerics::simd::{Kernel, Register, WIDTH, compute, groups, pack, unpad};
use crate::validate::check_positive;

/// Number of intervals of the path. On recordings, durations then are 0.1 to 1.6 % above those of eight times this number, the
/// more the slower the movement.
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
fn rate_limits(limits: &Limits, primitive: &Primitive) -> Result<PathLimits> {
    limits.check_rotations(primitive)?;
    let n_dofs = primitive.n_dofs();
    if !limits.bound_rates(n_dofs) {
        let problem = "bound neither velocity nor acceleration: give one of them, or the movement takes no time";
        return Err(Error::Argument { name: "limits", problem });
    }
    Ok(limits.along_path(primitive))
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
fn path(primitive: &Arc<Primitive>, conditions: &Conditions, limits: &PathLimits) -> Result<SampledPath> {
    let extent = primitive.canonical().extent();
    let interval = extent / N_INTERVALS as f64;
    let halved = |k: i32| interval * 0.5f64.powi(k);
    let knots = std::iter::once(0.0)
        .chain((1..=N_HALVINGS).rev().map(halved))
        .chain((1..N_INTERVALS).map(|i| interval * i as f64))
        .chain((1..=N_HALVINGS).map(|k| extent - halved(k)))
        .chain(std::iter::once(extent * (1.0 - KINK)));
    let mut path = SampledPath::at(knots.collect(), groups(primitive.n_dofs()), limits.rotations.len());
    path.sample_turns(limits);
    Controller::new(primitive, primitive.tau(), conditions, Some(0.0))?.sample_path(&mut path);
    Ok(path)
}

/// Returns the smallest constant τ with which the movement keeps its limits of velocity and acceleration, in seconds:
/// max(max|y′|/V, √(max|y″|/A)) over DoFs and the whole movement, until it rests past its end; of a rotation with the sizes of
/// its angular velocity and acceleration.
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
    rate_limits(limits, primitive)?;
    Ok(primitive.tau() * slowdown(primitive, limits, &on_path(primitive, conditions)?)?)
}

/// Computes the movement that follows the path of the conditions as fast as the limits allow, sampled every `dt` seconds.
///
/// It begins and ends at rest; with a `velocity` or `goal_velocity` in the conditions it begins or ends with that. Limits hold
/// at the ends and in the middle of each thousandth of the path. In between, recordings exceed them by up to 0.5 %, paths with
/// corners by 2 %; a controller with the limits keeps them at every tick. Where the axis of a rotation turns, up to 1.9 % of the limit
/// of its angular acceleration remain unused.
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
    let path = path(primitive, &conditions, &bounds)?;
    check_positions(&path, limits, primitive)?;
    let mut curve = RateCurve::new(path.clock.len(), bounds.groups.len(), bounds.rotations.len());
    curve.compute(&path, &bounds, end, (MAX_RATE / primitive.tau()).powi(2));
    if start > curve.max[0] * (1.0 + 1e-9) {
        return Err(Error::Limits(LimitError::StartTooFast { ratio: (start / curve.max[0]).sqrt() }));
    }
    let start = start.min(curve.max[0]);
    curve.reach(&path, &bounds, start);
    follow(primitive, &path, &TimeLaw::new(&path.clock, &curve.max), dt)
}

/// Samples the movement that follows a path by a time law, every `dt` seconds up to the first sample at its end or past it.
///
/// Between knots the path is that for which the law keeps the limits.
fn follow(primitive: &Primitive, path: &SampledPath, law: &TimeLaw, dt: f64) -> Result<Trajectory> {
    check_positive("dt", dt)?;
    let steps = step_count(None, (law.duration() / dt).ceil() * dt, dt)?;
    let mut interval = 0;
    let [mut y, mut dy, mut ddy] = [(); 3].map(|()| vec![0.0; primitive.n_dofs()]);
    let mut before = vec![0.0; primitive.n_coordinates()];
    Trajectory::record("fastest", primitive, steps, dt, &mut |_| Ok(()), |_, time, motion| {
        let at = law.at(time, interval);
        interval = at.0;
        let Some(coordinates) = primitive.coordinates() else {
            compute(Sample { path, at, motion });
            return Ok(());
        };
        compute(Sample {
            path,
            at,
            motion: &mut Motion { position: &mut y, velocity: &mut dy, acceleration: &mut ddy },
        });
        let [u, rate, change] = at.1;
        let Motion { position, velocity, acceleration } = motion;
        // A quaternion keeps its sign from sample to sample.
        position.copy_from_slice(&before);
        coordinates.motion(u, [rate, change], [&y, &dy, &ddy], position, velocity, acceleration);
        before.copy_from_slice(position);
        Ok(())
    })
}

/// Kernel of [`follow`]: the motion in an interval for u, u̇ and ü.
struct Sample<'a, 'b> {
    path: &'a SampledPath,
    at: (usize, [f64; 3]),
    motion: &'a mut Motion<'b>,
}

impl Kernel for Sample<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { path, at: (i, [u, rate, change]), motion: Motion { position, velocity, acceleration } } = self;
        let (interval, since) = (path.interval(i), u - path.clock[i]);
        let (t, n_dofs) = (since / interval, position.len());
        for (group, (here, next)) in path.knot(i).iter().zip(path.knot(i + 1)).enumerate() {
            let dofs = group * WIDTH..n_dofs.min((group + 1) * WIDTH);
            let [from, to] = Derivatives::<T>::load_both([here, next]);
            let Derivatives { slope, bend } = from.between(to, interval, t);
            unpad((T::load(&here[0]) + from.way(to, interval, t)).store(), &mut position[dofs.clone()]);
            unpad((slope * rate).store(), &mut velocity[dofs.clone()]);
            unpad((bend * (rate * rate) + slope * change).store(), &mut acceleration[dofs]);
        }
    }
}

/// Checks that the path keeps the limits of the position.
///
/// # Errors
/// The first position outside.
fn check_positions(path: &SampledPath, limits: &Limits, primitive: &Primitive) -> Result<()> {
    if limits.lower.is_none() && limits.upper.is_none() {
        return Ok(());
    }
    let [lower, upper] = limits.position(primitive.n_dofs());
    let [lowest, highest] = [&lower, &upper].map(|limits| pack(limits));
    for (i, u) in path.clock.iter().enumerate() {
        for (group, [position, ..]) in path.knot(i).iter().enumerate() {
            let outside = position.simd_lt(lowest[group]) | position.simd_gt(highest[group]);
            if outside.any() {
                let lane = outside.to_bitmask().trailing_zeros() as usize;
                let (dof, value) = (group * WIDTH + lane, position.as_array()[lane]);
                let phase = u / primitive.canonical().extent();
                let (lower, upper) = (lower[dof], upper[dof]);
                return Err(Error::Limits(LimitError::LeftByPath { dof, value, lower, upper, phase }));
            }
        }
    }
    Ok(())
}
