//! Learning, called from Python.

use std::cell::Cell;
use std::sync::Arc;

use ndarray::{Array2, ArrayD, Axis, Ix2};
use pdmp_core::basis::Basis;
use pdmp_core::{
    Alignment, DofScale, FitOptions, Kind, MapChoice, MapKind, Sampling, Smoothing, Stage, StyleChoice, StyleCount,
    TimeScaling,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::basis::{Gp, NGnet};
use crate::convert::{array, count, items, matrix, numbers};
use crate::demo::Demonstration;
use crate::error::{detached, raise};
use crate::model::Model;
use crate::warp::Warp;

/// Learn one movement primitive from several demonstrations.
///
/// The four steps of Section 3.2: align the demonstrations to a nominal one, compute the targets
/// f = τẏ − z exactly, factorise F ≈ S·F_basis (Eq. 7), and regress the landscape on the phase.
///
/// Parameters
/// ----------
/// demos : sequence of Demonstration, sequence of (T, D) array_like, or (M, T, D) array_like
///     Demonstrations of one skill; if rhythmic, each is one cycle without its end point.
/// kind : {"discrete", "rhythmic"}
///     From a start to a goal, or around an anchor.
/// dt : float, optional
///     Sampling interval in s of the demonstrations that carry none.
/// period : float or (M,) array_like, optional
///     Periods in s of time-stamped cycles.
/// contexts : (M, Q) array_like, or M lists of Q numbers and labels, optional
///     The condition of each demonstration; otherwise those that they carry.
/// map : {"auto", "linear", "polynomial", "gp"}
///     What leads from contexts to movements: least squares as in the paper, ridge regression on polynomials of second
///     degree, or a Gaussian process. "auto" is the process, unless another is better at contexts left out by more
///     than two standard errors, and linear for fewer than 4 different contexts or more than 1024; `model.map` tells.
/// n_styles : int or "auto", optional
///     Style dimension J; otherwise from `spectrum`. "auto" is by what contexts foresee: the fewest styles whose error at
///     contexts held out (cross-validation, at most ten folds) is above the least of all by no more than the standard
///     error of the difference.
/// spectrum : float
///     Keep the fewest singular values whose sum exceeds this share of the sum of all.
/// basis : {"gp", "ngnet"}, GP or NGnet
///     Function approximator of the landscape.
/// smoothing : None, "auto" or float
///     Interpolate, smooth by generalised cross-validation, or smooth with this cut-off in Hz.
/// nominal : int, optional
///     Index of the nominal demonstration; otherwise the one of median duration.
/// n_samples : int, optional
///     Samples C after alignment; otherwise as many as the nominal demonstration has, and more where these are fewer
///     than 150.
/// dof_scale : None, "range" or (D,) array_like
///     Unit of each degree of freedom in the factorisation; if given as numbers, in a warp of time too.
/// alignment : {"linear", "warp"} or Warp
///     How time is scaled to that of the nominal demonstration: linearly, or by the monotone warp that brings the
///     demonstrations closest to each other, where they pause or hurry in different places.
/// events : (M, E) array_like, optional
///     Times in s of E landmarks in each demonstration, from its first sample or of its time stamps, in place of a
///     warp: all are aligned to those of the nominal demonstration.
/// tau : float, optional
///     Time constant in s, discrete; otherwise the nominal duration.
/// alpha_z, beta_z : float
///     Constants of the output system; `beta_z` is `alpha_z / 4` (critical damping) unless given.
/// alpha_x : float, optional
///     Constant of the discrete canonical system; otherwise x = 0.01 at the end. Past the end of the demonstrations
///     the forcing fades with x: if a movement drifts off its goal there before it settles, `alpha_x = alpha_z` keeps
///     it closest.
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
    demos, *, kind="discrete", dt=None, period=None, contexts=None, map="auto", n_styles=None, spectrum=0.9, basis=None,
    smoothing=None, nominal=None, n_samples=None, dof_scale=None, alignment=None, events=None, tau=None, alpha_z=25.0,
    beta_z=None, alpha_x=None, mu=1.0, threads=None, progress=None
), text_signature = "(demos, *, kind='discrete', dt=None, period=None, contexts=None, map='auto', n_styles=None, spectrum=0.9, \
    basis='gp', smoothing=None, nominal=None, n_samples=None, dof_scale=None, alignment='linear', events=None, \
    tau=None, alpha_z=25.0, beta_z=None, alpha_x=None, mu=1.0, threads=None, progress=None)")]
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
    spectrum: f64,
    basis: Option<&Bound<'_, PyAny>>,
    smoothing: Option<&Bound<'_, PyAny>>,
    nominal: Option<isize>,
    n_samples: Option<isize>,
    dof_scale: Option<&Bound<'_, PyAny>>,
    alignment: Option<&Bound<'_, PyAny>>,
    events: Option<&Bound<'_, PyAny>>,
    tau: Option<f64>,
    alpha_z: f64,
    beta_z: Option<f64>,
    alpha_x: Option<f64>,
    mu: f64,
    threads: Option<isize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let demos = demonstrations(demos)?;
    let options = FitOptions {
        alignment: Alignment {
            kind: kind_of(kind)?,
            dt,
            period: numbers("period", period)?,
            smoothing: smoothing_of(smoothing)?,
            nominal: nominal.map(|n| count("nominal", n)).transpose()?,
            n_samples: n_samples.map(|n| count("n_samples", n)).transpose()?,
            time_scaling: time_scaling_of(alignment, events)?,
        },
        contexts: contexts.map(crate::convert::contexts).transpose()?,
        map: map_of(map)?,
        styles: style_choice(n_styles, spectrum)?,
        basis: basis_of(basis)?,
        dof_scale: dof_scale_of(dof_scale)?,
        tau,
        alpha_z,
        beta_z,
        alpha_x,
        mu,
        threads: crate::convert::threads(threads)?,
    };
    let show = |py: Python<'_>, stage: Stage, share| match &progress {
        Some(progress) => progress.call1(py, (stage.name(), share)).map(drop),
        None => Ok(()),
    };
    let model = detached(py, show, |proceed| pdmp_core::fit(&demos, &options, proceed))?;
    Ok(Model(Arc::new(model)))
}

