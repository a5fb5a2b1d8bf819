//! Largest angular velocities and accelerations of a movement.
//!
//! Between two samples the angular velocity is the cubic with values and derivatives of both ends, and the angular acceleration its
//! derivative, as for a DoF (`extremes`); of both the size counts.

use std::sync::Arc;

use ndarray::Array2;

use super::sampling::times;
use super::{Extreme, Margins};
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::angular::AngularLimits;
use crate::motion::limits::Limits;
use crate::motion::rollout::rollout_at;
use crate::motion::sampled_path::TurnDerivatives;
use crate::motion::trajectory::Trajectory;
use crate::numerics::rotation::{Vector, dot};

/// Share of a limit that a search keeps free at the samples, which may be exceeded between them.
#[cfg(feature = "learning")]
pub(super) const SEARCH_MARGIN: f64 = 1e-5;
/// Minimum length of a cell with extremes inside, relative to the duration, as for a DoF.
const MIN_LENGTH: f64 = 1e-7;
/// Maximum of s(1 − s)², the cubic of a slope at an end.
const SLOPE_EXCURSION: f64 = 4.0 / 27.0;
/// Number of parts of a cell in which the largest size is searched.
const N_PARTS: u32 = 8;
/// Number of thirds by which the search narrows the part: to 1e-5 of it, which changes a maximum by its square.
const N_NARROWINGS: u32 = 28;

/// Adds the angular velocities and accelerations of a movement to its margins; nothing without limits of rotations.
///
/// # Errors
/// Conditions that do not fit the primitive.
pub(super) fn compare(
    primitive: &Arc<Primitive>,
    limits: &Limits,
    conditions: &Conditions,
    margins: &mut Margins,
) -> Result<()> {
    if !limits.bound_rotations(primitive) {
        return Ok(());
    }
    let movement = rollout_at(primitive, conditions, times(primitive, conditions)?)?;
    for dof in primitive.rotation_dofs() {
        let AngularLimits { velocity, acceleration } = limits.of_rotation(dof);
        let [fastest, hardest] = largest(&movement, dof);
        for (extreme, (size, time), limit) in
            [(&mut margins.velocity, fastest, velocity), (&mut margins.acceleration, hardest, acceleration)]
        {
            let ratio = size / limit;
            if limit.is_finite() && extreme.is_none_or(|extreme| ratio > extreme.ratio) {
                *extreme = Some(Extreme { ratio, dof, time });
            }
        }
    }
    Ok(())
}

/// Returns the largest |ω| and |ω̇| of the rotation whose first DoF is given, and their times.
fn largest(movement: &Trajectory, dof: usize) -> [(f64, f64); 2] {
    let vector = |rows: &Array2<f64>, row: usize| -> Vector { std::array::from_fn(|i| rows[[row, dof + i]]) };
    let sample = |row: usize| TurnDerivatives {
        slope: vector(&movement.velocity, row),
        bend: vector(&movement.acceleration, row),
    };
    let size = |v: Vector| dot(v, v).sqrt();
    let time = &movement.time;
    let min_length = MIN_LENGTH * time[time.len() - 1];
    let mut largest = [(f64::NEG_INFINITY, 0.0); 2];
    let mut here = sample(0);
    for (cell, ends) in time.windows(2).enumerate() {
        let (next, length) = (sample(cell + 1), ends[1] - ends[0]);
        for (turn, time) in [(here, ends[0]), (next, ends[1])] {
            for (largest, vector) in largest.iter_mut().zip([turn.slope, turn.bend]) {
                if size(vector) > largest.0 {
                    *largest = (size(vector), time);
                }
            }
        }
        // Beyond its ends, a cubic exceeds its larger one by that of the slopes, and its derivative by a parabola.
        let bends = [here, next].map(|turn| size(turn.bend));
        let arc: Vector = std::array::from_fn(|i| {
            1.5 * (next.slope[i] - here.slope[i]) / length - 0.75 * (here.bend[i] + next.bend[i])
        });
        let slopes = [here, next].map(|turn| size(turn.slope));
        let bounds = [
            slopes[0].max(slopes[1]) + SLOPE_EXCURSION * length * (bends[0] + bends[1]),
            bends[0].max(bends[1]) + size(arc),
        ];
        for (kind, (largest, bound)) in largest.iter_mut().zip(bounds).enumerate() {
            if length < min_length || bound <= largest.0 {
                continue;
            }
            let at = |share: f64| {
                let TurnDerivatives { slope, bend } = here.between(&next, length, share);
                size(if kind == 0 { slope } else { bend })
            };
            let (most, share) = largest_within(at);
            if most > largest.0 {
                *largest = (most, ends[0] + share * length);
            }
        }
        here = next;
    }
    largest
}

/// Returns the largest number that a function reaches from 0 to 1, and its place.
fn largest_within(at: impl Fn(f64) -> f64) -> (f64, f64) {
    let part = f64::from(N_PARTS).recip();
    let sampled = (0..=N_PARTS).map(|i| f64::from(i) * part).map(|share| (at(share), share));
    let (_, best) = sampled.fold((f64::NEG_INFINITY, 0.0), |best, next| if next.0 > best.0 { next } else { best });
    let [mut low, mut high] = [(best - part).max(0.0), (best + part).min(1.0)];
    for _ in 0..N_NARROWINGS {
        let third = (high - low) / 3.0;
        if at(low + third) < at(high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    let share = 0.5 * (low + high);
    (at(share), share)
}
