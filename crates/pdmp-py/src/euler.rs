//! Conversions of Euler angles.

use pdmp_core::preprocessing::orientation::{self, EulerSequence};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::choice::Choice;
use crate::convert::quoted;
use crate::orientation::{AngleUnit, Numbers, ORDERS, Samples, UNITS};

/// Converts Euler angles to unit quaternions.
///
/// Parameters
/// ----------
/// angles : array_like, (T, 3) or (3,)
///     Angles along time, or one triple, in the order of the sequence.
/// sequence : str
///     Axes of the three rotations in their order: small letters such as "xyz" for the fixed axes of the world (extrinsic),
///     capital letters such as "ZYX" for the moving axes of the body (intrinsic), as in SciPy. Roll, pitch and yaw are
///     usually "xyz" in this order.
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
///     Another shape, a number that is not finite, or a sequence with other letters, capital and small ones, or one axis
///     twice in succession.
///
/// Examples
/// --------
/// >>> angles = [90, 0, 0]
/// >>> pdmp.preprocessing.euler_to_quaternions(angles, "ZYX", unit="deg", order="wxyz").round(4).tolist()
/// [0.7071, 0.0, 0.0, 0.7071]
#[pyfunction]
#[pyo3(signature = (angles, sequence, *, unit, order))]
pub(crate) fn euler_to_quaternions<'py>(
    py: Python<'py>,
    angles: &Bound<'_, PyAny>,
    sequence: &Bound<'_, PyAny>,
    unit: Choice<'_>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (angles, sequence) = (Samples::of_angles(angles, &[3], unit)?, sequence_of(sequence)?);
    let order = order.of("order", &ORDERS)?;
    angles.map(py, |angles| orientation::euler_to_quaternions(angles, sequence, order))
}

/// Converts unit quaternions to Euler angles.
///
/// The first and third angle of the first sample lie within ±180°, the second within ±90° for three different axes, 0° and
/// 180° for a repeated one. The other samples have the angles closest to the sample before, so that they have no jumps.
///
/// In gimbal lock, at the bounds of the second angle, only the sum or the difference of the others is determined. Within
/// 1e-7 rad of it the third angle is that of the sample before, 0 at first; near it small rotations are large changes of
/// angles.
///
/// Parameters
/// ----------
/// quaternions : array_like, (T, 4) or (4,)
///     Unit quaternions along time, or one.
/// sequence : str
///     Sequence of the axes, as for `euler_to_quaternions`.
/// unit : {"rad", "deg"}
///     Unit of the angles.
/// order : {"wxyz", "xyzw"}
///     Order of the components.
///
/// Returns
/// -------
/// ndarray, (T, 3) or (3,)
///
/// Raises
/// ------
/// ValueError
///     As for `quaternions_to_matrices` and the sequence of `euler_to_quaternions`.
///
/// Warns
/// -----
/// UserWarning
///     Samples in gimbal lock.
#[pyfunction]
#[pyo3(signature = (quaternions, sequence, *, unit, order))]
pub(crate) fn quaternions_to_euler<'py>(
    py: Python<'py>,
    quaternions: &Bound<'_, PyAny>,
    sequence: &Bound<'_, PyAny>,
    unit: Choice<'_>,
    order: Choice<'_>,
) -> PyResult<Numbers<'py>> {
    let (quaternions, sequence) = (Samples::of("quaternions", quaternions, &[4])?, sequence_of(sequence)?);
    let (unit, order) = (unit.of("unit", &UNITS)?, order.of("order", &ORDERS)?);
    let mut locked = Vec::new();
    let angles = quaternions.map(py, |quaternions| {
        let mut euler = orientation::quaternions_to_euler(quaternions, sequence, order)?;
        locked = euler.locked;
        if matches!(unit, AngleUnit::Degree) {
            euler.angles.mapv_inplace(f64::to_degrees);
        }
        Ok(euler.angles)
    })?;
    if let Some(first) = locked.first() {
        let n = locked.len();
        let text = format!(
            "gimbal lock in {n} sample{}, first in sample {first}: the third angle is that of the sample before; choose a \
             sequence whose second angle stays away from its bounds",
            if n == 1 { "" } else { "s" }
        );
        crate::error::warn(py, &text)?;
    }
    Ok(angles)
}

fn sequence_of(sequence: &Bound<'_, PyAny>) -> PyResult<EulerSequence> {
    let text = sequence.extract::<String>().unwrap_or_default();
    EulerSequence::parse(&text).map_err(|error| PyValueError::new_err(format!("{error}; found {}", quoted(sequence))))
}
