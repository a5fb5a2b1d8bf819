//! The cubic smoothing spline, which takes measurement noise off samples before they are interpolated and differentiated.
//!
//! It minimises Σ(y_i − f(t_i))² + λ∫f̈². With Q (n, n−2) the second divided differences and R (n−2, n−2) the Gram
//! matrix of the hat functions, both banded, the second derivatives γ and the values f at the knots are
//!
//! ```text
//! M γ = Qᵀy,   M = R + λQᵀQ,   f = y − λQγ
//! ```
//!
//! solved in O(n) by LDLᵀ. On a uniform grid it is a low-pass filter without phase lag, 1/(1 + λω⁴) for slow signals,
//! which is why λ can be given as the frequency of half gain. Time is counted in mean intervals throughout.
//!
//! - C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10, 1967, doi:10.1007/BF02162161;
//! - P. Craven, G. Wahba, Smoothing noisy data with spline functions: generalised cross-validation, Numerische
//!   Mathematik 31, 1979, doi:10.1007/BF01404567;
//! - M. F. Hutchinson, F. R. de Hoog, Smoothing noisy data with spline functions, Numerische Mathematik 47, 1985,
//!   doi:10.1007/BF01389878 (the trace in O(n)).

mod noise;
mod roughness;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;
use crate::validate::check_positive;
pub use noise::Noise;
pub(crate) use noise::{MIN_THINNED, pool};
use roughness::Roughness;

/// Treatment of measurement noise before demonstrations are differentiated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Smoothing {
    /// Every sample is met.
    Interpolate,
    /// A sine of frequency `hz` keeps half its amplitude; the fall-off is of fourth order and without phase lag.
    CutOff {
        /// Cut-off frequency in Hz.
        hz: f64,
    },
    /// The cut-off of each degree of freedom by generalised cross-validation over all recordings together. The noise is
    /// taken to be white. Where cross-validation finds none, every sample is met.
    #[default]
    Auto,
}

/// Lowest cut-off, in cycles per sample. Rounding errors grow with λ, that is with the inverse fourth power of the
/// cut-off; here they are 1e-3 of the gain, and at ten times the cut-off 1e-7.
const MIN_PER_SAMPLE: f64 = 1e-4;

/// Reach of a sample's influence in periods of the cut-off: it decays as exp(−√2π·hz·|Δt|), here to 3e-14.
const REACH: f64 = 7.0;

/// Most copies of a cycle on either side of it: at the lowest cut-off that is allowed, one cycle per period, a sample's
/// influence decays to 1e-4 over two periods.
const MAX_COPIES: usize = 2;

/// Samples of one recording, or of one cycle where it has a period.
///
/// The caller has checked that there are at least 4, that the times increase, t_0 < … < t_{n−1} < t_0 + period, and
/// that the values are finite.
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
    /// Number of samples n.
    fn len(&self) -> usize {
        self.time.len()
    }

    /// Seconds from the first sample to the last one, or to the next cycle.
    fn duration(&self) -> f64 {
        self.period.unwrap_or_else(|| self.time[self.len() - 1] - self.time[0])
    }

    /// Mean interval in seconds.
    fn interval(&self) -> f64 {
        let n = self.len();
        self.duration() / if self.period.is_some() { n } else { n - 1 } as f64
    }

    /// Knots in mean intervals: the samples, and of a cycle `pad` of its copies on either side.
    fn knots(&self, pad: usize) -> Vec<f64> {
        let (n, interval) = (self.len(), self.interval());
        let knot = |k: usize| (self.time[k % n] - self.time[0]) / interval + (k / n * n) as f64;
        // Whole turns ahead, so that counts stay positive.
        (0..n + 2 * pad).map(|k| knot(k + MAX_COPIES * n - pad)).collect()
    }

    /// Copies of samples on either side of a cycle that tell in it at a cut-off in Hz.
    fn pad(&self, hz: f64) -> usize {
        let reach = (REACH / (hz * self.interval())).ceil();
        if self.period.is_some() { (MAX_COPIES * self.len()).min(reach as usize) } else { 0 }
    }

    /// Deviations of one to four columns from their first values (n,), with the largest of each; the last column fills up.
    fn deviations(&self, columns: &[usize]) -> (Vec<F64x4>, F64x4) {
        let rows = self.values.as_standard_layout();
        let rows = rows.as_slice().unwrap_or_default();
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

    /// The smoothed values (n, D) by rows, each column at its cut-off in Hz; columns without one stay.
    pub(crate) fn smoothed(&self, cut_offs: &[Option<f64>]) -> Array2<f64> {
        let mut smoothed = self.values.as_standard_layout().into_owned();
        let Some(lowest) = cut_offs.iter().flatten().copied().reduce(f64::min) else { return smoothed };
        let pad = self.pad(lowest);
        let roughness = Roughness::new(&self.knots(pad));
        let columns: Vec<usize> = (0..cut_offs.len()).filter(|&d| cut_offs[d].is_some()).collect();
        for columns in columns.chunks(WIDTH) {
            let mut lambdas = [1.0; WIDTH];
            let hz = columns.iter().filter_map(|&d| cut_offs[d]);
            lambdas.iter_mut().zip(hz).for_each(|(to, hz)| *to = lambda(hz * self.interval()));
            let lambda = F64x4::new(lambdas);
            // A column is smoothed as shares of its largest deviation.
            let (deviations, largest) = self.deviations(columns);
            let scale = largest.fast_max(F64x4::splat(f64::MIN_POSITIVE));
            let mut shares: Vec<F64x4> = deviations.into_iter().map(|deviation| deviation / scale).collect();
            copy_cycle(&mut shares, pad);
            roughness.bend(&mut shares);
            roughness.factor(lambda).solve(&mut shares);
            let rows = smoothed.as_slice_mut().unwrap_or_default().chunks_exact_mut(self.values.ncols());
            for (row, residual) in rows.zip(roughness.residuals(&shares).skip(pad)) {
                let off = (residual * lambda * scale).to_array();
                columns.iter().zip(off).for_each(|(&d, off)| row[d] -= off);
            }
        }
        smoothed
    }
}

