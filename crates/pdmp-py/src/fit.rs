//! Learning, called from Python.

use std::cell::Cell;
use std::sync::Arc;

use ndarray::Array2;
use pdmp_core::context::{ContextMapKind, MapSelection};
use pdmp_core::learning::regression::Basis;
use pdmp_core::learning::{
    CanonicalOptions, DofScaling, NStyles, Stage, TimeScaling, TransportSelection, Truncation, fit_with,
};
use pdmp_core::numerics::Smoothing;
use pdmp_core::{FitOptions, Kind};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyList, PyMapping};

use crate::basis::{Gp, NGnet};
use crate::convert::{count, items, matrix, numbers};
use crate::demo::{Demonstration, Source, Trajectory};
use crate::error::{detached, raise};
use crate::model::Model;
use crate::warp::TimeWarp;

/// Learn one movement primitive from several demonstrations.
///
/// The four steps of Section 3.2: align the demonstrations to a nominal one, compute the targets
/// f = τẏ − z exactly, factorise F ≈ S·F_basis (Eq. 7), and regress the landscape on the phase.
///
/// Parameters
/// ----------
/// demos : sequence or mapping of Demonstration, of Trajectory or of (T, D) array_like, or (M, T, D) array_like
///     Demonstrations of one skill; if rhythmic, each is one cycle without its end point. Of a mapping, such as the
///     readers return, the values count. Data frames name their degrees of freedom by their columns.
/// kind : {"discrete", "rhythmic"}
///     From a start to a goal, or around an anchor.
/// dt : float, optional
///     Sampling interval in s of the demonstrations that carry none.
/// period : float or (M,) array_like, optional
///     Periods in s of time-stamped cycles.
/// contexts : (M, Q) array_like, or M lists of Q numbers and labels, optional
///     The condition of each demonstration; otherwise those that they carry.
/// map : {"auto", "stacked", "gp", "linear", "polynomial"}
///     Map from contexts to movements: a Gaussian process and a penalised line, weighted by their errors at contexts
///     left out, outside of the contexts of the demonstrations together with the mean ("stacked"); the process alone;
///     least squares as in the paper; or ridge regression on polynomials of second degree. "auto" is "stacked", and
///     "linear" for labels alone, which get the mean of their demonstrations each, for two different contexts and for
///     more than 1024. The repr of `model.map` has the weights.
/// n_styles : int or "auto", optional
///     Style dimension J. By default the systematic styles: as many as carry nine tenths of the sum of the singular
///     values, at least five (or half of the demonstrations) and as many as the contexts explain (F-test), but none
///     that measurement noise alone would give (parallel analysis). "auto" is cross-validation over contexts by the
///     one-standard-error rule, in at most ten folds.
/// singular_value_share : float, optional
///     The paper's rule instead: the fewest singular values whose sum exceeds this share of the sum of all, such as 0.9.
/// basis : {"gp", "ngnet"}, GP or NGnet
///     Function approximator of the landscape.
/// smoothing : "auto", float or None
///     Smooth each degree of freedom by generalised cross-validation over all demonstrations, which leaves clean ones as
///     they are; or with this cut-off in Hz; or interpolate every sample. `model.noise` and `model.cut_offs` hold what
///     was found.
/// nominal : int, optional
///     Index of the nominal demonstration; otherwise the one of median duration.
/// n_samples : int, optional
///     Samples C after alignment; otherwise as many as the nominal demonstration has, and more where these are fewer
///     than 150.
/// transport : {"learnt", "immediate"}
///     How the way from start to goal is spread over a discrete movement: along the profile by which the demonstrations
///     cover theirs (:meth:`Model.transport`), or at once as in the paper, where a moved goal shifts the whole path.
///     Past its end a movement brakes (:attr:`Model.braking`), or its forcing fades with the phase as in the paper.
/// dof_scale : None, "unit", "range" or (D,) array_like
///     Unit of each degree of freedom in the factorisation. By default as recorded ("unit") where all units are equal or
///     unknown; otherwise the degrees of freedom of each unit are scaled together by the largest range among them.
///     "range" scales each by its own range. If given as numbers, in a warp of time too.
/// alignment : {"linear", "warp"} or TimeWarp
///     How time is scaled to that of the nominal demonstration: linearly, or by the monotone warp that brings the
///     demonstrations closest to each other, where they pause or hurry in different places. A `TimeWarp` is applied as given;
///     "warp" has eight segments, fewer where a demonstration has fewer than 16 samples, and with at least three
///     different contexts is applied only if it lowers the error at contexts held out by more than its standard error;
///     `model.segment_durations` has one column where it is not.
/// events : (M, E) array_like, optional
///     Times in s of E landmarks in each demonstration, from its first sample or of its time stamps, in place of a
///     warp: all are aligned to those of the nominal demonstration.
/// tau : float, optional
///     Time constant in s, discrete; otherwise the nominal duration.
/// alpha_z, beta_z : float
///     Constants of the output system; `beta_z` is `alpha_z / 4` (critical damping) unless given.
/// alpha_x : float, optional
///     Constant of the discrete canonical system; otherwise x = 0.01 at the end. Where transport is immediate the
///     forcing fades with x past the end of the demonstrations: if a movement drifts off its goal there before it
///     settles, `alpha_x = alpha_z` keeps it closest.
/// mu : float
///     Constant of the rhythmic canonical system.
/// threads : int, optional
///     How many threads may work on it; otherwise as many as the system allows. The model does not depend on it.
/// progress : callable, optional
///     Called with the stage and the share of it that is done; an exception it raises ends the fit.
///
/// Returns
/// -------
/// Model
///
/// Warns
/// -----
/// UserWarning
///     Samples that no movement makes, with their place: time stamps far closer than the others, dropouts written as
///     zeros, padding, counters and time stamps among the columns, wrapped angles, angles of different demonstrations
///     whole turns apart (taken off where units say that they are angles), and an `alpha_z` too high for the samples.
///
/// Raises
/// ------
/// ValueError
///     Demonstrations or options that do not fit together.
/// FitError
///     Well-formed demonstrations from which nothing could be learnt.
///
/// References
/// ----------
/// Matsubara, Hyon, Morimoto, Neural Networks 24 (2011), https://doi.org/10.1016/j.neunet.2011.02.004
#[pyfunction]
#[pyo3(signature = (
    demos, *, kind="discrete", dt=None, period=None, contexts=None, map="auto", n_styles=None, singular_value_share=None, basis=None,
    smoothing=SmoothingArgument(Smoothing::Auto), nominal=None, n_samples=None, transport=None, dof_scale=None,
    alignment=None, events=None, tau=None, alpha_z=25.0, beta_z=None, alpha_x=None, mu=None, threads=None, progress=None
), text_signature = "(demos, *, kind='discrete', dt=None, period=None, contexts=None, map='auto', n_styles=None, singular_value_share=None, \
    basis='gp', smoothing='auto', nominal=None, n_samples=None, transport=None, dof_scale=None, \
    alignment='linear', events=None, tau=None, alpha_z=25.0, beta_z=None, alpha_x=None, mu=None, threads=None, progress=None)")]
