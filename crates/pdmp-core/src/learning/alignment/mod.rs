//! Alignment of demonstrations (step 1 of Section 3.2): time scaling to a nominal one, and resampling to C samples.
//!
//! The paper scales time linearly. For repetitions that pause at different phases, the phase axis is divided into
//! segments, and each demonstration has its own duration of each, estimated by a time warp or given by landmarks.

mod elastic_warp;
mod landmarks;
mod sample_times;

use std::borrow::Cow;
use std::ops::Range;

use ndarray::{Array2, Axis};

use crate::demonstration::{Demonstration, MIN_SAMPLES_PER_DEMONSTRATION};
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::template::{TimeWarp, WarpTemplate};
use crate::numerics::smoothing_spline::{MIN_DECIMATED, Noise, Samples, Smoothing, pooled};
use crate::numerics::spline::{Knots, Splines};
use crate::numerics::threads::Threads;
use crate::validate::{check_length, check_range};
use sample_times::{Clock, Ticks};

/// Smallest number of steps of the aligned demonstrations, unless their number of samples is given: the steps of the
/// nominal demonstration are subdivided. A few samples do not resolve the target where a movement turns sharply.
const MIN_STEPS: usize = 150;
/// Largest number of samples after alignment.
const MAX_SAMPLES: usize = 1_000_000;

/// Settings of sampling, smoothing and alignment of demonstrations.
#[derive(Clone, Debug)]
pub(crate) struct Alignment {
    /// Discrete movements from start to goal, or cycles.
    pub(crate) kind: Kind,
    /// Sampling interval in seconds, for demonstrations that carry none.
    pub(crate) dt: Option<f64>,
    /// Periods in seconds of time-stamped cycles, one for all or one for each; empty where the sampling interval gives them.
    pub(crate) period: Vec<f64>,
    /// Smoothing of measurement noise.
    pub(crate) smoothing: Smoothing,
    /// Index of the nominal demonstration; otherwise that of median duration.
    pub(crate) nominal: Option<usize>,
    /// Number of samples C, from 4 to 1e6; otherwise that of the nominal demonstration, whose steps are subdivided equally
    /// if there are fewer than 150.
    pub(crate) n_samples: Option<usize>,
    /// DoFs that are the components of a vector, such as a rotation vector: their noise is estimated together.
    pub(crate) vectors: Vec<Range<usize>>,
}

/// Scaling of the time of each demonstration to that of the nominal one.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TimeScaling {
    /// Linear scaling by Tⁿ/Tᵐ, as in the paper.
    #[default]
    Linear,
    /// Monotone time warp that aligns the shapes of the demonstrations.
    Warp(TimeWarp),
    /// Default warp, with fewer segments where a demonstration has fewer than 16 samples. In a fit with at least three
    /// different contexts it is kept only if it lowers the cross-validation error over the contexts by more than the
    /// standard error; otherwise scaling is linear.
    WarpIfBetter,
    /// Landmark registration: piecewise linear scaling between landmarks. Their times (M, E) are in seconds, from the
    /// first sample or on the clock of the time stamps.
    Landmarks(Array2<f64>),
}

/// Demonstrations on a common phase axis, each of which is resampled on demand.
#[derive(Clone, Debug)]
pub(crate) struct Aligned<'a> {
    demos: &'a [Demonstration],
    clocks: Vec<Clock<'a>>,
    kind: Kind,
    /// Measurement noise, which smoothing removes.
    pub(crate) noise: Noise,
    /// Warping functions (M,); `None` for linear time.
    warps: Vec<Option<WarpingFunction>>,
    /// Phases (K+1,) that divide the movement into segments.
    pub(crate) breaks: Vec<f64>,
    /// Durations (M, K) of the segments, in seconds.
    pub(crate) segment_durations: Array2<f64>,
    /// Index of the nominal demonstration.
    pub(crate) nominal: usize,
    /// Number of samples C of each demonstration after alignment.
    pub(crate) n_samples: usize,
}

/// Time scaling of demonstrations.
#[derive(Clone, Debug)]
pub(crate) struct Timing {
    warps: Vec<Option<WarpingFunction>>,
    breaks: Vec<f64>,
    segment_durations: Array2<f64>,
}

