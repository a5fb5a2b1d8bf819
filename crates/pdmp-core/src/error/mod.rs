//! The error type of the crate.
//!
//! Every variant carries the argument, the numbers and the remedy; [`Error::kind`] groups them by the caller's next step.
//! Texts belong to no programming language: a binding appends its own hints. Errors of the control loop hold nothing that
//! allocates.

mod classification;
mod format;
mod limits;
mod located;
mod rotations;

use std::path::PathBuf;

use crate::kind::Kind;
pub use classification::ErrorKind;
use format::{Column, Count, Gap, Number, Rounded, Times};
pub use {limits::LimitError, located::Mismatch, located::MovementError, rotations::RotationError};

/// Any error of this crate.
///
/// ```
/// use pdmp_core::{Demonstration, ErrorKind, Sampling};
///
/// let error = Demonstration::new(ndarray::Array2::zeros((2, 1)), Sampling::Unknown).unwrap_err();
/// assert_eq!(error.kind(), ErrorKind::Data);
/// assert_eq!(error.to_string(), "position has 2 samples: at least 4 are needed; record at a higher rate");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error in one of several demonstrations.
    #[error("demo {demo}: {source}")]
    Demo {
        /// Index of the demonstration, from 0.
        demo: usize,
        /// Its error.
        source: Box<Error>,
    },
    /// An error in one of several movements.
    #[error(transparent)]
    Movement(Box<MovementError>),
    /// Labels that differ from those of other demonstrations or of a model.
    #[error(transparent)]
    Mismatch(Box<Mismatch>),
    /// An element of a vector is NaN or infinite.
    #[error("{name}[{index}] = {}: every number must be finite", Number(*value))]
    NotFinite {
        /// The argument.
        name: &'static str,
        /// Index of the element.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// An element of a matrix is NaN or infinite.
    #[error(
        "{name}[{row}, {column}] = {value}: every number must be finite; \
         fill the gap or cut the row out first"
    )]
    NotFiniteAt {
        /// The argument.
        name: &'static str,
        /// Row of the element.
        row: usize,
        /// Column of the element.
        column: usize,
        /// Its value.
        value: f64,
    },
    /// A vector of the wrong length.
    #[error("{name} has length {found}, expected {expected}: one value per {per}")]
    Length {
        /// The argument.
        name: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it has.
        found: usize,
        /// Owner of one element.
        per: &'static str,
    },
    /// A name that is repeated or too long.
    #[error("{name}[{index}] = {value:?}: {allowed}")]
    Name {
        /// The argument.
        name: &'static str,
        /// Index of the name.
        index: usize,
        /// The name, shortened.
        value: String,
        /// The allowed values, as the end of the sentence.
        allowed: &'static str,
    },
    /// A number of vectors or numbers that differs from the number of movements.
    #[error("{name} has {found} rows, but there are {expected} movements: pass one for each, or one for all")]
    Rows {
        /// The argument.
        name: &'static str,
        /// The number of movements.
        expected: usize,
        /// The number of rows.
        found: usize,
    },
    /// A condition that only some of several conditions have.
    #[error("{name}: given for some of the conditions only; give it for all")]
    Single {
        /// The condition.
        name: &'static str,
    },
    /// A number outside its range.
    #[error("{name} = {}: {allowed}", Number(*value))]
    Range {
        /// The argument.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range, as the end of the sentence.
        allowed: &'static str,
    },
    /// A cut-off frequency outside its range.
    #[error("{name} = {} Hz: {allowed} of {} Hz", Number(*hz), Rounded(*rate))]
    CutOff {
        /// The argument.
        name: &'static str,
        /// Its value, in Hz.
        hz: f64,
        /// The allowed range, as the end of a sentence about the sampling rate.
        allowed: &'static str,
        /// The sampling rate, in Hz.
        rate: f64,
    },
    /// A number so large that its square overflows.
    #[error(
        "{name}[{row}, {column}] = {value:e}: magnitudes above {limit:e} overflow when squared; \
         give the data in a larger unit"
    )]
    Magnitude {
        /// The argument.
        name: &'static str,
        /// Row of the element.
        row: usize,
        /// Column of the element.
        column: usize,
        /// Its value.
        value: f64,
        /// The largest magnitude that is accepted.
        limit: f64,
    },
    /// An element of a vector so large that products with it overflow.
    #[error("{name}[{index}] = {value:e}: magnitudes above {limit:e} overflow when squared")]
    TooLarge {
        /// The argument.
        name: &'static str,
        /// Index of the element.
        index: usize,
        /// Its value.
        value: f64,
        /// The largest magnitude that is accepted.
        limit: f64,
    },
    /// Arrays that do not fit into memory.
    #[error("{name} would take {} numbers: not enough memory; reduce the number of samples", Number(*numbers))]
    Memory {
        /// The requested arrays.
        name: &'static str,
        /// Their number of elements.
        numbers: f64,
    },
    /// Time stamps that do not increase.
    #[error(
        "time[{index}] = {time} s does not come after time[{before}] = {previous} s: \
         time stamps must increase, by more than 1e-12 of the duration; drop repeated samples",
        before = index - 1
    )]
    Time {
        /// Index of the offending stamp.
        index: usize,
        /// Its value, in seconds.
        time: f64,
        /// The value before it, in seconds.
        previous: f64,
    },
    /// Samples that are missing over too long a time.
    #[error("{}", Gap(column, *from, *to, *max_gap))]
    Gap {
        /// Name of the column; "" if rows are missing.
        column: String,
        /// Time of the last sample before the gap, in seconds; −∞ where there is none.
        from: f64,
        /// Time of the first sample after the gap, in seconds; ∞ where there is none.
        to: f64,
        /// The longest gap that is interpolated, in seconds.
        max_gap: f64,
    },
    /// A gap through which a column of unknown unit changes as a wrapped angle does.
    #[error(
        "column '{column}': changes by {change:.3} in the gap between t = {from} s and t = {to} s, about a full turn: give its \
         unit, as in \"{column} [rad]\", so that an angle takes the shorter way round, or unwrap it first"
    )]
    WrapInGap {
        /// Name of the column.
        column: String,
        /// Time of the last sample before the gap, in seconds.
        from: f64,
        /// Time of the first sample after it, in seconds.
        to: f64,
        /// The change between them.
        change: f64,
    },
    /// A recording without a period.
    #[error(
        "no period: the recording repeats itself best after {lag:.3} s, with a correlation of {share:.2}, below {least:.2}; \
         keep the DoFs that repeat, or give the onset of each cycle"
    )]
    Aperiodic {
        /// Lag of the largest correlation, in seconds.
        lag: f64,
        /// Mean correlation of all DoFs there.
        share: f64,
        /// The least correlation of a periodic recording.
        least: f64,
    },
    /// Landmarks out of order, or outside the demonstration.
    #[error(
        "landmarks[{index}] = {time} s must come after {before} s, the start or the landmark before, and before {end} s, the end, \
         by more than 1e-6 of the duration: sort the landmarks, in the time of the demonstration"
    )]
    Landmark {
        /// Index of the offending landmark.
        index: usize,
        /// Its time, in seconds.
        time: f64,
        /// The landmark before it, or the start, in seconds.
        before: f64,
        /// The end of the demonstration, in seconds.
        end: f64,
    },
    /// More segments of a time warp than the samples resolve.
    #[error(
        "n_segments = {n_segments}: must lie between 1 and {most}, half the fewest samples of a demonstration or 1000"
    )]
    Segments {
        /// Requested segments.
        n_segments: usize,
        /// Largest possible number.
        most: usize,
    },
    /// A rotation that is none, or too far from the others.
    #[error(transparent)]
    Rotation(RotationError),
    /// Too few samples to carry a cubic.
    #[error("position has {found} samples: at least {least} are needed; record at a higher rate")]
    Samples {
        /// Samples found.
        found: usize,
        /// Samples needed.
        least: usize,
    },
    /// No demonstration at all.
    #[error("demos is empty: pass at least one demonstration")]
    NoDemonstrations,
    /// Demonstrations with different numbers of degrees of freedom.
    #[error("position has {found} DoFs, but demo 0 has {expected}: all must have the same")]
    Dofs {
        /// DoFs of the first demonstration.
        expected: usize,
        /// DoFs of this one.
        found: usize,
    },
    /// A style dimension that the data cannot carry.
    #[error("n_styles = {n_styles}: must lie between 1 and {most}, the number of {of}")]
    Styles {
        /// Requested dimension.
        n_styles: usize,
        /// Largest possible dimension.
        most: usize,
        /// The limiting quantity.
        of: &'static str,
    },
    /// A context value that is none of the demonstrated labels.
    #[error("context[{}] = {value}: not demonstrated; the labels are {known}", Column(*column, name))]
    Label {
        /// Index of the context value.
        column: usize,
        /// Name of its column, if known.
        name: Option<String>,
        /// The value.
        value: String,
        /// The demonstrated labels.
        known: String,
    },
    /// A label in place of a number.
    #[error("context[{}] = {label:?}: a number is expected, as in the demonstrations", Column(*column, name))]
    NoNumber {
        /// Index of the context value.
        column: usize,
        /// Name of its column, if known.
        name: Option<String>,
        /// The label.
        label: String,
    },
    /// A context with other names than the columns of the demonstrations' contexts.
    #[error("context has the names {found}; expected one value for each of {expected}")]
    ContextNames {
        /// Names of the columns.
        expected: String,
        /// Names of the values.
        found: String,
    },
    /// A context value that is a label in one demonstration and a number in another.
    #[error("contexts[:, {column}] holds {} and {}: give one or the other", Count(*labels, "label"), Count(*numbers, "number"))]
    Mixed {
        /// Index of the context value.
        column: usize,
        /// Number of labels.
        labels: usize,
        /// Number of numbers.
        numbers: usize,
    },
    /// An argument of the other kind of primitive.
    #[error("{name} does not apply to a {kind} primitive{instead}")]
    Kind {
        /// The argument.
        name: &'static str,
        /// The kind of this primitive.
        kind: Kind,
        /// The alternative, as the end of the sentence.
        instead: &'static str,
    },
    /// A demonstration that no style of a model describes.
    #[error(
        "the model does not describe this demonstration: the movement of the closest style deviates by {:.0} % of the \
         demonstration's own, and the forcing it leaves out is {} that left out of the model's demonstrations; check its \
         DoFs, units and phase, or fit a model with it",
        100.0 * off,
        Times(*times)
    )]
    Undescribed {
        /// Deviation of the movement over its own from the mean, by root mean square.
        off: f64,
        /// Size of the forcing that is left out, over that which is left out of the demonstrations.
        times: f64,
    },
    /// A demonstration whose style is far larger than those demonstrated.
    #[error(
        "the model does not describe this demonstration: its style is {ratio:.1} times as large as the largest of the \
         demonstrations'; check its units"
    )]
    StyleSize {
        /// Its size over the largest of the demonstrations'.
        ratio: f64,
    },
    /// Limits of a robot that are wrong, that a path leaves, or that no tick can keep.
    #[error(transparent)]
    Limits(LimitError),
    /// An argument that is missing, empty or unsuitable.
    #[error("{name} {problem}")]
    Argument {
        /// The argument.
        name: &'static str,
        /// The problem and its remedy, as the end of the sentence.
        problem: &'static str,
    },
    /// Two arguments that exclude each other.
    #[error("pass {} or {}, not both: {reason}", names[0], names[1])]
    Conflict {
        /// The arguments.
        names: [&'static str; 2],
        /// The reason, as the end of the sentence.
        reason: &'static str,
    },
    /// A recording without motion.
    #[error("the recording stands still: {consequence}")]
    Still {
        /// The consequence, as the end of the sentence.
        consequence: &'static str,
    },
    /// A well-formed problem without a numerical solution.
    #[error("{0}")]
    Fit(String),
    /// A call that its progress callback cancelled.
    #[error("interrupted")]
    Interrupted,
    /// A file of a model or a partial fit that is damaged, foreign or of another version.
    #[error("not a usable file: {0}")]
    File(String),
    /// A file that cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

/// Result of a fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;
