//! Estimation of measurement noise, and of the cut-offs that remove it, by generalised cross-validation.
//!
//! For a smoothing spline f = A(λ)y the score n‖y − f‖²/tr(I − A)² estimates the prediction error (Craven and Wahba). The
//! minimum of one recording is often far from the best λ. A common cut-off in Hz for each degree of freedom, at the least
//! geometric mean of the scores of all recordings, has a fifth to a half of the error of acceleration that separate cut-offs
//! have in the worst case. At the minimum, ‖y − f‖²/tr(I − A) estimates the noise variance.
//!
//! The search runs on recordings decimated by the means of blocks of samples. White noise remains white, and the noise of a
//! recording that was resampled at a higher rate becomes white again. If the best cut-off is too high for the decimated
//! rate, the search is repeated with more samples, and finally with all.

use ndarray::{Array1, Array2};

use super::roughness::Roughness;
use super::{Samples, Smoothing, extend_periodically, lambda};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;

/// Most recordings of a search. For forces with an impact, one in five selections of twelve recordings leads to a false
/// detection of noise, and no selection of 24.
const MAX_POOLED: usize = 24;

/// Least number of samples of a decimated recording.
pub(crate) const MIN_DECIMATED: usize = 64;

/// Highest cut-off of a decimated recording, in cycles per sample, that ends the search.
const MAX_DECIMATED_CUT_OFF: f64 = 0.25;

/// Largest root mean square step between samples of a decimated recording, relative to its standard deviation: that of a
/// sine with twelve samples per period. With fewer, a recording of many periods would be mistaken for noise.
const MAX_STEP: f64 = 0.5;

/// Highest cut-off of the search in cycles per sample, with λ = 1e-3. It represents interpolation: a sine at the Nyquist
/// frequency keeps 95 % of its amplitude.
const INTERPOLATION_CUT_OFF: f64 = 1.07;

/// Least decrease of the logarithmic score from interpolation to the best cut-off that is evidence of noise. Without noise
/// it is below 0.01, or up to 0.1 where some recordings have an impact; with noise that changes accelerations by a tenth or
/// more, it is 0.15 to 0.8.
const MIN_SCORE_DECREASE: f64 = 0.12;

/// Ratio of successive cut-offs of the search, half a decade of λ.
const CUT_OFF_RATIO: f64 = 1.333_521_432_163_324;

/// Ratio of the sixth differences of noise to the second differences of the movement below which noise is negligible: it
/// changes accelerations by a thousandth.
const NEGLIGIBLE_NOISE: f64 = 2e-4;

/// Least number of samples for the test by differences.
const MIN_DIFFERENCED: usize = 16;

/// Largest number of samples for the test by differences, which bounds its cost.
const MAX_DIFFERENCED: usize = 4096;

/// Largest relative deviation of an interval from the mean at which sixth differences of a smooth movement vanish.
const MAX_UNEVENNESS: f64 = 1e-6;

/// Measurement noise of recordings, and the cut-offs of the filter that removes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviations (D,).
    pub(crate) levels: Vec<f64>,
    /// Cut-offs (D,) in Hz.
    pub(crate) cut_offs: Vec<Option<f64>>,
}

impl Noise {
    /// Returns the absence of noise in `n_dofs` degrees of freedom.
    pub(crate) fn none(n_dofs: usize) -> Self {
        Self { levels: vec![0.0; n_dofs], cut_offs: vec![None; n_dofs] }
    }

    /// Returns the standard deviation σ (D,) of the noise in the unit of each DoF; 0 if none was estimated or detected.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Returns the cut-offs (D,) in Hz, at which a sine keeps half its amplitude; `None` for interpolation.
    pub fn cut_offs(&self) -> &[Option<f64>] {
        &self.cut_offs
    }

    /// Estimates the noise from at least one recording, decimated to at least `min_samples` samples.
    ///
    /// The caller selects recordings by [`pooled`] and checks a given cut-off with [`Smoothing::check`].
    ///
    /// # Errors
    /// Threads that the system does not provide.
    pub(crate) fn estimate(
        smoothing: Smoothing,
        recordings: &[Samples],
        min_samples: usize,
        threads: Threads,
    ) -> Result<Self> {
        let n_dofs = recordings[0].values.ncols();
        let mut noise = Self::none(n_dofs);
        match smoothing {
            Smoothing::Interpolate => {}
            Smoothing::CutOff { hz } => {
                noise.cut_offs.fill(Some(hz));
                let all: Vec<Decimated> =
                    recordings.iter().map(|samples| Decimated::new(samples, usize::MAX)).collect();
                let columns: Vec<usize> = (0..n_dofs).collect();
                let scores = Scores::compute(&all, &columns, &[hz; WIDTH], threads)?;
                noise.levels = columns.iter().map(|&d| scores.level(d, 0)).collect();
            }
            Smoothing::Auto => noise.search(recordings, min_samples, threads)?,
        }
        Ok(noise)
    }

