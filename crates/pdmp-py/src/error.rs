//! How errors of the core appear in Python.

use std::cell::Cell;
use std::path::Path;

use pdmp_core::{Error, ErrorKind};
use pyo3::create_exception;
use pyo3::exceptions::{
    PyException, PyFileNotFoundError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyPermissionError,
    PyRecursionError, PyValueError,
};
use pyo3::prelude::*;

create_exception!(pdmp, PdmpError, PyException, "Base of the errors that are not about an argument.");
create_exception!(pdmp, FitError, PdmpError, "Learning did not succeed on well-formed demonstrations.");
create_exception!(pdmp, ModelFileError, PdmpError, "A model file that is damaged, foreign or of another version.");

/// The Python exception of a core error: `ValueError` for arguments, `OSError` for the system, ours for the rest.
pub(crate) fn raise(error: Error) -> PyErr {
    let text = printable(&error.to_string());
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

fn system_error(path: &Path, source: &std::io::Error) -> PyErr {
    let (reason, path) = (source.to_string(), path.display().to_string());
    match (source.raw_os_error(), source.kind()) {
        // With an errno Python chooses the subclass.
        (Some(errno), _) => PyOSError::new_err((errno, reason, path)),
        (None, std::io::ErrorKind::NotFound) => PyFileNotFoundError::new_err((2, "No such file or directory", path)),
        (None, std::io::ErrorKind::PermissionDenied) => PyPermissionError::new_err((13, "Permission denied", path)),
        // A path that never reached the system: EINVAL.
        (None, _) => PyOSError::new_err((22, reason, path)),
    }
}

/// A text whose control characters are escaped, line breaks and reversed directions of writing among them: names and
/// labels come from files, and texts end up on terminals.
pub(crate) fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            ' '..='~' => shown.push(c),
            // After a letter, combining accents stay as they are.
            _ => shown.extend(format!("a{c}").escape_debug().skip(1)),
        }
    }
    shown
}

/// A printable text that any console can write.
pub(crate) fn ascii(text: &str) -> String {
    let plain = printable(&text.replace('é', "e"));
    plain.chars().flat_map(|c| if c.is_ascii() { vec![c] } else { c.escape_unicode().collect() }).collect()
}

/// Most calls within calls: each takes stack of its own, of which Python's limit of recursion knows nothing.
const MAX_NESTED: usize = 16;

/// Runs a call that may call back into Python, and from there into this library again.
pub(crate) fn nested<T>(call: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    thread_local!(static DEPTH: Cell<usize> = const { Cell::new(0) });
    struct Level;
    impl Drop for Level {
        fn drop(&mut self) {
            DEPTH.set(DEPTH.get() - 1);
        }
    }
    if DEPTH.get() >= MAX_NESTED {
        let message = "a callback, or the __array__ of an argument, calls the function that called it, again and again";
        return Err(PyRecursionError::new_err(message));
    }
    DEPTH.set(DEPTH.get() + 1);
    let _level = Level;
    call()
}

/// Runs a long call without holding the interpreter. The call is handed a question whether to go on, which tells
/// `progress` the share that is done, and whose answer is no after Ctrl-C or an exception of `progress`.
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

/// [`detached`] for a call whose progress nobody follows.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    call: impl FnOnce(&mut dyn FnMut(f64) -> Result<(), Error>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    detached(py, |_, (), _| Ok(()), |progress| call(&mut |share| progress((), share)))
}
