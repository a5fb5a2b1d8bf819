//! What grows from cycle to cycle: the angle of a wheel or a crank, or the way of someone who walks.

use std::f64::consts::TAU;

use ndarray::{Array1, Array2};

/// A full turn in each unit of angle.
const TURNS: [(&str, f64); 3] = [("rad", TAU), ("deg", 360.0), ("°", 360.0)];
/// Share of a turn by which the growth of an angle may miss whole turns: bounds of cycles are found to about a percent,
const ANGLE: f64 = 0.05;
/// and by which the growth of a number without a unit may miss one turn and still count as an angle.
const NUMBER: f64 = 0.01;
/// Least gain that is reported, over the range of the closed cycle: joint angles of people who walk or run stay below 0.9.
const MIN_REPORTED: f64 = 1.0;
/// Share of the values below which a gain is rounding.
const ROUNDING: f64 = 1e-9;

/// What a degree of freedom gains in each cycle of a recording, which its closed cycles lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Index of the recording.
    pub recording: usize,
    /// Index of the degree of freedom.
    pub dof: usize,
    /// Gain in a cycle, the median one by size, in the unit of the degree of freedom.
    pub gain: f64,
    /// Full turns per cycle that were taken off each cycle and all that follow; 0 of what is no angle.
    pub turns: i32,
}

/// Full turns of an angle that gains so much per cycle, and how large each is; 0 where it does not turn.
pub(super) fn turns(gain: f64, unit: &str) -> (i32, f64) {
    let known = TURNS.iter().filter(|(angle, _)| *angle == unit).map(|(_, turn)| (*turn, ANGLE, f64::from(i32::MAX)));
    let guessed = TURNS[..2].iter().filter(|_| unit.is_empty()).map(|(_, turn)| (*turn, NUMBER, 1.0));
    for (turn, slack, most) in known.chain(guessed) {
        let whole = (gain / turn).round();
        if whole != 0.0 && whole.abs() <= most && (gain / turn - whole).abs() <= slack {
            return (whole as i32, turn);
        }
    }
    (0, 0.0)
}

/// The gain of a degree of freedom in a cycle, the median one by size.
pub(super) fn typical(gains: &[Array1<f64>], dof: usize) -> f64 {
    let mut gains: Vec<f64> = gains.iter().map(|gain| gain[dof]).collect();
    gains.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    gains.get(gains.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
}

/// Whether a gain surpasses all movement of a degree of freedom within closed cycles (C, D), and rounding.
pub(super) fn surpasses(gain: f64, cycles: &[Array2<f64>], dof: usize) -> bool {
    let bounds = |cycle: &Array2<f64>| {
        cycle.column(dof).iter().fold((f64::MAX, f64::MIN), |(low, high), y| (y.min(low), y.max(high)))
    };
    let at_least =
        |(low, high): (f64, f64)| f64::max(MIN_REPORTED * (high - low), ROUNDING * high.abs().max(low.abs()));
    gain.abs() > cycles.iter().map(bounds).map(at_least).fold(0.0, f64::max)
}
