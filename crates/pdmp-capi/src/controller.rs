//! Controllers: made, commanded, stepped and read.

use std::mem::{MaybeUninit, align_of, size_of};
use std::ptr;

use pdmp_core::{Command, Controller};

use crate::buffers::{pdmp_memory, pdmp_text, pdmp_vector};
use crate::command::{pdmp_command, pdmp_conditions, pdmp_motion};
use crate::model::pdmp_model;
use crate::status::{Fault, answer, answer_in, pdmp_status};

use pdmp_status::PDMP_OK;

/// A running primitive: a model, its commands and its state. One thread at a time uses it.
pub struct pdmp_controller {
    inner: Controller,
    /// Why the last call that was refused was.
    fault: Option<Fault>,
    /// Whether its memory is the library's.
    owned: bool,
}

/// What a controller is made with.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_settings {
    /// Length of a tick, in seconds.
    pub dt: f64,
    /// Time to 99 % of a changed style, tau, goal or anchor, in seconds; 0 is the paper's immediate switch, and without
    /// it a tenth of the nominal duration (discrete) or a quarter of the nominal period (rhythmic) serves. A goal takes
    /// what remains of the movement if that is longer, unless transport is immediate.
    pub transition: *const f64,
    /// Where the controller is put, pdmp_controller_size bytes aligned to pdmp_controller_alignment; its vectors, whose
    /// lengths are the model's, are allocated even so.
    pub memory: pdmp_memory,
}

/// Bytes of a controller in memory of the caller's.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_size() -> usize {
    size_of::<pdmp_controller>()
}

/// Alignment of a controller in memory of the caller's, in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_alignment() -> usize {
    align_of::<pdmp_controller>()
}

/// Makes a controller and starts its movement; NULL conditions are those of the nominal demonstration. The controller
/// is NULL if it is refused. The model may be freed before it.
///
/// # Safety
/// What `settings` and `conditions` point to is valid, their memory is used by nothing else, and `error` has the room
/// that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_new(
    model: Option<&pdmp_model>,
    settings: Option<&pdmp_settings>,
    conditions: Option<&pdmp_conditions>,
    controller: Option<&mut MaybeUninit<*mut pdmp_controller>>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let place = controller.ok_or(Fault::Null("controller"))?.write(ptr::null_mut());
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let &pdmp_settings { dt, transition, memory } = settings.ok_or(Fault::Null("settings"))?;
        let given = place_in(memory)?;
        // SAFETY: NULL or valid.
        let transition = unsafe { transition.as_ref() }.copied();
        // SAFETY: the caller's promise is the same.
        let conditions = conditions.map(|conditions| unsafe { conditions.get(model) }).transpose()?.unwrap_or_default();
        let inner = Controller::new(model.primitive(), dt, &conditions, transition)?;
        // SAFETY: it comes from place_in, and the caller's promise is that nothing else uses it.
        *place = unsafe { put(inner, given) };
        Ok(PDMP_OK)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { answer_in(error, call) }
}

/// The caller's memory, if it is given, as the place of a controller.
fn place_in(memory: pdmp_memory) -> Result<Option<*mut pdmp_controller>, Fault> {
    let (needed, alignment) = (size_of::<pdmp_controller>(), align_of::<pdmp_controller>());
    let (address, size) = (memory.data.addr(), memory.size);
    match (address, size) {
        (0, 0) => Ok(None),
        (0, _) => Err(Fault::Null("memory")),
        _ if size < needed || address % alignment != 0 => Err(Fault::Memory { size, address, needed, alignment }),
        _ => Ok(Some(memory.data.cast())),
    }
}

/// Puts a controller into memory of the caller's, or allocates it.
///
/// # Safety
/// The memory comes from [`place_in`] and is used by nothing else.
unsafe fn put(inner: Controller, memory: Option<*mut pdmp_controller>) -> *mut pdmp_controller {
    let made = pdmp_controller { inner, fault: None, owned: memory.is_none() };
    match memory {
        // SAFETY: large enough and aligned, as place_in has seen, and used by nothing else.
        Some(memory) => unsafe {
            memory.write(made);
            memory
        },
        None => Box::into_raw(Box::new(made)),
    }
}

