//! Minimum-jerk transition of the moving frame to a commanded goal and final velocity.
//!
//! A goal commanded during a movement, and a final velocity, displace the frame (`transport`) by
//!
//! ```text
//! q(u) = Σₖ aₖ sᵏ,     s = (u − u₀)/(u₁ − u₀),     k = 0 … 5,
//! ```
//!
//! the trajectory of least ∫‖q‴‖²du between given values and first two derivatives at u₀ and u₁ (Flash and Hogan, Journal of
//! Neuroscience 5, 1985, doi:10.1523/JNEUROSCI.05-07-01688.1985). It begins with the present value and derivatives, so that
//! position, velocity and acceleration stay continuous for any sequence of commands, and ends with q″ = 0. For a displacement
//! Δ from rest to rest its peak velocity is 15/8·Δ/(u₁ − u₀) and its peak acceleration 10/√3·Δ/(u₁ − u₀)².

use crate::dynamics::output_system::{Attractor, CubicSample};
use crate::error::Result;
use crate::numerics::simd::{F64x4, Real, Register};
use crate::numerics::state::{Visitor, clone_in_place, visit_flag, visit_number};

/// Peak velocity of a transition from rest to rest, in units of the displacement over the duration.
const PEAK_VELOCITY: f64 = 15.0 / 8.0;
/// Peak acceleration of a transition from rest to rest, in units of the displacement over the squared duration: 10/√3.
const PEAK_ACCELERATION: f64 = 5.773_502_691_896_258;
/// Minimum duration of a restored transition. The square of its inverse, times bounded coefficients, is finite.
const MIN_DURATION: f64 = 1e-30;

/// Displacement of the frame with its first and second derivative with respect to the clock.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FrameSample<T = F64x4> {
    pub(crate) value: T,
    pub(crate) slope: T,
    pub(crate) bend: T,
}

/// Transition of the frame, by groups of DoFs.
#[derive(Debug)]
pub(crate) struct GoalTransition {
    active: bool,
    /// u₀.
    from: f64,
    /// u₁.
    to: f64,
    /// aₖ.
    coefficients: Vec<[F64x4; 6]>,
    /// q at the clock.
    pub(crate) value: Vec<F64x4>,
    ends: Vec<TransitionEnd>,
}

/// End of a transition of a group.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TransitionEnd {
    pub(crate) goal: F64x4,
    /// q(u₁) and q′(u₁).
    pub(crate) value: F64x4,
    pub(crate) slope: F64x4,
}

clone_in_place!(GoalTransition { active, from, to, coefficients, value, ends });

impl GoalTransition {
    /// Returns no transition of `n_groups` groups.
    pub(crate) fn inactive(n_groups: usize) -> Self {
        let zeros = vec![F64x4::ZERO; n_groups];
        let coefficients = vec![[F64x4::ZERO; 6]; n_groups];
        let ends = vec![TransitionEnd::default(); n_groups];
        Self { active: false, from: 0.0, to: 0.0, coefficients, value: zeros, ends }
    }

    /// Returns whether a transition is in progress.
    #[inline(always)]
    pub(crate) fn is_active(&self) -> bool {
        self.active
    }

    /// Returns the clock u₁ at the end of the last transition.
    pub(crate) fn end(&self) -> f64 {
        self.to
    }

    /// Returns the goal at u₁ of a group.
    pub(crate) fn goal(&self, group: usize) -> F64x4 {
        self.ends[group].goal
    }

    /// Returns an upper bound of |q − q(u₁)| of a group from clock `u` on.
    ///
    /// With the rest r = u₁ − u the transition is q(u₁) − (q(u₁) − q)·B₀ + q′r·B₁ + q″r²·B₂ from a state with q′(u₁) = 0, where
    /// the Hermite polynomials B of degree 5 are at most 1, 0.2 and 0.02.
    pub(crate) fn max_deviation(&self, group: usize, u: f64) -> F64x4 {
        if !self.active {
            return F64x4::ZERO;
        }
        let FrameSample { value, slope, bend } = self.sample::<F64x4>(group, u);
        let rest = (self.to - u).max(0.0);
        (value - self.ends[group].value).abs() + slope.abs() * (0.2 * rest) + bend.abs() * (0.02 * rest * rest)
    }

    /// Returns whether a transition is in progress that ends at or before clock `u`.
    #[inline(always)]
    pub(crate) fn has_reached_end(&self, u: f64) -> bool {
        self.active && u >= self.to
    }

