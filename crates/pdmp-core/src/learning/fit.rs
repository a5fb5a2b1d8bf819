//! Learning of a primitive from demonstrations: the four steps of Section 3.2.

use std::ops::Range;
use std::sync::Arc;

use ndarray::Array2;

use crate::context::{ContextColumn, ContextMap, tabulate};
use crate::demonstration::{ContextValue, Demonstration, check_labels};
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::{Aligned, Alignment, TimeScaling, Timing};
use crate::learning::factorization::{Factors, Truncation};
use crate::learning::options::TransportSelection;
use crate::learning::style_selection::cross_validation::StyleSelection;
use crate::learning::targets::Targets;
use crate::model::primitive::Primitive;
use crate::model::template::WarpTemplate;
use crate::model::{DemonstrationParameters, FitSummary, Model, Moments};
use crate::preprocessing::inspection::{cycle_ends, inspect, unwound};
use crate::validate::{check_length, check_names};

use super::assembly::Foundation;
use super::braking_rate::share_accelerations;
use super::constants::Constants;
use super::movement_metric::{metric, phase_curves, residual_variance, squared_residuals};
use super::noise_findings;
use super::options::{CanonicalOptions, FitOptions, NStyles, Stage};
use super::rotation_timing;
use super::rotations::{Residuals, vectors_of};
use super::stiffness::stiffness;
use super::style_selection::singular_values::{Recorded, noise_limit, regressors, systematic};
use super::warp_selection::WarpSelection;

/// Fits a model to demonstrations.
///
/// # Errors
/// Demonstrations that do not match each other, options out of range, or options that do not suit the demonstrations.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::{Demonstration, FitOptions, Kind, Sampling, fit};
///
/// let rise = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
/// let position = Array2::from_shape_fn((101, 1), |(c, _)| rise(c as f64 / 100.0));
/// let demonstration = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
/// let model = fit(&[demonstration], &FitOptions::new(Kind::Discrete))?;
/// assert_eq!((model.n_demos(), model.n_dofs(), model.n_styles()), (1, 1, 1));
/// # Ok::<(), pdmp_core::Error>(())
/// ```
pub fn fit(demos: &[Demonstration], options: &FitOptions) -> Result<Model> {
    fit_with(demos, options, &mut |_, _| Ok(()))
}