fn style_choice(n_styles: Option<&Bound<'_, PyAny>>, spectrum: f64) -> PyResult<StyleChoice> {
    let Some(n_styles) = n_styles else { return style_count(None, spectrum).map(StyleChoice::Given) };
    if let Ok(name) = n_styles.extract::<String>() {
        let wanted = "must be a number, \"auto\" or None";
        return if name == "auto" {
            Ok(StyleChoice::Auto)
        } else {
            Err(PyValueError::new_err(format!("n_styles = {name:?}: {wanted}")))
        };
    }
    style_count(Some(n_styles.extract()?), spectrum).map(StyleChoice::Given)
}

/// J as given, or from a share of the spectrum.
pub(crate) fn style_count(n_styles: Option<isize>, spectrum: f64) -> PyResult<StyleCount> {
    match n_styles {
        Some(n_styles) => count("n_styles", n_styles).map(StyleCount::Given),
        None => Ok(StyleCount::Spectrum(spectrum)),
    }
}

fn demonstrations(demos: &Bound<'_, PyAny>) -> PyResult<Vec<pdmp_core::Demonstration>> {
    if demos.is_instance_of::<Demonstration>() {
        return Err(PyValueError::new_err("demos is a single demonstration: put it into a list"));
    }
    if demos.hasattr("ndim")? {
        let stack = array("demos", demos)?;
        if stack.ndim() != 3 {
            let shape = stack.shape();
            let wanted = "expected (M, T, D): put a single (T, D) array into a list";
            return Err(PyValueError::new_err(format!("demos has shape {shape:?}, {wanted}")));
        }
        return stack.axis_iter(Axis(0)).enumerate().map(|(m, demo)| unrated(m, demo.to_owned())).collect();
    }
    if demos.try_iter().is_err() {
        let wanted = "demos must be a list of demonstrations or arrays, or an array of shape (M, T, D)";
        return Err(PyTypeError::new_err(wanted));
    }
    let m = Cell::new(0);
    items("demos", demos, |_, item| match (item.cast::<Demonstration>(), m.replace(m.get() + 1)) {
        (Ok(demo), _) => Ok(demo.get().0.clone()),
        (Err(_), m) => unrated(m, array(&format!("demo {m}: position"), item)?),
    })
}

/// A demonstration from a bare array (T, D), whose rate the fit is told.
fn unrated(m: usize, position: ArrayD<f64>) -> PyResult<pdmp_core::Demonstration> {
    let shape = position.shape().to_vec();
    let position = position.into_dimensionality::<Ix2>().map_err(|_| {
        PyValueError::new_err(format!("demo {m}: position has shape {shape:?}, expected two axes (T, D)"))
    })?;
    pdmp_core::Demonstration::new(position, Sampling::Unknown).map_err(|error| raise(error.in_demo(m)))
}

pub(crate) fn map_of(map: &str) -> PyResult<MapChoice> {
    if map == "auto" {
        return Ok(MapChoice::Auto);
    }
    let found = MapKind::ALL.into_iter().find(|kind| kind.name() == map);
    let wanted = "must be \"auto\", \"linear\", \"polynomial\" or \"gp\"";
    found.map(MapChoice::Given).ok_or_else(|| PyValueError::new_err(format!("map = {map:?}: {wanted}")))
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
    if let Ok(warp) = alignment.cast::<Warp>() {
        return Ok(TimeScaling::Warp(warp.get().0.clone()));
    }
    match alignment.extract::<String>().as_deref() {
        Ok("linear") => Ok(TimeScaling::Linear),
        Ok("warp") => Ok(TimeScaling::Warp(Default::default())),
        _ => {
            let wanted = "must be \"linear\", \"warp\" or pdmp.Warp(...)";
            Err(PyValueError::new_err(format!("alignment = {}: {wanted}", alignment.repr()?)))
        }
    }
}

fn smoothing_of(smoothing: Option<&Bound<'_, PyAny>>) -> PyResult<Smoothing> {
    let Some(smoothing) = smoothing else { return Ok(Smoothing::Interpolate) };
    // True would be a cut-off of 1 Hz.
    if let Ok(hz) = smoothing.extract::<f64>()
        && !smoothing.is_instance_of::<PyBool>()
    {
        return Ok(Smoothing::CutOff { hz });
    }
    match smoothing.extract::<String>().as_deref() {
        Ok("auto") => Ok(Smoothing::Auto),
        _ => {
            let wanted = "must be None, \"auto\" or a cut-off in Hz";
            Err(PyValueError::new_err(format!("smoothing = {}: {wanted}", smoothing.repr()?)))
        }
    }
}

fn dof_scale_of(scale: Option<&Bound<'_, PyAny>>) -> PyResult<DofScale> {
    let Some(scale) = scale else { return Ok(DofScale::Unit) };
    match scale.extract::<String>().as_deref() {
        Ok("range") => Ok(DofScale::Range),
        Ok(other) => {
            Err(PyValueError::new_err(format!("dof_scale = {other:?}: must be None, \"range\" or one number per DoF")))
        }
        Err(_) => crate::convert::vector("dof_scale", scale).map(DofScale::Given),
    }
}
