//! Findings of an inspection of demonstrations, and of a fit.

use std::fmt;

/// Implausible property of the samples of demonstrations, or of a fit to them. Its text states the place and the remedy.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// Two time stamps that are so close that a curve through both samples is far steeper than the movement.
    CloseStamps {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom that changes most between them.
        dof: String,
        /// Location of the later of the two samples.
        place: SampleLocation,
        /// Interval between them, in seconds.
        interval: f64,
        /// Median interval of the demonstration, in seconds.
        usual: f64,
        /// Rate of change between the two samples, relative to the largest elsewhere.
        ratio: f64,
    },
    /// Samples that are exactly zero, far from their neighbours.
    Zeros {
        /// Index of the demonstration.
        demo: usize,
        /// Names of the degrees of freedom.
        dofs: Vec<String>,
        /// Location of the first such sample.
        from: SampleLocation,
        /// Location of the last such sample.
        to: SampleLocation,
        /// Smaller one of the jumps at both ends, relative to the largest step elsewhere.
        ratio: f64,
    },
    /// Padding rows at the end of a demonstration.
    Padded {
        /// Index of the demonstration.
        demo: usize,
        /// Location of the first padding row.
        from: SampleLocation,
        /// Number of padding rows.
        rows: usize,
        /// Kind of the padding.
        padding: Padding,
    },
    /// A column that increases by exactly one per sample in every demonstration.
    Counter {
        /// Name of the degree of freedom.
        dof: String,
    },
    /// A column that repeats the time stamps of every demonstration.
    Clock {
        /// Name of the degree of freedom.
        dof: String,
    },
    /// An angle that jumps by a full turn from one sample to the next.
    Wrap {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Location of the sample after the jump.
        place: SampleLocation,
        /// Size of the jump, in the unit of the degree of freedom.
        jump: f64,
        /// Full turn in that unit.
        turn: f64,
    },
    /// An angle that is offset by whole turns from that of most demonstrations.
    TurnsApart {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Number of turns.
        turns: f64,
        /// Full turn in the unit of the degree of freedom.
        turn: f64,
        /// True if the turns were subtracted, because the unit is one of angles.
        mended: bool,
    },
    /// A rhythmic demonstration whose end does not meet its start.
    OpenCycle {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Step from the last sample to the first one, in the unit of the degree of freedom.
        opening: f64,
        /// That step relative to the largest one within the cycle.
        ratio: f64,
    },
    /// A rhythmic demonstration whose last sample repeats its first one.
    RepeatedEnd {
        /// Index of the demonstration.
        demo: usize,
    },
    /// Columns that have the norm of a quaternion, and are not declared as a rotation.
    Quaternion {
        /// First of the four columns.
        column: usize,
        /// Name of the first of the four columns.
        name: String,
    },
    /// A rotation far from the mean of the demonstrations.
    FarRotation {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the first of the four columns.
        column: String,
        /// Largest angle from the mean rotation, in degrees.
        degrees: f64,
    },
    /// Gains so high that the accelerations of the reproduction far exceed those of the demonstration.
    Stiff {
        /// Gain α_z, per unit of the clock.
        alpha_z: f64,
        /// Name of the degree of freedom.
        dof: String,
        /// Index of the demonstration.
        demo: usize,
        /// Largest acceleration of the reproduction, per second squared.
        reproduced: f64,
        /// Largest acceleration of the demonstration, per second squared.
        shown: f64,
        /// Number of samples C after alignment.
        n_samples: usize,
    },
    /// Measurement noise that is large relative to the movement.
    Noisy {
        /// Name of the degree of freedom.
        dof: String,
        /// Standard deviation of the noise, in the unit of the degree of freedom.
        level: f64,
        /// Standard deviation of the noise, relative to the range.
        share: f64,
        /// Cut-off frequency of the smoothing, in Hz.
        cut_off: f64,
    },
    /// A degree of freedom of small range that the styles do not describe.
    TruncatedDof {
        /// Name of the degree of freedom.
        dof: String,
        /// Range of the degree of freedom, in its unit.
        range: f64,
        /// Largest range of all degrees of freedom.
        largest: f64,
        /// Truncation error of the targets of this degree of freedom, relative by root mean square.
        share: f64,
        /// Style dimension J.
        n_styles: usize,
    },
}

impl Finding {
    /// Returns the finding with the index of its demonstration increased by `first`.
    #[cfg(feature = "learning")]
    pub(crate) fn shifted(mut self, first: usize) -> Self {
        match &mut self {
            Self::CloseStamps { demo, .. }
            | Self::Zeros { demo, .. }
            | Self::Padded { demo, .. }
            | Self::Wrap { demo, .. }
            | Self::TurnsApart { demo, .. }
            | Self::OpenCycle { demo, .. }
            | Self::RepeatedEnd { demo }
            | Self::FarRotation { demo, .. }
            | Self::Stiff { demo, .. } => *demo += first,
            Self::Counter { .. }
            | Self::Clock { .. }
            | Self::Quaternion { .. }
            | Self::Noisy { .. }
            | Self::TruncatedDof { .. } => {}
        }
        self
    }
}

/// Location of a sample in a demonstration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleLocation {
    /// Index of the sample.
    pub sample: usize,
    /// Time of the sample in seconds, if known.
    pub time: Option<f64>,
}

/// Kind of the rows that pad a demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Padding {
    /// Rows of zeros.
    Zeros,
    /// Copies of the last row of the movement.
    LastRow,
}

