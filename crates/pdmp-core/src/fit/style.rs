//! Where a demonstration lies that a model was not fitted to.

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;

use crate::align::{Alignment, TimeScaling};
use crate::demo::Demonstration;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::smooth::Smoothing;
use crate::targets::Targets;
use crate::threads::Threads;

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
        time_scaling: TimeScaling::Linear,
    };
    let mut aligned = alignment.align(std::slice::from_ref(demo), Threads::ONE)?;
    aligned.noise = model.learnt.noise.clone();
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
