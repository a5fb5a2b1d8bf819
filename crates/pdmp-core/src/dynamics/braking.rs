//! Braking of a discrete movement past its end.
//!
//! A movement that ends with velocity v_end continues along the critically damped curve
//!
//! ```text
//! e(v) = v_end·v·exp(−λv),     λ = κ/2,     v = u − u_end,
//! ```
//!
//! whose deceleration is at most κ·v_end, and which returns to the goal at the rate λ. A forcing that decays as exp(−κv)
//! decelerates equally but leaves a displacement that decays at the rate α_z/2 for every κ. From
//! z = −α_zβ_z·h(v), h(v) = ∫₀ᵛ exp(−α_z(v − s))·s·exp(−λs) ds, and e′ = z + p, the forcing is p = (1 − λv)·exp(−λv) + α_zβ_z·h.

use crate::dynamics::output_system::{Attractor, CubicSample, INVERSE_FACTORIAL, State};
use crate::numerics::simd::F64x4;

/// Maximum |x| of the series of ψ; the closed form loses a digit here, and more below.
const MAX_SERIES: f64 = 0.5;

/// Braking with unit velocity at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Braking {
    alpha_z: f64,
    /// α_zβ_z.
    stiffness: f64,
    lambda: f64,
    /// v at the maximum of h.
    peak: f64,
}

impl Braking {
    /// Returns the braking with the largest deceleration κ per unit of velocity.
    pub(crate) fn new(Attractor { alpha_z, beta_z }: Attractor, kappa: f64) -> Self {
        let mut braking = Self { alpha_z, stiffness: alpha_z * beta_z, lambda: 0.5 * kappa, peak: 0.0 };
        // h′ = v·exp(−λv) − α_z·h has one change of sign, before 4/min(α_z, λ). Fifty bisections exhaust the digits.
        let (mut low, mut high) = (0.0, 4.0 / alpha_z.min(braking.lambda));
        for _ in 0..50 {
            let v = 0.5 * (low + high);
            if v * (-braking.lambda * v).exp() > alpha_z * braking.h(v) { low = v } else { high = v }
        }
        braking.peak = high;
        braking
    }

    /// Returns p·exp(α_z v) and its derivative.
    pub(crate) fn forcing(&self, v: f64) -> [f64; 2] {
        let &Self { alpha_z, stiffness, lambda, .. } = self;
        let d = alpha_z - lambda;
        let growth = (d * v).exp();
        let p = (1.0 - lambda * v) * growth + stiffness * v * v * psi(d * v, growth);
        [p, growth * (d * (1.0 - lambda * v) - lambda + stiffness * v)]
    }

    /// Returns the second derivative of p·exp(α_z v), given the first.
    pub(crate) fn forcing_bend(&self, v: f64, slope: f64) -> f64 {
        let d = self.alpha_z - self.lambda;
        d * slope + (d * v).exp() * (self.stiffness - self.lambda * d)
    }

    /// Returns e = v·exp(−λv) and z = −α_zβ_z·h(v).
    pub(crate) fn state(&self, v: f64) -> State<f64> {
        State { e: v * (-self.lambda * v).exp(), z: -self.stiffness * self.h(v) }
    }

    /// Returns the maximum of e from v on.
    pub(crate) fn max_displacement(&self, v: f64) -> f64 {
        let v = v.max(1.0 / self.lambda);
        v * (-self.lambda * v).exp()
    }

    /// Returns an upper bound of |p| from v on, which decreases.
    pub(crate) fn bound(&self, v: f64) -> f64 {
        let decayed = self.lambda * v;
        (1.0 + decayed) * (-decayed).exp() + self.stiffness * self.h(v.max(self.peak))
    }

    /// Returns h(v) = v²·ψ((α_z − λ)v)·exp(−α_z v).
    fn h(&self, v: f64) -> f64 {
        let x = (self.alpha_z - self.lambda) * v;
        let decay = (-self.alpha_z * v).exp();
        if decay > 0.0 { v * v * psi(x, x.exp()) * decay } else { 0.0 }
    }
}

