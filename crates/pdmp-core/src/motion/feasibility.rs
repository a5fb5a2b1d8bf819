//! Comparison of movements with limits of position, velocity and acceleration.

use std::sync::Arc;

use ndarray::Array2;

use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::motion::limits::{Limits, limit_of_dof};
use crate::motion::rollout::rollout_at;
use crate::motion::trajectory::Trajectory;

/// Number of intervals between the samples of a movement. Movements found on recordings of four skills exceed their limits at ten
/// times this number by less than 4e-5 of them.
const N_INTERVALS: usize = 2000;
/// Distance of the samples on both sides of the end, where the acceleration is not continuous, relative to the duration.
const KINK: f64 = 1e-9;
/// Largest excess that counts as rounding, relative to the limits: movements that start at rest on a limit of the position may
/// pass it by 1e-8.
pub(crate) const TOLERANCE: f64 = 1e-6;

/// Extreme of a movement relative to its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// |ẏ|/V or |ÿ|/A, at most 1 inside; for the position the distance outside, relative to the range between the limits, or
    /// to that of the nominal movement if a side has none: at most 0 inside.
    pub ratio: f64,
    /// Index of the DoF.
    pub dof: usize,
    /// Time, in seconds.
    pub time: f64,
}

/// Largest ratios of a movement to its limits; `None` for a kind without limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Margins {
    /// Distance of the position outside.
    pub position: Option<Extreme>,
    /// Ratio of the velocity.
    pub velocity: Option<Extreme>,
    /// Ratio of the acceleration.
    pub acceleration: Option<Extreme>,
}

impl Margins {
    /// Returns whether the movement keeps all limits, within 1e-6 of them.
    pub fn is_feasible(&self) -> bool {
        let keeps =
            |extreme: Option<Extreme>, most: f64| extreme.is_none_or(|extreme| extreme.ratio <= most + TOLERANCE);
        keeps(self.position, 0.0) && keeps(self.velocity, 1.0) && keeps(self.acceleration, 1.0)
    }
}

/// Limit of one side of a DoF: ±y^(order) ≤ ±value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    pub(crate) derivative: Derivative,
    pub(crate) dof: usize,
    /// 1 for an upper limit, −1 for a lower one.
    pub(crate) side: f64,
    pub(crate) value: f64,
    /// Unit of the excess.
    pub(crate) scale: f64,
}

impl Bound {
    /// Returns whether a movement keeps the limit.
    #[cfg(feature = "learning")]
    pub(crate) fn is_kept(&self, movement: &Trajectory) -> bool {
        self.worst(movement).1 <= TOLERANCE
    }

    /// Returns the place of the largest excess ±(y − value)/scale, and that excess, at most 0 inside.
    pub(crate) fn worst(&self, movement: &Trajectory) -> (Place, f64) {
        let samples = of(movement, self.derivative).column(self.dof);
        let excess = |sample: usize| match self.derivative {
            Derivative::Position => self.side * (samples[sample] - self.value) / self.scale,
            Derivative::Velocity | Derivative::Acceleration => self.side * samples[sample] / self.scale - 1.0,
        };
        let mut worst = (Place { sample: 0, share: 0.0 }, excess(0));
        for sample in 1..samples.len() {
            let here = excess(sample);
            // The last two samples enclose the end.
            let (before, after) =
                if sample < N_INTERVALS { (excess(sample - 1), excess(sample + 1)) } else { (here, here) };
            let (slope, bend) = (0.5 * (after - before), after - 2.0 * here + before);
            let is_peak = here >= before && here >= after && bend < 0.0;
            let share = if is_peak { -slope / bend } else { 0.0 };
            let most = here + 0.5 * share * slope;
            if most > worst.1 {
                worst = (Place { sample, share }, most);
            }
        }
        worst
    }
}

/// Place between samples: on the parabola through a sample and its neighbours, at a share of the interval from the sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    sample: usize,
    share: f64,
}

impl Place {
    /// Returns the value of a DoF, linear in the samples.
    #[cfg(feature = "learning")]
    pub(crate) fn value(&self, movement: &Trajectory, derivative: Derivative, dof: usize) -> f64 {
        let (samples, Self { sample, share }) = (of(movement, derivative).column(dof), *self);
        if share == 0.0 {
            return samples[sample];
        }
        let [before, here, after] = [samples[sample - 1], samples[sample], samples[sample + 1]];
        here + 0.5 * share * (after - before + share * (after - 2.0 * here + before))
    }

    /// Returns the time, in seconds.
    pub(crate) fn time(&self, movement: &Trajectory) -> f64 {
        let time = &movement.time;
        time[self.sample] + self.share * (time[1] - time[0])
    }
}

