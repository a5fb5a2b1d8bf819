//! Phase shift of a cycle relative to the cycles of a model.

use faer::Mat;
use ndarray::{ArrayView1, ArrayView2, Axis};

/// Number of phases of the coarse search, which a search sample by sample around the best one follows.
const N_PHASES: usize = 128;
/// Largest ratio of the residual sums of squares after and before a shift for which the cycle is shifted. Unless a shift
/// explains the cycle clearly better, it begins in the same phase as those of the model.
const MAX_RESIDUAL_RATIO: f64 = 0.5;
/// Smallest relative norm of a style's forcing, orthogonal to that of the styles before it, that exceeds rounding.
const ROUNDING: f64 = 1e-9;

/// Returns the number of samples by which a cycle precedes those of the model.
///
/// It is the rotation of the target (C·D) whose projection on the forcing of the styles (C·D, J) is largest. A movement
/// that is its own opposite half a cycle later is explained equally well there, by the opposite style. Where the forcing
/// of all demonstrations, of `styles` (M, J), correlates positively with its mean, that of the cycle must too.
pub(super) fn phase_lead(design: &Mat<f64>, target: &[f64], styles: ArrayView2<f64>, n_dofs: usize) -> usize {
    let n_samples = target.len() / n_dofs;
    let directions = directions(design);
    let largest = target.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    if largest == 0.0 {
        return 0;
    }
    let target: Vec<f64> = target.iter().map(|f| f / largest).collect();
    let rotated = |direction: &[f64], lead: usize| {
        let (after, before) = (&target[lead * n_dofs..], &target[..lead * n_dofs]);
        let (first, last) = direction.split_at(after.len());
        dot(first, after) + dot(last, before)
    };
    let explained = |lead: usize| directions.iter().map(|direction| rotated(direction, lead).powi(2)).sum::<f64>();
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
    let total = dot(&target, &target);
    let better = total - most < MAX_RESIDUAL_RATIO * (total - explained(0));
    if better || !agrees_with_mean(0) { lead } else { 0 }
}

/// Returns the forcing (C·D) of the mean style, if that of every demonstration correlates positively with it.
fn common_forcing(design: &Mat<f64>, styles: ArrayView2<f64>) -> Option<Vec<f64>> {
    let forcing = |style: ArrayView1<f64>| -> Vec<f64> {
        (0..design.nrows()).map(|i| style.iter().enumerate().map(|(j, s)| design[(i, j)] * s).sum()).collect()
    };
    let mean = forcing(styles.mean_axis(Axis(0))?.view());
    let along: Vec<f64> = design.col_iter().map(|column| column.iter().zip(&mean).map(|(a, b)| a * b).sum()).collect();
    let together = styles.rows().into_iter().all(|row| row.dot(&ArrayView1::from(&along)) > 0.0);
    together.then_some(mean)
}

/// Returns an orthonormal basis of the forcing of all styles.
fn directions(design: &Mat<f64>) -> Vec<Vec<f64>> {
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for j in 0..design.ncols() {
        let mut column: Vec<f64> = design.col(j).iter().copied().collect();
        let largest = column.iter().fold(0.0f64, |most, f| most.max(f.abs()));
        if largest == 0.0 {
            continue;
        }
        column.iter_mut().for_each(|f| *f /= largest);
        let size = dot(&column, &column).sqrt();
        // Two passes give orthogonality to rounding.
        for direction in directions.iter().chain(&directions) {
            let share = dot(&column, direction);
            column.iter_mut().zip(direction).for_each(|(f, d)| *f -= share * d);
        }
        let norm = dot(&column, &column).sqrt();
        if norm > ROUNDING * size {
            column.iter_mut().for_each(|f| *f /= norm);
            directions.push(column);
        }
    }
    directions
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
