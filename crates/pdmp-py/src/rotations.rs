//! Rotations among the coordinates: columns that are unit quaternions.

use std::sync::Arc;

use numpy::IntoPyArray;
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::choice::Choice;
use crate::convert::{Matrix, matrix, quoted};
use crate::error::raise;
use crate::fit::FRAMES;
use crate::model::Model;
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

/// Converts positions to degrees of freedom, whose rotations are rotation vectors from those of a reference.
///
/// Parameters
/// ----------
/// reference, position : array_like, (T, n_coordinates)
///     Positions with unit quaternions.
/// rotations : dict of int to str
///     First column and order of each quaternion, as of `Demonstration`.
///
/// Returns
/// -------
/// ndarray, (T, n_dofs)
///     Rotation vectors in rad in the body frame of the reference; the other coordinates are those of `position`.
///
/// Raises
/// ------
/// ValueError
///     Shapes that differ, or a quaternion whose norm deviates from 1 by more than 1e-3.
#[pyfunction]
pub(crate) fn to_tangent<'py>(
    py: Python<'py>,
    reference: &Bound<'_, PyAny>,
    position: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
) -> PyResult<Matrix<'py>> {
    let (reference, position) = (matrix("reference", "(T, D)", reference)?, matrix("position", "(T, D)", position)?);
    let rotations = rotations_of(rotations, None)?;
    let dofs = pdmp_core::model::to_tangent(reference.view(), position.view(), &rotations).map_err(raise)?;
    Ok(dofs.into_pyarray(py))
}

/// Converts degrees of freedom relative to a reference to positions: the inverse of `to_tangent`.
///
/// Parameters
/// ----------
/// reference : array_like, (T, n_coordinates)
///     Positions with unit quaternions.
/// dofs : array_like, (T, n_dofs)
///     Degrees of freedom, whose rotations are rotation vectors in rad.
/// rotations : dict of int to str
///     First column and order of each quaternion.
///
/// Returns
/// -------
/// ndarray, (T, n_coordinates)
///
/// Raises
/// ------
/// ValueError
///     As for `to_tangent`.
#[pyfunction]
pub(crate) fn from_tangent<'py>(
    py: Python<'py>,
    reference: &Bound<'_, PyAny>,
    dofs: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
) -> PyResult<Matrix<'py>> {
    let (reference, dofs) = (matrix("reference", "(T, D)", reference)?, matrix("dofs", "(T, D)", dofs)?);
    let rotations = rotations_of(rotations, None)?;
    let position = pdmp_core::model::from_tangent(reference.view(), dofs.view(), &rotations).map_err(raise)?;
    Ok(position.into_pyarray(py))
}

/// Computes the mean of positions with rotations, their Karcher mean.
///
/// Parameters
/// ----------
/// positions : list of array_like, (T, n_coordinates)
///     Positions with unit quaternions.
/// rotations : dict of int to str
///     First column and order of each quaternion.
///
/// Returns
/// -------
/// ndarray, (T, n_coordinates)
///
/// Raises
/// ------
/// ValueError
///     As for `to_tangent`.
#[pyfunction]
pub(crate) fn mean_positions<'py>(
    py: Python<'py>,
    positions: &Bound<'_, PyAny>,
    rotations: &Bound<'_, PyAny>,
) -> PyResult<Matrix<'py>> {
    let rotations = rotations_of(rotations, None)?;
    let positions = positions
        .try_iter()?
        .map(|position| matrix("positions", "(T, D)", &position?))
        .collect::<PyResult<Vec<_>>>()?;
    let views: Vec<_> = positions.iter().map(|position| position.view()).collect();
    Ok(pdmp_core::model::mean_positions(&views, &rotations).map_err(raise)?.into_pyarray(py))
}

#[pymethods]
impl Model {
    /// Returns the model with angular velocities and accelerations in another frame; it moves alike.
    ///
    /// Parameters
    /// ----------
    /// frame : {"body", "world"}
    ///     Frame that rotates, or the frame in which orientations are measured.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The model has no rotations.
    fn in_frame(&self, frame: Choice<'_>) -> PyResult<Self> {
        let frame = frame.of("frame", &FRAMES)?;
        self.0.in_frame(frame).map(|model| Self(Arc::new(model))).map_err(raise)
    }
}
