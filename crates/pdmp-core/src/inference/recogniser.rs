//! Recognition of a movement while it is observed.

use super::calibration::BandFactors;
use super::estimate::Estimate;
use super::evidence::{Belief, Kernels, Mean, Scratch, Spread, Weigh};
use super::movement_table::MovementTable;
use super::noise_filter::NoiseFilter;
use super::observation::{Hypotheses, Observe, Sums};
use super::pauses::Pauses;
use super::prior::{Moments, Prior};
use super::rotations::{Layout, Sample};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Model;
use crate::numerics::simd::{F64x4, WIDTH, compute};
use crate::validate::{check_number, check_range};

/// Hypotheses of the duration, where the start is known.
const N_DURATIONS: usize = 64;
/// Largest number of hypotheses, where the start or phase is unknown.
const MAX_HYPOTHESES: usize = 384;
/// Largest number of hypotheses of the start or phase.
const MAX_STARTS: usize = 96;
/// Deviations of the logarithm of the duration beyond the demonstrated range that hypotheses cover.
const MARGIN: f64 = 1.0;

/// Knowledge of the time of a movement.
///
/// ```
/// use pdmp_core::inference::Timing;
///
/// assert_eq!(Timing::default().starts, [0.0, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// Earliest and latest start of a discrete movement, in seconds from the first observation: a negative one is a
    /// movement that was joined on its way. Until it starts, it rests. By default, it starts with the first observation.
    /// A rhythmic movement is observed from an unknown phase.
    pub starts: [f64; 2],
    /// Duration or period in seconds, if it is known.
    pub duration: Option<f64>,
}

/// Computations from the observations so far.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Stage {
    /// None.
    Observed,
    /// Means and weights of the hypotheses.
    Weighed,
    /// Covariances and the estimate.
    Estimated,
}

/// Hypothesis of the time of a movement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hypothesis {
    /// Duration or period T, in seconds.
    pub(crate) duration: f64,
    /// Logarithm of the duration, less the mean of the demonstrations.
    pub(crate) log: f64,
    /// Start from the first observation, in durations.
    pub(crate) start: f64,
}

impl Hypothesis {
    /// Returns the fraction of the movement at a time from the first observation.
    pub(crate) fn fraction(&self, time: f64) -> f64 {
        time / self.duration - self.start
    }
}

/// Filter that estimates the parameters of a movement while it is observed.
///
/// Each hypothesis of duration and start has the posterior of θ under the mixture of a [`Prior`], in closed form from the
/// sums of outer products of whitened observations: the movement is linear in θ. An observation takes the same time and
/// memory at any time, and does not allocate.
///
/// The movement may pause. The clock of all hypotheses rests while it does, and what is observed then is no part of the
/// sums ([`Estimate::stopped`]).
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit, rollout};
/// # use pdmp_core::inference::{Recogniser, Timing};
/// # use pdmp_core::learning::learn_prior;
/// # use pdmp_core::motion::TimeGrid;
/// # use pdmp_core::numerics::Threads;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # // Each obstacle is passed twice.
/// # let demos = [demos.clone(), demos].concat();
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let prior = learn_prior(&model, &demos, None, Threads::ONE)?;
/// let mut recogniser = Recogniser::new(&model, &prior, Timing::default())?;
/// // The first half of a movement is seen.
/// let movement = rollout(model.primitive(), &model.conditions(&[1])?, TimeGrid { dt: 0.01, duration: None })?;
/// let n = movement.time.len() / 2;
/// for (&time, position) in movement.time.iter().zip(movement.position.rows()).take(n) {
///     recogniser.update(time, &position.to_vec())?;
/// }
/// let (duration, seen) = (recogniser.estimate()?.duration, recogniser.estimate()?.fraction);
/// assert!(seen > 0.2 && seen < 0.9);
/// let rest = recogniser.continuation(&[duration])?;
/// assert_eq!(rest.position.dim(), (1, model.n_dofs()));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Recogniser {
    pub(crate) prior: Prior,
    pub(crate) table: MovementTable,
    kernels: Kernels,
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// The hypotheses in fours; the last ones in excess have no weight.
    pub(crate) fours: Vec<Hypotheses>,
    pub(crate) noise: NoiseFilter,
    pub(crate) sums: Vec<Sums>,
    pub(crate) beliefs: Vec<Belief>,
    pub(crate) scratch: Scratch,
    pub(crate) rows: Vec<F64x4>,
    pub(crate) layout: Layout,
    /// The last observation.
    pub(crate) sample: Sample,
    /// Positions of the DoFs (D,) under four hypotheses, and their variances.
    pub(crate) lanes: Vec<F64x4>,
    pub(crate) variances: Vec<f64>,
    /// Parameters (K,) in degrees of freedom.
    pub(crate) parameters: Vec<f64>,
    /// Times of the first and the last observation, in seconds.
    pub(crate) times: Option<[f64; 2]>,
    /// Time from the first to the last observation without pauses, in seconds.
    pub(crate) clock: f64,
    /// Filter of pauses, if there may be any.
    pub(crate) pauses: Option<Pauses>,
    /// Number of observed positions.
    pub(crate) n_observed: usize,
    stage: Stage,
    pub(crate) estimate: Estimate,
}