/// Makes a controller that goes on bit for bit as another would, to look ahead from where that is; it is made like the
/// other in memory of the caller's, or allocated. The copy is NULL if it is refused.
///
/// # Safety
/// `memory` is used by nothing else, and `error` has the room that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_clone(
    controller: Option<&pdmp_controller>,
    memory: pdmp_memory,
    copy: Option<&mut MaybeUninit<*mut pdmp_controller>>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let place = copy.ok_or(Fault::Null("copy"))?.write(ptr::null_mut());
        let inner = controller.ok_or(Fault::Null("controller"))?.inner.clone();
        let given = place_in(memory)?;
        // SAFETY: it comes from place_in, and the caller's promise is that nothing else uses it.
        *place = unsafe { put(inner, given) };
        Ok(PDMP_OK)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { answer_in(error, call) }
}

/// Frees a controller. Memory of the caller's is the caller's again. With NULL it does nothing.
///
/// # Safety
/// `controller` is NULL or was made by pdmp_controller_new, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_free(controller: *mut pdmp_controller) {
    // SAFETY: NULL or a controller.
    match unsafe { controller.as_ref() } {
        // SAFETY: it was boxed, and is not used again.
        Some(pdmp_controller { owned: true, .. }) => drop(unsafe { Box::from_raw(controller) }),
        // SAFETY: it is not used again.
        Some(_) => unsafe { controller.drop_in_place() },
        None => {}
    }
}

/// A call on a controller, which keeps the reason of a refusal.
fn on(
    controller: Option<&mut pdmp_controller>,
    call: impl FnOnce(&mut pdmp_controller) -> Result<pdmp_status, Fault>,
) -> pdmp_status {
    let Some(controller) = controller else { return pdmp_status::PDMP_NULL };
    let mut refused = None;
    let status = answer(|| call(controller), |fault| refused = Some(fault));
    if refused.is_some() {
        controller.fault = refused;
    }
    status
}

/// Starts again under other conditions; NULL are those of the nominal demonstration.
///
/// # Safety
/// What `conditions` points to is valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_reset(
    controller: Option<&mut pdmp_controller>,
    conditions: Option<&pdmp_conditions>,
) -> pdmp_status {
    on(controller, |controller| {
        let model = controller.inner.primitive();
        // SAFETY: the caller's promise is the same.
        let conditions = conditions.map(|conditions| unsafe { conditions.get(model) }).transpose()?.unwrap_or_default();
        controller.inner.reset(&conditions)?;
        Ok(PDMP_OK)
    })
}

/// Sets the style s (n_styles) to go to.
///
/// # Safety
/// `style` points to the numbers that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_style(
    controller: Option<&mut pdmp_controller>,
    style: pdmp_vector,
) -> pdmp_status {
    on(controller, |controller| {
        // SAFETY: the caller's promise is the same.
        let style = unsafe { style.need("style", controller.inner.primitive().n_styles(), "style dimension") }?;
        controller.inner.set_style(style)?;
        Ok(PDMP_OK)
    })
}

/// Sets the goal g (n_dofs) of a discrete movement.
///
/// # Safety
/// `goal` points to the numbers that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_goal(
    controller: Option<&mut pdmp_controller>,
    goal: pdmp_vector,
) -> pdmp_status {
    on(controller, |controller| {
        // SAFETY: the caller's promise is the same.
        let goal = unsafe { goal.need("goal", controller.inner.primitive().n_dofs(), "DoF") }?;
        controller.inner.set_goal(goal)?;
        Ok(PDMP_OK)
    })
}

/// Sets the anchor y_a (n_dofs) of a rhythmic movement.
///
/// # Safety
/// `anchor` points to the numbers that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_anchor(
    controller: Option<&mut pdmp_controller>,
    anchor: pdmp_vector,
) -> pdmp_status {
    on(controller, |controller| {
        // SAFETY: the caller's promise is the same.
        let anchor = unsafe { anchor.need("anchor", controller.inner.primitive().n_dofs(), "DoF") }?;
        controller.inner.set_anchor(anchor)?;
        Ok(PDMP_OK)
    })
}

/// Sets the time constant tau, in seconds; the rate 1/tau is what passes the filter.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_tau(controller: Option<&mut pdmp_controller>, tau: f64) -> pdmp_status {
    on(controller, |controller| Ok(controller.inner.set_tau(tau).map(|()| PDMP_OK)?))
}

/// Sets the amplitude r_0 of a rhythmic movement; r follows by Eq. (4).
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_amplitude(
    controller: Option<&mut pdmp_controller>,
    amplitude: f64,
) -> pdmp_status {
    on(controller, |controller| Ok(controller.inner.set_amplitude(amplitude).map(|()| PDMP_OK)?))
}

/// Sets the speed, the share of the rate 1/tau at which the path is followed: 0 pauses on the path, 1 goes on. A change
/// passes the filter of tau, and stays in force over pdmp_controller_reset.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_speed(controller: Option<&mut pdmp_controller>, speed: f64) -> pdmp_status {
    on(controller, |controller| Ok(controller.inner.set_speed(speed).map(|()| PDMP_OK)?))
}

