//! Texts of findings: what was found where, and the remedy.

use std::fmt;

use super::{Finding, Padding, SampleLocation};

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
                write_places(f, from, to)?;
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
                "demo {demo}: {dof:?} jumps by {jump:.4} at {place}, about {} of {turn:.4}: a wrapped angle? Unwrap it with \
                 pdmp.preprocessing.unwrap",
                FullTurns((jump / turn).round().abs())
            ),
            Self::Outlier { demo, dof, from, to, step, ratio, others } => {
                write!(f, "demo {demo}: {dof:?} departs by {} ", short(*step))?;
                write_places(f, from, to)?;
                write!(
                    f,
                    " and returns, in steps {ratio:.0} times the neighbouring and the usual ones{}: outliers? Replace them by \
                     NaN, which the readers of pdmp fill, or remove them",
                    Others(*others)
                )
            }
            Self::Jump { demo, dof, place, step, ratio, others } => write!(
                f,
                "demo {demo}: {dof:?} jumps by {} at {place}, {ratio:.0} times the neighbouring and the usual steps{}: a slipped \
                 sensor, or missing samples? Correct the offset, or cut the recording there with pdmp.preprocessing.split_at",
                short(*step),
                Others(*others)
            ),
            Self::Stuck { demo, dof, from, to, step, ratio, others } => {
                write!(f, "demo {demo}: {dof:?} is constant ")?;
                write_places(f, from, to)?;
                write!(
                    f,
                    " and then jumps by {}, {ratio:.0} times the neighbouring and the usual steps{}: a stuck sensor? Replace \
                     the samples by NaN, which the readers of pdmp fill, or cut the recording there with \
                     pdmp.preprocessing.split_at",
                    short(*step),
                    Others(*others)
                )
            }
            Self::MissingRows { demo, from, to, ratio, error } => {
                write!(
                    f,
                    "demo {demo}: no samples between {from} and {to}, for {ratio:.0} times the median interval, and "
                )?;
                match error {
                    Some((dof, share)) => write!(
                        f,
                        "interpolation over equally long parts errs by up to {:.0} % of the range of {dof:?}",
                        100.0 * share
                    )?,
                    None => {
                        f.write_str("the rest of the recording is too short to determine the movement in between")?
                    }
                }
                f.write_str(
                    ": missing rows? Leave the demonstration out, or cut the recording there with \
                     pdmp.preprocessing.split_at",
                )
            }
            Self::OtherRange { demo, ratio, unit } => {
                let of = if unit.is_empty() { String::new() } else { format!(" in [{unit}]") };
                write!(f, "demo {demo}: range{of} {} times that of the others: ", short(*ratio))?;
                f.write_str(&guess(*ratio, &[(DEGREES, "degrees", "radians"), (1e3, "mm", "m")], "check its units"))
            }
            Self::OtherDuration { demo, duration, ratio } => {
                write!(f, "demo {demo}: duration of {} s, {} times the median: ", short(*duration), short(*ratio))?;
                let units = [(1e3, "ms", "s"), (1e6, "\u{b5}s", "s"), (1e9, "ns", "s")];
                f.write_str(&guess(*ratio, &units, "check its time stamps"))
            }
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

/// Degrees in a radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;
/// Largest ratio of a range or duration to that which a unit explains: movements differ.
const MAX_VARIATION: f64 = 3.0;

/// Returns the unit that explains a ratio, of (factor, own unit, unit of the others), as a question, or another remedy.
fn guess(ratio: f64, units: &[(f64, &str, &str)], otherwise: &str) -> String {
    let explains = |factor: f64, ratio: f64| (1.0 / MAX_VARIATION..=MAX_VARIATION).contains(&(ratio / factor));
    let pair = units.iter().find_map(|&(factor, large, small)| {
        let direct = explains(factor, ratio).then_some((large, small));
        direct.or_else(|| explains(factor, 1.0 / ratio).then_some((small, large)))
    });
    pair.map_or_else(|| otherwise.to_string(), |(own, others)| format!("{own} among {others}? Convert it"))
}

/// Writes the location of one or several samples.
fn write_places(f: &mut fmt::Formatter, from: &SampleLocation, to: &SampleLocation) -> fmt::Result {
    if from == to { write!(f, "at {from}") } else { write!(f, "from {from} to {to}") }
}

/// Display of a number of full turns.
struct FullTurns(f64);

impl fmt::Display for FullTurns {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0 <= 1.0 { f.write_str("a full turn") } else { write!(f, "{} full turns", self.0) }
    }
}

/// Display of the number of other places with the same finding.
struct Others(usize);

impl fmt::Display for Others {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0 == 0 { Ok(()) } else { write!(f, " ({} more in this demonstration)", self.0) }
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
