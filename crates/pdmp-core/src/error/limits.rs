//! Errors about limits of a robot.

use super::format::{Number, Rounded};

/// Error about the limits of one DoF.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// A lower limit of the position that is not below the upper one.
    #[error("limits of DoF {dof}: the lower limit {lower} must be below the upper limit {upper}")]
    Order {
        /// Index of the DoF.
        dof: usize,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A path that leaves the limits of the position.
    #[error(
        "limits of DoF {dof}: the path reaches {value:.6} at {:.1} % of its clock, outside {lower} to {upper}; change goal or \
         style, or let a controller with these limits bend the path",
        100.0 * phase
    )]
    LeftByPath {
        /// Index of the DoF.
        dof: usize,
        /// Its position.
        value: f64,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
        /// Fraction of the clock.
        phase: f64,
    },
    /// A start from which the limits cannot be kept.
    #[error(
        "velocity: the movement starts {ratio:.3} times too fast to keep its limits on the path; start slower, or let a \
         controller with these limits bend the path"
    )]
    StartTooFast {
        /// Rate at the start, relative to the largest admissible one.
        ratio: f64,
    },
    /// A limit of a rotation.
    #[error(
        "limits of DoF {dof}: a rotation has no limits; give infinity for its three DoFs, and limit angular velocities in the \
         driver of the robot"
    )]
    OfRotation {
        /// Index of the DoF.
        dof: usize,
    },
    /// A limit of the jerk without one of the acceleration.
    #[error(
        "limits of DoF {dof}: a jerk of {} needs a limit of the acceleration, which bounds the time of a reversal; give both",
        Number(*jerk)
    )]
    JerkAlone {
        /// Index of the DoF.
        dof: usize,
        /// Its limit of the jerk.
        jerk: f64,
    },
    /// Limits that no movement of the varied conditions keeps.
    #[error(
        "limits of DoF {dof}: no change of {varied} keeps them; at best the {quantity} reaches {} at {time:.3} s, beyond {}; {remedy}",
        Rounded(*value),
        Rounded(*limit)
    )]
    Infeasible {
        /// Index of the DoF.
        dof: usize,
        /// Conditions that were varied.
        varied: &'static str,
        /// Position, velocity or acceleration.
        quantity: &'static str,
        /// Its value where the movement with the smallest excess exceeds the limit most.
        value: f64,
        /// The limit.
        limit: f64,
        /// Time of that value, in seconds.
        time: f64,
        /// The remedy, as the end of the sentence.
        remedy: &'static str,
    },
}
