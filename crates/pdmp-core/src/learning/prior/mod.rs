//! Prior of the parameters of a movement, with settings and bands from simulated recognition of held-out demonstrations.

mod fitted;
mod folds;
mod recording;
mod selection;
mod simulation;

use ndarray::{Array2, ArrayView2, Axis};

use crate::context::ContextMap;
use crate::demonstration::{ContextValue, Demonstration};
use crate::error::{Error, Result};
use crate::inference::prior::MIN_DEMOS;
use crate::inference::recogniser::check_linear;
use crate::inference::{Calibration, Layout, Mixture, Prior, Settings};
use crate::model::Model;
use crate::numerics::threads::Threads;
use crate::validate::check_length;

use fitted::fitted;
use folds::folds;
use recording::Recording;
use simulation::{Refit, Simulation};

/// Residual of every DoF in addition to that of the demonstrations, relative to the deviation of their positions.
const MIN_RESIDUAL: f64 = 0.02;
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
/// of one, or a model with a time warp.
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
    let demos = fitted(model, demos, threads)?;
    let contexts = contexts_of(model)?;
    let shown = Shown { demos: &demos, recordings: &recordings, contexts: contexts.as_deref() };
    let refits = each(threads, &folds(demos.len(), groups)?, |fold| Refit::new(model, &shown, fold))?;
    let prior = prior_of(model, &recordings.iter().collect::<Vec<_>>())?;
    let simulation = Simulation { recordings: &recordings, refits: &refits, contexts: None, threads };
    let (settings, calibration) = simulation.learn(durations)?;
    let mixture = Mixture { settings, calibration, ..prior.mixture().clone() };
    let learnt = Prior::new(model.kind(), mixture, prior.residual().to_vec())?.of_model(model);
    let simulation = Simulation { contexts: contexts.as_deref(), ..simulation };
    match prior.deviations() {
        Some(deviations) if simulation.n_held_out()? >= MIN_DEMOS => {
            let (settings, calibration) = simulation.learn(durations)?;
            learnt.with_deviations(Mixture { settings, calibration, ..deviations.clone() })
        }
        _ => Ok(learnt),
    }
}

/// Demonstrations, with what is known of each.
struct Shown<'a> {
    demos: &'a [Demonstration],
    recordings: &'a [Recording],
    /// Contexts (M, Q), if there are any.
    contexts: Option<&'a [Vec<ContextValue>]>,
}

/// Returns the contexts of the demonstrations of a model; `None` without a context map.
fn contexts_of(model: &Model) -> Result<Option<Vec<Vec<ContextValue>>>> {
    let demonstrated = model.map().zip(model.demonstrated().contexts.as_ref());
    let of = |(map, contexts): (&ContextMap, &Array2<f64>)| {
        contexts.rows().into_iter().map(|row| map.context(&row.to_vec())).collect::<Result<Vec<_>>>()
    };
    demonstrated.map(of).transpose()
}

/// Computes a result for each item, by several threads.
fn each<A: Sync, T: Send>(threads: Threads, items: &[A], work: impl Fn(&A) -> Result<T> + Sync) -> Result<Vec<T>> {
    let mut results: Vec<Option<T>> = items.iter().map(|_| None).collect();
    let tasks = results.iter_mut().zip(items).collect();
    threads.try_for_each(tasks, |(result, item): (&mut Option<T>, &A)| {
        *result = Some(work(item)?);
        Ok(())
    })?;
    Ok(results.into_iter().flatten().collect())
}

/// Returns the prior of the demonstrations of a model, with settings and factors to be learnt.
fn prior_of(model: &Model, recordings: &[&Recording]) -> Result<Prior> {
    let demonstrated = model.demonstrated();
    let outputs = demonstrated.outputs(model.kind());
    let mixture = |outputs: ArrayView2<f64>| {
        let (parameters, logs) = outputs.split_at(Axis(1), outputs.ncols() - 1);
        let settings = Settings { bandwidth: 1.0, tempering: 1.0, correlation_time: 1.0 };
        let (parameters, log_durations) = (parameters.to_owned(), logs.iter().copied().collect());
        Mixture { parameters, log_durations, settings, calibration: Calibration::NONE }
    };
    let own = mixture(outputs.view());
    let residual = residual(model, recordings, &own.parameters)?;
    let prior = Prior::new(model.kind(), own, residual)?;
    let Some((map, contexts)) = model.map().zip(demonstrated.contexts.as_ref()) else { return Ok(prior) };
    prior.with_deviations(mixture(map.deviations(contexts, outputs.view())?.view()))
}

/// Returns the root mean square deviation (D,) of the recordings from their reproductions, at least [`MIN_RESIDUAL`]. The
/// components of rotations, and those of the points of poses, share theirs.
fn residual(model: &Model, recordings: &[&Recording], parameters: &Array2<f64>) -> Result<Vec<f64>> {
    let n_dofs = model.n_dofs();
    let responses = crate::inference::responses(model.primitive())?;
    let steps = responses.nrows() / n_dofs - 1;
    let (mut squares, mut sums, mut totals, mut n) = (vec![0.0; n_dofs], vec![0.0; n_dofs], vec![0.0; n_dofs], 0.0);
    let (layout, mut positions, mut dofs) = (Layout::new(model.primitive()), Vec::new(), vec![0.0; n_dofs]);
    for (recording, parameters) in recordings.iter().zip(parameters.rows()) {
        let reproduced = responses.dot(&parameters);
        for (time, position) in recording.samples() {
            let place = time / recording.duration * steps as f64;
            let index = (place as usize).min(steps - 1);
            layout.dofs(time / recording.duration, &position, &mut dofs);
            for (d, y) in dofs.iter().enumerate() {
                let [below, above] = [index, index + 1].map(|k| reproduced[k * n_dofs + d]);
                squares[d] += (y - below - (place - index as f64) * (above - below)).powi(2);
                sums[d] += y;
                totals[d] += y * y;
            }
            n += 1.0;
            positions.push(position);
        }
    }
    let scale = model.ranges().iter().copied().fold(0.0, f64::max);
    let mut variances: Vec<f64> = (0..n_dofs).map(|d| (totals[d] - sums[d] * sums[d] / n).max(0.0) / n).collect();
    layout.set_variances(&positions, &mut variances);
    for (variance, square) in variances.iter_mut().zip(&squares) {
        *variance = square / n + MIN_RESIDUAL * MIN_RESIDUAL * *variance;
    }
    layout.share(&mut variances);
    let least = (1e-6 * scale).max(f64::MIN_POSITIVE.sqrt());
    Ok(variances.into_iter().map(|variance| variance.sqrt().max(least)).collect())
}