impl Recogniser {
    /// Creates the recogniser of a model with a prior of its parameters.
    ///
    /// # Errors
    /// A prior of another model, a model with a time warp, or times that are not finite.
    pub fn new(model: &Model, prior: &Prior, timing: Timing) -> Result<Self> {
        let mut recogniser = Self::with_durations(model, prior, timing, N_DURATIONS)?;
        recogniser.pauses =
            Some(Pauses::new(prior, &recogniser.layout, &recogniser.noise, &recogniser.sums, &recogniser.table));
        Ok(recogniser)
    }

    /// Creates a recogniser of movements without pauses, with a number of hypotheses of the duration.
    pub(crate) fn with_durations(model: &Model, prior: &Prior, timing: Timing, n_durations: usize) -> Result<Self> {
        prior.check_model(model)?;
        check_linear(model)?;
        let layout = Layout::new(model.primitive());
        let moments = prior.moments(&layout.vectors);
        let table = MovementTable::new(model.primitive(), prior, &moments)?;
        let kernels = Kernels::new(prior, &moments, &table);
        let hypotheses = hypotheses(prior, timing, &moments, n_durations)?;
        let fours: Vec<Hypotheses> = hypotheses.chunks(WIDTH).map(four).collect();
        Ok(Self {
            noise: NoiseFilter::new(prior.residual(), prior.settings().correlation_time),
            sums: vec![Sums::new(&table); fours.len()],
            beliefs: vec![Belief::new(&kernels); fours.len()],
            scratch: Scratch::new(&kernels),
            rows: vec![F64x4::ZERO; model.n_dofs().max(2) * table.width],
            times: None,
            clock: 0.0,
            pauses: None,
            n_observed: 0,
            stage: Stage::Observed,
            estimate: Estimate::new(prior, &layout),
            sample: Sample::missing(&layout),
            lanes: vec![F64x4::ZERO; layout.n_dofs],
            variances: vec![0.0; layout.n_dofs],
            parameters: moments.mean.clone(),
            layout,
            prior: prior.clone(),
            table,
            kernels,
            hypotheses,
            fours,
        })
    }

    /// Forgets all observations. Does not allocate.
    pub fn reset(&mut self) {
        self.sums.iter_mut().for_each(Sums::reset);
        self.noise.restart();
        self.pauses.iter_mut().for_each(Pauses::reset);
        (self.times, self.clock, self.n_observed, self.stage) = (None, 0.0, 0, Stage::Observed);
    }

    /// Returns the number of hypotheses.
    pub fn n_hypotheses(&self) -> usize {
        self.hypotheses.len()
    }

