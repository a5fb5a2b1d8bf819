//! Estimation of measurement noise, and of the cut-offs that remove it, by generalised cross-validation.
//!
//! The minimum of the score of one recording is often far from the best λ. A common cut-off in Hz for each degree of freedom,
//! at the least geometric mean of the scores of all recordings, has a fifth to a half of the error of acceleration that
//! separate cut-offs have in the worst case.
//!
//! The search runs on recordings decimated by the means of blocks of samples. White noise remains white, and the noise of a
//! recording that was resampled at a higher rate becomes white again. If the best cut-off is too high for the decimated
//! rate, the search is repeated with more samples, and finally with all.

use std::ops::Range;

use super::cross_validation::{CUT_OFF_RATIO, Decimated, Scores};
use super::ends::at_rest;
use super::{NATURAL, Rest, Samples, Smoothing};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::statistics::upper_median;
use crate::numerics::threads::Threads;

/// Most recordings of a search. For forces with an impact, one in five selections of twelve recordings leads to a false
/// detection of noise, and no selection of 24.
const MAX_POOLED: usize = 24;

/// Least number of samples of a decimated recording.
pub(crate) const MIN_DECIMATED: usize = 64;

/// Highest cut-off of a decimated recording, in cycles per sample, that ends the search.
const MAX_DECIMATED_CUT_OFF: f64 = 0.25;

/// Highest cut-off of the search in cycles per sample, with λ = 1e-3. It represents interpolation: a sine at the Nyquist
/// frequency keeps 95 % of its amplitude.
const INTERPOLATION_CUT_OFF: f64 = 1.07;

/// Least decrease of the logarithmic score from interpolation to the best cut-off that is evidence of noise. Without noise
/// it is below 0.01, or up to 0.1 where some recordings have an impact; with noise that changes accelerations by a tenth or
/// more, it is 0.15 to 0.8.
const MIN_SCORE_DECREASE: f64 = 0.12;

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
    /// Ends (D,) at which the recordings are at rest.
    pub(crate) ends: Vec<Rest>,
}

impl Noise {
    /// Returns the absence of noise in `n_dofs` degrees of freedom.
    pub(crate) fn none(n_dofs: usize) -> Self {
        Self { levels: vec![0.0; n_dofs], cut_offs: vec![None; n_dofs], ends: vec![NATURAL; n_dofs] }
    }

    /// Returns the standard deviation σ (D,) of the noise in the unit of each DoF; 0 if none was estimated or detected.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Returns the cut-offs (D,) in Hz, at which a sine keeps half its amplitude; `None` for interpolation.
    pub fn cut_offs(&self) -> &[Option<f64>] {
        &self.cut_offs
    }

    /// Returns the ends (D,), first and last, at which recordings are smoothed with zero velocity.
    ///
    /// These are the ends of discrete movements at which the samples do not contradict zero velocity, by the scores of generalised
    /// cross-validation. Elsewhere the spline has no curvature at its ends, by which movements that start from rest would have a
    /// start velocity.
    pub fn ends(&self) -> &[[bool; 2]] {
        &self.ends
    }

    /// Estimates the noise from at least one recording, decimated to at least `min_samples` samples.
    ///
    /// The caller selects recordings by [`pooled`] and checks a given cut-off with [`Smoothing::check`]. The components of a
    /// vector have common noise.
    ///
    /// # Errors
    /// Threads that the system does not provide.
    pub(crate) fn estimate(
        smoothing: Smoothing,
        recordings: &[Samples],
        vectors: &[Range<usize>],
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
                let scores = Scores::compute(&all, &columns, vectors, &[hz; WIDTH], threads)?;
                noise.levels = columns.iter().map(|&d| scores.level(d, 0)).collect();
            }
            Smoothing::Auto => noise.search(recordings, vectors, min_samples, threads)?,
        }
        Ok(noise)
    }

    /// Returns the noise with the ends at which the recordings are at rest.
    ///
    /// # Errors
    /// Threads that the system does not provide.
    pub(crate) fn with_ends(
        mut self,
        recordings: &[Samples],
        vectors: &[Range<usize>],
        threads: Threads,
    ) -> Result<Self> {
        self.ends = at_rest(recordings, &self.cut_offs, vectors, threads)?;
        Ok(self)
    }

    /// Searches the cut-off of each DoF.
    fn search(
        &mut self,
        recordings: &[Samples],
        vectors: &[Range<usize>],
        mut min_samples: usize,
        threads: Threads,
    ) -> Result<()> {
        let mut pending = possibly_noisy(recordings);
        // A test of single components would depend on the frame of a vector.
        pending.retain(|d| !vectors.iter().any(|vector| vector.contains(d)));
        pending.extend(vectors.iter().flat_map(Range::clone));
        pending.sort_unstable();
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
            let interval = upper_median(decimated.iter().map(|recording| recording.interval));
            let interpolation =
                ((INTERPOLATION_CUT_OFF / interval / lowest).ln() / CUT_OFF_RATIO.ln()).ceil().max(2.0) as usize;
            let n_cut_offs = (interpolation + 1).next_multiple_of(WIDTH);
            let cut_offs: Vec<f64> = (0..n_cut_offs).map(|k| lowest * CUT_OFF_RATIO.powi(k as i32)).collect();
            let scores = Scores::compute(&decimated, &pending, vectors, &cut_offs, threads)?;
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
///
/// They are multiples of [`pool_stride`], so that recordings of unknown number can be selected as they arrive.
pub(crate) fn pooled(n: usize) -> impl Iterator<Item = usize> {
    let (n_pooled, stride) = (n.min(MAX_POOLED), pool_stride(n));
    (0..n_pooled).map(move |p| p * n / n_pooled / stride * stride)
}

/// Returns a power of two of whose multiples there are at most 512 below `n`; it does not decrease with `n`.
pub(crate) fn pool_stride(n: usize) -> usize {
    1 << (n / MIN_CANDIDATES).max(1).ilog2()
}

/// Least number of candidates for the pool, of more recordings: the pool is even to a tenth of its spacing.
const MIN_CANDIDATES: usize = 256;

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