/// Returns positions, velocities or accelerations (T, D).
fn of(trajectory: &Trajectory, derivative: Derivative) -> &Array2<f64> {
    match derivative {
        Derivative::Position => &trajectory.position,
        Derivative::Velocity => &trajectory.velocity,
        Derivative::Acceleration => &trajectory.acceleration,
    }
}

/// Computes the movement at the times at which it is compared with its limits: those of its demonstrated duration or period,
/// scaled by τ.
pub(crate) fn sampled(primitive: &Arc<Primitive>, conditions: &Conditions) -> Result<Trajectory> {
    let duration = primitive.duration() * conditions.time_constant(primitive)? / primitive.tau();
    let interval = duration * (1.0 - KINK) / N_INTERVALS as f64;
    let times = (0..=N_INTERVALS).map(|k| k as f64 * interval).chain([duration * (1.0 + KINK)]);
    rollout_at(primitive, conditions, times.collect())
}

/// Returns the range of the positions of the nominal movement (D,), positive.
///
/// # Errors
/// None for a valid primitive.
pub(crate) fn ranges(primitive: &Arc<Primitive>) -> Result<Vec<f64>> {
    let nominal = sampled(primitive, &Conditions::default())?;
    let range_of = |column: ndarray::ArrayView1<f64>| {
        let [least, most] = [f64::min, f64::max].map(|extreme| column.iter().copied().fold(column[0], extreme));
        most - least
    };
    let ranges: Vec<f64> = nominal.position.columns().into_iter().map(range_of).collect();
    let largest = ranges.iter().copied().fold(0.0, f64::max);
    // A DoF at rest takes a thousandth of the largest range.
    let least = if largest > 0.0 { 1e-3 * largest } else { 1.0 };
    Ok(ranges.into_iter().map(|range| range.max(least)).collect())
}

/// Returns the finite limits of position, velocity and acceleration.
///
/// # Errors
/// Limits that do not fit the primitive.
pub(crate) fn bounds(limits: &Limits, ranges: &[f64]) -> Result<Vec<Bound>> {
    limits.check(ranges.len())?;
    let [lower, upper] = limits.position(ranges.len());
    let mut bounds = Vec::new();
    for (dof, range) in ranges.iter().enumerate() {
        let distance = upper[dof] - lower[dof];
        let scale = if distance.is_finite() { distance } else { *range };
        bounds.push(Bound { derivative: Derivative::Position, dof, side: -1.0, value: lower[dof], scale });
        bounds.push(Bound { derivative: Derivative::Position, dof, side: 1.0, value: upper[dof], scale });
        let rates = [(Derivative::Velocity, &limits.velocity), (Derivative::Acceleration, &limits.acceleration)];
        for (derivative, limit) in rates {
            let scale = limit_of_dof(limit, dof, f64::INFINITY);
            bounds.extend([-1.0, 1.0].map(|side| Bound { derivative, dof, side, value: side * scale, scale }));
        }
    }
    bounds.retain(|bound| bound.value.is_finite());
    Ok(bounds)
}

/// Compares the movement under constant conditions with limits of position, velocity and acceleration, over its demonstrated
/// duration, or one period, scaled by τ.
///
/// ```text
/// position: max((lower − y), (y − upper))/range,   velocity: max |ẏ|/V,   acceleration: max |ÿ|/A
/// ```
///
/// over time and DoFs. A limit of the jerk does not count.
///
/// ```
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::motion::{Limits, feasible};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let limits = Limits { velocity: Some(vec![0.5]), ..Limits::default() };
/// let margins = feasible(model.primitive(), &limits, &Conditions::default())?;
/// assert!(!margins.is_feasible());
/// // The first DoF exceeds 0.5 m/s in the middle.
/// let fastest = margins.velocity.expect("there is a limit of the velocity");
/// assert!(fastest.dof == 0 && fastest.ratio > 3.0 && (fastest.time - 0.5).abs() < 0.1);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Conditions or limits that do not fit the primitive.
pub fn feasible(primitive: &Arc<Primitive>, limits: &Limits, conditions: &Conditions) -> Result<Margins> {
    limits.check_rotations(primitive)?;
    let (primitive, conditions) = primitive.inside_with(conditions)?;
    let bounds = bounds(limits, &ranges(primitive)?)?;
    let movement = sampled(primitive, &conditions)?;
    let mut margins = Margins::default();
    for bound in bounds {
        let (place, excess) = bound.worst(&movement);
        let (extreme, ratio) = match bound.derivative {
            Derivative::Position => (&mut margins.position, excess),
            // The quotient is exact where the excess is rounded.
            Derivative::Velocity => (&mut margins.velocity, excess + 1.0),
            Derivative::Acceleration => (&mut margins.acceleration, excess + 1.0),
        };
        if extreme.is_none_or(|extreme| ratio > extreme.ratio) {
            *extreme = Some(Extreme { ratio, dof: bound.dof, time: place.time(&movement) });
        }
    }
    Ok(margins)
}
