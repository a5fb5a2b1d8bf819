//! Critically damped second-order filters: how commands change without a jump in position or velocity.
//!
//! The rate 1/τ passes its filter in seconds. Style, goal, anchor and amplitude pass theirs on the clock u, so that the path
//! does not depend on how fast it is followed. `time` stands for either.
//!
//! ẍ = −2ωẋ − ω²(x − target), solved in closed form over a tick. Its impulse response is positive, so that a filtered
//! positive command stays positive, whatever the order and time of its changes.

use crate::dynamics::output_system::INVERSE_FACTORIAL;
use crate::numerics::simd::{F64x4, Register, pack, repack};

/// Time to 99 % of a step, times ω: the root of (1 + s)exp(−s) = 0.01.
const SETTLING: f64 = 6.638_352_067_993_813;
/// A part of a transition, times ω, within which a cubic is off by some 1e-9 of the step.
const MAX_CLOCK_STEP: f64 = 0.07;
/// Most parts of a tick for a transition's sake.
const MAX_PARTS: f64 = 32.0;
/// Terms of an exponential of such a part that reach its last digit.
const TERMS: usize = 10;
/// Shortest transition, in seconds, that is filtered: a shorter one, whose ω² leaves the range of numbers, is immediate.
const MIN_TRANSITION: f64 = 1e-15;
/// After so long, times ω, what is left of a step lies far below rounding.
const FORGOTTEN: f64 = 45.0;

/// The filter: its constant, common to all commands of a movement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterGains {
    /// ω; infinite for an immediate switch.
    omega: f64,
    /// Time until what is left of a step lies far below rounding.
    forgets: f64,
}

/// The filter's solution over a tick: what displacement d = x − target and rate v at its start become and add.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilterStep {
    dt: f64,
    /// x − target at the end, of d and v.
    value: [f64; 2],
    /// ẋ at the end, of d and v.
    rate: [f64; 2],
    /// ∫(x − target) over the tick, of d and v.
    integral: [f64; 2],
}

impl FilterGains {
    /// `transition` is the time to 99 % in seconds, 0 for an immediate switch.
    pub(crate) fn new(transition: f64) -> Self {
        let transition = if transition < MIN_TRANSITION { 0.0 } else { transition };
        Self { omega: SETTLING / transition, forgets: FORGOTTEN / SETTLING * transition }
    }

    /// The same on a clock that runs at the rate 1/τ.
    pub(crate) fn on_clock(&self, tau: f64) -> Self {
        Self { omega: self.omega * tau, forgets: self.forgets / tau }
    }

    /// The same with a longer transition, if it is longer.
    pub(crate) fn lasting(&self, transition: f64) -> Self {
        let longer = Self::new(transition.max(0.0));
        if longer.omega < self.omega { longer } else { *self }
    }

    /// Whether commands are switched to at once.
    pub(crate) fn immediate(&self) -> bool {
        self.omega.is_infinite()
    }

    /// Parts in which a stretch `dt` of a transition is well described by cubics; what is over within one of many need
    /// not be.
    pub(crate) fn parts(&self, dt: f64) -> f64 {
        (self.omega * dt / MAX_CLOCK_STEP).min(MAX_PARTS)
    }

    /// How far a group may still go, at most.
    pub(crate) fn left(&self, follower: &CommandFilter, group: usize) -> F64x4 {
        let CommandFilter { value, rate, target, .. } = follower;
        (value[group] - target[group]).abs() + rate[group].abs() * (1.0 / self.omega)
    }

    /// The solution over a time `dt` without its integral, which only the rate needs.
    pub(crate) fn pass(&self, dt: f64) -> FilterStep {
        let s = (self.omega * dt).min(1e4);
        let decay = decay(s);
        let (value, rate) = ([(1.0 + s) * decay, dt * decay], [-self.omega * (s * decay), (1.0 - s) * decay]);
        FilterStep { dt, value, rate, integral: [0.0; 2] }
    }