    /// Includes the position (n_q,) at a time in seconds. A missing coordinate is NaN, and a rotation with one is missing;
    /// the interval to the time before is arbitrary. A rotation is one of less than half a turn from the mean of the
    /// demonstrations; the sign of its quaternion does not matter. Does not allocate.
    ///
    /// # Errors
    /// A time that is not after the one before, a wrong number of coordinates, an infinite one, or a quaternion whose norm is
    /// not 1. The recogniser then remains as it was.
    pub fn update(&mut self, time: f64, position: &[f64]) -> Result<()> {
        check_number("time", 0, time)?;
        let (first, interval) = match self.times {
            None => (time, 0.0),
            Some([first, last]) => {
                check_range(
                    "time",
                    time,
                    time > last,
                    "must be after the time of the observation before; reset to begin again",
                )?;
                (first, time - last)
            }
        };
        self.layout.read(position, &mut self.sample)?;
        self.times = Some([first, time]);
        self.stage = Stage::Observed;
        if self.pauses.as_ref().is_none_or(|pauses| !pauses.stopped) {
            self.include(interval);
        }
        self.watch(time);
        Ok(())
    }

    /// Includes the sample after an interval in seconds of the clock.
    pub(crate) fn include(&mut self, interval: f64) {
        self.clock += interval;
        self.n_observed += self.sample.dofs.iter().filter(|y| !y.is_nan()).count();
        self.noise.advance(interval, &self.sample.dofs);
        let Self { table, noise, rows, layout, sample, lanes, .. } = self;
        layout.spread(sample, lanes);
        for (four, sums) in self.fours.iter().zip(&mut self.sums) {
            let places = table.places(four.fraction(self.clock));
            layout.about_means(sample, &places, lanes);
            compute(Observe { sums, table, places, noise, position: lanes, rows });
        }
    }

    /// Returns the estimate from all observations so far. Does not allocate.
    ///
    /// # Errors
    /// No observation yet, or observations so far from the model that their likelihood underflows.
    pub fn estimate(&mut self) -> Result<&Estimate> {
        if self.stage < Stage::Estimated {
            self.weigh()?;
            let Self { kernels, scratch, .. } = self;
            scratch.begin();
            for belief in self.beliefs.iter_mut().filter(|belief| belief.counts()) {
                compute(Spread { belief, kernels, scratch });
            }
            self.summarise();
            self.stage = Stage::Estimated;
        }
        Ok(&self.estimate)
    }

    /// Computes mean and weight of each hypothesis.
    ///
    /// # Errors
    /// As for [`Self::estimate`].
    pub(crate) fn weigh(&mut self) -> Result<()> {
        if self.stage >= Stage::Weighed {
            return Ok(());
        }
        if self.n_observed == 0 {
            let problem = "has none: call update with a position first";
            return Err(Error::Argument { name: "observations", problem });
        }
        let Self { kernels, .. } = self;
        for ((belief, sums), four) in self.beliefs.iter_mut().zip(&self.sums).zip(&self.fours) {
            belief.weight = four.weight;
            compute(Weigh { belief, information: &sums.information, log: four.log, kernels });
        }
        let weights = || self.beliefs.iter().flat_map(|belief| belief.weight.to_array());
        let largest = weights().fold(f64::NEG_INFINITY, f64::max);
        if !largest.is_finite() || weights().any(f64::is_nan) {
            let problem = "are too far from the demonstrations: check their units";
            return Err(Error::Argument { name: "observations", problem });
        }
        let mut sum = 0.0;
        for belief in &mut self.beliefs {
            belief.weight = (belief.weight - F64x4::splat(largest)).exp();
            sum += belief.weight.reduce_add();
        }
        for belief in &mut self.beliefs {
            belief.weight *= F64x4::splat(sum.recip());
            if belief.counts() {
                compute(Mean { belief, kernels });
            }
        }
        self.stage = Stage::Weighed;
        Ok(())
    }

