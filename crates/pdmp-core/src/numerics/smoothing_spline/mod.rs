//! Cubic smoothing spline, which removes measurement noise from samples before interpolation and differentiation.
//!
//! It minimises Σ(y_i − f(t_i))² + λ∫f̈². With the second divided differences Q (n, n−2) and the Gram matrix R (n−2, n−2)
//! of the hat functions, both banded, the second derivatives γ and the values f at the knots are
//!
//! ```text
//! M γ = Qᵀy,   M = R + λQᵀQ,   f = y − λQγ
//! ```
//!
//! solved in O(n) by LDLᵀ. On a uniform grid the spline is a low-pass filter without phase lag, with the gain 1/(1 + λω⁴)
//! for slow signals. The frequency of half gain, the cut-off, therefore determines λ. The unit of time is the mean interval.
//! At its ends f̈ = 0, or ḟ = 0 where the recordings of a fit begin or end at rest (`ends`).
//!
//! - C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10, 1967, doi:10.1007/BF02162161;
//! - P. Craven, G. Wahba, Smoothing noisy data with spline functions: generalised cross-validation, Numerische
//!   Mathematik 31, 1979, doi:10.1007/BF01404567;
//! - M. F. Hutchinson, F. R. de Hoog, Smoothing noisy data with spline functions, Numerische Mathematik 47, 1985,
//!   doi:10.1007/BF01389878 (the trace in O(n)).

mod cross_validation;
mod ends;
mod noise;
mod roughness;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;
use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;
use crate::validate::{check_positive, row_major, row_major_mut};
pub(crate) use ends::{NATURAL, Rest};
pub use noise::Noise;
pub(crate) use noise::{MIN_DECIMATED, pool_stride, pooled};
use roughness::{Factorization, Roughness};

/// Treatment of measurement noise before demonstrations are differentiated.
///
/// ```
/// # #[cfg(feature = "learning")] {
/// use pdmp_core::FitOptions;
/// use pdmp_core::numerics::Smoothing;
///
/// let options = FitOptions::discrete().smoothing(Smoothing::CutOff { hz: 6.0 });
/// assert_eq!(options.smoothing, Smoothing::CutOff { hz: 6.0 });
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Smoothing {
    /// Interpolation of every sample.
    Interpolate,
    /// Low-pass filter of fourth order without phase lag.
    CutOff {
        /// Cut-off frequency in Hz, at which a sine keeps half its amplitude.
        hz: f64,
    },
    /// Low-pass filter with the cut-off of each degree of freedom by generalised cross-validation over all recordings
    /// together, which assumes white noise. Where it detects none, every sample is interpolated.
    #[default]
    Auto,
}

/// Lowest cut-off, in cycles per sample. Rounding errors grow with λ, the inverse fourth power of the cut-off: they are 1e-3
/// of the gain here, and 1e-7 at ten times this cut-off.
const MIN_CUT_OFF: f64 = 1e-4;

/// Range of influence of a sample, in periods of the cut-off. The influence decays as exp(−√2π·hz·|Δt|), here to 3e-14.
const INFLUENCE_PERIODS: f64 = 7.0;

/// Most copies of a cycle on either side of it. At the lowest valid cut-off, one cycle per period, the influence of a sample
/// decays to 1e-4 over two periods.
const MAX_COPIES: usize = 2;

/// Samples of a recording, or of one cycle if they have a period.
///
/// The caller ensures at least 4 samples, increasing times t_0 < … < t_{n−1} < t_0 + period, and finite values.
#[derive(Clone, Copy)]
pub(crate) struct Samples<'a> {
    /// Times (n,) in seconds.
    pub(crate) time: &'a [f64],
    /// Period in seconds.
    pub(crate) period: Option<f64>,
    /// Values (n, D).
    pub(crate) values: ArrayView2<'a, f64>,
}

