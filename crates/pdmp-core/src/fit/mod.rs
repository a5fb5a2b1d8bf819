//! Learning a primitive from demonstrations: the four steps of Section 3.2, composed.

use std::f64::consts::TAU;
use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use ndarray::{Array2, s};

use crate::align::{Aligned, Alignment, TimeScaling};
use crate::attractor::Attractor;
use crate::basis::{Basis, Domain, Gp};
use crate::context::{ContextColumn, ContextMap, MapChoice, tabulate};
use crate::demo::{ContextValue, Demonstration, check_context};
use crate::error::{Error, Result, check_positive, check_vector};
use crate::factor::{Factors, StyleCount};
use crate::foresight::Foresight;
use crate::landscape::Landscape;
use crate::model::{Demonstrated, Learnt, Model};
use crate::phase::{Canonical, Kind};
use crate::smooth::Smoothing;
use crate::targets::Targets;
use crate::threads::Threads;

/// The unit of each degree of freedom in the factorisation.
#[derive(Clone, Debug, PartialEq)]
pub enum DofScale {
    /// As recorded: right where all DoFs have one unit.
    Unit,
    /// The range of each DoF, so that all weigh alike.
    Range,
    /// Given (D,), in the unit of each DoF.
    Given(Vec<f64>),
}

/// Everything that can be chosen about a fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// How demonstrations are read and aligned.
    pub alignment: Alignment,
    /// Conditions of the demonstrations (M rows of Q); otherwise those that they carry.
    pub contexts: Option<Vec<Vec<ContextValue>>>,
    /// What leads from contexts to movements.
    pub map: MapChoice,
    /// Style dimension J.
    pub styles: StyleChoice,
    /// Function approximator of the landscape.
    pub basis: Basis,
    /// Unit of each DoF in the factorisation.
    pub dof_scale: DofScale,
    /// Time constant τ in seconds, discrete; otherwise the nominal duration.
    pub tau: Option<f64>,
    /// α_z of the output system.
    pub alpha_z: f64,
    /// β_z of the output system; otherwise α_z/4, critical damping.
    pub beta_z: Option<f64>,
    /// α_x of the canonical system, discrete; otherwise x = 0.01 at the end of the nominal demonstration.
    pub alpha_x: Option<f64>,
    /// μ of the canonical system, rhythmic.
    pub mu: f64,
    /// How many threads may work on it. The model does not depend on it, to the last bit.
    pub threads: Threads,
}

impl FitOptions {
    /// The defaults: as many styles as make up nine tenths of the singular values, a Gaussian process, no smoothing,
    /// α_z = 25, μ = 1, as many threads as the system allows, and all else from the demonstrations.
    pub fn new(kind: Kind) -> Self {
        let smoothing = Smoothing::Interpolate;
        Self {
            alignment: Alignment {
                kind,
                dt: None,
                period: Vec::new(),
                smoothing,
                nominal: None,
                n_samples: None,
                time_scaling: TimeScaling::Linear,
            },
            contexts: None,
            map: MapChoice::Auto,
            styles: StyleCount::Spectrum(0.9).into(),
            basis: Basis::Gp(Gp::default()),
            dof_scale: DofScale::Unit,
            tau: None,
            alpha_z: 25.0,
            beta_z: None,
            alpha_x: None,
            mu: 1.0,
            threads: Threads::available(),
        }
    }
}

/// How the number of styles J is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StyleChoice {
    /// By number, or by the spectrum.
    Given(StyleCount),
    /// The fewest that foresee movements, in contexts held out, with an error above the least that any number has by no
    /// more than the standard error of the difference: cross-validation over the contexts, in at most ten folds.
    Auto,
}

impl From<StyleCount> for StyleChoice {
    fn from(count: StyleCount) -> Self {
        Self::Given(count)
    }
}

/// Where a fit is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The warps of step 1, where time is not scaled linearly.
    Align,
    /// The rest of step 1, and step 2, demonstration by demonstration.
    Targets,
    /// Step 3.
    Factorise,
    /// Step 4.
    Regress,
    /// Compiling the landscape to its table.
    Compile,
}

