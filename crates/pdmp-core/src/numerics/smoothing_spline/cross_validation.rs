//! Generalised cross-validation of smoothing splines.
//!
//! For a smoothing spline f = A(λ)y the score n‖y − f‖²/tr(I − A)² estimates the prediction error (Craven and Wahba). At its
//! minimum, ‖y − f‖²/tr(I − A) estimates the noise variance.

use std::ops::Range;

use ndarray::{Array1, Array2, ArrayView1};

use super::roughness::Roughness;
use super::{NATURAL, Samples, extend_periodically, lambda};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;
use crate::validate::{row_major, row_major_mut};

/// Largest root mean square step between samples of a decimated recording, relative to its standard deviation: that of a
/// sine with twelve samples per period. With fewer, a recording of many periods would be mistaken for noise.
const MAX_STEP: f64 = 0.5;

/// Ratio of successive cut-offs of the search, half a decade of λ.
pub(super) const CUT_OFF_RATIO: f64 = 1.333_521_432_163_324;

/// Scores of generalised cross-validation for D columns and K cut-offs, summed over recordings.
pub(super) struct Scores {
    /// ln(n‖y − f‖²/tr(I − A)²) (D, K), up to a constant of each column.
    pub(super) logarithms: Array2<f64>,
    /// ‖y − f‖² (D, K), scaled to the noise of single samples instead of block means.
    pub(super) squares: Array2<f64>,
    /// tr(I − A) (D, K).
    pub(super) traces: Array2<f64>,
    /// Number of recordings in which a column moves (D,).
    moving: Array1<f64>,
    /// Mean squares of the steps between samples, and variances (2, D).
    variation: Array2<f64>,
}

impl Scores {
    /// Computes the scores of columns at cut-offs (K,) in Hz, where K is a multiple of [`WIDTH`].
    ///
    /// Columns of a group in `vectors` are the components of a vector: they share their scores, which do not depend on its
    /// frame.
    pub(super) fn compute(
        recordings: &[Decimated],
        columns: &[usize],
        vectors: &[Range<usize>],
        cut_offs: &[f64],
        threads: Threads,
    ) -> Result<Self> {
        let shape = (columns.len(), cut_offs.len());
        let mut parts: Vec<Self> = recordings.iter().map(|_| Self::zeros(shape)).collect();
        // Recordings with equal knots share their factorisations.
        let mut groups: Vec<Vec<(&Decimated, &mut Self)>> = Vec::new();
        for (recording, part) in recordings.iter().zip(&mut parts) {
            match groups.iter_mut().find(|group| group[0].0.has_knots_of(recording)) {
                Some(group) => group.push((recording, part)),
                None => groups.push(vec![(recording, part)]),
            }
        }
        let tasks = groups.iter_mut().flat_map(|group| {
            let n = group.len().div_ceil(threads.get());
            group.chunks_mut(n)
        });
        threads.try_for_each(tasks.collect(), |group| {
            fill_scores(group, columns, vectors, cut_offs);
            Ok(())
        })?;
        let mut sum = Self::zeros(shape);
        for (part, recording) in parts.iter_mut().zip(recordings) {
            for vector in vectors {
                let members: Vec<usize> = (0..columns.len()).filter(|&c| vector.contains(&columns[c])).collect();
                part.share(&members, recording.time.len());
            }
            sum.logarithms += &part.logarithms;
            sum.squares += &part.squares;
            sum.traces += &part.traces;
            sum.moving += &part.moving;
            sum.variation += &part.variation;
        }
        Ok(sum)
    }

    fn zeros(shape: (usize, usize)) -> Self {
        let [logarithms, squares, traces] = [(); 3].map(|()| Array2::zeros(shape));
        let (moving, variation) = (Array1::zeros(shape.0), Array2::zeros((2, shape.0)));
        Self { logarithms, squares, traces, moving, variation }
    }

