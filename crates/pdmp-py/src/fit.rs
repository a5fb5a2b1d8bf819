//! Fits, and the conversion of their options.

use std::cell::Cell;
use std::sync::Arc;

use pdmp_core::context::{ContextMapKind, MapSelection};
use pdmp_core::learning::regression::Basis;
use pdmp_core::learning::{
    CanonicalOptions, DofScaling, NStyles, Stage, TransportSelection, Truncation, fit_blocks, fit_with,
};
use pdmp_core::model::Frame;
use pdmp_core::numerics::Smoothing;
use pdmp_core::{FitOptions, Kind};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyList, PyMapping, PyString};

use crate::blocks::Blocks;
use crate::choice::Choice;
use crate::convert::{items, numbers, quoted};
use crate::demonstration::{Demonstration, Source};
use crate::error::{detached, raise};
use crate::instance;
use crate::model::Model;
use crate::regression::{Gp, NGnet};
use crate::scalar::{Scalar, optional_count, optional_number};
use crate::trajectory::Trajectory;
use crate::warp::time_scaling_of;

/// Fits a movement primitive to demonstrations.
///
/// The four steps of Section 3.2: align the demonstrations to a nominal one, compute the targets f = τẏ − z exactly,
/// factorise them, F ≈ S·F_basis (Eq. 7), and regress the attractor landscape on the phase.
///
/// Parameters
/// ----------
/// demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (M, T, D), or blocks
///     Demonstrations of one skill. A rhythmic one is a single cycle without its end point. Of a mapping, as the
///     readers return, the values are used. The columns of data frames name the degrees of freedom. More demonstrations
///     than memory holds are passed in blocks: a list of blocks, or a function without arguments that returns an
///     iterable of them, the same at each of two to four calls. A block is a list of demonstrations, an array (B, T, D),
///     or a function that returns one, as `io.read_blocks` gives for files. Memory then holds one block, a triangular
///     factor of C·D columns and a few numbers for each demonstration; the model is the same but for rounding. Contexts
///     are then those of the demonstrations; warps, landmarks, rotations and `n_styles="auto"` need all demonstrations
///     at once.
/// kind : {"discrete", "rhythmic"}
///     Movement from a start to a goal, or around an anchor, the default for the result of `preprocessing.cycles`.
/// dt : float, optional
///     Sampling interval in s of demonstrations without one.
/// period : float or array_like, (M,), optional
///     Periods in s of time-stamped cycles.
/// contexts : array_like, (M, Q) or (M,), or M lists of Q numbers and labels, or mapping, optional
///     Contexts of the demonstrations, numbers in any unit; by default those that the demonstrations carry, with
///     the names that readers of `pdmp.io` found. The model keeps the names of the columns of a data frame, of
///     records, of M mappings, or of a mapping from names to columns (M,).
/// map : {"auto", "stacked", "gp", "linear", "polynomial"}
///     Map from contexts to style, goal, start and duration. "stacked" weights a Gaussian process and a ridge
///     regression by their leave-one-out errors, and the mean too outside the range of the contexts; "gp" is the
///     process alone, "linear" least squares as in the paper, "polynomial" ridge regression of second degree. "auto" is
///     "stacked"; it is "linear" for labels alone, each of which then has the mean of its demonstrations, for two
///     different contexts and for more than 1024. The repr of `model.map` states the weights.
/// n_styles : int or "auto", optional
///     Style dimension J. By default the number that carries nine tenths of the sum of the singular
///     values, at least five (or half of the demonstrations) and those that the contexts explain (F-test), without
///     those that measurement noise alone would give (parallel analysis). "auto" applies the one-standard-error rule to
///     the error of cross-validation over contexts, in at most ten folds.
/// singular_value_share : float, optional
///     Share in (0, 1], the paper's rule: J is the smallest number of singular values whose sum exceeds this share of
///     the sum of all, for example 0.9.
/// basis : {"gp", "ngnet"}, GP or NGnet
///     Regression of the landscape.
/// smoothing : "auto", float or None
///     Smoothing of the positions: by generalised cross-validation over all demonstrations for each degree of freedom,
///     which leaves clean ones unchanged; by a cut-off frequency in Hz; or none, so that every sample is interpolated.
///     Recordings that do not contradict zero velocity at their start or end are smoothed with it there.
///     `model.noise` and `model.cut_offs` hold the result.
/// nominal : int, optional
///     Index of the nominal demonstration; by default the one of median duration.
/// n_samples : int, optional
///     Number C of samples after alignment, from 4 to 1e6; by default that of the nominal demonstration, and more if
///     that has fewer than 150.
/// transport : {"learnt", "immediate"}, optional
///     Motion of the frame of a discrete movement from start to goal: by default along the learnt profile of the
///     demonstrations (`Model.transport`), or at once as in the paper, where a moved goal shifts the whole path. Past
///     its end the movement brakes (`Model.braking`); with "immediate" transport the forcing fades with the phase, as
///     in the paper.
/// dof_scale : None, "unit", "range" or array_like, (D,)
///     Scale of each degree of freedom in the factorisation. "unit" keeps the data as recorded, the default if all
///     units are equal or unknown. Otherwise the degrees of freedom of each unit are divided by the largest range among
///     them. "range" divides each by its own range. Numbers are divisors in the unit of each degree of freedom, and
///     also apply to a time warp.
/// rotation_length : float, optional
///     Length that weighs as much as 1 rad where positions and rotations are factorised together, in the unit of the
///     positions; by default the ratio of the deviations from the mean of the demonstrations, by root mean square.
/// rotation_frame : {"body", "world"}
///     Frame of the angular velocities and accelerations of a model with rotations.
/// alignment : {"linear", "warp"} or TimeWarp
///     Scaling of time to that of the nominal demonstration: linear, or by the monotone warps that bring the
///     demonstrations closest to each other. A `TimeWarp` is always applied. "warp" has eight segments, fewer if a
///     demonstration has fewer than 16 samples; with three or more different contexts it is applied only if it lowers
///     the cross-validation error over contexts by more than its standard error, and `model.segment_durations` has one
///     column if it is not.
/// landmarks : array_like, (M, E), optional
///     Times in s of E landmarks in each demonstration, from its first sample or on the clock of its time stamps. They
///     are aligned to those of the nominal demonstration, in place of a warp.
/// tau : float, optional
///     Time constant τ in s of a discrete primitive; by default the nominal duration.
/// alpha_z : float
///     Rate α_z of the output system, from 1e-6 to 1e6, without unit.
/// beta_z : float, optional
///     Stiffness β_z of the output system, from 1e-6 to 1e6, without unit; by default `alpha_z / 4` (critical damping).
/// alpha_x : float, optional
///     Rate α_x of the discrete canonical system, without unit; by default such that x = 0.01 at the end. With
///     "immediate" transport the forcing fades with x past the end: if a movement leaves its goal there before it
///     settles, `alpha_x = alpha_z` reduces the deviation most.
/// mu : float, optional
///     Rate μ of the amplitude of a rhythmic primitive, from 1e-6 to 1e6, without unit; 1 by default.
/// threads : int, optional
///     Largest number of threads; by default all that the system offers. The model does not depend on it.
/// progress : callable, optional
///     Called as `progress(stage, fraction)` with the name of a stage and its completed fraction. An exception that it
///     raises cancels the fit.
///
/// Returns
/// -------
/// Model
///
/// Warns
/// -----
/// UserWarning
///     Implausible samples, with their positions: outliers, jumps, stuck sensors, dropouts recorded as zeros, padding,
///     missing rows, time stamps much closer than the others, counters or time stamps among the columns, wrapped angles,
///     angles of different demonstrations whole turns apart (subtracted if units mark them as angles); ranges or a
///     duration 15 times those of the other demonstrations; and an `alpha_z` too high for the sampling rate.
///
/// Raises
/// ------
/// ValueError
///     Demonstrations or options are invalid or do not fit together.
/// FitError
///     The numerical problem of well-formed demonstrations has no solution.
/// MemoryError
///     The targets do not fit into memory.
///
/// References
/// ----------
/// Matsubara, Hyon, Morimoto, Neural Networks 24 (2011), https://doi.org/10.1016/j.neunet.2011.02.004
///
/// Examples
/// --------
/// >>> s = np.linspace(0.0, 1.0, 61)
/// >>> reach = s**3 * (10 - 15 * s + 6 * s**2)
/// >>> demos = [np.column_stack([reach, height * np.sin(np.pi * s) ** 2]) for height in (0.1, 0.2, 0.3)]
/// >>> fitted = pdmp.fit(demos, dt=0.02, contexts=[[0.1], [0.2], [0.3]], n_styles=1)
/// >>> fitted.n_demos, fitted.n_dofs, fitted.n_styles
/// (3, 2, 1)
#[pyfunction]
#[pyo3(
    signature = (
        demos, *, kind=Choice::FIRST, dt=None, period=None, contexts=None, map=Choice::FIRST, n_styles=None,
        singular_value_share=None, basis=None, smoothing=SmoothingArgument(Smoothing::Auto), nominal=None,
        n_samples=None, transport=None, dof_scale=None, rotation_length=None, rotation_frame=Choice::FIRST,
        alignment=None, landmarks=None, tau=None,
        alpha_z=Scalar::Number(25.0), beta_z=None, alpha_x=None, mu=None, threads=None, progress=None
    ),
    text_signature = "(demos, *, kind='discrete', dt=None, period=None, contexts=None, map='auto', n_styles=None, \
                      singular_value_share=None, basis='gp', smoothing='auto', nominal=None, n_samples=None, \
                      transport=None, dof_scale=None, rotation_length=None, rotation_frame='body', alignment='linear', \
                      landmarks=None, tau=None, alpha_z=25.0, \
                      beta_z=None, alpha_x=None, mu=None, threads=None, progress=None)"
)]
#[allow(clippy::too_many_arguments)]
pub(crate) fn fit(
    py: Python<'_>,
    demos: &Bound<'_, PyAny>,
    kind: Choice<'_>,
    dt: Option<Scalar<'_>>,
    period: Option<&Bound<'_, PyAny>>,
    contexts: Option<&Bound<'_, PyAny>>,
    map: Choice<'_>,
    n_styles: Option<&Bound<'_, PyAny>>,
    singular_value_share: Option<Scalar<'_>>,
    basis: Option<&Bound<'_, PyAny>>,
    smoothing: SmoothingArgument,
    nominal: Option<Scalar<'_>>,
    n_samples: Option<Scalar<'_>>,
    transport: Option<Choice<'_>>,
    dof_scale: Option<&Bound<'_, PyAny>>,
    rotation_length: Option<Scalar<'_>>,
    rotation_frame: Choice<'_>,
    alignment: Option<&Bound<'_, PyAny>>,
    landmarks: Option<&Bound<'_, PyAny>>,
    tau: Option<Scalar<'_>>,
    alpha_z: Scalar<'_>,
    beta_z: Option<Scalar<'_>>,
    alpha_x: Option<Scalar<'_>>,
    mu: Option<Scalar<'_>>,
    threads: Option<Scalar<'_>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Model> {
    let kind = kind.or(crate::labelled::attribute::<PyString>(demos, "kind"));
    let own_contexts = crate::labelled::attribute::<PyMapping>(demos, "contexts");
    let contexts = contexts.or(own_contexts.as_ref());
    let blocks = Blocks::of(demos)?;
    let demos = if blocks.is_some() { Vec::new() } else { demonstrations("demos", demos)? };
    let discrete = (optional_number("tau", tau)?, optional_number("alpha_x", alpha_x)?, transport);
    let rhythmic = (optional_number("mu", mu)?, period);
    let mut options = FitOptions::new(canonical_of(kind.of("kind", &KINDS)?, discrete, rhythmic)?);
    options.dt = optional_number("dt", dt)?;
    options.smoothing = smoothing.0;
    options.nominal = optional_count("nominal", nominal)?;
    options.n_samples = optional_count("n_samples", n_samples)?;
    options.time_scaling = time_scaling_of(alignment, landmarks)?;
    if let Some(contexts) = contexts {
        let (names, rows) = crate::named_contexts::named_contexts("contexts", contexts)?;
        (options.contexts, options.context_names) = (Some(rows), names.unwrap_or_default());
    }
    options.map = map_of(map)?;
    options.n_styles = n_styles_of(n_styles, optional_number("singular_value_share", singular_value_share)?)?;
    options.basis = basis_of(basis)?;
    options.dof_scale = dof_scale_of(dof_scale)?;
    options.rotation_length = optional_number("rotation_length", rotation_length)?;
    options.frame = rotation_frame.of("rotation_frame", &FRAMES)?;
    options.alpha_z = alpha_z.number("alpha_z")?;
    options.beta_z = optional_number("beta_z", beta_z)?;
    options.threads = crate::convert::threads(threads)?;
    let progress = instance::callback("progress", progress)?.map(|progress| progress.clone().unbind());
    let report = |py: Python<'_>, stage: Stage, fraction| match &progress {
        Some(progress) => progress.call1(py, (stage.name(), fraction)).map(drop),
        None => Ok(()),
    };
    let model = match &blocks {
        Some(blocks) => blocks
            .checked_result(detached(py, report, |progress| fit_blocks(&mut || blocks.pass(), &options, progress)))?,
        None => detached(py, report, |progress| fit_with(&demos, &options, progress))?,
    };
    crate::inspection::warn(py, &model.learnt().findings)?;
    Ok(Model(Arc::new(model)))
}

