//! Critically damped second-order filters of commands, so that a changed command leaves position and velocity continuous.
//!
//! ```text
//! ẍ = −2ωẋ − ω²(x − target)
//! ```
//!
//! is solved in closed form over a tick. The rate 1/τ is filtered in seconds; style, goal, anchor and amplitude are filtered
//! on the clock u, so that the path does not depend on the rate. Below, time t stands for either. The impulse response is
//! positive, so that a filtered positive command stays positive for any sequence of changes.

use crate::dynamics::output_system::INVERSE_FACTORIAL;
use crate::error::Result;
use crate::numerics::simd::{F64x4, Register, pack, padded, repack};
use crate::numerics::state::{Visitor, clone_in_place, visit_number};

/// ωt at which 99 % of a step are done: the root of (1 + s)exp(−s) = 0.01.
const SETTLING_TIME: f64 = 6.638_352_067_993_813;
/// ωt at which the remainder of a step lies far below rounding.
const DECAY_TIME: f64 = 45.0;
/// Maximum ωt of a substep: a cubic then deviates from the filter by about 1e-9 of the step.
const MAX_SUBSTEP: f64 = 0.07;
/// Maximum number of substeps that a filter requires.
const MAX_SUBSTEPS: f64 = 32.0;
/// Number of terms of the series of an exponential that is exact to the last digit up to [`MAX_SUBSTEP`].
const N_TERMS: usize = 10;
/// Minimum transition, in seconds, that is filtered. A shorter one is immediate, since its ω² may overflow.
const MIN_TRANSITION: f64 = 1e-15;
/// Maximum rate of a restored command; its products with gains stay finite.
const MAX_COMMAND_RATE: f64 = 1e220;
/// Maximum ωt in exponents: exp(−ωt) is zero, and ωt·exp(−ωt) must not become ∞·0.
const MAX_EXPONENT: f64 = 1e4;

/// Gain of the filter, common to all commands that it serves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterGains {
    /// ω; infinite for an immediate switch.
    omega: f64,
    /// Time after which the remainder of a step lies far below rounding.
    decay_time: f64,
}

/// Solution of the filter over a tick, as weights of the displacement d = x − target and of the rate v = ẋ at its start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterStep {
    dt: f64,
    /// Weights of d and v in x − target at the end.
    value: [f64; 2],
    /// Weights of d and v in ẋ at the end.
    rate: [f64; 2],
    /// Weights of d and v in ∫(x − target)dt over the tick.
    integral: [f64; 2],
}

impl FilterGains {
    /// Returns the gain for a time to 99 % of a step, in seconds; 0 is an immediate switch.
    pub(crate) fn new(transition: f64) -> Self {
        let transition = if transition < MIN_TRANSITION { 0.0 } else { transition };
        Self { omega: SETTLING_TIME / transition, decay_time: DECAY_TIME / SETTLING_TIME * transition }
    }

    /// Returns the gain on a clock of rate 1/τ.
    pub(crate) fn on_clock(&self, tau: f64) -> Self {
        Self { omega: self.omega * tau, decay_time: self.decay_time / tau }
    }

    /// Returns whether commands take effect at once.
    pub(crate) fn is_immediate(&self) -> bool {
        self.omega.is_infinite()
    }

    /// Returns the number of substeps, not rounded, in which cubics describe the filtered commands over `dt`.
    ///
    /// The number is bounded: a transition that ends within one of many substeps needs no accurate description.
    pub(crate) fn substeps(&self, dt: f64) -> f64 {
        if self.is_immediate() { 0.0 } else { (self.omega * dt / MAX_SUBSTEP).min(MAX_SUBSTEPS) }
    }

    /// Returns an upper bound of the remaining displacement |x(t) − target| of a group: |x − target| + |ẋ|/ω.
    pub(crate) fn max_displacement(&self, command: &CommandFilter, group: usize) -> F64x4 {
        let CommandFilter { value, rate, target, .. } = command;
        (value[group] - target[group]).abs() + rate[group].abs() * (1.0 / self.omega)
    }

