//! The phase in which a cycle begins, relative to those of a model.

use faer::Mat;

/// Phases that are tried over the cycle before the best is looked for sample by sample.
const PHASES: usize = 128;
/// Another phase is taken where it leaves out less than this share of what the cycle leaves out as it is: that begins where
/// those of the model do, unless it says otherwise.
const MAX_SHARE: f64 = 0.5;
/// Forcing of a style, less that of the styles before it, that is rounding.
const ROUNDING: f64 = 1e-9;

/// Samples by which a cycle begins before those of the model: the rotation of its target (C·D) of which the forcing of the
/// styles (C·D, J) explains most, by projection.
pub(super) fn lead(design: &Mat<f64>, target: &[f64], n_dofs: usize) -> usize {
    let n_samples = target.len() / n_dofs;
    let directions = directions(design);
    let largest = target.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    if largest == 0.0 {
        return 0;
    }
    let target: Vec<f64> = target.iter().map(|f| f / largest).collect();
    let explained = |lead: usize| {
        let (after, before) = (&target[lead * n_dofs..], &target[..lead * n_dofs]);
        let product = |direction: &Vec<f64>| {
            let (first, last) = direction.split_at(after.len());
            dot(first, after) + dot(last, before)
        };
        directions.iter().map(|direction| product(direction).powi(2)).sum::<f64>()
    };
    let best = |leads: &mut dyn Iterator<Item = usize>| {
        leads.map(|lead| (lead, explained(lead))).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    let stride = n_samples.div_ceil(PHASES);
    let (near, _) = best(&mut (0..n_samples).step_by(stride));
    let around = (0..2 * stride + 1).map(|k| (near + n_samples + k - stride) % n_samples);
    let (lead, most) = best(&mut around.into_iter());
    let whole = dot(&target, &target);
    if whole - most < MAX_SHARE * (whole - explained(0)) { lead } else { 0 }
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
