//! Rate of the clock within the limits of velocity and acceleration: what one DoF cannot follow slows all of them along the
//! path.
//!
//! ```text
//! ẏ = ρy′,  ÿ = ρ²y″ + ρ̇y′:    |ẏ| ≤ V and |ÿ| ≤ A bound ρ and ρ̇,    ρ² ≤ K(u)
//! ```
//!
//! K is the largest ρ² from which the path ahead can be followed (`path_ahead`). While the filter of the commanded rate keeps
//! these limits, the movement is to the bit that without limits. Otherwise ρ is linear over the substep, with the ρ̇ closest to
//! that of the filter, which then continues from there.

use super::Controller;
use super::governor::Governor;
use super::step::first_element;
use crate::motion::viability::MIN_TICK;
use crate::numerics::simd::Register;

/// Largest decrease of the rate over a substep off the path, relative to it.
const MAX_DECREASE: f64 = 0.1;
/// Maximum number of parts of a substep.
const MAX_PARTS: usize = 16;
/// Relative excess of ρ² over the largest one from which the margins of the path ahead return.
const TOLERANCE: f64 = 0.01;

impl Controller {
    /// Returns whether the rate of the next substep needs no limit, at a settled rate.
    #[inline(always)]
    pub(super) fn admits_rate(&self, governor: &Governor) -> bool {
        let rate = first_element(self.rate.value());
        self.rate.is_settled() && governor.ahead.admits_constant(rate * rate)
    }

    /// Determines the rate over the next `dt` seconds. Returns the clock interval if it deviates from the filter of the
    /// commanded rate.
    #[inline(never)]
    pub(super) fn limit_rate(&mut self, dt: f64) -> Option<f64> {
        if dt < MIN_TICK {
            return None;
        }
        self.update_rate_step(dt);
        let Governor { ahead, limits, .. } = &**self.governor.as_ref()?;
        let rate = first_element(self.rate.value());
        let [next, next_slope] = self.rate.preview(&self.rate_step);
        let wanted = (next - rate) / dt;
        let [least, most] = ahead.slopes(rate * rate, limits);
        let keeps = |[least, most]: [f64; 2]| [wanted, next_slope].iter().all(|slope| (least..=most).contains(slope));
        let crosses = rate.max(next) * dt > ahead.rest();
        if keeps([least, most]) && (!crosses || keeps(ahead.next_slopes(next * next, limits))) {
            return None;
        }
        let slope = if least <= most && rate * rate <= ahead.largest_square() * (1.0 + TOLERANCE) {
            wanted.max(least).min(most)
        } else {
            // Off the path, at a rate from which it cannot be followed, the clock is slowed and the DoFs are limited on their own.
            wanted.min(most).max(-MAX_DECREASE * rate / dt)
        };
        // Numbers near overflow leave no slope to follow; the DoFs are then limited on their own.
        let slope = Some(slope.max(-rate / dt)).filter(|slope| slope.is_finite())?;
        self.rate_slope = Some(slope);
        if let Some(governor) = &mut self.governor {
            governor.slows = true;
        }
        Some((rate + 0.5 * slope * dt) * dt)
    }

    /// Advances by `dt` seconds and `h` on the clock at a limited rate, which changes its slope at the knots of the path ahead.
    #[inline(never)]
    pub(super) fn limited_substep(&mut self, mut dt: f64, mut h: f64) {
        for _ in 0..MAX_PARTS {
            let Some(governor) = &self.governor else { break };
            let rest = governor.ahead.rest() / self.perturbation.phase_rate();
            if self.rate_slope.is_none() || rest >= h {
                break;
            }
            let part = self.time_to(rest, dt);
            self.advance_part(part, rest);
            dt -= part;
            h = self.clock_step(dt);
        }
        self.advance_part(dt, h);
    }

    /// Advances by `dt` seconds and `h` on the clock. It stays a call, so that the tick of a free movement stays small.
    #[inline(never)]
    fn advance_part(&mut self, dt: f64, h: f64) {
        self.free_substep(dt, h);
    }

    /// Advances the rate by `dt` seconds.
    #[inline(always)]
    pub(super) fn advance_rate<T: Register>(&mut self, dt: f64) {
        match self.rate_slope.take() {
            None => {
                self.update_rate_step(dt);
                self.rate.advance::<T>(&self.rate_step);
            }
            Some(slope) => self.rate.move_on(slope, dt, &self.rate_gains),
        }
    }

    /// Returns the time in [0, dt] after which the clock has advanced by `area`.
    pub(super) fn time_to(&self, area: f64, dt: f64) -> f64 {
        match self.rate_slope {
            None => self.rate.integral_time(area, dt, &self.rate_gains),
            Some(slope) => {
                let rate = first_element(self.rate.value());
                // ρt + ½ρ̇t² = area, without cancellation.
                (2.0 * area / (rate + (rate * rate + 2.0 * slope * area).max(0.0).sqrt())).min(dt)
            }
        }
    }
}
