//! Controllers: creation, commands, ticks and outputs.

use std::mem::{MaybeUninit, align_of, size_of};
use std::ptr;

use pdmp_core::motion::{Compliance, Limits};
use pdmp_core::{Command, Controller};

use crate::buffers::{pdmp_memory, pdmp_text, pdmp_vector};
use crate::command::{pdmp_command, pdmp_conditions, pdmp_motion, per_coordinate};
use crate::fault::Fault;
use crate::guard::{guard, guard_with_text};
use crate::limits::memory_of_limits;
use crate::model::pdmp_model;
use crate::status::pdmp_status;

use pdmp_status::PDMP_OK;

/// Controller of one movement: a primitive, its commands and its state. One thread at a time may use it.
pub struct pdmp_controller {
    pub(crate) inner: Controller,
    /// Memory for the limits of a call.
    pub(crate) limits: Limits,
    /// Error of the last call that failed.
    fault: Option<Fault>,
    /// True if the library allocated the memory.
    owned: bool,
}

/// Settings of a controller.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_settings {
    /// Length of a tick, in seconds; positive.
    pub dt: f64,
    /// Time, in seconds, after which 99 % of a commanded change of style, tau, goal, anchor or amplitude has taken
    /// effect; 0 is the immediate switch of the paper. NULL for the default: a tenth of the nominal duration (discrete)
    /// or a quarter of the nominal period (rhythmic). Unless the transport of the model is immediate, a goal takes the
    /// remaining time of the movement instead, near and past its end the time that the attractor would take.
    pub transition: *const f64,
    /// Memory for the controller: pdmp_controller_size bytes, aligned to pdmp_controller_alignment, that nothing else
    /// uses until pdmp_controller_free. The arrays of the controller are allocated by the library in any case.
    pub memory: pdmp_memory,
}

/// Returns the size of a controller in bytes, for pdmp_settings.memory.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_size() -> usize {
    size_of::<pdmp_controller>()
}

/// Returns the alignment of a controller in bytes, for pdmp_settings.memory.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_alignment() -> usize {
    align_of::<pdmp_controller>()
}

/// Creates a controller and starts a movement. `conditions` may be NULL: those of the nominal demonstration.
///
/// `*controller` is set to the new controller, which the caller frees with pdmp_controller_free, or to NULL on error.
/// The model may be freed before the controller.
///
/// Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE, PDMP_MEMORY; PDMP_ABSENT if a condition does not apply to the kind of
/// model.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_new(
    model: Option<&pdmp_model>,
    settings: Option<&pdmp_settings>,
    conditions: Option<&pdmp_conditions>,
    controller: Option<&mut MaybeUninit<*mut pdmp_controller>>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let handle = controller.ok_or(Fault::Null("controller"))?.write(ptr::null_mut());
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let &pdmp_settings { dt, transition, memory } = settings.ok_or(Fault::Null("settings"))?;
        let memory = aligned(memory)?;
        // SAFETY: the contract of the C ABI guarantees that the pointer is NULL or valid.
        let transition = unsafe { transition.as_ref() }.copied();
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let conditions = conditions.map(|conditions| unsafe { conditions.get(model) }).transpose()?.unwrap_or_default();
        let inner = Controller::new(model.primitive(), dt, &conditions, transition)?;
        // SAFETY: `aligned` has checked the memory, and the contract of the C ABI guarantees that nothing else uses it.
        *handle = unsafe { emplace(inner, memory) };
        Ok(PDMP_OK)
    };
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { guard_with_text(error, call) }
}

/// Checks size and alignment of the caller's memory, and returns it, or `None` if it is not given.
pub(crate) fn aligned(memory: pdmp_memory) -> Result<Option<*mut pdmp_controller>, Fault> {
    let (needed, alignment) = (size_of::<pdmp_controller>(), align_of::<pdmp_controller>());
    let (address, size) = (memory.data.addr(), memory.size);
    match (address, size) {
        (0, 0) => Ok(None),
        (0, _) => Err(Fault::Null("memory")),
        _ if size < needed || address % alignment != 0 => Err(Fault::Memory { size, address, needed, alignment }),
        _ => Ok(Some(memory.data.cast())),
    }
}

