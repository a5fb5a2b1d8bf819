//! Movements of a batch that have a timing of their own, each computed by a rollout.

use std::sync::Arc;

use ndarray::{Array2, ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use crate::dynamics::canonical::turn;
use crate::error::Result;
use crate::model::Coordinates;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::controller::third_derivative::third_derivative;
use crate::motion::response_products::Product;
use crate::motion::rollout::{Clock, TimeGrid, rollout};
use crate::motion::transposed_rollout;
use crate::validate::row_major;

/// Movements without common response curves, which differ in τ, follow warped time or start at another phase.
#[derive(Clone, Debug)]
pub(super) struct Singles {
    primitive: Arc<Primitive>,
    conditions: Vec<Conditions>,
    /// Time constants τ.
    taus: Vec<f64>,
    grid: TimeGrid,
}

impl Singles {
    /// Checks the movements. Without a duration in the grid, all have that of the longest.
    pub(super) fn new(primitive: &Arc<Primitive>, conditions: Vec<Conditions>, grid: TimeGrid) -> Result<Self> {
        let (mut longest, mut taus) = (0.0f64, Vec::with_capacity(conditions.len()));
        for one in &conditions {
            one.complete(primitive)?;
            taus.push(one.time_constant(primitive)?);
            longest = longest.max(primitive.duration() * taus[taus.len() - 1] / primitive.tau);
        }
        let grid = TimeGrid { duration: grid.duration.or(Some(longest)), ..grid };
        Ok(Self { primitive: Arc::clone(primitive), conditions, taus, grid })
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

    /// Writes the motion of the DoFs of movement `b` up to an order, for a primitive with rotations.
    pub(super) fn write_dofs(&self, coordinates: &Coordinates, b: usize, dofs: &mut [Array2<f64>]) -> Result<()> {
        let [_, rate, _] = self.clock(b, 1)?[0];
        let conditions = coordinates.in_dofs_from(&self.conditions[b], rate)?;
        let movement = rollout(coordinates.dofs(), &conditions, self.grid)?;
        dofs.iter_mut()
            .zip([movement.position, movement.velocity, movement.acceleration])
            .for_each(|(to, from)| *to = from);
        Ok(())
    }

    /// Returns the clock u of movement `b` with u̇ and ü at the first `n` samples.
    pub(super) fn clock(&self, b: usize, n: usize) -> Result<Vec<[f64; 3]>> {
        let mut clock = Clock::of(&self.primitive, &self.conditions[b])?;
        let conditions = clock.conditions(&self.conditions[b]);
        let rate = 1.0 / conditions.time_constant(&self.primitive)?;
        let (start, mut seconds) = (conditions.phase.map_or(0.0, turn), 0.0);
        let at = |k: usize| {
            if k > 0 {
                let time = k as f64 * self.grid.dt;
                seconds = clock.tick(time).map_or(time, |tick| seconds + tick);
            }
            let [speed, change] = clock.speed();
            [start + rate * seconds, rate * speed, rate * change]
        };
        Ok((0..n).map(at).collect())
    }

    /// Returns τ of movement `b`, in seconds.
    pub(super) fn tau(&self, b: usize) -> f64 {
        self.taus[b]
    }

    /// Returns whether a movement follows segment durations.
    pub(super) fn is_warped(&self) -> bool {
        self.conditions.iter().any(|one| one.segment_durations.as_ref().is_some_and(|durations| durations.len() > 1))
    }

    /// Returns the products of the movements from `first` on with their cotangents (n, T, D).
    pub(super) fn products(&self, first: usize, cotangents: &[ArrayView3<f64>], by_tau: bool) -> Result<Vec<Product>> {
        let cotangents: Vec<_> = cotangents.iter().map(|array| array.as_standard_layout()).collect();
        let (n, n_samples, n_dofs) = cotangents[0].dim();
        let length = n_samples * n_dofs;
        let mut products = Vec::with_capacity(n);
        for (b, conditions) in self.conditions[first..first + n].iter().enumerate() {
            let rows: Vec<&[f64]> = cotangents.iter().map(|array| &row_major(array)[b * length..][..length]).collect();
            let mut product = transposed_rollout::products(&self.primitive, conditions, self.grid, &rows)?;
            if by_tau {
                let movement = rollout(&self.primitive, conditions, self.grid)?;
                let slopes = [&movement.velocity, &movement.acceleration];
                let third =
                    (rows.len() > 2).then(|| third_derivative(&self.primitive, conditions, self.grid.dt, slopes));
                let third = third.transpose()?;
                let orders = [&movement.position, slopes[0], slopes[1]].into_iter().chain(&third);
                product.scaled_time = scaled_time(&rows, orders.map(row_major), self.grid.dt, n_dofs);
            }
            products.push(product);
        }
        Ok(products)
    }
}

/// Returns Σₖ k⟨v⁽ᵏ⁾, y⁽ᵏ⁾⟩ + Σₖ⟨t·v⁽ᵏ⁾, y⁽ᵏ⁺¹⁾⟩ of a movement with its cotangents.
fn scaled_time<'a>(cotangents: &[&[f64]], mut orders: impl Iterator<Item = &'a [f64]>, dt: f64, n_dofs: usize) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    let (mut sum, mut order) = (0.0, orders.next().unwrap_or_default());
    for ((k, v), slopes) in cotangents.iter().enumerate().zip(orders) {
        if k > 0 {
            sum += k as f64 * dot(order, v);
        }
        order = slopes;
        let samples = v.chunks(n_dofs).zip(slopes.chunks(n_dofs)).enumerate();
        sum += samples.fold(0.0, |sum, (t, (v, slope))| sum + t as f64 * dt * dot(slope, v));
    }
    sum
}
