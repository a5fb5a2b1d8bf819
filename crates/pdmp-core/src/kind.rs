//! The kind of movement.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The kind of movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// From a start to a goal.
    Discrete,
    /// Around an anchor, periodically.
    Rhythmic,
}

impl Kind {
    /// The name used in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Discrete => "discrete",
            Kind::Rhythmic => "rhythmic",
        }
    }

    /// Samples that make so many intervals from the start to the end of the movement, or to the next cycle.
    pub(crate) fn samples(self, n_steps: usize) -> usize {
        match self {
            Kind::Discrete => n_steps + 1,
            Kind::Rhythmic => n_steps,
        }
    }

    /// Intervals from the first of `n_samples` to the end of the movement, or to the next cycle.
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
