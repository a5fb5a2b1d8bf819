//! Errors about limits of a robot.

use std::fmt;

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
    /// Different numbers of lower and upper limits of the position.
    #[error("limits: position has {} lower and {} upper limits: give one for each DoF, or one for all", lengths[0], lengths[1])]
    PositionLengths {
        /// Numbers of lower and upper limits.
        lengths: [usize; 2],
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
    /// A limit of the position or jerk of a rotation.
    #[error(
        "limits of DoF {dof}: a rotation has no limit of the {quantity}; give infinity for its three DoFs, and limit its angular \
         velocity and acceleration"
    )]
    OfRotation {
        /// Index of the DoF.
        dof: usize,
        /// Position or jerk.
        quantity: &'static str,
    },
    /// Limits of the three DoFs of a rotation that are not equal.
    #[error(
        "limits of DoF {dof}: a limit of {} for the {quantity}, of DoF {first} {}; both are DoFs of one rotation, and its limit bounds \
         the size of the angular {quantity}, which depends on no frame: give equal numbers",
        Number(*limit),
        Number(*expected)
    )]
    UnequalOfRotation {
        /// Index of the DoF.
        dof: usize,
        /// Index of the first DoF of the rotation.
        first: usize,
        /// Velocity or acceleration.
        quantity: &'static str,
        /// Its limit.
        limit: f64,
        /// That of the first DoF.
        expected: f64,
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
    /// Limits that no change of the varied conditions was found to keep.
    #[error(
        "limits of DoF {dof}: no change of {varied} was found that keeps them; at best the {quantity} reaches {} at {time:.3} s, beyond {}; {}",
        Rounded(*value),
        Rounded(*limit),
        Remedy { at_start: *time == 0.0, quantity, varies_all: *varies_all, slower: *slower }
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
        /// True if both style and goal, or anchor, were varied.
        varies_all: bool,
        /// Factor of its duration with which the unchanged movement keeps the limits, if that is known.
        slower: Option<f64>,
    },
}

/// Remedy for limits that no change of conditions keeps.
struct Remedy<'a> {
    at_start: bool,
    quantity: &'a str,
    varies_all: bool,
    slower: Option<f64>,
}

impl fmt::Display for Remedy<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("widen the limits")?;
        if !self.varies_all {
            f.write_str(", or vary both")?;
        }
        match (self.quantity, self.at_start, self.slower) {
            // Rounded up, so that the printed factor suffices.
            (_, _, Some(slower)) => {
                write!(f, ", or let the movement last {:.3} times as long (tau or segment_durations)", slower + 5e-4)
            }
            ("position", true, _) => f.write_str(", or start inside them"),
            ("position", false, _) => Ok(()),
            (_, true, _) => f.write_str(", or start with a lower velocity"),
            (_, false, _) => f.write_str(", or enlarge tau"),
        }
    }
}
