//! Commands between ticks. A rejected command leaves the last valid one in force.

use std::ops::BitOr;

use super::{Controller, MAX_SPEED, Status};
use crate::error::{Error, Result};
use crate::motion::command::Command;
use crate::motion::perturbation::Compliance;

impl Controller {
    /// Sets the style s (J,).
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None)?;
    /// let style = model.demonstrated().styles.row(2).to_vec();
    /// controller.set_style(&style)?;
    /// assert_eq!(controller.style(), style);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A wrong length or a number that is not finite. The style then remains unchanged.
    pub fn set_style(&mut self, style: &[f64]) -> Result<()> {
        self.set(&Command { style: Some(style), ..Command::default() })
    }

    /// Sets the goal g (D,) of a discrete movement, in the unit of each DoF.
    ///
    /// With learnt transport the frame moves to the goal with minimum jerk over the rest of the movement, near and past the
    /// end over the time in which it is no faster than the paper's equations would be. With immediate transport the goal
    /// passes the filter of the other commands into Eq. (1), as in the paper.
    ///
    /// # Errors
    /// A rhythmic primitive, a wrong length, or a number that is not finite. The goal then remains unchanged.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<()> {
        self.set(&Command { goal: Some(goal), ..Command::default() })
    }

    /// Sets the final velocity (D,) with which a discrete movement passes its goal at the end, per second; `None` is that of
    /// the demonstrations.
    ///
    /// At the commanded τ the movement is at its goal with this velocity when the clock reaches the end, to rounding, after
    /// any sequence of commands: of the final velocity and τ before the last tenth of the movement, of goals and styles before
    /// the shortest transition of a goal, by default the last third. Later ones do not change the arrival; a later goal is
    /// taken up past the end, where the attractor also brings the movement back. The speed scales the velocity.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), model.duration() / 100.0, &Conditions::default(), None)?;
    /// controller.set_goal_velocity(Some(&[2.0, -0.5]))?;
    /// for _ in 0..100 {
    ///     controller.step()?;
    /// }
    /// assert!((controller.velocity()[0] - 2.0).abs() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A rhythmic primitive or one with immediate transport, a wrong length, or a number that is not finite. The final
    /// velocity then remains unchanged.
    pub fn set_goal_velocity(&mut self, velocity: Option<&[f64]>) -> Result<()> {
        if velocity.is_none() && self.conditions.has_goal_velocity {
            self.conditions.has_goal_velocity = false;
            self.conditions.goal_velocity.fill(0.0);
            if !self.started {
                self.begin();
            } else if self.approaching {
                self.start_goal_transition();
            }
        }
        self.set(&Command { goal_velocity: velocity, ..Command::default() })
    }

    /// Sets the anchor y_a (D,) of a rhythmic movement, in the unit of each DoF.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Sampling, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let position = ndarray::Array2::from_shape_fn((100, 1), |(c, _)| (0.02 * std::f64::consts::PI * c as f64).sin());
    /// # let demos = [Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?];
    /// # let model = fit(&demos, &FitOptions::new(Kind::Rhythmic))?;
    /// # let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None)?;
    /// controller.set_anchor(&[0.5])?;
    /// assert_eq!(controller.centre(), [0.5]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A discrete primitive, a wrong length, or a number that is not finite. The anchor then remains unchanged.
    pub fn set_anchor(&mut self, anchor: &[f64]) -> Result<()> {
        self.set(&Command { anchor: Some(anchor), ..Command::default() })
    }

    /// Sets the time constant τ, in seconds. The rate 1/τ is filtered.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// controller.set_tau(2.0 * model.tau())?;
    /// assert_eq!(controller.tau(), 2.0 * model.tau());
    /// assert!(controller.set_tau(-1.0).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A number that is not positive, or that differs from the model's τ by a factor of more than 1e6. τ then remains
    /// unchanged.
    pub fn set_tau(&mut self, tau: f64) -> Result<()> {
        self.set(&Command { tau: Some(tau), ..Command::default() })
    }

    /// Sets the amplitude r₀ of a rhythmic movement. r₀ is filtered, and r converges to it by Eq. (4).
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Sampling, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let position = ndarray::Array2::from_shape_fn((100, 1), |(c, _)| (0.02 * std::f64::consts::PI * c as f64).sin());
    /// # let demos = [Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?];
    /// # let model = fit(&demos, &FitOptions::new(Kind::Rhythmic))?;
    /// # let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None)?;
    /// controller.set_amplitude(0.5)?;
    /// assert_eq!(controller.amplitude(), 0.5);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A discrete primitive, a negative number or one that is not finite. r₀ then remains unchanged.
    pub fn set_amplitude(&mut self, amplitude: f64) -> Result<()> {
        self.set(&Command { amplitude: Some(amplitude), ..Command::default() })
    }

    /// Sets the speed, a factor of the rate 1/τ: 1 by default, 0 for a pause on the path. The change is filtered as that of
    /// τ. Infinity is as fast as limits of velocity and acceleration allow ([`Controller::set_limits`]). The speed remains in force after [`Controller::reset`].
    ///
    /// A movement that starts with a given velocity ẏ keeps it at any speed, also in a pause: ẏ = ρy′ with a rate ρ at the start
    /// of at least max |ẏ|T/(k·range), k = 15/8 for a discrete and π for a rhythmic movement, up to 1/τ. From there the rate
    /// passes the filter to that of the speed, within the limits.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), Some(0.0))?;
    /// controller.set_speed(0.0)?;
    /// let phase = controller.phase();
    /// controller.step()?;
    /// assert_eq!(controller.phase(), phase);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A speed outside [0, 1e6]. It then remains unchanged.
    pub fn set_speed(&mut self, speed: f64) -> Result<()> {
        self.check_speed(speed)?;
        self.speed = speed;
        let rate = [self.commanded_rate()];
        if self.started {
            self.rate.set_target(&rate, &self.rate_gains);
            self.publish();
        } else {
            self.begin();
        }
        Ok(())
    }

    /// Checks a speed.
    pub(in crate::motion) fn check_speed(&self, speed: f64) -> Result<()> {
        let unlimited = speed == f64::INFINITY && self.governor.is_some();
        if !((0.0..=1e6).contains(&speed) || unlimited) {
            let allowed = "must lie between 0, a pause, and 1e6, or be infinite within synchronous limits of velocity or \
                           acceleration";
            return Err(Error::Range { name: "speed", value: speed, allowed });
        }
        Ok(())
    }

    /// Sets the tolerance of a settled movement, 0.005 by default, relative to the larger of two lengths of each DoF: its
    /// largest demonstrated range, and its distance from the goal when this was last commanded. Where both are a millionth of
    /// the largest range or less, it is relative to the largest range: a disturbed DoF at rest does not delay the end.
    ///
    /// Past the demonstrated end a movement is [`Status::Finished`] when it is within the tolerance of its goal and will stay
    /// there. The tolerance remains in force after [`Controller::reset`].
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Status, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// controller.set_tolerance(1e-6)?;
    /// while controller.step()? == Status::Working {}
    /// assert!((controller.position()[0] - controller.centre()[0]).abs() <= 1e-6 * model.ranges()[0]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A tolerance outside (0, 1]. It then remains unchanged.
    pub fn set_tolerance(&mut self, tolerance: f64) -> Result<()> {
        if !(tolerance > 0.0 && tolerance <= 1.0) {
            let allowed = "must be positive and at most 1, the range of the demonstrations";
            return Err(Error::Range { name: "tolerance", value: tolerance, allowed });
        }
        self.tolerance = tolerance;
        Ok(())
    }

    /// Sets the gains of a measured position: k_s of phase stopping, and k_t of tracking, per unit of the clock.
    ///
    /// By default k_s = 1000, so that an error of a tenth of the range slows the phase elevenfold, and k_t = 10 divided by
    /// the demonstrated clock interval T/τ or 2π. A gain of 0 disables its term.
    ///
    /// ```
    /// # use pdmp_core::{Command, Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// use pdmp_core::motion::Compliance;
    ///
    /// controller.set_compliance(Compliance { stopping: 1e6, tracking: 0.0 })?;
    /// controller.step()?;
    /// let (phase, measured) = (controller.phase(), [1.0, 0.0]);
    /// controller.step_with(&Command { measured: Some(&measured), ..Command::default() })?;
    /// assert!(phase - controller.phase() < 1e-6);
    /// controller.release();
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A gain that is negative, not finite or above 1e100. Both then remain unchanged.
    pub fn set_compliance(&mut self, compliance: Compliance) -> Result<()> {
        self.perturbation.set_compliance(compliance)
    }

    /// Discards the measured position and the expected error, so that no perturbation acts until the next measurement. The
    /// velocity stays continuous: the movement takes up the pull of the last measurement, and regains its own velocity.
    pub fn release(&mut self) {
        let [tau, _] = self.coupling_tau();
        for (group, pull) in self.groups.iter_mut().zip(self.perturbation.pull()) {
            group.z += *pull * tau;
        }
        self.perturbation.release();
        self.change_phase_rate();
        self.leave_path();
        self.publish();
    }

    /// Returns the commanded rate: speed/τ, or that of an unlimited speed.
    pub(super) fn commanded_rate(&self) -> f64 {
        self.rate_at(self.conditions.tau)
    }

    /// Returns the rate of the speed for the time constant `tau`, or that of an unlimited speed.
    pub(super) fn rate_at(&self, tau: f64) -> f64 {
        if self.speed.is_infinite() { MAX_SPEED / self.primitive.tau() } else { self.speed / tau }
    }

    /// Checks and applies a command.
    fn set(&mut self, command: &Command) -> Result<()> {
        command.check(&self.primitive)?;
        self.apply(command);
        Ok(())
    }

    /// Applies a valid command. A repeated command has no effect.
    ///
    /// Commands before the first tick apply from the start; later ones resume a settled movement.
    pub(super) fn apply(&mut self, command: &Command) {
        let mut changes = Changes::default();
        let conditions = &mut self.conditions;
        if let Some(style) = command.style.filter(|style| *style != conditions.style) {
            conditions.style.copy_from_slice(style);
            changes.style = true;
        }
        if self.pose.is_some() {
            changes.centre = self.command_centre(command);
        } else if let Some(centre) = command.goal.or(command.anchor).filter(|centre| *centre != self.conditions.centre)
        {
            self.conditions.centre.copy_from_slice(centre);
            changes.centre = true;
        }
        let conditions = &mut self.conditions;
        let present = self.pose.as_ref().map_or(&conditions.goal_velocity, |pose| &pose.goal_velocity);
        if let Some(velocity) = command.goal_velocity
            && !(conditions.has_goal_velocity && velocity == present)
        {
            match &mut self.pose {
                Some(pose) => pose.goal_velocity.copy_from_slice(velocity),
                None => conditions.goal_velocity.copy_from_slice(velocity),
            }
            conditions.has_goal_velocity = true;
            changes.goal_velocity = true;
        }
        if self.pose.is_some() && self.conditions.has_goal_velocity && (changes.centre || changes.goal_velocity) {
            self.set_final_velocity();
            changes.goal_velocity = true;
        }
        let conditions = &mut self.conditions;
        if let Some(amplitude) = command.amplitude.filter(|amplitude| *amplitude != conditions.amplitude) {
            conditions.amplitude = amplitude;
            changes.amplitude = true;
        }
        if let Some(tau) = command.tau.filter(|tau| *tau != conditions.tau) {
            conditions.tau = tau;
            self.max_tau = self.max_tau.max(tau);
            self.rate.set_target(&[self.commanded_rate()], &self.rate_gains);
            changes.tau = true;
        }
        if changes == Changes::default() {
            return;
        }
        self.status = Status::Working;
        if self.started { self.govern(changes) } else { self.begin() }
    }

    /// Moves the targets of changed commands by a share of the distance to the commanded ones.
    pub(super) fn take_up(&mut self, changes: Changes, share: f64) {
        let gains = self.command_gains;
        if changes.style {
            self.style.move_target(&self.conditions.style, share, &gains);
        }
        if changes.centre {
            self.move_centre(share);
        }
        if changes.amplitude {
            self.amplitude.move_target(&[self.conditions.amplitude], share, &gains);
        }
        // Without transition, style and τ change the motion at once.
        if gains.is_immediate() {
            self.read_forcing();
            self.publish();
        }
        // The velocity at the end depends on style and τ.
        if (changes.centre && self.has_frame()) || self.approaching || changes.goal_velocity {
            self.start_goal_transition();
        }
    }

    /// Moves the target of the goal or anchor by a share of the distance to the commanded one, moved inside the limits.
    pub(super) fn move_centre(&mut self, share: f64) {
        let accepted = self.limiter.accept(&self.conditions.centre);
        if self.primitive.transport.is_immediate() {
            self.centre.move_target(accepted, share, &self.command_gains);
        } else {
            self.centre.move_target_only(accepted, share);
        }
        self.update_lengths();
    }
}

impl BitOr for Changes {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self {
            style: self.style | other.style,
            centre: self.centre | other.centre,
            goal_velocity: self.goal_velocity | other.goal_velocity,
            amplitude: self.amplitude | other.amplitude,
            tau: self.tau | other.tau,
        }
    }
}

/// Commands that have changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Changes {
    style: bool,
    /// Goal or anchor.
    centre: bool,
    goal_velocity: bool,
    amplitude: bool,
    tau: bool,
}

impl Changes {
    /// Commands that a governor may accept in part.
    pub(super) const PATH: Self = Self { style: true, centre: true, amplitude: true, goal_velocity: false, tau: false };
}
