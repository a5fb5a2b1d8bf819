//! Input and output of a tick of many movements, in memory of the caller.

use ndarray::ArrayView2;

use crate::error::{Error, Result};
use crate::motion::command::Command;
use crate::validate::check_length;

/// Commands of one tick of B movements, each with one row for a movement; those of movements that the tick leaves out are
/// ignored. An absent one leaves its quantity unchanged, as in [`Command`].
///
/// ```
/// use ndarray::array;
/// use pdmp_core::motion::Commands;
///
/// let (goals, taus) = (array![[0.4, 0.1], [0.5, 0.0]], [0.8, 1.2]);
/// let commands = Commands { goal: Some(goals.view()), tau: Some(&taus), ..Commands::default() };
/// assert!(commands.style.is_none());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Commands<'a> {
    /// Styles s (B, J).
    pub style: Option<ArrayView2<'a, f64>>,
    /// Goals g (B, D) of discrete movements.
    pub goal: Option<ArrayView2<'a, f64>>,
    /// Final velocities (B, D) of discrete movements, per second.
    pub goal_velocity: Option<ArrayView2<'a, f64>>,
    /// Anchors y_a (B, D) of rhythmic movements.
    pub anchor: Option<ArrayView2<'a, f64>>,
    /// Time constants τ (B,), in seconds.
    pub tau: Option<&'a [f64]>,
    /// Amplitudes r₀ (B,) of rhythmic movements.
    pub amplitude: Option<&'a [f64]>,
    /// Speeds (B,), factors of the rates 1/τ, as in [`crate::Controller::set_speed`].
    pub speed: Option<&'a [f64]>,
    /// Measured positions ỹ (B, D).
    pub measured: Option<ArrayView2<'a, f64>>,
    /// Measured phases φ* (B,) of rhythmic movements, in rad.
    pub phase: Option<&'a [f64]>,
}

/// Output of a tick of B movements, by rows in memory of the caller. Rows of movements that the tick leaves out keep their
/// values.
#[derive(Debug)]
pub struct Motions<'a> {
    /// Positions (B·D,) or (B·nq,) in coordinates.
    pub position: &'a mut [f64],
    /// Velocities (B·D,), per second.
    pub velocity: &'a mut [f64],
    /// Accelerations (B·D,), per second squared.
    pub acceleration: &'a mut [f64],
}

impl<'a> Commands<'a> {
    /// Checks that there is one row for each of `n` movements, consecutive in memory; [`Command::check`] checks their numbers.
    pub(super) fn check(&self, n: usize) -> Result<()> {
        let Self { style, goal, goal_velocity, anchor, tau, amplitude, speed, measured, phase } = self;
        for (name, rows) in [
            ("style", style),
            ("goal", goal),
            ("goal_velocity", goal_velocity),
            ("anchor", anchor),
            ("measured", measured),
        ] {
            if let Some(rows) = rows {
                let found = rows.nrows();
                if found != n {
                    return Err(Error::Rows { name, expected: n, found });
                }
                if rows.as_slice().is_none() {
                    return Err(Error::Argument { name, problem: "must be contiguous, by rows" });
                }
            }
        }
        for (name, numbers) in [("tau", tau), ("amplitude", amplitude), ("speed", speed), ("phase", phase)] {
            if let Some(numbers) = numbers {
                check_length(name, numbers.len(), n, "movement")?;
            }
        }
        Ok(())
    }

    /// Returns the command of one movement.
    pub(super) fn of(&self, b: usize) -> Command<'a> {
        let row = |rows: &Option<ArrayView2<'a, f64>>| {
            rows.and_then(|rows| rows.to_slice().map(|numbers| &numbers[b * rows.ncols()..][..rows.ncols()]))
        };
        let number = |numbers: &Option<&[f64]>| numbers.map(|numbers| numbers[b]);
        Command {
            style: row(&self.style),
            goal: row(&self.goal),
            goal_velocity: row(&self.goal_velocity),
            anchor: row(&self.anchor),
            tau: number(&self.tau),
            amplitude: number(&self.amplitude),
            measured: row(&self.measured),
            phase: number(&self.phase),
            ..Command::default()
        }
    }
}