/// Returns ψ(x) = ((x − 1)eˣ + 1)/x² = Σₖ (k + 1)xᵏ/(k + 2)!, for x and eˣ.
fn psi(x: f64, exp: f64) -> f64 {
    if x.abs() > MAX_SERIES {
        return ((x - 1.0) * exp + 1.0) / (x * x);
    }
    let terms = INVERSE_FACTORIAL[2..16].iter().rev().zip((1..15).rev());
    terms.fold(0.0, |sum, (inverse, k)| sum * x + f64::from(k) * inverse)
}

/// Motion past the end due to the forcing w = r·(a + b·p) of a movement that brakes: e = b·e₁ and z = b·z₁ − a·r solve
/// e′ = z + w about the goal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BrakedMotion {
    pub(super) r: f64,
    pub(super) p: f64,
    /// e₁ and z₁.
    pub(super) unit: State<f64>,
    /// Maximum of e₁ from the clock on.
    pub(super) max_displacement: f64,
}

impl BrakedMotion {
    /// Returns the state for a + b·p as value and b as slope.
    pub(crate) fn state(&self, CubicSample { value, slope }: CubicSample<F64x4>) -> State<F64x4> {
        let a = value - slope * self.p;
        State { e: slope * self.unit.e, z: slope * self.unit.z - a * self.r }
    }

    /// Returns the maximum of |e| from the clock on.
    pub(crate) fn max_displacement(&self, slope: F64x4) -> F64x4 {
        slope.abs() * self.max_displacement
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::runge_kutta::rk4;
    use approx::assert_relative_eq;

    /// The output system under the braking forcing follows v·exp(−λv), by RK4, for rates below, at and above α_z.
    #[test]
    fn braking_follows_the_critically_damped_curve() {
        let attractor = Attractor { alpha_z: 25.0, beta_z: 6.25 };
        for lambda in [5.0, 12.5, 25.0, 25.0 + 1e-9, 100.0] {
            let braking = Braking::new(attractor, 2.0 * lambda);
            let forcing = |v: f64| braking.forcing(v)[0] * (-attractor.alpha_z * v).exp();
            let flow = |v: f64, [e, z]: [f64; 2]| [z + forcing(v), -25.0 * (6.25 * e + z)];
            let (mut state, h) = ([0.0; 2], 1e-4);
            for k in 0..5000 {
                let v = f64::from(k) * h;
                state = rk4(flow, v, state, h);
                assert_relative_eq!(state[0], (v + h) * (-lambda * (v + h)).exp(), epsilon = 1e-9);
            }
        }
    }

    /// The derivatives are those of the value, and the series joins the closed form.
    #[test]
    fn braking_forcing_is_smooth() {
        let attractor = Attractor { alpha_z: 25.0, beta_z: 6.25 };
        for lambda in [5.0f64, 24.0, 100.0] {
            for v in [1e-3, 0.0199, MAX_SERIES / (25.0 - lambda).abs(), 0.03, 0.3] {
                let braking = Braking::new(attractor, 2.0 * lambda);
                let [[below, falling], [_, slope], [above, rising]] =
                    [-1e-6, 0.0, 1e-6].map(|by| braking.forcing(v + by));
                assert_relative_eq!((above - below) / 2e-6, slope, max_relative = 1e-6, epsilon = 1e-6);
                let bend = braking.forcing_bend(v, slope);
                assert_relative_eq!((rising - falling) / 2e-6, bend, max_relative = 1e-6, epsilon = 1e-4);
            }
        }
    }

    /// The bound decreases and is never exceeded later, but for rounding.
    #[test]
    fn forcing_stays_within_its_bound() {
        let attractor = Attractor { alpha_z: 25.0, beta_z: 6.25 };
        for lambda in [12.5, 24.0, 100.0] {
            let braking = Braking::new(attractor, 2.0 * lambda);
            let mut bound = f64::INFINITY;
            for k in 0..3000 {
                let v = f64::from(k) * 1e-3;
                let forcing = braking.forcing(v)[0] * (-attractor.alpha_z * v).exp();
                let next = braking.bound(v) * (1.0 + 1e-12);
                assert!(next <= bound * (1.0 + 1e-12) && forcing.abs() <= next, "{lambda} {v}");
                bound = next;
            }
        }
    }
}
