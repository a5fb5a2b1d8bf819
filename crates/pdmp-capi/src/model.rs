//! Models: read, looked at, asked for the conditions of a movement.

use std::ffi::{CStr, CString, c_char, c_void};
use std::io::ErrorKind;
use std::mem::MaybeUninit;
use std::path::Path;
use std::ptr;
use std::sync::Arc;

use pdmp_core::context::{ContextColumn, ContextMap};
use pdmp_core::{Conditions, Error, Kind, Model};

use crate::buffers::{pdmp_buffer, pdmp_text, pdmp_vector};
use crate::command::pdmp_conditions;
use crate::status::{Fault, answer, answer_in, pdmp_status};

use pdmp_kind::*;
use pdmp_status::PDMP_OK;

/// A learnt primitive. It never changes, and threads can share it.
pub struct pdmp_model {
    pub(crate) inner: Arc<Model>,
    names: Vec<CString>,
    labels: Vec<Vec<CString>>,
}

/// The kind of movement.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum pdmp_kind {
    /// From a start to a goal.
    PDMP_DISCRETE,
    /// Around an anchor, periodically.
    PDMP_RHYTHMIC,
}

/// What there is to know of a model before it moves.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct pdmp_info {
    /// Discrete or rhythmic.
    pub kind: pdmp_kind,
    /// Number of degrees of freedom D.
    pub n_dofs: usize,
    /// Dimension J of the style parameter.
    pub n_styles: usize,
    /// Number of demonstrations M.
    pub n_demos: usize,
    /// Length Q of a context; 0 if the model was learnt without.
    pub n_contexts: usize,
    /// Numbers that pdmp_model_demonstration and pdmp_model_predict write at most: n_styles + 2 n_dofs + 1.
    pub n_conditions: usize,
    /// Time constant tau of the nominal demonstration, in seconds.
    pub tau: f64,
    /// Duration or period of the nominal demonstration, in seconds.
    pub duration: f64,
}

/// Puts a new model where the caller wants it, or NULL.
///
/// # Safety
/// `error` has the room that it tells.
unsafe fn deliver(
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
    load: impl FnOnce() -> Result<Model, Fault>,
) -> pdmp_status {
    let call = || {
        let place = model.ok_or(Fault::Null("model"))?.write(ptr::null_mut());
        let inner = load()?;
        // In C a name ends at its first zero byte.
        let texts = |texts: &[String]| {
            let texts = texts.iter().map(|text| CString::new(text.split('\0').next().unwrap_or_default()));
            texts.collect::<Result<Vec<_>, _>>().map_err(|_| Fault::Internal)
        };
        let names = texts(inner.names())?;
        let columns = inner.map().map(ContextMap::columns).unwrap_or_default();
        let labels = columns.iter().map(|column| match column {
            ContextColumn::Label(labels) => texts(labels),
            ContextColumn::Number => Ok(Vec::new()),
        });
        let labels = labels.collect::<Result<_, _>>()?;
        *place = Box::into_raw(Box::new(pdmp_model { inner: Arc::new(inner), names, labels }));
        Ok(PDMP_OK)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { answer_in(error, call) }
}

/// Reads a model file from a path in UTF-8. The model is NULL if it is refused.
///
/// # Safety
/// `path` is NULL or ends in a zero byte, and `error` has the room that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_load(
    path: *const c_char,
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
) -> pdmp_status {
    let load = || {
        if path.is_null() {
            return Err(Fault::Null("path"));
        }
        // SAFETY: it is not NULL, and the caller promises the zero byte.
        let path = unsafe { CStr::from_ptr(path) };
        let path = path.to_str().map_err(|_| Error::Io {
            path: path.to_string_lossy().into_owned().into(),
            source: ErrorKind::InvalidFilename.into(),
        });
        Ok(Model::load(Path::new(path?))?)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { deliver(model, error, load) }
}

/// Reads a model from the bytes of a file. The model is NULL if it is refused.
///
/// # Safety
/// `bytes` is NULL or points to `size` bytes, and `error` has the room that it tells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_from_bytes(
    bytes: *const c_void,
    size: usize,
    model: Option<&mut MaybeUninit<*mut pdmp_model>>,
    error: pdmp_text,
) -> pdmp_status {
    let read = || {
        if bytes.is_null() {
            return Err(Fault::Null("bytes"));
        }
        // SAFETY: it is not NULL, and the caller promises the size.
        let bytes = unsafe { std::slice::from_raw_parts(bytes.cast(), size) };
        Ok(Model::from_bytes(bytes)?)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { deliver(model, error, read) }
}

/// Frees a model. Its controllers go on: what they need of it stays. With NULL it does nothing.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_free(model: Option<Box<pdmp_model>>) {
    drop(model);
}