impl Stage {
    /// The name shown to a user.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Align => "align",
            Stage::Targets => "targets",
            Stage::Factorise => "factorise",
            Stage::Regress => "regress",
            Stage::Compile => "compile",
        }
    }
}

/// Learns a primitive.
///
/// `proceed` is told now and then the stage and the share of it that is done; an error that it returns, such as
/// [`Error::Interrupted`], ends the fit.
///
/// # Errors
/// Demonstrations or options that do not fit together, or whatever `proceed` returns.
pub fn fit(
    demos: &[Demonstration],
    options: &FitOptions,
    proceed: &mut dyn FnMut(Stage, f64) -> Result<()>,
) -> Result<Model> {
    if let StyleChoice::Given(count) = options.styles {
        count.check(demos.len(), "demonstrations")?;
    }
    let mut aligned = options.alignment.align(demos)?;
    let contexts = contexts_of(demos, options.contexts.as_deref())?;
    let (names, units) = labels_of(demos)?;
    let constants = Constants::of(options, &aligned)?;
    let threads = options.threads;
    let mut aligning = |share| proceed(Stage::Align, share);
    let unit = options.dof_scale.given(demos[0].n_dofs())?;
    let template = options.alignment.time_scaling.apply(&mut aligned, unit, threads, &mut aligning)?;
    let mut targeting = |share| proceed(Stage::Targets, share);
    let mut targets = Targets::of(&aligned, constants.attractor, constants.canonical, threads, &mut targeting)?;
    let ranges = targets.ranges();
    let dof_scale = options.dof_scale.of(&ranges);
    targets.scale(&dof_scale);

    let mut factorising = |share| proceed(Stage::Factorise, share);
    let factors = match options.styles {
        StyleChoice::Given(count) => Factors::of(targets.forcing.view(), count, &mut factorising)?,
        StyleChoice::Auto => {
            let (columns, numbers) = contexts.as_ref().ok_or(Error::Arguments(
                "n_styles = \"auto\" goes by contexts: pass contexts, a number, or None to go by the spectrum",
            ))?;
            let all = Factors::of(targets.forcing.view(), StyleCount::Spectrum(1.0), &mut factorising)?;
            let foresight = Foresight::new(&aligned, &targets, &all, constants.attractor, constants.canonical)?;
            let n_styles = foresight.styles(columns, numbers, options.map, &mut factorising)?;
            all.leading(n_styles)
        }
    };
    let Targets { forcing, goals, starts, anchors, .. } = targets;
    drop(forcing);

    proceed(Stage::Regress, 0.0)?;
    let clock = constants.canonical.clock(aligned.n_samples);
    let basis_targets = by_clock(&factors.basis, &dof_scale);
    let mut regressing = |share| proceed(Stage::Regress, share);
    let regression = options.basis.regress(constants.domain(), &clock, basis_targets.view(), &mut regressing)?;

    let mut compiling = |share| proceed(Stage::Compile, share);
    let shape = (factors.basis.nrows(), demos[0].n_dofs());
    let n_samples = clock.len();
    let landscape =
        Landscape::compile(constants.canonical, shape, n_samples, regression.as_ref(), threads, &mut compiling)?;

    let durations = aligned.durations();
    let (breaks, timings, nominal) = (aligned.breaks.clone(), aligned.timings.clone(), aligned.nominal);
    let (columns, contexts) = contexts.unzip();
    let left_out = factors.left_out();
    let Factors { styles, singular_values, .. } = factors;
    let demonstrated = Demonstrated { styles, goals, starts, anchors, breaks, timings, durations, contexts, nominal };
    let learnt = Learnt {
        n_samples,
        smoothing: options.alignment.smoothing,
        template,
        dof_scale,
        singular_values,
        left_out,
        left_over: None,
        basis: regression.describe(),
    };
    let Constants { attractor, tau, .. } = constants;
    let (cycle, responses) = Default::default();
    let map = None;
    let model = Model { attractor, landscape, tau, names, units, ranges, demonstrated, learnt, map, cycle, responses };
    let mut model = Arc::new(model.with_cycle());
    if let (Some(columns), Some(contexts)) = (columns, &model.demonstrated.contexts) {
        let (outputs, metric) = (model.outputs(), model.metric()?);
        let map = ContextMap::learn(columns, contexts, outputs.view(), metric.view(), options.map)?;
        let left_over = model.left_over(aligned)?;
        let model = Arc::make_mut(&mut model);
        (model.map, model.learnt.left_over) = (Some(map), Some(left_over));
    }
    Ok(Arc::unwrap_or_clone(model))
}

