//! Bounds of the substeps of a tick.

use crate::model::primitive::Primitive;

/// Maximum clock step of a substep, relative to the extent of the movement.
const MAX_CLOCK_STEP: f64 = 1.0 / 500.0;
/// Maximum number of substeps of a tick. A tick that needs more is still stable, but less accurate.
pub(in crate::motion) const MAX_SUBSTEPS: f64 = 1000.0;
/// Relative rounding error of a substep that ends at u_end.
pub(in crate::motion) const ROUNDING: f64 = 1e-9;

/// Returns the maximum clock step of a substep. The margin keeps a tick of exactly this length in one step.
pub(in crate::motion) fn max_clock_step(primitive: &Primitive) -> f64 {
    MAX_CLOCK_STEP * primitive.canonical().extent() * (1.0 + 1e-9)
}