/// Sets how much a measured position stops the phase, k_s, and pulls the movement, k_t per unit of the clock.
///
/// By default k_s = 1000, so that an error of a tenth of the range slows the phase elevenfold, and k_t = 10 over the
/// demonstrated stretch of the clock, T/tau or 2 pi; 0 is without.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_compliance(
    controller: Option<&mut pdmp_controller>,
    stopping: f64,
    tracking: f64,
) -> pdmp_status {
    on(controller, |controller| Ok(controller.inner.set_compliance(stopping, tracking).map(|()| PDMP_OK)?))
}

/// Forgets the measured position: no robot follows any more, until the next one is measured.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_release(controller: Option<&mut pdmp_controller>) -> pdmp_status {
    on(controller, |controller| {
        controller.inner.release();
        Ok(PDMP_OK)
    })
}

/// One tick with nothing new commanded. Answers whether the movement goes on.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_step(controller: Option<&mut pdmp_controller>) -> pdmp_status {
    on(controller, |controller| Ok(controller.inner.step()?.into()))
}

/// One tick under a command, with the motion written where the caller wants it; NULL is nothing told, or not wanted.
/// Answers whether the movement goes on.
///
/// What is refused is refused as a whole: no part of the command takes effect, and no time passes. A perturbation is
/// held over the tick:
///
///     tau y' = z + w(u) + k_t d + tau c_v
///     tau z' = alpha_z (beta_z (g - y) - z) + tau^2 c_a
///     tau u' = k = 1 / (1 + k_s |d / range|^2)
///     tau o' = 5 k (e - o) / extent
///
/// with the coupling terms c_v and c_a, and d, what of the error e = m - y at the measured position m lies beyond the
/// error o that is expected by now. The last e stays in force until the next measurement or pdmp_controller_release.
///
/// # Safety
/// What `command` and `motion` point to is valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_update(
    controller: Option<&mut pdmp_controller>,
    command: Option<&pdmp_command>,
    motion: Option<&pdmp_motion>,
) -> pdmp_status {
    on(controller, |controller| {
        let inner = &mut controller.inner;
        motion.map_or(Ok(()), |motion| motion.check(inner.primitive().n_dofs()))?;
        // SAFETY: the caller's promise is the same.
        let command = command.map_or(Ok(Command::default()), |command| unsafe { command.get(inner.primitive()) })?;
        let status = inner.step_with(&command)?;
        if let Some(motion) = motion {
            // SAFETY: the caller's promise is the same, and the room was checked. The command, whose vectors may overlap
            // with these, has been read.
            unsafe { motion.put(inner) };
        }
        Ok(status.into())
    })
}

/// Reads the motion as it is now. Answers whether it goes on.
///
/// # Safety
/// What `motion` points to is valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_read(
    controller: Option<&mut pdmp_controller>,
    motion: Option<&pdmp_motion>,
) -> pdmp_status {
    on(controller, |controller| {
        let motion = motion.ok_or(Fault::Null("motion"))?;
        motion.check(controller.inner.primitive().n_dofs())?;
        // SAFETY: the caller's promise is the same, and the room was checked.
        unsafe { motion.put(&controller.inner) };
        Ok(controller.inner.status().into())
    })
}

/// Tells the seconds since the start, and the phase: x in (0, 1] where discrete, phi in [0, 2 pi) where rhythmic; NULL
/// is not wanted. Answers whether the movement goes on.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_progress(
    controller: Option<&pdmp_controller>,
    time: Option<&mut MaybeUninit<f64>>,
    phase: Option<&mut MaybeUninit<f64>>,
) -> pdmp_status {
    let Some(pdmp_controller { inner, .. }) = controller else { return pdmp_status::PDMP_NULL };
    time.map(|time| time.write(inner.time()));
    phase.map(|phase| phase.write(inner.phase()));
    inner.status().into()
}

/// Tells why the last call that this controller refused was refused, and returns the length of that text without its
/// closing zero. There is none, of length 0, before the first.
///
/// # Safety
/// `text` has the room that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_error(controller: Option<&pdmp_controller>, text: pdmp_text) -> usize {
    match controller.and_then(|controller| controller.fault.as_ref()) {
        // SAFETY: the caller's promise is the same.
        Some(fault) => unsafe { text.put(fault) },
        // SAFETY: the caller's promise is the same.
        None => unsafe { text.put(&"") },
    }
}
