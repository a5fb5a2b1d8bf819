//! Errors in one of several movements, and labels of demonstrations that differ.

use super::Error;
use super::format::Rounded;

/// Error in one of several movements that are computed together.
#[derive(Debug, thiserror::Error)]
#[error("movement {movement}: {source}")]
pub struct MovementError {
    /// Index of the movement, from 0.
    pub movement: usize,
    /// Its error.
    pub source: Error,
}

/// Names, units, rotations or numbers that differ from those of other demonstrations, of a model or of a fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name}{} = {found}, but {of} has {expected}: {remedy}", index.map_or(String::new(), |index| format!("[{index}]")))]
pub struct Mismatch {
    /// The argument.
    pub name: &'static str,
    /// Index of the first element that differs, of a list.
    pub index: Option<usize>,
    /// The value found.
    pub found: String,
    /// The other one.
    pub expected: String,
    /// The owner of the other one.
    pub of: String,
    /// The remedy, as the end of the sentence.
    pub remedy: &'static str,
}

impl Error {
    /// Returns the error of a number of a demonstration that differs from that of the fit.
    pub(crate) fn other_demonstration(name: &'static str, index: Option<usize>, [found, expected]: [f64; 2]) -> Self {
        let [found, expected] = [found, expected].map(|x| Rounded(x).to_string());
        let remedy = "pass the demonstrations of the fit, in their order and unit";
        Self::Mismatch(Box::new(Mismatch { name, index, found, expected, of: "the fit".into(), remedy }))
    }

    /// Names the movement in which this error arose.
    pub(crate) fn in_movement(self, movement: usize) -> Self {
        Self::Movement(Box::new(MovementError { movement, source: self }))
    }
}