impl Alignment {
    /// Returns the demonstrations with linear time scaling, and estimates their noise.
    ///
    /// # Errors
    /// No demonstration, different numbers of DoFs, a missing sampling interval or period, or a nominal index, number of
    /// samples or cut-off out of range.
    pub(crate) fn align<'a>(&self, demos: &'a [Demonstration], threads: Threads) -> Result<Aligned<'a>> {
        let n_dofs = demos.first().ok_or(Error::NoDemonstrations)?.n_coordinates();
        if self.period.len() > 1 {
            check_length("period", self.period.len(), demos.len(), "demonstration")?;
        }
        let mut clocks = Vec::with_capacity(demos.len());
        for (m, demo) in demos.iter().enumerate() {
            if demo.n_coordinates() != n_dofs {
                return Err(Error::Dofs { expected: n_dofs, found: demo.n_coordinates() }.in_demo(m));
            }
            if self.kind == Kind::Rhythmic && demo.goal().is_some() {
                let (kind, instead) = (self.kind, ": it moves about the mean of its cycle");
                return Err(Error::Kind { name: "goal", kind, instead }.in_demo(m));
            }
            let period = self.period.get(if self.period.len() == 1 { 0 } else { m }).copied();
            clocks.push(Clock::of(demo, self, period).map_err(|error| error.in_demo(m))?);
        }
        let durations: Vec<f64> = clocks.iter().map(|clock| clock.duration).collect();
        let nominal = self.nominal_of(&durations)?;
        let n_samples = self.n_samples_for(demos[nominal].n_samples())?;
        let (kind, noise) = (self.kind, Noise::none(n_dofs));
        let (warps, breaks) = (vec![None; demos.len()], vec![0.0, 1.0]);
        let segment_durations = ndarray::Array1::from_vec(durations).insert_axis(Axis(1));
        let mut aligned = Aligned { demos, clocks, kind, noise, warps, breaks, segment_durations, nominal, n_samples };
        aligned.noise = self.noise(&aligned, threads)?;
        Ok(aligned)
    }

    /// Checks a given cut-off against the sampling rate and period of each demonstration.
    ///
    /// # Errors
    /// A cut-off out of range.
    pub(crate) fn check_cut_off(&self, aligned: &Aligned) -> Result<()> {
        let Smoothing::CutOff { .. } = self.smoothing else { return Ok(()) };
        let check = |m: usize| self.smoothing.check(&aligned.samples(m, &aligned.seconds(m)));
        (0..aligned.n_demos()).try_for_each(|m| check(m).map_err(|error| error.in_demo(m)))
    }

    /// Estimates the measurement noise from a pool of demonstrations.
    fn noise(&self, aligned: &Aligned, threads: Threads) -> Result<Noise> {
        self.check_cut_off(aligned)?;
        let pool: Vec<(usize, Vec<f64>)> = pooled(aligned.n_demos()).map(|m| (m, aligned.seconds(m))).collect();
        let samples: Vec<Samples> = pool.iter().map(|(m, time)| aligned.samples(*m, time)).collect();
        let noise = Noise::estimate(self.smoothing, &samples, &self.vectors, MIN_DECIMATED, threads)?;
        noise.with_ends(&samples, &self.vectors, threads)
    }

    /// Returns the number of samples C for that of the nominal demonstration.
    ///
    /// # Errors
    /// A given number out of range.
    pub(crate) fn n_samples_for(&self, nominal: usize) -> Result<usize> {
        let steps = self.kind.steps(nominal);
        let n_samples = self.n_samples.unwrap_or(self.kind.samples(steps * MIN_STEPS.div_ceil(steps)));
        let valid = (MIN_SAMPLES_PER_DEMONSTRATION..=MAX_SAMPLES).contains(&n_samples);
        check_range("n_samples", n_samples as f64, valid, "must lie between 4 and 1e6").map(|()| n_samples)
    }

    /// Returns the given nominal index, or that of the lower median of the durations, the first of equals.
    pub(crate) fn nominal_of(&self, durations: &[f64]) -> Result<usize> {
        match self.nominal {
            Some(nominal) => {
                let allowed = "must be the index of a demonstration, from 0";
                check_range("nominal", nominal as f64, nominal < durations.len(), allowed).map(|()| nominal)
            }
            None => {
                let mut order: Vec<usize> = (0..durations.len()).collect();
                order.sort_by(|&a, &b| durations[a].total_cmp(&durations[b]));
                Ok(order[(durations.len() - 1) / 2])
            }
        }
    }
}

impl TimeScaling {
    /// Scales the time of the demonstrations, and returns the template of a warp.
    ///
    /// `unit` (D,) are the scales of the DoFs in the comparison; otherwise their ranges.
    ///
    /// # Errors
    /// Settings out of range, landmarks out of order, too little memory, or the error that `progress` returned.
    pub(crate) fn apply(
        &self,
        aligned: &mut Aligned,
        unit: Option<&[f64]>,
        threads: Threads,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Option<WarpTemplate>> {
        match self {
            Self::Linear => Ok(None),
            Self::Warp(warp) => aligned.warp(warp, unit, threads, progress).map(Some),
            Self::WarpIfBetter => {
                let warp = TimeWarp::default();
                let segments = warp.n_segments.min(aligned.max_segments());
                aligned.warp(&TimeWarp { n_segments: segments, ..warp }, unit, threads, progress).map(Some)
            }
            Self::Landmarks(landmarks) => aligned.register(landmarks.view()).map(|()| None),
        }
    }
}

impl Aligned<'_> {
    /// Changes the number of samples.
    pub(crate) fn resampled(self, n_samples: usize) -> Self {
        Self { n_samples, ..self }
    }

