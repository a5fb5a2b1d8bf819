//! Style of a demonstration outside the training set.

use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use ndarray::{Array2, ArrayView2};

use super::rotations::{self, vectors_of};
use super::{cycle_phase, rotation_timing};
use crate::demonstration::{Demonstration, check_labels, check_rotations};
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::{Aligned, Alignment};
use crate::learning::targets::Targets;
use crate::model::conditions::Conditions;
use crate::model::{Coordinates, Model};
use crate::motion::rollout::{TimeGrid, rollout};
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;
use crate::validate::check_length;

/// Smallest standard deviation σ of the residuals relative to the target.
const ROUNDING: f64 = 1e-9;
/// Largest norm of a style relative to the largest of the demonstrations; beyond it, the units probably differ.
const MAX_STYLE: f64 = 10.0;
/// Largest relative deviation from a demonstration, by root mean square over time and DoFs, each scaled by its range. With
/// this limit 109 of 124 held-out demonstrations of recorded sets are accepted, and 39 of 96 of other tasks.
const MAX_DEVIATION: f64 = 0.5;
/// Largest number of shifts of a cycle with rotations to the phase of the model, the first of which is mostly the last.
const MAX_SHIFTS: usize = 4;
/// Largest truncation error of the forcing relative to that of the demonstrations, by root mean square.
const MAX_TRUNCATION_RATIO: f64 = 3.0;

/// Options of [`style_of`].
///
/// ```
/// use pdmp_core::learning::StyleOptions;
///
/// let options = StyleOptions::default().dt(0.01).landmarks([0.4, 0.9]);
/// assert_eq!(options.period, None);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StyleOptions {
    /// Sampling interval in seconds of a demonstration that carries none.
    pub dt: Option<f64>,
    /// Period in seconds of a cycle with time stamps.
    pub period: Option<f64>,
    /// Times (E,) in seconds of the landmarks of the demonstration, where the model was fitted with landmarks.
    pub landmarks: Option<Vec<f64>>,
}

impl StyleOptions {
    /// Sets the sampling interval, in seconds, of a demonstration that carries none.
    pub fn dt(self, dt: f64) -> Self {
        Self { dt: Some(dt), ..self }
    }

    /// Sets the period, in seconds, of a cycle with time stamps.
    pub fn period(self, period: f64) -> Self {
        Self { period: Some(period), ..self }
    }

    /// Sets the times (E,) of the landmarks, in seconds.
    pub fn landmarks(self, landmarks: impl Into<Vec<f64>>) -> Self {
        Self { landmarks: Some(landmarks.into()), ..self }
    }
}

/// Estimates the style (J,) of a demonstration outside the training set.
///
/// The estimate is the maximum a posteriori style given the target, with Gaussian residuals and a zero-mean Gaussian prior
/// whose standard deviations are the largest magnitudes of the demonstrations' styles. A rhythmic demonstration that
/// begins in another phase than those of the model is first shifted to their phase.
///
/// Time is scaled as in the fit: linearly, by the same warp, or by the landmarks in the options.
///
/// # Errors
/// A demonstration that does not match the model, one that no style describes, or landmarks where the model has none.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::learning::{StyleOptions, Truncation, style_of};
/// use pdmp_core::{Demonstration, FitOptions, Sampling, fit};
///
/// # let arch = |h: f64| {
/// #     let position = Array2::from_shape_fn((101, 1), |(c, _)| h * (0.0314 * c as f64).sin().powi(3));
/// #     Demonstration::new(position, Sampling::Uniform { dt: 0.01 })
/// # };
/// let demonstrations = [arch(1.0)?, arch(2.0)?];
/// let model = fit(&demonstrations, &FitOptions::discrete().n_styles(Truncation::Rank(1)))?;
/// let style = style_of(&model, &arch(1.5)?, &StyleOptions::default())?;
/// let styles = &model.demonstrated().styles;
/// assert!(styles[[0, 0]] < style[0] && style[0] < styles[[1, 0]]);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
pub fn style_of(model: &Model, demo: &Demonstration, options: &StyleOptions) -> Result<Vec<f64>> {
    let primitive = model.primitive();
    check_length("demonstration", demo.n_coordinates(), primitive.n_coordinates(), primitive.per_coordinate())?;
    let own = [primitive.coordinate_names(), primitive.coordinate_units()];
    for (name, labels, own) in [("names", demo.names(), own[0]), ("units", demo.units(), own[1])] {
        check_labels(name, labels, own, "the model")?;
    }
    let alignment = Alignment {
        kind: model.kind(),
        dt: options.dt,
        period: options.period.into_iter().collect(),
        smoothing: Smoothing::Interpolate,
        nominal: None,
        n_samples: Some(model.learnt.n_samples),
        vectors: Vec::new(),
    };
    if let Some(coordinates) = primitive.coordinates() {
        let inside = Model { primitive: Arc::clone(primitive.inside()), ..model.clone() };
        return style_about_means(&inside, demo, coordinates, &alignment, options);
    }
    let mut aligned = alignment.align(std::slice::from_ref(demo), Threads::ONE)?;
    aligned.noise = model.learnt.noise.clone();
    scale_time(&mut aligned, model, options)?;
    let Estimate { style, described, .. } = estimate(model, aligned)?;
    described.map(|()| style)
}

