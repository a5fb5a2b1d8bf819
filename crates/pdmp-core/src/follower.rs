//! Critically damped second-order filters: how commands change without a jump in position or velocity.
//!
//! ẍ = −2ωẋ − ω²(x − target), solved in closed form over a tick. Its impulse response is positive, so that a filtered
//! positive command stays positive, whatever the order and time of its changes.

/// Time to 99 % of a step, times ω: the root of (1 + s)exp(−s) = 0.01.
const SETTLING: f64 = 6.638_352_067_993_813;
/// After so long, times ω, what is left of a step lies far below rounding.
const FORGOTTEN: f64 = 60.0;

/// Several commands that are followed with one time constant.
#[derive(Clone, Debug)]
pub(crate) struct Follower {
    value: Vec<f64>,
    rate: Vec<f64>,
    target: Vec<f64>,
    /// ω, per second; infinite for an immediate switch.
    omega: f64,
    /// Seconds until the values are their targets.
    remaining: f64,
}

impl Follower {
    /// At rest on `target`; `transition` is the time to 99 % in seconds, 0 for an immediate switch.
    pub(crate) fn new(target: &[f64], transition: f64) -> Self {
        Self {
            value: target.to_vec(),
            rate: vec![0.0; target.len()],
            target: target.to_vec(),
            omega: SETTLING / transition,
            remaining: 0.0,
        }
    }

    /// Values now.
    pub(crate) fn value(&self) -> &[f64] {
        &self.value
    }

    /// Their derivatives with respect to time, per second.
    pub(crate) fn rate(&self) -> &[f64] {
        &self.rate
    }

    /// Where they go.
    pub(crate) fn target(&self) -> &[f64] {
        &self.target
    }

    /// Whether the values have come to rest on their targets.
    pub(crate) fn settled(&self) -> bool {
        self.remaining <= 0.0
    }

    /// Sets out for a target of the same length.
    pub(crate) fn follow(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        if self.omega.is_finite() {
            self.remaining = FORGOTTEN / self.omega;
        } else {
            self.settle();
        }
    }

    /// Jumps to a target of the same length.
    pub(crate) fn jump(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        self.settle();
    }

    fn settle(&mut self) {
        self.value.copy_from_slice(&self.target);
        self.rate.fill(0.0);
        self.remaining = 0.0;
    }

    /// Moves on by `dt` seconds.
    pub(crate) fn advance(&mut self, dt: f64) {
        if self.settled() {
            return;
        }
        self.remaining -= dt;
        if self.settled() {
            return self.settle();
        }
        let (omega, decay) = (self.omega, (-self.omega * dt).exp());
        for ((x, v), target) in self.value.iter_mut().zip(&mut self.rate).zip(&self.target) {
            let d = *x - target;
            let b = *v + omega * d;
            *x = target + (d + b * dt) * decay;
            *v = (*v - omega * b * dt) * decay;
        }
    }

    /// ∫ of the first value over the next `dt` seconds.
    pub(crate) fn integral(&self, dt: f64) -> f64 {
        let (x, target) = (self.value[0], self.target[0]);
        if self.settled() {
            return x * dt;
        }
        let (omega, s) = (self.omega, self.omega * dt);
        let (d, b) = (x - target, self.rate[0] + omega * (x - target));
        let first = -(-s).exp_m1();
        let second = first - s * (-s).exp();
        target * dt + d / omega * first + b / (omega * omega) * second
    }

    /// The time in [0, dt] at which the integral of the first, positive value reaches `area`.
    pub(crate) fn time_to(&self, area: f64, dt: f64) -> f64 {
        if self.settled() {
            return (area / self.value[0]).min(dt);
        }
        let (mut low, mut high) = (0.0, dt);
        // The integral is increasing; fifty halvings exhaust the digits of a double.
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.integral(middle) < area { low = middle } else { high = middle }
        }
        high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// After the transition time 99 % of a step are done, however many ticks it took.
    #[test]
    fn transition_is_the_time_to_99_percent() {
        for ticks in [1, 7, 1000] {
            let mut follower = Follower::new(&[2.0], 0.3);
            follower.follow(&[5.0]);
            (0..ticks).for_each(|_| follower.advance(0.3 / f64::from(ticks)));
            assert_relative_eq!(follower.value()[0], 2.0 + 0.99 * 3.0, epsilon = 1e-12);
        }
    }

    /// The integral is that of the values, by Simpson's rule, and its inverse finds the time back.
    #[test]
    fn integral_is_that_of_the_values() {
        let mut follower = Follower::new(&[2.0], 0.3);
        follower.follow(&[5.0]);
        follower.advance(0.02);
        let at = |t: f64| {
            let mut follower = follower.clone();
            follower.advance(t);
            follower.value()[0]
        };
        let n = 1000;
        let h = 0.1 / f64::from(n);
        let simpson: f64 =
            (0..n).map(|k| f64::from(k) * h).map(|t| h / 6.0 * (at(t) + 4.0 * at(t + h / 2.0) + at(t + h))).sum();
        assert_relative_eq!(follower.integral(0.1), simpson, max_relative = 1e-11);
        assert_relative_eq!(follower.time_to(simpson, 1.0), 0.1, max_relative = 1e-9);
    }

    proptest! {
        /// A positive command stays positive under any sequence of changes.
        #[test]
        fn positive_commands_stay_positive(steps in prop::collection::vec((1e-3..1e3f64, 1e-4..1.0f64), 1..30)) {
            let mut follower = Follower::new(&[1.0], 0.2);
            for (target, dt) in steps {
                follower.follow(&[target]);
                let area = follower.integral(dt);
                follower.advance(dt);
                prop_assert!(follower.value()[0] > 0.0 && area > 0.0);
            }
        }
    }
}
