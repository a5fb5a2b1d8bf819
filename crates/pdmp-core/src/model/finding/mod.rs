//! Findings of an inspection of demonstrations, and of a fit.

mod text;

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
    /// Samples far from those before and after them.
    Outlier {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Location of the first such sample.
        from: SampleLocation,
        /// Location of the last such sample.
        to: SampleLocation,
        /// Step to the first such sample, in the unit of the degree of freedom.
        step: f64,
        /// That step relative to the neighbouring and the usual ones.
        ratio: f64,
        /// Number of other such places in the demonstration.
        others: usize,
    },
    /// A step from one sample to the next far beyond the neighbouring ones.
    Jump {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Location of the sample after the step.
        place: SampleLocation,
        /// Size of the step, in the unit of the degree of freedom.
        step: f64,
        /// The step relative to the neighbouring and the usual ones.
        ratio: f64,
        /// Number of other such places in the demonstration.
        others: usize,
    },
    /// Equal samples that end in a step far beyond the neighbouring ones.
    Stuck {
        /// Index of the demonstration.
        demo: usize,
        /// Name of the degree of freedom.
        dof: String,
        /// Location of the first of the equal samples.
        from: SampleLocation,
        /// Location of the last of the equal samples.
        to: SampleLocation,
        /// Step from the last of them to the next sample, in the unit of the degree of freedom.
        step: f64,
        /// That step relative to the neighbouring and the usual ones.
        ratio: f64,
        /// Number of other such places in the demonstration.
        others: usize,
    },
    /// An interval between time stamps so long that the samples do not determine the movement within it.
    MissingRows {
        /// Index of the demonstration.
        demo: usize,
        /// Location of the sample before the interval.
        from: SampleLocation,
        /// Location of the sample after the interval.
        to: SampleLocation,
        /// Length of the interval, relative to the median one.
        ratio: f64,
        /// Degree of freedom, and the largest error relative to its range of interpolation over equally long parts; `None`
        /// if there is no such part.
        error: Option<(String, f64)>,
    },
    /// A demonstration whose ranges are of another order of magnitude than those of the others.
    OtherRange {
        /// Index of the demonstration.
        demo: usize,
        /// Median over the degrees of freedom of the range relative to that of the others.
        ratio: f64,
        /// Unit of the degrees of freedom; "" if it is unknown or all are meant.
        unit: String,
    },
    /// A demonstration whose duration is of another order of magnitude than that of the others.
    OtherDuration {
        /// Index of the demonstration.
        demo: usize,
        /// Duration in seconds.
        duration: f64,
        /// Duration relative to the median.
        ratio: f64,
    },
    /// An angle that jumps by full turns from one sample to the next.
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
            | Self::Outlier { demo, .. }
            | Self::Jump { demo, .. }
            | Self::Stuck { demo, .. }
            | Self::MissingRows { demo, .. }
            | Self::OtherRange { demo, .. }
            | Self::OtherDuration { demo, .. }
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
