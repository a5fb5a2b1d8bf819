//! Kalman filter: the state at each sample given the samples before it.
//!
//! The covariances are the same for all outputs and are filtered once. The means are filtered four outputs at a time.
//!
//! R. E. Kalman, Journal of Basic Engineering 82 (1960) 35–45.

use nalgebra::SVector;

use super::matern_sde::{Square, Transition};
use super::{PORTION, Progress};
use crate::error::Result;
use crate::numerics::simd::F64x4;

/// States of four outputs.
pub(super) type States<const D: usize> = [F64x4; D];

/// Transitions from each sample to the next, and from the last one to the end of the process.
pub(super) struct Transitions<const D: usize> {
    /// A single one where the intervals are equal.
    transitions: Vec<Transition<D>>,
    n_samples: usize,
}

impl<const D: usize> Transitions<D> {
    pub(super) fn new(intervals: &Intervals, rate: f64) -> Self {
        let transitions = match intervals {
            Intervals::Even { interval, .. } => vec![Transition::new(rate * interval)],
            Intervals::Uneven(intervals) => intervals.iter().map(|interval| Transition::new(rate * interval)).collect(),
        };
        Self { transitions, n_samples: intervals.n_samples() }
    }

    pub(super) fn n_samples(&self) -> usize {
        self.n_samples
    }

    pub(super) fn are_even(&self) -> bool {
        self.transitions.len() == 1
    }

    /// Returns the transition that starts at sample i.
    pub(super) fn after(&self, i: usize) -> &Transition<D> {
        if self.are_even() { &self.transitions[0] } else { &self.transitions[i] }
    }
}

/// Intervals of the clock from each sample to the next, and from the last one to the end of the process.
pub(super) enum Intervals {
    /// Equal intervals, up to rounding of the clock.
    Even { interval: f64, n_samples: usize },
    /// One interval per sample.
    Uneven(Vec<f64>),
}

impl Intervals {
    /// Returns the intervals of ascending samples `u`; `end` is the first sample one turn later, on the circle.
    pub(super) fn new(u: &[f64], end: Option<f64>) -> Self {
        let (n_samples, first, last) = (u.len(), u[0], u[u.len() - 1]);
        let (intervals, end) = end.map_or((n_samples - 1, last), |end| (n_samples, end));
        let interval = (end - first) / intervals.max(1) as f64;
        let rounding = 4.0 * f64::EPSILON * first.abs().max(end.abs());
        if u.iter().enumerate().all(|(i, u)| (u - (first + interval * i as f64)).abs() <= rounding) {
            return Self::Even { interval, n_samples };
        }
        Self::Uneven(u.iter().zip(u[1..].iter().chain([&end])).map(|(from, to)| (to - from).max(0.0)).collect())
    }

    fn n_samples(&self) -> usize {
        match self {
            Self::Even { n_samples, .. } => *n_samples,
            Self::Uneven(intervals) => intervals.len(),
        }
    }
}

/// Prediction of a sample from the samples before it.
pub(super) struct FilterStep<const D: usize> {
    /// Covariance P of the predicted state.
    pub(super) covariance: Square<D>,
    /// Innovation variance S = P₀₀ + ν.
    pub(super) variance: f64,
    /// Kalman gain P₀/S.
    pub(super) gain: SVector<f64, D>,
}

impl<const D: usize> FilterStep<D> {
    fn new(covariance: Square<D>, noise: f64) -> Self {
        let variance = covariance[(0, 0)] + noise;
        Self { covariance, variance, gain: covariance.column(0) / variance }
    }

    /// Returns the covariance after the measurement update, P − P₀P₀ᵀ/S.
    pub(super) fn updated(&self, noise: f64) -> Square<D> {
        let p = &self.covariance;
        Square::from_fn(|i, j| {
            // In the first row and column the difference is P₀ν/S, which avoids cancellation.
            if i.min(j) == 0 { p[(i, j)] * (noise / self.variance) } else { p[(i, j)] - self.gain[i] * p[(0, j)] }
        })
    }
}

/// Filter steps of all samples, and one at the end of the process.
///
/// With equal intervals they converge to a steady state.
pub(super) struct FilterSteps<const D: usize> {
    /// Steps up to the steady state; the last one holds from there on.
    transient: Vec<FilterStep<D>>,
}

