//! Prior of the parameters of a movement, with settings and bands from simulated recognition of held-out demonstrations.

mod folds;
mod recording;
mod simulation;

use ndarray::{Array2, Axis, concatenate};

use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::inference::prior::MIN_DEMOS;
use crate::inference::recogniser::check_linear;
use crate::inference::{BandFactors, Calibration, Prior, SHARES, Settings};
use crate::kind::Kind;
use crate::model::Model;
use crate::numerics::threads::Threads;
use crate::validate::check_length;

use folds::{Fold, folds};
use recording::Recording;
use simulation::{Outcome, SimulatedErrors, errors, outcomes, refit};

/// Bandwidths of the kernels, in order of preference.
const BANDWIDTHS: [f64; 3] = [0.6, 1.0, 0.3];
/// Exponents of the likelihood.
const TEMPERINGS: [f64; 3] = [0.1, 1.0, 0.01];
/// Correlation times of the residual, in mean durations.
const CORRELATION_TIMES: [f64; 2] = [0.15, 0.5];
/// Residual of every DoF in addition to that of the demonstrations, relative to the deviation of their positions.
const MIN_RESIDUAL: f64 = 0.02;
/// Quantile of the Gaussian distribution at 0.95, the half-width of a band of 90 %.
const BAND: f64 = 1.644_853_626_951_472_2;
/// Coverage of the bands.
const COVERAGE: f64 = 0.9;

/// Learns the prior of style, goal, start or anchor, and duration from the M demonstrations of a model, in their order.
///
/// Bandwidth, exponent of the likelihood and correlation time of the residual are those with the smallest error of the
/// rest of held-out demonstrations, after 10, 30, 50 and 70 % of each; the model is fitted again without them. The bands
/// are scaled to hold 90 % of their errors.
///
/// `groups` (M,) numbers the person, session or object of each demonstration. Held out is then a group at a time: the prior
/// is one for new groups. Without it, the prior is one for those that the demonstrations show.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
/// # use pdmp_core::learning::learn_prior;
/// # use pdmp_core::numerics::Threads;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # // Each obstacle is passed twice.
/// # let demos = [demos.clone(), demos].concat();
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let prior = learn_prior(&model, &demos, None, Threads::ONE)?;
/// assert_eq!(prior.n_demos(), demos.len());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Other demonstrations than those of the model, fewer than four, fewer than two groups or three demonstrations outside
/// of one, or a model with rotations or a time warp.
pub fn learn_prior(
    model: &Model,
    demos: &[Demonstration],
    groups: Option<&[usize]>,
    threads: Threads,
) -> Result<Prior> {
    check_linear(model)?;
    check_length("demonstrations", demos.len(), model.n_demos(), "demonstration of the fit")?;
    if demos.len() <= MIN_DEMOS {
        let problem = "are too few: a prior needs at least four, to hold one of them out";
        return Err(Error::Argument { name: "demonstrations", problem });
    }
    let durations = &model.demonstrated().durations;
    let of = |(m, demo): (usize, &Demonstration)| Recording::new(demo, model, durations[m]).map_err(|e| e.in_demo(m));
    let recordings: Vec<Recording> = demos.iter().enumerate().map(of).collect::<Result<_>>()?;
    let folds = folds(demos.len(), groups)?;
    let each = Each { recordings: &recordings, folds: &folds, threads };
    let models = each.result(|_, fold| refit(model, demos, fold))?;
    let errors = each.result(|k, fold| errors(&each, &models[k], fold))?;
    let (correlation, settings) = best(&errors.concat());
    let outcomes = each.result(|k, fold| outcomes(&each, &models[k], fold, correlation, settings))?.concat();
    let all: Vec<&Recording> = recordings.iter().collect();
    let settings = of_duration(settings, correlation, &model.demonstrated().durations);
    Ok(prior_of(model, &all, settings)?.with_calibration(calibration(&outcomes)))
}

/// Demonstrations and their folds.
struct Each<'a> {
    recordings: &'a [Recording],
    folds: &'a [Fold],
    threads: Threads,
}

impl Each<'_> {
    /// Computes a result for each fold, by several threads.
    fn result<T: Send>(&self, work: impl Fn(usize, &Fold) -> Result<T> + Sync) -> Result<Vec<T>> {
        let mut results: Vec<Option<T>> = self.folds.iter().map(|_| None).collect();
        let tasks = results.iter_mut().zip(self.folds).enumerate().collect();
        self.threads.try_for_each(tasks, |(k, (result, fold)): (usize, (&mut Option<T>, &Fold))| {
            *result = Some(work(k, fold)?);
            Ok(())
        })?;
        Ok(results.into_iter().flatten().collect())
    }

    /// Returns the recordings that a fold learns from.
    fn training(&self, fold: &Fold) -> Vec<&Recording> {
        fold.training.iter().map(|&m| &self.recordings[m]).collect()
    }
}

/// Returns settings with a correlation time relative to the geometric mean of durations in seconds.
fn of_duration(settings: Settings, correlation: f64, durations: &[f64]) -> Settings {
    let mean = (durations.iter().map(|duration| duration.ln()).sum::<f64>() / durations.len() as f64).exp();
    Settings { correlation_time: correlation * mean, ..settings }
}

