//! The size of measurement noise, and the cut-offs that take it off, by generalised cross-validation.
//!
//! Of a smoothing spline f = A(λ)y the score n‖y − f‖²/tr(I − A)² estimates the error of prediction (Craven and Wahba).
//! One recording often has a lowest score far from the best λ: one cut-off in Hz for a degree of freedom in all
//! recordings, of the least geometric mean of their scores, leaves a fifth to a half of the error of acceleration that
//! one each leaves at worst. At that cut-off, ‖y − f‖²/tr(I − A) is the variance of the noise.
//!
//! Recordings are searched in thinned form, by the means of blocks of samples: white noise stays white, and that of a
//! recording that was resampled more densely becomes white again. Where the best cut-off is too high for that, they are
//! searched again with more samples, at last with all.

use ndarray::{Array1, Array2};

use super::roughness::Roughness;
use super::{Samples, Smoothing, copy_cycle, lambda};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;

/// Most recordings that are searched together, evenly chosen: of forces with an impact, twelve show noise in every fifth
/// choice, these in none.
const MAX_POOLED: usize = 24;

/// Least samples of a thinned recording.
pub(crate) const MIN_THINNED: usize = 64;

/// Highest cut-off, in cycles per sample of thinned recordings, that is taken from them.
const MAX_THINNED: f64 = 0.25;

/// Largest step from one sample of a thinned recording to the next, by root mean square in shares of the deviation from
/// the mean: that of a sine with twelve samples a period. A recording of many periods that has fewer would pass for noise.
const MAX_STEP: f64 = 0.5;

/// Highest cut-off that is tried, in cycles per sample, which stands for interpolation: λ = 1e-3, where a sine at the
/// Nyquist frequency keeps 95 % of its amplitude.
const INTERPOLATING: f64 = 1.07;

/// Least fall of the score's logarithm, from interpolation to the best cut-off, that shows noise: without any it falls by
/// less than 0.01, where some recordings have an impact by up to 0.1, and with noise that changes accelerations by a
/// tenth or more by 0.15 to 0.8.
const MIN_GAIN: f64 = 0.12;

/// Steps of the search: half a decade of λ.
const RATIO: f64 = 1.333_521_432_163_324;

/// Sixth differences that noise would make, in shares of the second differences, below which it is negligible: it
/// changes accelerations by a thousandth.
const NEGLIGIBLE: f64 = 2e-4;

/// Fewest samples from which differences are conclusive, and most of which they are taken.
const MIN_DIFFERENCED: usize = 16;
const MAX_DIFFERENCED: usize = 4096;

/// Largest deviation of an interval from the mean, in shares of it, at which sixth differences of what is smooth vanish.
const UNEVEN: f64 = 1e-6;

/// Measurement noise of recordings, and the filter that takes it off.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    pub(crate) levels: Vec<f64>,
    pub(crate) cut_offs: Vec<Option<f64>>,
}

impl Noise {
    /// No noise in any of `n_dofs`.
    pub(crate) fn none(n_dofs: usize) -> Self {
        Self { levels: vec![0.0; n_dofs], cut_offs: vec![None; n_dofs] }
    }

    /// Standard deviation σ (D,) of the noise, in the unit of each DoF: 0 where none was looked for or found.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Cut-offs (D,) in Hz, at which a sine keeps half its amplitude; `None` where every sample is met.
    pub fn cut_offs(&self) -> &[Option<f64>] {
        &self.cut_offs
    }

    /// The noise of the recordings in a [`pool`] (at least one), all of which a given cut-off suits, searched in means of
    /// blocks that leave at least `least` samples.
    ///
    /// # Errors
    /// None but those of threads that cannot be had.
    pub(crate) fn of(smoothing: Smoothing, pool: &[Samples], least: usize, threads: Threads) -> Result<Self> {
        let n_dofs = pool[0].values.ncols();
        let mut noise = Self::none(n_dofs);
        match smoothing {
            Smoothing::Interpolate => {}
            Smoothing::CutOff { hz } => {
                noise.cut_offs.fill(Some(hz));
                let thinned: Vec<Thinned> = pool.iter().map(|samples| Thinned::of(samples, usize::MAX)).collect();
                let columns: Vec<usize> = (0..n_dofs).collect();
                let scores = Scores::of(&thinned, &columns, &[hz; WIDTH], threads)?;
                noise.levels = columns.iter().map(|&d| scores.level(d, 0)).collect();
            }
            Smoothing::Auto => noise.search(pool, least, threads)?,
        }
        Ok(noise)
    }

