//! Movements of a batch that have a timing of their own, each computed by a rollout.

use std::sync::Arc;

use ndarray::{ArrayView2, ArrayViewMut3, Axis};

use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::rollout::{TimeGrid, rollout};

/// Movements without common response curves, which differ in τ, follow warped time or start at another phase.
#[derive(Clone, Debug)]
pub(super) struct Singles {
    primitive: Arc<Primitive>,
    conditions: Vec<Conditions>,
    grid: TimeGrid,
}

impl Singles {
    /// Checks the movements. Without a duration in the grid, all have that of the longest.
    pub(super) fn new(primitive: &Arc<Primitive>, conditions: Vec<Conditions>, grid: TimeGrid) -> Result<Self> {
        let mut longest = 0.0f64;
        for one in &conditions {
            one.complete(primitive)?;
            longest = longest.max(primitive.duration() * one.time_constant(primitive)? / primitive.tau);
        }
        let grid = TimeGrid { duration: grid.duration.or(Some(longest)), ..grid };
        Ok(Self { primitive: Arc::clone(primitive), conditions, grid })
    }

    /// Returns the number of samples.
    pub(super) fn n_samples(&self) -> Result<usize> {
        Ok(self.grid.steps(&self.primitive, self.primitive.tau)? + 1)
    }

    /// Writes the movements from `first` on.
    pub(super) fn write(&self, first: usize, outputs: &mut [ArrayViewMut3<f64>]) -> Result<()> {
        let n = outputs.first().map_or(0, |output| output.len_of(Axis(0)));
        for (b, conditions) in self.conditions[first..first + n].iter().enumerate() {
            let movement = rollout(&self.primitive, conditions, self.grid)?;
            let orders: [ArrayView2<f64>; 3] =
                [movement.position.view(), movement.velocity.view(), movement.acceleration.view()];
            for (output, order) in outputs.iter_mut().zip(orders) {
                output.index_axis_mut(Axis(0), b).assign(&order);
            }
        }
        Ok(())
    }
}