    /// What follows a filtered command x by q̇ = m(x − q), after a time `dt`: the amplitude r of Eq. (4), or a target of
    /// its own that is at rest where the filter is immediate.
    pub(crate) fn lag(&self, follower: &CommandFilter, q: f64, m: f64, dt: f64) -> f64 {
        let [x, v, target] = [&follower.value, &follower.rate, &follower.target].map(|lanes| lanes[0].as_array()[0]);
        let (d, decay) = (x - target, (-m * dt).exp());
        if follower.settled() {
            return target + (q - target) * decay;
        }
        // q − target = (q₀ − target)e^(−mt) + m∫(d + (v + ωd)s)e^(−ωs)e^(−m(t−s))ds, with x = (m − ω)t. A
        // filter is over after a few of its own times.
        let s = (self.omega * dt).min(1e4);
        let (x, filtered) = (m * dt - s, (-s).exp());
        let [even, linear] = if x.abs() > 0.1 {
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
        target + (q - target) * decay + m * dt * (d * even + (v * dt + s * d) * linear)
    }

    /// The solution over a time `dt`.
    pub(crate) fn glide(&self, dt: f64) -> FilterStep {
        let omega = self.omega;
        // A step that is over is over, however long since.
        let s = (omega * dt).min(1e4);
        let decay = (-s).exp();
        // ∫exp(−ωt) and ∫ωt·exp(−ωt), times ω.
        let first = -(-s).exp_m1();
        let second = first - s * decay;
        FilterStep {
            dt,
            value: [(1.0 + s) * decay, dt * decay],
            rate: [-omega * (s * decay), (1.0 - s) * decay],
            integral: [(first + second) / omega, second / (omega * omega)],
        }
    }
}

/// exp(−s), by its series over the short times of a loop: a call would take longer than all else that a filter does.
#[inline(always)]
fn decay(s: f64) -> f64 {
    if s > MAX_CLOCK_STEP {
        return (-s).exp();
    }
    let mut sum = INVERSE_FACTORIAL[TERMS - 1];
    for k in (0..TERMS - 1).rev() {
        sum = INVERSE_FACTORIAL[k] - s * sum;
    }
    sum
}

impl FilterStep {
    /// Over no time: what is there stays.
    pub(crate) const START: Self = Self { dt: 0.0, value: [1.0, 0.0], rate: [0.0, 1.0], integral: [0.0; 2] };

    /// Length of the tick.
    pub(crate) fn dt(&self) -> f64 {
        self.dt
    }
}

/// Commands that set out together, in groups of four, padded with zeros.
#[derive(Clone, Debug)]
pub(crate) struct CommandFilter {
    value: Vec<F64x4>,
    rate: Vec<F64x4>,
    target: Vec<F64x4>,
    /// Time until the values are their targets.
    remaining: f64,
}

impl CommandFilter {
    /// At rest on its targets.
    pub(crate) fn new(target: &[f64]) -> Self {
        let target = pack(target);
        Self { value: target.clone(), rate: vec![F64x4::ZERO; target.len()], target, remaining: 0.0 }
    }

    /// Values now.
    pub(crate) fn value(&self) -> &[F64x4] {
        &self.value
    }

    /// Their derivatives with respect to time.
    pub(crate) fn rate(&self) -> &[F64x4] {
        &self.rate
    }

    /// Where they go.
    pub(crate) fn target(&self) -> &[F64x4] {
        &self.target
    }

    /// Whether the values have come to rest on their targets.
    pub(crate) fn settled(&self) -> bool {
        self.remaining <= 0.0
    }

    /// Sets out for as many targets.
    pub(crate) fn follow(&mut self, target: &[f64], filter: &FilterGains) {
        if filter.immediate() {
            return self.jump(target);
        }
        repack(&mut self.target, target);
        self.remaining = filter.forgets;
    }

    /// Jumps to as many targets.
    pub(crate) fn jump(&mut self, target: &[f64]) {
        repack(&mut self.target, target);
        self.settle();
    }

    fn settle(&mut self) {
        self.value.copy_from_slice(&self.target);
        self.rate.fill(F64x4::ZERO);
        self.remaining = 0.0;
    }

    /// Moves on by a tick.
    #[inline(always)]
    pub(crate) fn advance<T: Register>(&mut self, glide: &FilterStep) {
        if self.elapse(glide) {
            for group in 0..self.value.len() {
                self.advance_group::<T>(group, glide);
            }
        }
    }

    /// Takes a tick off the time to come, and tells whether each group is now to be moved on.
    pub(crate) fn elapse(&mut self, glide: &FilterStep) -> bool {
        let moving = !self.settled();
        if moving {
            self.remaining -= glide.dt;
        }
        moving
    }

    /// Moves one group on by a tick, and returns its value and rate.
    #[inline(always)]
    pub(crate) fn advance_group<T: Register>(&mut self, group: usize, glide: &FilterStep) -> [T; 2] {
        let settled = self.settled();
        let (value, rate, target) = (&mut self.value[group], &mut self.rate[group], T::load(&self.target[group]));
        let [x, v] = if settled {
            [target, T::default()]
        } else {
            let (d, v) = (T::load(value) - target, T::load(rate));
            [target + (d * glide.value[0] + v * glide.value[1]), d * glide.rate[0] + v * glide.rate[1]]
        };
        (*value, *rate) = (x.store(), v.store());
        [x, v]
    }

    /// ∫ of the first value over a tick.
    pub(crate) fn integral(&self, glide: &FilterStep) -> f64 {
        let [x, v, target] = [&self.value, &self.rate, &self.target].map(|lanes| lanes[0].as_array()[0]);
        target * glide.dt + ((x - target) * glide.integral[0] + v * glide.integral[1])
    }

