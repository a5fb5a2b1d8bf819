//! Kinematic limits of a robot.

use crate::error::{Error, Result};

/// Limits of position, velocity and acceleration of each DoF; `None` or an infinite element is no limit.
///
/// ```
/// use pdmp_core::motion::Limits;
///
/// let limits = Limits { velocity: Some(vec![2.0, 1.5]), acceleration: Some(vec![8.0; 2]), ..Limits::default() };
/// assert!(limits.check(2).is_ok());
/// assert!(limits.check(3).is_err());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    /// Lower limits of the position (D,), in the unit of each DoF.
    pub lower: Option<Vec<f64>>,
    /// Upper limits of the position (D,), in the unit of each DoF.
    pub upper: Option<Vec<f64>>,
    /// Limits of |ẏ| (D,), per second.
    pub velocity: Option<Vec<f64>>,
    /// Limits of |ÿ| (D,), per second squared.
    pub acceleration: Option<Vec<f64>>,
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
}

impl Limits {
    /// Checks shapes and values for `n_dofs` DoFs.
    ///
    /// # Errors
    /// A wrong length, a lower limit that is not below the upper one, or a velocity or acceleration that is not positive.
    pub fn check(&self, n_dofs: usize) -> Result<()> {
        let vectors = [
            ("lower", &self.lower),
            ("upper", &self.upper),
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
        ];
        for (name, vector) in vectors {
            let Some(vector) = vector else { continue };
            if vector.len() != n_dofs {
                return Err(Error::Length { name, expected: n_dofs, found: vector.len(), per: "DoF" });
            }
            if let Some(index) = vector.iter().position(|limit| limit.is_nan()) {
                return Err(Error::NotFinite { name, index, value: vector[index] });
            }
            let positive = name == "velocity" || name == "acceleration";
            if let Some(&value) = vector.iter().find(|limit| positive && **limit <= 0.0) {
                return Err(Error::Range { name, value, allowed: "every limit must be positive; infinity is none" });
            }
        }
        let [lower, upper] = self.position(n_dofs);
        match lower.iter().zip(&upper).position(|(lower, upper)| lower >= upper) {
            Some(dof) => Err(Error::LimitOrder { dof, lower: lower[dof], upper: upper[dof] }),
            None => Ok(()),
        }
    }

    /// Returns the lower and upper limits of the position, infinite where there is none.
    pub(crate) fn position(&self, n_dofs: usize) -> [Vec<f64>; 2] {
        let limits = |limits: &Option<Vec<f64>>, none: f64| limits.clone().unwrap_or_else(|| vec![none; n_dofs]);
        [limits(&self.lower, f64::NEG_INFINITY), limits(&self.upper, f64::INFINITY)]
    }
}
