//! Movements through points.

use std::mem::MaybeUninit;
use std::{ptr, slice};

use pdmp_core::inference::{At, Passage, PassageOptions, ViaPoint, through};
use pdmp_core::{Conditions, Error, Model};

use crate::buffers::{length_of, pdmp_text, pdmp_vector};
use crate::command::{pdmp_conditions, per_coordinate};
use crate::controller::{call_on, pdmp_controller};
use crate::fault::Fault;
use crate::guard::{guard, guard_with_text};
use crate::model::{n_contexts, pdmp_model};
use crate::status::pdmp_status;

use pdmp_status::PDMP_OK;

/// Movement through points: its conditions and its additional forcing. It is immutable, and threads may share it.
pub struct pdmp_passage {
    pub(crate) inner: Passage,
}

/// Point that a movement passes at a time or a phase, one of which is given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_point {
    /// Time since the start of the movement, in seconds, at the tau of the conditions.
    pub time: *const f64,
    /// Phase x of a discrete movement, or phi in rad of a rhythmic one, as from pdmp_controller_progress.
    pub phase: *const f64,
    /// Position, one number for each of `dofs`; not given for a velocity alone.
    pub position: pdmp_vector,
    /// Velocity per second, one number for each of `dofs`; not given for a position alone. A rotation has three in place of its
    /// four coordinates: its angular velocity in rad/s, as in velocities of controllers, at the orientation in `position`.
    pub velocity: pdmp_vector,
    /// Degrees of freedom, or coordinates of a model with rotations, counted from 0; NULL for all of them.
    pub dofs: *const usize,
    /// Number of elements of `dofs`.
    pub n_dofs: usize,
    /// Standard deviation of the position relative to the range of each DoF; 0 is a point that is passed exactly.
    pub tolerance: f64,
}

/// Options of pdmp_model_through.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_passage_options {
    /// Context (n_contexts) whose prediction supplies mean and covariance of the conditions; those of the demonstrations by
    /// default.
    pub context: pdmp_vector,
    /// Phase from which on a movement that is under way under the conditions departs from them, as from
    /// pdmp_controller_progress. All conditions then remain, and the additional forcing alone leads it through the points.
    pub from_phase: *const f64,
    /// Standard deviation of the additional displacement relative to the ranges, 0.03 by default. With 0 the conditions carry
    /// all that they can, and the additional forcing the least.
    pub deviation: *const f64,
}

/// Properties of a movement through points.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pdmp_passage_info {
    /// Conditions of the movement, for pdmp_controller_new, _reset and pdmp_model_rollout.
    pub conditions: pdmp_conditions,
    /// Mahalanobis distance of the points from the movements of the demonstrators.
    pub distance: f64,
    /// Number of positions and velocities.
    pub n_constraints: usize,
    /// 1 if the points lie farther from the demonstrations than 999 of 1000 movements of the demonstrators would, otherwise 0.
    pub far: std::ffi::c_int,
    /// Largest displacement (n_dofs) by the additional forcing, relative to the ranges.
    pub displacement: pdmp_vector,
}

impl pdmp_point {
    /// Returns the point as the core takes it.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for reads, over its length.
    unsafe fn get(&self, model: &Model) -> Result<ViaPoint, Fault> {
        let dofs = length_of(self.dofs, self.n_dofs, "dofs")?.map(|length| {
            // SAFETY: `dofs` is not NULL, so the caller guarantees `length` readable numbers.
            unsafe { slice::from_raw_parts(self.dofs, length) }.to_vec()
        });
        let n_coordinates = dofs.as_ref().map_or(model.n_coordinates(), Vec::len);
        let n_velocities = dofs.as_ref().map_or(model.n_dofs(), |dofs| model.primitive().dofs_of(dofs).len());
        let [per, per_velocity] = match dofs {
            Some(_) => ["element of dofs", "DoF of the point, of which a rotation has three"],
            None => [per_coordinate(model), "DoF"],
        };
        // SAFETY: the caller guarantees that the vectors are not given or valid.
        let (position, velocity) = unsafe {
            (
                self.position.get("position", n_coordinates, per)?.map(<[f64]>::to_vec),
                self.velocity.get("velocity", n_velocities, per_velocity)?.map(<[f64]>::to_vec),
            )
        };
        // SAFETY: the caller guarantees that the pointers are NULL or valid.
        let [time, phase] = [self.time, self.phase].map(|number| unsafe { number.as_ref() }.copied());
        let at = match (time, phase) {
            (Some(time), None) => At::Time(time),
            (None, Some(phase)) => At::Phase(phase),
            _ => {
                let problem = "need a time or a phase each, and not both";
                return Err(Error::Argument { name: "points", problem }.into());
            }
        };
        Ok(ViaPoint { at, position, velocity, dofs, tolerance: self.tolerance })
    }
}

impl pdmp_passage_options {
    const NONE: Self = Self { context: pdmp_vector::NONE, from_phase: ptr::null(), deviation: ptr::null() };

