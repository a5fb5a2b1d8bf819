//! Conversions of orientations.

use ndarray::{Array, ArrayD, ArrayView, Axis, Dimension, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn};
use pdmp_core::demonstration::QuaternionOrder;
use pdmp_core::preprocessing::orientation;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::choice::Choice;
use crate::convert::array;
use crate::error::raise;

pub(crate) type Numbers<'py> = Bound<'py, PyArrayDyn<f64>>;

pub(crate) const ORDERS: [(&str, QuaternionOrder); 2] =
    [("wxyz", QuaternionOrder::Wxyz), ("xyzw", QuaternionOrder::Xyzw)];

/// Unit of angles.
#[derive(Clone, Copy)]
pub(crate) enum AngleUnit {
    Rad,
    Degree,
}

pub(crate) const UNITS: [(&str, AngleUnit); 2] = [("rad", AngleUnit::Rad), ("deg", AngleUnit::Degree)];

/// Converts rotation matrices to unit quaternions.
///
/// The columns of a matrix are the axes of the body in the world frame. Matrices whose M.T @ M deviates from the identity by
/// at most 1e-3 are replaced by the closest rotation. The signs are continuous along time, from w ≥ 0 in the first sample.
///
/// Parameters
/// ----------
/// matrices : array_like, (T, 3, 3) or (3, 3)
///     Rotation matrices along time, or one.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 4) or (4,)
///
/// Raises
/// ------
/// ValueError
///     Another shape, a number that is not finite, a larger deviation, or a reflection (determinant −1).
///
/// Examples
/// --------
/// >>> pdmp.preprocessing.matrices_to_quaternions(np.diag([1, -1, -1]), order="xyzw").tolist()
/// [1.0, 0.0, 0.0, 0.0]
#[pyfunction]
#[pyo3(signature = (matrices, *, order))]
pub(crate) fn matrices_to_quaternions<'py>(
    py: Python<'py>,
    matrices: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (matrices, order) = (Samples::of("matrices", matrices, &[3, 3])?, order.of("order", &ORDERS)?);
    matrices.map(py, |matrices| orientation::matrices_to_quaternions(matrices, order))
}

/// Converts unit quaternions to rotation matrices.
///
/// Parameters
/// ----------
/// quaternions : array_like, (T, 4) or (4,)
///     Unit quaternions along time, or one.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 3, 3) or (3, 3)
///     Matrices, whose columns are the axes of the body in the world frame.
///
/// Raises
/// ------
/// ValueError
///     Another shape, a number that is not finite, or a norm that deviates from 1 by more than 1e-3.
#[pyfunction]
#[pyo3(signature = (quaternions, *, order))]
pub(crate) fn quaternions_to_matrices<'py>(
    py: Python<'py>,
    quaternions: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (quaternions, order) = (Samples::of("quaternions", quaternions, &[4])?, order.of("order", &ORDERS)?);
    quaternions.map(py, |quaternions| orientation::quaternions_to_matrices(quaternions, order))
}

/// Converts homogeneous transforms to poses.
///
/// Parameters
/// ----------
/// transforms : array_like, (T, 4, 4) or (4, 4)
///     Transforms from the body frame to the world frame along time, or one, with the last row 0, 0, 0, 1. Their rotations
///     are converted as by `matrices_to_quaternions`.
/// order : {"wxyz", "xyzw"}
///     Order of the components of the quaternions.
///
/// Returns
/// -------
/// ndarray, (T, 7) or (7,)
///     Positions x, y, z and unit quaternions, for a demonstration with `rotations={3: order}`.
///
/// Raises
/// ------
/// ValueError
///     As for `matrices_to_quaternions`, or another last row.
///
/// Examples
/// --------
/// >>> transforms = np.tile(np.eye(4), (50, 1, 1))
/// >>> transforms[:, 2, 3] = np.linspace(0, 0.3, 50)
/// >>> poses = pdmp.preprocessing.transforms_to_poses(transforms, order="wxyz")
/// >>> pdmp.Demonstration(poses, dt=0.01, rotations={3: "wxyz"}).n_dofs
/// 6
#[pyfunction]
#[pyo3(signature = (transforms, *, order))]
pub(crate) fn transforms_to_poses<'py>(
    py: Python<'py>,
    transforms: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (transforms, order) = (Samples::of("transforms", transforms, &[4, 4])?, order.of("order", &ORDERS)?);
    transforms.map(py, |transforms| orientation::transforms_to_poses(transforms, order))
}

/// Converts poses to homogeneous transforms.
///
/// Parameters
/// ----------
/// poses : array_like, (T, 7) or (7,)
///     Positions x, y, z and unit quaternions along time, or one.
/// order : {"wxyz", "xyzw"}
///     Order of the components of the quaternions.
///
/// Returns
/// -------
/// ndarray, (T, 4, 4) or (4, 4)
///
/// Raises
/// ------
/// ValueError
///     Another shape, a number that is not finite, or a quaternion whose norm deviates from 1 by more than 1e-3.
#[pyfunction]
#[pyo3(signature = (poses, *, order))]
pub(crate) fn poses_to_transforms<'py>(
    py: Python<'py>,
    poses: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (poses, order) = (Samples::of("poses", poses, &[7])?, order.of("order", &ORDERS)?);
    poses.map(py, |poses| orientation::poses_to_transforms(poses, order))
}

