//! Demonstrations: recorded movements whose shapes and numbers are checked.

use std::f64::consts::TAU;
use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::numerics::rotation::{Quaternion, dot, normalised, on_side_of};
pub use crate::validate::MAX_MAGNITUDE;
use crate::validate::{
    MAX_NAME_LENGTH, check_length, check_matrix, check_names, check_number, check_positive, check_time, check_vector,
};

/// Minimum number of samples of a demonstration: a cubic spline with not-a-knot ends needs four.
pub const MIN_SAMPLES_PER_DEMONSTRATION: usize = 4;

/// Sampling times of a demonstration.
#[derive(Clone, Debug, PartialEq)]
pub enum Sampling {
    /// Equal intervals of unknown length; the fit options state it.
    Unknown,
    /// Equal intervals.
    Uniform {
        /// Sampling interval in seconds.
        dt: f64,
    },
    /// Individual times.
    Stamped {
        /// Strictly increasing time stamps, in seconds.
        time: Vec<f64>,
    },
}

/// Order of the components of a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QuaternionOrder {
    /// Scalar part first.
    Wxyz,
    /// Scalar part last.
    Xyzw,
}

/// Four columns that are a unit quaternion, which rotates from the body frame to the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationColumns {
    /// First of the four columns.
    pub column: usize,
    /// Order of the components.
    pub order: QuaternionOrder,
}

/// Largest deviation of the norm of a quaternion from 1: rounding to three digits is mended, other data are not a rotation.
pub(crate) const MAX_NORM_DEVIATION: f64 = 1e-3;

impl RotationColumns {
    /// Returns the quaternion [w, x, y, z] in a row of coordinates.
    #[inline]
    pub(crate) fn read(self, coordinates: &[f64]) -> Quaternion {
        let [a, b, c, d] = std::array::from_fn(|i| coordinates[self.column + i]);
        match self.order {
            QuaternionOrder::Wxyz => [a, b, c, d],
            QuaternionOrder::Xyzw => [d, a, b, c],
        }
    }

    /// Writes a quaternion [w, x, y, z] to a row of coordinates.
    #[inline]
    pub(crate) fn write(self, [w, x, y, z]: Quaternion, coordinates: &mut [f64]) {
        coordinates[self.column..self.column + 4].copy_from_slice(&match self.order {
            QuaternionOrder::Wxyz => [w, x, y, z],
            QuaternionOrder::Xyzw => [x, y, z, w],
        });
    }

    /// Returns the columns of x, y and z.
    pub(crate) fn vector_columns(self) -> [usize; 3] {
        let first = self.column + usize::from(self.order == QuaternionOrder::Wxyz);
        [first, first + 1, first + 2]
    }

    /// Returns the quaternion [w, x, y, z] of a row with its norm made 1.
    ///
    /// # Errors
    /// A norm that deviates from 1 by more than 1e-3.
    pub(crate) fn unit(self, name: &'static str, row: Option<usize>, coordinates: &[f64]) -> Result<Quaternion> {
        let q = self.read(coordinates);
        let norm = dot(q, q).sqrt();
        if (norm - 1.0).abs() <= MAX_NORM_DEVIATION {
            return Ok(q.map(|x| x / norm));
        }
        Err(Error::Quaternion { name, row, column: self.column, norm })
    }
}

/// One value of a context.
///
/// ```
/// use pdmp_core::demonstration::ContextValue;
///
/// assert_eq!(ContextValue::from(0.3), ContextValue::Number(0.3));
/// assert_eq!(ContextValue::from("cup"), ContextValue::Label("cup".to_string()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum ContextValue {
    /// A quantity, such as a height.
    Number(f64),
    /// A category, such as the kind of an object; all labels are equally distant from each other.
    Label(String),
}

impl From<f64> for ContextValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&str> for ContextValue {
    fn from(label: &str) -> Self {
        Self::Label(label.to_string())
    }
}

impl From<String> for ContextValue {
    fn from(label: String) -> Self {
        Self::Label(label)
    }
}

/// One recorded movement.
///
/// ```
/// use ndarray::Array2;
/// use pdmp_core::{Demonstration, Sampling};
///
/// # fn main() -> pdmp_core::Result<()> {
/// let position = Array2::from_shape_fn((101, 1), |(c, _)| (c as f64 / 100.0).powi(2));
/// let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?
///     .with_context(vec![0.3])?
///     .with_names(vec!["height".to_string()])?
///     .with_units(vec!["m".to_string()])?;
/// assert_eq!((demo.n_samples(), demo.n_dofs()), (101, 1));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    position: Array2<f64>,
    sampling: Sampling,
    goal: Option<Vec<f64>>,
    context: Option<Vec<ContextValue>>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
    rotations: Vec<RotationColumns>,
}

