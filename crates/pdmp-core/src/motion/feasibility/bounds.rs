//! Limits of single DoFs, and the excess of a movement over them.

use super::extremes::{Movement, Place};
use crate::error::Result;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::motion::limits::{Limits, limit_of_dof};
use crate::motion::perturbation::{MIN_RANGE_RATIO, largest_range};

/// Largest excess that counts as rounding, relative to the limits.
pub(super) const TOLERANCE: f64 = 1e-9;
/// Limit of one side of a DoF: ±y ≤ ±value, or that of a derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub(super) derivative: Derivative,
    pub(super) dof: usize,
    /// 1 for an upper limit, −1 for a lower one.
    pub(super) side: f64,
    pub(super) value: f64,
    /// Unit of the excess.
    pub(super) scale: f64,
}

/// Excess of a movement over a limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excess {
    /// ±(y − value)/scale, at most 0 inside.
    pub(super) excess: f64,
    pub(super) place: Place,
}

impl Bound {
    /// Returns the excess of a movement at its start.
    pub(super) fn start_excess(&self, movement: &Movement) -> Excess {
        let excess = self.outward(movement, Place::START) - self.side * self.value / self.scale;
        Excess { excess, place: Place::START }
    }

    /// Returns the largest excess of a movement.
    pub(super) fn excess(&self, movement: &Movement) -> Excess {
        let (most, place) = movement.largest(self.derivative, self.dof, self.side);
        Excess { excess: self.relative(most), place }
    }

    /// Returns the largest excess of each stretch of a movement whose excess is above a tolerance.
    pub(super) fn excesses(&self, movement: &Movement, tolerance: f64) -> Vec<Excess> {
        let mut excesses = Vec::new();
        let mut stretch: Option<Excess> = None;
        movement.visit(self.derivative, self.dof, self.side, |value, place| {
            let excess = self.relative(value);
            if excess <= tolerance {
                excesses.extend(stretch.take());
            } else if stretch.is_none_or(|largest| excess > largest.excess) {
                stretch = Some(Excess { excess, place });
            }
            self.side * self.value + self.scale * stretch.map_or(tolerance, |largest| largest.excess)
        });
        excesses.extend(stretch);
        excesses
    }

    /// Returns the excess of ±y or a derivative.
    fn relative(&self, value: f64) -> f64 {
        (value - self.side * self.value) / self.scale
    }

    /// Returns the value of a movement or a response at a place, outwards positive and relative to the unit of the excess.
    pub(super) fn outward(&self, movement: &Movement, place: Place) -> f64 {
        self.side * movement.value(self.derivative, self.dof, place) / self.scale
    }
}

/// Returns the finite limits of position, velocity and acceleration.
///
/// # Errors
/// Limits that do not fit the primitive.
pub(super) fn bounds(primitive: &Primitive, limits: &Limits) -> Result<Vec<Bound>> {
    let n_dofs = primitive.n_dofs();
    limits.check(n_dofs)?;
    let [lower, upper] = limits.position(n_dofs);
    let ranges = ranges(primitive);
    let mut bounds = Vec::new();
    for dof in 0..n_dofs {
        let distance = upper[dof] - lower[dof];
        let scale = if distance.is_finite() { distance } else { ranges[dof] };
        for (side, value) in [(-1.0, lower[dof]), (1.0, upper[dof])] {
            bounds.push(Bound { derivative: Derivative::Position, dof, side, value, scale });
        }
        let rates = [(Derivative::Velocity, &limits.velocity), (Derivative::Acceleration, &limits.acceleration)];
        for (derivative, limit) in rates {
            let scale = limit_of_dof(limit, dof, f64::INFINITY);
            bounds.extend([-1.0, 1.0].map(|side| Bound { derivative, dof, side, value: side * scale, scale }));
        }
    }
    bounds.retain(|bound| bound.value.is_finite());
    Ok(bounds)
}

/// Returns the demonstrated ranges of the positions (D,), positive.
pub(super) fn ranges(primitive: &Primitive) -> Vec<f64> {
    let largest = largest_range(primitive.ranges());
    let least = if largest > 0.0 { MIN_RANGE_RATIO * largest } else { 1.0 };
    primitive.ranges().iter().map(|range| range.max(least)).collect()
}
