//! How errors of the core appear in Python.

use pdmp_core::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyOSError, PyValueError};
use pyo3::prelude::*;

create_exception!(pdmp, PdmpError, PyException, "Base of the errors that are not about an argument.");
create_exception!(pdmp, FitError, PdmpError, "Learning did not succeed on well-formed demonstrations.");
create_exception!(pdmp, ModelFileError, PdmpError, "A model file that is damaged, foreign or of another version.");

/// The Python exception of a core error: `ValueError` for arguments, `OSError` for the system, ours for the rest.
pub(crate) fn raise(error: Error) -> PyErr {
    match error {
        Error::Fit(_) => FitError::new_err(error.to_string()),
        Error::File(_) => ModelFileError::new_err(error.to_string()),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        Error::Io { ref path, ref source } => match source.raw_os_error() {
            // With an errno Python chooses the subclass, such as FileNotFoundError.
            Some(errno) => PyOSError::new_err((errno, source.to_string(), path.display().to_string())),
            None => PyOSError::new_err(error.to_string()),
        },
        _ => PyValueError::new_err(error.to_string()),
    }
}
