//! The one error type. Every variant carries the numbers that a user needs to mend the call, and those that can
//! arise in a control loop hold nothing that allocates.

use std::fmt;
use std::path::PathBuf;

use crate::kind::Kind;

/// What can go wrong, from a bad argument to a damaged file.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An error in one of several demonstrations.
    #[error("demo {demo}: {source}")]
    Demo {
        /// Index of the demonstration, from 0.
        demo: usize,
        /// What is wrong with it.
        source: Box<Error>,
    },
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
        /// What each element belongs to.
        per: &'static str,
    },
    /// Another number of vectors than there are movements.
    #[error("{name} has {found} rows, but there are {expected} styles: pass one row for each, or one vector for all")]
    Rows {
        /// The argument.
        name: &'static str,
        /// The number of styles.
        expected: usize,
        /// The number of rows.
        found: usize,
    },
    /// A condition of only one of two conditions that are blended.
    #[error("{name}: given for one of the two only; give it for both")]
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
        /// What is allowed.
        allowed: &'static str,
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
    #[error("{name} would take {} numbers: not enough memory; ask for fewer samples", Number(*numbers))]
    Memory {
        /// What is asked for.
        name: &'static str,
        /// How many numbers it has.
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
    #[error("column '{column}': {}", Gap(*from, *to, *max_gap))]
    Gap {
        /// Name of the column.
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
         unit, as in \"{column} [rad]\" or units=, so that an angle goes the shorter way round, or unwrap it first"
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
    /// A recording that does not repeat itself.
    #[error(
        "no period: the recording repeats itself best after {lag:.3} s, with a correlation of {share:.2}, below {least:.2}; \
         keep the DoFs that repeat, or tell when each cycle begins with events="
    )]
    Aperiodic {
        /// Where the recording resembles itself most, in seconds.
        lag: f64,
        /// The mean correlation of all DoFs there.
        share: f64,
        /// The least correlation of a periodic recording.
        least: f64,
    },
    /// Events out of order, or outside the demonstration.
    #[error(
        "events[{index}] = {time} s must come after {before} s, the start or the event before, and before {end} s, the end, \
         by more than 1e-6 of the duration: sort the events, in the time of the demonstration"
    )]
    Event {
        /// Index of the offending event.
        index: usize,
        /// Its time, in seconds.
        time: f64,
        /// The event before it, or the start, in seconds.
        before: f64,
        /// The end of the demonstration, in seconds.
        end: f64,
    },
    /// More segments of a warp than the samples tell apart.
    #[error(
        "n_segments = {n_segments}: must lie between 1 and {most}, half the fewest samples of a demonstration or 1000"
    )]
    Segments {
        /// The segments asked for.
        n_segments: usize,
        /// The most that are possible.
        most: usize,
    },
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
        /// The dimension asked for.
        n_styles: usize,
        /// The largest possible.
        most: usize,
        /// What limits it.
        of: &'static str,
    },
    /// A context value that stands for no label that was shown.
    #[error("context[{column}] = {value}: never shown; the labels are {known}")]
    Label {
        /// Which value of the context.
        column: usize,
        /// What it is.
        value: String,
        /// The labels that it may be.
        known: String,
    },
    /// A label where the model knows numbers.
    #[error("context[{column}] = {label:?}: a number is expected, as in the demonstrations")]
    NoNumber {
        /// Which value of the context.
        column: usize,
        /// What it is.
        label: String,
    },
    /// A context value that is a label in one demonstration and a number in another.
    #[error("contexts[:, {column}] holds {labels} labels and {numbers} numbers: give one or the other")]
    Mixed {
        /// Which value of the contexts.
        column: usize,
        /// How many labels.
        labels: usize,
        /// How many numbers.
        numbers: usize,
    },
    /// An argument that the other kind of primitive has.
    #[error("{name} does not apply to a {kind} primitive{instead}")]
    Kind {
        /// The argument.
        name: &'static str,
        /// The kind of this primitive.
        kind: Kind,
        /// What to use, as the end of the sentence.
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
    /// Arguments that are missing or exclude each other.
    #[error("{0}")]
    Arguments(&'static str),
    /// The demonstrations are well formed, but learning did not succeed.
    #[error("{0}")]
    Fit(String),
    /// The caller stopped a long call.
    #[error("interrupted")]
    Interrupted,
    /// A model file that is damaged, foreign or of another version.
    #[error("not a usable model file: {0}")]
    File(String),
    /// A file that cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// How many times as much.
struct Times(f64);

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0 < 1e4 { write!(f, "{:.1} times", self.0) } else { f.write_str("over 10 000 times") }
    }
}

/// Where samples are missing, and what can be done about it.
struct Gap(f64, f64, f64);

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Gap(from, to, max_gap) = *self;
        match (from.is_finite(), to.is_finite()) {
            (true, true) => write!(
                f,
                "no sample between t = {from} s and t = {to} s: that is longer than max_gap = {max_gap} s; raise max_gap, \
                 or cut the recording there"
            ),
            (false, true) => write!(f, "no sample before t = {to} s, where none can be interpolated: cut the rows out"),
            (true, false) => {
                write!(f, "no sample after t = {from} s, where none can be interpolated: cut the rows out")
            }
            (false, false) => write!(f, "no sample at all: leave the column out"),
        }
    }
}

/// A number as a person would write it: whole ones plainly, very large and small ones with an exponent.
struct Number(f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0.fract() == 0.0 && self.0.abs() < 1e9 { write!(f, "{}", self.0) } else { write!(f, "{:?}", self.0) }
    }
}

/// The result of a call into this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Names the demonstration in which this error arose.
    pub fn in_demo(self, demo: usize) -> Self {
        Error::Demo { demo, source: Box::new(self) }
    }
}
