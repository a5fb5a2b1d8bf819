//! Rotations among the coordinates: columns that are unit quaternions.

use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::quoted;
use crate::scalar::Scalar;

/// Returns the rotations of a mapping from the first column of a quaternion, its index or name, to its order.
pub(crate) fn rotations_of(rotations: &Bound<'_, PyAny>, names: Option<&[String]>) -> PyResult<Vec<RotationColumns>> {
    let wrong = |problem: String| PyValueError::new_err(format!("rotations = {}: {problem}", quoted(rotations)));
    let form = "must map the first column of each quaternion to its order, such as {3: \"wxyz\"}";
    let items = rotations.call_method0("items").map_err(|_| wrong(form.to_string()))?;
    items
        .try_iter()?
        .map(|item| {
            let (column, order) = item?.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
            let column = match column.extract::<String>() {
                Ok(name) => names
                    .and_then(|names| names.iter().position(|other| *other == name))
                    .ok_or_else(|| wrong(format!("there is no column named {name:?}; pass names=, or an index")))?,
                Err(_) => Scalar::Object(column).count("rotations")?,
            };
            let order = match order.extract::<String>().as_deref() {
                Ok("wxyz") => QuaternionOrder::Wxyz,
                Ok("xyzw") => QuaternionOrder::Xyzw,
                _ => return Err(wrong("the order must be \"wxyz\" or \"xyzw\"".to_string())),
            };
            Ok(RotationColumns { column, order })
        })
        .collect()
}

/// Returns rotations as a mapping from the first column of a quaternion to its order.
pub(crate) fn rotations_to_python<'py>(py: Python<'py>, rotations: &[RotationColumns]) -> PyResult<Bound<'py, PyDict>> {
    let mapping = PyDict::new(py);
    for rotation in rotations {
        let order = match rotation.order {
            QuaternionOrder::Wxyz => "wxyz",
            QuaternionOrder::Xyzw => "xyzw",
        };
        mapping.set_item(rotation.column, order)?;
    }
    Ok(mapping)
}
