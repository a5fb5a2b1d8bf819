//! The two canonical systems in closed form.
//!
//! Both are driven by one clock `u` with u̇ = 1/τ. It is integrated, never computed as t/τ, so that a changed τ bends
//! the phase and does not make it jump.
//!
//! - discrete (Eq. 3): τẋ = −α_x x, x(0) = 1, hence x = exp(−α_x u);
//! - rhythmic (Eq. 4): τφ̇ = 1, hence φ = u mod 2π, and τṙ = μ(r₀ − r). The paper prints r − r₀, which diverges for
//!   μ > 0.

use std::f64::consts::TAU;

use crate::kind::Kind;
use serde::{Deserialize, Serialize};

/// A canonical system.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Canonical {
    /// τẋ = −α_x x, demonstrated up to u = `u_end`.
    Discrete {
        /// Decay of the phase, per unit of u.
        alpha_x: f64,
        /// Clock at the end of the demonstrated movement, T/τ.
        u_end: f64,
    },
    /// τφ̇ = 1 and τṙ = μ(r₀ − r).
    Rhythmic {
        /// Rate at which the amplitude follows its target, per unit of u.
        mu: f64,
    },
}

impl Canonical {
    /// Which of the two it is.
    pub fn kind(&self) -> Kind {
        match self {
            Canonical::Discrete { .. } => Kind::Discrete,
            Canonical::Rhythmic { .. } => Kind::Rhythmic,
        }
    }

    /// Length of the demonstrated stretch of the clock: T/τ, or one turn.
    pub fn extent(&self) -> f64 {
        match *self {
            Canonical::Discrete { u_end, .. } => u_end,
            Canonical::Rhythmic { .. } => TAU,
        }
    }

    /// The clock at each of `n_samples` at equal intervals.
    pub(crate) fn clock(&self, n_samples: usize) -> Vec<f64> {
        let steps = self.kind().steps(n_samples) as f64;
        (0..n_samples).map(|c| self.extent() * (c as f64 / steps)).collect()
    }

    /// The clock at a phase: −ln(x)/α_x where discrete, φ itself where rhythmic.
    pub(crate) fn clock_at(&self, phase: f64) -> f64 {
        match *self {
            Canonical::Discrete { alpha_x, .. } => -phase.ln() / alpha_x,
            Canonical::Rhythmic { .. } => phase,
        }
    }

    /// The phase at clock `u`: x in (0, 1], or φ in [0, 2π).
    pub fn phase(&self, u: f64) -> f64 {
        match *self {
            Canonical::Discrete { alpha_x, .. } => faded((-alpha_x * u).exp()),
            Canonical::Rhythmic { .. } => turn(u),
        }
    }
}

/// An angle in [0, 2π).
pub(crate) fn turn(phi: f64) -> f64 {
    // A remainder takes long, and most angles of a control loop are there already. What lies just below 0 rounds to 2π.
    if (0.0..TAU).contains(&phi) { phi } else { phi.rem_euclid(TAU) % TAU }
}

/// A sum of many small steps that does not drift: what each addition rounds off is carried to the next (Kahan 1965).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CompensatedSum {
    value: f64,
    carried: f64,
}

impl CompensatedSum {
    /// A sum that starts at `value`.
    pub(crate) fn at(value: f64) -> Self {
        Self { value, carried: 0.0 }
    }

    /// The sum.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Adds a step.
    pub(crate) fn add(&mut self, step: f64) {
        let step = step + self.carried;
        let sum = self.value + step;
        self.carried = step - (sum - self.value);
        self.value = sum;
    }

    /// Brings an angle back into [0, 2π).
    pub(crate) fn wrap(&mut self) {
        self.value = turn(self.value);
    }
}

/// The amplitude r after a stretch `h` of the clock: r₀ + (r − r₀)exp(−μh).
pub(crate) fn amplitude(mu: f64, r: f64, target: f64, h: f64) -> f64 {
    faded(target + (r - target) * (-mu * h).exp())
}

/// A number that is not negative, or zero where it has all but faded: what lies below would leave the range of fast
/// numbers.
pub(crate) fn faded(x: f64) -> f64 {
    if x < 1e-200 { 0.0 } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Integrates u' = f(u) over [0, 1] by RK4, independently of the closed forms.
    fn rk4(mut y: f64, f: impl Fn(f64) -> f64) -> f64 {
        let h = 1e-4;
        for _ in 0..10_000 {
            let k1 = f(y);
            let k2 = f(y + h / 2.0 * k1);
            let k3 = f(y + h / 2.0 * k2);
            let k4 = f(y + h * k3);
            y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        }
        y
    }

    #[test]
    fn x_solves_the_discrete_canonical_system() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        assert_relative_eq!(canonical.phase(1.0), rk4(1.0, |x| -4.6 * x), max_relative = 1e-12);
    }

    #[test]
    fn r_solves_the_amplitude_equation_and_converges() {
        assert_relative_eq!(amplitude(2.5, 0.2, 1.5, 1.0), rk4(0.2, |r| 2.5 * (1.5 - r)), max_relative = 1e-12);
        assert_relative_eq!(amplitude(2.5, 0.2, 1.5, 40.0), 1.5, max_relative = 1e-12);
    }
}
