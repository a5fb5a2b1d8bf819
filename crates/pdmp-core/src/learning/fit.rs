//! Learning a primitive from demonstrations: the four steps of Section 3.2, composed.

use std::sync::Arc;

use ndarray::{Array2, s};

use crate::context::{ContextColumn, ContextMap, tabulate};
use crate::demonstration::{ContextValue, Demonstration};
use crate::dynamics::transport::Transport;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::{Aligned, TimeScaling};
use crate::learning::factorization::{Factors, StyleCount};
use crate::learning::options::TransportChoice;
use crate::learning::style_selection::cross_validation::Foresight;
use crate::learning::targets::Targets;
use crate::model::primitive::{Parts, Primitive};
use crate::model::template::Template;
use crate::model::{Demonstrated, Learnt, Model};
use crate::preprocessing::inspection::{inspect, unwound};

use super::constants::Constants;
use super::movement_metric::{metric, residual_variance};
use super::options::{FitOptions, Stage, StyleChoice};
use super::stiffness::stiffness;
use super::style_selection::spectrum;
use super::tabulation::compile;
use super::{noise_findings, time_scaling};

/// Fits a model to demonstrations.
///
/// # Errors
/// Demonstrations or options that do not fit together.
pub fn fit(demos: &[Demonstration], options: &FitOptions) -> Result<Model> {
    fit_with(demos, options, &mut |_, _| Ok(()))
}

