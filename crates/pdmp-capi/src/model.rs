//! Models: loading, properties, and conditions of demonstrated and predicted movements.

use std::ffi::{CString, c_char, c_int, c_void};
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::Arc;

use pdmp_core::context::{ContextColumn, ContextMap};
use pdmp_core::demonstration::QuaternionOrder;
use pdmp_core::model::Coordinates;
use pdmp_core::{Conditions, Kind, Model};

use crate::buffers::{bytes_of, path_of, pdmp_buffer, pdmp_text, pdmp_vector};
use crate::command::pdmp_conditions;
use crate::fault::Fault;
use crate::guard::{guard, guard_with_text};
use crate::status::pdmp_status;

use pdmp_kind::*;
use pdmp_status::PDMP_OK;

/// Learnt primitive. It is immutable, and threads may share it.
pub struct pdmp_model {
    pub(crate) inner: Arc<Model>,
    names: Vec<CString>,
    units: Vec<CString>,
    labels: Vec<Vec<CString>>,
}

/// Kind of a movement.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum pdmp_kind {
    /// Point-to-point movement from a start to a goal.
    PDMP_DISCRETE,
    /// Periodic movement around an anchor.
    PDMP_RHYTHMIC,
}

/// Properties of a model.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct pdmp_info {
    /// Kind of the movement.
    pub kind: pdmp_kind,
    /// Number of degrees of freedom D, the length of velocities and accelerations.
    pub n_dofs: usize,
    /// Number of coordinates, the length of positions, goals, anchors and starts: n_dofs, and one more for each rotation, which
    /// is a unit quaternion.
    pub n_coordinates: usize,
    /// Number of style dimensions J.
    pub n_styles: usize,
    /// Number of demonstrations M.
    pub n_demos: usize,
    /// Number of context values Q; 0 if the model was fitted without contexts.
    pub n_contexts: usize,
    /// Number of elements that pdmp_model_demonstration and pdmp_model_predict need in `storage`: n_styles + 2
    /// n_coordinates + 1.
    pub n_conditions: usize,
    /// Time constant tau of the nominal demonstration, in seconds.
    pub tau: f64,
    /// Duration or period of the nominal demonstration, in seconds.
    pub duration: f64,
}

/// Writes a pointer to a new model to `model`, or NULL on error.
///
/// # Safety
/// `error.data` is NULL or points to at least `error.size` writable bytes.
unsafe fn create(
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
    load: impl FnOnce() -> Result<Model, Fault>,
) -> pdmp_status {
    let call = || {
        let handle = model.ok_or(Fault::Null("model"))?.write(ptr::null_mut());
        let inner = load()?;
        // A C string ends at its first zero byte.
        let c_strings = |texts: &[String]| {
            let texts = texts.iter().map(|text| CString::new(text.split('\0').next().unwrap_or_default()));
            texts.collect::<Result<Vec<_>, _>>().map_err(|_| Fault::Internal)
        };
        let [names, units] = [c_strings(inner.names())?, c_strings(inner.units())?];
        let columns = inner.map().map(ContextMap::columns).unwrap_or_default();
        let labels = columns.iter().map(|column| match column {
            ContextColumn::Label(labels) => c_strings(labels),
            ContextColumn::Number => Ok(Vec::new()),
        });
        let labels = labels.collect::<Result<_, _>>()?;
        *handle = Box::into_raw(Box::new(pdmp_model { inner: Arc::new(inner), names, units, labels }));
        Ok(PDMP_OK)
    };
    // SAFETY: this function has the same contract for `error`.
    unsafe { guard_with_text(error, call) }
}

/// Loads a model file. `path` is a UTF-8 string.
///
/// `*model` is set to the new model, which the caller frees with pdmp_model_free, or to NULL on error.
///
/// Errors: PDMP_NULL, PDMP_IO, PDMP_FILE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_load(
    path: *const c_char,
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
) -> pdmp_status {
    // SAFETY: the contract of the C ABI covers `path`.
    let load = || Ok(Model::load(unsafe { path_of(path) }?)?);
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { create(model, error, load) }
}

/// Loads a model from the `size` bytes of a model file in memory, which may be freed afterwards.
///
/// `*model` is set to the new model, which the caller frees with pdmp_model_free, or to NULL on error.
///
/// Errors: PDMP_NULL, PDMP_FILE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_from_bytes(
    bytes: *const c_void,
    size: usize,
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
) -> pdmp_status {
    // SAFETY: the contract of the C ABI covers `bytes`.
    let load = || Ok(Model::from_bytes(unsafe { bytes_of(bytes, size) }?)?);
    // SAFETY: the contract of the C ABI covers `error`.
    unsafe { create(model, error, load) }
}

/// Frees a model; NULL is ignored. Controllers of the model remain valid.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_free(model: Option<Box<pdmp_model>>) {
    drop(model);
}

/// Writes the properties of a model to `info`.
///
/// Errors: PDMP_NULL.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_describe(
    model: Option<&pdmp_model>,
    info: Option<&mut MaybeUninit<pdmp_info>>,
) -> pdmp_status {
    let call = || {
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        info.ok_or(Fault::Null("info"))?.write(pdmp_info {
            kind: match model.kind() {
                Kind::Discrete => PDMP_DISCRETE,
                Kind::Rhythmic => PDMP_RHYTHMIC,
            },
            n_dofs: model.n_dofs(),
            n_coordinates: model.n_coordinates(),
            n_styles: model.n_styles(),
            n_demos: model.n_demos(),
            n_contexts: n_contexts(model),
            n_conditions: n_conditions(model),
            tau: model.tau(),
            duration: model.duration(),
        });
        Ok(PDMP_OK)
    };
    guard(call, drop)
}