    /// The time in [0, dt] at which the integral of the first, positive value reaches `area`.
    pub(crate) fn time_to(&self, area: f64, dt: f64, filter: &FilterGains) -> f64 {
        if self.settled() {
            return (area / self.value[0].as_array()[0]).min(dt);
        }
        let (mut low, mut high) = (0.0, dt);
        // The integral is increasing; fifty halvings exhaust the digits of a double.
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.integral(&filter.glide(middle)) < area { low = middle } else { high = middle }
        }
        high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn first(lanes: &[F64x4]) -> f64 {
        lanes[0].as_array()[0]
    }

    /// One command that sets out from 2 for 5, to be there after 0.3 s.
    fn command() -> (CommandFilter, FilterGains) {
        let (mut follower, filter) = (CommandFilter::new(&[2.0]), FilterGains::new(0.3));
        follower.follow(&[5.0], &filter);
        (follower, filter)
    }

    /// After the transition time 99 % of a step are done, however many ticks it took.
    #[test]
    fn transition_is_the_time_to_99_percent() {
        for ticks in [1, 7, 1000] {
            let (mut follower, filter) = command();
            (0..ticks).for_each(|_| follower.advance::<F64x4>(&filter.glide(0.3 / f64::from(ticks))));
            assert_relative_eq!(first(follower.value()), 2.0 + 0.99 * 3.0, epsilon = 1e-12);
        }
    }

    /// The values solve ẍ = −2ωẋ − ω²(x − target), by RK4.
    #[test]
    fn values_solve_the_filter() {
        let (mut follower, filter) = command();
        let (mut x, mut v, n) = (2.0, 0.0, 1000);
        let h = 0.2 / f64::from(n);
        let f = |x: f64, v: f64| (v, -2.0 * filter.omega * v - filter.omega.powi(2) * (x - 5.0));
        for _ in 0..n {
            let a = f(x, v);
            let b = f(x + h / 2.0 * a.0, v + h / 2.0 * a.1);
            let c = f(x + h / 2.0 * b.0, v + h / 2.0 * b.1);
            let d = f(x + h * c.0, v + h * c.1);
            x += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            v += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        }
        follower.advance::<F64x4>(&filter.glide(0.2));
        assert_relative_eq!(first(follower.value()), x, max_relative = 1e-9);
        assert_relative_eq!(first(follower.rate()), v, max_relative = 1e-8);
    }

    /// The integral is that of the values, by Simpson's rule, and its inverse finds the time back.
    #[test]
    fn integral_is_that_of_the_values() {
        let (mut follower, filter) = command();
        follower.advance::<F64x4>(&filter.glide(0.02));
        let at = |t: f64| {
            let mut follower = follower.clone();
            follower.advance::<F64x4>(&filter.glide(t));
            first(follower.value())
        };
        let n = 1000;
        let h = 0.1 / f64::from(n);
        let simpson: f64 =
            (0..n).map(|k| f64::from(k) * h).map(|t| h / 6.0 * (at(t) + 4.0 * at(t + h / 2.0) + at(t + h))).sum();
        assert_relative_eq!(follower.integral(&filter.glide(0.1)), simpson, max_relative = 1e-11);
        assert_relative_eq!(follower.time_to(simpson, 1.0, &filter), 0.1, max_relative = 1e-9);
    }

    /// What follows a filtered command solves its equation, by RK4, faster and slower than the filter and alike.
    #[test]
    fn lag_solves_its_equation() {
        let (start, filter) = command();
        for m in [0.3, filter.omega * (1.0 - 1e-9), filter.omega * 1.01, 500.0] {
            let (mut q, n) = (1.0, 2000);
            let h = 0.1 / f64::from(n);
            let x = |t: f64| {
                let mut follower = start.clone();
                follower.advance::<F64x4>(&filter.pass(t));
                first(follower.value())
            };
            for k in 0..n {
                let t = f64::from(k) * h;
                let f = |t: f64, q: f64| m * (x(t) - q);
                let a = f(t, q);
                let b = f(t + h / 2.0, q + h / 2.0 * a);
                let c = f(t + h / 2.0, q + h / 2.0 * b);
                let d = f(t + h, q + h * c);
                q += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
            assert_relative_eq!(filter.lag(&start, 1.0, m, 0.1), q, max_relative = 1e-9);
        }
    }

    /// The series is the exponential as far as it serves.
    #[test]
    fn decay_is_the_exponential() {
        for k in 0..=2000 {
            let s = 1e-3 * MAX_CLOCK_STEP * f64::from(k);
            assert_relative_eq!(decay(s), (-s).exp(), max_relative = 4.0 * f64::EPSILON);
        }
    }

    proptest! {
        /// A positive command stays positive under any sequence of changes.
        #[test]
        fn positive_commands_stay_positive(steps in prop::collection::vec((1e-3..1e3f64, 1e-4..1.0f64), 1..30)) {
            let (mut follower, filter) = command();
            for (target, dt) in steps {
                follower.follow(&[target], &filter);
                let glide = filter.glide(dt);
                let area = follower.integral(&glide);
                follower.advance::<F64x4>(&glide);
                prop_assert!(first(follower.value()) > 0.0 && area > 0.0);
            }
        }
    }
}