    /// Gives the columns of a vector in one recording of n samples the score of its length.
    fn share(&mut self, members: &[usize], n: usize) {
        let Some(&moving) = members.iter().find(|&&column| self.moving[column] > 0.0) else { return };
        let count = members.len() as f64;
        for k in 0..self.squares.ncols() {
            let squares = members.iter().map(|&column| self.squares[[column, k]]).sum::<f64>() / count;
            let trace = self.traces[[moving, k]];
            let score = n as f64 * squares / (trace * trace);
            for &column in members {
                self.logarithms[[column, k]] = score.max(f64::MIN_POSITIVE).ln();
                (self.squares[[column, k]], self.traces[[column, k]]) = (squares, trace);
            }
        }
        let variation = [0, 1].map(|k| members.iter().map(|&column| self.variation[[k, column]]).sum::<f64>());
        for &column in members {
            self.moving[column] = 1.0;
            (0..2).for_each(|k| self.variation[[k, column]] = variation[k]);
        }
    }

    /// Returns the index of the least score, and the cut-off at the vertex of the parabola through it and its neighbours.
    pub(super) fn minimum(&self, column: usize, cut_offs: &[f64]) -> (usize, f64) {
        let scores = self.logarithms.row(column);
        let k = (0..cut_offs.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        if k == 0 || k + 1 == cut_offs.len() {
            return (k, cut_offs[k]);
        }
        let [below, above] = [scores[k - 1] - scores[k], scores[k + 1] - scores[k]];
        let shift = 0.5 * (below - above) / (below + above).max(f64::MIN_POSITIVE);
        (k, cut_offs[k] * CUT_OFF_RATIO.powf(shift.clamp(-0.5, 0.5)))
    }

    /// Returns the decrease of the logarithmic score between two cut-offs, as the mean of the recordings that move.
    pub(super) fn decrease(&self, column: usize, from: usize, to: usize) -> f64 {
        let scores = self.logarithms.row(column);
        (scores[from] - scores[to]) / self.moving[column].max(1.0)
    }

    /// Returns whether the sampling interval is short for the movement of a column.
    pub(super) fn is_resolved(&self, column: usize) -> bool {
        self.variation[[0, column]] <= MAX_STEP * MAX_STEP * self.variation[[1, column]]
    }

    /// Returns the standard deviation of the noise of a column at cut-off `k`.
    pub(super) fn level(&self, column: usize, k: usize) -> f64 {
        let trace = self.traces[[column, k]];
        if trace > 0.0 { (self.squares[[column, k]] / trace).sqrt() } else { 0.0 }
    }
}

/// Recording decimated by the means of blocks of samples.
pub(super) struct Decimated {
    time: Vec<f64>,
    period: Option<f64>,
    /// Means (n, D).
    values: Array2<f64>,
    /// Number of samples in a block.
    block: f64,
    /// Mean interval in seconds.
    pub(super) interval: f64,
}

impl Decimated {
    /// Decimates with the largest blocks that leave at least `min_samples` samples, or none.
    pub(super) fn new(samples: &Samples, min_samples: usize) -> Self {
        let block = (samples.len() / min_samples).max(1);
        let chunks = samples.time.chunks_exact(block);
        let time: Vec<f64> = chunks.map(|times| times.iter().sum::<f64>() / block as f64).collect();
        let n_dofs = samples.values.ncols();
        let mut values = Array2::zeros((time.len(), n_dofs));
        let rows = samples.values.as_standard_layout();
        let blocks = row_major(&rows).chunks_exact(block * n_dofs);
        for (mean, rows) in row_major_mut(&mut values).chunks_exact_mut(n_dofs).zip(blocks) {
            for row in rows.chunks_exact(n_dofs) {
                mean.iter_mut().zip(row).for_each(|(mean, y)| *mean += y);
            }
            mean.iter_mut().for_each(|mean| *mean /= block as f64);
        }
        let interval = Samples { time: &time, period: samples.period, values: values.view() }.interval();
        Self { time, period: samples.period, values, block: block as f64, interval }
    }