    /// Visits the state, with the bounds of a clock and of a quantity in units of a DoF.
    pub(crate) fn walk(&mut self, visit: &mut Visitor, clock: [f64; 2], quantity: [f64; 2]) -> Result<()> {
        let Self { active, from, to, coefficients, value, ends } = self;
        visit_flag(visit, active)?;
        visit_number(visit, from, clock)?;
        let after = if *active { from.next_up().max(*from + MIN_DURATION) } else { clock[0] };
        // A transition may begin at the largest clock.
        visit_number(visit, to, [after, 2.0 * clock[1]])?;
        visit(bytemuck::cast_slice_mut::<[F64x4; 6], f64>(coefficients), quantity)?;
        visit(bytemuck::cast_slice_mut::<F64x4, f64>(value), quantity)?;
        ends.iter_mut().try_for_each(|TransitionEnd { goal, value, slope }| {
            [goal, value, slope].into_iter().try_for_each(|lanes| visit(lanes.as_mut_array(), quantity))
        })
    }

    /// Ends the transition: the displacement becomes zero.
    pub(crate) fn clear(&mut self) {
        self.active = false;
        self.value.fill(F64x4::ZERO);
    }

    /// Starts a transition from clock `from` to clock `to`. `end` returns the end of a group, given its index, its present
    /// displacement q(from), and the end that was planned before.
    pub(crate) fn start(&mut self, from: f64, to: f64, end: impl Fn(usize, F64x4, TransitionEnd) -> TransitionEnd) {
        let duration = to - from;
        for group in 0..self.coefficients.len() {
            let FrameSample { value, slope, bend } = self.sample(group, from);
            let end = end(group, value, self.ends[group]);
            let (rate, half_bend) = (slope * duration, bend * (0.5 * duration * duration));
            let rest = end.value - value - rate - half_bend;
            let rest_slope = end.slope * duration - rate - half_bend * 2.0;
            // The second derivative at the end is zero.
            let rest_bend = -half_bend;
            self.coefficients[group] = [
                value,
                rate,
                half_bend,
                rest * 10.0 - rest_slope * 4.0 + rest_bend,
                rest * -15.0 + rest_slope * 7.0 - rest_bend * 2.0,
                rest * 6.0 - rest_slope * 3.0 + rest_bend,
            ];
            (self.value[group], self.ends[group]) = (value, end);
        }
        (self.active, self.from, self.to) = (true, from, to);
    }

    /// Returns the displacement of a group at clock `u`.
    #[inline(always)]
    pub(crate) fn sample<T: Register>(&self, group: usize, u: f64) -> FrameSample<T> {
        if !self.active {
            return FrameSample::default();
        }
        let scale = 1.0 / (self.to - self.from);
        let s = ((u - self.from) * scale).clamp(0.0, 1.0);
        let [a, b, c, d, e, f] = &self.coefficients[group];
        let [a, b, c, d, e, f] = T::load_all([a, b, c, d, e, f]);
        let value = a + (b + (c + (d + (e + f * s) * s) * s) * s) * s;
        let slope = b + (c * 2.0 + (d * 3.0 + (e * 4.0 + f * (5.0 * s)) * s) * s) * s;
        let bend = c * 2.0 + (d * 6.0 + (e * 12.0 + f * (20.0 * s)) * s) * s;
        FrameSample { value, slope: slope * scale, bend: bend * (scale * scale) }
    }

    /// Returns q‴ of a group at clock `u` before the end of the transition.
    pub(crate) fn third(&self, group: usize, u: f64) -> F64x4 {
        let scale = 1.0 / (self.to - self.from);
        let s = (u - self.from) * scale;
        let [_, _, _, d, e, f] = self.coefficients[group];
        (d * 6.0 + (e * 24.0 + f * (60.0 * s)) * s) * (scale * scale * scale)
    }
}

impl<T: Real> FrameSample<T> {
    /// Returns the motion q′ and q″ of the frame for a phase of the given rate on the clock of the output system.
    #[inline(always)]
    pub(crate) fn motion(&self, phase_rate: f64) -> CubicSample<T> {
        CubicSample { value: self.slope * phase_rate, slope: self.bend * (phase_rate * phase_rate) }
    }
}

/// Shortest transitions whose velocity and acceleration do not exceed those of the paper's equations, on the clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MinDurations {
    /// Bound by the peak velocity.
    pub(crate) by_velocity: f64,
    /// Bound by the peak acceleration.
    pub(crate) by_acceleration: f64,
}

