//! Status of a movement.

use pyo3::prelude::*;

use crate::convert::Reduced;

/// State of a movement: in progress (`WORKING`, 1, true) or settled on its goal (`FINISHED`, 2, false).
#[pyclass(frozen, eq, hash, module = "pdmp")]
#[derive(PartialEq, Eq, Hash)]
pub(crate) enum Status {
    #[pyo3(name = "WORKING")]
    Working = 1,
    #[pyo3(name = "FINISHED")]
    Finished = 2,
}

#[pymethods]
impl Status {
    /// Returns whether the movement is in progress, so that a loop is `while controller.step()`.
    fn __bool__(&self) -> bool {
        *self == Self::Working
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let name = match self {
            Self::Working => "WORKING",
            Self::Finished => "FINISHED",
        };
        Ok((py.import("builtins")?.getattr("getattr")?, (py.get_type::<Self>(), name).into_pyobject(py)?))
    }
}
