//! Time-optimal time law along a path within limits of velocity and acceleration.
//!
//! The path y(u) of a movement does not depend on the rate u̇ of its clock, so that ẏ = y′u̇ and ÿ = y″u̇² + y′ü. With x = u̇²
//! and a = ü constant over each of N intervals Δ, x_{i+1} = x_i + 2Δa_i and the limits are linear in (x, a):
//!
//! ```text
//! |y′| √x ≤ V,    |y″x + y′a| ≤ A at both ends of each interval.
//! ```
//!
//! A backward pass computes the largest x from which the rest of the path can be followed, a forward pass takes the largest
//! a that stays below it: O(N·D). The movement begins and ends at rest, or with the velocities that its conditions give.
//!
//! H. Pham, Q.-C. Pham, *A new approach to time-optimal path parameterization based on reachability analysis*, IEEE
//! Transactions on Robotics 34(3), 2018.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::limits::Limits;
use crate::motion::rollout::{TimeGrid, follow, rollout};
use crate::motion::trajectory::Trajectory;

/// Number of intervals of the path. Durations then are within 1e-3 of those of ten times this number.
const N_INTERVALS: usize = 1000;
/// Maximum rate relative to the nominal one, where no limit bounds it.
const MAX_RATE: f64 = 1e4;
/// Maximum number of Newton steps to a vertex; each removes a limit, and two to five suffice on recordings.
const MAX_NEWTON_STEPS: usize = 64;

/// Time law u(t): pieces of constant ü.
#[derive(Clone, Debug)]
pub(crate) struct TimeLaw {
    interval: f64,
    /// Time at each knot, in seconds.
    time: Vec<f64>,
    /// u̇ at each knot.
    rate: Vec<f64>,
}

impl TimeLaw {
    /// Returns the time law from x = u̇² at knots `interval` apart.
    fn new(interval: f64, x: &[f64]) -> Self {
        let rate: Vec<f64> = x.iter().map(|x| x.sqrt()).collect();
        let mut time = Vec::with_capacity(rate.len());
        time.push(0.0);
        for ends in rate.windows(2) {
            time.push(time[time.len() - 1] + 2.0 * interval / (ends[0] + ends[1]));
        }
        Self { interval, time, rate }
    }

    /// Returns the duration, in seconds.
    pub(crate) fn duration(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Returns u, u̇ and ü at time `t`; past the end, those of the end.
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let last = self.time.len() - 2;
        let i = self.time.partition_point(|knot| *knot <= t).saturating_sub(1).min(last);
        let length = self.time[i + 1] - self.time[i];
        let a = (self.rate[i + 1] - self.rate[i]) / length;
        let since = (t - self.time[i]).clamp(0.0, length);
        let u = self.interval * i as f64 + (self.rate[i] + 0.5 * a * since) * since;
        [u, self.rate[i] + a * since, if t <= self.duration() { a } else { 0.0 }]
    }
}

/// Limit |αx + βa| ≤ A.
#[derive(Clone, Copy, Debug)]
struct Row {
    alpha: f64,
    beta: f64,
    limit: f64,
}

impl Row {
    /// Returns the ends of a for a given x, each as value and slope with respect to x.
    fn ends(&self) -> [[f64; 2]; 2] {
        let Self { alpha, beta, limit } = *self;
        let (slope, half) = (-alpha / beta, limit / beta.abs());
        [[-half, slope], [half, slope]]
    }
}

/// Path of a movement and its limits: y′ and y″ of each DoF at N + 1 knots of the clock and the middles between them.
struct Path<'a> {
    /// Clock interval Δ between knots.
    interval: f64,
    /// y′ and y″ (2N + 1, D) by rows.
    slope: Vec<f64>,
    bend: Vec<f64>,
    velocity: &'a [f64],
    acceleration: &'a [f64],
}