impl MinDurations {
    /// Returns the bounds for the gains of the output system and the transition of its commands on the clock.
    ///
    /// After a step of the goal the paper's output system has the peak velocity [`Attractor::step_peak`] and the peak
    /// acceleration ω² = α_zβ_z. A filtered step has smaller peaks, for which the transition and 1.5 times the transition
    /// compensate, for any ratio of the two times.
    pub(crate) fn new(attractor: Attractor, transition: f64) -> Self {
        let omega = (attractor.alpha_z * attractor.beta_z).sqrt();
        Self {
            by_velocity: transition + PEAK_VELOCITY / attractor.step_peak(),
            by_acceleration: 1.5 * transition + PEAK_ACCELERATION.sqrt() / omega,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn first(sample: FrameSample) -> [f64; 3] {
        [sample.value, sample.slope, sample.bend].map(|lanes| lanes.as_array()[0])
    }

    fn end(values: [f64; 3]) -> TransitionEnd {
        let [goal, value, slope] = values.map(F64x4::splat);
        TransitionEnd { goal, value, slope }
    }

    /// From rest to rest the transition is the minimum-jerk profile 10s³ − 15s⁴ + 6s⁵.
    #[test]
    fn rest_to_rest_is_minimum_jerk() {
        let mut transition = GoalTransition::inactive(1);
        transition.start(0.2, 0.7, |_, _, _| end([2.0, 2.0, 0.0]));
        for k in 0..=10 {
            let s = f64::from(k) / 10.0;
            let [value, ..] = first(transition.sample(0, 0.2 + 0.5 * s));
            assert_relative_eq!(value, 2.0 * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s), epsilon = 1e-14);
        }
        let grid = |k: i32| first(transition.sample(0, 0.2 + 0.5 * f64::from(k) / 1e4));
        let peak = |i: usize| (0..=10_000).map(|k| grid(k)[i].abs()).fold(0.0, f64::max);
        assert_relative_eq!(peak(1), PEAK_VELOCITY * 2.0 / 0.5, max_relative = 1e-6);
        assert_relative_eq!(peak(2), PEAK_ACCELERATION * 2.0 / 0.25, max_relative = 1e-6);
    }

    proptest! {
        /// Each transition continues from the last one and arrives at its ends.
        #[test]
        fn transitions_join_smoothly(
            commands in prop::collection::vec((0.05..2.0f64, 0.1..0.9f64, -5.0..5.0f64, -5.0..5.0f64), 1..8),
        ) {
            let mut transition = GoalTransition::inactive(1);
            let mut u = 0.0;
            for (duration, share, value, slope) in commands {
                let before = first(transition.sample(0, u));
                transition.start(u, u + duration, |_, _, _| end([value, value, slope]));
                let after = first(transition.sample(0, u));
                let arrival = first(transition.sample(0, u + duration));
                for (found, expected) in after.into_iter().zip(before).chain(arrival.into_iter().zip([value, slope, 0.0])) {
                    prop_assert!((found - expected).abs() <= 1e-9 * (1.0 + before[2].abs()) / (duration * duration));
                }
                u += share * duration;
            }
        }

        /// The bounds hold against an integration of the filtered step of the paper's equations.
        #[test]
        fn peaks_do_not_exceed_those_of_the_output_system(
            alpha_z in 1.0..60.0f64, ratio in 0.05..1.0f64, filter in prop_oneof![Just(0.0), 0.1..30.0f64],
        ) {
            let attractor = Attractor { alpha_z, beta_z: alpha_z * ratio };
            let omega = (alpha_z * attractor.beta_z).sqrt();
            let MinDurations { by_velocity, by_acceleration } = MinDurations::new(attractor, filter / omega);
            // ωt at which 99 % of a filtered step are done.
            let rate = if filter > 0.0 { 6.638_352 * omega / filter } else { 0.0 };
            let slopes = |_, [x, v, e, z]: [f64; 4]| {
                [v, -2.0 * rate * v - rate * rate * (x - 1.0), z, alpha_z * (attractor.beta_z * (x - e) - z)]
            };
            let h = 0.02 / rate.max(omega);
            let mut state = [if filter > 0.0 { 0.0 } else { 1.0 }, 0.0, 0.0, 0.0];
            let [mut peak_velocity, mut peak_acceleration] = [0.0f64; 2];
            for _ in 0..((8.0 + filter) / (omega * h)) as usize {
                let [_, _, velocity, acceleration] = slopes(0.0, state);
                peak_velocity = peak_velocity.max(velocity.abs());
                peak_acceleration = peak_acceleration.max(acceleration.abs());
                state = rk4(slopes, 0.0, state, h);
            }
            prop_assert!(PEAK_VELOCITY / by_velocity <= 1.001 * peak_velocity);
            prop_assert!(PEAK_ACCELERATION / (by_acceleration * by_acceleration) <= 1.001 * peak_acceleration);
        }
    }
}
