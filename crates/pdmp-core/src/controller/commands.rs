//! What can be commanded at any tick. A command that is refused leaves the last good one in force.

use super::{Controller, Status, reach_tolerance};
use crate::error::{Result, check_vector};
use crate::model::{check_amplitude, check_style, check_tau, refuse};
use crate::phase::Kind;

impl Controller {
    /// Sets the style s (J,) to go to.
    ///
    /// # Errors
    /// A wrong length or a number that is not finite; the style then stays as it was.
    pub fn set_style(&mut self, style: &[f64]) -> Result<()> {
        check_style(style, self.model.n_styles())?;
        self.conditions.style.copy_from_slice(style);
        self.style.follow(style);
        self.commanded();
        Ok(())
    }

    /// Sets the goal g (D,) of a discrete movement.
    ///
    /// # Errors
    /// A rhythmic primitive, a wrong length, or a number that is not finite; the goal then stays as it was.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<()> {
        refuse(self.model.kind(), "goal", self.model.kind() == Kind::Rhythmic)?;
        self.set_centre("goal", goal)
    }

    /// Sets the anchor y_a (D,) of a rhythmic movement.
    ///
    /// # Errors
    /// A discrete primitive, a wrong length, or a number that is not finite; the anchor then stays as it was.
    pub fn set_anchor(&mut self, anchor: &[f64]) -> Result<()> {
        refuse(self.model.kind(), "anchor", self.model.kind() == Kind::Discrete)?;
        self.set_centre("anchor", anchor)
    }

    fn set_centre(&mut self, name: &'static str, centre: &[f64]) -> Result<()> {
        check_vector(name, centre, self.model.n_dofs(), "DoF")?;
        self.conditions.centre.copy_from_slice(centre);
        self.centre.follow(centre);
        for (d, tolerance) in self.tolerance.iter_mut().enumerate() {
            *tolerance = tolerance.max(reach_tolerance(centre[d], self.position[d]));
        }
        self.commanded();
        Ok(())
    }

    /// Sets the time constant τ, in seconds; the rate 1/τ is what passes the filter.
    ///
    /// # Errors
    /// A number that is not positive, or more than a millionfold from the model's τ; τ then stays as it was.
    pub fn set_tau(&mut self, tau: f64) -> Result<()> {
        check_tau(tau, self.model.tau())?;
        self.conditions.tau = tau;
        self.rate.follow(&[1.0 / tau]);
        self.commanded();
        Ok(())
    }

    /// Sets the amplitude r₀ of a rhythmic movement; r follows by Eq. (4).
    ///
    /// # Errors
    /// A discrete primitive, a negative number or one that is not finite; r₀ then stays as it was.
    pub fn set_amplitude(&mut self, amplitude: f64) -> Result<()> {
        refuse(self.model.kind(), "amplitude", self.model.kind() == Kind::Discrete)?;
        check_amplitude(amplitude)?;
        self.conditions.amplitude = amplitude;
        self.commanded();
        Ok(())
    }

    /// Sets how much a measured position stops the phase, k_s, and pulls the movement, k_t per unit of the clock.
    ///
    /// By default k_s = 1000, so that an error of a tenth of the range slows the phase elevenfold, and k_t = 10 over the
    /// demonstrated stretch of the clock, T/τ or 2π; 0 is without.
    ///
    /// # Errors
    /// A gain that is negative, not finite or above 1e100; both then stay as they were.
    pub fn set_compliance(&mut self, stopping: f64, tracking: f64) -> Result<()> {
        self.held.set_compliance(stopping, tracking)
    }

    /// Commands given before the first step hold from the start; later ones set a settled movement going.
    fn commanded(&mut self) {
        self.status = Status::Working;
        if !self.started {
            self.begin();
        }
    }
}
