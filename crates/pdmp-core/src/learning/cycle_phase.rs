//! Phase shift of a cycle relative to the cycles of a model.
//!
//! The residual rotations of a cycle depend on its phase, as the mean rotation does: before they are known, the phase is that
//! in which the cycle is closest to the mean rotations, by the sum of sin²(θ/2) over its samples.

use faer::Mat;
use ndarray::{Array1, ArrayView1, ArrayView2, Axis};

use crate::demonstration::{Demonstration, Sampling};
use crate::error::Result;
use crate::model::Coordinates;
use crate::numerics::orthonormal_span::OrthonormalSpan;
use crate::numerics::rotation::{Quaternion, dot};

/// Number of phases of the coarse search, which a search sample by sample around the best one follows.
const N_PHASES: usize = 128;
/// Largest ratio of the residual sums of squares after and before a shift for which the cycle is shifted. Unless a shift
/// explains the cycle clearly better, it begins in the same phase as those of the model.
const MAX_RESIDUAL_RATIO: f64 = 0.5;

/// Returns the number of samples by which a cycle precedes those of the model.
///
/// It is the rotation of the target (C·D) whose projection on the forcing of the styles (C·D, J) is largest. A movement
/// that is its own opposite half a cycle later is explained equally well there, by the opposite style. Where the forcing
/// of all demonstrations, of `styles` (M, J), correlates positively with its mean, that of the cycle must too.
pub(super) fn phase_lead(design: &Mat<f64>, target: &[f64], styles: ArrayView2<f64>, n_dofs: usize) -> usize {
    let n_samples = target.len() / n_dofs;
    let mut span = OrthonormalSpan::default();
    design.col_iter().for_each(|column| span.add(Array1::from_iter(column.iter().copied()).view()));
    let largest = target.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    if largest == 0.0 {
        return 0;
    }
    let target: Array1<f64> = target.iter().map(|f| f / largest).collect();
    let rotated = |direction: &Array1<f64>, lead: usize| {
        let (before, after) = target.view().split_at(Axis(0), lead * n_dofs);
        let (first, last) = direction.view().split_at(Axis(0), after.len());
        first.dot(&after) + last.dot(&before)
    };
    let explained = |lead: usize| span.0.iter().map(|direction| rotated(direction, lead).powi(2)).sum::<f64>();
    let mean = common_forcing(design, styles);
    let agrees_with_mean = |lead: usize| mean.as_ref().is_none_or(|mean| rotated(mean, lead) > 0.0);
    let best = |leads: &mut dyn Iterator<Item = usize>| {
        let candidates = leads.filter(|lead| agrees_with_mean(*lead)).map(|lead| (lead, explained(lead)));
        candidates.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let stride = n_samples.div_ceil(N_PHASES);
    let Some((near, _)) = best(&mut (0..n_samples).step_by(stride)) else { return 0 };
    let mut around = (0..2 * stride + 1).map(|k| (near + n_samples + k - stride) % n_samples);
    let Some((lead, most)) = best(&mut around) else { return 0 };
    let total = target.dot(&target);
    let better = total - most < MAX_RESIDUAL_RATIO * (total - explained(0));
    if better || !agrees_with_mean(0) { lead } else { 0 }
}

/// Returns the number of samples by which a cycle with rotations precedes the mean rotations of a model, whose phase at each
/// sample is given in radians.
pub(super) fn lead_before_mean(demo: &Demonstration, phases: &[f64], coordinates: &Coordinates) -> usize {
    let n = phases.len();
    let pairs: Vec<[Vec<Quaternion>; 2]> = coordinates
        .rotations()
        .iter()
        .map(|rotation| {
            let rows = demo.position();
            let recorded = rows.rows().into_iter().map(|row| rotation.columns.read(&row.to_vec())).collect();
            [recorded, phases.iter().map(|&u| rotation.mean.at(u).rotation).collect()]
        })
        .collect();
    let off = |lead: usize| {
        let of_sample = |c: usize| pairs.iter().map(move |[q, mean]| 1.0 - dot(q[(c + lead) % n], mean[c]).powi(2));
        (0..n).flat_map(of_sample).sum::<f64>()
    };
    let best = |leads: &mut dyn Iterator<Item = usize>| {
        leads.map(|lead| (lead, off(lead))).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    let stride = n.div_ceil(N_PHASES);
    let (near, _) = best(&mut (0..n).step_by(stride));
    let (lead, least) = best(&mut (0..2 * stride + 1).map(|k| (near + n + k - stride) % n));
    if least < MAX_RESIDUAL_RATIO * off(0) { lead } else { 0 }
}

/// Returns a cycle that begins at one of its samples, given their times and the period in seconds.
///
/// # Errors
/// As for [`Demonstration::new`].
pub(super) fn beginning_at(demo: &Demonstration, lead: usize, times: &[f64], period: f64) -> Result<Demonstration> {
    let n = times.len();
    let rows: Vec<usize> = (0..n).map(|c| (c + lead) % n).collect();
    let sampling = match demo.sampling() {
        Sampling::Stamped { .. } => {
            let time = |&row: &usize| times[row] - times[lead] + if row < lead { period } else { 0.0 };
            Sampling::Stamped { time: rows.iter().map(time).collect() }
        }
        regular => regular.clone(),
    };
    demo.part(demo.position().select(Axis(0), &rows), sampling)
}

/// Returns the forcing (C·D) of the mean style, if that of every demonstration correlates positively with it.
fn common_forcing(design: &Mat<f64>, styles: ArrayView2<f64>) -> Option<Array1<f64>> {
    let style = styles.mean_axis(Axis(0))?;
    let mean =
        Array1::from_shape_fn(design.nrows(), |i| style.iter().enumerate().map(|(j, s)| design[(i, j)] * s).sum());
    let along: Vec<f64> = design.col_iter().map(|column| column.iter().zip(&mean).map(|(a, b)| a * b).sum()).collect();
    let together = styles.rows().into_iter().all(|row| row.dot(&ArrayView1::from(&along)) > 0.0);
    together.then_some(mean)
}