    /// Returns the options as the core takes them.
    ///
    /// # Safety
    /// Every pointer is NULL or valid for reads, over its length.
    unsafe fn get(&self, model: &Model) -> Result<PassageOptions, Fault> {
        // SAFETY: this function has the same contract.
        let prediction = match unsafe { self.context.get("context", n_contexts(model), "context value") }? {
            Some(context) => {
                let map = model.map().ok_or(Fault::NoContexts)?;
                Some(model.predict(&map.context(context)?)?)
            }
            None => None,
        };
        // SAFETY: the caller guarantees that the pointers are NULL or valid.
        let [from_phase, deviation] =
            [self.from_phase, self.deviation].map(|number| unsafe { number.as_ref() }.copied());
        Ok(PassageOptions { prediction, from_phase, deviation })
    }
}

/// Computes the most probable movement through `n_points` points.
///
/// `conditions` may be NULL or have some members: they remain, and the others follow from the demonstrations or the context. The
/// result is the mean given the points of movements y(u) = Phi(u) theta + delta(u), with style, goal and start theta, or style and
/// anchor, as scattered as those of the demonstrations, and an additional displacement delta. Points without tolerance are passed to
/// 1e-9 of the range; a rhythmic movement passes them on its limit cycle, in every period. `options` may be NULL.
///
/// `*passage` is set to the new passage, which the caller frees with pdmp_passage_free, or to NULL on error.
///
/// This function allocates. Errors: PDMP_NULL; PDMP_LENGTH; PDMP_RANGE for no point, one outside of the movement or before
/// `from_phase`, a number that is not finite, the velocity of a rotation without its orientation, points that contradict each
/// other or the conditions, or more than 500 numbers;
/// PDMP_ABSENT if a condition does not apply to the kind of model, or for a context if the model was fitted without contexts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_through(
    model: Option<&pdmp_model>,
    points: *const pdmp_point,
    n_points: usize,
    conditions: Option<&pdmp_conditions>,
    options: Option<&pdmp_passage_options>,
    passage: Option<&mut MaybeUninit<*mut pdmp_passage>>,
    error: pdmp_text,
) -> pdmp_status {
    let call = || {
        let handle = passage.ok_or(Fault::Null("passage"))?.write(ptr::null_mut());
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let points = match length_of(points, n_points, "points")? {
            // SAFETY: `points` is not NULL, so the contract of the C ABI guarantees `length` readable points.
            Some(length) => unsafe { slice::from_raw_parts(points, length) },
            None => return Err(Fault::Null("points")),
        };
        // SAFETY: the contract of the C ABI covers the pointers of these arguments.
        let (points, options, given) = unsafe {
            let points = points.iter().map(|point| point.get(model)).collect::<Result<Vec<_>, _>>()?;
            let options = options.unwrap_or(&pdmp_passage_options::NONE).get(model)?;
            let given = conditions.map(|conditions| conditions.get(model)).transpose()?.unwrap_or_default();
            (points, options, given)
        };
        // Conditions have a tau here, and no durations of segments.
        let tau = match (given.tau, &options.prediction) {
            (Some(tau), _) => tau,
            (None, Some(prediction)) => prediction.conditions.time_constant(model)?,
            (None, None) => model.conditions(&(0..model.n_demos()).collect::<Vec<_>>())?.time_constant(model)?,
        };
        let given = Conditions { tau: Some(tau), ..given };
        let inner = through(model, &points, &given, &options)?;
        *handle = Box::into_raw(Box::new(pdmp_passage { inner }));
        Ok(PDMP_OK)
    };
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { guard_with_text(error, call) }
}

/// Writes the properties of a movement through points to `info`. Its members point into the passage, which must outlive their use.
///
/// Errors: PDMP_NULL.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_passage_describe(
    passage: Option<&pdmp_passage>,
    info: Option<&mut MaybeUninit<pdmp_passage_info>>,
) -> pdmp_status {
    let call = || {
        let passage = passage.ok_or(Fault::Null("passage"))?;
        let inner = &passage.inner;
        info.ok_or(Fault::Null("info"))?.write(pdmp_passage_info {
            conditions: pdmp_conditions { forcing: passage, ..pdmp_conditions::view(&inner.conditions) },
            distance: inner.distance,
            n_constraints: inner.n_constraints,
            far: inner.is_far().into(),
            displacement: pdmp_vector::of(&inner.displacement),
        });
        Ok(PDMP_OK)
    };
    guard(call, drop)
}

/// Frees a passage; NULL is ignored. Controllers that use its forcing remain valid.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_passage_free(passage: Option<Box<pdmp_passage>>) {
    drop(passage);
}

/// Adds the additional forcing of a passage to that in force, for a movement under way under the conditions of the passage, see
/// pdmp_passage_options.from_phase.
///
/// Position and velocity stay continuous, and the acceleration too if the forcing begins at the present phase or later; one that
/// began earlier is joined as a goal that has moved. Before the first tick it acts from the start. pdmp_controller_reset ends it.
///
/// This function allocates only if a forcing is in force already. Errors: PDMP_NULL; PDMP_RANGE for a passage of another model, or
/// the ninth forcing with another beginning. The movement then continues.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_controller_add_forcing(
    controller: Option<&mut pdmp_controller>,
    passage: Option<&pdmp_passage>,
) -> pdmp_status {
    call_on(controller, |controller| {
        controller.inner.add_forcing(&passage.ok_or(Fault::Null("passage"))?.inner.forcing)?;
        Ok(PDMP_OK)
    })
}