/// The style (J,) of a demonstration that the model was not fitted to: least squares on its target.
///
/// `dt` in seconds and `period` serve as in a fit. Its time is scaled as that of the others was: where theirs was warped
/// so is this one's, and where they had events it needs its own (E,), in seconds.
///
/// # Errors
/// A demonstration that does not fit the model, or events where the others had none.
pub fn style_of(
    model: &Model,
    demo: &Demonstration,
    dt: Option<f64>,
    period: Option<f64>,
    events: Option<&[f64]>,
) -> Result<Vec<f64>> {
    let n_dofs = model.n_dofs();
    if demo.n_dofs() != n_dofs {
        let (expected, found) = (n_dofs, demo.n_dofs());
        return Err(Error::Length { name: "demonstration", expected, found, per: "DoF" });
    }
    let alignment = Alignment {
        kind: model.kind(),
        dt,
        period: period.into_iter().collect(),
        smoothing: model.learnt.smoothing,
        nominal: None,
        n_samples: Some(model.learnt.n_samples),
        time_scaling: TimeScaling::Linear,
    };
    let mut aligned = alignment.align(std::slice::from_ref(demo))?;
    let by_events = model.learnt.template.is_none() && model.demonstrated.timings.ncols() > 1;
    match (&model.learnt.template, events) {
        (None, Some(events)) if by_events => aligned.register_to(&model.demonstrated.breaks, events)?,
        (None, None) if by_events => {
            return Err(Error::Arguments("the model was fitted with events: pass events= of this demonstration too"));
        }
        (_, Some(_)) => {
            return Err(Error::Arguments("the model was fitted without events: leave out events="));
        }
        (Some(template), None) => aligned.warp_to(template)?,
        (None, None) => {}
    }
    let mut target = Targets::of(&aligned, model.attractor, model.canonical(), Threads::ONE, &mut |_| Ok(()))?;
    let scale = &model.learnt.dof_scale;
    target.scale(scale);
    let target = target.forcing;

    let clock = model.canonical().clock(model.learnt.n_samples);
    let n_outputs = model.landscape.n_outputs();
    let mut design = Mat::zeros(target.len(), model.n_styles());
    let (mut value, mut slope) = (vec![0.0; n_outputs], vec![0.0; n_outputs]);
    for (c, &u) in clock.iter().enumerate() {
        model.landscape.evaluate(u, &mut value, &mut slope);
        for (o, w) in value.iter().enumerate() {
            let (j, d) = (o / n_dofs, o % n_dofs);
            design[(c * n_dofs + d, j)] = w / scale[d];
        }
    }
    // Columns of unit size: factors that carry nothing are left out instead of divided by.
    let sizes: Vec<f64> =
        (0..model.n_styles()).map(|j| design.col(j).iter().fold(0.0f64, |m, x| m.max(x.abs()))).collect();
    let floor = 1e-13 * sizes.iter().fold(0.0f64, |m, s| m.max(*s));
    let kept: Vec<usize> = (0..sizes.len()).filter(|&j| sizes[j] > floor).collect();
    let mut style = vec![0.0; model.n_styles()];
    if kept.is_empty() {
        return Ok(style);
    }
    let scaled = Mat::from_fn(design.nrows(), kept.len(), |i, k| design[(i, kept[k])] / sizes[kept[k]]);
    let right = Mat::from_fn(target.len(), 1, |i, _| target[[0, i]]);
    let solution = scaled.col_piv_qr().solve_lstsq(&right);
    for (k, &j) in kept.iter().enumerate() {
        style[j] = solution[(k, 0)] / sizes[j];
    }
    Ok(style)
}