/// Fits a model as [`fit`] does, and reports its progress.
///
/// `progress` is called periodically with the stage and the completed share of it; an error that it returns, such as
/// [`Error::Interrupted`], cancels the fit.
///
/// # Errors
/// Demonstrations or options that do not fit together, or the error that `progress` returned.
pub fn fit_with(
    demos: &[Demonstration],
    options: &FitOptions,
    progress: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<Model> {
    if let StyleChoice::Given(count) = options.styles {
        count.check(demos.len(), "demonstrations")?;
    }
    let threads = options.threads;
    let mut findings = inspect(demos, options.alignment.dt);
    let whole = unwound(demos);
    let demos = &*whole;
    let mut aligned = options.alignment.align(demos, threads)?;
    let contexts = contexts_of(demos, options.contexts.as_deref())?;
    let (names, units) = labels_of(demos)?;
    let constants = Constants::of(options, &aligned)?;
    let mut aligning = |share| progress(Stage::Align, share);
    let template = scale_time(&mut aligned, options, &constants, &units, contexts.as_ref(), &mut aligning)?;
    let mut targeting = |share| progress(Stage::Targets, share);
    let mut targets = Targets::of(&aligned, constants.attractor, constants.canonical, threads, &mut targeting)?;
    let ranges = targets.ranges();
    let dof_scale = options.dof_scale.of(&ranges, &units);
    let transport = match (options.transport, constants.canonical.kind()) {
        (TransportChoice::Learnt, Kind::Discrete) => targets.transport(constants.canonical, &dof_scale)?,
        _ => Transport::immediate(),
    };
    let braking = (!transport.is_immediate()).then(|| targets.braking(constants.attractor));
    targets.carry(&transport, constants.attractor, constants.canonical);
    targets.scale(&dof_scale);

    let mut factorising = |share| progress(Stage::Factorise, share);
    let shown = Shown { aligned: &aligned, targets: &targets, transport: &transport, constants: &constants };
    let factors = shown.factors(options, &dof_scale, contexts.as_ref(), &mut factorising)?;
    findings.extend(noise_findings::noisy(&aligned.noise, &ranges, &names));
    let unknown = units.iter().all(String::is_empty);
    findings.extend(noise_findings::left_out(&targets, &factors, &aligned.noise, &names).filter(|_| unknown));
    let Targets { forcing, goals, starts, anchors, .. } = targets;
    drop(forcing);

    progress(Stage::Regress, 0.0)?;
    let clock = constants.canonical.clock(aligned.n_samples);
    let basis_targets = by_clock(&factors.basis, &dof_scale);
    let mut regressing = |share| progress(Stage::Regress, share);
    let regression = options.basis.regress(constants.domain(), &clock, basis_targets.view(), &mut regressing)?;

    let mut compiling = |share| progress(Stage::Compile, share);
    let shape = (factors.basis.nrows(), demos[0].n_dofs());
    let n_samples = clock.len();
    let landscape = compile(constants.canonical, shape, n_samples, regression.as_ref(), threads, &mut compiling)?;

    let (timings, nominal) = (aligned.timings.clone(), aligned.nominal);
    let (columns, contexts) = contexts.unzip();
    let left_out = factors.left_out();
    let Factors { styles, singular_values, .. } = factors;
    let durations = aligned.durations();
    let demonstrated = Demonstrated { styles, goals, starts, anchors, timings, durations, contexts, nominal };
    let Constants { attractor, canonical, tau } = constants;
    let breaks = aligned.breaks.clone();
    let nominal = demonstrated.nominal(canonical.kind());
    let parts = Parts { attractor, landscape, transport, braking, tau, names, units, ranges, breaks, nominal };
    let primitive = Arc::new(Primitive::new(parts));
    findings.extend(stiffness(&primitive, &aligned)?);
    let noise = aligned.noise.clone();
    let (map, left_over) = match (columns, &demonstrated.contexts) {
        (Some(columns), Some(contexts)) => {
            let outputs = demonstrated.outputs(canonical.kind());
            let metric = metric(&primitive, outputs.view(), demonstrated.timings.view())?;
            let map = ContextMap::learn(columns, contexts, outputs.view(), metric.view(), options.map)?;
            (Some(map), Some(residual_variance(&primitive, outputs.view(), aligned)?))
        }
        _ => (None, None),
    };
    let basis = regression.describe();
    let learnt =
        Learnt { n_samples, noise, template, dof_scale, singular_values, left_out, left_over, basis, findings };
    Ok(Model { primitive, demonstrated, learnt, map })
}

/// Contexts (M, Q) of the demonstrations, with what their columns mean.
type Contexts = (Vec<ContextColumn>, Array2<f64>);

/// Scales the time of demonstrations, and returns the template of a warp, if one is made and kept.
fn scale_time(
    aligned: &mut Aligned,
    options: &FitOptions,
    constants: &Constants,
    units: &[String],
    contexts: Option<&Contexts>,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Option<Template>> {
    let (scaling, threads) = (&options.alignment.time_scaling, options.threads);
    let unit = options.dof_scale.given(aligned.demo(0).n_dofs())?;
    let Some((columns, numbers)) = contexts.filter(|_| *scaling == TimeScaling::WarpIfBetter) else {
        return scaling.apply(aligned, unit, threads, progress);
    };
    let linear = aligned.clone();
    let template = scaling.apply(aligned, unit, threads, &mut |share| progress(0.5 * share))?;
    let n_styles = |aligned: &Aligned| {
        let count = match options.styles {
            StyleChoice::Given(count) => count,
            StyleChoice::Systematic => StyleCount::Spectrum(0.9),
            StyleChoice::Auto => StyleCount::Spectrum(1.0),
        };
        let mut targets = Targets::of(aligned, constants.attractor, constants.canonical, threads, &mut |_| Ok(()))?;
        targets.scale(&options.dof_scale.of(&targets.ranges(), units));
        Ok(Factors::of(targets.forcing.view(), count, &mut |_| Ok(()))?.styles.ncols())
    };
    let contexts = time_scaling::Contexts { columns, numbers, map: options.map, n_styles: &n_styles };
    if contexts.favour(aligned, &linear, options.alignment.kind, &mut |share| progress(0.5 + 0.5 * share))? {
        return Ok(template);
    }
    *aligned = linear;
    Ok(None)
}

/// Targets to factorise, and where they come from.
struct Shown<'a> {
    aligned: &'a Aligned<'a>,
    targets: &'a Targets,
    transport: &'a Transport,
    constants: &'a Constants,
}

impl Shown<'_> {
    /// The factors of the targets, as many as the options ask for.
    fn factors(
        &self,
        options: &FitOptions,
        dof_scale: &[f64],
        contexts: Option<&Contexts>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Factors> {
        let Self { aligned, targets, transport, constants } = *self;
        let forcing = targets.forcing.view();
        match options.styles {
            StyleChoice::Systematic => {
                let noise = spectrum::noise_limit(aligned, constants, transport, dof_scale, options.threads)?;
                spectrum::systematic(forcing, noise, contexts, progress)
            }
            StyleChoice::Given(count) => Factors::of(forcing, count, progress),
            StyleChoice::Auto => {
                let (columns, numbers) = contexts.ok_or(Error::Arguments(
                    "n_styles = \"auto\" goes by contexts: pass contexts, a number, or None to go by the spectrum",
                ))?;
                let all = Factors::of(forcing, StyleCount::Spectrum(1.0), &mut |share| progress(0.5 * share))?;
                let foresight =
                    Foresight::new(aligned, targets, &all, transport, constants.attractor, constants.canonical)?;
                let mut second = |share: f64| progress(0.5 + 0.5 * share);
                let n_styles = foresight.styles(columns, numbers, options.map, &mut second)?;
                Ok(all.leading(n_styles))
            }
        }
    }
}

/// F_basis (J, C·D) as outputs over the clock (C, J·D), in the unit of each DoF.
fn by_clock(basis: &Array2<f64>, dof_scale: &[f64]) -> Array2<f64> {
    let n_dofs = dof_scale.len();
    let mut outputs = Array2::zeros((basis.ncols() / n_dofs, basis.nrows() * n_dofs));
    for (c, mut output) in outputs.rows_mut().into_iter().enumerate() {
        let forcing = basis.slice(s![.., c * n_dofs..(c + 1) * n_dofs]);
        for ((output, forcing), scale) in output.iter_mut().zip(forcing).zip(dof_scale.iter().cycle()) {
            *output = forcing * scale;
        }
    }
    outputs
}

/// Contexts (M, Q), with what their columns mean: those given, or those of the demonstrations if they carry any.
fn contexts_of(demos: &[Demonstration], given: Option<&[Vec<ContextValue>]>) -> Result<Option<Contexts>> {
    if let Some(contexts) = given
        && contexts.len() != demos.len()
    {
        let (expected, found) = (demos.len(), contexts.len());
        return Err(Error::Length { name: "contexts", expected, found, per: "demonstration" });
    }
    let contexts: Option<Vec<&[ContextValue]>> = match given {
        Some(contexts) => Some(contexts.iter().map(Vec::as_slice).collect()),
        None if demos.iter().all(|demo| demo.context().is_none()) => None,
        None => Some(demos.iter().map(|demo| demo.context().unwrap_or_default()).collect()),
    };
    contexts.map(|contexts| tabulate(&contexts)).transpose()
}

/// Names and units of the DoFs: those of the demonstrations if they carry any, which must agree.
fn labels_of(demos: &[Demonstration]) -> Result<(Vec<String>, Vec<String>)> {
    let n_dofs = demos.first().map_or(0, Demonstration::n_dofs);
    let names = agreed(demos, Demonstration::names, "names differ from those of the other demonstrations")?;
    let units = agreed(demos, Demonstration::units, "units differ from those of the other demonstrations")?;
    Ok((
        names.unwrap_or_else(|| (0..n_dofs).map(|d| format!("y{d}")).collect()),
        units.unwrap_or_else(|| vec![String::new(); n_dofs]),
    ))
}

/// What all demonstrations that tell it tell alike.
fn agreed(
    demos: &[Demonstration],
    told: impl Fn(&Demonstration) -> Option<&[String]>,
    otherwise: &'static str,
) -> Result<Option<Vec<String>>> {
    let Some(first) = demos.iter().find_map(&told) else { return Ok(None) };
    match demos.iter().position(|demo| told(demo).is_some_and(|other| other != first)) {
        Some(m) => Err(Error::Arguments(otherwise).in_demo(m)),
        None => Ok(Some(first.to_vec())),
    }
}