/// Returns the options of the canonical system. Rejects arguments of the other kind.
pub(crate) fn canonical_of(
    kind: Kind,
    (tau, alpha_x, transport): (Option<f64>, Option<f64>, Option<Choice<'_>>),
    (mu, period): (Option<f64>, Option<&Bound<'_, PyAny>>),
) -> PyResult<CanonicalOptions> {
    let reject = |name, is_present: bool| match is_present {
        true => Err(raise(pdmp_core::Error::Kind { name, kind, instead: ": leave it out" })),
        false => Ok(()),
    };
    match kind {
        Kind::Discrete => {
            reject("mu", mu.is_some())?;
            reject("period", period.is_some())?;
            let transport = transport.unwrap_or(Choice::FIRST).of("transport", &TRANSPORTS)?;
            Ok(CanonicalOptions::Discrete { tau, alpha_x, transport })
        }
        Kind::Rhythmic => {
            reject("tau", tau.is_some())?;
            reject("alpha_x", alpha_x.is_some())?;
            reject("transport", transport.is_some())?;
            Ok(CanonicalOptions::Rhythmic { mu: mu.unwrap_or(1.0), periods: numbers("period", period)? })
        }
    }
}

/// Frames of angular velocities.
pub(crate) const FRAMES: [(&str, Frame); 2] = [("body", Frame::Body), ("world", Frame::World)];

pub(crate) fn n_styles_of(n_styles: Option<&Bound<'_, PyAny>>, singular_value_share: Option<f64>) -> PyResult<NStyles> {
    let Some(n_styles) = n_styles else {
        return Ok(singular_value_share.map_or(NStyles::AboveNoise, |share| Truncation::Share(share).into()));
    };
    if singular_value_share.is_some() {
        return Err(PyValueError::new_err("n_styles and singular_value_share: pass one of them"));
    }
    match n_styles.extract::<String>().as_deref() {
        Ok("auto") => Ok(NStyles::CrossValidated),
        Ok(_) => {
            let allowed = "must be a number, \"auto\" or None";
            Err(PyValueError::new_err(format!("n_styles = {}: {allowed}", quoted(n_styles))))
        }
        Err(_) => Ok(Truncation::Rank(Scalar::Object(n_styles.clone()).count("n_styles")?).into()),
    }
}

/// Converts a list of demonstrations or arrays, a mapping with such values, or an array (M, T, D).
pub(crate) fn demonstrations(argument: &str, demos: &Bound<'_, PyAny>) -> PyResult<Vec<pdmp_core::Demonstration>> {
    if demos.is_instance_of::<Demonstration>() || demos.is_instance_of::<Trajectory>() {
        return Err(PyValueError::new_err(format!("{argument} is a single demonstration: put it into a list")));
    }
    let demos = &if demos.is_instance_of::<PyMapping>() { demos.call_method0("values")? } else { demos.clone() };
    if demos.hasattr("ndim")? {
        let shape: Vec<usize> = demos.getattr("shape")?.extract()?;
        if shape.len() != 3 {
            let expected = "expected (M, T, D): put a single (T, D) array into a list";
            return Err(PyValueError::new_err(format!("{argument} has shape {shape:?}, {expected}")));
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
        let holds = |many: PyResult<Bound<'_, PyAny>>| {
            let first = many.and_then(|many| many.try_iter()?.next().transpose());
            first.is_ok_and(|one| one.is_some_and(|one| one.is_instance_of::<Demonstration>()))
        };
        if item.is_instance_of::<PyMapping>() && holds(item.call_method0("values")) {
            let message = format!(
                "demo {m} is a mapping of demonstrations, as readers return it: put the values of all into one list, \
                 [demo for part in parts for demo in part.values()]"
            );
            return Err(PyValueError::new_err(message));
        }
        if item.is_instance_of::<PyList>() && holds(Ok(item.clone())) {
            let message = format!(
                "demo {m} is a list of demonstrations: put all of them into one list, or pass a list of lists or a \
                 function that returns an iterator over blocks"
            );
            return Err(PyValueError::new_err(message));
        }
        Source::of(&format!("demo {m}: position"), item)?.demonstration(m)
    })
}

pub(crate) const KINDS: [(&str, Kind); 2] = [("discrete", Kind::Discrete), ("rhythmic", Kind::Rhythmic)];
pub(crate) const TRANSPORTS: [(&str, TransportSelection); 2] =
    [("learnt", TransportSelection::Learnt), ("immediate", TransportSelection::Immediate)];

/// Returns the selection of the context map for argument `map`.
pub(crate) fn map_of(map: Choice<'_>) -> PyResult<MapSelection> {
    let given = ContextMapKind::ALL.into_iter().map(|kind| (kind.name(), MapSelection::Given(kind)));
    map.of("map", &[("auto", MapSelection::Auto)].into_iter().chain(given).collect::<Vec<_>>())
}

pub(crate) fn basis_of(basis: Option<&Bound<'_, PyAny>>) -> PyResult<Basis> {
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
            let allowed = "must be \"gp\", \"ngnet\", pdmp.GP(...) or pdmp.NGnet(...)";
            Err(PyValueError::new_err(format!("basis = {}: {allowed}", quoted(basis))))
        }
    }
}

