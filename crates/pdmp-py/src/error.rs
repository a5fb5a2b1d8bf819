//! How errors of the core appear in Python.

use std::io::ErrorKind;

use pdmp_core::Error;
use pyo3::create_exception;
use pyo3::exceptions::{
    PyException, PyFileNotFoundError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyPermissionError, PyValueError,
};
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
        Error::Io { ref path, ref source } => {
            let (reason, path) = (source.to_string(), path.display().to_string());
            match (source.raw_os_error(), source.kind()) {
                // With an errno Python chooses the subclass.
                (Some(errno), _) => PyOSError::new_err((errno, reason, path)),
                (None, ErrorKind::NotFound) => PyFileNotFoundError::new_err((2, reason, path)),
                (None, ErrorKind::PermissionDenied) => PyPermissionError::new_err((13, reason, path)),
                (None, _) => PyOSError::new_err(error.to_string()),
            }
        }
        Error::Memory { .. } => PyMemoryError::new_err(error.to_string()),
        _ => PyValueError::new_err(error.to_string()),
    }
}
