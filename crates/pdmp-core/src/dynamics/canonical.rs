//! Discrete and rhythmic canonical systems in closed form.
//!
//! Both are driven by a clock `u` with u̇ = 1/τ. The clock is integrated rather than computed as t/τ, so that the phase
//! stays continuous when τ changes.
//!
//! - discrete (Eq. 3): τẋ = −α_x x, x(0) = 1, hence x = exp(−α_x u);
//! - rhythmic (Eq. 4): τφ̇ = 1, hence φ = u mod 2π, and τṙ = μ(r₀ − r). The paper prints r − r₀, which diverges for
//!   μ > 0.

use std::f64::consts::TAU;

use crate::error::Result;
use crate::kind::Kind;
use crate::numerics::blocks::Block;
use crate::numerics::state::{Visitor, visit_number};
use serde::{Deserialize, Serialize};

/// Canonical system of a movement.
///
/// ```
/// use pdmp_core::dynamics::Canonical;
///
/// let discrete = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
/// assert_eq!(discrete.phase(1.0), (-4.6f64).exp());
/// let rhythmic = Canonical::Rhythmic { mu: 2.0 };
/// assert_eq!(rhythmic.phase(rhythmic.extent()), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Canonical {
    /// τẋ = −α_x x, demonstrated for 0 ≤ u ≤ `u_end`.
    Discrete {
        /// Decay rate α_x of the phase, per unit of u.
        alpha_x: f64,
        /// Clock u at the end of the demonstrated movement, T/τ.
        u_end: f64,
    },
    /// τφ̇ = 1 and τṙ = μ(r₀ − r).
    Rhythmic {
        /// Rate μ at which the amplitude r converges to its target r₀, per unit of u.
        mu: f64,
    },
}

impl Canonical {
    /// Returns the kind of the movement.
    pub fn kind(&self) -> Kind {
        match self {
            Canonical::Discrete { .. } => Kind::Discrete,
            Canonical::Rhythmic { .. } => Kind::Rhythmic,
        }
    }

    /// Returns the length of the demonstrated clock interval: T/τ for a discrete system, 2π for a rhythmic one.
    pub fn extent(&self) -> f64 {
        match *self {
            Canonical::Discrete { u_end, .. } => u_end,
            Canonical::Rhythmic { .. } => TAU,
        }
    }

    /// Returns the clock at each of `n_samples` equidistant samples of the demonstrated movement.
    pub(crate) fn clock(&self, n_samples: usize) -> Vec<f64> {
        let steps = self.kind().steps(n_samples) as f64;
        (0..n_samples).map(|c| self.extent() * (c as f64 / steps)).collect()
    }

    /// Returns the clock at a phase: −ln(x)/α_x for a discrete system, φ for a rhythmic one.
    pub(crate) fn clock_at(&self, phase: f64) -> f64 {
        match *self {
            Canonical::Discrete { alpha_x, .. } => -phase.ln() / alpha_x,
            Canonical::Rhythmic { .. } => phase,
        }
    }

    /// Returns the phase at clock `u`: x in [0, 1] for a discrete system, φ in [0, 2π) for a rhythmic one.
    pub fn phase(&self, u: f64) -> f64 {
        match *self {
            Canonical::Discrete { alpha_x, .. } => faded((-alpha_x * u).exp()),
            Canonical::Rhythmic { .. } => turn(u),
        }
    }
}

/// Compensated sums of N movements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompensatedSums<const N: usize> {
    values: [f64; N],
    compensations: [f64; N],
}

impl<const N: usize> CompensatedSums<N> {
    pub(crate) const ZERO: Self = Self { values: [0.0; N], compensations: [0.0; N] };

    /// Returns the sums.
    #[inline(always)]
    pub(crate) fn values(&self) -> &[f64; N] {
        &self.values
    }

