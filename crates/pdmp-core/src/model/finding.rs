//! What an inspection reports.

use std::fmt;

/// Something implausible about the samples of demonstrations, or about a fit to them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// Two time stamps so close that a curve through both samples is far steeper than the movement.
    CloseStamps {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom that changes most between them.
        dof: String,
        /// The later of the two samples.
        place: Place,
        /// Seconds between them.
        interval: f64,
        /// Median interval of the demonstration, in seconds.
        usual: f64,
        /// Rate of change between the two samples, over the largest elsewhere.
        ratio: f64,
    },
    /// Samples that are exactly zero, far from those beside them.
    Zeros {
        /// Index of the demonstration.
        demo: usize,
        /// Names of the degrees of freedom.
        dofs: Vec<String>,
        /// First sample.
        from: Place,
        /// Last sample.
        to: Place,
        /// The smaller jump beside them, over the largest step elsewhere.
        ratio: f64,
    },
    /// Rows at the end that pad a demonstration.
    Padded {
        /// Index of the demonstration.
        demo: usize,
        /// First of these rows.
        from: Place,
        /// How many there are.
        rows: usize,
        /// What they are.
        padding: Padding,
    },
    /// A column that grows by exactly one a sample in every demonstration.
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
        /// The sample after the jump.
        place: Place,
        /// The jump, in the unit of the degree of freedom.
        jump: f64,
        /// A full turn in that unit.
        turn: f64,
    },
    /// An angle that lies whole turns from that of the first demonstration.
    TurnsApart {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// How many turns.
        turns: f64,
        /// A full turn in the unit of the degree of freedom.
        turn: f64,
        /// Whether the unit says that it is an angle, so that the turns were taken off.
        mended: bool,
    },
    /// Gains so high that the reproduced demonstration accelerates far harder than the recorded one.
    Stiff {
        /// α_z.
        alpha_z: f64,
        /// Name of the degree of freedom.
        dof: String,
        /// Index of the demonstration.
        demo: usize,
        /// Largest acceleration of the reproduction, per second squared.
        reproduced: f64,
        /// Largest acceleration of the demonstration.
        shown: f64,
        /// Samples C after alignment.
        n_samples: usize,
    },
    /// Measurement noise that is large beside the movement.
    Noisy {
        /// Name of the degree of freedom.
        dof: String,
        /// Standard deviation of the noise, in the unit of the degree of freedom.
        level: f64,
        /// The same as a share of the range.
        share: f64,
        /// Cut-off of the smoothing, in Hz.
        cut_off: f64,
    },
    /// A degree of freedom of small range whose movement the styles leave out.
    LeftOut {
        /// Name of the degree of freedom.
        dof: String,
        /// Its range, in its unit.
        range: f64,
        /// The largest range of all.
        largest: f64,
        /// Share of its targets that the styles leave out, by root mean square.
        share: f64,
        /// Style dimension J.
        n_styles: usize,
    },
}

/// Where in a demonstration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Index of the sample.
    pub sample: usize,
    /// Its time in seconds, where that is known.
    pub time: Option<f64>,
}

/// Rows that pad a demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Padding {
    /// All zero.
    Zeros,
    /// All like the last row of the movement.
    LastRow,
}

impl fmt::Display for Place {
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
                "demo {demo}: {place} was taken {interval:.2e} s after the one before it, where {usual:.2e} s are usual, and \
                 {dof:?} changes {ratio:.0} times faster between them than anywhere else: drop one of the two samples, or \
                 check the time stamps"
            ),
            Self::Zeros { demo, dofs, from, to, ratio } => {
                let what = if dofs.len() == 1 { "is" } else { "are" };
                write!(f, "demo {demo}: {} {what} exactly 0 ", Names(dofs))?;
                if from == to {
                    write!(f, "at {from}")?;
                } else {
                    write!(f, "from {from} to {to}")?;
                }
                write!(
                    f,
                    ", and the step there is {ratio:.0} times the largest elsewhere: samples that were lost? Replace them by \
                     NaN, which the readers of pdmp fill, or cut them out"
                )
            }
            Self::Padded { demo, from, rows, padding } => {
                let like = match padding {
                    Padding::Zeros => "rows of zeros",
                    Padding::LastRow => "rows exactly like the one before them",
                };
                write!(
                    f,
                    "demo {demo}: ends in {rows} {like}, from {from} on: padding? Cut them off, and pass demonstrations of \
                     different length as a list"
                )
            }
            Self::Counter { dof } => write!(
                f,
                "{dof:?} grows by exactly 1 a sample in every demonstration: a counter of samples? Leave the column out"
            ),
            Self::Clock { dof } => write!(
                f,
                "{dof:?} is the time of the samples in every demonstration: leave the column out, and pass it as time="
            ),
            Self::Wrap { demo, dof, place, jump, turn } => write!(
                f,
                "demo {demo}: {dof:?} jumps by {jump:.4} at {place}, about a full turn of {turn:.4}: an angle that was \
                 wrapped? Unwrap it with pdmp.preprocessing.unwrap"
            ),
            Self::TurnsApart { demo, dof, turns, turn, mended } => {
                write!(
                    f,
                    "demo {demo}: {dof:?} lies {turns} full turns of {turn:.4} from that of most demonstrations: "
                )?;
                f.write_str(if *mended {
                    "they were taken off; bring the recordings together to avoid this"
                } else {
                    "an angle? Give its unit, \"rad\" or \"deg\", to take them off"
                })
            }
            Self::Stiff { alpha_z, dof, demo, reproduced, shown, n_samples } => write!(
                f,
                "alpha_z = {}: the reproduction of demo {demo} accelerates up to {} in {dof:?}, where {} was recorded; \
                 {n_samples} samples do not resolve transients that fast: lower alpha_z, or raise n_samples",
                short(*alpha_z),
                short(*reproduced),
                short(*shown)
            ),
            Self::Noisy { dof, level, share, cut_off } => write!(
                f,
                "{dof:?} has measurement noise of standard deviation {}, {} % of its range; it is smoothed at {} Hz: check \
                 the recordings, or choose the cut-off by smoothing",
                short(*level),
                short(100.0 * share),
                short(*cut_off)
            ),
            Self::LeftOut { dof, range, largest, share, n_styles } => write!(
                f,
                "{n_styles} styles leave out {} % of {dof:?}, whose range of {} is small beside {}: if its unit is another \
                 one, give units or dof_scale = \"range\"; otherwise raise n_styles",
                short((100.0 * share).round()),
                short(*range),
                short(*largest)
            ),
        }
    }
}

/// A number with at most four significant digits.
fn short(value: f64) -> String {
    let text = format!("{value:.3e}").parse::<f64>().unwrap_or(value);
    format!("{text}")
}

/// Names as a list in one line, some of them where there are many.
struct Names<'a>(&'a [String]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        const MOST: usize = 4;
        for (k, name) in self.0.iter().take(MOST).enumerate() {
            write!(f, "{}{name:?}", if k == 0 { "" } else { ", " })?;
        }
        let more = self.0.len().saturating_sub(MOST);
        if more > 0 { write!(f, " and {more} more") } else { Ok(()) }
    }
}
