//! Third derivative of a movement under constant conditions, from its first and second.
//!
//! With the motion c of the frame, additional displacement included, z = y′ − w − c′ and e′ = y′ − c′ turn z′ = −α_z(β_z e + z)
//! into
//!
//! ```text
//! y‴ = −α_z(y″ + β_z y′) + w″ + α_z w′ + c‴ + α_z c″ + α_zβ_z c′.
//! ```
//!
//! w″ is that of the cubics of the forcing table, and jumps at their knots, as c‴ does at the knots of the transport profile.
//! There y″ has a slope on either side. Knots coincide with the samples of the demonstrations by construction
//! (`learning::tabulation`), so that no side is preferred: the mean of both is returned, to which central differences converge.

use std::sync::Arc;

use ndarray::Array2;

use super::Controller;
use crate::dynamics::forcing_table::TableIndex;
use crate::dynamics::output_system::Attractor;
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::numerics::simd::{F64x4, WIDTH, unpack, unpad};
use crate::validate::{row_major, row_major_mut, zeros};

/// Distance of both sides of a clock from it, relative to the extent of the movement: more than the rounding error of the clock.
const SIDE: f64 = 1e-9;

/// Returns the third derivative (T, D) with respect to time of the movement under constant conditions in linear time, from
/// its velocities and accelerations (T, D) at intervals `dt`.
///
/// # Errors
/// Conditions that do not fit the primitive, or a derivative that does not fit into memory.
pub(in crate::motion) fn third_derivative(
    primitive: &Arc<Primitive>,
    conditions: &Conditions,
    dt: f64,
    [velocity, acceleration]: [&Array2<f64>; 2],
) -> Result<Array2<f64>> {
    // The terms other than those of the movement itself depend on the phase by the clock alone.
    let from = conditions.phase.unwrap_or(0.0);
    let controller = Controller::new(primitive, dt, &Conditions { phase: None, ..conditions.clone() }, Some(0.0))?;
    let (rate, side) = (1.0 / controller.conditions.tau, SIDE * primitive.canonical().extent());
    let Attractor { alpha_z, beta_z } = primitive.attractor();
    let [by_velocity, by_acceleration] = [alpha_z * beta_z * rate * rate, alpha_z * rate];
    let (half_cube, n_dofs) = (0.5 * rate * rate * rate, primitive.n_dofs());
    let mut third: Array2<f64> = zeros("jacobian", velocity.dim())?;
    let mut inputs = vec![0.0; n_dofs];
    let rows = row_major_mut(&mut third).chunks_mut(n_dofs);
    let slopes = row_major(velocity).chunks(n_dofs).zip(row_major(acceleration).chunks(n_dofs));
    for (k, (row, (velocity, acceleration))) in rows.zip(slopes).enumerate() {
        let u = from + k as f64 * dt * rate;
        controller.sum_inputs(controller.side(u - side), &controller.side(u + side), &mut inputs);
        for d in 0..n_dofs {
            row[d] = inputs[d] * half_cube - (by_velocity * velocity[d] + by_acceleration * acceleration[d]);
        }
    }
    Ok(third)
}

/// Terms of a clock that all DoFs have in common.
struct Side {
    u: f64,
    /// Position in the forcing table.
    index: TableIndex,
    /// Weights of the coefficients of the cubics there.
    weights: [f64; 4],
    /// ℓ‴ + α_zℓ″ + α_zβ_zℓ′ of the transport profile.
    transport: f64,
}

impl Controller {
    fn side(&self, u: f64) -> Side {
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let (index, [slope, mut weights]) = self.primitive.forcing_table().slope_weights(u);
        for i in 0..4 {
            weights[i] += alpha_z * slope[i];
        }
        let segment = self.primitive.transport.segment_at(u);
        let lag = segment.lag(u);
        let transport = segment.third() + alpha_z * (lag.bend + beta_z * lag.slope);
        Side { u, index, weights, transport }
    }

    /// Computes the sum of w″ + α_z w′ + c‴ + α_z c″ + α_zβ_z c′ (D,) over two clocks, with the style, amplitude and frame of
    /// the start.
    fn sum_inputs(&self, mut before: Side, after: &Side, inputs: &mut [f64]) {
        let table = self.primitive.forcing_table();
        let style = unpack(self.style.value(), self.primitive.n_styles());
        let is_one_cell = before.index.is_in_cell_of(after.index);
        if is_one_cell {
            for i in 0..4 {
                before.weights[i] += after.weights[i];
            }
        }
        let is_displaced = self.goal_transition.is_active() || self.conditions.forcing.is_some();
        for (index, inputs) in inputs.chunks_mut(WIDTH).enumerate() {
            let mut w = table.weighted(before.index, index, &before.weights, style);
            if !is_one_cell {
                w += table.weighted(after.index, index, &after.weights, style);
            }
            let mut sum = w * self.r + self.groups[index].displacement * (before.transport + after.transport);
            if is_displaced {
                sum += self.displacement_input(index, before.u) + self.displacement_input(index, after.u);
            }
            unpad(sum, inputs);
        }
    }

    /// Returns q‴ + α_z q″ + α_zβ_z q′ of a group, with the additional displacement.
    fn displacement_input(&self, index: usize, u: f64) -> F64x4 {
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let (transition, mut sum) = (&self.goal_transition, F64x4::ZERO);
        if transition.is_active() && u < transition.end() {
            let frame = transition.sample::<F64x4>(index, u);
            sum += transition.third(index, u) + (frame.bend + frame.slope * beta_z) * alpha_z;
        }
        if let Some(forcing) = &self.conditions.forcing {
            let frame = forcing.sample::<F64x4>(index, u);
            sum += forcing.third(index, u) + (frame.bend + frame.slope * beta_z) * alpha_z;
        }
        sum
    }
}
