//! Kinds of errors and the arguments at fault.

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
    /// Returns the caller's next step; that of the inner error for one of several demonstrations or movements.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Demo { source, .. } => source.kind(),
            Self::Movement(error) => error.source.kind(),
            Self::Rotation(error) => error.next_step(),
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
            | Self::Still { .. }
            | Self::Samples { .. }
            | Self::Dofs { .. }
            | Self::Mixed { .. }
            | Self::Undescribed { .. }
            | Self::StyleSize { .. } => ErrorKind::Data,
            Self::NotFinite { .. }
            | Self::Length { .. }
            | Self::Name { .. }
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
            | Self::ContextNames { .. }
            | Self::NoNumber { .. }
            | Self::Kind { .. }
            | Self::Mismatch(_)
            | Self::Limits(_)
            | Self::Argument { .. }
            | Self::Conflict { .. } => ErrorKind::Argument,
        }
    }

    /// Returns the argument at fault, the first of two that exclude each other. `None` where no single argument is at
    /// fault: the recording as a whole, the numerical problem, the model file, the system or the caller.
    ///
    /// ```
    /// use pdmp_core::{Demonstration, Sampling};
    ///
    /// let error = Demonstration::new(ndarray::Array2::zeros((9, 0)), Sampling::Unknown).unwrap_err();
    /// assert_eq!(error.argument(), Some("position"));
    /// ```
    pub fn argument(&self) -> Option<&str> {
        match self {
            Self::Demo { source, .. } => source.argument(),
            Self::Movement(error) => error.source.argument(),
            Self::Mismatch(error) => Some(error.name),
            Self::NotFinite { name, .. }
            | Self::NotFiniteAt { name, .. }
            | Self::Length { name, .. }
            | Self::Name { name, .. }
            | Self::Rows { name, .. }
            | Self::Single { name }
            | Self::Range { name, .. }
            | Self::CutOff { name, .. }
            | Self::Magnitude { name, .. }
            | Self::TooLarge { name, .. }
            | Self::Kind { name, .. }
            | Self::Argument { name, .. }
            | Self::Conflict { names: [name, _], .. } => Some(name),
            Self::Rotation(error) => Some(error.at_fault()),
            Self::Time { .. } => Some("time"),
            Self::Landmark { .. } => Some("landmarks"),
            Self::Segments { .. } => Some("n_segments"),
            Self::Samples { .. } | Self::Dofs { .. } => Some("position"),
            Self::NoDemonstrations => Some("demos"),
            Self::Styles { .. } => Some("n_styles"),
            Self::Label { .. } | Self::NoNumber { .. } | Self::ContextNames { .. } => Some("context"),
            Self::Mixed { .. } => Some("contexts"),
            Self::Limits(_) => Some("limits"),
            Self::Gap { .. }
            | Self::WrapInGap { .. }
            | Self::Aperiodic { .. }
            | Self::Still { .. }
            | Self::Undescribed { .. }
            | Self::StyleSize { .. }
            | Self::Memory { .. }
            | Self::Fit(_)
            | Self::Interrupted
            | Self::File(_)
            | Self::Io { .. } => None,
        }
    }

    /// Names the demonstration in which this error arose.
    pub fn in_demo(self, demo: usize) -> Self {
        Error::Demo { demo, source: Box::new(self) }
    }
}
