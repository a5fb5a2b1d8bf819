//! Simulated recognition of held-out demonstrations.

use super::folds::Fold;
use super::recording::Recording;
use super::selection::{CORRELATION_TIMES, best, calibration, candidates, of_duration};
use super::{Shown, each, prior_of};
use crate::context::MapSelection;
use crate::demonstration::{ContextValue, Sampling};
use crate::error::{Error, Result};
use crate::inference::{Calibration, Prior, Recogniser, SHARES, Settings, Timing};
use crate::learning::factorization::Truncation;
use crate::learning::fit::fit;
use crate::learning::options::{CanonicalOptions, DofScaling, FitOptions};
use crate::model::Model;
use crate::numerics::threads::Threads;

/// Hypotheses of the duration while candidates are compared.
const N_DURATIONS: usize = 16;
/// Largest number of positions to come of a recording at which candidates are compared.
const MAX_POSITIONS: usize = 12;

/// Root mean square errors of the rest of a held-out recording, for each correlation time, share seen and candidate.
pub(super) type SimulatedErrors = Vec<Vec<Vec<f64>>>;

/// Errors after a share of a held-out recording.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// Index of the share seen.
    pub(super) share: usize,
    /// Errors of the rest, in standard deviations.
    pub(super) positions: Vec<f64>,
    /// Errors of the goal or anchor, in standard deviations.
    pub(super) goals: Vec<f64>,
    /// Error of the logarithm of the duration, in standard deviations.
    pub(super) duration: f64,
    /// Mean squared whitened residual.
    pub(super) misfit: f64,
}

/// Model of the demonstrations outside of a fold.
pub(super) struct Refit {
    model: Model,
    prior: Prior,
    held_out: Vec<usize>,
}

impl Refit {
    /// Fits the demonstrations outside of a fold.
    pub(super) fn new(model: &Model, shown: &Shown, fold: &Fold) -> Result<Self> {
        let model = refit(model, shown, fold)?;
        let training: Vec<&Recording> = fold.training.iter().map(|&m| &shown.recordings[m]).collect();
        Ok(Self { prior: prior_of(&model, &training)?, model, held_out: fold.held_out.clone() })
    }

    /// Returns settings with a correlation time relative to the geometric mean of the durations.
    fn settings(&self, settings: Settings, correlation: f64) -> Settings {
        of_duration(settings, correlation, &self.model.demonstrated().durations)
    }
}

/// Recognition of held-out recordings by models of the others.
#[derive(Clone, Copy)]
pub(super) struct Simulation<'a> {
    pub(super) recordings: &'a [Recording],
    pub(super) refits: &'a [Refit],
    /// Contexts (M, Q) in which recordings are recognised; `None` for recognition without contexts.
    pub(super) contexts: Option<&'a [Vec<ContextValue>]>,
    pub(super) threads: Threads,
}

impl Simulation<'_> {
    /// Returns the best settings of a prior of demonstrations of given durations in seconds, and the factors of its bands.
    pub(super) fn learn(&self, durations: &[f64]) -> Result<(Settings, Calibration)> {
        let errors = each(self.threads, self.refits, |refit| self.errors(refit))?.concat();
        let (correlation, settings) = best(&errors);
        let outcomes = each(self.threads, self.refits, |refit| self.outcomes(refit, correlation, settings))?;
        Ok((of_duration(settings, correlation, durations), calibration(&outcomes.concat())))
    }

    /// Returns the number of recordings that are recognised.
    pub(super) fn n_held_out(&self) -> Result<usize> {
        let of = |refit: &Refit| Ok(self.held_out(refit)?.len());
        self.refits.iter().map(of).sum()
    }

    /// Returns the held-out recordings of a fold with their priors. Without those whose label the others lack.
    fn held_out(&self, Refit { model, prior, held_out }: &Refit) -> Result<Vec<(&Recording, Prior)>> {
        let of = |&m: &usize| match self.contexts {
            None => Some(Ok((&self.recordings[m], prior.clone()))),
            Some(contexts) => match prior.given(model, &contexts[m]) {
                Err(Error::Label { .. }) => None,
                given => Some(given.map(|prior| (&self.recordings[m], prior))),
            },
        };
        held_out.iter().filter_map(of).collect()
    }

    /// Recognises held-out recordings with every candidate.
    fn errors(&self, refit: &Refit) -> Result<Vec<SimulatedErrors>> {
        let of = |(recording, prior): (&Recording, Prior)| {
            CORRELATION_TIMES.into_iter().map(|time| errors_of_candidates(refit, recording, &prior, time)).collect()
        };
        self.held_out(refit)?.into_iter().map(of).collect()
    }

    /// Recognises held-out recordings with the chosen settings.
    fn outcomes(&self, refit: &Refit, correlation: f64, settings: Settings) -> Result<Vec<Outcome>> {
        let mut outcomes = Vec::new();
        for (recording, prior) in self.held_out(refit)? {
            let prior = prior.with_settings(refit.settings(settings, correlation))?;
            let mut recogniser = Recogniser::new(&refit.model, &prior, Timing::default())?;
            watch(&mut recogniser, recording, |recogniser, share, rest| {
                outcomes.push(outcome(recogniser, recording, share, rest)?);
                Ok(())
            })?;
        }
        Ok(outcomes)
    }
}