    /// Returns the solution over a time `dt` without its integral, which only the rate needs.
    pub(crate) fn step(&self, dt: f64) -> FilterStep {
        let s = (self.omega * dt).min(MAX_EXPONENT);
        let decay = decay(s);
        FilterStep { dt, value: [(1.0 + s) * decay, dt * decay], rate: self.rate_weights(s, decay), integral: [0.0; 2] }
    }

    /// Returns the solution over a time `dt` with its integral.
    pub(crate) fn step_with_integral(&self, dt: f64) -> FilterStep {
        let omega = self.omega;
        let s = (omega * dt).min(MAX_EXPONENT);
        let decay = (-s).exp();
        // ω∫exp(−ωt)dt and ω∫ωt·exp(−ωt)dt.
        let first = -(-s).exp_m1();
        let second = first - s * decay;
        FilterStep {
            dt,
            value: [(1.0 + s) * decay, dt * decay],
            rate: self.rate_weights(s, decay),
            integral: [(first + second) / omega, second / (omega * omega)],
        }
    }

    /// Returns the weights of displacement and rate in the rate, for s = ωt and exp(−s).
    fn rate_weights(&self, s: f64, decay: f64) -> [f64; 2] {
        // An immediate switch leaves no rate; ∞·0 is none.
        let stiffness = if self.is_immediate() { 0.0 } else { -self.omega * (s * decay) };
        [stiffness, (1.0 - s) * decay]
    }

    /// Returns the solution of q̇ = m(x − q) after a time `dt`, from `q`: the response of the amplitude r of Eq. (4) to the
    /// filtered command x = r₀.
    pub(crate) fn first_order_response(&self, command: &CommandFilter, q: f64, m: f64, dt: f64) -> f64 {
        let [x, v, target] = [&command.value, &command.rate, &command.target].map(|lanes| lanes[0].as_array()[0]);
        let (d, decay) = (x - target, (-m * dt).exp());
        if command.is_settled() {
            return target + (q - target) * decay;
        }
        // q − target = (q₀ − target)e^(−mt) + m∫(d + (v + ωd)s)e^(−ωs)e^(−m(t−s))ds; below, x = (m − ω)t.
        let s = (self.omega * dt).min(MAX_EXPONENT);
        let (x, filtered) = (m * dt - s, (-s).exp());
        let [constant, linear] = if x.abs() > 0.1 {
            [(filtered - decay) / x, (filtered * (x - 1.0) + decay) / (x * x)]
        } else {
            // (e^x − 1)/x and (e^x(x − 1) + 1)/x² by their series: Σ x^k/(k + 1)! and Σ x^k/(k!(k + 2)).
            let (mut power, mut sums) = (1.0, [0.0; 2]);
            for k in 0..12 {
                sums[0] += power / f64::from(k + 1);
                sums[1] += power / f64::from(k + 2);
                power *= x / f64::from(k + 1);
            }
            sums.map(|sum| sum * decay)
        };
        target + (q - target) * decay + m * dt * (d * constant + (v * dt + s * d) * linear)
    }
}

/// Returns exp(−s), by its series over the short ticks of a loop: a call of `exp` would take longer than the rest of the
/// filter.
#[inline(always)]
fn decay(s: f64) -> f64 {
    if s > MAX_SUBSTEP {
        return (-s).exp();
    }
    let mut sum = INVERSE_FACTORIAL[N_TERMS - 1];
    for k in (0..N_TERMS - 1).rev() {
        sum = INVERSE_FACTORIAL[k] - s * sum;
    }
    sum
}

impl FilterStep {
    /// Solution over a tick of length zero.
    pub(crate) const IDENTITY: Self = Self { dt: 0.0, value: [1.0, 0.0], rate: [0.0, 1.0], integral: [0.0; 2] };

