//! Knots of the path ahead, and its samples there.

use super::Controller;
use super::path_ahead::N_INTERVALS;
use super::step::first_element;
use crate::dynamics::canonical::Canonical;
use crate::motion::sampled_path::{SampledPath, TurnDerivatives};
use crate::numerics::rotation::Turning;
use crate::numerics::simd::unpack;

/// Number of intervals of a whole movement or period; past the end of a discrete movement are the others.
const N_MOVEMENT: usize = 512;
/// Clock between the knots on both sides of the end, where y″ is not continuous, relative to the clock until then.
const KINK: f64 = 1e-6;
/// Clock past the end of a discrete movement, relative to its extent.
const TAIL: f64 = 0.3;
/// Number of periods of a rhythmic movement. The rate at the last knot is that of the slowest part; a period later it has no
/// effect.
const N_PERIODS: f64 = N_INTERVALS as f64 / N_MOVEMENT as f64;
/// Rate up to which the curve is computed, relative to the largest that is needed: the line from there to a slower knot leaves the
/// latter free.
const RESERVE: f64 = 1.5;
/// Relative difference of intervals that is rounding.
const SAME_INTERVAL: f64 = 1e-12;
/// Maximum ωh of a substep of the path during a transition of commands; the path then deviates by 1e-5 of the change.
const MAX_TRANSITION_STEP: f64 = 14.0;

/// Equidistant knots of a piece of the path.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Piece {
    pub(super) first: usize,
    /// Clock of the first knot.
    pub(super) start: f64,
    pub(super) interval: f64,
}

impl Piece {
    /// Piece without knots.
    const NONE: Self = Self { first: N_INTERVALS + 1, start: f64::INFINITY, interval: 0.0 };
}

impl Controller {
    /// Returns the pieces of the path ahead: up to the end of a discrete movement and past it.
    pub(super) fn pieces(&self) -> [Piece; 2] {
        let extent = self.primitive.canonical().extent();
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else {
            let interval = N_PERIODS * extent / N_INTERVALS as f64;
            return [Piece { first: 0, start: 0.0, interval }, Piece::NONE];
        };
        let (rest, end) = (u_end - self.clock.value(), self.goal_transition.end() - self.clock.value());
        let end = if self.goal_transition.is_active() { end } else { 0.0 };
        let tail = end.max(rest).max(0.0) - rest.max(0.0) + TAIL * extent;
        if rest <= KINK * extent {
            let interval = tail / N_INTERVALS as f64;
            return [Piece { first: 0, start: 0.0, interval }, Piece::NONE];
        }
        let n = (rest / extent * N_MOVEMENT as f64).ceil().clamp(1.0, N_MOVEMENT as f64) as usize;
        let n_tail = N_INTERVALS - n - 1;
        [
            Piece { first: 0, start: 0.0, interval: rest * (1.0 - KINK) / n as f64 },
            Piece { first: n + 1, start: rest, interval: tail / n_tail as f64 },
        ]
    }

    /// Samples y, y′ and y″ under the present commands at the knots of a path, which begins at the present clock.
    pub(crate) fn sample_path(&mut self, path: &mut SampledPath) {
        self.release();
        // At the rate 1 the derivatives with respect to the clock are those with respect to time.
        self.rate.reset(&[1.0]);
        self.read_out();
        let (mut u, mut h) = (path.clock[0], 0.0);
        for index in 0..path.clock.len() {
            let knot = path.clock[index];
            // An interval that is equal up to rounding has the same propagator.
            if (knot - u - h).abs() > SAME_INTERVAL * h {
                h = knot - u;
            }
            if knot > u {
                self.follow_path(h);
            }
            let samples = path.knot_mut(index);
            let n = samples.len();
            let (position, velocity, acceleration) =
                (&self.position[..n], &self.velocity[..n], &self.acceleration[..n]);
            for (group, sample) in samples.iter_mut().enumerate() {
                *sample = [position[group], velocity[group], acceleration[group]];
            }
            self.sample_turns(path.turns_mut(index));
            u = knot;
        }
    }

    /// Samples the rotations of a path at the present clock, at the rate 1.
    fn sample_turns(&self, samples: &mut [TurnDerivatives]) {
        if samples.is_empty() {
            return;
        }
        let Some(coordinates) = self.primitive.coordinates() else { return };
        let (n_dofs, rates) = (self.primitive.n_dofs(), [self.perturbation.phase_rate(), 0.0]);
        let dofs = [&*self.position, &self.velocity, &self.acceleration].map(|lanes| unpack(lanes, n_dofs));
        for (rotation, sample) in coordinates.rotations().iter().zip(samples) {
            let Turning { velocity, acceleration, .. } = rotation.motion(self.clock.value(), rates, dofs);
            *sample = TurnDerivatives { slope: velocity, bend: acceleration };
        }
    }

    /// Advances by `h` on the clock at the rate 1.
    fn follow_path(&mut self, h: f64) {
        let mut n_substeps = h / self.max_clock_step;
        if !self.are_commands_settled() {
            n_substeps = n_substeps.max(self.command_gains.substeps(h) / MAX_TRANSITION_STEP);
        }
        let n_substeps = if n_substeps > 1.0 { n_substeps.ceil() } else { 1.0 };
        for _ in 0..n_substeps as u32 {
            self.substep(h / n_substeps, h / n_substeps);
            if self.approaching && !self.style.is_settled() {
                self.correct_arrival();
            }
        }
    }

    /// Returns the largest rate on the way to any command up to it, at least the present one.
    pub(super) fn max_rate(&self) -> f64 {
        let rest = self.rate_gains.max_displacement(&self.rate, 0).as_array()[0];
        (first_element(self.rate.target()) + rest) * RESERVE
    }
}
