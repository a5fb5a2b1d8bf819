//! Sensitivity ∂y/∂o of a movement to the outputs o of the context map.
//!
//! At a fixed phase y = Σⱼ sⱼRⱼ + g(1 − E) + y(0)E (discrete) or y = Σⱼ sⱼRⱼ + y_a (rhythmic) is linear in style, goal and
//! start or anchor, with the unit responses R and E.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, s};

use crate::context::log_duration_jacobian;
use crate::kind::Kind;
use crate::model::responses::Curves;

/// Number of steps of a movement over which errors are averaged.
pub(crate) const STEPS: usize = 100;

/// Rows of a linear map of the three DoFs of a rotation.
pub(crate) type Matrix = [[f64; 3]; 3];

/// Sensitivity of the positions to each output.
pub(crate) struct Sensitivity<'a> {
    curves: &'a Curves,
    kind: Kind,
    /// ∂y/∂T_k (T, D) with respect to each segment duration, in DoF units per second; empty at fixed phase.
    by_duration: Vec<Array2<f64>>,
}

impl<'a> Sensitivity<'a> {
    /// Returns the sensitivity for unit responses and the derivatives with respect to segment durations.
    pub(crate) fn new(kind: Kind, curves: &'a Curves, by_duration: Vec<Array2<f64>>) -> Self {
        Self { curves, kind, by_duration }
    }

    /// Returns the non-zero entries of ∂y/∂o for DoF `d` at sample `k`, with the index of each output.
    fn entries(&self, k: usize, d: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        let (n_styles, n_dofs) = (self.curves.styles.len(), self.curves.start.ncols());
        let styles = self.curves.styles.iter().enumerate().map(move |(j, curve)| (j, curve[[k, d]]));
        let start = self.curves.start[[k, d]];
        let (centre, start) = match self.kind {
            Kind::Discrete => (1.0 - start, Some((n_styles + n_dofs + d, start))),
            Kind::Rhythmic => (1.0, None),
        };
        let first = n_styles + n_dofs * if self.kind == Kind::Discrete { 2 } else { 1 };
        let durations = self.by_duration.iter().enumerate().map(move |(i, curve)| (first + i, curve[[k, d]]));
        styles.chain([(n_styles + d, centre)]).chain(start).chain(durations)
    }

    /// Returns the positions (T, D) for the outputs (P,) of one movement.
    pub(crate) fn positions(&self, outputs: ArrayView1<f64>) -> Array2<f64> {
        Array2::from_shape_fn(self.curves.start.dim(), |(k, d)| self.entries(k, d).map(|(i, x)| outputs[i] * x).sum())
    }

    /// Returns the variances (T, D) of the positions for a covariance (P, P) of the outputs. Those of a rotation are of the
    /// vectors to which the maps of each sample, with its first DoF, send changes of its three DoFs.
    pub(crate) fn variances(&self, covariance: &Array2<f64>, maps: &[Vec<(usize, Matrix)>]) -> Array2<f64> {
        Array2::from_shape_fn(self.curves.start.dim(), |(k, d)| {
            let map = maps.get(k).and_then(|maps| maps.iter().find(|(dof, _)| (*dof..dof + 3).contains(&d)));
            let entries: Vec<(usize, f64)> = match map {
                None => self.entries(k, d).collect(),
                Some((dof, map)) => {
                    let row = map[d - dof];
                    (0..3).flat_map(|j| self.entries(k, dof + j).map(move |(i, x)| (i, row[j] * x))).collect()
                }
            };
            let row = |i: usize| entries.iter().map(|&(j, y)| covariance[[i, j]] * y).sum::<f64>();
            entries.iter().map(|&(i, x)| x * row(i)).sum::<f64>().max(0.0)
        })
    }

    /// Returns the metric G (P, P) of output errors: δoᵀGδo is the mean square error of the movement, summed over DoFs.
    ///
    /// `outputs` (M, P) and `segment_durations` (M, K) are those of the demonstrations. A relative error of 1 in all
    /// segment durations counts as much as the variance of the mean movement over time.
    pub(crate) fn metric(&self, outputs: ArrayView2<f64>, segment_durations: ArrayView2<f64>) -> Array2<f64> {
        let (length, n_dofs) = self.curves.start.dim();
        let mut metric = Array2::zeros((outputs.ncols(), outputs.ncols()));
        for (k, d) in (0..length).flat_map(|k| (0..n_dofs).map(move |d| (k, d))) {
            let entries = self.entries(k, d);
            for (i, x) in entries.clone() {
                entries.clone().for_each(|(j, y)| metric[[i, j]] += x * y / length as f64);
            }
        }
        let mean = |rows: ArrayView2<f64>| rows.mean_axis(Axis(0)).unwrap_or_default();
        let changes = log_duration_jacobian(&mean(segment_durations).to_vec());
        let variation = self.positions(mean(outputs).view()).var_axis(Axis(0), 0.0).sum();
        let first = outputs.ncols() - changes.nrows();
        let duration_metric = changes.t().dot(&changes) * (variation / changes.nrows() as f64);
        metric.slice_mut(s![first.., first..]).assign(&duration_metric);
        metric
    }
}
