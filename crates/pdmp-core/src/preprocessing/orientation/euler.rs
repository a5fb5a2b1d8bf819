//! Euler angles of any sequence of axes.
//!
//! With the axes i, j, k of the rotations about fixed axes in their order, and s = ±1 the sign of the permutation (i, j, k),
//! where k is the third axis if i is repeated,
//!
//! ```text
//! q = e_k(θ₃) ⊗ e_j(θ₂) ⊗ e_i(θ₁),
//! repeated axis:  (a, b, c, d) = (w, q_i, q_j, s·q_k),
//! three axes:     (a, b, c, d) = (w − q_j, q_i + s·q_k, q_j + w, s·q_k − q_i),
//! θ₂ = 2·atan2(|(c, d)|, |(a, b)|),   half sum: atan2(b, a),   half difference: atan2(d, c).
//! ```
//!
//! Three axes take θ₂ − π/2 and s·θ₃. The difference is undefined where c = d = 0, the sum where a = b = 0: gimbal lock.
//! Rotations about moving axes are those about fixed axes in reverse order.
//!
//! E. Bernardes, S. Viollet, Quaternion to Euler angles conversion: a direct, general and computationally efficient method,
//! PLoS ONE 17, 2022, doi:10.1371/journal.pone.0276302.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ndarray::{Array2, ArrayView2, aview1};

use super::{read, written};
use crate::demonstration::QuaternionOrder;
use crate::error::{Error, Result};
use crate::numerics::rotation::{Quaternion, Vector, product};
use crate::validate::{check_length, check_matrix};

/// Angle in rad from gimbal lock within which the third angle is chosen.
const MAX_LOCK: f64 = 1e-7;

/// Sequence of the axes of Euler angles.
///
/// ```
/// use pdmp_core::preprocessing::orientation::EulerSequence;
///
/// assert!(EulerSequence::parse("ZYX").is_ok());
/// assert!(EulerSequence::parse("xxz").is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EulerSequence {
    axes: [usize; 3],
    moving: bool,
}

/// Euler angles along time.
#[derive(Clone, Debug, PartialEq)]
pub struct EulerAngles {
    /// Angles (T, 3) in rad, in the order of the sequence.
    pub angles: Array2<f64>,
    /// Samples in gimbal lock, where only the sum or the difference of the first and third angle is determined.
    pub locked: Vec<usize>,
}

impl EulerSequence {
    /// Returns the sequence of three letters: "xyz" rotates about the fixed axes x, then y, then z of the world (extrinsic),
    /// "XYZ" about the moving axes of the body (intrinsic).
    ///
    /// # Errors
    /// Other letters, capital and small ones mixed, or the same axis twice in succession.
    pub fn parse(text: &str) -> Result<Self> {
        let problem = "must have three of the axes xyz, about fixed axes, or XYZ, about moving axes, such as \"xyz\" or \
                       \"ZYX\", with no axis twice in succession";
        let wrong = Error::Argument { name: "sequence", problem };
        let moving = text.starts_with(|c: char| c.is_ascii_uppercase());
        let letters = if moving { "XYZ" } else { "xyz" };
        let axes: Option<Vec<usize>> = text.chars().map(|c| letters.find(c)).collect();
        match axes.as_deref() {
            Some(&[i, j, k]) if i != j && j != k => Ok(Self { axes: [i, j, k], moving }),
            _ => Err(wrong),
        }
    }

    /// Returns the rotation by angles in rad.
    fn rotation(self, angles: Vector) -> Quaternion {
        let turns: [Quaternion; 3] = std::array::from_fn(|n| {
            let (sine, cosine) = (0.5 * angles[n]).sin_cos();
            let mut q = [cosine, 0.0, 0.0, 0.0];
            q[1 + self.axes[n]] = sine;
            q
        });
        let [first, second, third] = turns;
        if self.moving { product(first, product(second, third)) } else { product(third, product(second, first)) }
    }

