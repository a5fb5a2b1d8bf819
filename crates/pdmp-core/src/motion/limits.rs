//! Kinematic limits of a robot.

use crate::error::{Error, LimitError, Result};
use crate::model::Primitive;
use crate::motion::angular::AngularLimits;
use crate::motion::rate_limits::{PathLimits, RateLimits};
use crate::numerics::simd::{F64x4, WIDTH, groups};
use crate::validate::MAX_MAGNITUDE;

/// Limits of position, velocity, acceleration and jerk: one number for all DoFs, or one for each. `None` or infinity is no limit.
///
/// The three DoFs of a rotation have equal limits Ω and A, in rad/s and rad/s², which bound the sizes of its angular velocity and
/// acceleration, |ω| ≤ Ω and |ω̇| ≤ A: they depend on no frame. Its position and jerk have no limits.
///
/// ```
/// use pdmp_core::motion::Limits;
///
/// let limits = Limits { velocity: Some(vec![2.0, 1.5]), acceleration: Some(vec![8.0]), ..Limits::default() };
/// assert!(limits.check(2).is_ok());
/// assert!(limits.check(3).is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Lower limits of the position (1,) or (D,), in the unit of each DoF.
    pub lower: Option<Vec<f64>>,
    /// Upper limits of the position (1,) or (D,), in the unit of each DoF.
    pub upper: Option<Vec<f64>>,
    /// Limits of |ẏ| (1,) or (D,), per second.
    pub velocity: Option<Vec<f64>>,
    /// Limits of |ÿ| (1,) or (D,), per second squared.
    pub acceleration: Option<Vec<f64>>,
    /// Limits of |dÿ/dt| (1,) or (D,), per second cubed, of DoFs whose acceleration has a limit.
    pub jerk: Option<Vec<f64>>,
    /// True, the default: what one DoF cannot follow slows all of them along the path. False: every DoF is limited on its own.
    pub synchronous: bool,
}

impl Default for Limits {
    fn default() -> Self {
        Self { lower: None, upper: None, velocity: None, acceleration: None, jerk: None, synchronous: true }
    }
}

/// Limit that determines the acceleration of a DoF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The lower or upper limit of the position: the DoF brakes in front of it, or rests on it.
    Position,
    /// The limit of the velocity.
    Velocity,
    /// The limit of the acceleration.
    Acceleration,
    /// The limit of the jerk.
    Jerk,
}

impl Limits {
    /// Checks shapes and values for `n_dofs` DoFs.
    ///
    /// # Errors
    /// A wrong length, a finite limit above 1e150 in magnitude, a lower limit that is not below the upper one, a velocity,
    /// acceleration or jerk that is not positive, or a limit of the jerk without one of the acceleration.
    pub fn check(&self, n_dofs: usize) -> Result<()> {
        if let (Some(lower), Some(upper)) = (&self.lower, &self.upper)
            && lower.len().min(upper.len()) > 1
            && lower.len() != upper.len()
        {
            let lengths = [lower.len(), upper.len()];
            return Err(Error::Limits(LimitError::PositionLengths { lengths }));
        }
        let vectors = [
            ("lower", &self.lower),
            ("upper", &self.upper),
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
            ("jerk", &self.jerk),
        ];
        for (name, vector) in vectors {
            let Some(vector) = vector else { continue };
            if vector.len() != 1 && vector.len() != n_dofs {
                return Err(Error::Length { name, expected: n_dofs, found: vector.len(), per: "DoF" });
            }
            if let Some(index) = vector.iter().position(|limit| limit.is_nan()) {
                return Err(Error::NotFinite { name, index, value: vector[index] });
            }
            let too_large = |limit: &f64| limit.is_finite() && limit.abs() > MAX_MAGNITUDE;
            if let Some(index) = vector.iter().position(too_large) {
                return Err(Error::TooLarge { name, index, value: vector[index], limit: MAX_MAGNITUDE });
            }
            let positive = name != "lower" && name != "upper";
            if let Some(&value) = vector.iter().find(|limit| positive && **limit <= 0.0) {
                return Err(Error::Range { name, value, allowed: "every limit must be positive; infinity is none" });
            }
        }
        (0..n_dofs).try_for_each(|dof| {
            let lower = limit_of_dof(&self.lower, dof, f64::NEG_INFINITY);
            let upper = limit_of_dof(&self.upper, dof, f64::INFINITY);
            let [acceleration, jerk] =
                [&self.acceleration, &self.jerk].map(|limits| limit_of_dof(limits, dof, f64::INFINITY));
            if jerk.is_finite() && !acceleration.is_finite() {
                return Err(Error::Limits(LimitError::JerkAlone { dof, jerk }));
            }
            if lower < upper { Ok(()) } else { Err(Error::Limits(LimitError::Order { dof, lower, upper })) }
        })
    }