/// Moves a controller to the caller's memory, or to the heap if there is none.
///
/// # Safety
/// The memory comes from [`aligned`], and nothing else uses it.
pub(crate) unsafe fn emplace(inner: Controller, memory: Option<*mut pdmp_controller>) -> *mut pdmp_controller {
    let limits = memory_of_limits(inner.primitive().n_dofs());
    let controller = pdmp_controller { inner, limits, fault: None, owned: memory.is_none() };
    match memory {
        // SAFETY: `aligned` has checked size and alignment, and the contract of this function excludes other users.
        Some(memory) => unsafe {
            memory.write(controller);
            memory
        },
        None => Box::into_raw(Box::new(controller)),
    }
}

/// Frees a controller; NULL is ignored. Memory that the caller provided may then be reused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_free(controller: *mut pdmp_controller) {
    // SAFETY: the contract of the C ABI guarantees NULL or a live controller.
    match unsafe { controller.as_ref() } {
        // SAFETY: `emplace` boxed this controller, and the caller does not use it again.
        Some(pdmp_controller { owned: true, .. }) => drop(unsafe { Box::from_raw(controller) }),
        // SAFETY: the controller lives in memory of the caller, who does not use it again.
        Some(_) => unsafe { controller.drop_in_place() },
        None => {}
    }
}

/// Executes a call on a controller, and stores its error, if any, in the controller.
pub(crate) fn call_on(
    controller: Option<&mut pdmp_controller>,
    call: impl FnOnce(&mut pdmp_controller) -> Result<pdmp_status, Fault>,
) -> pdmp_status {
    let Some(controller) = controller else { return pdmp_status::PDMP_NULL };
    let mut reported = None;
    let status = guard(|| call(controller), |fault| reported = Some(fault));
    if reported.is_some() {
        controller.fault = reported;
    }
    status
}

/// Starts a new movement. `conditions` may be NULL: those of the nominal demonstration. On error the present movement
/// continues unchanged.
///
/// This function allocates. Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_reset(
    controller: Option<&mut pdmp_controller>,
    conditions: Option<&pdmp_conditions>,
) -> pdmp_status {
    call_on(controller, |controller| {
        let model = controller.inner.primitive();
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let conditions = conditions.map(|conditions| unsafe { conditions.get(model) }).transpose()?.unwrap_or_default();
        controller.inner.reset(&conditions)?;
        Ok(PDMP_OK)
    })
}

/// Sets the style parameter s (n_styles). Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_style(
    controller: Option<&mut pdmp_controller>,
    style: pdmp_vector,
) -> pdmp_status {
    call_on(controller, |controller| {
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let style = unsafe { style.require("style", controller.inner.primitive().n_styles(), "style dimension") }?;
        controller.inner.set_style(style)?;
        Ok(PDMP_OK)
    })
}

/// Sets the goal g (n_coordinates) of a discrete movement, in the unit of each DoF. Errors: PDMP_NULL, PDMP_LENGTH,
/// PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_goal(
    controller: Option<&mut pdmp_controller>,
    goal: pdmp_vector,
) -> pdmp_status {
    call_on(controller, |controller| {
        let primitive = controller.inner.primitive();
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let goal = unsafe { goal.require("goal", primitive.n_coordinates(), per_coordinate(primitive)) }?;
        controller.inner.set_goal(goal)?;
        Ok(PDMP_OK)
    })
}

/// Sets the final velocity (n_dofs) with which a discrete movement passes its goal at the end, in the unit of each DoF per
/// second; `{NULL, 0}` for that of the demonstrations. Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_goal_velocity(
    controller: Option<&mut pdmp_controller>,
    velocity: pdmp_vector,
) -> pdmp_status {
    call_on(controller, |controller| {
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let velocity = unsafe { velocity.get("goal_velocity", controller.inner.primitive().n_dofs(), "DoF") }?;
        controller.inner.set_goal_velocity(velocity)?;
        Ok(PDMP_OK)
    })
}

