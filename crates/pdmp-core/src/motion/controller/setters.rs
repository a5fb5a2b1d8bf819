//! What can be commanded between ticks. A command that is refused leaves the last good one in force.

use super::{Controller, SETTLED, Status};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::command_filter::{FilterGains, FilterStep};
use crate::error::{Error, Result};
use crate::motion::command::Command;

impl Controller {
    /// Sets the style s (J,) to go to.
    ///
    /// # Errors
    /// A wrong length or a number that is not finite; the style then stays as it was.
    pub fn set_style(&mut self, style: &[f64]) -> Result<()> {
        self.set(&Command { style: Some(style), ..Command::default() })
    }

    /// Sets the goal g (D,) of a discrete movement.
    ///
    /// # Errors
    /// A rhythmic primitive, a wrong length, or a number that is not finite; the goal then stays as it was.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<()> {
        self.set(&Command { goal: Some(goal), ..Command::default() })
    }

    /// Sets the anchor y_a (D,) of a rhythmic movement.
    ///
    /// # Errors
    /// A discrete primitive, a wrong length, or a number that is not finite; the anchor then stays as it was.
    pub fn set_anchor(&mut self, anchor: &[f64]) -> Result<()> {
        self.set(&Command { anchor: Some(anchor), ..Command::default() })
    }

    /// Sets the time constant τ, in seconds; the rate 1/τ is what passes the filter.
    ///
    /// # Errors
    /// A number that is not positive, or more than a millionfold from the model's τ; τ then stays as it was.
    pub fn set_tau(&mut self, tau: f64) -> Result<()> {
        self.set(&Command { tau: Some(tau), ..Command::default() })
    }

    /// Sets the amplitude r₀ of a rhythmic movement; r follows by Eq. (4), r₀ a filter.
    ///
    /// # Errors
    /// A discrete primitive, a negative number or one that is not finite; r₀ then stays as it was.
    pub fn set_amplitude(&mut self, amplitude: f64) -> Result<()> {
        self.set(&Command { amplitude: Some(amplitude), ..Command::default() })
    }

    /// Sets the speed: the share of the rate 1/τ at which the path is followed, 1 at the start. 0 pauses on the path; the
    /// change passes the filter of τ. A speed stays in force over [`Controller::reset`].
    ///
    /// # Errors
    /// A speed outside [0, 1e6]; it then stays as it was.
    pub fn set_speed(&mut self, speed: f64) -> Result<()> {
        if !(0.0..=1e6).contains(&speed) {
            return Err(Error::Range { name: "speed", value: speed, allowed: "must lie between 0, a pause, and 1e6" });
        }
        self.speed = speed;
        let rate = [speed / self.conditions.tau];
        if self.started {
            self.rate.follow(&rate, &self.rate_filter);
        } else {
            self.rate.jump(&rate);
        }
        self.read_out();
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

    /// Forgets the measured position: no robot follows any more, until the next one is measured.
    pub fn release(&mut self) {
        self.held.release();
        self.read_out();
    }

    fn set(&mut self, command: &Command) -> Result<()> {
        command.check(&self.primitive)?;
        self.apply(command);
        Ok(())
    }

    /// Takes a command that has been checked. What is commanded already changes nothing.
    ///
    /// Commands given before the first tick hold from the start; later ones set a settled movement going.
    pub(super) fn apply(&mut self, command: &Command) {
        let filter = self.filter;
        let mut news = false;
        if let Some(style) = command.style.filter(|style| *style != self.conditions.style) {
            self.conditions.style.copy_from_slice(style);
            self.style.follow(style, &filter);
            news = true;
        }
        if let Some(centre) = command.goal.or(command.anchor).filter(|centre| *centre != self.conditions.centre) {
            self.conditions.centre.copy_from_slice(centre);
            self.centre_filter = self.centre_filter();
            self.centre_course = FilterStep::START;
            self.centre.follow(centre, &self.centre_filter);
            self.set_tolerance();
            news = true;
        }
        if let Some(tau) = command.tau.filter(|tau| *tau != self.conditions.tau) {
            self.conditions.tau = tau;
            self.rate.follow(&[self.speed / tau], &self.rate_filter);
            news = true;
        }
        if let Some(amplitude) = command.amplitude.filter(|amplitude| *amplitude != self.conditions.amplitude) {
            self.conditions.amplitude = amplitude;
            self.amplitude.follow(&[amplitude], &filter);
            news = true;
        }
        if !news {
            return;
        }
        self.status = Status::Working;
        if !self.started {
            return self.begin();
        }
        // A style that was switched to at once.
        if filter.immediate() {
            self.read_forcing();
        }
    }
    /// The filter of a goal commanded now.
    ///
    /// Such a goal enters Eq. (1) alone, as in the paper, but over what remains of the movement: the filter takes so long,
    /// less the time 1/β_z by which the output system lags behind, and never less than a transition. A goal at once is
    /// what immediate transport has, an anchor, and any goal from shortly before the end on.
    fn centre_filter(&self) -> FilterGains {
        match self.primitive.canonical() {
            Canonical::Discrete { u_end, .. } if !self.primitive.transport.is_immediate() => {
                let remaining = u_end - self.clock.value() - 1.0 / self.primitive.attractor().beta_z;
                self.filter.lasting(remaining)
            }
            _ => self.filter,
        }
    }

    /// Sets the distances at which the way from here to the goal counts as gone, not below what rounding leaves of it.
    pub(super) fn set_tolerance(&mut self) {
        let ends = self.centre.target().iter().zip(&self.position);
        for (group, (&centre, &position)) in self.groups.iter_mut().zip(ends) {
            let rounding = centre.abs().max(position.abs()) * (8.0 * f64::EPSILON);
            group.tolerance = group.least.max(((centre - position).abs() * SETTLED).max(rounding));
        }
    }
}