    /// Returns a sum.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> CompensatedSum {
        CompensatedSum { value: self.values[i], compensation: self.compensations[i] }
    }

    /// Overwrites a sum.
    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, sum: CompensatedSum) {
        (self.values[i], self.compensations[i]) = (sum.value, sum.compensation);
    }

    /// Adds a step to a sum and returns it.
    #[inline(always)]
    pub(crate) fn add(&mut self, i: usize, step: f64) -> f64 {
        let mut sum = self.get(i);
        sum.add(step);
        self.set(i, sum);
        sum.value
    }

    /// Wraps an angle to [0, 2π) and returns it.
    #[inline(always)]
    pub(crate) fn wrap(&mut self, i: usize) -> f64 {
        self.values[i] = turn(self.values[i]);
        self.values[i]
    }

    /// Adds a step each to the sums from `first` on that fill a register, and returns these.
    #[inline(always)]
    pub(crate) fn add_block<B: Block>(&mut self, first: usize, step: B) -> B {
        let [sums, rests] = [&mut self.values[first..], &mut self.compensations[first..]];
        let (before, step) = (B::read_all(sums), step + B::read_all(rests));
        let sum = before + step;
        sum.write_all(sums);
        (step - (sum - before)).write_all(rests);
        sum
    }
}

/// Wraps an angle to [0, 2π).
pub(crate) fn turn(phi: f64) -> f64 {
    // The remainder is slow, and most angles of a control loop need none. That of a tiny negative angle rounds to 2π.
    if (0.0..TAU).contains(&phi) { phi } else { phi.rem_euclid(TAU) % TAU }
}

/// Compensated sum of many small steps: the rounding error of each addition is carried to the next (Kahan 1965).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CompensatedSum {
    value: f64,
    compensation: f64,
}

impl CompensatedSum {
    /// Returns a sum that starts at `value`.
    pub(crate) fn at(value: f64) -> Self {
        Self { value, compensation: 0.0 }
    }

    /// Returns the sum.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Adds a step.
    #[inline(always)]
    pub(crate) fn add(&mut self, step: f64) {
        let step = step + self.compensation;
        let sum = self.value + step;
        self.compensation = step - (sum - self.value);
        self.value = sum;
    }

    /// Visits the sum, within the given bounds, and its compensation.
    pub(crate) fn walk(&mut self, visit: &mut Visitor, bounds: [f64; 2]) -> Result<()> {
        visit_number(visit, &mut self.value, bounds)?;
        let rounding = 1e-9 * self.value.abs().max(1.0);
        visit_number(visit, &mut self.compensation, [-rounding, rounding])
    }

    /// Wraps an angle to [0, 2π).
    pub(crate) fn wrap(&mut self) {
        self.value = turn(self.value);
    }
}

/// Returns the amplitude r after a clock interval `h`: r₀ + (r − r₀)exp(−μh).
pub(crate) fn amplitude(mu: f64, r: f64, target: f64, h: f64) -> f64 {
    faded(target + (r - target) * (-mu * h).exp())
}

/// Flushes a non-negative number below 1e-200 to zero: products of such numbers become subnormal, which is slow.
pub(crate) fn faded(x: f64) -> f64 {
    if x < 1e-200 { 0.0 } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_relative_eq;

    /// Integrates u' = f(u) over [0, 1] by RK4, independently of the closed forms.
    fn integrated(y: f64, f: impl Fn(f64) -> f64) -> f64 {
        (0..10_000).fold([y], |y, _| rk4(|_, [y]| [f(y)], 0.0, y, 1e-4))[0]
    }

    #[test]
    fn x_solves_the_discrete_canonical_system() {
        let canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 1.0 };
        assert_relative_eq!(canonical.phase(1.0), integrated(1.0, |x| -4.6 * x), max_relative = 1e-12);
    }

    #[test]
    fn r_solves_the_amplitude_equation_and_converges() {
        assert_relative_eq!(amplitude(2.5, 0.2, 1.5, 1.0), integrated(0.2, |r| 2.5 * (1.5 - r)), max_relative = 1e-12);
        assert_relative_eq!(amplitude(2.5, 0.2, 1.5, 40.0), 1.5, max_relative = 1e-12);
    }
}
