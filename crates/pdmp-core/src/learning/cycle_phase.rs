//! Phase shift of a cycle relative to the cycles of a model.

use faer::Mat;
use ndarray::{Array1, ArrayView1, ArrayView2, Axis};

use crate::numerics::orthonormal_span::OrthonormalSpan;

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

/// Returns the forcing (C·D) of the mean style, if that of every demonstration correlates positively with it.
fn common_forcing(design: &Mat<f64>, styles: ArrayView2<f64>) -> Option<Array1<f64>> {
    let style = styles.mean_axis(Axis(0))?;
    let mean =
        Array1::from_shape_fn(design.nrows(), |i| style.iter().enumerate().map(|(j, s)| design[(i, j)] * s).sum());
    let along: Vec<f64> = design.col_iter().map(|column| column.iter().zip(&mean).map(|(a, b)| a * b).sum()).collect();
    let together = styles.rows().into_iter().all(|row| row.dot(&ArrayView1::from(&along)) > 0.0);
    together.then_some(mean)
}