    fn samples(&self) -> Samples<'_> {
        Samples { time: &self.time, period: self.period, values: self.values.view() }
    }

    /// Returns whether another recording has equal times and period.
    fn has_knots_of(&self, other: &Self) -> bool {
        self.period == other.period && self.time == other.time
    }

    /// Returns the largest deviation of a column from its first value, or of the vector that it is a component of, and the
    /// deviations relative to it; `None` if zero.
    fn scaled(&self, d: usize, vectors: &[Range<usize>]) -> Option<(f64, Vec<f64>)> {
        let column = self.values.column(d);
        let deviations = column.iter().map(|y| y - column[0]);
        let scale = match vectors.iter().find(|vector| vector.contains(&d)) {
            Some(vector) => {
                let first = self.values.row(0);
                let square = |row: ArrayView1<f64>| vector.clone().map(|i| (row[i] - first[i]).powi(2)).sum::<f64>();
                self.values.rows().into_iter().map(square).fold(0.0f64, f64::max).sqrt()
            }
            None => deviations.clone().fold(0.0f64, |max, y| max.max(y.abs())),
        };
        (scale > 0.0).then(|| (scale, deviations.map(|y| y / scale).collect()))
    }
}

/// Computes the scores of columns of at least one recording with equal knots.
fn fill_scores(
    recordings: &mut [(&Decimated, &mut Scores)],
    columns: &[usize],
    vectors: &[Range<usize>],
    cut_offs: &[f64],
) {
    let first = recordings[0].0;
    let (samples, n) = (first.samples(), first.time.len());
    let mut moving = Vec::new();
    for (m, (recording, scores)) in recordings.iter_mut().enumerate() {
        for (column, &d) in columns.iter().enumerate() {
            let Some((scale, y)) = recording.scaled(d, vectors) else { continue };
            let mean = y.iter().sum::<f64>() / n as f64;
            scores.moving[column] = 1.0;
            scores.variation[[0, column]] = y.windows(2).map(|y| (y[1] - y[0]).powi(2)).sum::<f64>() / (n - 1) as f64;
            scores.variation[[1, column]] = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n as f64;
            moving.push((m, column, scale, y));
        }
    }
    for (group, hz) in cut_offs.chunks_exact(WIDTH).enumerate() {
        let pad = samples.pad(hz[0]);
        let roughness = Roughness::new(&samples.knots(pad), NATURAL);
        let lambdas = [0, 1, 2, 3].map(|k| lambda(hz[k] * first.interval));
        let factors = roughness.factorize(F64x4::new(lambdas));
        // The columns of Q without those of periodic copies.
        let own = if first.period.is_some() { pad - 1..pad - 1 + n } else { 0..n - 2 };
        let traces = roughness.trace(&factors, own).to_array();
        for (m, column, scale, y) in &moving {
            let mut differences = y.clone();
            extend_periodically(&mut differences, pad);
            roughness.second_differences(&mut differences);
            let mut gamma: Vec<F64x4> = differences.into_iter().map(F64x4::splat).collect();
            factors.solve(&mut gamma);
            let residuals = roughness.residuals(&gamma).skip(pad).take(n);
            let squares = residuals.fold(F64x4::ZERO, |sum, r| sum + r * r).to_array();
            let (recording, scores) = &mut recordings[*m];
            for (k, ((square, lambda), trace)) in squares.into_iter().zip(lambdas).zip(traces).enumerate() {
                let at = [*column, group * WIDTH + k];
                // n‖Qγ‖²/tr(QM⁻¹Qᵀ)²: λ cancels, which avoids 0/0 in the limit of interpolation.
                let score = n as f64 * square / (trace * trace);
                scores.logarithms[at] = score.max(f64::MIN_POSITIVE).ln();
                scores.squares[at] = square * (lambda * scale).powi(2) * recording.block;
                scores.traces[at] = lambda * trace;
            }
        }
    }
}
