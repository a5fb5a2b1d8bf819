//! Synchronisation of a rhythmic movement with a measured phase: a continuous pull, and a reset at an event.
//!
//! ```text
//! τφ̇ = max(0, κ + k_φ sin(φ* − φ))        pull by a measured phase φ*
//! φ := φ*,  z := z + w(φ) − w(φ*)          reset; position y and velocity ẏ = ρ(z + w) are continuous
//! ```
//!
//! κ is the phase rate of the perturbation (`perturbation`), 1 without a measured position. The pull is the coupling of
//! phase oscillators of the Kuramoto model (Acebrón et al., Reviews of Modern Physics 77, 137, 2005). It acts on the clock of
//! the phase alone, as phase stopping does; the clock of the output system is unchanged. The reset is the phase resetting of
//! Nakanishi et al., IROS 2004, [doi:10.1109/IROS.2004.1389470].
//!
//! Over a tick φ* is assumed to advance as φ does without the pull. The difference δ = φ* − φ then obeys δ′ = −k_φ sin δ,
//! whose solution tan(δ/2) = tan(δ₀/2)exp(−k_φh) gives the mean pull (δ₀ − δ)/h. It does not overshoot φ* for any gain and
//! any tick.
//!
//! [doi:10.1109/IROS.2004.1389470]: https://doi.org/10.1109/IROS.2004.1389470

use super::Controller;
use crate::dynamics::canonical::{CompensatedSum, turn};
use crate::error::{Error, Result};
use crate::model::conditions::check_phase;

/// Default k_φ, the largest for which the rate 1 + k_φ sin(φ* − φ) needs no lower bound. Measured on planar loops: cycles until
/// an error of 0.4 cycles is below 0.02, lag behind a frequency 10 % higher, and rms acceleration under white noise of
/// 0.05 rad relative to that without noise:
///
/// | k_φ | decay, cycles | lag, cycles | acceleration |
/// |----:|-----:|------:|-----:|
/// | 0.5 | 1.24 | 0.032 | 1.01 |
/// | 1   | 0.62 | 0.016 | 1.02 |
/// | 2   | 0.31 | 0.008 | 1.08 |
/// | 8   | 0.08 | 0.002 | 1.93 |
pub(super) const PHASE_GAIN: f64 = 1.0;
/// Maximum k_φ. Its time constant is less than a tenth of the maximum substep, so that a larger gain acts no faster, and w′
/// stays finite.
pub(super) const MAX_PHASE_GAIN: f64 = 1000.0;

impl Controller {
    /// Sets the phase φ of a rhythmic movement, in rad, for example at the heel strike of a gait.
    ///
    /// ```text
    /// φ := φ*,  z := z + w(φ) − w(φ*)
    /// ```
    ///
    /// Position and velocity are continuous and the acceleration jumps; the deviation from the cycle at the new phase
    /// decays with the output system. Before the first tick the movement starts at this phase, as with
    /// [`crate::Conditions::phase`].
    ///
    /// With the measured time between two events, the frequency adapts by the rule ω ← ω + K(ω_measured − ω) of Nakanishi et
    /// al., Robotics and Autonomous Systems 47, 2004, pages 79–91:
    ///
    /// ```
    /// # use std::f64::consts::TAU;
    /// # use ndarray::Array2;
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Sampling, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let position = Array2::from_shape_fn((100, 1), |(c, _)| (TAU * c as f64 / 100.0).sin());
    /// # let demo = Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?;
    /// # let model = fit(&[demo], &FitOptions::new(Kind::Rhythmic))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-2, &Conditions::default(), None)?;
    /// // A gait with strides of 1.25 s; the model has a period of 1 s.
    /// for _stride in 0..12 {
    ///     for _tick in 0..125 {
    ///         controller.step()?;
    ///     }
    ///     controller.set_phase(0.0)?;
    ///     let (omega, measured) = (1.0 / controller.tau(), TAU / 1.25);
    ///     controller.set_tau(1.0 / (omega + 0.5 * (measured - omega)))?;
    /// }
    /// assert!((TAU * controller.tau() - 1.25).abs() < 0.01);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A discrete primitive, or a phase that is not finite. The phase then remains unchanged.
    pub fn set_phase(&mut self, phase: f64) -> Result<()> {
        check_phase(self.primitive.kind(), phase)?;
        let phase = turn(phase);
        if !self.started {
            self.conditions.phase = phase;
            self.begin();
            return Ok(());
        }
        self.move_rotations(phase);
        let (r, phase_rate) = (self.r, self.perturbation.phase_rate());
        self.add_additional_slope(phase_rate);
        self.groups.iter_mut().for_each(|group| group.z += group.forcing.value * r);
        self.clock = CompensatedSum::at(phase);
        self.read_frame();
        self.read_forcing();
        self.add_additional_slope(-phase_rate);
        self.groups.iter_mut().for_each(|group| group.z -= group.forcing.value * r);
        self.leave_path();
        self.publish();
        Ok(())
    }

