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
    /// A matrix that is no rotation.
    #[error(
        "{name}[{index}]: the product of the transposed matrix and the matrix deviates from the identity by {}, more than 1e-3: a \
         rotation matrix has orthogonal columns of length 1; check the order of its nine numbers, and divide out scales",
        Rounded(*deviation)
    )]
    Matrix {
        /// The argument.
        name: &'static str,
        /// Index of the matrix.
        index: usize,
        /// Largest element of the deviation.
        deviation: f64,
    },
    /// An orthogonal matrix that mirrors.
    #[error(
        "{name}[{index}]: the determinant is -1: the matrix mirrors, which no rotation does; change the sign of one axis of a \
         left-handed frame first"
    )]
    Reflection {
        /// The argument.
        name: &'static str,
        /// Index of the matrix.
        index: usize,
    },
    /// A homogeneous transform with another last row than 0, 0, 0, 1.
    #[error(
        "transforms[{index}] has the last row {row:?}, expected [0.0, 0.0, 0.0, 1.0]: the position is the last column; transpose \
         transforms that are stored by columns"
    )]
    LastRow {
        /// Index of the transform.
        index: usize,
        /// Its last row.
        row: [f64; 4],
    },
    /// A turn about an axis without direction.
    #[error("axes[{index}] has norm {}: a turn by {angle} rad needs an axis; give one, or the angle 0", Rounded(*norm))]
    ZeroAxis {
        /// Index of the axis.
        index: usize,
        /// Its norm.
        norm: f64,
        /// The angle about it, in rad.
        angle: f64,
    },
}

impl RotationError {
    /// Returns the caller's next step.
    pub(super) fn next_step(&self) -> ErrorKind {
        match self {
            Self::Norm { row: None, .. } | Self::OppositeArms { .. } => ErrorKind::Argument,
            Self::Norm { .. }
            | Self::HalfTurn { .. }
            | Self::Matrix { .. }
            | Self::Reflection { .. }
            | Self::LastRow { .. }
            | Self::ZeroAxis { .. } => ErrorKind::Data,
        }
    }

    /// Returns the argument at fault.
    pub(super) fn at_fault(&self) -> &str {
        match self {
            Self::Norm { name, .. }
            | Self::OppositeArms { name, .. }
            | Self::Matrix { name, .. }
            | Self::Reflection { name, .. } => name,
            Self::HalfTurn { .. } => "position",
            Self::LastRow { .. } => "transforms",
            Self::ZeroAxis { .. } => "axes",
        }
    }
}
