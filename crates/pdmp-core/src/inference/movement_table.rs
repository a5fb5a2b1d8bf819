//! Table of the movements of independent parameters.

use std::sync::Arc;

use ndarray::{Array2, s};

use super::prior::{Moments, Prior, frame_size};
use crate::error::Result;
use crate::kind::Kind;
use crate::model::primitive::Primitive;
use crate::motion::unit_responses::unit_curves;
use crate::numerics::linear_algebra::symmetric_eigen;

/// Intervals of the table over the movement; linear interpolation errs by less than 1e-4 of the range.
const STEPS: usize = 200;
/// Largest number of directions of the parameters: it bounds the time of a sample.
const MAX_DIRECTIONS: usize = 24;
/// Smallest mean square of the movement along a direction, relative to the variance of the residual.
const MIN_VARIANCE: f64 = 1e-2;

/// Movements y(u) = Φ(u)θ, tabulated for θ = μ + k·(log T − mean of log T) + L·x with independent x of unit variance.
///
/// The columns of L are ordered by the mean square of their movements, relative to the variance of the residual; directions
/// below a hundredth of it, or beyond the first [`MAX_DIRECTIONS`], belong to the residual.
#[derive(Clone, Debug)]
pub(crate) struct MovementTable {
    kind: Kind,
    n_dofs: usize,
    /// Number q of directions.
    pub(crate) n_directions: usize,
    /// Length w of a row: q + 1 and zeros up to a multiple of four, so that loops run in vector registers.
    pub(crate) width: usize,
    /// Rows Φ_d(u)[L, μ, 0] (w,) for each sample and DoF.
    rows: Vec<f64>,
    /// Mean μ (K,).
    pub(crate) mean: Vec<f64>,
    /// Matrix L (K, q).
    pub(crate) directions: Array2<f64>,
    /// Left inverse of L (q, K).
    pub(crate) inverse: Array2<f64>,
}

impl MovementTable {
    /// Tabulates the movements of a primitive about the mean of a prior.
    ///
    /// # Errors
    /// Responses that do not fit into memory, or eigenvalues that do not converge.
    pub(crate) fn new(primitive: &Arc<Primitive>, prior: &Prior, moments: &Moments) -> Result<Self> {
        let (kind, n_dofs) = (prior.kind(), prior.residual().len());
        let responses = responses(primitive)?;
        let (n_rows, n_parameters) = responses.dim();
        let (variances, axes) = symmetric_eigen(moments.covariance.view(), "covariance of the demonstrations")?;
        // The covariance is positive definite but for rounding.
        let largest = variances.iter().copied().fold(0.0, f64::max);
        let deviations: Vec<f64> = variances.iter().map(|v| v.max(1e-14 * largest).sqrt()).collect();
        let root = Array2::from_shape_fn(axes.dim(), |(i, j)| axes[[i, j]] * deviations[j]);
        let mut moved = responses.dot(&root);
        for (mut row, d) in moved.rows_mut().into_iter().zip((0..n_dofs).cycle()) {
            row /= prior.residual()[d];
        }
        let metric = moved.t().dot(&moved) / (n_rows / n_dofs) as f64;
        let (squares, rotation) = symmetric_eigen(metric.view(), "movements of the demonstrations")?;
        let relevant = squares.iter().filter(|square| **square >= MIN_VARIANCE).count();
        let n_directions = relevant.clamp(1, MAX_DIRECTIONS.min(n_parameters));
        let kept = rotation.slice(s![.., n_parameters - n_directions..; -1]).to_owned();
        let directions = root.dot(&kept);
        let inverse = Array2::from_shape_fn((n_parameters, n_parameters), |(j, i)| axes[[i, j]] / deviations[j]);
        let inverse = kept.t().dot(&inverse);
        let (along, mean) = (responses.dot(&directions), responses.dot(&ndarray::aview1(&moments.mean)));
        let width = (n_directions + 1).next_multiple_of(4);
        let mut rows = vec![0.0; n_rows * width];
        for ((row, along), mean) in rows.chunks_exact_mut(width).zip(along.rows()).zip(&mean) {
            row.iter_mut().zip(along.iter().chain([mean])).for_each(|(to, from)| *to = *from);
        }
        Ok(Self { kind, n_dofs, n_directions, width, rows, mean: moments.mean.clone(), directions, inverse })
    }

    /// Returns the movements of the directions and the mean at a fraction of the duration or period, for one DoF:
    /// Φ_d(u)[L, μ, 0] (w,). A discrete movement rests before its start and past its end.
    pub(crate) fn row(&self, fraction: f64, dof: usize, row: &mut [f64]) {
        let (index, weight) = self.place(fraction);
        let stride = self.n_dofs * self.width;
        let first = index * stride + dof * self.width;
        let (below, above) = (&self.rows[first..], &self.rows[first + stride..]);
        for ((entry, a), b) in row.iter_mut().zip(below).zip(above) {
            *entry = a + weight * (b - a);
        }
    }

    fn place(&self, fraction: f64) -> (usize, f64) {
        let fraction = match self.kind {
            Kind::Discrete => fraction.clamp(0.0, 1.0),
            Kind::Rhythmic => fraction - fraction.floor(),
        };
        let place = fraction * STEPS as f64;
        let index = (place as usize).min(STEPS - 1);
        (index, place - index as f64)
    }

    /// Returns the parameters (K,) at coordinates x (q,).
    pub(crate) fn parameters<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let sum = move |row: ndarray::ArrayView1<f64>| row.iter().zip(x).map(|(a, b)| a * b).sum::<f64>();
        self.mean.iter().zip(self.directions.rows()).map(move |(mean, row)| mean + sum(row))
    }
}

/// Returns the movements Φ (S·D, K) of unit parameters, by samples and DoFs.
pub(crate) fn responses(primitive: &Arc<Primitive>) -> Result<Array2<f64>> {
    let curves = unit_curves(primitive, STEPS)?;
    let (n_styles, n_dofs, kind) = (primitive.n_styles(), primitive.n_dofs(), primitive.kind());
    let n_samples = STEPS + 1;
    let last = curves.styles.dim().2;
    let n_parameters = n_styles + frame_size(kind) * n_dofs;
    let mut responses = Array2::zeros((n_samples * n_dofs, n_parameters));
    for (k, d) in (0..n_samples).flat_map(|k| (0..n_dofs).map(move |d| (k, d))) {
        let mut row = responses.row_mut(k * n_dofs + d);
        // The last sample of a cycle is the first.
        let sample = if k < last { k } else { 0 };
        (0..n_styles).for_each(|j| row[j] = curves.styles[[0, j, sample, d]]);
        match kind {
            Kind::Discrete => {
                row[n_styles + d] = 1.0 - curves.start[[0, sample]];
                row[n_styles + n_dofs + d] = curves.start[[0, sample]];
            }
            Kind::Rhythmic => row[n_styles + d] = 1.0,
        }
    }
    Ok(responses)
}
