//! Execution of a call behind the C boundary: panics are caught, and errors become a status and a message.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::buffers::pdmp_text;
use crate::fault::Fault;
use crate::status::pdmp_status;

/// Executes a call, and passes its error, if any, to `report`. A panic becomes [`Fault::Internal`].
pub(crate) fn guard(call: impl FnOnce() -> Result<pdmp_status, Fault>, report: impl FnOnce(Fault)) -> pdmp_status {
    let result = catch_unwind(AssertUnwindSafe(call)).unwrap_or(Err(Fault::Internal));
    result.unwrap_or_else(|fault| {
        let status = fault.status();
        report(fault);
        status
    })
}

/// Executes a call, and writes its error message, if any, to `error`.
///
/// # Safety
/// `error.data` is NULL or points to at least `error.size` writable bytes.
pub(crate) unsafe fn guard_with_text(
    error: pdmp_text,
    call: impl FnOnce() -> Result<pdmp_status, Fault>,
) -> pdmp_status {
    guard(call, |fault| {
        // SAFETY: the caller guarantees that `error.data` is NULL or has `error.size` writable bytes.
        unsafe { error.write(&fault) };
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_status() {
        let mut reported = None;
        let status = guard(|| panic!("a test"), |fault| reported = Some(fault));
        assert_eq!(status, pdmp_status::PDMP_INTERNAL);
        assert!(matches!(reported, Some(Fault::Internal)));
    }
}