impl Path<'_> {
    /// Returns the index of the last knot.
    fn last(&self) -> usize {
        self.slope.len() / self.velocity.len() / 2
    }

    /// Writes the limits of interval `i` on (x, a); returns the largest x at its start from the limits of x alone.
    fn rows(&self, i: usize, rows: &mut Vec<Row>, max: f64) -> f64 {
        let n = self.velocity.len();
        let mut most = max;
        rows.clear();
        for d in 0..n {
            let [here, next] = [2 * i * n + d, 2 * (i + 1) * n + d];
            most = most.min((self.velocity[d] / self.slope[here]).powi(2));
            let limit = self.acceleration[d];
            if limit.is_infinite() {
                continue;
            }
            let middle = here + n;
            for (knot, since) in [(here, 0.0), (middle, self.interval), (next, 2.0 * self.interval)] {
                let (alpha, beta) = (self.bend[knot], self.slope[knot] + since * self.bend[knot]);
                if beta != 0.0 {
                    rows.push(Row { alpha, beta, limit });
                } else if alpha != 0.0 {
                    most = most.min(limit / alpha.abs());
                }
            }
        }
        most
    }

    /// Returns x = u̇² at the knots of the time-optimal law from `start` to at most `end`.
    ///
    /// # Errors
    /// A start from which the limits cannot be kept.
    fn fastest(&self, [start, end]: [f64; 2], max: f64) -> Result<Vec<f64>> {
        let (last, twice) = (self.last(), 2.0 * self.interval);
        let mut rows = Vec::with_capacity(4 * self.velocity.len());
        let mut x = vec![0.0; last + 1];
        x[last] = end;
        for i in (0..last).rev() {
            let most = self.rows(i, &mut rows, max);
            x[i] = vertex(&rows, most, [[0.0, -1.0 / twice], [x[i + 1] / twice, -1.0 / twice]]);
        }
        if start > x[0] * (1.0 + 1e-9) {
            let ratio = (start / x[0]).sqrt();
            return Err(Error::Fit(format!(
                "velocity: the movement starts {ratio:.3} times too fast to keep its limits on the path; start slower"
            )));
        }
        x[0] = start.min(x[0]);
        for i in 0..last {
            self.rows(i, &mut rows, max);
            let a = rows
                .iter()
                .map(|row| row.ends()[1])
                .map(|[value, slope]| value + slope * x[i])
                .fold(f64::INFINITY, f64::min);
            x[i + 1] = x[i + 1].min(x[i] + twice * a).max(0.0);
        }
        Ok(x)
    }
}

/// Returns the largest x up to `most` for which some a lies within all rows and `next`.
///
/// The gap between the smallest upper and the largest lower end is concave in x and not negative at 0, so that Newton's
/// method from above reaches its zero in finitely many steps.
fn vertex(rows: &[Row], most: f64, next: [[f64; 2]; 2]) -> f64 {
    let mut x = most;
    for _ in 0..MAX_NEWTON_STEPS {
        let at = |[value, slope]: [f64; 2]| value + slope * x;
        let [mut lower, mut upper] = next;
        for row in rows {
            let [least, largest] = row.ends();
            if at(least) > at(lower) {
                lower = least;
            }
            if at(largest) < at(upper) {
                upper = largest;
            }
        }
        if at(upper) >= at(lower) {
            break;
        }
        let crossing = (upper[0] - lower[0]) / (lower[1] - upper[1]);
        if crossing >= x || crossing.is_nan() {
            break;
        }
        x = crossing.max(0.0);
    }
    x
}

/// Returns the limits of velocity and acceleration, infinite where there is none.
///
/// # Errors
/// Limits that do not fit, or neither of both.
fn rates(limits: &Limits, n_dofs: usize) -> Result<[Vec<f64>; 2]> {
    limits.check(n_dofs)?;
    let rates = limits.rates(n_dofs);
    if rates.iter().flatten().all(|limit| limit.is_infinite()) {
        let problem = "bound neither velocity nor acceleration: give one of them, or the movement takes no time";
        return Err(Error::Argument { name: "limits", problem });
    }
    Ok(rates)
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

/// Returns the path under conditions of [`on_path`], with y′ and y″ in place of ẏ and ÿ, and the interval of its clock.
fn path(primitive: &Arc<Primitive>, conditions: &Conditions) -> Result<(Trajectory, f64)> {
    let (tau, duration) = (primitive.tau(), primitive.duration());
    let dt = duration / (2 * N_INTERVALS) as f64;
    let mut path = rollout(primitive, conditions, TimeGrid { dt, duration: Some(duration) })?;
    path.velocity *= tau;
    path.acceleration *= tau * tau;
    Ok((path, 2.0 * dt / tau))
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
    let [velocity, acceleration] = rates(limits, primitive.n_dofs())?;
    let (path, _) = path(primitive, &on_path(primitive, conditions)?)?;
    let largest = |derivative: &ndarray::Array2<f64>, limits: &[f64]| {
        derivative.rows().into_iter().fold(0.0f64, |largest, row| {
            row.iter().zip(limits).fold(largest, |largest, (derivative, limit)| largest.max(derivative.abs() / limit))
        })
    };
    Ok(largest(&path.velocity, &velocity).max(largest(&path.acceleration, &acceleration).sqrt()))
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
    let [velocity, acceleration] = rates(limits, primitive.n_dofs())?;
    let given =
        |velocity: &Option<Vec<f64>>| velocity.as_ref().is_some_and(|velocity| velocity.iter().any(|v| *v != 0.0));
    let commanded = conditions.time_constant(primitive)?.powi(-2);
    let ends = [&conditions.velocity, &conditions.goal_velocity].map(|v| if given(v) { commanded } else { 0.0 });
    let conditions = on_path(primitive, conditions)?;
    let (trajectory, interval) = path(primitive, &conditions)?;
    limits.check_positions(&trajectory)?;
    let path = Path {
        interval,
        slope: trajectory.velocity.into_raw_vec_and_offset().0,
        bend: trajectory.acceleration.into_raw_vec_and_offset().0,
        velocity: &velocity,
        acceleration: &acceleration,
    };
    let x = path.fastest(ends, (MAX_RATE / primitive.tau()).powi(2))?;
    follow(primitive, &conditions, TimeLaw::new(interval, &x), dt)
}
