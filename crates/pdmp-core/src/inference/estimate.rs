//! Estimate of the parameters of a movement.

use std::f64::consts::TAU;

use super::movement_table::MAX_DIRECTIONS;
use super::prior::{Prior, frame_size};
use super::recogniser::Recogniser;
use super::rotations::Layout;
use super::triangle::row;
use crate::kind::Kind;
use crate::model::Conditions;
use crate::numerics::simd::{F64x4, WIDTH};

/// Means and standard deviations of the parameters of a movement, given a part of it.
///
/// Standard deviations are scaled so that 90 % of held-out demonstrations lie within 1.645 of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    kind: Kind,
    /// Style (J,), then goal (n_q,) and start (n_q,), or anchor (n_q,).
    pub parameters: Vec<f64>,
    /// Standard deviations of style (J,), then goal (D,) and start (D,), or anchor (D,). Those of a rotation are of the
    /// components of the rotation vector in rad from its mean, in the frame of angular velocities.
    pub deviations: Vec<f64>,
    /// Style dimension J.
    pub n_styles: usize,
    /// Duration or period in seconds, the exponential of its mean logarithm.
    pub duration: f64,
    /// Standard deviation of the logarithm of the duration.
    pub duration_deviation: f64,
    /// Time of arrival of a discrete movement in seconds, on the clock of the observations.
    pub arrival: f64,
    /// Time from the start to the last observation over the estimated duration, more than 1 after the end; of a rhythmic
    /// movement, the fraction of the cycle in [0, 1).
    pub fraction: f64,
    /// Standard deviation of `fraction`.
    pub fraction_deviation: f64,
    /// Probability that the movement is stopped. From 0.9 on, its clock rests until it is below 0.5: fraction and positions
    /// to come are those of a movement that goes on at once, and the arrival is later by the pause.
    pub stopped: f64,
    /// Mean squared residual, relative to the one that a tenth of the demonstrations exceed: above 1, the movement is
    /// unlike the demonstrations.
    pub surprise: f64,
}

impl Estimate {
    pub(crate) fn new(prior: &Prior, layout: &Layout) -> Self {
        let (kind, n_styles) = (prior.kind(), prior.n_styles());
        let zeros = |n: usize| vec![0.0; n_styles + frame_size(kind) * n];
        Self {
            kind,
            parameters: zeros(layout.n_coordinates),
            deviations: zeros(layout.n_dofs),
            n_styles,
            duration: 0.0,
            duration_deviation: 0.0,
            arrival: 0.0,
            fraction: 0.0,
            fraction_deviation: 0.0,
            stopped: 0.0,
            surprise: 0.0,
        }
    }

    /// Returns the style (J,).
    pub fn style(&self) -> &[f64] {
        &self.parameters[..self.n_styles]
    }

    /// Returns the goal (n_q,), or the anchor of a rhythmic movement.
    pub fn goal(&self) -> &[f64] {
        let positions = &self.parameters[self.n_styles..];
        &positions[..positions.len() / frame_size(self.kind)]
    }

    /// Returns the start (n_q,); empty for a rhythmic movement.
    pub fn start(&self) -> &[f64] {
        &self.parameters[self.n_styles + self.goal().len()..]
    }

    /// Returns the standard deviations (D,) of the goal or anchor.
    pub fn goal_deviation(&self) -> &[f64] {
        let positions = &self.deviations[self.n_styles..];
        &positions[..positions.len() / frame_size(self.kind)]
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
                let start = Some(self.start().to_vec());
                Conditions { goal, start, ..conditions }
            }
            Kind::Rhythmic => Conditions { anchor: goal, phase: Some(TAU * self.fraction), ..conditions },
        }
    }
}

