//! What a movement owes to each output of a map from contexts.
//!
//! At one phase y = Σⱼ sⱼRⱼ + g(1 − E) + y(0)E, or Σⱼ sⱼRⱼ + y_a about an anchor, is linear in what a map predicts.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, s};

use crate::context::relative_changes;
use crate::kind::Kind;
use crate::model::responses::Curves;

/// Steps of a movement over which errors are averaged.
pub(crate) const STEPS: usize = 100;

/// Positions per unit of each output.
pub(crate) struct Sensitivity<'a> {
    curves: &'a Curves,
    kind: Kind,
    /// Those (T, D) per second of each segment's time; none at equal phase.
    paces: Vec<Array2<f64>>,
}

impl<'a> Sensitivity<'a> {
    pub(crate) fn new(kind: Kind, curves: &'a Curves, paces: Vec<Array2<f64>>) -> Self {
        Self { curves, kind, paces }
    }

    /// Indices and values of the outputs that move DoF `d` at sample `k`.
    fn of(&self, k: usize, d: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        let (n_styles, n_dofs) = (self.curves.styles.len(), self.curves.start.ncols());
        let styles = self.curves.styles.iter().enumerate().map(move |(j, curve)| (j, curve[[k, d]]));
        let start = self.curves.start[[k, d]];
        let (centre, start) = match self.kind {
            Kind::Discrete => (1.0 - start, Some((n_styles + n_dofs + d, start))),
            Kind::Rhythmic => (1.0, None),
        };
        let first = n_styles + n_dofs * if self.kind == Kind::Discrete { 2 } else { 1 };
        let paces = self.paces.iter().enumerate().map(move |(i, pace)| (first + i, pace[[k, d]]));
        styles.chain([(n_styles + d, centre)]).chain(start).chain(paces)
    }

    /// Positions (T, D) for the outputs of one movement.
    pub(crate) fn positions(&self, outputs: ArrayView1<f64>) -> Array2<f64> {
        Array2::from_shape_fn(self.curves.start.dim(), |(k, d)| self.of(k, d).map(|(i, x)| outputs[i] * x).sum())
    }

    /// Variances (T, D) for a covariance of the outputs.
    pub(crate) fn variances(&self, covariance: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn(self.curves.start.dim(), |(k, d)| {
            let active = self.of(k, d);
            let row = |i: usize| active.clone().map(|(j, y)| covariance[[i, j]] * y).sum::<f64>();
            active.clone().map(|(i, x)| x * row(i)).sum::<f64>().max(0.0)
        })
    }

    /// The matrix (P, P) that makes errors of the outputs (M, P) into the mean square of the movement's, summed over
    /// DoFs. A timing that is off by all of itself counts as much as the mean movement's own variation.
    pub(crate) fn metric(&self, outputs: ArrayView2<f64>, timings: ArrayView2<f64>) -> Array2<f64> {
        let (length, n_dofs) = self.curves.start.dim();
        let mut metric = Array2::zeros((outputs.ncols(), outputs.ncols()));
        for (k, d) in (0..length).flat_map(|k| (0..n_dofs).map(move |d| (k, d))) {
            let active = self.of(k, d);
            for (i, x) in active.clone() {
                active.clone().for_each(|(j, y)| metric[[i, j]] += x * y / length as f64);
            }
        }
        let mean = |rows: ArrayView2<f64>| rows.mean_axis(Axis(0)).unwrap_or_default();
        let changes = relative_changes(&mean(timings).to_vec());
        let variation = self.positions(mean(outputs).view()).var_axis(Axis(0), 0.0).sum();
        let first = outputs.ncols() - changes.nrows();
        let timing = changes.t().dot(&changes) * (variation / changes.nrows() as f64);
        metric.slice_mut(s![first.., first..]).assign(&timing);
        metric
    }
}
