//! Demonstrations: recorded movements with checked shapes.

use ndarray::{Array2, ArrayView2};

use crate::error::{Error, Result};
pub use crate::validate::LARGEST;
use crate::validate::{check_matrix, check_number, check_positive, check_time, check_vector};

/// Fewest samples that carry a cubic spline with not-a-knot ends.
pub const LEAST_SAMPLES: usize = 4;

/// Longest name or unit of a DoF, in bytes.
const LONGEST_NAME: usize = 1000;

/// When the samples of a demonstration were taken.
#[derive(Clone, Debug, PartialEq)]
pub enum Sampling {
    /// At equal intervals, whose length the fit is told.
    Unknown,
    /// At equal intervals of `dt` seconds.
    Uniform {
        /// Sampling interval in seconds.
        dt: f64,
    },
    /// At the given times in seconds.
    Stamped {
        /// Strictly increasing time stamps, in seconds.
        time: Vec<f64>,
    },
}

/// One value of a context.
#[derive(Clone, Debug, PartialEq)]
pub enum ContextValue {
    /// A quantity, such as a height.
    Number(f64),
    /// A name, such as that of a style; no label is nearer to one than to another.
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
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    position: Array2<f64>,
    sampling: Sampling,
    goal: Option<Vec<f64>>,
    context: Option<Vec<ContextValue>>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
}

impl Demonstration {
    /// A movement of positions (T, D), in the unit of each degree of freedom.
    ///
    /// # Errors
    /// Fewer than four samples, no DoF, a number that is not finite or too large to be squared, an interval that is not
    /// positive, time stamps that do not increase or are not one per sample.
    pub fn new(position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        check_matrix("position", position.view())?;
        let (found, n_dofs) = position.dim();
        if n_dofs == 0 {
            return Err(Error::Arguments("position has no DoFs: pass an array of shape (T, D) with D of at least 1"));
        }
        if found < LEAST_SAMPLES {
            return Err(Error::Samples { found, least: LEAST_SAMPLES });
        }
        match &sampling {
            Sampling::Unknown => {}
            Sampling::Uniform { dt } => check_positive("dt", *dt)?,
            Sampling::Stamped { time } => check_time(time, found)?,
        }
        Ok(Self { position, sampling, goal: None, context: None, names: None, units: None })
    }

    /// Sets the point attractor of this movement (D,); without it, the last sample serves.
    ///
    /// # Errors
    /// A length other than D, or a number that is not finite.
    pub fn with_goal(mut self, goal: Vec<f64>) -> Result<Self> {
        check_vector("goal", &goal, self.n_dofs(), "DoF")?;
        self.goal = Some(goal);
        Ok(self)
    }

    /// Sets the condition under which this movement was made (Q,), such as an obstacle's height.
    ///
    /// # Errors
    /// No value, or a number that is not finite.
    pub fn with_context<V: Into<ContextValue>>(mut self, context: Vec<V>) -> Result<Self> {
        let context: Vec<ContextValue> = context.into_iter().map(Into::into).collect();
        check_context(&context)?;
        self.context = Some(context);
        Ok(self)
    }

    /// Names the degrees of freedom (D,).
    ///
    /// # Errors
    /// A number of names other than D, a name given twice, or one longer than 1000 bytes.
    pub fn with_names(mut self, names: Vec<String>) -> Result<Self> {
        if names.len() != self.n_dofs() {
            let (expected, found) = (self.n_dofs(), names.len());
            return Err(Error::Length { name: "names", expected, found, per: "DoF" });
        }
        if names.iter().enumerate().any(|(d, name)| names[..d].contains(name) || name.len() > LONGEST_NAME) {
            return Err(Error::Arguments("names must differ from each other and have at most 1000 bytes each"));
        }
        self.names = Some(names);
        Ok(self)
    }

    /// Sets the units of the degrees of freedom (D,), such as "rad"; "" where one is not known.
    ///
    /// # Errors
    /// A number of units other than D, or one longer than 1000 bytes.
    pub fn with_units(mut self, units: Vec<String>) -> Result<Self> {
        if units.len() != self.n_dofs() {
            let (expected, found) = (self.n_dofs(), units.len());
            return Err(Error::Length { name: "units", expected, found, per: "DoF" });
        }
        if units.iter().any(|unit| unit.len() > LONGEST_NAME) {
            return Err(Error::Arguments("units must have at most 1000 bytes each"));
        }
        self.units = Some(units);
        Ok(self)
    }

    /// The same movement with other samples: its labels, goal and context stay.
    ///
    /// # Errors
    /// As for [`Demonstration::new`].
    pub(crate) fn sampled(&self, position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        let Self { goal, context, names, units, .. } = self.clone();
        Ok(Self { goal, context, names, units, ..Self::new(position, sampling)? })
    }

    /// A part of the movement, which ends elsewhere: without the goal.
    pub(crate) fn part(&self, position: Array2<f64>, sampling: Sampling) -> Result<Self> {
        Ok(Self { goal: None, ..self.sampled(position, sampling)? })
    }

    /// Moves a degree of freedom, goal included, as when whole turns are taken off an angle.
    pub(crate) fn shift(&mut self, dof: usize, by: f64) {
        self.position.column_mut(dof).iter_mut().for_each(|y| *y += by);
        if let Some(goal) = &mut self.goal {
            goal[dof] += by;
        }
    }

    /// Positions (T, D).
    pub fn position(&self) -> ArrayView2<'_, f64> {
        self.position.view()
    }

    /// When the samples were taken.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// The point attractor given for this movement (D,).
    pub fn goal(&self) -> Option<&[f64]> {
        self.goal.as_deref()
    }

    /// The condition given for this movement (Q,).
    pub fn context(&self) -> Option<&[ContextValue]> {
        self.context.as_deref()
    }

    /// The names given to the degrees of freedom (D,).
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    /// The units given to the degrees of freedom (D,).
    pub fn units(&self) -> Option<&[String]> {
        self.units.as_deref()
    }

    /// Number of samples T.
    pub fn n_samples(&self) -> usize {
        self.position.nrows()
    }

    /// Number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.position.ncols()
    }
}

/// Checks that there are values, and that the numbers among them are finite.
pub(crate) fn check_context(context: &[ContextValue]) -> Result<()> {
    if context.is_empty() {
        return Err(Error::Arguments("context is empty: pass at least one value, or none at all"));
    }
    context.iter().enumerate().try_for_each(|(index, value)| match value {
        ContextValue::Number(number) => check_number("context", index, *number),
        ContextValue::Label(_) => Ok(()),
    })
}
