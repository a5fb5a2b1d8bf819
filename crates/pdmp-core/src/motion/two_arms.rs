//! Poses of two arms as an absolute and a relative pose, and back.
//!
//! With the positions p and unit quaternions q of the left and the right arm,
//!
//! ```text
//! r = q_L⁻¹ ⊗ q_R,     h = (1 + r)/|1 + r|,     h ⊗ h = r,
//! absolute:  p_A = (p_L + p_R)/2,   q_A = q_L ⊗ h,      relative:  p_r = R(q_A)ᵀ(p_R − p_L),   q_r = r,
//! p_L, p_R = p_A ∓ R(q_A)p_r/2,     q_L = q_A ⊗ h⁻¹,    q_R = q_A ⊗ h.
//! ```
//!
//! q_A is the midpoint of the geodesic from q_L to q_R. The pose of the right arm in the frame of the left one is R(h)p_r and
//! r: it depends on the relative pose alone, so that arms with a constant relative pose hold a rigid object.
//!
//! r and −r are the same rotation, but their midpoints differ by half a turn about its axis. The sign is that on the side of a
//! reference rotation. With the identity, the midpoint is that of the shorter geodesic, which is undefined for arms that are
//! half a turn apart, as grippers that face each other are; with a reference near the relative rotation of the task it is
//! undefined only half a turn from the reference.
//!
//! F. Caccavale, P. Chiacchio, S. Chiaverini, Task-space regulation of cooperative manipulators, Automatica 36, 2000.

use crate::demonstration::MAX_NORM_DEVIATION;
use crate::error::{Error, Result, RotationError};
use crate::numerics::rotation::{
    Quaternion, Vector, add_scaled, distance, dot, inverse, mean, normalised, on_side_of, product, rotate,
};
use crate::validate::check_vector;

/// Position x, y, z and unit quaternion w, x, y, z of a frame.
pub type Pose = [f64; 7];

/// Largest angle in degrees between a relative rotation and the reference: beyond, noise of some degrees could turn the
/// midpoint by half a turn.
const MAX_ANGLE: f64 = 175.0;
/// Largest angle in degrees between rotations and their mean, which is unique for rotations within half of a half turn.
const MAX_SPREAD: f64 = 90.0;

/// Conversion between the poses of two arms and an absolute and a relative pose.
///
/// ```
/// use pdmp_core::motion::TwoArms;
///
/// # fn main() -> pdmp_core::Result<()> {
/// // Grippers 0.4 m apart that face each other.
/// let left = [0.5, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0];
/// let right = [0.5, -0.2, 0.3, 0.0, 0.0, 0.0, 1.0];
/// let arms = TwoArms::about([0.0, 0.0, 0.0, 1.0])?;
/// let [absolute, relative] = arms.absolute_relative(&left, &right)?;
/// assert_eq!(absolute[..3], [0.5, 0.0, 0.3]);
/// let [again, _] = arms.left_right(&absolute, &relative)?;
/// assert!((0..7).all(|i| (again[i] - left[i]).abs() < 1e-15));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct TwoArms {
    reference: Quaternion,
}

impl Default for TwoArms {
    /// Returns the conversion by the shorter geodesic.
    fn default() -> Self {
        Self { reference: [1.0, 0.0, 0.0, 0.0] }
    }
}

impl TwoArms {
    /// Returns the conversion about a reference q_L⁻¹ ⊗ q_R, a unit quaternion w, x, y, z of either sign.
    ///
    /// # Errors
    /// A quaternion whose norm deviates from 1 by more than 1e-3, or a number that is not finite.
    pub fn about(reference: [f64; 4]) -> Result<Self> {
        // The hemisphere of a reference with w ≥ 0 does not contain −1, where h is undefined.
        Ok(Self { reference: on_side_of(unit("reference", &reference, 0)?, [1.0, 0.0, 0.0, 0.0]) })
    }

    /// Returns the absolute and the relative pose.
    ///
    /// # Errors
    /// A number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a relative rotation of more
    /// than 175° from the reference.
    pub fn absolute_relative(&self, left: &Pose, right: &Pose) -> Result<[Pose; 2]> {
        let (from, to) = (unit("left", left, 3)?, unit("right", right, 3)?);
        let relative = normalised(product(inverse(from), to));
        let (relative, half) = self.halved("right", relative)?;
        let absolute = normalised(product(from, half));
        let between = add_scaled(position(right), -1.0, position(left));
        let middle = add_scaled(position(left), 0.5, between);
        Ok([pose(middle, absolute), pose(rotate(inverse(absolute), between), relative)])
    }

    /// Returns the poses of the left and the right arm.
    ///
    /// # Errors
    /// As for [`TwoArms::absolute_relative`].
    pub fn left_right(&self, absolute: &Pose, relative: &Pose) -> Result<[Pose; 2]> {
        let middle = unit("absolute", absolute, 3)?;
        let (_, half) = self.halved("relative", unit("relative", relative, 3)?)?;
        let between = rotate(middle, position(relative));
        let turned = [inverse(half), half].map(|half| normalised(product(middle, half)));
        let [left, right] = [-0.5, 0.5].map(|side| add_scaled(position(absolute), side, between));
        Ok([pose(left, turned[0]), pose(right, turned[1])])
    }

