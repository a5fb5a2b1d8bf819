//! Findings of a fit about noise, and about degrees of freedom that its styles leave out.

use crate::learning::factorization::Factors;
use crate::learning::targets::Targets;
use crate::model::finding::Finding;
use crate::numerics::smoothing_spline::Noise;

/// Share of the range from which on noise is reported: smoothing then takes off details of a tenth of the movement.
const MIN_SHARE: f64 = 0.05;

/// A range is small beside one this many times as large.
const SMALL: f64 = 10.0;

/// Share of the targets, by root mean square, from which on what styles leave out is reported.
const MIN_LEFT_OUT: f64 = 0.7;

/// A range this many times the noise is one of a movement.
const MOVING: f64 = 20.0;

/// Returns the degrees of freedom whose noise is large beside their ranges (D,).
pub(super) fn noisy(noise: &Noise, ranges: &[f64], names: &[String]) -> Vec<Finding> {
    let found = noise.levels().iter().zip(noise.cut_offs()).zip(ranges.iter().zip(names));
    let found = found.filter_map(|((&level, cut_off), (&range, name))| {
        let share = level / range.max(f64::MIN_POSITIVE);
        // The smoothed range of a joint at rest is less than its noise.
        let (dof, cut_off) = (name.clone(), (*cut_off)?);
        (share > MIN_SHARE && range > level).then_some(Finding::Noisy { dof, level, share, cut_off })
    });
    found.collect()
}

/// Returns the degree of freedom of small range of which the styles leave out most.
///
/// S is orthonormal and F_basis = SᵀF, so that ‖F_d − S·F_basis,d‖² = ‖F_d‖² − ‖F_basis,d‖² for each DoF d.
pub(super) fn left_out(targets: &Targets, factors: &Factors, noise: &Noise, names: &[String]) -> Option<Finding> {
    let (ranges, n_dofs) = (targets.ranges(), names.len());
    let largest = ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let squares = |rows: &ndarray::Array2<f64>, d: usize| {
        rows.rows().into_iter().flat_map(|row| row.into_iter().skip(d).step_by(n_dofs)).map(|f| f * f).sum::<f64>()
    };
    let small = |d: &usize| ranges[*d] * SMALL < largest && ranges[*d] > MOVING * noise.levels()[*d];
    let share = |d: usize| {
        let all = squares(&targets.forcing, d);
        let share = (1.0 - squares(&factors.basis, d) / all.max(f64::MIN_POSITIVE)).max(0.0).sqrt();
        if all > 0.0 { share } else { 0.0 }
    };
    let found = (0..n_dofs).filter(small).map(|d| (d, share(d))).max_by(|a, b| a.1.total_cmp(&b.1));
    found.filter(|(_, share)| *share > MIN_LEFT_OUT).map(|(d, share)| Finding::LeftOut {
        dof: names[d].clone(),
        range: ranges[d],
        largest,
        share,
        n_styles: factors.styles.ncols(),
    })
}
