//! Poses of two arms as an absolute and a relative pose, and back.

use pdmp_core::Result;
use pdmp_core::motion::{Pose, TwoArms};

use crate::buffers::{pdmp_buffer, pdmp_text, pdmp_vector};
use crate::guard::guard_with_text;
use crate::status::pdmp_status;

/// Converts the poses of two arms to an absolute and a relative pose. With positions p and unit quaternions q of both arms,
///
///     r = q_left^-1 q_right          h = (1 + r) / |1 + r|, half of this rotation
///     absolute:  (p_left + p_right) / 2      q_left h
///     relative:  R(q_absolute)^T (p_right - p_left)      r
///
/// Poses are x, y, z, qw, qx, qy, qz. `reference` is a rotation q_left^-1 q_right of the task, as qw, qx, qy, qz: r is taken
/// with the sign on its side, which makes the absolute pose continuous except half a turn from it. `{NULL, 0}` is the identity,
/// which does not suit grippers that face each other.
///
/// This function does not allocate. Errors: PDMP_NULL, PDMP_LENGTH, PDMP_RANGE if a number is not finite, the norm of a
/// quaternion deviates from 1 by more than 1e-3, or r is more than 175 degrees from the reference.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_absolute_relative(
    left: pdmp_vector,
    right: pdmp_vector,
    reference: pdmp_vector,
    absolute: pdmp_buffer,
    relative: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let outputs = [("absolute", absolute), ("relative", relative)];
    // SAFETY: the contract of the C ABI covers all arguments.
    unsafe { convert([("left", left), ("right", right)], reference, outputs, error, TwoArms::absolute_relative) }
}

/// Converts an absolute and a relative pose to the poses of two arms, the inverse of pdmp_absolute_relative:
///
///     p_left, p_right = p_absolute -/+ R(q_absolute) p_relative / 2      q_left, q_right = q_absolute h^-1, q_absolute h
///
/// with h h = q_relative. Arguments and errors are as there; this function does not allocate either.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdmp_left_right(
    absolute: pdmp_vector,
    relative: pdmp_vector,
    reference: pdmp_vector,
    left: pdmp_buffer,
    right: pdmp_buffer,
    error: pdmp_text,
) -> pdmp_status {
    let inputs = [("absolute", absolute), ("relative", relative)];
    // SAFETY: the contract of the C ABI covers all arguments.
    unsafe { convert(inputs, reference, [("left", left), ("right", right)], error, TwoArms::left_right) }
}

/// Converts two poses to two others.
///
/// # Safety
/// Every pointer is NULL or valid over its length, and no buffer overlaps another argument.
unsafe fn convert(
    inputs: [(&'static str, pdmp_vector); 2],
    reference: pdmp_vector,
    outputs: [(&'static str, pdmp_buffer); 2],
    error: pdmp_text,
    by: impl FnOnce(&TwoArms, &Pose, &Pose) -> Result<[Pose; 2]>,
) -> pdmp_status {
    let call = || {
        let mut poses = [[0.0; 7]; 2];
        for ((name, numbers), pose) in inputs.into_iter().zip(&mut poses) {
            // SAFETY: this function has the same contract.
            pose.copy_from_slice(unsafe { numbers.require(name, 7, "component of a pose") }?);
        }
        // SAFETY: as above.
        let arms = match unsafe { reference.get("reference", 4, "component of a quaternion") }? {
            None => TwoArms::default(),
            Some(numbers) => TwoArms::about(std::array::from_fn(|i| numbers[i]))?,
        };
        for (name, buffer) in outputs {
            buffer.check(name, 7, "component of a pose")?;
        }
        let converted = by(&arms, &poses[0], &poses[1])?;
        for ((_, buffer), pose) in outputs.into_iter().zip(&converted) {
            // SAFETY: the buffer has been checked, and the caller guarantees its pointer.
            unsafe { buffer.write(pose) };
        }
        Ok(pdmp_status::PDMP_OK)
    };
    // SAFETY: the caller guarantees `error`.
    unsafe { guard_with_text(error, call) }
}