/// Sets the anchor y_a (n_coordinates) of a rhythmic movement, in the unit of each DoF. Errors: PDMP_NULL, PDMP_LENGTH,
/// PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_set_anchor(
    controller: Option<&mut pdmp_controller>,
    anchor: pdmp_vector,
) -> pdmp_status {
    call_on(controller, |controller| {
        let primitive = controller.inner.primitive();
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let anchor = unsafe { anchor.require("anchor", primitive.n_coordinates(), per_coordinate(primitive)) }?;
        controller.inner.set_anchor(anchor)?;
        Ok(PDMP_OK)
    })
}

/// Sets the time constant tau > 0, in seconds. The rate 1/tau is filtered, over pdmp_settings.transition. Errors:
/// PDMP_NULL, PDMP_RANGE.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_tau(controller: Option<&mut pdmp_controller>, tau: f64) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_tau(tau).map(|()| PDMP_OK)?))
}

/// Sets the amplitude r_0 >= 0 of a rhythmic movement. r follows by Eq. (4) of the paper. Errors: PDMP_NULL,
/// PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_amplitude(
    controller: Option<&mut pdmp_controller>,
    amplitude: f64,
) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_amplitude(amplitude).map(|()| PDMP_OK)?))
}

/// Sets the phase phi of a rhythmic movement, in rad, for example at the heel strike of a gait. Position and velocity are
/// continuous, and the deviation from the cycle at the new phase decays. Before the first tick the movement starts at this
/// phase. Errors: PDMP_NULL, PDMP_RANGE, PDMP_ABSENT.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_phase(controller: Option<&mut pdmp_controller>, phase: f64) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_phase(phase).map(|()| PDMP_OK)?))
}

/// Sets the gain k_phi in [0, 1000] of a measured phase, pdmp_command.phase, per unit of the clock u: an error of the phase
/// decays with exp(-k_phi t/tau). 1 by default, 0 disables the pull. Errors: PDMP_NULL, PDMP_RANGE.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_phase_gain(controller: Option<&mut pdmp_controller>, gain: f64) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_phase_gain(gain).map(|()| PDMP_OK)?))
}

/// Sets the speed in [0, 1e6], a factor of the rate 1/tau: 0 pauses the movement on its path, 1 is the default. The
/// change is filtered like tau, and persists across pdmp_controller_reset. A movement that starts with a given velocity
/// keeps it at any speed, and brakes from it into a pause, within the limits. Errors: PDMP_NULL, PDMP_RANGE.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_speed(controller: Option<&mut pdmp_controller>, speed: f64) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_speed(speed).map(|()| PDMP_OK)?))
}

/// Sets the tolerance in (0, 1] of a movement that has settled, PDMP_FINISHED; 0.005 by default. It is relative to the
/// larger of two lengths of each DoF: its largest demonstrated range, and its distance from the goal when this was last
/// commanded. It persists across pdmp_controller_reset. Errors: PDMP_NULL, PDMP_RANGE.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_tolerance(
    controller: Option<&mut pdmp_controller>,
    tolerance: f64,
) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.set_tolerance(tolerance).map(|()| PDMP_OK)?))
}

/// Sets the gains of the response to a measured position, see pdmp_controller_update: `stopping` k_s of phase stopping
/// and `tracking` k_t of the pull towards the measurement, per unit of the clock u; both at least 0.
///
/// By default k_s = 1000, so that a tracking error of a tenth of the range slows the phase by a factor of 11, and k_t =
/// 10 / extent, where the extent of the clock is T/tau (discrete) or 2 pi (rhythmic). 0 disables a term. Errors:
/// PDMP_NULL, PDMP_RANGE.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_set_compliance(
    controller: Option<&mut pdmp_controller>,
    stopping: f64,
    tracking: f64,
) -> pdmp_status {
    call_on(controller, |controller| {
        Ok(controller.inner.set_compliance(Compliance { stopping, tracking }).map(|()| PDMP_OK)?)
    })
}