impl Demonstration {
    /// Creates a demonstration from positions (T, D), in the unit of each degree of freedom.
    ///
    /// # Errors
    /// Fewer than [`MIN_SAMPLES_PER_DEMONSTRATION`] samples, no DoF, a number that is not finite or exceeds [`MAX_MAGNITUDE`],
    /// an interval that is not positive, time stamps that do not increase, or a number of time stamps other than T.
    pub fn new(position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        check_matrix("position", position.view())?;
        let (found, n_dofs) = position.dim();
        if n_dofs == 0 {
            return Err(Error::Argument {
                name: "position",
                problem: "has no DoFs: pass an array of shape (T, D) with D of at least 1",
            });
        }
        if found < MIN_SAMPLES_PER_DEMONSTRATION {
            return Err(Error::Samples { found, least: MIN_SAMPLES_PER_DEMONSTRATION });
        }
        match &sampling {
            Sampling::Unknown => {}
            Sampling::Uniform { dt } => check_positive("dt", *dt)?,
            Sampling::Stamped { time } => check_time(time, found)?,
        }
        Ok(Self { position, sampling, goal: None, context: None, names: None, units: None, rotations: Vec::new() })
    }

    /// Sets the goal of this movement (D,). The default is the last sample.
    ///
    /// ```
    /// # use ndarray::Array2;
    /// # use pdmp_core::{Demonstration, Sampling};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let position = Array2::from_shape_fn((50, 1), |(c, _)| c as f64 / 50.0);
    /// // The recording stops short of the target.
    /// let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?.with_goal(vec![1.0])?;
    /// assert_eq!(demo.goal(), Some(&[1.0][..]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A length other than D, or a number that is not finite or exceeds [`MAX_MAGNITUDE`].
    pub fn with_goal(mut self, goal: Vec<f64>) -> Result<Self> {
        check_vector("goal", &goal, self.n_coordinates(), self.per())?;
        self.goal = Some(goal);
        self.unit_goal()
    }

    /// Declares columns that are unit quaternions. Their norms become 1, and their signs continuous along time.
    ///
    /// ```
    /// # use ndarray::Array2;
    /// # use pdmp_core::{Demonstration, Sampling};
    /// use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
    ///
    /// # fn main() -> pdmp_core::Result<()> {
    /// // Height, and a turn about the vertical axis.
    /// let position = Array2::from_shape_fn((50, 5), |(c, d)| match d {
    ///     0 => c as f64 / 50.0,
    ///     1 => (0.01 * c as f64).cos(),
    ///     4 => (0.01 * c as f64).sin(),
    ///     _ => 0.0,
    /// });
    /// let rotation = RotationColumns { column: 1, order: QuaternionOrder::Wxyz };
    /// let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?.with_rotations(vec![rotation])?;
    /// assert_eq!((demo.n_coordinates(), demo.n_dofs()), (5, 4));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Columns that do not exist or overlap, or a quaternion in the positions or the goal whose norm deviates from 1 by more
    /// than 1e-3.
    pub fn with_rotations(mut self, mut rotations: Vec<RotationColumns>) -> Result<Self> {
        rotations.sort_by_key(|rotation| rotation.column);
        let n = self.n_coordinates();
        if let Some(last) = rotations.last().filter(|last| last.column.saturating_add(4) > n) {
            let allowed = "must leave room for the four columns of a quaternion";
            return Err(Error::Range { name: "rotations", value: last.column as f64, allowed });
        }
        if let Some(pair) = rotations.windows(2).find(|pair| pair[0].column + 4 > pair[1].column) {
            let allowed = "is a column of the rotation before it: each has four columns of its own";
            return Err(Error::Range { name: "rotations", value: pair[1].column as f64, allowed });
        }
        for rotation in &rotations {
            let mut before: Option<Quaternion> = None;
            for (c, mut row) in self.position.rows_mut().into_iter().enumerate() {
                let mut coordinates = row.to_vec();
                let unit = rotation.unit("position", Some(c), &coordinates)?;
                let q = before.map_or(unit, |before| on_side_of(unit, before));
                rotation.write(q, &mut coordinates);
                row.assign(&ndarray::aview1(&coordinates));
                before = Some(q);
            }
        }
        self.rotations = rotations;
        self.unit_goal()
    }

    /// Makes the norms of the quaternions of the goal 1.
    fn unit_goal(mut self) -> Result<Self> {
        if let Some(goal) = &mut self.goal {
            for rotation in &self.rotations {
                let q = rotation.unit("goal", None, goal)?;
                rotation.write(q, goal);
            }
        }
        Ok(self)
    }

