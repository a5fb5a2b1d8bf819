//! Sampling of whole movements such that their acceleration is smooth between samples.

use std::sync::Arc;

use super::extremes::Movement;
use crate::dynamics::canonical::Canonical;
use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::{Conditions, check_phase};
use crate::model::primitive::Primitive;
use crate::motion::rollout::rollout_at;

/// Minimum number of cells of the demonstrated duration or period.
const MIN_CELLS: usize = 2000;
/// Distance of the samples on both sides of a jump of the acceleration, relative to the duration.
const GAP: f64 = 1e-11;
/// Distance from such a jump within which there are no knots, relative to the duration.
const MIN_DISTANCE: f64 = 1e-6;
/// Decay to which a discrete movement is followed past its end, and a rhythmic one from its start to its cycle.
const DECAY: f64 = 1e-9;
/// Maximum time of this decay, relative to the duration.
const MAX_SETTLING: f64 = 20.0;
/// Number of cells past the end.
const SETTLING_CELLS: usize = 500;

/// Computes the whole movement: a discrete one from its start until it rests past its end, a rhythmic one over a period, and
/// from a given start over the periods until it has reached its cycle.
///
/// # Errors
/// Conditions that do not fit the primitive.
pub(super) fn sampled(primitive: &Arc<Primitive>, conditions: &Conditions) -> Result<Movement> {
    Ok(rollout_at(primitive, conditions, times(primitive, conditions)?)?.into())
}

/// Returns the times of the samples, in seconds.
pub(super) fn times(primitive: &Primitive, conditions: &Conditions) -> Result<Vec<f64>> {
    let duration = primitive.duration() * conditions.time_constant(primitive)? / primitive.tau();
    let segments = conditions.segment_durations.as_ref().filter(|segments| segments.len() > 1);
    let warp = segments.map(|segments| primitive.warping_function(segments)).transpose()?;
    let start = match (primitive.kind(), conditions.phase) {
        (Kind::Rhythmic, Some(phase)) => {
            check_phase(Kind::Rhythmic, phase)?;
            phase / primitive.canonical().extent() * duration
        }
        _ => 0.0,
    };
    let is_jump = |phase: f64| phase == 1.0 || warp.is_some() && primitive.breaks().contains(&phase);
    // The slowest rate per unit of the clock at which the output system forgets its state.
    let attractor = primitive.attractor();
    let slowest = 0.5 * attractor.alpha_z * (1.0 - (1.0 - 4.0 * attractor.beta_z / attractor.alpha_z).max(0.0).sqrt());
    let settling = |rate: f64| (-DECAY.ln() / (rate * primitive.canonical().extent())).min(MAX_SETTLING);
    let approaches =
        primitive.kind() == Kind::Rhythmic && (conditions.start.is_some() || conditions.velocity.is_some());
    let n_approaching = if approaches { settling(slowest).ceil() as usize } else { 0 };
    // A period from a phase on extends into the next one.
    let n_cycles = 1 + n_approaching + usize::from(start > 0.0);
    let phases = phases(primitive);
    let gap = GAP * duration;
    let mut times = Vec::with_capacity(n_cycles * phases.len() + SETTLING_CELLS);
    for cycle in 0..n_cycles {
        for phase in &phases {
            let share = warp.as_ref().map_or(*phase, |warp| warp.share(*phase));
            let time = (cycle as f64 + share) * duration;
            if is_jump(*phase) { times.extend([time - gap, time + gap]) } else { times.push(time) }
        }
    }
    if let Canonical::Discrete { alpha_x, .. } = primitive.canonical() {
        // The end brakes at half the rate κ, or fades with the phase.
        let fading = primitive.braking().map_or(alpha_x, |braking| 0.5 * braking);
        let length = duration * settling(slowest.min(fading));
        // Braking may be much faster than the attractor: cells grow with the time past the end.
        let share = |k: usize| (k as f64 / SETTLING_CELLS as f64).powi(2);
        times.extend((1..=SETTLING_CELLS).map(|k| duration + gap + length * share(k)));
    }
    let from_start = times.into_iter().map(|time| time - start).filter(|time| *time > gap);
    Ok(std::iter::once(0.0).chain(from_start).collect())
}

/// Returns the phases after 0 up to 1 of the samples: the knots of forcing table and transport, between which the acceleration is smooth, the breaks
/// between segments, and others between them.
fn phases(primitive: &Primitive) -> Vec<f64> {
    let breaks = primitive.breaks();
    let is_apart = |phase: &f64| breaks.iter().all(|at| (phase - at).abs() > MIN_DISTANCE);
    let uniform = |n: usize| (1..n).map(move |k| k as f64 / n as f64);
    let tables = [primitive.forcing_table().cells(), primitive.transport.n_cells()];
    let mut knots: Vec<f64> = tables.into_iter().flat_map(uniform).filter(is_apart).chain(breaks.to_vec()).collect();
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    let mut phases = Vec::with_capacity(knots.len().max(2 * MIN_CELLS));
    for ends in knots.windows(2) {
        let length = ends[1] - ends[0];
        let n = (length * MIN_CELLS as f64).ceil();
        phases.extend((1..n as usize).map(|k| ends[0] + length * k as f64 / n));
        phases.push(ends[1]);
    }
    phases
}