/// Returns the candidates for one correlation time.
fn candidates() -> impl Iterator<Item = Settings> {
    let of = |tempering| BANDWIDTHS.into_iter().map(move |bandwidth| (bandwidth, tempering));
    let settings = |(bandwidth, tempering)| Settings { bandwidth, tempering, correlation_time: 1.0 };
    TEMPERINGS.into_iter().flat_map(of).map(settings)
}

/// Returns the prior of the demonstrations of a model with given settings, and bands that are not scaled.
fn prior_of(model: &Model, recordings: &[&Recording], settings: Settings) -> Result<Prior> {
    let demonstrated = model.demonstrated();
    let parameters = match model.kind() {
        Kind::Discrete => vec![demonstrated.styles.view(), demonstrated.goals.view(), demonstrated.starts.view()],
        Kind::Rhythmic => vec![demonstrated.styles.view(), demonstrated.anchors.view()],
    };
    let fit = |_| Error::Argument { name: "model", problem: "has demonstrations of different lengths" };
    let parameters = concatenate(Axis(1), &parameters).map_err(fit)?;
    let residual = residual(model, recordings, &parameters)?;
    let logs = demonstrated.durations.iter().map(|duration| duration.ln()).collect();
    Prior::new(model.kind(), parameters, logs, residual, settings, Calibration::NONE)
}

/// Returns the root mean square deviation (D,) of the recordings from their reproductions, at least [`MIN_RESIDUAL`].
fn residual(model: &Model, recordings: &[&Recording], parameters: &Array2<f64>) -> Result<Vec<f64>> {
    let n_dofs = model.n_dofs();
    let responses = crate::inference::responses(model.primitive())?;
    let steps = responses.nrows() / n_dofs - 1;
    let (mut squares, mut sums, mut totals, mut n) = (vec![0.0; n_dofs], vec![0.0; n_dofs], vec![0.0; n_dofs], 0.0);
    for (recording, parameters) in recordings.iter().zip(parameters.rows()) {
        let reproduced = responses.dot(&parameters);
        for (time, position) in recording.samples() {
            let place = time / recording.duration * steps as f64;
            let index = (place as usize).min(steps - 1);
            for (d, y) in position.iter().enumerate() {
                let [below, above] = [index, index + 1].map(|k| reproduced[k * n_dofs + d]);
                squares[d] += (y - below - (place - index as f64) * (above - below)).powi(2);
                sums[d] += y;
                totals[d] += y * y;
            }
            n += 1.0;
        }
    }
    let scale = model.ranges().iter().copied().fold(0.0, f64::max);
    let of = |d: usize| {
        let variance = (totals[d] - sums[d] * sums[d] / n).max(0.0) / n;
        (squares[d] / n + MIN_RESIDUAL * MIN_RESIDUAL * variance).sqrt().max(1e-6 * scale).max(f64::MIN_POSITIVE.sqrt())
    };
    Ok((0..n_dofs).map(of).collect())
}

/// Returns the correlation time and the candidate with the smallest error of the rest, by the geometric mean over the
/// shares seen.
fn best(errors: &[SimulatedErrors]) -> (f64, Settings) {
    let mut best =
        (f64::INFINITY, CORRELATION_TIMES[0], Settings { bandwidth: 1.0, tempering: 1.0, correlation_time: 1.0 });
    for (c, correlation) in CORRELATION_TIMES.into_iter().enumerate() {
        for (k, settings) in candidates().enumerate() {
            let of = |share: usize| errors.iter().map(|errors| errors[c][share][k]).sum::<f64>().max(1e-300);
            let score = (0..SHARES.len()).map(|share| of(share).ln()).sum::<f64>();
            if score < best.0 {
                best = (score, correlation, settings);
            }
        }
    }
    (best.1, best.2)
}

/// Returns the factors of the bands.
fn calibration(outcomes: &[Outcome]) -> Calibration {
    Calibration([0, 1, 2, 3].map(|share| {
        let own = outcomes.iter().filter(|outcome| outcome.share == share);
        let of = |errors: &dyn Fn(&Outcome) -> Vec<f64>| quantile(own.clone().flat_map(errors).collect());
        BandFactors {
            position: of(&|outcome| outcome.positions.clone()) / BAND,
            goal: of(&|outcome| outcome.goals.clone()) / BAND,
            duration: of(&|outcome| vec![outcome.duration]) / BAND,
            misfit: of(&|outcome| vec![outcome.misfit]),
        }
    }))
}

/// Returns the value that the share [`COVERAGE`] of n values and a new one do not exceed: the ⌈0.9 (n + 1)⌉-th.
fn quantile(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (COVERAGE * (values.len() + 1) as f64).ceil() as usize;
    let last = values.len().saturating_sub(1);
    let value = values.get(rank.saturating_sub(1).min(last)).copied().filter(|value| !value.is_nan());
    value.unwrap_or(BAND).clamp(1e-6, 1e6)
}