/// Returns the errors of the rest of a recording for each share seen and candidate of a correlation time.
fn errors_of_candidates(
    refit: &Refit,
    recording: &Recording,
    prior: &Prior,
    correlation: f64,
) -> Result<Vec<Vec<f64>>> {
    let of = |settings| prior.clone().with_settings(refit.settings(settings, correlation));
    let priors = candidates().map(of).collect::<Result<Vec<_>>>()?;
    let mut recogniser = Recogniser::with_durations(&refit.model, &priors[0], Timing::default(), N_DURATIONS)?;
    let mut of_shares = Vec::with_capacity(SHARES.len());
    let (mut errors, scale) = (vec![0.0; refit.model.n_dofs()], scale(&refit.model));
    watch(&mut recogniser, recording, |recogniser, _, rest| {
        let step = rest.len().div_ceil(MAX_POSITIONS).max(1);
        let rest: Vec<_> = rest.iter().step_by(step).collect();
        let time: Vec<f64> = rest.iter().map(|(time, _)| *time).collect();
        let error = |prior: &Prior| {
            recogniser.set_prior(prior.clone());
            let predicted = recogniser.mean_continuation(&time)?;
            let mut square = 0.0;
            for (predicted, (_, position)) in predicted.rows().into_iter().zip(&rest) {
                recogniser.layout.errors(&predicted.to_vec(), position, &mut errors);
                errors.iter().zip(&scale).for_each(|(error, scale)| square += (error / scale).powi(2));
            }
            Ok((square / (rest.len() * scale.len()).max(1) as f64).sqrt())
        };
        of_shares.push(priors.iter().map(error).collect::<Result<Vec<f64>>>()?);
        Ok(())
    })?;
    Ok(of_shares)
}

/// Compares an estimate after a share of a recording with the rest of it.
fn outcome(
    recogniser: &mut Recogniser,
    recording: &Recording,
    share: usize,
    rest: &[(f64, Vec<f64>)],
) -> Result<Outcome> {
    let time: Vec<f64> = rest.iter().map(|(time, _)| *time).collect();
    let predicted = recogniser.continuation(&time)?;
    recogniser.estimate()?;
    let (layout, estimate) = (&recogniser.layout, &recogniser.estimate);
    let mut errors = vec![0.0; layout.n_dofs];
    let mut relative = |predicted: &[f64], position: &[f64], deviations: &[f64]| {
        layout.errors(predicted, position, &mut errors);
        errors.iter().zip(deviations).map(|(error, deviation)| error.abs() / deviation).collect::<Vec<f64>>()
    };
    let mut positions = Vec::with_capacity(predicted.deviation.len());
    let rows = predicted.position.rows().into_iter().zip(predicted.deviation.rows());
    for ((predicted, deviations), (_, position)) in rows.zip(rest) {
        positions.extend(relative(&predicted.to_vec(), position, &deviations.to_vec()));
    }
    let goals = relative(estimate.goal(), &recording.goal(layout), estimate.goal_deviation());
    let duration = (estimate.duration / recording.duration).ln().abs() / estimate.duration_deviation;
    Ok(Outcome { share, positions, goals, duration, misfit: estimate.surprise })
}

/// Returns the unit (D,) in which errors count: that of the factorisation of a model with rotations, whose angles and lengths
/// have none in common.
fn scale(model: &Model) -> Vec<f64> {
    match model.primitive().coordinates() {
        Some(_) => model.learnt().dof_scale.clone(),
        None => vec![1.0; model.n_dofs()],
    }
}

/// Shows a recording, and calls `compare` after each share with its index and the samples to come.
fn watch(
    recogniser: &mut Recogniser,
    recording: &Recording,
    mut compare: impl FnMut(&mut Recogniser, usize, &[(f64, Vec<f64>)]) -> Result<()>,
) -> Result<()> {
    recogniser.reset();
    let samples: Vec<(f64, Vec<f64>)> = recording.samples().collect();
    let mut seen = 0;
    for (share, part) in SHARES.into_iter().enumerate() {
        while seen + 1 < samples.len() && (seen == 0 || samples[seen].0 <= part * recording.duration) {
            recogniser.update(samples[seen].0, &samples[seen].1)?;
            seen += 1;
        }
        compare(recogniser, share, &recording.rest(seen))?;
    }
    Ok(())
}

/// Fits a model of the same style dimension to the training demonstrations of a fold.
fn refit(model: &Model, shown: &Shown, fold: &Fold) -> Result<Model> {
    let training = fold.training.iter().map(|&m| shown.demos[m].clone()).collect::<Vec<_>>();
    let stamped = training.iter().any(|demo| matches!(demo.sampling(), Sampling::Stamped { .. }));
    let canonical = match CanonicalOptions::from(model.kind()) {
        CanonicalOptions::Rhythmic { mu, .. } if stamped => {
            let periods = fold.training.iter().map(|&m| model.demonstrated().durations[m]).collect();
            CanonicalOptions::Rhythmic { mu, periods }
        }
        canonical => canonical,
    };
    let rank = Truncation::Rank(model.n_styles().min(training.len()));
    let mut options =
        FitOptions::new(canonical).n_styles(rank).alpha_z(model.attractor().alpha_z).threads(Threads::ONE);
    if let Some(coordinates) = model.primitive().coordinates() {
        options = options.dof_scale(DofScaling::Given(scale(model))).frame(coordinates.frame());
    }
    let contexts = shown.contexts.map(|contexts| fold.training.iter().map(|&m| contexts[m].clone()).collect());
    let map = model.map().map_or(MapSelection::Auto, |map| MapSelection::Given(map.kind()));
    fit(&training, &FitOptions { contexts, map, ..options })
}
