//! Table of the movements of independent parameters.
// Closures of iterators stay calls, into which the instructions of larger registers are not inlined.
#![allow(clippy::needless_range_loop)]

use std::sync::Arc;

use ndarray::{Array2, s};

use super::prior::{Moments, Prior, frame_size};
use crate::error::Result;
use crate::kind::Kind;
use crate::model::primitive::Primitive;
use crate::motion::unit_responses::unit_curves;
use crate::numerics::linear_algebra::symmetric_eigen;
use crate::numerics::simd::{F64x4, Register, WIDTH, padded};

/// Intervals of the table over the movement; linear interpolation errs by less than 1e-4 of the range.
const STEPS: usize = 200;
/// Largest number of directions of the parameters: it bounds the time of a sample.
pub(crate) const MAX_DIRECTIONS: usize = 24;
/// Smallest mean square of the movement along a direction, relative to the variance of the residual.
const MIN_VARIANCE: f64 = 1e-2;

/// Place between two samples of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    index: usize,
    weight: f64,
}

impl Place {
    /// Returns the fraction of the duration or period.
    pub(crate) fn share(self) -> f64 {
        (self.index as f64 + self.weight) / STEPS as f64
    }
}

/// Movements y(u) = Φ(u)θ, tabulated for θ = μ + k·(log T − mean of log T) + L·x with independent x of unit variance.
///
/// The columns of L are ordered by the mean square of their movements, relative to the variance of the residual; directions
/// below a hundredth of it, or beyond the first [`MAX_DIRECTIONS`], belong to the residual.
#[derive(Clone, Debug)]
pub(crate) struct MovementTable {
    kind: Kind,
    pub(crate) n_dofs: usize,
    /// Number q of directions.
    pub(crate) n_directions: usize,
    /// Length w of a row: q + 1 and zeros up to a multiple of four, so that loops run in vector registers.
    pub(crate) width: usize,
    /// Rows Φ_d(u)[L, μ, 0] (w,) for each sample and DoF, in groups of four columns.
    rows: Vec<F64x4>,
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
        let mut rows = Vec::with_capacity(n_rows * width / WIDTH);
        for (along, mean) in along.rows().into_iter().zip(&mean) {
            let row: Vec<f64> = along.iter().chain([mean]).copied().collect();
            rows.extend(row.chunks(WIDTH).map(padded));
        }
        Ok(Self { kind, n_dofs, n_directions, width, rows, mean: moments.mean.clone(), directions, inverse })
    }

    /// Returns the movements of the directions and the mean at four fractions of the duration or period, for one DoF:
    /// Φ_d(u)[L, μ, 0] (w,). A discrete movement rests before its start and past its end.
    #[inline(always)]
    pub(crate) fn rows<T: Register>(&self, places: &[Place; WIDTH], dof: usize, rows: &mut [F64x4]) {
        let n = self.width / WIDTH;
        let stride = self.n_dofs * n;
        let blocks = &mut rows.as_chunks_mut::<WIDTH>().0[..n];
        let mut samples = [(&self.rows[..0], &self.rows[..0]); WIDTH];
        for l in 0..WIDTH {
            let first = places[l].index * stride + dof * n;
            samples[l] = (&self.rows[first..][..n], &self.rows[first + stride..][..n]);
        }
        for k in 0..n {
            let mut lanes = [T::default(); WIDTH];
            for l in 0..WIDTH {
                let (below, above) = (T::load(&samples[l].0[k]), T::load(&samples[l].1[k]));
                lanes[l] = below + (above - below) * places[l].weight;
            }
            let columns = T::transpose(lanes);
            for l in 0..WIDTH {
                blocks[k][l] = columns[l].store();
            }
        }
    }

    /// Returns the places of fractions of the duration or period.
    pub(crate) fn places(&self, fractions: [f64; WIDTH]) -> [Place; WIDTH] {
        fractions.map(|fraction| {
            let fraction = match self.kind {
                Kind::Discrete => fraction.clamp(0.0, 1.0),
                Kind::Rhythmic => fraction - fraction.floor(),
            };
            let place = fraction * STEPS as f64;
            let index = (place as usize).min(STEPS - 1);
            Place { index, weight: place - index as f64 }
        })
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
