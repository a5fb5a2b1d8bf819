//! Half-spaces in place of the limits of rotations, for the search of conditions.
//!
//! The size of an angular velocity or acceleration at one time is no affine function of style and goal. Where it exceeds its limit, the
//! movement is linearised at the present conditions by differences, and the half-space of the linearised size joins the program. As the
//! size is nearly convex, the rounds lead to conditions whose movement keeps the limit, close to the nearest ones.

use std::sync::Arc;

use ndarray::ArrayView1;

use super::bounds::Bound;
use super::sampling::times;
use super::turning::{SEARCH_MARGIN, compare};
use super::{Extreme, Margins};
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::model::responses::Derivative;
use crate::motion::limits::Limits;
use crate::motion::rollout::rollout_at;
use crate::motion::trajectory::Trajectory;

/// Step of the differences, in standard deviations.
const STEP: f64 = 1e-4;

/// Limits of the rotations of a primitive, and the request that a search starts from.
pub(super) struct TurnCuts<'a> {
    pub(super) primitive: &'a Arc<Primitive>,
    pub(super) limits: &'a Limits,
    pub(super) request: &'a Conditions,
}

/// Sample at which a stretch of a movement exceeds the limit of a rotation most.
struct Peak {
    dof: usize,
    derivative: Derivative,
    sample: usize,
    /// Size relative to the limit of the search, minus 1.
    excess: f64,
}

/// Half-space in x: the excess at a peak with its gradient.
pub(super) struct Cut {
    pub(super) gradient: Vec<f64>,
    pub(super) excess: f64,
}

impl TurnCuts<'_> {
    /// Returns the half-spaces of the stretches in which the movement exceeds limits by more than `tolerance`, and the largest excess,
    /// given the conditions of the DoFs as a function of x.
    ///
    /// # Errors
    /// A movement that overflows.
    pub(super) fn at(
        &self,
        x: &[f64],
        tolerance: f64,
        conditions: impl Fn(&[f64]) -> Conditions,
    ) -> Result<(Vec<Cut>, f64)> {
        let here = self.movement(&conditions(x))?;
        let peaks = self.peaks(&here, tolerance);
        let largest = peaks.iter().fold(f64::NEG_INFINITY, |largest, peak| largest.max(peak.excess));
        let mut cuts: Vec<Cut> = peaks.iter().map(|peak| Cut { gradient: Vec::new(), excess: peak.excess }).collect();
        for j in if peaks.is_empty() { 0..0 } else { 0..x.len() } {
            let mut stepped = x.to_vec();
            stepped[j] += STEP;
            let movement = self.movement(&conditions(&stepped))?;
            for (cut, peak) in cuts.iter_mut().zip(&peaks) {
                let there = self.excess(&movement, peak.derivative, peak.dof, peak.sample);
                cut.gradient.push((there - peak.excess) / STEP);
            }
        }
        Ok((cuts, largest))
    }

    /// Returns the extreme of the conditions of the DoFs that exceeds the limits of a rotation most, as a bound of its first DoF.
    ///
    /// # Errors
    /// A movement that overflows.
    pub(super) fn worst(&self, conditions: &Conditions) -> Result<Option<(Bound, Extreme)>> {
        let mut margins = Margins::default();
        compare(self.primitive, self.limits, &self.outside(conditions), &mut margins)?;
        let kinds = [(Derivative::Velocity, margins.velocity), (Derivative::Acceleration, margins.acceleration)];
        let extremes =
            kinds.into_iter().filter_map(|(derivative, extreme)| extreme.map(|extreme| (derivative, extreme)));
        let worst = extremes.max_by(|(_, a), (_, b)| a.ratio.total_cmp(&b.ratio));
        Ok(worst.map(|(derivative, extreme)| {
            let value = self.limit(derivative, extreme.dof);
            (Bound { derivative, dof: extreme.dof, side: 1.0, value, scale: value }, extreme)
        }))
    }

    /// Returns the conditions in coordinates for those of the DoFs.
    fn outside(&self, conditions: &Conditions) -> Conditions {
        let Some(coordinates) = self.primitive.coordinates() else { return conditions.clone() };
        let Conditions { velocity, goal_velocity, .. } = self.request.clone();
        Conditions { velocity, goal_velocity, ..coordinates.of_dofs(conditions.clone()) }
    }

    fn movement(&self, conditions: &Conditions) -> Result<Trajectory> {
        let conditions = self.outside(conditions);
        rollout_at(self.primitive, &conditions, times(self.primitive, &conditions)?)
    }

    fn limit(&self, derivative: Derivative, dof: usize) -> f64 {
        let limits = self.limits.of_rotation(dof);
        if derivative == Derivative::Velocity { limits.velocity } else { limits.acceleration }
    }

    /// Returns the size at a sample relative to the limit of the search, minus 1.
    fn excess(&self, movement: &Trajectory, derivative: Derivative, dof: usize, sample: usize) -> f64 {
        let rows = if derivative == Derivative::Velocity { &movement.velocity } else { &movement.acceleration };
        let own: ArrayView1<f64> = rows.slice(ndarray::s![sample, dof..dof + 3]);
        own.dot(&own).sqrt() / (self.limit(derivative, dof) * (1.0 - SEARCH_MARGIN)) - 1.0
    }

    fn peaks(&self, movement: &Trajectory, tolerance: f64) -> Vec<Peak> {
        let mut peaks = Vec::new();
        for dof in self.primitive.rotation_dofs() {
            for derivative in [Derivative::Velocity, Derivative::Acceleration] {
                let mut stretch: Option<Peak> = None;
                for sample in 0..movement.time.len() {
                    let excess = self.excess(movement, derivative, dof, sample);
                    if excess <= tolerance {
                        peaks.extend(stretch.take());
                    } else if stretch.as_ref().is_none_or(|peak| excess > peak.excess) {
                        stretch = Some(Peak { dof, derivative, sample, excess });
                    }
                }
                peaks.extend(stretch);
            }
        }
        peaks
    }
}