/// Puts `pad` samples of the copies of a cycle on either side of it.
fn copy_cycle<T: Copy>(cycle: &mut Vec<T>, pad: usize) {
    let n = cycle.len();
    if pad > 0 {
        *cycle = (0..n + 2 * pad).map(|k| cycle[(k + MAX_COPIES * n - pad) % n]).collect();
    }
}

/// The smoothed values (n, D) of one recording, each column for itself. Noise is searched in all samples: a jump, which
/// blocks spread, does not pass for it.
///
/// # Errors
/// A cut-off that is not positive and finite, above the Nyquist frequency, below [`MIN_PER_SAMPLE`] or below one per
/// period.
pub(crate) fn smooth(
    smoothing: Smoothing,
    time: &[f64],
    period: Option<f64>,
    values: ArrayView2<f64>,
) -> Result<Array2<f64>> {
    let samples = Samples { time, period, values };
    smoothing.check(&samples)?;
    Ok(samples.smoothed(Noise::of(smoothing, &[samples], usize::MAX, Threads::ONE)?.cut_offs()))
}

impl Smoothing {
    /// Checks that a given cut-off suits a recording.
    pub(crate) fn check(self, samples: &Samples) -> Result<()> {
        let Self::CutOff { hz } = self else { return Ok(()) };
        check_positive("smoothing", hz)?;
        let per_sample = hz * samples.interval();
        let allowed = if per_sample >= 0.5 {
            "must lie below half the sampling rate"
        } else if per_sample < MIN_PER_SAMPLE {
            "must be at least a ten-thousandth of the sampling rate"
        } else if samples.period.is_some_and(|period| hz * period < 1.0 - 1e-9) {
            "must be at least one cycle per period: a lower cut-off takes the movement away"
        } else {
            return Ok(());
        };
        Err(Error::Range { name: "smoothing", value: hz, allowed })
    }
}

/// The λ that halves a sine of `frequency` cycles per sample on a uniform grid, where λQR⁻¹Qᵀ has the eigenvalue
/// λ(2 sin ω/2)⁴/(1 − ⅔sin² ω/2): the 1/(1 + λω⁴) of the continuous case up to terms of the order ω⁴. Past the Nyquist
/// frequency, where there is no such sine, it goes on falling with the fourth power.
fn lambda(frequency: f64) -> f64 {
    let inside = frequency.clamp(MIN_PER_SAMPLE, 0.5);
    let sin_squared = (PI * inside).sin().powi(2);
    (1.0 - sin_squared / 1.5) / (16.0 * sin_squared * sin_squared) * (inside / frequency).min(1.0).powi(4)
}