/// Fits a model as [`fit`] does, and reports its progress.
///
/// `progress` is called periodically with the stage and its completed fraction; an error that it returns, such as
/// [`Error::Interrupted`], cancels the fit.
///
/// # Errors
/// As for [`fit`], or the error that `progress` returned.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::learning::{Stage, fit_with};
/// use pdmp_core::{Demonstration, Error, FitOptions, Kind, Sampling};
///
/// # let position = Array2::from_shape_fn((50, 1), |(c, _)| (0.1 * c as f64).sin());
/// let demonstrations = [Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?];
/// let mut cancel = |stage, _| if stage == Stage::Regress { Err(Error::Interrupted) } else { Ok(()) };
/// let result = fit_with(&demonstrations, &FitOptions::new(Kind::Discrete), &mut cancel);
/// assert!(matches!(result, Err(Error::Interrupted)));
/// # Ok::<(), Error>(())
/// ```
pub fn fit_with(
    demos: &[Demonstration],
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<Model> {
    if let NStyles::Truncated(count) = options.n_styles {
        count.check(demos.len(), "demonstrations")?;
    }
    let threads = options.threads;
    let mut findings = inspect(demos, options.dt);
    if options.canonical.kind() == Kind::Rhythmic {
        findings.extend(cycle_ends(demos));
    }
    let whole = unwound(demos);
    let vectors = vectors_of(&whole)?;
    let mut aligning = |share| progress(Stage::Align, share);
    let timing = if vectors.is_empty() || options.time_scaling == TimeScaling::Linear {
        None
    } else {
        Some(time_rotations(&whole, &vectors, options, &mut aligning)?)
    };
    let residuals = Residuals::of(&whole, options, timing.as_ref().map(|(timing, _)| timing))?;
    let demos = residuals.as_ref().map_or(&*whole, |residuals| &residuals.demos);
    let alignment = Alignment { vectors: vectors.clone(), ..options.alignment() };
    let mut aligned = alignment.align(demos, threads)?;
    let contexts = contexts_of(demos, options.contexts.as_deref())?;
    if !options.context_names.is_empty() {
        let n_columns = contexts.as_ref().map_or(0, |(columns, _)| columns.len());
        check_names("context_names", &options.context_names, n_columns, "context column")?;
    }
    let (names, units) = labels_of(demos)?;
    let constants = Constants::of(options, &aligned)?;
    let template = match timing {
        Some((timing, template)) => {
            aligned.set_timing(timing);
            template
        }
        None => {
            let unit = options.dof_scale.given(demos[0].n_dofs())?;
            scale_time(&mut aligned, options, &constants, &units, contexts.as_ref(), unit, &mut aligning)?
        }
    };
    let mut targeting = |share| progress(Stage::Targets, share);
    let mut targets = Targets::of(&aligned, constants.attractor, constants.canonical, threads, &mut targeting)?;
    let mut ranges = targets.ranges();
    let dof_scale = match &residuals {
        Some(residuals) => {
            residuals.set_ranges(&mut ranges);
            residuals.dof_scale(options, &ranges, &units)?
        }
        None => options.dof_scale.of(&ranges, &units),
    };
    let transport = match options.canonical {
        CanonicalOptions::Discrete { transport: TransportSelection::Learnt, .. } => {
            targets.transport(constants.canonical, &dof_scale)?
        }
        _ => Transport::immediate(),
    };
    let mut accelerations = targets.largest_accelerations();
    share_accelerations(&mut accelerations, &vectors, &aligned, &constants);
    targets.carry(&transport, constants.attractor, constants.canonical);
    targets.scale(&dof_scale);

    let mut factorising = |share| progress(Stage::Factorise, share);
    let training = Training { aligned: &aligned, targets: &targets, transport: &transport, constants: &constants };
    let factors = training.factors(options, &dof_scale, contexts.as_ref(), &mut factorising)?;
    findings.extend(noise_findings::noisy(&aligned.noise, &ranges, &names, &units));
    if units.iter().all(String::is_empty) {
        let squares = |d| noise_findings::squares(targets.forcing.view(), names.len(), d);
        let own = targets.ranges();
        let truncated = noise_findings::truncation_error(&own, squares, &factors, &aligned.noise, &dof_scale, &names);
        findings.extend(truncated);
    }
    let Targets { forcing, goals, starts, anchors, .. } = targets;
    drop(forcing);

    let n_samples = aligned.n_samples;
    let breaks = aligned.breaks.clone();
    let foundation =
        Foundation { constants, transport, dof_scale, ranges, accelerations, names, units, breaks, n_samples, vectors };
    let (forcing_table, regression) = foundation.forcing_table(&factors.basis_targets, options, progress)?;

    let segment_durations = aligned.segment_durations.clone();
    let (columns, contexts) = contexts.unzip();
    let truncation_error = factors.truncation_error();
    let Factors { styles, singular_values, .. } = factors;
    let durations = aligned.durations();
    let demonstrated = DemonstrationParameters {
        styles,
        goals,
        starts,
        anchors,
        segment_durations,
        durations,
        contexts,
        nominal: aligned.nominal,
    };
    let dof_scale = foundation.dof_scale.clone();
    let primitive = foundation.primitive(forcing_table, &demonstrated);
    let nominal = demonstrated.nominal;
    findings.extend(stiffness(&primitive, (nominal, n_samples), |position| aligned.sample(nominal, position))?);
    findings.extend(residuals.iter().flat_map(|residuals| residuals.findings.iter().cloned()));
    let noise = aligned.noise.clone();
    let learn = |columns| {
        let map = learn_map(columns, &primitive, &demonstrated, options)?;
        let outputs = demonstrated.outputs(primitive.kind());
        let curves = phase_curves(&primitive)?;
        let squares = squared_residuals(primitive.kind(), &curves, outputs.view(), aligned);
        Ok::<_, Error>((map, residual_variance(squares, outputs.nrows(), &noise)))
    };
    let (map, residual_variance) = columns.map(learn).transpose()?.unzip();
    let learnt = FitSummary {
        n_samples,
        noise,
        template,
        dof_scale,
        singular_values,
        truncation_error,
        residual_variance,
        regression,
        findings,
    };
    let primitive = match residuals {
        Some(residuals) => residuals.outside(primitive, options.frame),
        None => primitive,
    };
    Ok(Model { primitive, demonstrated, learnt, map, moments: Moments::default() })
}

/// Learns the map from the contexts of the demonstrations to their movements.
pub(super) fn learn_map(
    columns: Vec<ContextColumn>,
    primitive: &Arc<Primitive>,
    demonstrated: &DemonstrationParameters,
    options: &FitOptions,
) -> Result<ContextMap> {
    let outputs = demonstrated.outputs(primitive.kind());
    let metric = metric(primitive, outputs.view(), demonstrated.segment_durations.view())?;
    let no_contexts = Error::Argument { name: "contexts", problem: "is empty: pass one row per movement" };
    let contexts = demonstrated.contexts.as_ref().ok_or(no_contexts)?;
    let map = ContextMap::learn(columns, contexts, outputs.view(), metric.view(), options.map)?;
    map.with_names(options.context_names.clone())
}

/// Types of the context columns (Q,), and the contexts (M, Q) as numbers.
pub(super) type Contexts = (Vec<ContextColumn>, Array2<f64>);

/// Scales the time of the demonstrations, and returns the template of the warp that is kept, if any.
fn scale_time(
    aligned: &mut Aligned,
    options: &FitOptions,
    constants: &Constants,
    units: &[String],
    contexts: Option<&Contexts>,
    unit: Option<&[f64]>,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Option<WarpTemplate>> {
    let (scaling, threads) = (&options.time_scaling, options.threads);
    let Some((columns, numbers)) = contexts.filter(|_| *scaling == TimeScaling::WarpIfBetter) else {
        return scaling.apply(aligned, unit, threads, progress);
    };
    let linear = aligned.clone();
    let template = scaling.apply(aligned, unit, threads, &mut |share| progress(0.5 * share))?;
    let n_styles = |aligned: &Aligned| {
        let count = match options.n_styles {
            NStyles::Truncated(count) => count,
            NStyles::AboveNoise => Truncation::Share(0.9),
            NStyles::CrossValidated => Truncation::Share(1.0),
        };
        let mut targets = Targets::of(aligned, constants.attractor, constants.canonical, threads, &mut |_| Ok(()))?;
        targets.scale(&options.dof_scale.of(&targets.ranges(), units));
        Ok(Factors::of(targets.forcing.view(), count, &mut |_| Ok(()))?.styles.ncols())
    };
    let selection = WarpSelection { columns, numbers, map: options.map, n_styles: &n_styles };
    let mut validating = |share| progress(0.5 + 0.5 * share);
    if selection.favours_warp(aligned, &linear, options.canonical.kind(), &mut validating)? {
        return Ok(template);
    }
    *aligned = linear;
    Ok(None)
}

/// Scales the time of demonstrations with rotations, and returns the template of the warp that is kept, if any.
fn time_rotations(
    demos: &[Demonstration],
    vectors: &[Range<usize>],
    options: &FitOptions,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<(Timing, Option<WarpTemplate>)> {
    let integrated = rotation_timing::integrated(demos, options.canonical.kind())?;
    let alignment = Alignment { vectors: vectors.to_vec(), ..options.alignment() };
    let mut aligned = alignment.align(&integrated, options.threads)?;
    let contexts = contexts_of(demos, options.contexts.as_deref())?;
    let constants = Constants::of(options, &aligned)?;
    let (_, units) = labels_of(&integrated)?;
    let scales = rotation_timing::scales(&integrated, vectors);
    let unit = options.dof_scale.given(scales.len())?.unwrap_or(&scales);
    let template = scale_time(&mut aligned, options, &constants, &units, contexts.as_ref(), Some(unit), progress)?;
    Ok((aligned.timing(), template))
}

/// Targets with the demonstrations and constants that they were computed from.
struct Training<'a> {
    aligned: &'a Aligned<'a>,
    targets: &'a Targets,
    transport: &'a Transport,
    constants: &'a Constants,
}

impl Training<'_> {
    /// Factorises the targets with the number of styles that the options select.
    fn factors(
        &self,
        options: &FitOptions,
        dof_scale: &[f64],
        contexts: Option<&Contexts>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Factors> {
        let Self { aligned, targets, transport, constants } = *self;
        let forcing = targets.forcing.view();
        match options.n_styles {
            NStyles::AboveNoise => {
                let durations = aligned.durations();
                let n_recorded: Vec<usize> = (0..durations.len()).map(|m| aligned.demo(m).n_samples()).collect();
                let recorded = Recorded {
                    noise: &aligned.noise,
                    durations: &durations,
                    n_recorded: &n_recorded,
                    n_samples: aligned.n_samples,
                };
                let noise = noise_limit(&recorded, constants, transport, dof_scale, options.threads)?;
                let regressors = contexts.map(|(columns, numbers)| regressors(columns, numbers));
                systematic(forcing, durations.len(), noise, regressors.as_ref(), progress)
            }
            NStyles::Truncated(count) => Factors::of(forcing, count, progress),
            NStyles::CrossValidated => {
                let (columns, numbers) = contexts.ok_or(Error::Argument {
                    name: "n_styles",
                    problem: "needs contexts for cross-validation: pass contexts, or a number of styles",
                })?;
                let all = Factors::of(forcing, Truncation::Share(1.0), &mut |share| progress(0.5 * share))?;
                let selection =
                    StyleSelection::new(aligned, targets, &all, transport, constants.attractor, constants.canonical);
                let mut validating = |share: f64| progress(0.5 + 0.5 * share);
                let n_styles = selection.n_styles(columns, numbers, options.map, &mut validating)?;
                Ok(all.leading(n_styles))
            }
        }
    }
}

/// Returns the given contexts, or those of the demonstrations; `None` if there are none.
pub(super) fn contexts_of(demos: &[Demonstration], given: Option<&[Vec<ContextValue>]>) -> Result<Option<Contexts>> {
    if let Some(contexts) = given {
        check_length("contexts", contexts.len(), demos.len(), "demonstration")?;
    }
    let contexts: Option<Vec<&[ContextValue]>> = match given {
        Some(contexts) => Some(contexts.iter().map(Vec::as_slice).collect()),
        None if demos.iter().all(|demo| demo.context().is_none()) => None,
        None => Some(demos.iter().map(|demo| demo.context().unwrap_or_default()).collect()),
    };
    contexts.map(|contexts| tabulate(&contexts)).transpose()
}

/// Returns names and units of the DoFs; defaults where no demonstration carries any.
pub(super) fn labels_of(demos: &[Demonstration]) -> Result<(Vec<String>, Vec<String>)> {
    let n_dofs = demos.first().map_or(0, Demonstration::n_coordinates);
    let names = common_labels(demos, Demonstration::names, "names")?;
    let units = common_labels(demos, Demonstration::units, "units")?;
    Ok((
        names.unwrap_or_else(|| (0..n_dofs).map(|d| format!("y{d}")).collect()),
        units.unwrap_or_else(|| vec![String::new(); n_dofs]),
    ))
}

/// Returns the labels that all demonstrations which carry any agree on.
fn common_labels(
    demos: &[Demonstration],
    labels: impl Fn(&Demonstration) -> Option<&[String]>,
    name: &'static str,
) -> Result<Option<Vec<String>>> {
    let first = demos.iter().enumerate().find_map(|(m, demo)| Some((m, labels(demo)?)));
    let Some((owner, first)) = first else { return Ok(None) };
    for (m, demo) in demos.iter().enumerate() {
        check_labels(name, labels(demo), first, &format!("demo {owner}")).map_err(|error| error.in_demo(m))?;
    }
    Ok(Some(first.to_vec()))
}