    /// Returns the time scaling.
    pub(crate) fn timing(&self) -> Timing {
        let Self { warps, breaks, segment_durations, .. } = self;
        Timing { warps: warps.clone(), breaks: breaks.clone(), segment_durations: segment_durations.clone() }
    }

    /// Scales time as that of demonstrations with the same sample times.
    pub(crate) fn set_timing(&mut self, timing: Timing) {
        let Timing { warps, breaks, segment_durations } = timing;
        (self.warps, self.breaks, self.segment_durations) = (warps, breaks, segment_durations);
    }

    /// Returns the warping function of demonstration `m`; `None` for linear time.
    pub(crate) fn warp_of(&self, m: usize) -> Option<&WarpingFunction> {
        self.warps[m].as_ref()
    }

    /// Returns the phases of the samples of demonstration `m` (n,), from 0 to 1.
    pub(crate) fn phases(&self, m: usize) -> Vec<f64> {
        let duration = self.clocks[m].duration;
        let phase = |t: f64| self.warps[m].as_ref().map_or(t / duration, |warp| warp.phase(t)[0]);
        self.seconds(m).into_iter().map(phase).collect()
    }

    /// Returns demonstration `m` as recorded.
    pub(crate) fn demo(&self, m: usize) -> &Demonstration {
        &self.demos[m]
    }

    /// Returns the number of demonstrations M.
    pub(crate) fn n_demos(&self) -> usize {
        self.demos.len()
    }

    /// Returns the durations or periods (M,) in seconds.
    pub(crate) fn durations(&self) -> Vec<f64> {
        self.segment_durations.sum_axis(Axis(1)).to_vec()
    }

    /// Writes the resampled positions of demonstration `m` (C·D), in row-major order.
    ///
    /// Linear scaling places sample c at the share c/(C−1) of the duration, or c/C of the period. A warped demonstration
    /// is read at the time where its warping function has that phase.
    pub(crate) fn sample(&self, m: usize, position: &mut [f64]) {
        let Clock { ticks, extent, .. } = self.clocks[m];
        let steps = self.kind.steps(self.n_samples) as f64;
        let phases = (0..self.n_samples).map(|c| c as f64);
        match &self.warps[m] {
            Some(warp) => self.read(m, phases.map(|c| extent * warp.share(c / steps)), position),
            None if matches!(ticks, Ticks::Even { .. })
                && self.demos[m].n_samples() == self.n_samples
                && extent == steps =>
            {
                position.copy_from_slice(&self.smoothed(m));
            }
            None => self.read(m, phases.map(|c| c * extent / steps), position),
        }
    }

    /// Writes the positions of demonstration `m` at non-decreasing times in units of its ticks.
    fn read(&self, m: usize, times: impl Iterator<Item = f64> + Clone, position: &mut [f64]) {
        let Clock { ticks, extent, .. } = self.clocks[m];
        let values = self.smoothed(m);
        let own = (0..self.demos[m].n_samples()).map(|c| ticks.at(c)).collect();
        let knots = match self.kind {
            Kind::Discrete => Knots::not_a_knot(own),
            Kind::Rhythmic => Knots::periodic(own, extent),
        };
        Splines::through(knots, &values, self.demos[m].n_dofs()).sample(times, position);
    }

    /// Returns the samples of demonstration `m` at the times of [`Aligned::seconds`].
    fn samples<'a>(&'a self, m: usize, time: &'a [f64]) -> Samples<'a> {
        let period = (self.kind == Kind::Rhythmic).then_some(self.clocks[m].duration);
        Samples { time, period, values: self.demos[m].position() }
    }

    /// Returns the times of the samples of demonstration `m` (n,) in seconds from the first.
    pub(crate) fn seconds(&self, m: usize) -> Vec<f64> {
        let ticks = self.clocks[m].ticks;
        (0..self.demos[m].n_samples()).map(|c| ticks.at(c) * ticks.unit()).collect()
    }

    /// Returns the samples of demonstration `m` (n·D), smoothed where they are noisy.
    fn smoothed(&self, m: usize) -> Cow<'_, [f64]> {
        let own = self.demos[m].position();
        if self.noise.cut_offs().iter().all(Option::is_none) {
            return own.to_slice().map_or_else(|| Cow::Owned(own.iter().copied().collect()), Cow::Borrowed);
        }
        let smoothed = self.samples(m, &self.seconds(m)).smoothed(self.noise.cut_offs(), self.noise.ends());
        Cow::Owned(smoothed.into_raw_vec_and_offset().0)
    }
}
