//! Detection of gains whose transients the samples do not resolve.
//!
//! The target of a discrete movement cancels a transient of rate α_z/2 that follows the start. Where α_z times the
//! sampling interval is not small, an interpolant of the sampled target cancels it incompletely, and the remaining
//! transient has accelerations that were not demonstrated.

use std::sync::Arc;

use ndarray::Array2;

use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::model::finding::Finding;
use crate::model::primitive::Primitive;
use crate::motion::rollout::{TimeGrid, rollout};

/// Largest accepted ratio of reproduced to demonstrated acceleration.
const MAX_RATIO: f64 = 3.0;

/// Largest α_z times the sampling interval on the clock that is resolved without a check; the defaults have 25/150. For a
/// reach of 201 samples, accelerations are as demonstrated at 0.12, 19 times as large at 0.5, 230 times at 1 and
/// 18 000 times at 4.
const RESOLVED: f64 = 0.17;

/// Compares the accelerations of the nominal demonstration, sampled by `sample`, with those of its reproduction, and returns
/// the worst DoF.
pub(super) fn stiffness(
    primitive: &Arc<Primitive>,
    (demo, n_samples): (usize, usize),
    sample: impl FnOnce(&mut [f64]),
) -> Result<Option<Finding>> {
    let (kind, n_dofs) = (primitive.kind(), primitive.n_dofs());
    // A cycle has no start, and its steady state no transient.
    let step = primitive.canonical().extent() / kind.steps(n_samples) as f64;
    if kind == Kind::Rhythmic || primitive.attractor().alpha_z * step <= RESOLVED {
        return Ok(None);
    }
    let mut position = Array2::zeros((n_samples, n_dofs));
    sample(crate::validate::row_major_mut(&mut position));
    let dt = primitive.duration() / kind.steps(n_samples) as f64;
    let reproduced = rollout(primitive, &Conditions::default(), TimeGrid { dt, duration: None })?.acceleration;
    let mut worst = None;
    let mut largest_ratio = MAX_RATIO;
    for (d, name) in primitive.names().iter().enumerate() {
        let column = position.column(d);
        let acceleration = |c: usize| ((column[c + 1] - column[c]) - (column[c] - column[c - 1])).abs() / (dt * dt);
        let demonstrated = (1..n_samples - 1).map(acceleration).fold(0.0, f64::max);
        let largest = reproduced.column(d).iter().fold(0.0f64, |most, a| most.max(a.abs()));
        if largest > largest_ratio * demonstrated && demonstrated > 0.0 {
            largest_ratio = largest / demonstrated;
            let (alpha_z, dof) = (primitive.attractor().alpha_z, name.clone());
            worst = Some(Finding::Stiff { alpha_z, dof, demo, reproduced: largest, shown: demonstrated, n_samples });
        }
    }
    Ok(worst)
}