impl fmt::Display for SampleLocation {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "sample {}", self.sample)?;
        self.time.map_or(Ok(()), |time| write!(f, " (t = {} s)", short(time)))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::CloseStamps { demo, dof, place, interval, usual, ratio } => write!(
                f,
                "demo {demo}: {place} was taken {interval:.2e} s after the sample before it, while the median interval is \
                 {usual:.2e} s, and {dof:?} changes {ratio:.0} times faster between them than anywhere else: drop one of the \
                 two samples, or check the time stamps"
            ),
            Self::Zeros { demo, dofs, from, to, ratio } => {
                let verb = if dofs.len() == 1 { "is" } else { "are" };
                write!(f, "demo {demo}: {} {verb} exactly 0 ", Names(dofs))?;
                if from == to {
                    write!(f, "at {from}")?;
                } else {
                    write!(f, "from {from} to {to}")?;
                }
                write!(
                    f,
                    ", and the step there is {ratio:.0} times the largest elsewhere: lost samples? Replace them by NaN, which \
                     the readers of pdmp fill, or remove them"
                )
            }
            Self::Padded { demo, from, rows, padding } => {
                let description = match padding {
                    Padding::Zeros => "rows of zeros",
                    Padding::LastRow => "copies of the row before them",
                };
                write!(
                    f,
                    "demo {demo}: ends in {rows} {description}, from {from} on: padding? Remove them, and pass \
                     demonstrations of different length as a list"
                )
            }
            Self::Counter { dof } => write!(
                f,
                "{dof:?} increases by exactly 1 per sample in every demonstration: a sample counter? Leave the column out"
            ),
            Self::Clock { dof } => write!(
                f,
                "{dof:?} equals the time stamps in every demonstration: leave the column out, and pass it as time="
            ),
            Self::Wrap { demo, dof, place, jump, turn } => write!(
                f,
                "demo {demo}: {dof:?} jumps by {jump:.4} at {place}, about a full turn of {turn:.4}: a wrapped angle? Unwrap \
                 it with pdmp.preprocessing.unwrap"
            ),
            Self::TurnsApart { demo, dof, turns, turn, mended } => {
                write!(
                    f,
                    "demo {demo}: {dof:?} lies {turns} {} of {turn:.4} from that of most demonstrations: ",
                    if turns.abs() == 1.0 { "full turn" } else { "full turns" }
                )?;
                f.write_str(if *mended {
                    "the turns were subtracted; use one range of angles in all recordings to avoid this"
                } else {
                    "an angle? Give its unit, \"rad\" or \"deg\", to subtract the turns"
                })
            }
            Self::OpenCycle { demo, dof, opening, ratio } => write!(
                f,
                "demo {demo}: {dof:?} steps by {} from the end of the cycle to its start, {} times the largest step within: a \
                 rhythmic demonstration is one closed cycle; cut it from a longer recording with pdmp.preprocessing.cycles, \
                 which closes it, or fit a discrete movement",
                short(*opening),
                short(*ratio)
            ),
            Self::RepeatedEnd { demo } => write!(
                f,
                "demo {demo}: the last sample repeats the first: a rhythmic demonstration ends one sampling interval before \
                 the next cycle starts; drop the last sample"
            ),
            Self::Quaternion { column, name } => write!(
                f,
                "columns {column} to {} ({name:?} to the third after it) have unit norm: a quaternion? Declare it, as in \
                 rotations={{{column}: \"wxyz\"}}, with its order of components; as ordinary columns its norm is not kept",
                column + 3
            ),
            Self::FarRotation { demo, column, degrees } => write!(
                f,
                "demo {demo}: the rotation from column {column:?} on is up to {degrees:.0} degrees from the mean of the \
                 demonstrations: beyond 90 its styles are distorted, and half a turn is refused; check the columns and their \
                 order, or fit the demonstrations in groups"
            ),
            Self::Stiff { alpha_z, dof, demo, reproduced, shown, n_samples } => write!(
                f,
                "alpha_z = {}: the reproduction of demo {demo} accelerates up to {} in {dof:?}, the demonstration up to {}; \
                 {n_samples} samples do not resolve such fast transients: lower alpha_z, or raise n_samples",
                short(*alpha_z),
                short(*reproduced),
                short(*shown)
            ),
            Self::Noisy { dof, level, share, cut_off } => write!(
                f,
                "{dof:?} has measurement noise of standard deviation {}, {} % of its range, and is smoothed at {} Hz: check \
                 the recordings, or set the cut-off by smoothing",
                short(*level),
                short(100.0 * share),
                short(*cut_off)
            ),
            Self::TruncatedDof { dof, range, largest, share, n_styles } => write!(
                f,
                "n_styles = {n_styles} leaves out {} % of {dof:?}, whose range of {} is small relative to {}: if its unit differs, \
                 give units or dof_scale = \"range\"; otherwise raise n_styles",
                short((100.0 * share).round()),
                short(*range),
                short(*largest)
            ),
        }
    }
}

/// Formats a number with at most four significant digits.
fn short(value: f64) -> String {
    let text = format!("{value:.3e}").parse::<f64>().unwrap_or(value);
    format!("{text}")
}

/// Display of names as a list in one line, abbreviated beyond a few.
struct Names<'a>(&'a [String]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        const MAX_NAMES: usize = 4;
        for (k, name) in self.0.iter().take(MAX_NAMES).enumerate() {
            write!(f, "{}{name:?}", if k == 0 { "" } else { ", " })?;
        }
        let n_omitted = self.0.len().saturating_sub(MAX_NAMES);
        if n_omitted > 0 { write!(f, " and {n_omitted} more") } else { Ok(()) }
    }
}