    /// Changes the settings of the prior other than the correlation time, and keeps the observations.
    pub(crate) fn set_prior(&mut self, prior: Prior) {
        self.kernels = Kernels::new(&prior, &prior.moments(&self.layout.vectors), &self.table);
        // The number of components depends on the bandwidth.
        self.beliefs.fill(Belief::new(&self.kernels));
        self.scratch = Scratch::new(&self.kernels);
        self.prior = prior;
        self.stage = Stage::Observed;
    }

    /// Returns the factors of the bands for the share of the movement that was seen, of the estimated duration.
    pub(crate) fn factors(&self, duration: f64) -> BandFactors {
        self.prior.calibration().at(self.clock / duration)
    }
}

/// Checks that the movements of a model are linear in parameters at a clock that is linear in time.
pub(crate) fn check_linear(model: &Model) -> Result<()> {
    if model.breaks().len() > 2 {
        let problem = "has a time warp, for which there is no recognition: fit it with linear time";
        return Err(Error::Argument { name: "model", problem });
    }
    Ok(())
}

/// Returns four hypotheses in lanes; the last ones repeat without weight if there are fewer.
fn four(hypotheses: &[Hypothesis]) -> Hypotheses {
    let lanes =
        |of: fn(&Hypothesis) -> f64| F64x4::new([0, 1, 2, 3].map(|k| of(&hypotheses[k.min(hypotheses.len() - 1)])));
    let weight = [0, 1, 2, 3].map(|k| if k < hypotheses.len() { 0.0 } else { f64::NEG_INFINITY });
    Hypotheses {
        duration: lanes(|hypothesis| hypothesis.duration),
        log: lanes(|hypothesis| hypothesis.log),
        start: lanes(|hypothesis| hypothesis.start),
        weight: F64x4::new(weight),
    }
}

/// Returns hypotheses of duration, and of start or phase.
fn hypotheses(prior: &Prior, timing: Timing, moments: &Moments, n_durations: usize) -> Result<Vec<Hypothesis>> {
    let Moments { log_mean, log_deviation, .. } = *moments;
    let [earliest, latest] = timing.starts;
    check_number("starts", 0, earliest)?;
    check_number("starts", 1, latest)?;
    check_range("starts", latest, latest >= earliest, "must not be before the earliest start")?;
    let rhythmic = prior.kind() == Kind::Rhythmic;
    let ends = [f64::min, f64::max].map(|end| prior.log_durations().iter().copied().fold(log_mean, end));
    let (mut low, mut high) = (ends[0] - MARGIN * log_deviation, ends[1] + MARGIN * log_deviation);
    if let Some(duration) = timing.duration {
        let valid = (1e-9..=1e9).contains(&duration);
        check_range("duration", duration, valid, "seconds must lie between 1e-9 and 1e9")?;
        (low, high) = (duration.ln(), duration.ln());
    }
    let (n_logs, n_starts) = if !rhythmic && earliest == latest {
        (if high > low { n_durations } else { 1 }, 1)
    } else {
        let turns = if rhythmic { 1.0 } else { (latest - earliest) / log_mean.exp() };
        // An error of the logarithm of the duration shifts the end of a movement as one of the start does.
        let n_logs = |n_starts: usize| ((high - low) / turns * n_starts as f64).ceil().min(1e6) as usize + 1;
        let n_starts = (2..=MAX_STARTS).rev().find(|&n| n * n_logs(n) <= MAX_HYPOTHESES).unwrap_or(2);
        (n_logs(n_starts).min(MAX_HYPOTHESES / n_starts), n_starts)
    };
    let step = (high - low) / (n_logs.max(2) - 1) as f64;
    let logs = (0..n_logs).map(|k| low + step * k as f64);
    let start = |duration: f64, k: usize| match (rhythmic, n_starts) {
        (true, n) => -(k as f64) / n as f64,
        (false, 1) => earliest / duration,
        (false, n) => (earliest + (latest - earliest) * k as f64 / (n - 1) as f64) / duration,
    };
    let of = |log: f64| {
        let duration = log.exp();
        (0..n_starts).map(move |k| Hypothesis { duration, log: log - log_mean, start: start(duration, k) })
    };
    Ok(logs.flat_map(of).collect())
}