    /// Returns the gain k_φ of a measured phase.
    pub fn phase_gain(&self) -> f64 {
        self.phase_gain
    }

    /// Sets the gain k_φ of a measured phase ([`crate::Command::phase`]), per unit of the clock. 0 disables the pull.
    ///
    /// An error of the phase decays with exp(−k_φ t/τ). A movement whose frequency differs from the measured one by the
    /// share ε lags by asin(ε/k_φ), and stays synchronised for ε < k_φ. By default k_φ = 1, the largest gain for which φ
    /// advances at every measured phase. The gain remains in force after [`Controller::reset`].
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Sampling, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let position = ndarray::Array2::from_shape_fn((100, 1), |(c, _)| (0.02 * std::f64::consts::PI * c as f64).sin());
    /// # let demos = [Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?];
    /// # let model = fit(&demos, &FitOptions::new(Kind::Rhythmic))?;
    /// # let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None)?;
    /// controller.set_phase_gain(0.5)?;
    /// assert_eq!(controller.phase_gain(), 0.5);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A gain outside [0, 1000]. It then remains unchanged.
    pub fn set_phase_gain(&mut self, gain: f64) -> Result<()> {
        if !(0.0..=MAX_PHASE_GAIN).contains(&gain) {
            let allowed = "must lie between 0, which disables the pull, and 1000";
            return Err(Error::Range { name: "phase_gain", value: gain, allowed });
        }
        self.phase_gain = gain;
        Ok(())
    }

    /// Adds the pull of a measured phase to the phase rate of a tick of `h` on the clock.
    pub(super) fn pull_phase(&mut self, measured: f64, h: f64) {
        if h > 0.0 {
            let difference = turn(turn(measured) - self.clock.value());
            self.perturbation.add_phase_pull(corrected(difference, self.phase_gain * h) / h);
        }
    }
}

/// Returns δ₀ − δ, the decrease of a phase difference δ′ = −sin δ over a clock interval `h`.
fn corrected(difference: f64, h: f64) -> f64 {
    let (sine, cosine) = (0.5 * difference).sin_cos();
    2.0 * (-sine * cosine * (-h).exp_m1()).atan2(cosine * cosine + sine * sine * (-h).exp())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use approx::assert_relative_eq;

    /// The correction solves δ′ = −sin δ: RK4 agrees.
    #[test]
    fn correction_solves_the_coupling_equation() {
        for start in [-3.0, -1.0, 1e-3, 0.5, 2.0, 3.1] {
            for h in [1e-3, 0.3, 4.0] {
                let (mut delta, n) = (start, 2000);
                let step = h / f64::from(n);
                for _ in 0..n {
                    let a = -f64::sin(delta);
                    let b = -f64::sin(delta + step / 2.0 * a);
                    let c = -f64::sin(delta + step / 2.0 * b);
                    let d = -f64::sin(delta + step * c);
                    delta += step / 6.0 * (a + 2.0 * b + 2.0 * c + d);
                }
                assert_relative_eq!(corrected(start, h), start - delta, max_relative = 1e-9);
            }
        }
    }

    /// The correction never exceeds the shorter way round, and its rate never exceeds 1, for any interval.
    #[test]
    fn correction_does_not_overshoot() {
        for k in 0..=200 {
            let difference = 2.0 * PI * f64::from(k) / 200.0;
            let shorter = if difference > PI { difference - 2.0 * PI } else { difference };
            for h in [5e-324, 1e-300, 1e-12, 1e-3, 1.0, 1e3, 1e300] {
                let found = corrected(difference, h);
                assert!(found * shorter >= 0.0 && found.abs() <= shorter.abs() * (1.0 + 1e-12) + 1e-15, "{found}");
                assert!(found.abs() <= h * (1.0 + 1e-12), "{found} {h}");
            }
        }
    }
}