    /// Returns the length of the tick.
    pub(crate) fn dt(&self) -> f64 {
        self.dt
    }
}

/// Filtered commands with a common transition, in groups of four, padded with zeros.
#[derive(Debug)]
pub(crate) struct CommandFilter {
    value: Vec<F64x4>,
    rate: Vec<F64x4>,
    target: Vec<F64x4>,
    /// Time until the values are set to their targets.
    remaining: f64,
}

clone_in_place!(CommandFilter { value, rate, target, remaining });

impl CommandFilter {
    /// Returns commands at rest on their targets.
    pub(crate) fn new(target: &[f64]) -> Self {
        let target = pack(target);
        Self { value: target.clone(), rate: vec![F64x4::ZERO; target.len()], target, remaining: 0.0 }
    }

    /// Returns the filtered values x.
    pub(crate) fn value(&self) -> &[F64x4] {
        &self.value
    }

    /// Returns the derivatives ẋ of the filtered values.
    pub(crate) fn rate(&self) -> &[F64x4] {
        &self.rate
    }

    /// Returns the targets.
    pub(crate) fn target(&self) -> &[F64x4] {
        &self.target
    }

    /// Returns whether the values rest on their targets.
    pub(crate) fn is_settled(&self) -> bool {
        self.remaining <= 0.0
    }

    /// Sets the targets and starts a transition.
    pub(crate) fn set_target(&mut self, target: &[f64], gains: &FilterGains) {
        self.move_target(target, 1.0, gains);
    }

    /// Moves the targets by a share of the distance to others and starts a transition.
    pub(crate) fn move_target(&mut self, target: &[f64], share: f64, gains: &FilterGains) {
        self.move_target_only(target, share);
        if gains.is_immediate() {
            self.settle();
        } else {
            self.remaining = gains.decay_time;
        }
    }

    /// Moves the targets by a share of the distance to others and leaves the values, which do not move.
    pub(crate) fn move_target_only(&mut self, target: &[f64], share: f64) {
        if share >= 1.0 {
            return repack(&mut self.target, target);
        }
        for (present, target) in bytemuck::cast_slice_mut::<F64x4, f64>(&mut self.target).iter_mut().zip(target) {
            *present += share * (target - *present);
        }
    }

    /// Sets the value of a group without a transition and leaves its target.
    pub(crate) fn set_value(&mut self, group: usize, value: F64x4) {
        self.value[group] = value;
    }

    /// Sets targets and values.
    pub(crate) fn reset(&mut self, target: &[f64]) {
        repack(&mut self.target, target);
        self.settle();
    }

    /// Sets the values to their targets, at rest.
    fn settle(&mut self) {
        self.value.copy_from_slice(&self.target);
        self.rate.fill(F64x4::ZERO);
        self.remaining = 0.0;
    }

    /// Visits values, targets and rates, for commands from `least` to `limit`.
    pub(crate) fn walk(&mut self, visit: &mut Visitor, gains: &FilterGains, [least, limit]: [f64; 2]) -> Result<()> {
        // Value and rate of a chain of steps between ±limit are bounded by 2·limit and 2ω·limit.
        let rate = if gains.is_immediate() { 0.0 } else { (2.0 * limit * gains.omega).min(MAX_COMMAND_RATE) };
        let Self { value, rate: slope, target, remaining: _ } = self;
        for (lanes, bounds) in [(value, [2.0 * least, 2.0 * limit]), (target, [least, limit]), (slope, [-rate, rate])] {
            visit(bytemuck::cast_slice_mut::<F64x4, f64>(lanes), bounds)?;
        }
        visit_number(visit, &mut self.remaining, [-1e300, gains.decay_time.max(f64::MIN_POSITIVE)])
    }