/// The constants of a primitive, and what follows from them alone.
struct Constants {
    attractor: Attractor,
    canonical: Canonical,
    tau: f64,
}

impl Constants {
    fn of(options: &FitOptions, aligned: &Aligned) -> Result<Self> {
        let duration = aligned.durations()[aligned.nominal];
        let attractor = Attractor { alpha_z: options.alpha_z, beta_z: options.beta_z.unwrap_or(options.alpha_z / 4.0) };
        check_rate("alpha_z", attractor.alpha_z)?;
        check_rate("beta_z", attractor.beta_z)?;
        check_rate("mu", options.mu)?;
        let kind = options.alignment.kind;
        let given = |name, value: Option<f64>| match value {
            Some(_) => Err(Error::Kind { name, kind, instead: ": leave it out" }),
            None => Ok(()),
        };
        let (canonical, tau) = match kind {
            Kind::Discrete => {
                let tau = options.tau.unwrap_or(duration);
                check_positive("tau", tau)?;
                let u_end = duration / tau;
                if !(1e-3..=1e3).contains(&u_end) {
                    let allowed = "must lie within a thousandfold of the nominal duration";
                    return Err(Error::Range { name: "tau", value: tau, allowed });
                }
                let alpha_x = options.alpha_x.unwrap_or(100f64.ln() / u_end);
                check_rate("alpha_x", alpha_x)?;
                if alpha_x * u_end > 300.0 {
                    let allowed = "must not exceed 300 tau / T, or the phase vanishes before the end";
                    return Err(Error::Range { name: "alpha_x", value: alpha_x, allowed });
                }
                (Canonical::Discrete { alpha_x, u_end }, tau)
            }
            Kind::Rhythmic => {
                given("tau", options.tau)?;
                given("alpha_x", options.alpha_x)?;
                (Canonical::Rhythmic { mu: options.mu }, duration / TAU)
            }
        };
        Ok(Self { attractor, canonical, tau })
    }

    fn domain(&self) -> Domain {
        match self.canonical {
            Canonical::Discrete { u_end, .. } => Domain::Interval { end: u_end },
            Canonical::Rhythmic { .. } => Domain::Circle,
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

/// Rates of the systems: far enough from the ends of the number range for their products.
fn check_rate(name: &'static str, value: f64) -> Result<()> {
    if (1e-6..=1e6).contains(&value) {
        Ok(())
    } else {
        Err(Error::Range { name, value, allowed: "must lie between 1e-6 and 1e6" })
    }
}

impl DofScale {
    /// The units (D,) that were given, if any were.
    fn given(&self, n_dofs: usize) -> Result<Option<&[f64]>> {
        let Self::Given(scale) = self else { return Ok(None) };
        check_vector("dof_scale", scale, n_dofs, "DoF")?;
        match scale.iter().find(|value| !(1e-100..=1e100).contains(*value)) {
            Some(&value) => {
                Err(Error::Range { name: "dof_scale", value, allowed: "must lie between 1e-100 and 1e100" })
            }
            None => Ok(Some(scale)),
        }
    }

    /// The units (D,) of DoFs with such ranges.
    fn of(&self, ranges: &[f64]) -> Vec<f64> {
        match self {
            Self::Unit => vec![1.0; ranges.len()],
            // A DoF at rest has no range; it has no target to be scaled either.
            Self::Range => ranges.iter().map(|&range| if range > 0.0 { range } else { 1.0 }).collect(),
            Self::Given(scale) => scale.clone(),
        }
    }
}

/// Contexts (M, Q), with what their columns mean: those given, or those of the demonstrations if they carry any.
fn contexts_of(
    demos: &[Demonstration],
    given: Option<&[Vec<ContextValue>]>,
) -> Result<Option<(Vec<ContextColumn>, Array2<f64>)>> {
    if let Some(contexts) = given {
        if contexts.len() != demos.len() {
            let (expected, found) = (demos.len(), contexts.len());
            return Err(Error::Length { name: "contexts", expected, found, per: "demonstration" });
        }
        for (m, context) in contexts.iter().enumerate() {
            check_context(context).map_err(|error| error.in_demo(m))?;
        }
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
