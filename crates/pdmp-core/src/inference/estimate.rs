//! Estimate of the parameters of a movement.

use std::f64::consts::TAU;

use super::prior::Prior;
use super::recogniser::Recogniser;
use crate::kind::Kind;
use crate::model::Conditions;

/// Hypotheses of less weight do not count.
pub(crate) const MIN_WEIGHT: f64 = 1e-4;

/// Means and standard deviations of the parameters of a movement, given a part of it.
///
/// Standard deviations are scaled so that 90 % of held-out demonstrations lie within 1.645 of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    kind: Kind,
    /// Style (J,), then goal (D,) and start (D,), or anchor (D,).
    pub parameters: Vec<f64>,
    /// Standard deviations of `parameters`.
    pub deviations: Vec<f64>,
    /// Style dimension J.
    pub n_styles: usize,
    /// Duration or period in seconds, the exponential of its mean logarithm.
    pub duration: f64,
    /// Standard deviation of the logarithm of the duration.
    pub duration_deviation: f64,
    /// Time of arrival of a discrete movement in seconds, on the clock of the observations.
    pub arrival: f64,
    /// Fraction of the movement, or of the cycle in [0, 1), at the last observation.
    pub fraction: f64,
    /// Standard deviation of `fraction`.
    pub fraction_deviation: f64,
    /// Mean squared residual, relative to the one that a tenth of the demonstrations exceed: above 1, the movement is
    /// unlike the demonstrations.
    pub surprise: f64,
}

impl Estimate {
    pub(crate) fn new(prior: &Prior) -> Self {
        let zeros = vec![0.0; prior.parameters().ncols()];
        Self {
            kind: prior.kind(),
            parameters: zeros.clone(),
            deviations: zeros,
            n_styles: prior.n_styles(),
            duration: 0.0,
            duration_deviation: 0.0,
            arrival: 0.0,
            fraction: 0.0,
            fraction_deviation: 0.0,
            surprise: 0.0,
        }
    }

    /// Returns the style (J,).
    pub fn style(&self) -> &[f64] {
        &self.parameters[..self.n_styles]
    }

    /// Returns the goal (D,), or the anchor of a rhythmic movement.
    pub fn goal(&self) -> &[f64] {
        &self.parameters[self.n_styles..self.n_styles + self.n_dofs()]
    }

    /// Returns the standard deviations (D,) of the goal or anchor.
    pub fn goal_deviation(&self) -> &[f64] {
        &self.deviations[self.n_styles..self.n_styles + self.n_dofs()]
    }

    fn n_dofs(&self) -> usize {
        let per_dof = if self.kind == Kind::Discrete { 2 } else { 1 };
        (self.parameters.len() - self.n_styles) / per_dof
    }

    /// Returns the conditions of the whole movement. A cycle continues from the phase of the last observation.
    pub fn conditions(&self) -> Conditions {
        let goal = Some(self.goal().to_vec());
        let conditions = Conditions {
            style: Some(self.style().to_vec()),
            segment_durations: Some(vec![self.duration]),
            ..Conditions::default()
        };
        match self.kind {
            Kind::Discrete => {
                let start = Some(self.parameters[self.n_styles + self.n_dofs()..].to_vec());
                Conditions { goal, start, ..conditions }
            }
            Kind::Rhythmic => Conditions { anchor: goal, phase: Some(TAU * self.fraction), ..conditions },
        }
    }
}

impl Recogniser {
    /// Computes the estimate from the weighed hypotheses.
    pub(crate) fn summarise(&mut self) {
        let [first, last] = self.times.unwrap_or_default();
        let (mut log, mut log_square, mut arrival) = (0.0, 0.0, 0.0);
        let (mut fraction, mut fraction_square, mut turn) = (0.0, 0.0, [0.0; 2]);
        let Self { beliefs, hypotheses, estimate, table, scratch, .. } = self;
        estimate.parameters.fill(0.0);
        estimate.deviations.fill(0.0);
        for (belief, hypothesis) in beliefs.iter().zip(&*hypotheses) {
            let weight = belief.weight;
            let ln = hypothesis.duration.ln();
            log += weight * ln;
            log_square += weight * ln * ln;
            arrival += weight * (1.0 + hypothesis.start) * hypothesis.duration;
            let own = hypothesis.fraction(last - first);
            fraction += weight * own;
            fraction_square += weight * own * own;
            turn[0] += weight * (TAU * own).cos();
            turn[1] += weight * (TAU * own).sin();
            if weight < MIN_WEIGHT {
                continue;
            }
            for (k, value) in table.parameters(&belief.mean).enumerate() {
                scratch.row.iter_mut().zip(table.directions.row(k)).for_each(|(to, from)| *to = *from);
                let square = value * value + belief.variance(&mut scratch.row);
                estimate.parameters[k] += weight * value;
                estimate.deviations[k] += weight * square;
            }
        }
        estimate.duration = log.exp();
        estimate.arrival = first + arrival;
        let (factors, resolution) = (self.factors(log.exp()), self.log_resolution());
        let estimate = &mut self.estimate;
        for (deviation, mean) in estimate.deviations.iter_mut().zip(&estimate.parameters) {
            *deviation = (*deviation - mean * mean).max(0.0).sqrt();
        }
        // A goal that is reached is one up to the residual.
        let (n_styles, residual) = (self.prior.n_styles(), self.prior.residual());
        for (k, deviation) in estimate.deviations[n_styles..].iter_mut().enumerate() {
            *deviation = factors.goal * deviation.hypot(residual[k % residual.len()]);
        }
        let log_deviation = (log_square - log * log).max(0.0).sqrt();
        estimate.duration_deviation = factors.duration * resolution.hypot(log_deviation);
        estimate.fraction = fraction;
        estimate.fraction_deviation = (fraction_square - fraction * fraction).max(0.0).sqrt();
        if self.prior.kind() == Kind::Rhythmic {
            let length = turn[0].hypot(turn[1]).clamp(f64::MIN_POSITIVE, 1.0);
            estimate.fraction = (turn[1].atan2(turn[0]) / TAU).rem_euclid(1.0);
            estimate.fraction_deviation = (-2.0 * length.ln()).sqrt() / TAU;
        }
        self.estimate.surprise = self.misfit() / factors.misfit;
    }

    /// Returns the standard deviation within a hypothesis of the logarithm of the duration: that of a uniform distribution
    /// over its interval.
    fn log_resolution(&self) -> f64 {
        let next = self.hypotheses.iter().find(|other| other.log > self.hypotheses[0].log);
        next.map_or(0.0, |next| (next.log - self.hypotheses[0].log) / 12f64.sqrt())
    }

    /// Returns the mean squared whitened residual under the most probable hypothesis.
    pub(crate) fn misfit(&self) -> f64 {
        let best = (0..self.beliefs.len()).max_by(|&i, &j| self.beliefs[i].weight.total_cmp(&self.beliefs[j].weight));
        let (best, width) = (best.unwrap_or(0), self.table.width);
        let size = (self.table.n_directions + 1) * width;
        let information = &self.information[best * size..][..size];
        // The row [−x, 1] from both sides, on the lower triangle.
        let row = |i: usize| self.beliefs[best].mean.get(i).map_or(1.0, |x| -x);
        let mut sum = 0.0;
        for (i, sums) in information.chunks_exact(width).enumerate() {
            for (j, entry) in sums[..=i].iter().enumerate() {
                sum += if i == j { 1.0 } else { 2.0 } * row(i) * row(j) * entry;
            }
        }
        sum.max(0.0) / self.n_observed.max(1) as f64
    }
}