#[allow(clippy::too_many_arguments)]
pub(crate) fn fit(
    py: Python<'_>,
    demos: &Bound<'_, PyAny>,
    kind: &str,
    dt: Option<f64>,
    period: Option<&Bound<'_, PyAny>>,
    contexts: Option<&Bound<'_, PyAny>>,
    map: &str,
    n_styles: Option<&Bound<'_, PyAny>>,
    singular_value_share: Option<f64>,
    basis: Option<&Bound<'_, PyAny>>,
    smoothing: SmoothingArgument,
    nominal: Option<isize>,
    n_samples: Option<isize>,
    transport: Option<&str>,
    dof_scale: Option<&Bound<'_, PyAny>>,
    alignment: Option<&Bound<'_, PyAny>>,
    events: Option<&Bound<'_, PyAny>>,
    tau: Option<f64>,
    alpha_z: f64,
    beta_z: Option<f64>,
    alpha_x: Option<f64>,
    mu: Option<f64>,
    threads: Option<isize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let demos = demonstrations("demos", demos)?;
    let canonical = canonical_of(kind_of(kind)?, (tau, alpha_x, transport), (mu, period))?;
    let mut options = FitOptions::new(canonical);
    options.dt = dt;
    options.smoothing = smoothing.0;
    options.nominal = nominal.map(|n| count("nominal", n)).transpose()?;
    options.n_samples = n_samples.map(|n| count("n_samples", n)).transpose()?;
    options.time_scaling = time_scaling_of(alignment, events)?;
    options.contexts = contexts.map(crate::convert::contexts).transpose()?;
    options.map = map_of(map)?;
    options.n_styles = style_choice(n_styles, singular_value_share)?;
    options.basis = basis_of(basis)?;
    options.dof_scale = dof_scale_of(dof_scale)?;
    (options.alpha_z, options.beta_z) = (alpha_z, beta_z);
    options.threads = crate::convert::threads(threads)?;
    let show = |py: Python<'_>, stage: Stage, share| match &progress {
        Some(progress) => progress.call1(py, (stage.name(), share)).map(drop),
        None => Ok(()),
    };
    let model = detached(py, show, |progress| fit_with(&demos, &options, progress))?;
    crate::inspection::warn(py, &model.learnt().findings)?;
    Ok(Model(Arc::new(model)))
}