/// Style of a demonstration.
struct Estimate {
    style: Vec<f64>,
    /// Share of a cycle by which it precedes those of the model.
    lead: f64,
    /// An error if the model does not describe the demonstration.
    described: Result<()>,
}

/// Estimates the style of a demonstration with rotations by the model of the degrees of freedom. The residual rotations of
/// a cycle are those about the mean rotations in its phase.
fn style_about_means(
    inside: &Model,
    demo: &Demonstration,
    coordinates: &Coordinates,
    alignment: &Alignment,
    options: &StyleOptions,
) -> Result<Vec<f64>> {
    check_rotations(demo.rotations(), &coordinates.columns(), "the model")?;
    let kind = inside.kind();
    let vectors = vectors_of(std::slice::from_ref(demo))?;
    let by_shape = rotation_timing::alignment(alignment, vectors);
    let (mut shifted, mut shift) = (None, 0);
    loop {
        let demo = shifted.as_ref().unwrap_or(demo);
        let integrated = rotation_timing::integrated(std::slice::from_ref(demo), kind)?;
        let mut timed = by_shape.align(&integrated, Threads::ONE)?;
        let (times, period) = (timed.seconds(0), timed.durations()[0]);
        let lead = if kind == Kind::Rhythmic && shift == 0 {
            let phases: Vec<f64> = timed.phases(0).into_iter().map(|phase| phase * std::f64::consts::TAU).collect();
            cycle_phase::lead_before_mean(demo, &phases, coordinates)
        } else {
            scale_time(&mut timed, inside, options)?;
            let residuals = rotations::about_means(demo, coordinates, &timed.phases(0))?;
            let mut aligned = alignment.align(std::slice::from_ref(&residuals), Threads::ONE)?;
            aligned.noise = inside.learnt.noise.clone();
            aligned.set_timing(timed.timing());
            let Estimate { style, lead, described } = estimate(inside, aligned)?;
            let lead = (lead * times.len() as f64).round() as usize % times.len();
            if lead == 0 || shift == MAX_SHIFTS {
                return described.map(|()| style);
            }
            lead
        };
        if lead > 0 {
            shifted = Some(cycle_phase::beginning_at(demo, lead, &times, period)?);
        }
        shift += 1;
    }
}

