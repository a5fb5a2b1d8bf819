//! The phase in which a cycle begins, relative to those of a model.

use faer::Mat;
use ndarray::{ArrayView1, ArrayView2, Axis};

/// Phases that are tried over the cycle before the best is looked for sample by sample.
const PHASES: usize = 128;
/// Another phase is taken where it leaves out less than this share of what the cycle leaves out as it is: that begins where
/// those of the model do, unless it says otherwise.
const MAX_SHARE: f64 = 0.5;
/// Forcing of a style, less that of the styles before it, that is rounding.
const ROUNDING: f64 = 1e-9;

/// Samples by which a cycle begins before those of the model: the rotation of its target (C·D) of which the forcing of the
/// styles (C·D, J) explains most, by projection.
///
/// A movement that is its own opposite half a cycle later is explained as well there, by the opposite style: where all
/// demonstrations, of `styles` (M, J), go with their mean, so must the cycle.
pub(super) fn lead(design: &Mat<f64>, target: &[f64], styles: ArrayView2<f64>, n_dofs: usize) -> usize {
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
    let mean = common(design, styles);
    let with_mean = |lead: usize| mean.as_ref().is_none_or(|mean| rotated(mean, lead) > 0.0);
    let best = |leads: &mut dyn Iterator<Item = usize>| {
        let tried = leads.filter(|lead| with_mean(*lead)).map(|lead| (lead, explained(lead)));
        tried.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let stride = n_samples.div_ceil(PHASES);
    let Some((near, _)) = best(&mut (0..n_samples).step_by(stride)) else { return 0 };
    let mut around = (0..2 * stride + 1).map(|k| (near + n_samples + k - stride) % n_samples);
    let Some((lead, most)) = best(&mut around) else { return 0 };
    let whole = dot(&target, &target);
    let better = whole - most < MAX_SHARE * (whole - explained(0));
    if better || !with_mean(0) { lead } else { 0 }
}

/// The forcing (C·D) of the mean style, if that of every demonstration goes with it.
fn common(design: &Mat<f64>, styles: ArrayView2<f64>) -> Option<Vec<f64>> {
    let forcing = |style: ArrayView1<f64>| -> Vec<f64> {
        (0..design.nrows()).map(|i| style.iter().enumerate().map(|(j, s)| design[(i, j)] * s).sum()).collect()
    };
    let mean = forcing(styles.mean_axis(Axis(0))?.view());
    let along: Vec<f64> = design.col_iter().map(|column| column.iter().zip(&mean).map(|(a, b)| a * b).sum()).collect();
    let together = styles.rows().into_iter().all(|row| row.dot(&ArrayView1::from(&along)) > 0.0);
    together.then_some(mean)
}

/// Orthonormal directions that span the forcing of all styles.
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
        // Twice is enough for orthogonality to rounding.
        for direction in directions.iter().chain(&directions) {
            let share = dot(&column, direction);
            column.iter_mut().zip(direction).for_each(|(f, d)| *f -= share * d);
        }
        let left = dot(&column, &column).sqrt();
        if left > ROUNDING * size {
            column.iter_mut().for_each(|f| *f /= left);
            directions.push(column);
        }
    }
    directions
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
