//! Findings of a fit about noise, and about degrees of freedom that its styles truncate.

use ndarray::ArrayView2;

use crate::learning::factorization::Factors;
use crate::model::finding::Finding;
use crate::numerics::smoothing_spline::Noise;

/// Smallest reported noise as a share of the range. Smoothing then removes details of up to a tenth of the movement.
const MIN_NOISE_SHARE: f64 = 0.05;

/// Smallest range, as a share of the largest one, of a degree of freedom that is not at rest. The range of a constant, such as
/// the relative pose of arms that hold an object, is that of its rounding errors.
const MIN_RANGE_SHARE: f64 = 1e-12;

/// Smallest reported noise as a share of the largest range of the same unit. Joints that hardly move, such as the toes of
/// recorded walks with a range of 0.000 03 to 0.01 rad beside others of 2 rad, have noise of a large share of their own range.
const MIN_NOISE_OF_UNIT: f64 = 1e-3;

/// Smallest ratio of the largest range to a range that counts as small.
const MIN_RANGE_RATIO: f64 = 10.0;

/// Smallest reported relative truncation error.
const MIN_TRUNCATION_ERROR: f64 = 0.7;

/// Smallest ratio of range to noise of a degree of freedom that moves.
const MIN_SIGNAL_TO_NOISE: f64 = 20.0;

/// Returns a finding for each degree of freedom whose noise is large relative to its range, and not small relative to those of
/// its unit.
pub(super) fn noisy(noise: &Noise, ranges: &[f64], names: &[String], units: &[String]) -> Vec<Finding> {
    let largest = ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let largest_of = |unit: &String| {
        let same = ranges.iter().zip(units).filter(|(_, other)| *other == unit && !unit.is_empty());
        same.fold(0.0f64, |most, (range, _)| most.max(*range))
    };
    let levels = noise.levels().iter().zip(noise.cut_offs()).zip(ranges.iter().zip(names.iter().zip(units)));
    let findings = levels.filter_map(|((&level, cut_off), (&range, (name, unit)))| {
        let share = level / range.max(f64::MIN_POSITIVE);
        // The smoothed range of a joint at rest is below its noise.
        let (dof, cut_off) = (name.clone(), (*cut_off)?);
        let moves = range > level && range > MIN_RANGE_SHARE * largest;
        let matters = moves && level > MIN_NOISE_OF_UNIT * largest_of(unit);
        (share > MIN_NOISE_SHARE && matters).then_some(Finding::Noisy { dof, level, share, cut_off })
    });
    findings.collect()
}

/// Returns a finding for the degree of freedom of small range, relative to the scales (D,), that the styles truncate most.
///
/// Of 11 sets of recordings with J = 1 and 2, none is reported as recorded. With half of the columns multiplied by 1000, 8 of
/// these 22 fits are; the small columns of franka_tasks and raise_hand_bandai are reproduced worse too, below the limit.
///
/// S is orthonormal and F_basis = SᵀF, so that ‖F_d − S·F_basis,d‖² = ‖F_d‖² − ‖F_basis,d‖² for each DoF d.
///
/// `all` returns the squares ‖F_d‖² of a DoF.
pub(super) fn truncation_error(
    ranges: &[f64],
    all: impl Fn(usize) -> f64,
    factors: &Factors,
    noise: &Noise,
    dof_scale: &[f64],
    names: &[String],
) -> Option<Finding> {
    let n_dofs = names.len();
    let largest = ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let scaled: Vec<f64> = ranges.iter().zip(dof_scale).map(|(range, scale)| range / scale).collect();
    let largest_scaled = scaled.iter().fold(0.0f64, |most, range| most.max(*range));
    let small = |d: &usize| {
        let moves = ranges[*d] > MIN_SIGNAL_TO_NOISE * noise.levels()[*d];
        moves && scaled[*d] * MIN_RANGE_RATIO < largest_scaled
    };
    let share = |d: usize| {
        let all = all(d);
        let kept = squares(factors.basis_targets.view(), n_dofs, d);
        let share = (1.0 - kept / all.max(f64::MIN_POSITIVE)).max(0.0).sqrt();
        if all > 0.0 { share } else { 0.0 }
    };
    let worst = (0..n_dofs).filter(small).map(|d| (d, share(d))).max_by(|a, b| a.1.total_cmp(&b.1));
    worst.filter(|(_, share)| *share > MIN_TRUNCATION_ERROR).map(|(d, share)| Finding::TruncatedDof {
        dof: names[d].clone(),
        range: ranges[d],
        largest,
        share,
        n_styles: factors.styles.ncols(),
    })
}

/// Returns the sum of the squares of a DoF in rows (M, C·D).
pub(super) fn squares(rows: ArrayView2<f64>, n_dofs: usize, d: usize) -> f64 {
    rows.rows().into_iter().flat_map(|row| row.into_iter().skip(d).step_by(n_dofs)).map(|f| f * f).sum()
}