    /// Advances all groups by a tick.
    #[inline(always)]
    pub(crate) fn advance<T: Register>(&mut self, step: &FilterStep) {
        if self.begin_step(step) {
            for group in 0..self.value.len() {
                self.advance_group::<T>(group, step);
            }
        }
    }

    /// Subtracts a tick from the remaining time. Returns whether each group must now be advanced.
    pub(crate) fn begin_step(&mut self, step: &FilterStep) -> bool {
        let moving = !self.is_settled();
        if moving {
            self.remaining -= step.dt;
        }
        moving
    }

    /// Advances one group by a tick. Returns its value and rate.
    #[inline(always)]
    pub(crate) fn advance_group<T: Register>(&mut self, group: usize, step: &FilterStep) -> [T; 2] {
        let settled = self.is_settled();
        let (value, rate, target) = (&mut self.value[group], &mut self.rate[group], T::load(&self.target[group]));
        let [x, v] = if settled {
            [target, T::default()]
        } else {
            let (d, v) = (T::load(value) - target, T::load(rate));
            [target + (d * step.value[0] + v * step.value[1]), d * step.rate[0] + v * step.rate[1]]
        };
        (*value, *rate) = (x.store(), v.store());
        [x, v]
    }

    /// Returns the first value and its rate after a tick.
    pub(crate) fn preview(&self, step: &FilterStep) -> [f64; 2] {
        let [x, v, target] = [&self.value, &self.rate, &self.target].map(|lanes| lanes[0].as_array()[0]);
        let d = x - target;
        [target + (d * step.value[0] + v * step.value[1]), d * step.rate[0] + v * step.rate[1]]
    }

    /// Sets the first value, at rest, and starts a transition to its target.
    pub(crate) fn start(&mut self, value: f64, gains: &FilterGains) {
        self.value[0] = padded(&[value]);
        self.remaining = gains.decay_time.max(f64::MIN_POSITIVE);
    }

    /// Advances the first value, which is not negative, by `dt` at a constant rate. The filter continues from there, at a rate
    /// from which it passes neither zero nor the target.
    pub(crate) fn move_on(&mut self, rate: f64, dt: f64, gains: &FilterGains) {
        let value = (self.value[0].as_array()[0] + rate * dt).max(0.0);
        let rest = (self.target[0].as_array()[0] - value).max(0.0);
        let omega = if gains.is_immediate() { 0.0 } else { gains.omega };
        (self.value[0], self.rate[0]) = (padded(&[value]), padded(&[rate.max(-omega * value).min(omega * rest)]));
        self.remaining = gains.decay_time.max(f64::MIN_POSITIVE);
    }

    /// Returns ∫x dt of the first value over a tick.
    pub(crate) fn integral(&self, step: &FilterStep) -> f64 {
        let [x, v, target] = [&self.value, &self.rate, &self.target].map(|lanes| lanes[0].as_array()[0]);
        target * step.dt + ((x - target) * step.integral[0] + v * step.integral[1])
    }

    /// Returns the time in [0, dt] at which the integral of the first value, which is positive, reaches `area`.
    pub(crate) fn integral_time(&self, area: f64, dt: f64, gains: &FilterGains) -> f64 {
        if self.is_settled() {
            return (area / self.value[0].as_array()[0]).min(dt);
        }
        let (mut low, mut high) = (0.0, dt);
        // The integral is increasing. Fifty bisections exhaust the digits of a double.
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.integral(&gains.step_with_integral(middle)) < area { low = middle } else { high = middle }
        }
        high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn first_element(lanes: &[F64x4]) -> f64 {
        lanes[0].as_array()[0]
    }

    /// Returns a command that steps from 2 to 5 with a transition of 0.3 s.
    fn stepped() -> (CommandFilter, FilterGains) {
        let (mut command, gains) = (CommandFilter::new(&[2.0]), FilterGains::new(0.3));
        command.set_target(&[5.0], &gains);
        (command, gains)
    }

