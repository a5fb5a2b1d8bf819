//! Recognition of a movement while it is observed.

use std::ffi::{c_char, c_void};
use std::mem::MaybeUninit;
use std::ptr;

use pdmp_core::inference::{Prior, Recogniser, Timing};
use pdmp_core::{Kind, Model};

use crate::buffers::{bytes_of, path_of, pdmp_buffer, pdmp_text, pdmp_vector};
use crate::command::pdmp_conditions;
use crate::fault::Fault;
use crate::guard::{guard, guard_with_text};
use crate::model::n_contexts;
use crate::status::pdmp_status;

use pdmp_status::PDMP_OK;

/// Filter that estimates a movement while it is observed. One thread at a time may use it.
pub struct pdmp_recogniser {
    inner: Recogniser,
    kind: Kind,
    n_coordinates: usize,
    n_dofs: usize,
    /// Duration of a movement over its time constant.
    extent: f64,
    tau: f64,
    phase: f64,
    /// Error of the last call that failed.
    fault: Option<Fault>,
}

/// Knowledge of the time of a movement that is observed.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_timing {
    /// Earliest start of a discrete movement, in seconds from the first observation; negative for one that is joined on its way.
    /// Until it starts, it rests. With 0 for both it starts with the first observation. A rhythmic movement is joined at any phase.
    pub earliest: f64,
    /// Latest start.
    pub latest: f64,
    /// Duration or period, in seconds; NULL if it is not known.
    pub duration: *const f64,
}

/// Estimate of a movement from a part of it. Standard deviations are scaled so that 90 % of held-out demonstrations lie within
/// 1.645 of them.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_estimate {
    /// Conditions of the whole movement: style, goal and start, or anchor and present phase, and tau.
    pub conditions: pdmp_conditions,
    /// Standard deviations (n_styles) of the style.
    pub style_deviation: pdmp_vector,
    /// Standard deviations (n_dofs) of the goal or anchor; those of a rotation are of the components of the rotation vector in
    /// rad from it, in the frame of angular velocities.
    pub goal_deviation: pdmp_vector,
    /// Duration or period, in seconds.
    pub duration: f64,
    /// Standard deviation of the logarithm of the duration.
    pub duration_deviation: f64,
    /// Time of arrival at the goal, in seconds on the clock of the observations; that of the end of the cycle if rhythmic.
    pub arrival: f64,
    /// Time from the start to the last observation over the estimated duration, more than 1 after the end; of a rhythmic
    /// movement, the fraction of the cycle in [0, 1).
    pub fraction: f64,
    /// Standard deviation of `fraction`.
    pub fraction_deviation: f64,
    /// Probability that the movement is stopped. From 0.9 on, its clock rests until it is below 0.5: fraction and positions to
    /// come are those of a movement that goes on at once, and the arrival is later by the pause.
    pub stopped: f64,
    /// Mean squared residual, relative to that which one in ten held-out demonstrations exceeds. Above 1 the movement is unlike the
    /// demonstrations.
    pub surprise: f64,
}

/// Writes a pointer to a new recogniser to `recogniser`, or NULL on error.
///
/// # Safety
/// `error.data` is NULL or points to at least `error.size` writable bytes, `context.data` is NULL or points to `context.size`
/// numbers, and `timing.duration` is NULL or valid.
unsafe fn create(
    context: pdmp_vector,
    timing: Option<&pdmp_timing>,
    recogniser: Option<&mut MaybeUninit<*mut pdmp_recogniser>>,
    error: pdmp_text,
    load: impl FnOnce() -> Result<(Model, Prior), Fault>,
) -> pdmp_status {
    let call = || {
        let handle = recogniser.ok_or(Fault::Null("recogniser"))?.write(ptr::null_mut());
        let (model, prior) = load()?;
        let prior = match model.map() {
            _ if context.data.is_null() => prior,
            None => return Err(Fault::NoContexts),
            Some(map) => {
                // SAFETY: this function has the same contract for `context`.
                let context = unsafe { context.require("context", n_contexts(&model), "context value") }?;
                prior.given(&model, &map.context(context)?)?
            }
        };
        let timing = timing.map_or(Timing::default(), |timing| Timing {
            starts: [timing.earliest, timing.latest],
            // SAFETY: the caller guarantees that the pointer is NULL or valid.
            duration: unsafe { timing.duration.as_ref() }.copied(),
        });
        let inner = Recogniser::new(&model, &prior, timing)?;
        let recogniser = pdmp_recogniser {
            inner,
            kind: model.kind(),
            n_coordinates: model.n_coordinates(),
            n_dofs: model.n_dofs(),
            extent: model.duration() / model.tau(),
            tau: model.tau(),
            phase: 0.0,
            fault: None,
        };
        *handle = Box::into_raw(Box::new(recogniser));
        Ok(PDMP_OK)
    };
    // SAFETY: this function has the same contract for `error`.
    unsafe { guard_with_text(error, call) }
}