impl<const D: usize> FilterSteps<D> {
    pub(super) fn new(
        transitions: &Transitions<D>,
        start: Square<D>,
        noise: f64,
        progress: &mut Progress,
    ) -> Result<Self> {
        let mut transient = Vec::new();
        let mut step = FilterStep::new(start, noise);
        for i in 0..transitions.n_samples() {
            if (i + 1) % PORTION == 0 {
                progress.report()?;
            }
            let transition = transitions.after(i);
            let next = transition.matrix * step.updated(noise) * transition.matrix.transpose() + transition.noise;
            let next = FilterStep::new(0.5 * (next + next.transpose()), noise);
            let settled = transitions.are_even() && have_settled(&step.covariance, &next.covariance);
            transient.push(step);
            step = next;
            if settled {
                break;
            }
        }
        transient.push(step);
        Ok(Self { transient })
    }

    /// Returns the first sample of the steady state.
    pub(super) fn settled(&self) -> usize {
        self.transient.len() - 1
    }

    pub(super) fn at(&self, i: usize) -> &FilterStep<D> {
        &self.transient[i.min(self.settled())]
    }

    /// Returns the distinct steps of the first `n` samples.
    fn first(&self, n: usize) -> &[FilterStep<D>] {
        &self.transient[..n.min(self.transient.len())]
    }

    /// Returns Σ ln S over the first `n` samples.
    pub(super) fn log_variances(&self, n: usize) -> f64 {
        let first = self.first(n);
        let sum: f64 = first.iter().map(|step| step.variance.ln()).sum();
        sum + (n - first.len()) as f64 * self.at(n).variance.ln()
    }

    /// Returns the distinct covariances of the first `n` states after their measurement updates.
    pub(super) fn updated(&self, n: usize, noise: f64) -> Vec<Square<D>> {
        self.first(n).iter().map(|step| step.updated(noise)).collect()
    }
}

/// Returns true if two covariances, or two precisions, are equal up to rounding.
pub(super) fn have_settled<const D: usize>(a: &Square<D>, b: &Square<D>) -> bool {
    let rounding = |i, j| 2.0 * f64::EPSILON * (a[(i, i)] * a[(j, j)]).abs().sqrt();
    (0..D).all(|i| (0..=i).all(|j| (a[(i, j)] - b[(i, j)]).abs() <= rounding(i, j)))
}

/// Returns the predicted states at each sample and at the end of the process, (C + 1, groups), from zero.
pub(super) fn means<const D: usize>(
    transitions: &Transitions<D>,
    steps: &FilterSteps<D>,
    targets: &[F64x4],
    progress: &mut Progress,
) -> Result<Vec<States<D>>> {
    let n_samples = transitions.n_samples();
    let groups = targets.len() / n_samples;
    let mut means = vec![[F64x4::ZERO; D]; (n_samples + 1) * groups];
    for i in 0..n_samples {
        if (i + 1) % PORTION == 0 {
            progress.report()?;
        }
        let step = steps.at(i);
        let matrix = &transitions.after(i).matrix;
        let (now, next) = means[i * groups..(i + 2) * groups].split_at_mut(groups);
        for ((x, next), y) in now.iter().zip(next).zip(&targets[i * groups..]) {
            let innovation = *y - x[0];
            let updated: States<D> = std::array::from_fn(|k| x[k] + innovation * step.gain[k]);
            *next = upper(matrix, &updated);
        }
    }
    Ok(means)
}

/// Returns A·x for an upper triangular A.
#[inline(always)]
fn upper<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|i| (i..D).fold(F64x4::ZERO, |sum, j| sum + x[j] * matrix[(i, j)]))
}

/// Returns Aᵀ·x for an upper triangular A.
#[inline(always)]
pub(super) fn transposed<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|j| (0..=j).fold(F64x4::ZERO, |sum, i| sum + x[i] * matrix[(i, j)]))
}

/// Returns M·x.
#[inline(always)]
pub(super) fn product<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|i| (0..D).fold(F64x4::ZERO, |sum, j| sum + x[j] * matrix[(i, j)]))
}
