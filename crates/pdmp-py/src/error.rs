//! Python exceptions for errors of the core, and long calls that can be interrupted.

use std::cell::Cell;
use std::ffi::CString;
use std::path::Path;

use pdmp_core::{Error, ErrorKind};
use pyo3::create_exception;
use pyo3::exceptions::{
    PyException, PyFileNotFoundError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyPermissionError,
    PyRecursionError, PyUserWarning, PyValueError,
};
use pyo3::prelude::*;

create_exception!(pdmp, PdmpError, PyException, "Base class of the errors that do not concern an argument.");
create_exception!(pdmp, FitError, PdmpError, "Numerical failure of a fit to well-formed demonstrations.");
create_exception!(pdmp, ModelFileError, PdmpError, "Model file that is damaged, not a model, or of another version.");

/// Returns the Python exception of a core error: `ValueError` for arguments and data, `OSError` for the system, and the
/// module's own for fits and model files.
pub(crate) fn raise(error: Error) -> PyErr {
    let place = if matches!(error.argument(), Some("lower" | "upper")) { "position: " } else { "" };
    let text = printable(&format!("{place}{error}{}", hint(&error)));
    match error.kind() {
        ErrorKind::Argument | ErrorKind::Data => PyValueError::new_err(text),
        ErrorKind::Numerical => FitError::new_err(text),
        ErrorKind::Memory => PyMemoryError::new_err(text),
        ErrorKind::ModelFile => ModelFileError::new_err(text),
        ErrorKind::Interrupted => PyKeyboardInterrupt::new_err(()),
        ErrorKind::Io => match error {
            Error::Io { path, source } => system_error(&path, &source),
            _ => PyOSError::new_err(text),
        },
    }
}

/// Returns the name of the Python argument that remedies an error, where the text of the core cannot name it.
fn hint(error: &Error) -> &'static str {
    match error {
        Error::Demo { source, .. } => hint(source),
        Error::Movement(error) => hint(&error.source),
        Error::File(reason) if reason.contains("load it as a partial fit") => " (pdmp.PartialFit.load)",
        Error::File(reason) if reason.ends_with("load it as a model") => " (pdmp.load)",
        Error::Aperiodic { .. } => " (onsets=)",
        Error::Argument { name: "time", .. } => " (dt= or time=)",
        _ => "",
    }
}

fn system_error(path: &Path, source: &std::io::Error) -> PyErr {
    let (reason, path) = (source.to_string(), path.display().to_string());
    match (source.raw_os_error(), source.kind()) {
        // Python chooses the subclass by the errno.
        (Some(errno), _) => PyOSError::new_err((errno, reason, path)),
        (None, std::io::ErrorKind::NotFound) => PyFileNotFoundError::new_err((2, reason, path)),
        (None, std::io::ErrorKind::PermissionDenied) => PyPermissionError::new_err((13, "Permission denied", path)),
        // EINVAL: the path is invalid before any system call.
        (None, _) => PyOSError::new_err((22, reason, path)),
    }
}

/// Issues a `UserWarning` at the line that called the library.
pub(crate) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(printable(text))?, 1)
}

/// Escapes control characters, among them line breaks and marks of the writing direction: names and labels come from
/// files and are printed on terminals.
pub(crate) fn printable(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            ' '..='~' => escaped.push(c),
            // `escape_debug` keeps a combining accent only after a letter.
            _ => escaped.extend(format!("a{c}").escape_debug().skip(1)),
        }
    }
    escaped
}

/// Escapes a text to printable ASCII, which every console can write.
pub(crate) fn ascii(text: &str) -> String {
    let plain = printable(&text.replace('é', "e"));
    plain.chars().flat_map(|c| if c.is_ascii() { vec![c] } else { c.escape_unicode().collect() }).collect()
}

/// Largest depth of calls within calls. Each uses native stack, which Python's recursion limit does not count.
const MAX_NESTED: usize = 16;

/// Runs a call that may call back into Python, and from there into this library.
pub(crate) fn nested<T>(call: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    thread_local!(static DEPTH: Cell<usize> = const { Cell::new(0) });
    struct Level;
    impl Drop for Level {
        fn drop(&mut self) {
            DEPTH.set(DEPTH.get() - 1);
        }
    }
    if DEPTH.get() >= MAX_NESTED {
        let message = "a callback or the __array__ of an argument calls the function that called it, without end";
        return Err(PyRecursionError::new_err(message));
    }
    DEPTH.set(DEPTH.get() + 1);
    let _level = Level;
    call()
}

/// Runs a long call with the interpreter released. The call reports its stage and completed fraction to a function,
/// which passes them to `progress` and returns [`Error::Interrupted`] after Ctrl-C or an exception of `progress`.
pub(crate) fn detached<S, T: Send>(
    py: Python<'_>,
    progress: impl Fn(Python<'_>, S, f64) -> PyResult<()> + Sync,
    call: impl FnOnce(&mut dyn FnMut(S, f64) -> Result<(), Error>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    nested(|| {
        let mut raised = None;
        let result = py.detach(|| {
            call(&mut |stage, share| {
                Python::attach(|py| py.check_signals().and_then(|()| progress(py, stage, share))).map_err(|error| {
                    raised = Some(error);
                    Error::Interrupted
                })
            })
        });
        result.map_err(|error| raised.unwrap_or_else(|| raise(error)))
    })
}

/// Runs a long call as [`detached`] does, without reports of progress.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    call: impl FnOnce(&mut dyn FnMut(f64) -> Result<(), Error>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    detached(py, |_, (), _| Ok(()), |progress| call(&mut |share| progress((), share)))
}
