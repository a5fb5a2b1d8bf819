//! Kinds of errors.

use super::Error;

/// The caller's next step after an [`Error`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// Pass another argument.
    Argument,
    /// Mend the recording, or choose another one.
    Data,
    /// Change the problem: it is well-formed, but has no numerical solution.
    Numerical,
    /// Reduce the amount, or provide more memory.
    Memory,
    /// Use another model file.
    ModelFile,
    /// Check the path, permissions and disk.
    Io,
    /// Nothing: the caller cancelled the call.
    Interrupted,
}

impl Error {
    /// Returns the caller's next step; that of the inner error for one of several demonstrations.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Demo { source, .. } => source.kind(),
            Self::Memory { .. } => ErrorKind::Memory,
            Self::Fit(_) => ErrorKind::Numerical,
            Self::File(_) => ErrorKind::ModelFile,
            Self::Io { .. } => ErrorKind::Io,
            Self::Interrupted => ErrorKind::Interrupted,
            Self::NotFiniteAt { .. }
            | Self::Magnitude { .. }
            | Self::Time { .. }
            | Self::Gap { .. }
            | Self::WrapInGap { .. }
            | Self::Aperiodic { .. }
            | Self::Samples { .. }
            | Self::Dofs { .. }
            | Self::Mixed { .. }
            | Self::Undescribed { .. }
            | Self::StyleSize { .. } => ErrorKind::Data,
            Self::NotFinite { .. }
            | Self::Length { .. }
            | Self::DofLabel { .. }
            | Self::Rows { .. }
            | Self::Single { .. }
            | Self::Range { .. }
            | Self::CutOff { .. }
            | Self::TooLarge { .. }
            | Self::Landmark { .. }
            | Self::Segments { .. }
            | Self::NoDemonstrations
            | Self::Styles { .. }
            | Self::Label { .. }
            | Self::NoNumber { .. }
            | Self::Kind { .. }
            | Self::Arguments(_) => ErrorKind::Argument,
        }
    }
}