    /// Checks limits for a primitive: those of a rotation bound the sizes of its angular velocity and acceleration.
    ///
    /// # Errors
    /// As for [`Limits::check`], a limit of the position or jerk of a rotation, or different limits of its three DoFs.
    pub(crate) fn check_rotations(&self, primitive: &Primitive) -> Result<()> {
        self.check(primitive.n_dofs())?;
        for first in primitive.rotation_dofs() {
            let refused = [("position", &self.lower), ("position", &self.upper), ("jerk", &self.jerk)];
            for (dof, (quantity, limits)) in (first..first + 3).flat_map(|dof| refused.map(|refused| (dof, refused))) {
                if limit_of_dof(limits, dof, f64::INFINITY).is_finite() {
                    return Err(Error::Limits(LimitError::OfRotation { dof, quantity }));
                }
            }
            for (quantity, limits) in [("velocity", &self.velocity), ("acceleration", &self.acceleration)] {
                let limit = |dof: usize| limit_of_dof(limits, dof, f64::INFINITY);
                if let Some(dof) = (first + 1..first + 3).find(|&dof| limit(dof) != limit(first)) {
                    let (limit, expected) = (limit(dof), limit(first));
                    return Err(Error::Limits(LimitError::UnequalOfRotation { dof, first, quantity, limit, expected }));
                }
            }
        }
        Ok(())
    }

    /// Returns whether a rotation has limits.
    pub(crate) fn bound_rotations(&self, primitive: &Primitive) -> bool {
        primitive.rotation_dofs().any(|dof| self.of_rotation(dof).are_finite())
    }

    /// Returns the limits of the rotation whose first DoF is given.
    pub(crate) fn of_rotation(&self, dof: usize) -> AngularLimits {
        let [velocity, acceleration] =
            [&self.velocity, &self.acceleration].map(|limits| limit_of_dof(limits, dof, f64::INFINITY));
        AngularLimits { velocity, acceleration }
    }

    /// Returns the limits with none for the DoFs of rotations.
    pub(crate) fn of_plain_dofs(&self, primitive: &Primitive) -> Self {
        let mut plain = self.clone();
        for limits in [&mut plain.velocity, &mut plain.acceleration].into_iter().flatten() {
            if let [limit] = limits[..] {
                limits.resize(primitive.n_dofs(), limit);
            }
            primitive.rotation_dofs().for_each(|first| limits[first..first + 3].fill(f64::INFINITY));
        }
        plain
    }

    /// Returns the lower and upper limits of the position, infinite where there is none.
    pub(crate) fn position(&self, n_dofs: usize) -> [Vec<f64>; 2] {
        [of_dofs(&self.lower, f64::NEG_INFINITY, n_dofs), of_dofs(&self.upper, f64::INFINITY, n_dofs)]
    }

    /// Returns the limits of velocity and acceleration along a path, infinite where there is none.
    pub(crate) fn along_path(&self, primitive: &Primitive) -> PathLimits {
        let rotations = primitive.rotation_dofs().map(|first| self.of_rotation(first)).collect();
        PathLimits { groups: self.of_plain_dofs(primitive).rates(primitive.n_dofs()), rotations }
    }

    /// Returns the limits of velocity and acceleration by groups, infinite where there is none.
    fn rates(&self, n_dofs: usize) -> Vec<RateLimits> {
        let lanes = |limits: &Option<Vec<f64>>, group: usize| {
            F64x4::new(std::array::from_fn(|lane| {
                let dof = group * WIDTH + lane;
                if dof < n_dofs { limit_of_dof(limits, dof, f64::INFINITY) } else { f64::INFINITY }
            }))
        };
        let of_group = |group| RateLimits::new(lanes(&self.velocity, group), lanes(&self.acceleration, group));
        (0..groups(n_dofs)).map(of_group).collect()
    }

    /// Returns whether a velocity or an acceleration is limited.
    pub(crate) fn bound_rates(&self, n_dofs: usize) -> bool {
        let finite = |limits| (0..n_dofs).any(|dof| limit_of_dof(limits, dof, f64::INFINITY).is_finite());
        finite(&self.velocity) || finite(&self.acceleration)
    }
}

/// Returns the limit of one DoF, `none` if there is none.
pub(crate) fn limit_of_dof(limits: &Option<Vec<f64>>, dof: usize, none: f64) -> f64 {
    match limits.as_deref() {
        None => none,
        Some([limit]) => *limit,
        Some(limits) => limits[dof],
    }
}

/// Returns limits by DoFs.
fn of_dofs(limits: &Option<Vec<f64>>, none: f64, n_dofs: usize) -> Vec<f64> {
    (0..n_dofs).map(|dof| limit_of_dof(limits, dof, none)).collect()
}