    /// Returns the angles in rad of a unit quaternion and their gimbal lock, where the third angle is that of `before`.
    fn angles(self, q: Quaternion, before: Vector) -> (Vector, bool) {
        let [mut i, j, mut k] = self.axes;
        if self.moving {
            (i, k) = (k, i);
        }
        let repeated = i == k;
        if repeated {
            k = 3 - i - j;
        }
        let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
        let (w, [x, y, z]) = (q[0], [q[1 + i], q[1 + j], sign * q[1 + k]]);
        let [a, b, c, d] = if repeated { [w, x, y, z] } else { [w - y, x + z, y + w, z - x] };
        let second = 2.0 * c.hypot(d).atan2(a.hypot(b));
        let (mut half_sum, mut half_difference) = (b.atan2(a), d.atan2(c));
        let (sign, offset) = if repeated { (1.0, 0.0) } else { (sign, FRAC_PI_2) };
        let locked = second <= MAX_LOCK || second >= PI - MAX_LOCK;
        if locked {
            // The angle about the first fixed axis is the difference, that about the third one the sum.
            let (third, known) = if self.moving { (before[2], -1.0) } else { (sign * before[2], 1.0) };
            if second <= MAX_LOCK {
                half_difference = known * (third - half_sum);
            } else {
                half_sum = third - known * half_difference;
            }
        }
        let (first, third) = (half_sum - half_difference, sign * (half_sum + half_difference));
        let angles = [first, second - offset, third];
        (if self.moving { [third, angles[1], first] } else { angles }, locked)
    }

    /// Returns the angles of the same rotation that are closest to others.
    fn nearest(self, angles: Vector, to: Vector) -> Vector {
        let mirrored = if self.axes[0] == self.axes[2] { -angles[1] } else { PI - angles[1] };
        let both = [angles, [angles[0] + PI, mirrored, angles[2] + PI]];
        let near = |angles: Vector| -> Vector {
            std::array::from_fn(|n| angles[n] - TAU * ((angles[n] - to[n]) / TAU).round())
        };
        let [a, b] = both.map(near);
        let off = |angles: Vector| (0..3).map(|n| (angles[n] - to[n]).powi(2)).sum::<f64>();
        if off(b) < off(a) { b } else { a }
    }
}

/// Converts Euler angles (T, 3) in rad to unit quaternions (T, 4).
///
/// ```
/// use pdmp_core::demonstration::QuaternionOrder;
/// use pdmp_core::preprocessing::orientation::{EulerSequence, euler_to_quaternions, quaternions_to_euler};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let (angles, sequence) = (ndarray::array![[0.1, 0.2, -0.3]], EulerSequence::parse("ZYX")?);
/// let quaternions = euler_to_quaternions(angles.view(), sequence, QuaternionOrder::Wxyz)?;
/// let again = quaternions_to_euler(quaternions.view(), sequence, QuaternionOrder::Wxyz)?;
/// assert!((again.angles - angles).iter().all(|difference| difference.abs() < 1e-15));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Rows without three angles, or a number that is not finite.
pub fn euler_to_quaternions(
    angles: ArrayView2<f64>,
    sequence: EulerSequence,
    order: QuaternionOrder,
) -> Result<Array2<f64>> {
    check_length("angles", angles.ncols(), 3, "axis of the sequence")?;
    check_matrix("angles", angles)?;
    Ok(written(angles.rows().into_iter().map(|row| sequence.rotation([row[0], row[1], row[2]])), order))
}

/// Converts unit quaternions (T, 4) to Euler angles (T, 3) in rad.
///
/// The first and third angle of the first sample lie within −π and π, the second within −π/2 and π/2 for three different axes,
/// 0 and π for a repeated one. The other samples have the angles closest to the sample before, so that they have no jumps.
/// Within 1e-7 rad of gimbal lock the third angle is that of the sample before, 0 at first; the rotation of the angles is
/// exact to 1e-7 rad there.
///
/// # Errors
/// As for [`super::quaternions_to_matrices`].
pub fn quaternions_to_euler(
    quaternions: ArrayView2<f64>,
    sequence: EulerSequence,
    order: QuaternionOrder,
) -> Result<EulerAngles> {
    let rotations = read("quaternions", quaternions, 0, order)?;
    let mut angles = Array2::zeros((rotations.len(), 3));
    let (mut before, mut locked) = ([0.0; 3], Vec::new());
    for (sample, (q, mut row)) in rotations.into_iter().zip(angles.rows_mut()).enumerate() {
        let (principal, is_locked) = sequence.angles(q, before);
        before = if sample == 0 {
            principal.map(|angle| angle - TAU * (angle / TAU).round())
        } else {
            sequence.nearest(principal, before)
        };
        row.assign(&aview1(&before));
        locked.extend(is_locked.then_some(sample));
    }
    Ok(EulerAngles { angles, locked })
}