impl Samples<'_> {
    /// Returns the number of samples n.
    fn len(&self) -> usize {
        self.time.len()
    }

    /// Returns the time from the first sample to the last one or to the next cycle, in seconds.
    fn duration(&self) -> f64 {
        self.period.unwrap_or_else(|| self.time[self.len() - 1] - self.time[0])
    }

    /// Returns the mean interval in seconds.
    fn interval(&self) -> f64 {
        let n = self.len();
        self.duration() / if self.period.is_some() { n } else { n - 1 } as f64
    }

    /// Returns the times of the samples, and of `pad` periodic copies on either side, in mean intervals.
    fn knots(&self, pad: usize) -> Vec<f64> {
        let (n, interval) = (self.len(), self.interval());
        let knot = |k: usize| (self.time[k % n] - self.time[0]) / interval + (k / n * n) as f64;
        // The offset of whole cycles keeps indices positive.
        (0..n + 2 * pad).map(|k| knot(k + MAX_COPIES * n - pad)).collect()
    }

    /// Returns the number of periodic copies on either side of a cycle that influence it at a cut-off in Hz.
    fn pad(&self, hz: f64) -> usize {
        let reach = (INFLUENCE_PERIODS / (hz * self.interval())).ceil();
        if self.period.is_some() { (MAX_COPIES * self.len()).min(reach as usize) } else { 0 }
    }

    /// Returns the deviations (n,) of one to four columns from their first values, and the largest magnitude of each.
    ///
    /// Unused lanes repeat the last column.
    fn deviations(&self, columns: &[usize]) -> (Vec<F64x4>, F64x4) {
        let rows = self.values.as_standard_layout();
        let rows = row_major(&rows);
        let columns: [usize; WIDTH] = std::array::from_fn(|lane| columns[lane.min(columns.len() - 1)]);
        let at = |row: &[f64]| F64x4::new(columns.map(|d| row[d]));
        let (first, mut largest) = (at(rows), F64x4::ZERO);
        let deviation = |row: &[f64]| {
            let deviation = at(row) - first;
            largest = largest.fast_max(deviation.abs());
            deviation
        };
        (rows.chunks_exact(self.values.ncols()).map(deviation).collect(), largest)
    }

    /// Smooths each column at its cut-off in Hz, with ends that are natural or at rest. Returns values (n, D), row-major;
    /// columns without cut-off are unchanged.
    pub(crate) fn smoothed(&self, cut_offs: &[Option<f64>], ends: &[Rest]) -> Array2<f64> {
        let mut smoothed = self.values.as_standard_layout().into_owned();
        let Some(lowest) = cut_offs.iter().flatten().copied().reduce(f64::min) else { return smoothed };
        let pad = self.pad(lowest);
        let knots = self.knots(pad);
        for rest in [NATURAL, [true, false], [false, true], [true; 2]] {
            let columns: Vec<usize> =
                (0..cut_offs.len()).filter(|&d| cut_offs[d].is_some() && ends[d] == rest).collect();
            if columns.is_empty() {
                continue;
            }
            let roughness = Roughness::new(&knots, rest);
            for columns in columns.chunks(WIDTH) {
                let Solution { lambda, scale, gamma, .. } = self.solve(columns, cut_offs, &roughness, pad);
                let rows = row_major_mut(&mut smoothed).chunks_exact_mut(self.values.ncols());
                for (row, residual) in rows.zip(roughness.residuals(&gamma).skip(pad)) {
                    let noise = (residual * lambda * scale).to_array();
                    columns.iter().zip(noise).for_each(|(&d, noise)| row[d] -= noise);
                }
            }
        }
        smoothed
    }

    /// Computes the second derivatives of the splines of one to four columns with cut-offs.
    fn solve(&self, columns: &[usize], cut_offs: &[Option<f64>], roughness: &Roughness, pad: usize) -> Solution {
        let mut lambdas = [1.0; WIDTH];
        let hz = columns.iter().filter_map(|&d| cut_offs[d]);
        lambdas.iter_mut().zip(hz).for_each(|(to, hz)| *to = lambda(hz * self.interval()));
        let lambda = F64x4::new(lambdas);
        // Scaling by the largest deviation avoids overflow and underflow.
        let (deviations, largest) = self.deviations(columns);
        let scale = largest.fast_max(F64x4::splat(f64::MIN_POSITIVE));
        let mut gamma: Vec<F64x4> = deviations.into_iter().map(|deviation| deviation / scale).collect();
        extend_periodically(&mut gamma, pad);
        roughness.extend(&mut gamma);
        roughness.second_differences(&mut gamma);
        let factors = roughness.factorize(lambda);
        factors.solve(&mut gamma);
        Solution { lambda, scale, factors, gamma }
    }
}