/// Discards the measured position; the movement is unperturbed until the next measurement. Errors: PDMP_NULL.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_release(controller: Option<&mut pdmp_controller>) -> pdmp_status {
    call_on(controller, |controller| {
        controller.inner.release();
        Ok(PDMP_OK)
    })
}

/// Advances the movement by one tick without a new command. Returns PDMP_WORKING, PDMP_FINISHED or an error.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_step(controller: Option<&mut pdmp_controller>) -> pdmp_status {
    call_on(controller, |controller| Ok(controller.inner.step()?.into()))
}

/// Applies a command, advances the movement by one tick, and writes the motion. `command` and `motion` may be NULL.
/// Returns PDMP_WORKING, PDMP_FINISHED or an error.
///
/// A command takes effect as a whole or, on error, not at all, and then no time passes. The perturbation terms are
/// constant over the tick:
///
///     tau y' = z + w(u) + k_t d + tau c_v
///     tau z' = alpha_z (beta_z (g - y) - z) + tau^2 c_a
///     tau u' = max(0, k + k_phi sin(phi* - phi))      k = 1 / (1 + k_s |d / range|^2)
///     tau o' = 5 k (e - o) / extent
///
/// with the coupling terms c_v and c_a, the tracking error e = m - y at the measured position m, the expected error o,
/// and d, the part of e beyond o: d = e - min(max(o, min(e, 0)), max(e, 0)) for each DoF. The last e stays in force
/// until the next measurement or pdmp_controller_release. A measured phase phi* pulls the phase of a rhythmic movement; the
/// pull is the mean over the tick of the exact solution, so that it does not overshoot phi*.
///
/// Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE; PDMP_ABSENT if a command does not apply to the kind of model.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_update(
    controller: Option<&mut pdmp_controller>,
    command: Option<&pdmp_command>,
    motion: Option<&pdmp_motion>,
) -> pdmp_status {
    call_on(controller, |controller| {
        let inner = &mut controller.inner;
        motion.map_or(Ok(()), |motion| motion.check(inner.primitive()))?;
        // SAFETY: the contract of the C ABI covers the pointers of this argument.
        let command = command.map_or(Ok(Command::default()), |command| unsafe { command.get(inner.primitive()) })?;
        let status = inner.step_with(&command)?;
        if let Some(motion) = motion {
            // SAFETY: `check` has verified the lengths, and the contract of the C ABI guarantees the pointers. The
            // command, whose arrays may overlap with these, is no longer read.
            unsafe { motion.write(inner) };
        }
        Ok(status.into())
    })
}

/// Writes the present motion. Returns PDMP_WORKING, PDMP_FINISHED or an error: PDMP_NULL, PDMP_LENGTH.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_read(
    controller: Option<&mut pdmp_controller>,
    motion: Option<&pdmp_motion>,
) -> pdmp_status {
    call_on(controller, |controller| {
        let motion = motion.ok_or(Fault::Null("motion"))?;
        motion.check(controller.inner.primitive())?;
        // SAFETY: `check` has verified the lengths, and the contract of the C ABI guarantees the pointers.
        unsafe { motion.write(&controller.inner) };
        Ok(controller.inner.status().into())
    })
}

/// Writes the time since the start, in seconds, and the phase: x in (0, 1] (discrete) or phi in [0, 2 pi) (rhythmic).
/// `time` and `phase` may be NULL. Returns PDMP_WORKING, PDMP_FINISHED or, if `controller` is NULL, PDMP_NULL.
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

/// Writes the error message of the last call on this controller that failed, and returns its length in bytes without
/// the terminating zero, also if `text` is too short for it. The message is empty before the first error. The message
/// of a NULL controller is empty.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_controller_error(controller: Option<&pdmp_controller>, text: pdmp_text) -> usize {
    match controller.and_then(|controller| controller.fault.as_ref()) {
        // SAFETY: the contract of the C ABI covers `text`.
        Some(fault) => unsafe { text.write(fault) },
        // SAFETY: as above.
        None => unsafe { text.write(&"") },
    }
}
