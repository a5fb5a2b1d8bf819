//! The Kalman filter: from what the samples before it say about the state at each sample.
//!
//! The covariances are those of all outputs, and are filtered once. The means take four outputs at a time.
//!
//! R. E. Kalman, Journal of Basic Engineering 82 (1960) 35–45.

use nalgebra::SVector;

use super::matern_sde::{Square, Transition};
use super::{PORTION, Progress};
use crate::error::Result;
use crate::numerics::simd::Lanes;

/// The states of four outputs.
pub(super) type States<const D: usize> = [Lanes; D];

/// The steps from each sample to the next, and from the last one on.
pub(super) struct Path<const D: usize> {
    /// One, if all are alike.
    transitions: Vec<Transition<D>>,
    n_samples: usize,
}

impl<const D: usize> Path<D> {
    pub(super) fn new(gaps: &Gaps, rate: f64) -> Self {
        let transitions = match gaps {
            Gaps::Even { gap, .. } => vec![Transition::new(rate * gap)],
            Gaps::Uneven(gaps) => gaps.iter().map(|gap| Transition::new(rate * gap)).collect(),
        };
        Self { transitions, n_samples: gaps.n_samples() }
    }

    pub(super) fn n_samples(&self) -> usize {
        self.n_samples
    }

    pub(super) fn is_even(&self) -> bool {
        self.transitions.len() == 1
    }

    /// The step from sample i on.
    pub(super) fn after(&self, i: usize) -> &Transition<D> {
        if self.is_even() { &self.transitions[0] } else { &self.transitions[i] }
    }
}

/// Distances from each sample to the next, and from the last one to what closes the chain.
pub(super) enum Gaps {
    /// Equal but for the rounding of the clock.
    Even { gap: f64, n_samples: usize },
    /// Any, one a sample.
    Uneven(Vec<f64>),
}

impl Gaps {
    /// Between samples `u` in order; `end` is where the circle closes, if it does.
    pub(super) fn new(u: &[f64], end: Option<f64>) -> Self {
        let (n_samples, first, last) = (u.len(), u[0], u[u.len() - 1]);
        let (intervals, end) = end.map_or((n_samples - 1, last), |end| (n_samples, end));
        let gap = (end - first) / intervals.max(1) as f64;
        let rounding = 4.0 * f64::EPSILON * first.abs().max(end.abs());
        if u.iter().enumerate().all(|(i, u)| (u - (first + gap * i as f64)).abs() <= rounding) {
            return Self::Even { gap, n_samples };
        }
        Self::Uneven(u.iter().zip(u[1..].iter().chain([&end])).map(|(from, to)| (to - from).max(0.0)).collect())
    }

    fn n_samples(&self) -> usize {
        match self {
            Self::Even { n_samples, .. } => *n_samples,
            Self::Uneven(gaps) => gaps.len(),
        }
    }
}

/// What the filter knows of a sample before it is seen.
pub(super) struct Step<const D: usize> {
    /// P, covariance of the state.
    pub(super) covariance: Square<D>,
    /// S, variance of the sample: P₀₀ + ν.
    pub(super) spread: f64,
    /// Share of the innovation that each component of the state takes, P₀/S.
    pub(super) gain: SVector<f64, D>,
}

impl<const D: usize> Step<D> {
    fn new(covariance: Square<D>, noise: f64) -> Self {
        let spread = covariance[(0, 0)] + noise;
        Self { covariance, spread, gain: covariance.column(0) / spread }
    }

    /// Covariance once the sample is seen, P − P₀P₀ᵀ/S.
    pub(super) fn updated(&self, noise: f64) -> Square<D> {
        let p = &self.covariance;
        Square::from_fn(|i, j| {
            // In the first row and column the difference is P₀ν/S: no digit is lost.
            if i.min(j) == 0 { p[(i, j)] * (noise / self.spread) } else { p[(i, j)] - self.gain[i] * p[(0, j)] }
        })
    }
}

/// What the filter goes through along a path: a step for each sample, and one where the path ends.
///
/// On an even path they settle.
pub(super) struct Steps<const D: usize> {
    /// Those that differ; the last stands for all that follow.
    different: Vec<Step<D>>,
}