/// Splines of four columns.
struct Solution {
    lambda: F64x4,
    /// Largest deviation of each column from its first value.
    scale: F64x4,
    factors: Factorization,
    /// Second derivatives of the columns divided by `scale`.
    gamma: Vec<F64x4>,
}

/// Extends a cycle by `pad` periodic copies of samples on either side.
fn extend_periodically<T: Copy>(cycle: &mut Vec<T>, pad: usize) {
    let n = cycle.len();
    if pad > 0 {
        *cycle = (0..n + 2 * pad).map(|k| cycle[(k + MAX_COPIES * n - pad) % n]).collect();
    }
}

/// Smooths the columns of one recording separately. Returns values (n, D).
///
/// The noise is estimated from all samples: a jump, which averages over blocks would spread, is not mistaken for noise.
///
/// # Errors
/// A cut-off that is not positive and finite, at or above half the sampling rate, below [`MIN_CUT_OFF`] or below one cycle
/// per period.
pub(crate) fn smooth(
    smoothing: Smoothing,
    time: &[f64],
    period: Option<f64>,
    values: ArrayView2<f64>,
    vectors: &[Range<usize>],
) -> Result<Array2<f64>> {
    let samples = Samples { time, period, values };
    smoothing.check(&samples)?;
    let noise = Noise::estimate(smoothing, &[samples], vectors, usize::MAX, Threads::ONE)?;
    Ok(samples.smoothed(noise.cut_offs(), &vec![NATURAL; values.ncols()]))
}

impl Smoothing {
    /// Checks a given cut-off against the sampling rate and period of a recording.
    ///
    /// # Errors
    /// As of [`smooth`].
    pub(crate) fn check(self, samples: &Samples) -> Result<()> {
        let Self::CutOff { hz } = self else { return Ok(()) };
        check_positive("smoothing", hz)?;
        let per_sample = hz * samples.interval();
        let of_rate = |allowed| Err(Error::CutOff { name: "smoothing", hz, allowed, rate: 1.0 / samples.interval() });
        if per_sample >= 0.5 {
            return of_rate("must lie below half the sampling rate");
        }
        if per_sample < MIN_CUT_OFF {
            return of_rate("must be at least a ten-thousandth of the sampling rate");
        }
        if samples.period.is_some_and(|period| hz * period < 1.0 - 1e-9) {
            let allowed = "must be at least one cycle per period: a lower cut-off removes the movement";
            return Err(Error::Range { name: "smoothing", value: hz, allowed });
        }
        Ok(())
    }
}

/// Computes the λ that halves a sine of `frequency` cycles per sample on a uniform grid.
///
/// There λQR⁻¹Qᵀ has the eigenvalue λ(2 sin ω/2)⁴/(1 − ⅔sin² ω/2), and the gain is the 1/(1 + λω⁴) of the continuous case up
/// to terms of order ω⁴. Beyond the Nyquist frequency λ continues to decrease with the fourth power.
fn lambda(frequency: f64) -> f64 {
    let below_nyquist = frequency.clamp(MIN_CUT_OFF, 0.5);
    let sin_squared = (PI * below_nyquist).sin().powi(2);
    (1.0 - sin_squared / 1.5) / (16.0 * sin_squared * sin_squared) * (below_nyquist / frequency).min(1.0).powi(4)
}