/// Scales the time of the only demonstration as in the fit.
fn scale_time(aligned: &mut Aligned, model: &Model, options: &StyleOptions) -> Result<()> {
    let by_landmarks = model.learnt.template.is_none() && model.demonstrated.segment_durations.ncols() > 1;
    match (&model.learnt.template, options.landmarks.as_deref()) {
        (None, Some(landmarks)) if by_landmarks => aligned.register_to(model.breaks(), landmarks)?,
        (None, None) if by_landmarks => {
            return Err(Error::Argument {
                name: "landmarks",
                problem: "is missing: the model was fitted with landmarks; pass those of this demonstration too",
            });
        }
        (_, Some(_)) => {
            return Err(Error::Argument {
                name: "landmarks",
                problem: "does not apply: the model was fitted without landmarks",
            });
        }
        (Some(template), None) => aligned.warp_to(template),
        (None, None) => {}
    }
    Ok(())
}

/// Estimates the style of a demonstration whose columns are the degrees of freedom.
fn estimate(model: &Model, aligned: Aligned) -> Result<Estimate> {
    let n_dofs = model.n_dofs();
    let mut targets = Targets::of(&aligned, model.attractor, model.canonical(), Threads::ONE, &mut |_| Ok(()))?;
    targets.carry(&model.transport, model.attractor, model.canonical());
    targets.scale(&model.learnt.dof_scale);
    let mut position = Array2::zeros((model.learnt.n_samples, n_dofs));
    aligned.sample(0, crate::validate::row_major_mut(&mut position));

    let design = design(model);
    let mut target = targets.forcing.row(0).to_vec();
    let mut samples = 0;
    if model.kind() == Kind::Rhythmic {
        samples = cycle_phase::phase_lead(&design, &target, model.demonstrated.styles.view(), n_dofs);
        target.rotate_left(samples * n_dofs);
        crate::validate::row_major_mut(&mut position).rotate_left(samples * n_dofs);
    }
    let (style, truncation_error) = maximum_a_posteriori(&design, &target, &model.demonstrated.styles);
    let row = |rows: &Array2<f64>| Some(rows.row(0).to_vec());
    let mut conditions = Conditions { style: Some(style.clone()), ..Conditions::default() };
    match model.kind() {
        Kind::Discrete => (conditions.goal, conditions.start) = (row(&targets.goals), row(&targets.starts)),
        Kind::Rhythmic => conditions.anchor = row(&targets.anchors),
    }
    let described = check_size(&style, model).and_then(|()| {
        let off = relative_deviation(model, &conditions, position.view())?;
        let times = truncation_error / training_truncation_error(model, target.len());
        let undescribed = off > MAX_DEVIATION && times > MAX_TRUNCATION_RATIO;
        if undescribed { Err(Error::Undescribed { off, times }) } else { Ok(()) }
    });
    Ok(Estimate { style, lead: samples as f64 / model.learnt.n_samples as f64, described })
}

/// Returns the root mean square truncation error of the demonstrations, in the units of the factorisation.
fn training_truncation_error(model: &Model, n_values: usize) -> f64 {
    let kept: f64 = model.learnt.singular_values.iter().take(model.n_styles()).map(|s| s * s).sum();
    let share = model.learnt.truncation_error;
    let all = kept / (1.0 - share * share).max(f64::EPSILON);
    share * (all / (model.n_demos() * n_values) as f64).sqrt()
}

/// Returns the forcing of unit styles (C·D, J), in the units of the factorisation.
fn design(model: &Model) -> Mat<f64> {
    let (n_dofs, n_styles) = (model.n_dofs(), model.n_styles());
    let scale = &model.learnt.dof_scale;
    let clock = model.canonical().clock(model.learnt.n_samples);
    let n_outputs = model.forcing_table.n_outputs();
    let mut design = Mat::zeros(clock.len() * n_dofs, n_styles);
    let (mut value, mut slope) = (vec![0.0; n_outputs], vec![0.0; n_outputs]);
    for (c, &u) in clock.iter().enumerate() {
        model.forcing_table.evaluate(u, &mut value, &mut slope);
        for (o, w) in value.iter().enumerate() {
            let (j, d) = (o / n_dofs, o % n_dofs);
            design[(c * n_dofs + d, j)] = w / scale[d];
        }
    }
    design
}

