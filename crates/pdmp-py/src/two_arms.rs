//! Poses of two arms as an absolute and a relative pose.

use ndarray::{ArrayD, ArrayView1, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn};
use pdmp_core::motion::{Pose, TwoArms};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::convert::{Vector, array, optional, to_numpy};
use crate::error::raise;

type Poses<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Converts the poses of two arms to an absolute and a relative pose.
///
/// With positions p and unit quaternions q of the left and the right arm::
///
///     r = inverse(q_left) * q_right          h = (1 + r) / |1 + r|, half of this rotation
///     absolute:  (p_left + p_right) / 2      q_left * h
///     relative:  R(q_absolute).T @ (p_right - p_left)      r
///
/// The absolute rotation is the midpoint of the geodesic between both arms. The pose of the right arm in the frame of the
/// left one depends on the relative pose alone: a primitive of absolute and relative pose, whose demonstrations have one
/// relative pose, keeps a rigid object between the arms for any style, goal and tau. Where the recorded relative poses vary
/// by noise, replace them by `mean_pose` of them before the fit. For compliance of the absolute pose alone, pass the
/// commanded relative pose as the measured one.
///
/// The quaternions r and -r are the same rotation, with midpoints that differ by half a turn about its axis. The sign is that
/// on the side of `reference`. The default is the shorter geodesic, which is undefined where the arms are half a turn
/// apart, as grippers that face each other are: pass a relative rotation of the task there, in both directions of the
/// conversion.
///
/// Parameters
/// ----------
/// left, right : array_like, (..., 7)
///     Poses x, y, z, qw, qx, qy, qz: position, and unit quaternion from the frame of the arm to the world frame. One pose
///     (7,) serves for each of the other arm.
/// reference : array_like, (4,), optional
///     Rotation inverse(q_left) * q_right as qw, qx, qy, qz, of either sign; by default the identity.
///
/// Returns
/// -------
/// absolute, relative : ndarray, (..., 7)
///     The inverse is `left_right`.
///
/// Raises
/// ------
/// ValueError
///     Shapes that differ, a number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a
///     relative rotation of more than 175 degrees from the reference.
///
/// Examples
/// --------
/// >>> left, right = [0.5, 0.2, 0.3, 1, 0, 0, 0], [0.5, -0.2, 0.3, 0, 0, 0, 1]
/// >>> absolute, relative = pdmp.robots.absolute_relative(left, right, reference=[0, 0, 0, 1])
/// >>> absolute.round(3).tolist(), relative.round(3).tolist()
/// ([0.5, 0.0, 0.3, 0.707, 0.0, 0.0, 0.707], [-0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
#[pyfunction]
#[pyo3(signature = (left, right, *, reference=None))]
pub(crate) fn absolute_relative<'py>(
    py: Python<'py>,
    left: &Bound<'py, PyAny>,
    right: &Bound<'py, PyAny>,
    reference: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Poses<'py>, Poses<'py>)> {
    let arms = about(reference)?;
    each(py, ["left", "right"], [left, right], |left, right| arms.absolute_relative(left, right))
}

/// Converts an absolute and a relative pose to the poses of two arms.
///
/// The inverse of `absolute_relative`, exact to rounding with the same reference::
///
///     p_left, p_right = p_absolute -/+ R(q_absolute) @ p_relative / 2
///     q_left, q_right = q_absolute * inverse(h), q_absolute * h         h * h = q_relative
///
/// Parameters
/// ----------
/// absolute, relative : array_like, (..., 7)
///     Poses x, y, z, qw, qx, qy, qz as from `absolute_relative`, with quaternions of either sign. One pose (7,) serves for
///     each of the other argument.
/// reference : array_like, (4,), optional
///     Reference of `absolute_relative`.
///
/// Returns
/// -------
/// left, right : ndarray, (..., 7)
///     Poses of the arms.
///
/// Raises
/// ------
/// ValueError
///     As for `absolute_relative`.
#[pyfunction]
#[pyo3(signature = (absolute, relative, *, reference=None))]
pub(crate) fn left_right<'py>(
    py: Python<'py>,
    absolute: &Bound<'py, PyAny>,
    relative: &Bound<'py, PyAny>,
    reference: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Poses<'py>, Poses<'py>)> {
    let arms = about(reference)?;
    each(py, ["absolute", "relative"], [absolute, relative], |absolute, relative| arms.left_right(absolute, relative))
}