/// Returns the canonical system, and rejects arguments of the other kind.
fn canonical_of(
    kind: Kind,
    (tau, alpha_x, transport): (Option<f64>, Option<f64>, Option<&str>),
    (mu, period): (Option<f64>, Option<&Bound<'_, PyAny>>),
) -> PyResult<CanonicalOptions> {
    let reject = |name, given: bool| match given {
        true => Err(raise(pdmp_core::Error::Kind { name, kind, instead: ": leave it out" })),
        false => Ok(()),
    };
    match kind {
        Kind::Discrete => {
            reject("mu", mu.is_some())?;
            reject("period", period.is_some())?;
            Ok(CanonicalOptions::Discrete { tau, alpha_x, transport: transport_of(transport.unwrap_or("learnt"))? })
        }
        Kind::Rhythmic => {
            reject("tau", tau.is_some())?;
            reject("alpha_x", alpha_x.is_some())?;
            reject("transport", transport.is_some())?;
            Ok(CanonicalOptions::Rhythmic { mu: mu.unwrap_or(1.0), periods: numbers("period", period)? })
        }
    }
}

fn style_choice(n_styles: Option<&Bound<'_, PyAny>>, singular_value_share: Option<f64>) -> PyResult<NStyles> {
    let Some(n_styles) = n_styles else {
        return Ok(singular_value_share.map_or(NStyles::AboveNoise, |share| Truncation::Share(share).into()));
    };
    if singular_value_share.is_some() {
        return Err(PyValueError::new_err("n_styles and singular_value_share: pass one of them"));
    }
    if let Ok(name) = n_styles.extract::<String>() {
        let wanted = "must be a number, \"auto\" or None";
        return if name == "auto" {
            Ok(NStyles::CrossValidated)
        } else {
            Err(PyValueError::new_err(format!("n_styles = {name:?}: {wanted}")))
        };
    }
    count("n_styles", n_styles.extract()?).map(|n_styles| Truncation::Rank(n_styles).into())
}

/// J as given, or from a share of the spectrum.
pub(crate) fn style_count(n_styles: Option<isize>, singular_value_share: f64) -> PyResult<Truncation> {
    match n_styles {
        Some(n_styles) => count("n_styles", n_styles).map(Truncation::Rank),
        None => Ok(Truncation::Share(singular_value_share)),
    }
}

/// Demonstrations from a list of them or of arrays, a mapping of names to them, or a stack of arrays.
pub(crate) fn demonstrations(argument: &str, demos: &Bound<'_, PyAny>) -> PyResult<Vec<pdmp_core::Demonstration>> {
    if demos.is_instance_of::<Demonstration>() || demos.is_instance_of::<Trajectory>() {
        return Err(PyValueError::new_err(format!("{argument} is a single demonstration: put it into a list")));
    }
    let demos = &if demos.is_instance_of::<PyMapping>() { demos.call_method0("values")? } else { demos.clone() };
    if demos.hasattr("ndim")? {
        let shape: Vec<usize> = demos.getattr("shape")?.extract()?;
        if shape.len() != 3 {
            let wanted = "expected (M, T, D): put a single (T, D) array into a list";
            return Err(PyValueError::new_err(format!("{argument} has shape {shape:?}, {wanted}")));
        }
    }
    if demos.try_iter().is_err() {
        return Err(PyTypeError::new_err(format!(
            "{argument} must be a list of demonstrations or arrays, a mapping of names to them, or an array of shape \
             (M, T, D)"
        )));
    }
    let next = Cell::new(0);
    items(argument, demos, |_, item| {
        let m = next.replace(next.get() + 1);
        if let Ok(demo) = item.cast::<Demonstration>() {
            return Ok(demo.get().0.clone());
        }
        if item.is_instance_of::<PyList>() && item.get_item(0).is_ok_and(|one| one.is_instance_of::<Demonstration>()) {
            let message = format!("demo {m} is a list of demonstrations: put all of them into one list");
            return Err(PyValueError::new_err(message));
        }
        Source::of(&format!("demo {m}: position"), item)?.demonstration(m)
    })
}

pub(crate) fn map_of(map: &str) -> PyResult<MapSelection> {
    if map == "auto" {
        return Ok(MapSelection::Auto);
    }
    let found = ContextMapKind::ALL.into_iter().find(|kind| kind.name() == map);
    let wanted = "must be \"auto\", \"stacked\", \"gp\", \"linear\" or \"polynomial\"";
    found.map(MapSelection::Given).ok_or_else(|| PyValueError::new_err(format!("map = {map:?}: {wanted}")))
}

pub(crate) fn kind_of(kind: &str) -> PyResult<Kind> {
    match kind {
        "discrete" => Ok(Kind::Discrete),
        "rhythmic" => Ok(Kind::Rhythmic),
        _ => Err(PyValueError::new_err(format!("kind = {kind:?}: must be \"discrete\" or \"rhythmic\""))),
    }
}

fn basis_of(basis: Option<&Bound<'_, PyAny>>) -> PyResult<Basis> {
    let Some(basis) = basis else { return Ok(Basis::Gp(Default::default())) };
    if let Ok(gp) = basis.cast::<Gp>() {
        return Ok(Basis::Gp(gp.get().0.clone()));
    }
    if let Ok(ngnet) = basis.cast::<NGnet>() {
        return Ok(Basis::NGnet(ngnet.get().0.clone()));
    }
    match basis.extract::<String>().as_deref() {
        Ok("gp") => Ok(Basis::Gp(Default::default())),
        Ok("ngnet") => Ok(Basis::NGnet(Default::default())),
        _ => {
            let wanted = "must be \"gp\", \"ngnet\", pdmp.GP(...) or pdmp.NGnet(...)";
            Err(PyValueError::new_err(format!("basis = {}: {wanted}", basis.repr()?)))
        }
    }
}

fn time_scaling_of(alignment: Option<&Bound<'_, PyAny>>, events: Option<&Bound<'_, PyAny>>) -> PyResult<TimeScaling> {
    let alignment = alignment.map_or(Ok(TimeScaling::Linear), alignment_of)?;
    let events: Option<Array2<f64>> = events.map(|events| matrix("events", "(M, E)", events)).transpose()?;
    match (alignment, events) {
        (TimeScaling::Linear, Some(events)) => Ok(TimeScaling::Events(events)),
        (_, Some(_)) => {
            Err(PyValueError::new_err("pass a warp as alignment or events, not both: events align by themselves"))
        }
        (alignment, None) => Ok(alignment),
    }
}

fn alignment_of(alignment: &Bound<'_, PyAny>) -> PyResult<TimeScaling> {
    if let Ok(warp) = alignment.cast::<TimeWarp>() {
        return Ok(TimeScaling::Warp(warp.get().0.clone()));
    }
    match alignment.extract::<String>().as_deref() {
        Ok("linear") => Ok(TimeScaling::Linear),
        Ok("warp") => Ok(TimeScaling::WarpIfBetter),
        _ => {
            let wanted = "must be \"linear\", \"warp\" or pdmp.TimeWarp(...)";
            Err(PyValueError::new_err(format!("alignment = {}: {wanted}", alignment.repr()?)))
        }
    }
}

/// `smoothing=`: None, "auto" or a cut-off in Hz.
pub(crate) struct SmoothingArgument(Smoothing);

impl<'py> FromPyObject<'_, 'py> for SmoothingArgument {
    type Error = PyErr;

    fn extract(smoothing: pyo3::Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if smoothing.is_none() {
            return Ok(Self(Smoothing::Interpolate));
        }
        // True would be a cut-off of 1 Hz.
        if let Ok(hz) = smoothing.extract::<f64>()
            && !smoothing.is_instance_of::<PyBool>()
        {
            return Ok(Self(Smoothing::CutOff { hz }));
        }
        match smoothing.extract::<String>().as_deref() {
            Ok("auto") => Ok(Self(Smoothing::Auto)),
            _ => {
                let wanted = "must be None, \"auto\" or a cut-off in Hz";
                Err(PyValueError::new_err(format!("smoothing = {}: {wanted}", smoothing.repr()?)))
            }
        }
    }
}

fn transport_of(transport: &str) -> PyResult<TransportSelection> {
    match transport {
        "learnt" => Ok(TransportSelection::Learnt),
        "immediate" => Ok(TransportSelection::Immediate),
        _ => Err(PyValueError::new_err(format!("transport = {transport:?}: must be \"learnt\" or \"immediate\""))),
    }
}

fn dof_scale_of(scale: Option<&Bound<'_, PyAny>>) -> PyResult<DofScaling> {
    let Some(scale) = scale else { return Ok(DofScaling::Auto) };
    match scale.extract::<String>().as_deref() {
        Ok("range") => Ok(DofScaling::Range),
        Ok("unit") => Ok(DofScaling::Unit),
        Ok(other) => Err(PyValueError::new_err(format!(
            "dof_scale = {other:?}: must be None, \"unit\", \"range\" or one number per DoF"
        ))),
        Err(_) => crate::convert::vector("dof_scale", scale).map(DofScaling::Given),
    }
}