    /// Returns a relative rotation on the side of the reference, and its half.
    fn halved(&self, name: &'static str, relative: Quaternion) -> Result<(Quaternion, Quaternion)> {
        let degrees = distance(self.reference, relative).to_degrees();
        if degrees > MAX_ANGLE {
            return Err(Error::Rotation(RotationError::OppositeArms { name, degrees, relative }));
        }
        let relative = on_side_of(relative, self.reference);
        Ok((relative, normalised(add_scaled(relative, 1.0, [1.0, 0.0, 0.0, 0.0]))))
    }
}

/// Returns the mean of poses: the arithmetic mean of the positions, and the Karcher mean of the rotations.
///
/// ```
/// use pdmp_core::motion::mean_pose;
///
/// # fn main() -> pdmp_core::Result<()> {
/// let turned = |angle: f64| [angle, 0.0, 0.0, (0.5 * angle).cos(), (0.5 * angle).sin(), 0.0, 0.0];
/// let mean = mean_pose(&[turned(0.1), turned(0.2), turned(0.6)])?;
/// assert!((0..7).all(|i| (mean[i] - turned(0.3)[i]).abs() < 1e-15));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// No pose, a number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a rotation of more than
/// 90° from the mean.
pub fn mean_pose(poses: &[Pose]) -> Result<Pose> {
    let rotations = poses.iter().map(|pose| unit("poses", pose, 3)).collect::<Result<Vec<_>>>()?;
    let &[first, ..] = &rotations[..] else {
        return Err(Error::Argument { name: "poses", problem: "is empty: a mean needs a pose" });
    };
    let weight = 1.0 / poses.len() as f64;
    // About the first pose, so that the mean of equal poses is that pose to the bit.
    let from = position(&poses[0]);
    let offset = poses.iter().fold([0.0; 3], |sum, each| add_scaled(sum, 1.0, add_scaled(position(each), -1.0, from)));
    let rotation = mean(first, rotations.iter().copied());
    if rotations.iter().any(|&q| distance(rotation, q).to_degrees() > MAX_SPREAD) {
        let problem = "has a rotation of more than 90 degrees from the mean, which is not unique then: average poses of one \
                       kind at a time";
        return Err(Error::Argument { name: "poses", problem });
    }
    Ok(pose(add_scaled(from, weight, offset), rotation))
}

fn position(pose: &Pose) -> Vector {
    [pose[0], pose[1], pose[2]]
}

fn pose([x, y, z]: Vector, [a, b, c, d]: Quaternion) -> Pose {
    [x, y, z, a, b, c, d]
}

