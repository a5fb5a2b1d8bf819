//! Simulated recognition of held-out demonstrations.

use super::folds::Fold;
use super::recording::Recording;
use super::{CORRELATION_TIMES, Each, candidates, of_duration, prior_of};
use crate::demonstration::{Demonstration, Sampling};
use crate::error::Result;
use crate::inference::{Prior, Recogniser, SHARES, Settings, Timing};
use crate::learning::factorization::Truncation;
use crate::learning::fit::fit;
use crate::learning::options::{CanonicalOptions, FitOptions};
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

/// Recognises held-out recordings with every candidate.
pub(super) fn errors(each: &Each, model: &Model, fold: &Fold) -> Result<Vec<SimulatedErrors>> {
    let training = each.training(fold);
    let mut errors = vec![SimulatedErrors::new(); fold.held_out.len()];
    for correlation in CORRELATION_TIMES {
        let of =
            |settings| prior_of(model, &training, of_duration(settings, correlation, &model.demonstrated().durations));
        let priors = candidates().map(of).collect::<Result<Vec<_>>>()?;
        let mut recogniser = Recogniser::with_durations(model, &priors[0], Timing::default(), N_DURATIONS)?;
        for (errors, &m) in errors.iter_mut().zip(&fold.held_out) {
            let mut of_shares = Vec::with_capacity(SHARES.len());
            watch(&mut recogniser, &each.recordings[m], |recogniser, _, rest| {
                let step = rest.len().div_ceil(MAX_POSITIONS).max(1);
                let rest: Vec<_> = rest.iter().step_by(step).collect();
                let time: Vec<f64> = rest.iter().map(|(time, _)| *time).collect();
                let error = |prior: &Prior| {
                    recogniser.set_prior(prior.clone());
                    let predicted = recogniser.mean_continuation(&time)?;
                    let square = predicted.indexed_iter().map(|((k, d), mean)| (rest[k].1[d] - mean).powi(2));
                    Ok((square.sum::<f64>() / predicted.len().max(1) as f64).sqrt())
                };
                of_shares.push(priors.iter().map(error).collect::<Result<Vec<f64>>>()?);
                Ok(())
            })?;
            errors.push(of_shares);
        }
    }
    Ok(errors)
}

/// Recognises held-out recordings with the chosen settings.
pub(super) fn outcomes(
    each: &Each,
    model: &Model,
    fold: &Fold,
    correlation: f64,
    settings: Settings,
) -> Result<Vec<Outcome>> {
    let settings = of_duration(settings, correlation, &model.demonstrated().durations);
    let mut recogniser = Recogniser::new(model, &prior_of(model, &each.training(fold), settings)?, Timing::default())?;
    let mut outcomes = Vec::new();
    for &m in &fold.held_out {
        let recording = &each.recordings[m];
        watch(&mut recogniser, recording, |recogniser, share, rest| {
            let time: Vec<f64> = rest.iter().map(|(time, _)| *time).collect();
            let predicted = recogniser.continuation(&time)?;
            let errors = predicted.position.indexed_iter().zip(&predicted.deviation);
            let positions = errors.map(|(((k, d), mean), deviation)| (rest[k].1[d] - mean).abs() / deviation).collect();
            let estimate = recogniser.estimate()?;
            let errors = estimate.goal().iter().zip(&recording.goal).zip(estimate.goal_deviation());
            let goals = errors.map(|((mean, goal), deviation)| (mean - goal).abs() / deviation).collect();
            let duration = (estimate.duration / recording.duration).ln().abs() / estimate.duration_deviation;
            outcomes.push(Outcome { share, positions, goals, duration, misfit: estimate.surprise });
            Ok(())
        })?;
    }
    Ok(outcomes)
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
        compare(recogniser, share, &samples[seen..])?;
    }
    Ok(())
}

/// Fits a model of the same style dimension to the training demonstrations of a fold.
pub(super) fn refit(model: &Model, demos: &[Demonstration], fold: &Fold) -> Result<Model> {
    let bare = |m: &usize| {
        let demo = &demos[*m];
        let sampling = match demo.sampling() {
            Sampling::Unknown => {
                let n_steps = model.kind().steps(demo.n_samples()) as f64;
                Sampling::Uniform { dt: model.demonstrated().durations[*m] / n_steps }
            }
            known => known.clone(),
        };
        // Without contexts, which would cost a map.
        let bare = Demonstration::new(demo.position().to_owned(), sampling)?;
        demo.goal().map_or(Ok(bare.clone()), |goal| bare.with_goal(goal.to_vec()))
    };
    let training = fold.training.iter().map(bare).collect::<Result<Vec<_>>>()?;
    let stamped = training.iter().any(|demo| matches!(demo.sampling(), Sampling::Stamped { .. }));
    let canonical = match CanonicalOptions::from(model.kind()) {
        CanonicalOptions::Rhythmic { mu, .. } if stamped => {
            let periods = fold.training.iter().map(|&m| model.demonstrated().durations[m]).collect();
            CanonicalOptions::Rhythmic { mu, periods }
        }
        canonical => canonical,
    };
    let rank = Truncation::Rank(model.n_styles().min(training.len()));
    let options = FitOptions::new(canonical).n_styles(rank).alpha_z(model.attractor().alpha_z).threads(Threads::ONE);
    fit(&training, &options)
}