impl Recogniser {
    /// Computes the estimate from the weighed hypotheses and the sum of their second moments.
    pub(crate) fn summarise(&mut self) {
        let [_, last] = self.times.unwrap_or_default();
        let clock = self.clock;
        let (mut log, mut log_square, mut arrival) = (0.0, 0.0, 0.0);
        let (mut fraction, mut fraction_square, mut turn) = (0.0, 0.0, [0.0; 2]);
        let Self { beliefs, hypotheses, estimate, table, scratch, layout, parameters, .. } = self;
        let rhythmic = estimate.kind == Kind::Rhythmic;
        let weights = beliefs.iter().flat_map(|belief| belief.weight.to_array());
        for (weight, hypothesis) in weights.zip(&*hypotheses) {
            log += weight * hypothesis.log;
            log_square += weight * hypothesis.log * hypothesis.log;
            arrival += weight * (1.0 + hypothesis.start) * hypothesis.duration;
            let own = hypothesis.fraction(clock);
            fraction += weight * own;
            fraction_square += weight * own * own;
            if rhythmic {
                let (sin, cos) = (TAU * own).sin_cos();
                turn = [turn[0] + weight * cos, turn[1] + weight * sin];
            }
        }
        let (mean, covariance) = scratch.moments(beliefs);
        for (k, directions) in table.directions.rows().into_iter().enumerate() {
            let directions = directions.as_slice().unwrap_or_default();
            parameters[k] = table.mean[k] + dot(directions, mean);
            estimate.deviations[k] = deviation(covariance, directions);
        }
        let (style, positions) = parameters.split_at(estimate.n_styles);
        estimate.parameters[..style.len()].copy_from_slice(style);
        let outside = estimate.parameters[style.len()..].chunks_exact_mut(layout.n_coordinates);
        for (part, (dofs, position)) in positions.chunks_exact(layout.n_dofs).zip(outside).enumerate() {
            let u = layout.clocks()[part];
            layout.write(u, dofs, position);
            for rotation in layout.rotations() {
                let map = layout.tangent(rotation.read(dofs), rotation.columns.read(position));
                let first = style.len() + part * layout.n_dofs + rotation.dof;
                for (i, map) in map.iter().enumerate() {
                    let mut along = [0.0; MAX_DIRECTIONS];
                    let along = &mut along[..mean.len()];
                    for (j, factor) in map.iter().enumerate() {
                        let own = table.directions.row(first + j);
                        along.iter_mut().zip(own).for_each(|(sum, own)| *sum += factor * own);
                    }
                    estimate.deviations[first + i] = deviation(covariance, along);
                }
            }
        }
        // The duration of the first hypothesis gives the mean of the demonstrations.
        let duration = (log - hypotheses[0].log).exp() * hypotheses[0].duration;
        estimate.duration = duration;
        estimate.arrival = last - clock + arrival;
        let (factors, resolution) = (self.factors(duration), self.log_resolution());
        let estimate = &mut self.estimate;
        // A goal that is reached is one up to the residual.
        let (n_styles, residual) = (self.prior.n_styles(), self.prior.residual());
        for (k, deviation) in estimate.deviations[n_styles..].iter_mut().enumerate() {
            *deviation = factors.goal * deviation.hypot(residual[k % residual.len()]);
        }
        let log_deviation = (log_square - log * log).max(0.0).sqrt();
        estimate.duration_deviation = factors.duration * resolution.hypot(log_deviation);
        estimate.fraction = fraction;
        estimate.fraction_deviation = (fraction_square - fraction * fraction).max(0.0).sqrt();
        if rhythmic {
            let length = turn[0].hypot(turn[1]).clamp(f64::MIN_POSITIVE, 1.0);
            estimate.fraction = (turn[1].atan2(turn[0]) / TAU).rem_euclid(1.0);
            estimate.fraction_deviation = (-2.0 * length.ln()).sqrt() / TAU;
        }
        self.estimate.stopped = self.pauses.as_ref().map_or(0.0, |pauses| pauses.probability);
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
        let weight = |h: usize| self.beliefs[h / WIDTH].weight.to_array()[h % WIDTH];
        let best = (0..self.hypotheses.len()).max_by(|&a, &b| weight(a).total_cmp(&weight(b))).unwrap_or(0);
        let (belief, information) = (&self.beliefs[best / WIDTH], &self.sums[best / WIDTH].information);
        let lane = |lanes: &F64x4| lanes.as_array()[best % WIDTH];
        // The row [−x, 1] from both sides, on the lower triangle.
        let entry = |i: usize| belief.mean.get(i).map_or(1.0, |x| -lane(x));
        let mut sum = 0.0;
        for i in 0..=self.table.n_directions {
            for (j, product) in information[row(i)..=row(i) + i].iter().enumerate() {
                sum += if i == j { 1.0 } else { 2.0 } * entry(i) * entry(j) * lane(product);
            }
        }
        sum.max(0.0) / self.n_observed.max(1) as f64
    }
}

/// Returns the standard deviation along a direction (q,), for the lower triangle of a covariance (q, q).
fn deviation(covariance: &[f64], direction: &[f64]) -> f64 {
    let mut square = 0.0;
    for (i, own) in direction.iter().enumerate() {
        let entries = &covariance[row(i)..=row(i) + i];
        square += own * (2.0 * dot(entries, &direction[..i]) + entries[i] * own);
    }
    square.max(0.0).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
