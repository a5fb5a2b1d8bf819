//! What a call answers, and why it refuses.

use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pdmp_core::{Error, Status};

use crate::buffers::pdmp_text;

/// What a call came to; below zero it was refused.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum pdmp_status {
    /// Done.
    PDMP_OK = 0,
    /// The movement goes on; a rhythmic one always does.
    PDMP_WORKING = 1,
    /// The demonstrated time is over, and position and velocity have settled on the goal.
    PDMP_FINISHED = 2,
    /// NULL where a pointer is needed.
    PDMP_NULL = -1,
    /// A wrong length.
    PDMP_LENGTH = -2,
    /// A number that is not finite, or outside its range.
    PDMP_RANGE = -3,
    /// What this model does not have: an anchor if it moves to a goal, or contexts if it was learnt without.
    PDMP_ABSENT = -4,
    /// A file that cannot be read.
    PDMP_IO = -5,
    /// A model file that is damaged, foreign or of another version.
    PDMP_FILE = -6,
    /// Memory that is too small or not aligned.
    PDMP_MEMORY = -7,
    /// A defect of this library. A controller that answers so must be reset or freed.
    PDMP_INTERNAL = -8,
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

/// Why a call is refused. Its text is made when it is asked for: what can arise in a loop holds nothing that allocates.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    #[error("{0} is NULL")]
    Null(&'static str),
    #[error("memory has {size} bytes at {address:#x}: a controller takes {needed}, aligned to {alignment}")]
    Memory { size: usize, address: usize, needed: usize, alignment: usize },
    #[error(transparent)]
    Core(#[from] Error),
    #[error("a defect of this library: please report it")]
    Internal,
}

impl Fault {
    fn status(&self) -> pdmp_status {
        match self {
            Fault::Null(_) => PDMP_NULL,
            Fault::Memory { .. } => PDMP_MEMORY,
            Fault::Internal => PDMP_INTERNAL,
            Fault::Core(error) => match error {
                Error::Length { .. } => PDMP_LENGTH,
                Error::Kind { .. } | Error::Arguments(_) => PDMP_ABSENT,
                Error::Io { .. } => PDMP_IO,
                Error::File(_) => PDMP_FILE,
                _ => PDMP_RANGE,
            },
        }
    }
}

/// Makes a call, and hands the reason to `tell` if it refuses. A panic ends here, as an answer.
pub(crate) fn answer(call: impl FnOnce() -> Result<pdmp_status, Fault>, tell: impl FnOnce(Fault)) -> pdmp_status {
    let result = catch_unwind(AssertUnwindSafe(call)).unwrap_or(Err(Fault::Internal));
    result.unwrap_or_else(|fault| {
        let status = fault.status();
        tell(fault);
        status
    })
}

/// Makes a call, and writes the reason into `error` if it refuses.
///
/// # Safety
/// `error` has the room that it tells.
pub(crate) unsafe fn answer_in(error: pdmp_text, call: impl FnOnce() -> Result<pdmp_status, Fault>) -> pdmp_status {
    answer(call, |fault| {
        // SAFETY: the caller's promise is the same.
        unsafe { error.put(&fault) };
    })
}

/// Version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_status() {
        let mut told = None;
        let status = answer(|| panic!("a test"), |fault| told = Some(fault));
        assert_eq!(status, PDMP_INTERNAL);
        assert!(matches!(told, Some(Fault::Internal)));
    }
}
