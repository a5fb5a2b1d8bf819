//! Difference of a demonstration from that of a fit.

use std::fmt;

use super::format::Rounded;

/// A quantity of a demonstration that differs from that of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The quantity: "duration" in seconds, "start", "goal", "anchor" or "style".
    pub name: &'static str,
    /// Index of its element, if it is a vector.
    pub index: Option<usize>,
    /// Its value of this demonstration.
    pub found: f64,
    /// Its value in the fit.
    pub expected: f64,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name)?;
        if let Some(index) = self.index {
            write!(f, "[{index}]")?;
        }
        write!(f, " is {} instead of {}", Rounded(self.found), Rounded(self.expected))
    }
}
