//! Status codes and the version of the library.

use std::ffi::c_char;

use pdmp_core::{Error, ErrorKind, Status};

/// Status code that a call returns; negative values are errors.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum pdmp_status {
    /// Success.
    PDMP_OK = 0,
    /// Success; the movement is in progress. A rhythmic movement never finishes.
    PDMP_WORKING = 1,
    /// Success; the demonstrated duration has passed, and position and velocity have settled at the goal.
    PDMP_FINISHED = 2,
    /// A required pointer is NULL.
    PDMP_NULL = -1,
    /// An array has the wrong length, or a buffer is too short.
    PDMP_LENGTH = -2,
    /// A value is not finite, lies outside its range or contradicts another argument.
    PDMP_RANGE = -3,
    /// The model does not have this property: a discrete model has no anchor, a rhythmic one no goal, and a model that
    /// was fitted without contexts predicts nothing.
    PDMP_ABSENT = -4,
    /// A file cannot be opened or read.
    PDMP_IO = -5,
    /// A model file is damaged, of another format or of another format version.
    PDMP_FILE = -6,
    /// Memory cannot be allocated, or the caller's memory is too small or misaligned.
    PDMP_MEMORY = -7,
    /// A bug in the library. A controller that returns this code must be reset or freed.
    PDMP_INTERNAL = -8,
    /// A computation did not converge.
    PDMP_NUMERICAL = -9,
}

use pdmp_status::*;

impl From<Status> for pdmp_status {
    fn from(status: Status) -> Self {
        match status {
            Status::Working => PDMP_WORKING,
            Status::Finished => PDMP_FINISHED,
        }
    }
}

/// The kinds of errors are mapped without a wildcard arm: a new kind needs a decision here.
impl From<&Error> for pdmp_status {
    fn from(error: &Error) -> Self {
        match (error, error.kind()) {
            (Error::Demo { source, .. }, _) => Self::from(&**source),
            (
                Error::Length { .. }
                | Error::Rows { .. }
                | Error::Samples { .. }
                | Error::NoDemonstrations
                | Error::Dofs { .. },
                _,
            ) => PDMP_LENGTH,
            (Error::Kind { .. }, _) => PDMP_ABSENT,
            (_, ErrorKind::Argument | ErrorKind::Data) => PDMP_RANGE,
            (_, ErrorKind::Numerical) => PDMP_NUMERICAL,
            (_, ErrorKind::Memory) => PDMP_MEMORY,
            (_, ErrorKind::ModelFile) => PDMP_FILE,
            (_, ErrorKind::Io) => PDMP_IO,
            // No call of the C ABI has a callback that could interrupt it.
            (_, ErrorKind::Interrupted) => PDMP_INTERNAL,
        }
    }
}

/// Returns the version of the library as a static string, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