    /// Searches the cut-off of every DoF.
    fn search(&mut self, pool: &[Samples], mut least: usize, threads: Threads) -> Result<()> {
        let mut open = noisy(pool);
        let longest = pool.iter().map(Samples::len).max().unwrap_or(0);
        // At least one cycle per period, or half a cycle in the whole of the longest recording.
        let cycles = if pool[0].period.is_some() { 1.0 } else { 0.5 };
        let extreme = if pool[0].period.is_some() { f64::min } else { f64::max };
        let lowest = cycles / pool.iter().map(Samples::duration).reduce(extreme).unwrap_or(1.0);
        while !open.is_empty() {
            let thinned: Vec<Thinned> = pool.iter().map(|samples| Thinned::of(samples, least)).collect();
            let whole = least > longest / 2;
            let interval = median(thinned.iter().map(|thinned| thinned.interval));
            let steps = ((INTERPOLATING / interval / lowest).ln() / RATIO.ln()).ceil().max(2.0) as usize;
            let grid: Vec<f64> =
                (0..(steps + 1).next_multiple_of(WIDTH)).map(|k| lowest * RATIO.powi(k as i32)).collect();
            let scores = Scores::of(&thinned, &open, &grid, threads)?;
            let mut left = Vec::new();
            for (column, &d) in open.iter().enumerate() {
                let (k, hz) = scores.best(column, &grid[..=steps]);
                let resolved = whole || hz * interval <= MAX_THINNED && scores.is_resolved(column);
                if resolved && scores.gain(column, k, steps) > MIN_GAIN {
                    (self.cut_offs[d], self.levels[d]) = (Some(hz), scores.level(column, k));
                } else if !whole {
                    left.push(d);
                }
            }
            open = left;
            least = least.saturating_mul(2);
        }
        Ok(())
    }
}

/// Indices of the recordings, among `n`, whose noise is that of all: evenly chosen.
pub(crate) fn pool(n: usize) -> impl Iterator<Item = usize> {
    let n_pooled = n.min(MAX_POOLED);
    (0..n_pooled).map(move |p| p * n / n_pooled)
}

/// Scores of K cut-offs, of each recording and DoF.
pub(super) struct Scores {
    /// ln(n‖y − f‖²/tr(I − A)²), summed over the recordings (D, K).
    pub(super) logarithms: Array2<f64>,
    /// ‖y − f‖² (D, K), of samples that are not thinned.
    pub(super) squares: Array2<f64>,
    /// tr(I − A) (D, K).
    pub(super) traces: Array2<f64>,
    /// Number of recordings in which a column moves (D,).
    moving: Array1<f64>,
    /// Mean squares of steps from sample to sample, and of deviations from the mean (2, D).
    variation: Array2<f64>,
}

