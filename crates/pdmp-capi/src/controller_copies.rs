//! Copies of a controller, for example to simulate the movement ahead.

use std::mem::MaybeUninit;
use std::ptr;

use crate::buffers::{pdmp_memory, pdmp_text};
use crate::controller::{aligned, call_on, emplace, pdmp_controller};
use crate::fault::Fault;
use crate::guard::guard_with_text;
use crate::status::pdmp_status;

use pdmp_status::PDMP_OK;

/// Copies a controller with its state, for example to simulate the movement ahead. Under the same commands, copy and
/// original move identically to the bit.
///
/// `memory` is memory for the copy as in pdmp_settings.memory, or `{NULL, 0}`. `*copy` is set to the new controller,
/// which the caller frees with pdmp_controller_free, or to NULL on error.
///
/// Errors: PDMP_NULL, PDMP_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_clone(
    controller: Option<&pdmp_controller>,
    memory: pdmp_memory,
    copy: Option<&mut MaybeUninit<*mut pdmp_controller>>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let handle = copy.ok_or(Fault::Null("copy"))?.write(ptr::null_mut());
        let inner = controller.ok_or(Fault::Null("controller"))?.inner.clone();
        let memory = aligned(memory)?;
        // SAFETY: `aligned` has checked the memory, and the contract of the C ABI guarantees that nothing else uses it.
        *handle = unsafe { emplace(inner, memory) };
        Ok(PDMP_OK)
    };
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { guard_with_text(error, call) }
}

/// Copies the state of a controller into an earlier copy of it, without allocation, so that a control loop can look ahead:
/// the copy is then advanced by pdmp_controller_step, or by pdmp_controller_update with ticks of any length.
///
/// `copy` becomes as by pdmp_controller_clone in its own memory; its error message remains. It allocates only if `copy` is
/// of another model, or if `controller` was reset with a start or a velocity since `copy` was made without one.
///
/// Errors: PDMP_NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_copy(
    controller: *const pdmp_controller,
    copy: *mut pdmp_controller,
) -> pdmp_status {
    if ptr::eq(controller, copy) && !copy.is_null() {
        return PDMP_OK;
    }
    // SAFETY: the contract of the C ABI guarantees NULL or live controllers, and these are two.
    let (controller, copy) = unsafe { (controller.as_ref(), copy.as_mut()) };
    call_on(copy, |copy| {
        copy.inner.clone_from(&controller.ok_or(Fault::Null("controller"))?.inner);
        Ok(PDMP_OK)
    })
}