/// Creates a recogniser from a model file with a prior. `path` is a UTF-8 string; `timing` may be NULL. `context` (n_contexts) is
/// the context of the movement, as for pdmp_model_predict: the prior is then that of movements in this context. With a NULL
/// pointer it is not known.
///
/// `*recogniser` is set to the new recogniser, which the caller frees with pdmp_recogniser_free, or to NULL on error. The
/// coordinates and degrees of freedom are those of the model, which pdmp_model_load reads from the same file.
///
/// Errors: PDMP_NULL; PDMP_IO; PDMP_FILE, also for a model file without a prior; PDMP_LENGTH; PDMP_ABSENT for a context if the model
/// was fitted without contexts; PDMP_RANGE for a context as for pdmp_model_predict, or times that are not finite or in
/// the wrong order, or a model with a time warp.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_recogniser_load(
    path: *const c_char,
    context: pdmp_vector,
    timing: Option<&pdmp_timing>,
    recogniser: Option<&mut MaybeUninit<*mut pdmp_recogniser>>,
    error: pdmp_text,
) -> pdmp_status {
    let load = || {
        // SAFETY: the contract of the C ABI covers `path`.
        let path = unsafe { path_of(path) }?;
        Ok((Model::load(path)?, Prior::load(path)?))
    };
    // SAFETY: the contract of the C ABI covers `context`, `timing` and `error`.
    unsafe { create(context, timing, recogniser, error, load) }
}

/// Creates a recogniser from the `size` bytes of a model file with a prior, as pdmp_recogniser_load does. The bytes may be freed
/// afterwards.
///
/// Errors: PDMP_NULL, PDMP_FILE, PDMP_LENGTH, PDMP_ABSENT, PDMP_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_recogniser_from_bytes(
    bytes: *const c_void,
    size: usize,
    context: pdmp_vector,
    timing: Option<&pdmp_timing>,
    recogniser: Option<&mut MaybeUninit<*mut pdmp_recogniser>>,
    error: pdmp_text,
) -> pdmp_status {
    let load = || {
        // SAFETY: the contract of the C ABI covers `bytes`.
        let bytes = unsafe { bytes_of(bytes, size) }?;
        Ok((Model::from_bytes(bytes)?, Prior::from_bytes(bytes)?))
    };
    // SAFETY: the contract of the C ABI covers `context`, `timing` and `error`.
    unsafe { create(context, timing, recogniser, error, load) }
}

/// Frees a recogniser; NULL is ignored.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_recogniser_free(recogniser: Option<Box<pdmp_recogniser>>) {
    drop(recogniser);
}

/// Executes a call on a recogniser, and stores its error, if any, in the recogniser.
fn call_on(
    recogniser: Option<&mut pdmp_recogniser>,
    call: impl FnOnce(&mut pdmp_recogniser) -> Result<(), Fault>,
) -> pdmp_status {
    let Some(recogniser) = recogniser else { return pdmp_status::PDMP_NULL };
    let mut reported = None;
    let status = guard(|| call(recogniser).map(|()| PDMP_OK), |fault| reported = Some(fault));
    if reported.is_some() {
        recogniser.fault = reported;
    }
    status
}

/// Includes an observation: the position (n_coordinates) at a time in seconds, after that of the observation before. A coordinate
/// that is not observed is NaN; a quaternion with one is not observed, and its sign does not matter. Intervals are arbitrary.
///
/// Errors: PDMP_NULL; PDMP_LENGTH; PDMP_RANGE if the time is not after the one before, a position is infinite, or the norm of a
/// quaternion is not 1. The recogniser then remains as it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_recogniser_update(
    recogniser: Option<&mut pdmp_recogniser>,
    time: f64,
    position: pdmp_vector,
) -> pdmp_status {
    call_on(recogniser, |recogniser| {
        // SAFETY: the contract of the C ABI covers `position`.
        let position = unsafe { position.require("position", recogniser.n_coordinates, "coordinate") }?;
        Ok(recogniser.inner.update(time, position)?)
    })
}