/// Argument `smoothing`: None, "auto" or a cut-off in Hz.
pub(crate) struct SmoothingArgument(pub(crate) Smoothing);

impl<'py> FromPyObject<'_, 'py> for SmoothingArgument {
    type Error = PyErr;

    fn extract(smoothing: pyo3::Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if smoothing.is_none() {
            return Ok(Self(Smoothing::Interpolate));
        }
        // True converts to 1.0, but is no cut-off.
        if let Ok(hz) = smoothing.extract::<f64>()
            && !smoothing.is_instance_of::<PyBool>()
        {
            return Ok(Self(Smoothing::CutOff { hz }));
        }
        match smoothing.extract::<String>().as_deref() {
            Ok("auto") => Ok(Self(Smoothing::Auto)),
            _ => {
                let allowed = "must be None, \"auto\" or a cut-off in Hz";
                Err(PyValueError::new_err(format!("smoothing = {}: {allowed}", quoted(&smoothing))))
            }
        }
    }
}

pub(crate) fn dof_scale_of(scale: Option<&Bound<'_, PyAny>>) -> PyResult<DofScaling> {
    let Some(scale) = scale else { return Ok(DofScaling::Auto) };
    match scale.extract::<String>().as_deref() {
        Ok("range") => Ok(DofScaling::Range),
        Ok("unit") => Ok(DofScaling::Unit),
        Ok(_) => {
            let allowed = "must be None, \"unit\", \"range\" or one number per DoF";
            Err(PyValueError::new_err(format!("dof_scale = {}: {allowed}", quoted(scale))))
        }
        Err(_) => crate::convert::vector("dof_scale", scale).map(DofScaling::Given),
    }
}
