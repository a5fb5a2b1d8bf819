//! Errors about rotations.

use super::ErrorKind;
use super::format::{Columns, Rounded};

/// Error about a rotation among the coordinates.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RotationError {
    /// A quaternion whose norm is not 1.
    #[error(
        "{name}[{}] has norm {}: a rotation is a unit quaternion, to within 1e-3; check the columns of rotations, or divide \
         each quaternion by its norm", Columns(*row, *column), Rounded(*norm)
    )]
    Norm {
        /// The argument.
        name: &'static str,
        /// Row of a matrix.
        row: Option<usize>,
        /// First of its four columns.
        column: usize,
        /// Its norm.
        norm: f64,
    },
    /// A residual rotation of about half a turn, which has no direction.
    #[error(
        "position[{sample}, {column}:{}]: the rotation is {degrees:.0} degrees from the mean of the demonstrations: they must \
         stay within half a turn of it; fit movements that turn the other way round as a model of their own", column + 4
    )]
    HalfTurn {
        /// Index of the sample.
        sample: usize,
        /// First of the four columns of the rotation.
        column: usize,
        /// Distance from the mean rotation, in degrees.
        degrees: f64,
    },
    /// A relative rotation of two arms that is about half a turn from its reference, where the midpoint is undefined.
    #[error(
        "{name}: the relative rotation of the arms is {degrees:.0} degrees from the reference, more than 175: the midpoint of \
         their orientations is undefined at half a turn; pass a reference near {relative:.3?}"
    )]
    OppositeArms {
        /// The argument.
        name: &'static str,
        /// Angle from the reference, in degrees.
        degrees: f64,
        /// The relative rotation, a unit quaternion w, x, y, z.
        relative: [f64; 4],
    },
}

impl RotationError {
    /// Returns the caller's next step.
    pub(super) fn next_step(&self) -> ErrorKind {
        match self {
            Self::Norm { row: None, .. } | Self::OppositeArms { .. } => ErrorKind::Argument,
            Self::Norm { .. } | Self::HalfTurn { .. } => ErrorKind::Data,
        }
    }

    /// Returns the argument at fault.
    pub(super) fn at_fault(&self) -> &str {
        match self {
            Self::Norm { name, .. } | Self::OppositeArms { name, .. } => name,
            Self::HalfTurn { .. } => "position",
        }
    }
}
