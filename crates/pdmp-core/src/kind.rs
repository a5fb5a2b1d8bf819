//! Kinds of movement.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Kind of a movement, which decides its canonical system.
///
/// ```
/// use pdmp_core::Kind;
///
/// assert_eq!(Kind::Rhythmic.name(), "rhythmic");
/// assert_eq!(Kind::Discrete.to_string(), "discrete");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A movement from a start to a goal.
    Discrete,
    /// A periodic movement about an anchor.
    Rhythmic,
}

impl Kind {
    /// Returns the name used in model files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Discrete => "discrete",
            Kind::Rhythmic => "rhythmic",
        }
    }

    /// Returns the number of samples that span `n_steps` sampling intervals: a rhythmic movement lacks the last sample,
    /// which is the first one of the next cycle.
    pub(crate) fn samples(self, n_steps: usize) -> usize {
        match self {
            Kind::Discrete => n_steps + 1,
            Kind::Rhythmic => n_steps,
        }
    }

    /// Returns the number of sampling intervals from the first of `n_samples` to the end of the movement or cycle, the
    /// inverse of [`Self::samples`].
    pub(crate) fn steps(self, n_samples: usize) -> usize {
        match self {
            Kind::Discrete => n_samples - 1,
            Kind::Rhythmic => n_samples,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}