/// Returns the name of degree of freedom `dof`, counted from 0, as a UTF-8 string that the model owns. Returns NULL if
/// `model` is NULL or `dof` >= n_dofs.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_name(model: Option<&pdmp_model>, dof: usize) -> *const c_char {
    model.and_then(|model| model.names.get(dof)).map_or(ptr::null(), |name| name.as_ptr())
}

/// Returns the unit of degree of freedom `dof`, counted from 0, as a UTF-8 string that the model owns; "" if it is not known.
/// Returns NULL if `model` is NULL or `dof` >= n_dofs.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_unit(model: Option<&pdmp_model>, dof: usize) -> *const c_char {
    model.and_then(|model| model.units.get(dof)).map_or(ptr::null(), |unit| unit.as_ptr())
}

/// Writes the conditions that reproduce demonstration `demonstration`, counted from 0: style, goal and start (discrete)
/// or anchor (rhythmic), and tau.
///
/// If the model was fitted with time warping or with landmarks, tau matches the duration of the demonstration, and the
/// relative timing within the movement is that of the nominal demonstration.
///
/// The numbers are written to `storage`, of at least pdmp_info.n_conditions elements, and the members of `*conditions`
/// point into it: `storage` must outlive their use.
///
/// Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_demonstration(
    model: Option<&pdmp_model>,
    demonstration: usize,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    storage: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let select = |model: &Model| Ok(model.conditions(&[demonstration])?);
    // SAFETY: the contract of the C ABI covers `storage` and `error`.
    unsafe { write_conditions(model, conditions, storage, error, select) }
}

/// Returns the first column of the unit quaternion of rotation `rotation`, counted from 0, in positions, and its order: `*order`
/// is 0 for (w, x, y, z) and 1 for (x, y, z, w). Angular velocities and accelerations are in the body frame, unless the model
/// was set to the world frame. Returns n_coordinates if there is no such rotation, and 0 if `model` is NULL.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_rotation(
    model: Option<&pdmp_model>,
    rotation: usize,
    order: Option<&mut MaybeUninit<c_int>>,
) -> usize {
    let Some(model) = model else { return 0 };
    let columns = model.inner.coordinates().map(Coordinates::columns).unwrap_or_default();
    let Some(columns) = columns.get(rotation) else { return model.inner.n_coordinates() };
    order.map(|order| order.write(c_int::from(columns.order == QuaternionOrder::Xyzw)));
    columns.column
}

/// Returns label `label` of context column `column`, both counted from 0, as a UTF-8 string that the model owns. In a
/// context, a label is represented by its index. Returns NULL if `model` is NULL, if an index is out of range, or if
/// the column is numeric.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_label(model: Option<&pdmp_model>, column: usize, label: usize) -> *const c_char {
    let found = model.and_then(|model| model.labels.get(column)?.get(label));
    found.map_or(ptr::null(), |label| label.as_ptr())
}

/// Predicts the conditions of a movement for a context (n_contexts), as in Section 4.1.2 of the paper: style, goal and
/// start (discrete) or anchor (rhythmic), and tau, which matches the predicted duration. A label is represented by its
/// index, see pdmp_model_label.
///
/// The numbers are written to `storage`, of at least pdmp_info.n_conditions elements, and the members of `*conditions`
/// point into it: `storage` must outlive their use.
///
/// Errors: PDMP_NULL; PDMP_LENGTH; PDMP_ABSENT if the model was fitted without contexts; PDMP_RANGE if a value is not
/// finite or no index of a label, or if the context is so far from the demonstrations that the prediction overflows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_predict(
    model: Option<&pdmp_model>,
    context: pdmp_vector,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    storage: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let predict = |model: &Model| {
        let map = model.map().ok_or(Fault::NoContexts)?;
        // SAFETY: the contract of the C ABI covers `context`.
        let context = unsafe { context.require("context", n_contexts(model), "context value") }?;
        Ok(model.predict(&map.context(context)?)?.conditions)
    };
    // SAFETY: the contract of the C ABI covers `storage` and `error`.
    unsafe { write_conditions(model, conditions, storage, error, predict) }
}

pub(crate) fn n_contexts(model: &Model) -> usize {
    model.demonstrated().contexts.as_ref().map_or(0, |contexts| contexts.ncols())
}

/// Returns the largest number of elements that the conditions of a movement take.
fn n_conditions(model: &Model) -> usize {
    model.n_styles() + 2 * model.n_coordinates() + 1
}

/// Writes the selected conditions, with tau in place of the durations of segments, to `storage` and `conditions`.
///
/// # Safety
/// `storage.data` is NULL or points to at least `storage.length` writable numbers; `error.data` is NULL or points to at
/// least `error.size` writable bytes.
unsafe fn write_conditions(
    model: Option<&pdmp_model>,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    storage: pdmp_buffer,
    error: pdmp_text,
    select: impl FnOnce(&Model) -> Result<Conditions, Fault>,
) -> pdmp_status {
    let call = || {
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let conditions = conditions.ok_or(Fault::Null("conditions"))?;
        if storage.data.is_null() {
            return Err(Fault::Null("storage"));
        }
        storage.check("storage", n_conditions(model), "style dimension, two per coordinate and one for tau")?;
        let selected = select(model)?;
        let tau = Some(selected.time_constant(model)?);
        let selected = Conditions { tau, segment_durations: None, ..selected };
        // SAFETY: `storage` was checked to hold the style, two vectors of n_coordinates and tau, the most that is selected.
        conditions.write(unsafe { pdmp_conditions::store(&selected, storage.data) });
        Ok(PDMP_OK)
    };
    // SAFETY: this function has the same contract for `error`.
    unsafe { guard_with_text(error, call) }
}