/// Converts rotation vectors to unit quaternions.
///
/// Parameters
/// ----------
/// vectors : array_like, (T, 3) or (3,)
///     Rotation vectors along time, or one: the axis times the angle in rad.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 4) or (4,)
///     Quaternions, whose signs are continuous along time.
///
/// Raises
/// ------
/// ValueError
///     Another shape, or a number that is not finite.
#[pyfunction]
#[pyo3(signature = (vectors, *, order))]
pub(crate) fn rotation_vectors_to_quaternions<'py>(
    py: Python<'py>,
    vectors: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (vectors, order) = (Samples::of("vectors", vectors, &[3])?, order.of("order", &ORDERS)?);
    vectors.map(py, |vectors| orientation::rotation_vectors_to_quaternions(vectors, order))
}

/// Converts unit quaternions to rotation vectors.
///
/// The first is that of the shortest rotation; of the others, that closest to the sample before, with whole turns added about
/// its axis. A path that passes half a turn has no jump.
///
/// Parameters
/// ----------
/// quaternions : array_like, (T, 4) or (4,)
///     Unit quaternions along time, or one.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 3) or (3,)
///     Rotation vectors in rad.
///
/// Raises
/// ------
/// ValueError
///     As for `quaternions_to_matrices`.
#[pyfunction]
#[pyo3(signature = (quaternions, *, order))]
pub(crate) fn quaternions_to_rotation_vectors<'py>(
    py: Python<'py>,
    quaternions: &Bound<'_, PyAny>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (quaternions, order) = (Samples::of("quaternions", quaternions, &[4])?, order.of("order", &ORDERS)?);
    quaternions.map(py, |quaternions| orientation::quaternions_to_rotation_vectors(quaternions, order))
}

/// Converts axes and angles to unit quaternions.
///
/// Parameters
/// ----------
/// axes : array_like, (T, 3) or (3,)
///     Axes of any length along time, or one for all angles.
/// angles : array_like, (T,) or float
///     Angles about them.
/// unit : {"rad", "deg"}
///     Unit of the angles.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 4) or (4,)
///     Quaternions, whose signs are continuous along time.
///
/// Raises
/// ------
/// ValueError
///     Another shape, a number that is not finite, or a turn about an axis of norm below 1e-9.
///
/// Examples
/// --------
/// >>> turn = pdmp.preprocessing.axis_angles_to_quaternions([0, 0, 2], 180, unit="deg", order="wxyz")
/// >>> turn.round(12).tolist()
/// [0.0, 0.0, 0.0, 1.0]
#[pyfunction]
#[pyo3(signature = (axes, angles, *, unit, order))]
pub(crate) fn axis_angles_to_quaternions<'py>(
    py: Python<'py>,
    axes: &Bound<'_, PyAny>,
    angles: &Bound<'_, PyAny>,
    unit: Choice<'_>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (mut axes, order) = (Samples::of("axes", axes, &[3])?, order.of("order", &ORDERS)?);
    let angles = Samples::of_angles(angles, &[], unit)?;
    let radians: Vec<f64> = angles.rows.iter().copied().collect();
    if axes.is_single {
        let shape = [radians.len(), 3];
        axes.rows = axes.rows.broadcast(IxDyn(&shape)).map(|rows| rows.to_owned()).unwrap_or(axes.rows);
        axes.is_single = angles.is_single;
    }
    axes.map(py, |axes| orientation::axis_angles_to_quaternions(axes, &radians, order))
}

/// Samples along time, or a single one.
pub(crate) struct Samples {
    rows: ArrayD<f64>,
    is_single: bool,
}

impl Samples {
    /// Returns samples of a given shape.
    pub(crate) fn of(name: &str, value: &Bound<'_, PyAny>, shape: &[usize]) -> PyResult<Self> {
        let rows = array(name, value)?;
        let is_single = rows.shape() == shape;
        if is_single || rows.ndim() == shape.len() + 1 && rows.shape()[1..] == *shape {
            let rows = if is_single { rows.insert_axis(Axis(0)) } else { rows };
            return Ok(Self { rows, is_single });
        }
        let text = |shape: &[String]| match shape {
            [one] => format!("({one},)"),
            several => format!("({})", several.join(", ")),
        };
        let numbers = |shape: &[usize]| shape.iter().map(usize::to_string).collect::<Vec<_>>();
        let (one, found) = (numbers(shape), numbers(rows.shape()));
        let series = [vec!["T".to_string()], one.clone()].concat();
        let (found, series, one) = (text(&found), text(&series), text(&one));
        Err(PyValueError::new_err(format!(
            "{name} has shape {found}, expected {series} along time, or one sample {one}"
        )))
    }

    /// Returns angles of a given shape in rad.
    pub(crate) fn of_angles(value: &Bound<'_, PyAny>, shape: &[usize], unit: Choice<'_>) -> PyResult<Self> {
        let mut angles = Self::of("angles", value, shape)?;
        if matches!(unit.of("unit", &UNITS)?, AngleUnit::Degree) {
            angles.rows.mapv_inplace(f64::to_radians);
        }
        Ok(angles)
    }

    /// Converts the samples.
    pub(crate) fn map<'py, D: Dimension, E: Dimension>(
        &self,
        py: Python<'py>,
        convert: impl FnOnce(ArrayView<'_, f64, D>) -> Result<Array<f64, E>, pdmp_core::Error>,
    ) -> PyResult<Numbers<'py>> {
        let rows = self.rows.view().into_dimensionality().map_err(|e| PyValueError::new_err(e.to_string()))?;
        let converted = convert(rows).map_err(raise)?.into_dyn();
        Ok(if self.is_single { converted.index_axis_move(Axis(0), 0) } else { converted }.into_pyarray(py))
    }
}