    /// Searches the cut-off of each DoF.
    fn search(&mut self, recordings: &[Samples], mut min_samples: usize, threads: Threads) -> Result<()> {
        let mut pending = possibly_noisy(recordings);
        let longest = recordings.iter().map(Samples::len).max().unwrap_or(0);
        // The lowest cut-off is one cycle per period, or half a cycle in the longest recording.
        let durations = recordings.iter().map(Samples::duration);
        let lowest = if recordings[0].period.is_some() {
            1.0 / durations.reduce(f64::min).unwrap_or(1.0)
        } else {
            0.5 / durations.reduce(f64::max).unwrap_or(1.0)
        };
        while !pending.is_empty() {
            let decimated: Vec<Decimated> =
                recordings.iter().map(|samples| Decimated::new(samples, min_samples)).collect();
            let is_last = min_samples > longest / 2;
            let interval = median(decimated.iter().map(|recording| recording.interval));
            let interpolation =
                ((INTERPOLATION_CUT_OFF / interval / lowest).ln() / CUT_OFF_RATIO.ln()).ceil().max(2.0) as usize;
            let n_cut_offs = (interpolation + 1).next_multiple_of(WIDTH);
            let cut_offs: Vec<f64> = (0..n_cut_offs).map(|k| lowest * CUT_OFF_RATIO.powi(k as i32)).collect();
            let scores = Scores::compute(&decimated, &pending, &cut_offs, threads)?;
            let mut unresolved = Vec::new();
            for (column, &d) in pending.iter().enumerate() {
                let (k, hz) = scores.minimum(column, &cut_offs[..=interpolation]);
                let resolved = is_last || hz * interval <= MAX_DECIMATED_CUT_OFF && scores.is_resolved(column);
                if resolved && scores.decrease(column, interpolation, k) > MIN_SCORE_DECREASE {
                    (self.cut_offs[d], self.levels[d]) = (Some(hz), scores.level(column, k));
                } else if !is_last {
                    unresolved.push(d);
                }
            }
            pending = unresolved;
            min_samples = min_samples.saturating_mul(2);
        }
        Ok(())
    }
}

/// Returns the indices of the recordings, evenly spaced among `n`, from which the common noise is estimated.
pub(crate) fn pooled(n: usize) -> impl Iterator<Item = usize> {
    let n_pooled = n.min(MAX_POOLED);
    (0..n_pooled).map(move |p| p * n / n_pooled)
}

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
    pub(super) fn compute(
        recordings: &[Decimated],
        columns: &[usize],
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
            fill_scores(group, columns, cut_offs);
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

    /// Returns the index of the least score, and the cut-off at the vertex of the parabola through it and its neighbours.
    fn minimum(&self, column: usize, cut_offs: &[f64]) -> (usize, f64) {
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
    fn decrease(&self, column: usize, from: usize, to: usize) -> f64 {
        let scores = self.logarithms.row(column);
        (scores[from] - scores[to]) / self.moving[column].max(1.0)
    }

    /// Returns whether the sampling interval is short for the movement of a column.
    fn is_resolved(&self, column: usize) -> bool {
        self.variation[[0, column]] <= MAX_STEP * MAX_STEP * self.variation[[1, column]]
    }

    /// Returns the standard deviation of the noise of a column at cut-off `k`.
    fn level(&self, column: usize, k: usize) -> f64 {
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
    interval: f64,
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

    /// Returns whether another recording has equal times and period.
    fn has_knots_of(&self, other: &Self) -> bool {
        self.period == other.period && self.time == other.time
    }

    /// Returns the largest deviation of a column from its first value, and the deviations relative to it; `None` if zero.
    fn scaled(&self, d: usize) -> Option<(f64, Vec<f64>)> {
        let column = self.values.column(d);
        let deviations = column.iter().map(|y| y - column[0]);
        let scale = deviations.clone().fold(0.0f64, |max, y| max.max(y.abs()));
        (scale > 0.0).then(|| (scale, deviations.map(|y| y / scale).collect()))
    }
}

/// Computes the scores of columns of at least one recording with equal knots.
fn fill_scores(recordings: &mut [(&Decimated, &mut Scores)], columns: &[usize], cut_offs: &[f64]) {
    let first = recordings[0].0;
    let (samples, n) = (first.samples(), first.time.len());
    let mut moving = Vec::new();
    for (m, (recording, scores)) in recordings.iter_mut().enumerate() {
        for (column, &d) in columns.iter().enumerate() {
            let Some((scale, y)) = recording.scaled(d) else { continue };
            let mean = y.iter().sum::<f64>() / n as f64;
            scores.moving[column] = 1.0;
            scores.variation[[0, column]] = y.windows(2).map(|y| (y[1] - y[0]).powi(2)).sum::<f64>() / (n - 1) as f64;
            scores.variation[[1, column]] = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n as f64;
            moving.push((m, column, scale, y));
        }
    }
    for (group, hz) in cut_offs.chunks_exact(WIDTH).enumerate() {
        let pad = samples.pad(hz[0]);
        let roughness = Roughness::new(&samples.knots(pad));
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

/// Returns the DoFs whose noise may not be negligible.
///
/// With even intervals these are the DoFs whose sixth differences are too large for a smooth movement, otherwise all.
fn possibly_noisy(recordings: &[Samples]) -> Vec<usize> {
    let is_even = |samples: &Samples| {
        let interval = samples.interval();
        let is_even = |pair: &[f64]| ((pair[1] - pair[0]) / interval - 1.0).abs() < MAX_UNEVENNESS;
        samples.len() >= MIN_DIFFERENCED && samples.time.windows(2).all(is_even)
    };
    let dofs: Vec<usize> = (0..recordings[0].values.ncols()).collect();
    if !recordings.iter().all(is_even) {
        return dofs;
    }
    let of_group = |dofs: &[usize]| {
        let deviations: Vec<(Vec<F64x4>, F64x4)> = recordings.iter().map(|samples| samples.deviations(dofs)).collect();
        let largest = deviations.iter().fold(F64x4::splat(f64::MIN_POSITIVE), |max, (_, size)| max.fast_max(*size));
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
        let noisy = |lane: &usize| (sixths[*lane] / 924.0).sqrt() > NEGLIGIBLE_NOISE * seconds[*lane].sqrt();
        (0..dofs.len()).filter(noisy).map(|lane| dofs[lane]).collect::<Vec<_>>()
    };
    dofs.chunks(WIDTH).flat_map(of_group).collect()
}

/// Returns the median, or the upper one of two.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}
