//! Errors of a call: those of the core, and those that arise at the C boundary.

use pdmp_core::Error;

use crate::status::pdmp_status::{self, *};

/// Reason for an error status. Its message is formatted on request: the errors of a control loop hold no heap memory.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    #[error("{0} is NULL")]
    Null(&'static str),
    #[error("memory has {size} bytes at {address:#x}: a controller needs {needed} bytes, aligned to {alignment}")]
    Memory { size: usize, address: usize, needed: usize, alignment: usize },
    #[error("the model has no contexts: fit it to demonstrations that carry a context")]
    NoContexts,
    #[error(transparent)]
    Core(#[from] Error),
    #[error("a bug in the library: please report it")]
    Internal,
}

impl Fault {
    pub(crate) fn status(&self) -> pdmp_status {
        match self {
            Fault::Null(_) => PDMP_NULL,
            Fault::Memory { .. } => PDMP_MEMORY,
            Fault::NoContexts => PDMP_ABSENT,
            Fault::Core(error) => error.into(),
            Fault::Internal => PDMP_INTERNAL,
        }
    }
}