/// Computes the mean of poses.
///
/// The position is the arithmetic mean, the rotation the Karcher mean, about which the rotation vectors add up to zero.
///
/// Parameters
/// ----------
/// poses : array_like, (..., 7)
///     Poses x, y, z, qw, qx, qy, qz, such as the relative poses of all demonstrations one after the other.
///
/// Returns
/// -------
/// ndarray, (7,)
///     Mean pose.
///
/// Raises
/// ------
/// ValueError
///     No pose, a number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a rotation of more
///     than 90 degrees from the mean.
#[pyfunction]
pub(crate) fn mean_pose<'py>(py: Python<'py>, poses: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
    let poses = checked("poses", array("poses", poses)?)?;
    let rows: Vec<Pose> = poses.rows().into_iter().map(row).collect();
    pdmp_core::motion::mean_pose(&rows).map(|mean| to_numpy(py, &mean)).map_err(raise)
}

fn about(reference: Option<&Bound<'_, PyAny>>) -> PyResult<TwoArms> {
    let Some(reference) = optional("reference", reference)? else { return Ok(TwoArms::default()) };
    let quaternion = reference.as_slice().try_into().map_err(|_| {
        let n = reference.len();
        PyValueError::new_err(format!("reference has {n} numbers: expected a unit quaternion qw, qx, qy, qz"))
    })?;
    TwoArms::about(quaternion).map_err(raise)
}

/// Checks that the last axis of an array has the seven numbers of a pose.
fn checked(name: &str, poses: ArrayD<f64>) -> PyResult<ArrayD<f64>> {
    if poses.shape().last() == Some(&7) {
        return Ok(poses);
    }
    let shape = poses.shape();
    let expected = "expected poses (..., 7) of x, y, z, qw, qx, qy, qz";
    Err(PyValueError::new_err(format!("{name} has shape {shape:?}: {expected}")))
}

fn row(pose: ArrayView1<'_, f64>) -> Pose {
    std::array::from_fn(|i| pose[i])
}

/// Converts pairs of poses.
fn each<'py>(
    py: Python<'py>,
    names: [&str; 2],
    poses: [&Bound<'py, PyAny>; 2],
    convert: impl Fn(&Pose, &Pose) -> Result<[Pose; 2], pdmp_core::Error>,
) -> PyResult<(Poses<'py>, Poses<'py>)> {
    let first = checked(names[0], array(names[0], poses[0])?)?;
    let second = checked(names[1], array(names[1], poses[1])?)?;
    let shape = if first.ndim() == 1 { second.shape() } else { first.shape() };
    let shape = IxDyn(shape);
    let (Some(a), Some(b)) = (first.broadcast(shape.clone()), second.broadcast(shape.clone())) else {
        let [name, other] = names;
        let (from, to) = (first.shape(), second.shape());
        return Err(PyValueError::new_err(format!(
            "{name} has shape {from:?} and {other} has shape {to:?}: expected one shape, or one pose (7,)"
        )));
    };
    let is_single = a.ndim() == 1;
    let mut results = [ArrayD::zeros(shape.clone()), ArrayD::zeros(shape.clone())];
    let [one, two] = &mut results;
    for (k, (((a, b), mut c), mut d)) in
        a.rows().into_iter().zip(b.rows()).zip(one.rows_mut()).zip(two.rows_mut()).enumerate()
    {
        let pair = convert(&row(a), &row(b)).map_err(|error| {
            let error = raise(error);
            if is_single { error } else { PyValueError::new_err(format!("row {k}: {}", error.value(py))) }
        })?;
        for (to, pose) in [&mut c, &mut d].into_iter().zip(pair) {
            to.assign(&ndarray::aview1(&pose));
        }
    }
    let [one, two] = results;
    Ok((one.into_pyarray(py), two.into_pyarray(py)))
}
