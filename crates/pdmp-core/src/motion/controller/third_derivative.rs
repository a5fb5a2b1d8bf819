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
use crate::dynamics::output_system::Attractor;
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::numerics::simd::{F64x4, WIDTH, unpack, unpad};
use crate::validate::zeros;

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
    for (k, mut row) in third.rows_mut().into_iter().enumerate() {
        let u = from + k as f64 * dt * rate;
        for (index, inputs) in inputs.chunks_mut(WIDTH).enumerate() {
            unpad(controller.input(index, u - side) + controller.input(index, u + side), inputs);
        }
        for (d, third) in row.iter_mut().enumerate() {
            let own = by_velocity * velocity[[k, d]] + by_acceleration * acceleration[[k, d]];
            *third = inputs[d] * half_cube - own;
        }
    }
    Ok(third)
}

impl Controller {
    /// Returns w″ + α_z w′ + c‴ + α_z c″ + α_zβ_z c′ of a group at clock `u`, with the style, amplitude and frame of the start.
    fn input(&self, index: usize, u: f64) -> F64x4 {
        let (primitive, transition) = (&self.primitive, &self.goal_transition);
        let Attractor { alpha_z, beta_z } = primitive.attractor();
        let w = primitive.forcing_table().slopes(u, index, unpack(self.style.value(), primitive.n_styles()));
        let (segment, stiffness) = (primitive.transport.segment_at(u), alpha_z * beta_z);
        let lag = segment.lag(u);
        let transport = segment.third() + alpha_z * lag.bend + stiffness * lag.slope;
        let mut input = (w.slope + w.value * alpha_z) * self.r + self.groups[index].displacement * transport;
        if transition.is_active() && u < transition.end() {
            let frame = transition.sample::<F64x4>(index, u);
            input += transition.third(index, u) + frame.bend * alpha_z + frame.slope * stiffness;
        }
        if let Some(forcing) = &self.conditions.forcing {
            let frame = forcing.sample::<F64x4>(index, u);
            input += forcing.third(index, u) + frame.bend * alpha_z + frame.slope * stiffness;
        }
        input
    }
}