/// Returns the quaternion that begins at a column with its norm made 1, and checks all numbers.
fn unit(name: &'static str, numbers: &[f64], column: usize) -> Result<Quaternion> {
    check_vector(name, numbers, numbers.len(), "coordinate")?;
    let q: Quaternion = std::array::from_fn(|i| numbers[column + i]);
    let norm = dot(q, q).sqrt();
    if (norm - 1.0).abs() <= MAX_NORM_DEVIATION {
        return Ok(q.map(|x| x / norm));
    }
    Err(Error::Rotation(RotationError::Norm { name, row: None, column, norm }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::rotation::{exp, log};
    use proptest::prelude::*;

    fn poses() -> impl Strategy<Value = Pose> {
        (prop::array::uniform3(-2.0..2.0), prop::array::uniform3(-3.0..3.0)).prop_map(|(p, delta)| pose(p, exp(delta)))
    }

    fn rotation(pose: &Pose) -> Quaternion {
        [pose[3], pose[4], pose[5], pose[6]]
    }

    /// Difference of positions and angle between rotations.
    fn gap(a: &Pose, b: &Pose) -> f64 {
        let apart = add_scaled(position(a), -1.0, position(b));
        dot(apart, apart).sqrt().max(distance(rotation(a), rotation(b)))
    }

    /// Pose of the right arm in the frame of the left one.
    fn grasp(left: &Pose, right: &Pose) -> Pose {
        let back = inverse(rotation(left));
        let between = add_scaled(position(right), -1.0, position(left));
        pose(rotate(back, between), product(back, rotation(right)))
    }

    proptest! {
        #[test]
        fn conversion_is_inverted_about_any_reference(left in poses(), right in poses(), about in poses()) {
            for arms in [TwoArms::default(), TwoArms::about(rotation(&about))?] {
                let Ok([absolute, relative]) = arms.absolute_relative(&left, &right) else { continue };
                let [again, other] = arms.left_right(&absolute, &relative)?;
                prop_assert!(gap(&left, &again) < 2e-14 && gap(&right, &other) < 2e-14);
                // Signs of quaternions have no effect on the rotations.
                let flipped = relative.map(|x| -x);
                let flipped = pose(position(&relative), rotation(&flipped));
                prop_assert!(gap(&arms.left_right(&absolute, &flipped)?[0], &left) < 2e-14);
            }
        }

        /// Equal angles from both arms, half of that between them for the shorter geodesic.
        #[test]
        fn absolute_rotation_is_the_midpoint(left in poses(), right in poses()) {
            let between = distance(rotation(&left), rotation(&right));
            match TwoArms::default().absolute_relative(&left, &right) {
                Ok([absolute, _]) => {
                    for arm in [&left, &right] {
                        prop_assert!((distance(rotation(&absolute), rotation(arm)) - 0.5 * between).abs() < 1e-13);
                    }
                }
                Err(_) => prop_assert!(between.to_degrees() > MAX_ANGLE),
            }
        }

        /// Arms with one relative pose hold one object, wherever the absolute pose is.
        #[test]
        fn grasp_depends_on_the_relative_pose_alone(relative in poses(), first in poses(), second in poses()) {
            let arms = TwoArms::about(rotation(&relative))?;
            let [a, b] = [first, second].map(|absolute| arms.left_right(&absolute, &relative));
            let ([left, right], [other_left, other_right]) = (a?, b?);
            prop_assert!(gap(&grasp(&left, &right), &grasp(&other_left, &other_right)) < 2e-14);
        }

        /// A motion of the world moves the absolute pose with it, and not the relative one.
        #[test]
        fn relative_pose_does_not_depend_on_the_world_frame(left in poses(), right in poses(), world in poses()) {
            let moved = |arm: &Pose| {
                let at = add_scaled(rotate(rotation(&world), position(arm)), 1.0, position(&world));
                pose(at, product(rotation(&world), rotation(arm)))
            };
            let arms = TwoArms::about(product(inverse(rotation(&left)), rotation(&right)))?;
            let [absolute, relative] = arms.absolute_relative(&left, &right)?;
            let [there, same] = arms.absolute_relative(&moved(&left), &moved(&right))?;
            prop_assert!(gap(&moved(&absolute), &there) < 1e-13 && gap(&relative, &same) < 1e-13);
        }
    }

    /// About a reference of half a turn, the absolute pose is smooth where that of the shorter geodesic turns round.
    #[test]
    fn absolute_pose_is_continuous_through_half_a_turn() {
        let arms = TwoArms::about(exp([0.0, 0.0, std::f64::consts::PI])).unwrap();
        let left = pose([0.0; 3], exp([0.2, 0.1, -0.4]));
        let at = |degrees: f64| {
            let turn = exp([0.0, 0.01, degrees.to_radians()]);
            arms.absolute_relative(&left, &pose([0.0; 3], product(rotation(&left), turn))).unwrap()[0]
        };
        for k in 0..400 {
            let degrees = 100.0 + 0.4 * f64::from(k);
            assert!(gap(&at(degrees), &at(degrees + 0.4)) < 0.0036);
        }
    }

    #[test]
    fn arms_half_a_turn_from_the_reference_are_refused() {
        let [left, right] = [[0.0; 3], [3.1, 0.0, 0.0]].map(|delta| pose([0.0; 3], exp(delta)));
        let text = TwoArms::default().absolute_relative(&left, &right).unwrap_err().to_string();
        assert!(text.contains("178 degrees") && text.contains("[0.021, 1.000, 0.000, 0.000]"), "{text}");
        assert!(TwoArms::about([0.02, 1.0, 0.0, 0.0]).unwrap().absolute_relative(&left, &right).is_ok());
    }

    /// The residual rotations about the mean add up to zero; poses too far apart have none.
    #[test]
    fn mean_pose_is_the_centre() {
        let spread = [[0.3, 0.1, 0.0], [-0.2, 0.4, 0.5], [0.1, -0.6, 0.2]];
        let poses = spread.map(|delta| pose(delta, product(exp([1.0, 2.0, -0.5]), exp(delta)).map(|x| -x)));
        let mean = mean_pose(&poses).unwrap();
        let residual = |each: &Pose| log(product(inverse(rotation(&mean)), rotation(each)));
        let sum = poses.iter().fold([0.0; 3], |sum, each| add_scaled(sum, 1.0, residual(each)));
        assert!(dot(sum, sum) < 1e-28);
        let expected = [0.2 / 3.0, -0.1 / 3.0, 0.7 / 3.0];
        assert!((0..3).all(|i| (mean[i] - expected[i]).abs() < 1e-15));
        let opposite = [[0.0; 3], [2.5, 0.0, 0.0], [-2.5, 0.0, 0.0]].map(|delta| pose([0.0; 3], exp(delta)));
        assert_eq!(mean_pose(&[poses[0]; 3]).unwrap()[..3], poses[0][..3]);
        assert!(mean_pose(&opposite).is_err() && mean_pose(&[]).is_err());
    }
}
