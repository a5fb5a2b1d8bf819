//! Gain per cycle: the angle of a wheel or a crank, or the position of a walker.

use std::f64::consts::TAU;

use ndarray::{Array1, Array2};

use crate::demonstration::turn_of;
use crate::numerics::statistics::extremes;

/// Maximum deviation of the gain of an angle from whole turns, in turns: cycle onsets are accurate to about a percent.
const ANGLE_TOLERANCE: f64 = 0.05;
/// Maximum deviation of the gain of a number without a unit from one turn, in turns, for it to count as an angle.
const UNKNOWN_TOLERANCE: f64 = 0.01;
/// Minimum gain that is reported, relative to the range of the closed cycle: joint angles in walking and running stay below
/// 0.9.
const MIN_REPORTED: f64 = 1.0;
/// Gain relative to the magnitude of the values below which it is rounding.
const ROUNDING: f64 = 1e-9;

/// Gain of a degree of freedom per cycle, which its closed cycles lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Index of the recording.
    pub recording: usize,
    /// Index of the degree of freedom.
    pub dof: usize,
    /// Gain per cycle, the median by magnitude, in the unit of the degree of freedom.
    pub gain: f64,
    /// Full turns per cycle that were subtracted from each cycle and all later ones; 0 unless it is an angle.
    pub turns: i32,
}

/// Returns the full turns in a gain per cycle, and the size of a turn in the unit; (0, 0) if there are none.
pub(super) fn turns(gain: f64, unit: &str) -> (i32, f64) {
    let known = turn_of(unit).map(|turn| (turn, ANGLE_TOLERANCE, f64::from(i32::MAX)));
    let guessed = [TAU, 360.0].into_iter().filter(|_| unit.is_empty()).map(|turn| (turn, UNKNOWN_TOLERANCE, 1.0));
    for (turn, tolerance, max_turns) in known.into_iter().chain(guessed) {
        let whole = (gain / turn).round();
        if whole != 0.0 && whole.abs() <= max_turns && (gain / turn - whole).abs() <= tolerance {
            return (whole as i32, turn);
        }
    }
    (0, 0.0)
}

/// Returns the gain of a degree of freedom per cycle, the median by magnitude.
pub(super) fn median_gain(gains: &[Array1<f64>], dof: usize) -> f64 {
    let mut gains: Vec<f64> = gains.iter().map(|gain| gain[dof]).collect();
    gains.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    gains.get(gains.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
}

/// Returns whether a gain exceeds the movement of a degree of freedom within every closed cycle (C, D), and rounding.
pub(super) fn exceeds_movement(gain: f64, cycles: &[Array2<f64>], dof: usize) -> bool {
    let threshold = |cycle: &Array2<f64>| {
        let [low, high] = extremes(cycle.column(dof).iter().copied());
        f64::max(MIN_REPORTED * (high - low), ROUNDING * high.abs().max(low.abs()))
    };
    gain.abs() > cycles.iter().map(threshold).fold(0.0, f64::max)
}