impl<const D: usize> Steps<D> {
    pub(super) fn new(path: &Path<D>, start: Square<D>, noise: f64, progress: &mut Progress) -> Result<Self> {
        let mut different = Vec::new();
        let mut step = Step::new(start, noise);
        for i in 0..path.n_samples() {
            if (i + 1) % PORTION == 0 {
                progress.ask()?;
            }
            let transition = path.after(i);
            let next = transition.matrix * step.updated(noise) * transition.matrix.transpose() + transition.noise;
            let next = Step::new(0.5 * (next + next.transpose()), noise);
            let settled = path.is_even() && have_settled(&step.covariance, &next.covariance);
            different.push(step);
            step = next;
            if settled {
                break;
            }
        }
        different.push(step);
        Ok(Self { different })
    }

    /// Sample from which all steps are alike.
    pub(super) fn settled(&self) -> usize {
        self.different.len() - 1
    }

    pub(super) fn at(&self, i: usize) -> &Step<D> {
        &self.different[i.min(self.settled())]
    }

    /// Those of the first `n` samples that differ: the last stands for the rest.
    fn first(&self, n: usize) -> &[Step<D>] {
        &self.different[..n.min(self.different.len())]
    }

    /// Σ ln S over the first `n` samples.
    pub(super) fn log_spreads(&self, n: usize) -> f64 {
        let first = self.first(n);
        let sum: f64 = first.iter().map(|step| step.spread.ln()).sum();
        sum + (n - first.len()) as f64 * self.at(n).spread.ln()
    }

    /// Covariances of the first `n` states once their samples are seen, as far as they differ.
    pub(super) fn updated(&self, n: usize, noise: f64) -> Vec<Square<D>> {
        self.first(n).iter().map(|step| step.updated(noise)).collect()
    }
}

/// Whether nothing but rounding distinguishes two covariances, or two precisions.
pub(super) fn have_settled<const D: usize>(a: &Square<D>, b: &Square<D>) -> bool {
    let rounding = |i, j| 2.0 * f64::EPSILON * (a[(i, i)] * a[(j, j)]).abs().sqrt();
    (0..D).all(|i| (0..=i).all(|j| (a[(i, j)] - b[(i, j)]).abs() <= rounding(i, j)))
}

/// The states that the filter expects at each sample and where the path ends, (C + 1, groups), from zero on.
pub(super) fn means<const D: usize>(
    path: &Path<D>,
    steps: &Steps<D>,
    targets: &[Lanes],
    progress: &mut Progress,
) -> Result<Vec<States<D>>> {
    let n_samples = path.n_samples();
    let groups = targets.len() / n_samples;
    let mut means = vec![[Lanes::ZERO; D]; (n_samples + 1) * groups];
    for i in 0..n_samples {
        if (i + 1) % PORTION == 0 {
            progress.ask()?;
        }
        let step = steps.at(i);
        let matrix = &path.after(i).matrix;
        let (now, next) = means[i * groups..(i + 2) * groups].split_at_mut(groups);
        for ((x, next), y) in now.iter().zip(next).zip(&targets[i * groups..]) {
            let innovation = *y - x[0];
            let seen: States<D> = std::array::from_fn(|k| x[k] + innovation * step.gain[k]);
            *next = upper(matrix, &seen);
        }
    }
    Ok(means)
}

/// A·x of an upper triangular A.
#[inline(always)]
pub(super) fn upper<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|i| (i..D).fold(Lanes::ZERO, |sum, j| sum + x[j] * matrix[(i, j)]))
}

/// Aᵀ·x of an upper triangular A.
#[inline(always)]
pub(super) fn transposed<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|j| (0..=j).fold(Lanes::ZERO, |sum, i| sum + x[i] * matrix[(i, j)]))
}

/// M·x.
#[inline(always)]
pub(super) fn product<const D: usize>(matrix: &Square<D>, x: &States<D>) -> States<D> {
    std::array::from_fn(|i| (0..D).fold(Lanes::ZERO, |sum, j| sum + x[j] * matrix[(i, j)]))
}
