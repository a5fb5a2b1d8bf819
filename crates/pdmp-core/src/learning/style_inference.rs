//! Where a demonstration lies that a model was not fitted to.

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use ndarray::{Array2, ArrayView2};

use super::cycle_phase;
use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::Alignment;
use crate::learning::targets::Targets;
use crate::model::Model;
use crate::model::conditions::Conditions;
use crate::motion::rollout::{TimeGrid, rollout};
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;

/// Largest size of a style, over the largest of the demonstrations': beyond, units differ.
const MAX_STYLE: f64 = 10.0;
/// Largest deviation from a demonstration, as a share of its movement, by root mean square over time and DoFs, each over
/// its range. Demonstrations left out of recorded sets are described in 109 of 124 cases, those of other tasks in 39 of 96.
const MAX_OFF: f64 = 0.5;
/// Size of the forcing that a style may leave out, over that which is left out of the demonstrations, by root mean square.
const MAX_LEFT_OUT: f64 = 3.0;

/// The style (J,) of a demonstration that the model was not fitted to: the likeliest given its target, with deviations like
/// those that are left out and styles as large as those of the demonstrations.
///
/// A rhythmic demonstration that begins in another phase than those of the model is turned by as many samples as bring it
/// closest to what the model makes.
///
/// `dt` in seconds and `period` serve as in a fit. Its time is scaled as that of the others was: where theirs was warped
/// so is this one's, and where they had events it needs its own (E,), in seconds.
///
/// # Errors
/// A demonstration that does not fit the model or that no style of it describes, or events where the others had none.
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
    for (told, own, otherwise) in [
        (demo.names(), model.names(), "names differ from those of the model"),
        (demo.units(), model.units(), "units differ from those of the model"),
    ] {
        if told.is_some_and(|told| told != own) {
            return Err(Error::Arguments(otherwise));
        }
    }
    let alignment = Alignment {
        kind: model.kind(),
        dt,
        period: period.into_iter().collect(),
        smoothing: Smoothing::Interpolate,
        nominal: None,
        n_samples: Some(model.learnt.n_samples),
    };
    let mut aligned = alignment.align(std::slice::from_ref(demo), Threads::ONE)?;
    aligned.noise = model.learnt.noise.clone();
    let by_events = model.learnt.template.is_none() && model.demonstrated.segment_durations.ncols() > 1;
    match (&model.learnt.template, events) {
        (None, Some(events)) if by_events => aligned.register_to(model.breaks(), events)?,
        (None, None) if by_events => {
            return Err(Error::Arguments("the model was fitted with events: pass events= of this demonstration too"));
        }
        (_, Some(_)) => {
            return Err(Error::Arguments("the model was fitted without events: leave out events="));
        }
        (Some(template), None) => aligned.warp_to(template)?,
        (None, None) => {}
    }
    let mut targets = Targets::of(&aligned, model.attractor, model.canonical(), Threads::ONE, &mut |_| Ok(()))?;
    targets.carry(&model.transport, model.attractor, model.canonical());
    targets.scale(&model.learnt.dof_scale);
    let mut position = Array2::zeros((model.learnt.n_samples, n_dofs));
    aligned.sample(0, crate::validate::row_major_mut(&mut position));

    let design = design(model);
    let mut target = targets.forcing.row(0).to_vec();
    if model.kind() == Kind::Rhythmic {
        let samples = cycle_phase::lead(&design, &target, model.demonstrated.styles.view(), n_dofs);
        target.rotate_left(samples * n_dofs);
        crate::validate::row_major_mut(&mut position).rotate_left(samples * n_dofs);
    }
    let (style, truncation_error) = likeliest(&design, &target, &model.demonstrated.styles);
    check_size(&style, model)?;
    let row = |rows: &Array2<f64>| Some(rows.row(0).to_vec());
    let mut conditions = Conditions { style: Some(style.clone()), ..Conditions::default() };
    match model.kind() {
        Kind::Discrete => (conditions.goal, conditions.start) = (row(&targets.goals), row(&targets.starts)),
        Kind::Rhythmic => conditions.anchor = row(&targets.anchors),
    }
    let off = off(model, &conditions, position.view())?;
    let times = truncation_error / usual_left_out(model, target.len());
    if off > MAX_OFF && times > MAX_LEFT_OUT { Err(Error::Undescribed { off, times }) } else { Ok(style) }
}

/// Root mean square of the forcing that the styles leave out of the demonstrations, in the units of the factorisation.
fn usual_left_out(model: &Model, n_values: usize) -> f64 {
    let kept: f64 = model.learnt.singular_values.iter().take(model.n_styles()).map(|s| s * s).sum();
    let share = model.learnt.truncation_error;
    let all = kept / (1.0 - share * share).max(f64::EPSILON);
    share * (all / (model.n_demos() * n_values) as f64).sqrt()
}

/// The forcing of unit styles (C·D, J), in the units of the factorisation.
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

/// The likeliest style (J,), and the root mean square of what it leaves out of the target.
///
/// Minimises ‖f − As‖²/σ² + Σ s_j²/v_j with v_j the largest square of the demonstrations' styles and σ² the mean square
/// that least squares leave: what the forcing of a style does not determine stays at the size of those demonstrated.
fn likeliest(design: &Mat<f64>, target: &[f64], styles: &Array2<f64>) -> (Vec<f64>, f64) {
    let (n_values, n_styles) = (design.nrows(), design.ncols());
    let largest = target.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    if largest == 0.0 {
        return (vec![0.0; n_styles], 0.0);
    }
    // In units of the target's largest value, and styles in units of the demonstrations'.
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

/// Deviations of a target that are not known better, as a share of it.
const ROUNDING: f64 = 1e-9;

/// Checks that a style is of the size of those of the demonstrations.
fn check_size(style: &[f64], model: &Model) -> Result<()> {
    let size = |style: &mut dyn Iterator<Item = &f64>| style.map(|s| s * s).sum::<f64>().sqrt();
    let largest = model.demonstrated.styles.rows().into_iter().map(|row| size(&mut row.iter())).fold(0.0, f64::max);
    let found = size(&mut style.iter());
    if found <= MAX_STYLE * largest { Ok(()) } else { Err(Error::StyleSize { ratio: found / largest }) }
}

/// The deviation of the model's movement from positions (C, D), over their own from their mean, by root mean square, each
/// DoF over its range.
fn off(model: &Model, conditions: &Conditions, position: ArrayView2<f64>) -> Result<f64> {
    let steps = model.kind().steps(position.nrows());
    let grid = TimeGrid { dt: model.duration() / steps as f64, duration: None };
    let made = rollout(model.primitive(), conditions, grid)?.position;
    let widest = model.ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let [mut deviation, mut movement] = [0.0; 2];
    for (d, range) in model.ranges.iter().enumerate() {
        let unit = if *range > 0.0 { *range } else { widest };
        let (shown, made) = (position.column(d), made.column(d));
        let mean = shown.mean().unwrap_or(0.0);
        if unit > 0.0 {
            deviation += shown.iter().zip(made).map(|(y, made)| ((y - made) / unit).powi(2)).sum::<f64>();
            movement += shown.iter().map(|y| ((y - mean) / unit).powi(2)).sum::<f64>();
        }
    }
    Ok(if movement > 0.0 { (deviation / movement).sqrt() } else { 0.0 })
}