/// Writes the estimate from all observations so far. Its members point into the recogniser, and are valid until the next call on it.
///
/// Errors: PDMP_NULL; PDMP_RANGE if there is no observation, or if the observations are too far from the demonstrations.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_recogniser_estimate(
    recogniser: Option<&mut pdmp_recogniser>,
    estimate: Option<&mut MaybeUninit<pdmp_estimate>>,
) -> pdmp_status {
    call_on(recogniser, |recogniser| {
        let written = estimate.ok_or(Fault::Null("estimate"))?;
        let pdmp_recogniser { inner, kind, extent, tau, phase, .. } = recogniser;
        let estimate = inner.estimate()?;
        *tau = estimate.duration / *extent;
        *phase = std::f64::consts::TAU * estimate.fraction;
        let goal = pdmp_vector::of(estimate.goal());
        let conditions = pdmp_conditions {
            style: pdmp_vector::of(estimate.style()),
            tau: ptr::from_ref(tau),
            ..pdmp_conditions::view(&pdmp_core::Conditions::default())
        };
        let conditions = match kind {
            Kind::Discrete => {
                let start = pdmp_vector::of(estimate.start());
                pdmp_conditions { goal, start, ..conditions }
            }
            Kind::Rhythmic => pdmp_conditions { anchor: goal, phase: ptr::from_ref(phase), ..conditions },
        };
        written.write(pdmp_estimate {
            conditions,
            style_deviation: pdmp_vector::of(&estimate.deviations[..estimate.n_styles]),
            goal_deviation: pdmp_vector::of(estimate.goal_deviation()),
            duration: estimate.duration,
            duration_deviation: estimate.duration_deviation,
            arrival: estimate.arrival,
            fraction: estimate.fraction,
            fraction_deviation: estimate.fraction_deviation,
            stopped: estimate.stopped,
            surprise: estimate.surprise,
        });
        Ok(())
    })
}

/// Predicts the positions at times in seconds, from the last observation on.
///
/// `position` takes time.length rows of n_coordinates numbers, one after the other, and `deviation` rows of n_dofs numbers: means
/// and standard deviations.
///
/// Errors: PDMP_NULL, PDMP_LENGTH; PDMP_RANGE if a time is before the last observation, and as for pdmp_recogniser_estimate.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_recogniser_continuation(
    recogniser: Option<&mut pdmp_recogniser>,
    time: pdmp_vector,
    position: pdmp_buffer,
    deviation: pdmp_buffer,
) -> pdmp_status {
    call_on(recogniser, |recogniser| {
        // SAFETY: the contract of the C ABI covers `time`.
        let time = unsafe { time.require("time", time.length, "time") }?;
        let [n_coordinates, n_dofs] =
            [recogniser.n_coordinates, recogniser.n_dofs].map(|row| time.len().saturating_mul(row));
        // SAFETY: the contract of the C ABI covers the buffers, which overlap with no other argument.
        let (position, deviation) = unsafe {
            let position = position.require("position", n_coordinates, "coordinate of each time")?;
            (position, deviation.require("deviation", n_dofs, "DoF of each time")?)
        };
        Ok(recogniser.inner.write_continuation(time, position, deviation)?)
    })
}

/// Forgets all observations. Errors: PDMP_NULL.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_recogniser_reset(recogniser: Option<&mut pdmp_recogniser>) -> pdmp_status {
    call_on(recogniser, |recogniser| {
        recogniser.inner.reset();
        Ok(())
    })
}

/// Writes the error message of the last call on this recogniser that failed, as pdmp_controller_error does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_recogniser_error(recogniser: Option<&pdmp_recogniser>, text: pdmp_text) -> usize {
    match recogniser.and_then(|recogniser| recogniser.fault.as_ref()) {
        // SAFETY: the contract of the C ABI covers `text`.
        Some(fault) => unsafe { text.write(fault) },
        // SAFETY: as above.
        None => unsafe { text.write(&"") },
    }
}