impl Scores {
    pub(super) fn of(pool: &[Thinned], columns: &[usize], grid: &[f64], threads: Threads) -> Result<Self> {
        let shape = (columns.len(), grid.len());
        let mut parts: Vec<Self> = pool.iter().map(|_| Self::zeros(shape)).collect();
        // Recordings with the same knots share their factorisations.
        let mut families: Vec<Vec<(&Thinned, &mut Self)>> = Vec::new();
        for (thinned, part) in pool.iter().zip(&mut parts) {
            match families.iter_mut().find(|family| family[0].0.has_knots_of(thinned)) {
                Some(family) => family.push((thinned, part)),
                None => families.push(vec![(thinned, part)]),
            }
        }
        let tasks = families.iter_mut().flat_map(|family| {
            let n = family.len().div_ceil(threads.get());
            family.chunks_mut(n)
        });
        threads.try_for_each(tasks.collect(), |recordings| {
            score(recordings, columns, grid);
            Ok(())
        })?;
        let mut sum = Self::zeros(shape);
        for part in &parts {
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

    /// Index and cut-off of the least score: that of the parabola through the lowest of the grid and its neighbours.
    fn best(&self, column: usize, grid: &[f64]) -> (usize, f64) {
        let scores = self.logarithms.row(column);
        let k = (0..grid.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        if k == 0 || k + 1 == grid.len() {
            return (k, grid[k]);
        }
        let [below, above] = [scores[k - 1] - scores[k], scores[k + 1] - scores[k]];
        let shift = 0.5 * (below - above) / (below + above).max(f64::MIN_POSITIVE);
        (k, grid[k] * RATIO.powf(shift.clamp(-0.5, 0.5)))
    }

    /// Fall of the score's logarithm from one cut-off to another, as the mean of the recordings that move.
    fn gain(&self, column: usize, to: usize, from: usize) -> f64 {
        let scores = self.logarithms.row(column);
        (scores[from] - scores[to]) / self.moving[column].max(1.0)
    }

    /// Returns whether the samples follow the movement of a column closely.
    fn is_resolved(&self, column: usize) -> bool {
        self.variation[[0, column]] <= MAX_STEP * MAX_STEP * self.variation[[1, column]]
    }

    /// Standard deviation of the noise of a column at a cut-off of the grid.
    fn level(&self, column: usize, k: usize) -> f64 {
        let trace = self.traces[[column, k]];
        if trace > 0.0 { (self.squares[[column, k]] / trace).sqrt() } else { 0.0 }
    }
}

/// A recording by the means of blocks of `block` samples.
pub(super) struct Thinned {
    time: Vec<f64>,
    period: Option<f64>,
    /// Means (n, D).
    values: Array2<f64>,
    block: f64,
    interval: f64,
}

impl Thinned {
    /// The means of the largest blocks that leave at least `least` samples.
    pub(super) fn of(samples: &Samples, least: usize) -> Self {
        let block = (samples.len() / least).max(1);
        let chunks = samples.time.chunks_exact(block);
        let time: Vec<f64> = chunks.map(|times| times.iter().sum::<f64>() / block as f64).collect();
        let n_dofs = samples.values.ncols();
        let mut values = Array2::zeros((time.len(), n_dofs));
        let rows = samples.values.as_standard_layout();
        let blocks = rows.as_slice().unwrap_or_default().chunks_exact(block * n_dofs);
        for (mean, rows) in values.as_slice_mut().unwrap_or_default().chunks_exact_mut(n_dofs).zip(blocks) {
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

    /// Returns whether the samples lie at the same times as those of another recording.
    fn has_knots_of(&self, other: &Self) -> bool {
        self.period == other.period && self.time == other.time
    }

    /// Deviations of a column from its first value in shares of the largest, and the largest; `None` where all are equal.
    fn shares(&self, d: usize) -> Option<(f64, Vec<f64>)> {
        let column = self.values.column(d);
        let deviations = column.iter().map(|y| y - column[0]);
        let scale = deviations.clone().fold(0.0f64, |most, y| most.max(y.abs()));
        (scale > 0.0).then(|| (scale, deviations.map(|y| y / scale).collect()))
    }
}

/// Fills the scores of the columns of recordings with the same knots (at least one).
fn score(recordings: &mut [(&Thinned, &mut Scores)], columns: &[usize], grid: &[f64]) {
    let first = recordings[0].0;
    let (samples, n) = (first.samples(), first.time.len());
    let mut moving = Vec::new();
    for (m, (thinned, scores)) in recordings.iter_mut().enumerate() {
        for (column, &d) in columns.iter().enumerate() {
            let Some((scale, y)) = thinned.shares(d) else { continue };
            let mean = y.iter().sum::<f64>() / n as f64;
            scores.moving[column] = 1.0;
            scores.variation[[0, column]] = y.windows(2).map(|y| (y[1] - y[0]).powi(2)).sum::<f64>() / (n - 1) as f64;
            scores.variation[[1, column]] = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n as f64;
            moving.push((m, column, scale, y));
        }
    }
    for (group, hz) in grid.chunks_exact(WIDTH).enumerate() {
        let pad = samples.pad(hz[0]);
        let roughness = Roughness::new(&samples.knots(pad));
        let lambdas = [0, 1, 2, 3].map(|k| lambda(hz[k] * first.interval));
        let factor = roughness.factor(F64x4::new(lambdas));
        // The columns of Q that belong to a cycle, or all.
        let own = if first.period.is_some() { pad - 1..pad - 1 + n } else { 0..n - 2 };
        let traces = roughness.trace(&factor, own).to_array();
        for (m, column, scale, y) in &moving {
            let mut bend = y.clone();
            copy_cycle(&mut bend, pad);
            roughness.bend(&mut bend);
            let mut gamma: Vec<F64x4> = bend.into_iter().map(F64x4::splat).collect();
            factor.solve(&mut gamma);
            let residuals = roughness.residuals(&gamma).skip(pad).take(n);
            let squares = residuals.fold(F64x4::ZERO, |sum, r| sum + r * r).to_array();
            let (thinned, scores) = &mut recordings[*m];
            for (k, ((square, lambda), trace)) in squares.into_iter().zip(lambdas).zip(traces).enumerate() {
                let at = [*column, group * WIDTH + k];
                // n‖Qγ‖²/tr(QM⁻¹Qᵀ)², from which λ is cancelled: no 0/0 where the spline interpolates.
                let score = n as f64 * square / (trace * trace);
                scores.logarithms[at] = score.max(f64::MIN_POSITIVE).ln();
                scores.squares[at] = square * (lambda * scale).powi(2) * thinned.block;
                scores.traces[at] = lambda * trace;
            }
        }
    }
}

/// Returns the DoFs that may be noisy: all, unless the intervals of the recordings are even; then those whose sixth
/// differences are too large for a smooth movement.
fn noisy(pool: &[Samples]) -> Vec<usize> {
    let n_dofs = pool[0].values.ncols();
    let even = |samples: &Samples| {
        let interval = samples.interval();
        let even = |pair: &[f64]| ((pair[1] - pair[0]) / interval - 1.0).abs() < UNEVEN;
        samples.len() >= MIN_DIFFERENCED && samples.time.windows(2).all(even)
    };
    let dofs: Vec<usize> = (0..n_dofs).collect();
    if !pool.iter().all(even) {
        return dofs;
    }
    let of_group = |dofs: &[usize]| {
        let deviations: Vec<(Vec<F64x4>, F64x4)> = pool.iter().map(|samples| samples.deviations(dofs)).collect();
        let largest = deviations.iter().fold(F64x4::splat(f64::MIN_POSITIVE), |most, (_, size)| most.fast_max(*size));
        let (unit, [mut seconds, mut sixths]) = (F64x4::splat(1.0) / largest, [F64x4::ZERO; 2]);
        for (deviations, _) in &deviations {
            for y in deviations[..deviations.len().min(MAX_DIFFERENCED)].windows(7) {
                let (middle, pair) = (y[3], y[2] + y[4]);
                let second = (pair - middle * 2.0) * unit;
                let sixth = ((y[0] + y[6]) - (y[1] + y[5]) * 6.0 + pair * 15.0 - middle * 20.0) * unit;
                seconds += second * second;
                sixths += sixth * sixth;
            }
        }
        // White noise of variance σ² has sixth differences of variance 924 σ².
        let [seconds, sixths] = [seconds.to_array(), sixths.to_array()];
        let noisy = |lane: &usize| (sixths[*lane] / 924.0).sqrt() > NEGLIGIBLE * seconds[*lane].sqrt();
        (0..dofs.len()).filter(noisy).map(|lane| dofs[lane]).collect::<Vec<_>>()
    };
    dofs.chunks(WIDTH).flat_map(of_group).collect()
}

/// The median of some numbers, the upper one of two.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}
