//! Demonstrations: recorded movements whose shapes and numbers are checked.

mod labels;
mod rotations;

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView2};

use crate::error::{Error, Result};
pub(crate) use labels::{check_labels, check_rotations};
pub(crate) use rotations::{MAX_NORM_DEVIATION, layout, points};
pub use rotations::{QuaternionOrder, RotationColumns};

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