    /// Returns the owner of one column in an error text.
    fn per(&self) -> &'static str {
        if self.rotations.is_empty() { "DoF" } else { "coordinate" }
    }

    /// Sets the context in which this movement was recorded (Q,), such as the height of an obstacle.
    ///
    /// # Errors
    /// No value, or a number that is not finite or exceeds [`MAX_MAGNITUDE`].
    pub fn with_context<V: Into<ContextValue>>(mut self, context: Vec<V>) -> Result<Self> {
        let context: Vec<ContextValue> = context.into_iter().map(Into::into).collect();
        check_context(&context)?;
        self.context = Some(context);
        Ok(self)
    }

    /// Sets the names of the degrees of freedom (D,).
    ///
    /// # Errors
    /// A number of names other than D, a repeated name, or one longer than 1000 bytes.
    pub fn with_names(mut self, names: Vec<String>) -> Result<Self> {
        check_names("names", &names, self.n_coordinates(), self.per())?;
        self.names = Some(names);
        Ok(self)
    }

    /// Sets the units of the degrees of freedom (D,), such as "rad"; an unknown unit is "".
    ///
    /// # Errors
    /// A number of units other than D, or one longer than 1000 bytes.
    pub fn with_units(mut self, units: Vec<String>) -> Result<Self> {
        check_length("units", units.len(), self.n_coordinates(), self.per())?;
        if units.iter().any(|unit| unit.len() > MAX_NAME_LENGTH) {
            return Err(Error::Argument { name: "units", problem: "must have at most 1000 bytes each" });
        }
        self.units = Some(units);
        Ok(self)
    }

    /// Returns the movement with other samples; goal, context, names, units and rotations are kept. Quaternions that were
    /// interpolated or filtered by components are normalised.
    ///
    /// # Errors
    /// As for [`Demonstration::new`], or a quaternion that is nearly zero.
    pub(crate) fn sampled(&self, mut position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        /// Components whose signs are continuous have this norm between samples a third of a turn apart.
        const MIN_NORM: f64 = 0.5;
        for rotation in &self.rotations {
            for (c, mut row) in position.rows_mut().into_iter().enumerate() {
                let mut coordinates = row.to_vec();
                let q = rotation.read(&coordinates);
                let norm = dot(q, q).sqrt();
                if !(norm > MIN_NORM) {
                    return Err(Error::Quaternion { name: "position", row: Some(c), column: rotation.column, norm });
                }
                rotation.write(normalised(q), &mut coordinates);
                row.assign(&ndarray::aview1(&coordinates));
            }
        }
        let Self { goal, context, names, units, rotations, .. } = self.clone();
        Ok(Self { goal, context, names, units, rotations, ..Self::new(position, sampling)? })
    }

    /// Returns a part of the movement, without the goal, which is the end of the whole.
    pub(crate) fn part(&self, position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        Ok(Self { goal: None, ..self.sampled(position, sampling)? })
    }

    /// Adds an offset to the positions and the goal of a degree of freedom.
    pub(crate) fn shift(&mut self, dof: usize, offset: f64) {
        self.position.column_mut(dof).iter_mut().for_each(|y| *y += offset);
        if let Some(goal) = &mut self.goal {
            goal[dof] += offset;
        }
    }

    /// Returns the positions (T, D), in the unit of each degree of freedom.
    pub fn position(&self) -> ArrayView2<'_, f64> {
        self.position.view()
    }

    /// Returns the sampling times.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Returns the goal (D,), if one was set.
    pub fn goal(&self) -> Option<&[f64]> {
        self.goal.as_deref()
    }

    /// Returns the context (Q,), if one was set.
    pub fn context(&self) -> Option<&[ContextValue]> {
        self.context.as_deref()
    }

    /// Returns the names of the degrees of freedom (D,), if they were set.
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    /// Returns the units of the degrees of freedom (D,), if they were set.
    pub fn units(&self) -> Option<&[String]> {
        self.units.as_deref()
    }

    /// Returns the number of samples T.
    pub fn n_samples(&self) -> usize {
        self.position.nrows()
    }

    /// Returns the columns of each rotation, whose components belong together.
    pub(crate) fn quaternion_columns(&self) -> Vec<Range<usize>> {
        self.rotations.iter().map(|rotation| rotation.column..rotation.column + 4).collect()
    }

    /// Returns the columns that are unit quaternions, in increasing order.
    pub fn rotations(&self) -> &[RotationColumns] {
        &self.rotations
    }

    /// Returns the number of coordinates, the columns of the positions.
    pub fn n_coordinates(&self) -> usize {
        self.position.ncols()
    }

    /// Returns the number of degrees of freedom D: a rotation has three, and four coordinates.
    pub fn n_dofs(&self) -> usize {
        self.position.ncols() - self.rotations.len()
    }
}

/// Checks that a context has a value and that its numbers are finite.
pub(crate) fn check_context(context: &[ContextValue]) -> Result<()> {
    if context.is_empty() {
        return Err(Error::Argument { name: "context", problem: "is empty: pass at least one value, or omit it" });
    }
    context.iter().enumerate().try_for_each(|(index, value)| match value {
        ContextValue::Number(number) => check_number("context", index, *number),
        ContextValue::Label(_) => Ok(()),
    })
}

/// Returns a full turn in a unit of angles; `None` for other units.
///
/// ```
/// use pdmp_core::demonstration::turn_of;
///
/// assert_eq!(turn_of("deg"), Some(360.0));
/// assert_eq!(turn_of("m"), None);
/// ```
pub fn turn_of(unit: &str) -> Option<f64> {
    match unit.trim() {
        "rad" | "radian" | "radians" => Some(TAU),
        "deg" | "degree" | "degrees" | "°" => Some(360.0),
        _ => None,
    }
}