    /// 99 % of a step are done after the transition time, for any number of ticks.
    #[test]
    fn transition_is_the_time_to_99_percent() {
        for ticks in [1, 7, 1000] {
            let (mut command, gains) = stepped();
            (0..ticks).for_each(|_| command.advance::<F64x4>(&gains.step_with_integral(0.3 / f64::from(ticks))));
            assert_relative_eq!(first_element(command.value()), 2.0 + 0.99 * 3.0, epsilon = 1e-12);
        }
    }

    /// The closed form agrees with RK4 on ẍ = −2ωẋ − ω²(x − target).
    #[test]
    fn values_solve_the_filter_equation() {
        let (mut command, gains) = stepped();
        let f = |_, [x, v]: [f64; 2]| [v, -2.0 * gains.omega * v - gains.omega.powi(2) * (x - 5.0)];
        let [x, v] = (0..1000).fold([2.0, 0.0], |state, _| rk4(f, 0.0, state, 0.2 / 1000.0));
        command.advance::<F64x4>(&gains.step_with_integral(0.2));
        assert_relative_eq!(first_element(command.value()), x, max_relative = 1e-9);
        assert_relative_eq!(first_element(command.rate()), v, max_relative = 1e-8);
    }

    /// The integral agrees with Simpson's rule, and its inverse returns the time.
    #[test]
    fn integral_agrees_with_simpsons_rule() {
        let (mut command, gains) = stepped();
        command.advance::<F64x4>(&gains.step_with_integral(0.02));
        let at = |t: f64| {
            let mut command = command.clone();
            command.advance::<F64x4>(&gains.step_with_integral(t));
            first_element(command.value())
        };
        let n = 1000;
        let h = 0.1 / f64::from(n);
        let simpson: f64 =
            (0..n).map(|k| f64::from(k) * h).map(|t| h / 6.0 * (at(t) + 4.0 * at(t + h / 2.0) + at(t + h))).sum();
        assert_relative_eq!(command.integral(&gains.step_with_integral(0.1)), simpson, max_relative = 1e-11);
        assert_relative_eq!(command.integral_time(simpson, 1.0, &gains), 0.1, max_relative = 1e-9);
    }

    /// The first-order response agrees with RK4 for rates m below, near and above ω.
    #[test]
    fn first_order_response_solves_its_equation() {
        let (start, gains) = stepped();
        for m in [0.3, gains.omega * (1.0 - 1e-9), gains.omega * 1.01, 500.0] {
            let n = 2000;
            let h = 0.1 / f64::from(n);
            let x = |t: f64| {
                let mut command = start.clone();
                command.advance::<F64x4>(&gains.step(t));
                first_element(command.value())
            };
            let f = |t: f64, [q]: [f64; 1]| [m * (x(t) - q)];
            let [q] = (0..n).fold([1.0], |q, k| rk4(f, f64::from(k) * h, q, h));
            assert_relative_eq!(gains.first_order_response(&start, 1.0, m, 0.1), q, max_relative = 1e-9);
        }
    }

    /// The series and the call agree on both sides of the switch between them.
    #[test]
    fn decay_is_the_exponential() {
        for k in 0..=2000 {
            let s = 1e-3 * MAX_SUBSTEP * f64::from(k);
            assert_relative_eq!(decay(s), (-s).exp(), max_relative = 4.0 * f64::EPSILON);
        }
    }

    proptest! {
        /// A positive command stays positive for any sequence of changes.
        #[test]
        fn positive_commands_stay_positive(steps in prop::collection::vec((1e-3..1e3f64, 1e-4..1.0f64), 1..30)) {
            let (mut command, gains) = stepped();
            for (target, dt) in steps {
                command.set_target(&[target], &gains);
                let step = gains.step_with_integral(dt);
                let area = command.integral(&step);
                command.advance::<F64x4>(&step);
                prop_assert!(first_element(command.value()) > 0.0 && area > 0.0);
            }
        }
    }
}