/// Returns the maximum a posteriori style (J,), and the root mean square residual of the target.
///
/// Minimises ‖f − As‖²/σ² + Σ s_j²/v_j, where v_j is the largest square of the demonstrations' styles and σ² the mean
/// squared residual of least squares. Components that the target does not determine are bounded by the prior.
fn maximum_a_posteriori(design: &Mat<f64>, target: &[f64], styles: &Array2<f64>) -> (Vec<f64>, f64) {
    let (n_values, n_styles) = (design.nrows(), design.ncols());
    let largest = target.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    if largest == 0.0 {
        return (vec![0.0; n_styles], 0.0);
    }
    // The target is scaled by its largest value, styles by the largest of the demonstrations.
    let unit: Vec<f64> = styles.columns().into_iter().map(|s| s.iter().fold(0.0f64, |m, s| m.max(s.abs()))).collect();
    let solve = |weight: f64| {
        let rows = n_values + n_styles;
        let left = Mat::from_fn(rows, n_styles, |i, j| {
            if i < n_values {
                design[(i, j)] * (unit[j] / largest)
            } else {
                f64::from(u8::from(i - n_values == j)) * weight
            }
        });
        let right = Mat::from_fn(rows, 1, |i, _| if i < n_values { target[i] / largest } else { 0.0 });
        let solution = left.col_piv_qr().solve_lstsq(&right);
        let style: Vec<f64> = (0..n_styles).map(|j| solution[(j, 0)]).collect();
        let error = |i: usize| right[(i, 0)] - style.iter().enumerate().map(|(j, s)| left[(i, j)] * s).sum::<f64>();
        let truncation_error = ((0..n_values).map(|i| error(i).powi(2)).sum::<f64>() / n_values as f64).sqrt();
        (style, truncation_error)
    };
    let size = (target.iter().map(|f| (f / largest).powi(2)).sum::<f64>() / n_values as f64).sqrt();
    let (_, deviation) = solve(ROUNDING * size);
    let (style, truncation_error) = solve(deviation.max(ROUNDING * size));
    (style.iter().zip(&unit).map(|(s, unit)| s * unit).collect(), truncation_error * largest)
}

/// Checks the norm of a style against those of the demonstrations.
fn check_size(style: &[f64], model: &Model) -> Result<()> {
    let size = |style: &mut dyn Iterator<Item = &f64>| style.map(|s| s * s).sum::<f64>().sqrt();
    let largest = model.demonstrated.styles.rows().into_iter().map(|row| size(&mut row.iter())).fold(0.0, f64::max);
    let found = size(&mut style.iter());
    if found <= MAX_STYLE * largest { Ok(()) } else { Err(Error::StyleSize { ratio: found / largest }) }
}

/// Returns the deviation of the model's movement from positions (C, D), relative to their deviation from their mean.
///
/// Both are root mean squares with each DoF scaled by its range.
fn relative_deviation(model: &Model, conditions: &Conditions, position: ArrayView2<f64>) -> Result<f64> {
    let steps = model.kind().steps(position.nrows());
    let grid = TimeGrid { dt: model.duration() / steps as f64, duration: None };
    let reproduced = rollout(model.primitive(), conditions, grid)?.position;
    let widest = model.ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let [mut deviation, mut movement] = [0.0; 2];
    for (d, range) in model.ranges.iter().enumerate() {
        let unit = if *range > 0.0 { *range } else { widest };
        let (recorded, reproduced) = (position.column(d), reproduced.column(d));
        let mean = recorded.mean().unwrap_or(0.0);
        if unit > 0.0 {
            deviation +=
                recorded.iter().zip(reproduced).map(|(y, reproduced)| ((y - reproduced) / unit).powi(2)).sum::<f64>();
            movement += recorded.iter().map(|y| ((y - mean) / unit).powi(2)).sum::<f64>();
        }
    }
    Ok(if movement > 0.0 { (deviation / movement).sqrt() } else { 0.0 })
}