/// Tells kind, sizes and times of a model.
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
            n_styles: model.n_styles(),
            n_demos: model.n_demos(),
            n_contexts: n_contexts(model),
            n_conditions: n_conditions(model),
            tau: model.tau(),
            duration: model.duration(),
        });
        Ok(PDMP_OK)
    };
    answer(call, drop)
}

/// Name of a degree of freedom, counted from 0, in UTF-8. It lives as long as the model, and is NULL past the last.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_name(model: Option<&pdmp_model>, dof: usize) -> *const c_char {
    model.and_then(|model| model.names.get(dof)).map_or(ptr::null(), |name| name.as_ptr())
}

/// Conditions that repeat a demonstration, counted from 0: its style, goal and start or anchor, and tau.
///
/// Of a model whose time was warped or has landmarks, tau is that of the whole duration: within it the movement hurries and
/// pauses as the nominal one does.
///
/// They are written to `numbers`, which has room for pdmp_info.n_conditions of them, and `conditions` points there.
///
/// # Safety
/// `numbers` and `error` have the room that they tell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_demonstration(
    model: Option<&pdmp_model>,
    demonstration: usize,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    numbers: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let demonstrated = |model: &Model| Ok(model.conditions(&[demonstration])?);
    // SAFETY: the caller's promise is the same.
    unsafe { lay_down(model, conditions, numbers, error, demonstrated) }
}

/// A label that a value of the contexts may be, both counted from 0, in UTF-8. It lives as long as the model, and is NULL
/// past the last, and where the value is a number. In a context a label is given by its index.
#[unsafe(no_mangle)]
pub extern "C" fn pdmp_model_label(model: Option<&pdmp_model>, value: usize, label: usize) -> *const c_char {
    let found = model.and_then(|model| model.labels.get(value)?.get(label));
    found.map_or(ptr::null(), |label| label.as_ptr())
}

/// Conditions of the movement predicted for a context (n_contexts), as in Section 4.1.2: style, goal and start or anchor,
/// and tau, that of the whole duration. A label is given by its index, see pdmp_model_label.
///
/// They are written to `numbers`, which has room for pdmp_info.n_conditions of them, and `conditions` points there.
///
/// # Safety
/// `context` points to the numbers that it tells, and `numbers` and `error` have the room that they tell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_model_predict(
    model: Option<&pdmp_model>,
    context: pdmp_vector,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    numbers: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let predict = |model: &Model| {
        let context = match n_contexts(model) {
            // Whatever the context: the model says what it lacks.
            0 => &[],
            // SAFETY: the caller's promise is the same.
            expected => unsafe { context.need("context", expected, "context value") }?,
        };
        Ok(match model.map() {
            Some(map) => model.predict(&map.context(context)?)?,
            None => model.predict(context)?,
        }
        .conditions)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { lay_down(model, conditions, numbers, error, predict) }
}

fn n_contexts(model: &Model) -> usize {
    model.demonstrated().contexts.as_ref().map_or(0, |contexts| contexts.ncols())
}

/// Numbers of a prediction's conditions, at most.
fn n_conditions(model: &Model) -> usize {
    model.n_styles() + 2 * model.n_dofs() + 1
}

/// # Safety
/// `numbers` and `error` have the room that they tell.
unsafe fn lay_down(
    model: Option<&pdmp_model>,
    conditions: Option<&mut MaybeUninit<pdmp_conditions>>,
    numbers: pdmp_buffer,
    error: pdmp_text,
    select: impl FnOnce(&Model) -> Result<Conditions, Fault>,
) -> pdmp_status {
    let call = || {
        let model = &model.ok_or(Fault::Null("model"))?.inner;
        let conditions = conditions.ok_or(Fault::Null("conditions"))?;
        if numbers.data.is_null() {
            return Err(Fault::Null("numbers"));
        }
        numbers.check("numbers", n_conditions(model), "style dimension, two per DoF and one for tau")?;
        let selected = select(model)?;
        let tau = Some(selected.time_constant(model)?);
        let selected = Conditions { tau, segment_durations: None, ..selected };
        // SAFETY: style, at most two vectors of the DoFs and tau fit.
        conditions.write(unsafe { pdmp_conditions::put(&selected, numbers.data) });
        Ok(PDMP_OK)
    };
    // SAFETY: the caller's promise is the same.
    unsafe { answer_in(error, call) }
}
