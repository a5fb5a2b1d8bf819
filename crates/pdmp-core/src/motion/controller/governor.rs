//! Governor of commands: of a new style, goal, anchor or amplitude the largest share is accepted with which all of the movement
//! ahead keeps the limits.
//!
//! A copy of the controller takes the command up, and the path ahead of it is sampled (`path_ahead`). The command is accepted if
//! the present rate can be reduced in time and every position ahead lies inside its limits, or no farther outside than without
//! the command. Otherwise a half of it is tried at the next tick, and so on; what is left is tried again while the movement goes
//! on.

use super::Controller;
use super::path_ahead::PathAhead;
use super::setters::Changes;
use super::step::first_element;
use crate::error::Result;
use crate::kind::Kind;
use crate::motion::angular::AngularLimits;
use crate::motion::rate_limits::{PathLimits, RateLimits};
use crate::numerics::state::{Visitor, clone_in_place, visit_flag, visit_number};

/// Margins of velocity and acceleration along the path.
pub(super) const MARGINS: [f64; 2] = [0.005, 0.03];
/// Smallest share of a command that is tried.
const MIN_SHARE: f64 = 1.0 / 64.0;
/// Distance outside the limits of the position, relative to the range, that counts as rounding.
const TOLERANCE: f64 = 1e-9;

/// Path ahead, and the commands that are not yet accepted as a whole.
#[derive(Debug)]
pub(super) struct Governor {
    /// Limits along the path.
    pub(super) limits: PathLimits,
    pub(super) ahead: PathAhead,
    /// True if the limits determined the rate in the present tick.
    pub(super) slows: bool,
    /// Path ahead of `trial`.
    candidate: PathAhead,
    /// Controller whose path was sampled last.
    origin: Box<Controller>,
    /// Controller with a share of the command.
    trial: Box<Controller>,
    /// Copy of a controller that moves along its path.
    sampler: Box<Controller>,
    /// True if a part of a command is not yet accepted.
    pending: bool,
    /// Share of the rest of the command that is tried next.
    share: f64,
}

clone_in_place!(Governor { limits, ahead, slows, candidate, origin, trial, sampler, pending, share });

impl Governor {
    /// Returns a governor of a controller, which has none.
    fn new(controller: &Controller) -> Self {
        let (n_groups, n_rotations) = (controller.groups.len(), controller.limiter.turns.len());
        let copy = || Box::new(controller.clone());
        Self {
            limits: PathLimits { groups: Vec::with_capacity(n_groups), rotations: Vec::with_capacity(n_rotations) },
            ahead: PathAhead::new(n_groups, n_rotations),
            slows: false,
            candidate: PathAhead::new(n_groups, n_rotations),
            origin: copy(),
            trial: copy(),
            sampler: copy(),
            pending: false,
            share: 1.0,
        }
    }

    /// Samples the path ahead of a controller.
    fn look_ahead(&mut self, controller: &Controller) {
        (*self.origin).clone_from(controller);
        self.ahead.compute(controller, &mut self.sampler, &self.limits);
    }

    /// Samples the path ahead of a controller that takes up a share of the changes. Returns whether it can be followed.
    fn admits(&mut self, controller: &Controller, changes: Changes) -> bool {
        (*self.trial).clone_from(controller);
        self.trial.take_up(changes, self.share);
        self.candidate.compute(&self.trial, &mut self.sampler, &self.limits);
        let rate = first_element(controller.rate.value());
        let excess = |ahead: &PathAhead| (rate * rate / ahead.largest_square()).max(1.0);
        let outside = |ahead: &PathAhead| ahead.distance_outside(&controller.limiter.bounds, &controller.groups);
        excess(&self.candidate) <= excess(&self.ahead)
            && outside(&self.candidate) <= outside(&self.ahead).max(TOLERANCE)
    }
}

impl Controller {
    /// Puts a governor in force if the limits bound the rate of the path, and takes up what it did not accept if they no longer
    /// do. The first time it allocates memory for the path, which is kept.
    pub(super) fn limit_path(&mut self) {
        if !self.limiter.limits_rate() {
            let Some(mut governor) = self.governor.take() else { return };
            if std::mem::take(&mut governor.pending) {
                self.take_up(Changes::PATH, 1.0);
            }
            self.idle_governor = Some(governor);
            return;
        }
        let governor = self.governor.take().or_else(|| self.idle_governor.take());
        let mut governor = governor.unwrap_or_else(|| Box::new(Governor::new(self)));
        let PathLimits { groups, rotations } = &mut governor.limits;
        let [velocity, acceleration] = MARGINS.map(|margin| 1.0 - margin);
        groups.clear();
        groups.extend(
            self.limiter
                .bounds
                .iter()
                .map(|bounds| RateLimits::new(bounds.velocity * velocity, bounds.acceleration * acceleration)),
        );
        rotations.clear();
        rotations.extend(self.limiter.turns.iter().map(|turn| AngularLimits {
            velocity: turn.limits.velocity * velocity,
            acceleration: turn.limits.acceleration * acceleration,
        }));
        self.governor = Some(governor);
    }

    /// Samples the path ahead under the present commands.
    pub(super) fn look_ahead(&mut self) {
        let Some(mut governor) = self.governor.take() else { return };
        governor.look_ahead(self);
        self.governor = Some(governor);
    }

    /// Looks ahead at the start, and reduces the rate there to what the path ahead admits. A given velocity is kept.
    pub(super) fn start_rate(&mut self) {
        self.look_ahead();
        let Some(governor) = &mut self.governor else { return };
        governor.pending = false;
        let rate = first_element(self.rate.value());
        let admitted = governor.ahead.largest_square().sqrt();
        if self.conditions.velocity.is_none() && admitted < rate {
            self.rate.start(admitted, &self.rate_gains);
            self.read_out();
        }
    }

    /// Marks the path ahead as left.
    pub(super) fn leave_path(&mut self) {
        if let Some(governor) = &mut self.governor {
            governor.ahead.leave();
        }
    }

    /// Samples the path ahead again if necessary, and tries again to accept a command.
    #[inline(always)]
    pub(super) fn refresh_path(&mut self) {
        if self.governor.is_some() {
            self.refresh_governed_path();
        }
    }

    /// Samples the path ahead again as [`Controller::refresh_path`]. It stays a call, so that the tick of a free movement stays
    /// small.
    #[inline(never)]
    fn refresh_governed_path(&mut self) {
        let Some(governor) = &self.governor else { return };
        let rhythmic = self.primitive.kind() == Kind::Rhythmic;
        let is_due = governor.ahead.is_due(first_element(self.rate.target()), rhythmic);
        let tries = governor.pending && (governor.share < 1.0 || governor.ahead.has_progressed());
        if tries && self.accept(Changes::PATH) {
            return;
        }
        if is_due {
            self.look_ahead();
        }
    }

    /// Takes up changed commands, as far as the limits admit.
    pub(super) fn govern(&mut self, changes: Changes) {
        // An immediate switch leaves no path to follow.
        let Some(governor) = self.governor.as_mut().filter(|_| !self.command_gains.is_immediate()) else {
            self.take_up(changes, 1.0);
            return self.look_ahead();
        };
        let changes = if governor.pending { changes | Changes::PATH } else { changes };
        (governor.pending, governor.share) = (true, 1.0);
        self.accept(changes);
    }

    /// Accepts a share of changed commands if the path ahead can then be followed. Returns whether it does.
    ///
    /// Otherwise half of it is tried at the next tick, down to the smallest share, and from an accepted one on twice as much of
    /// the rest. The rest as a whole is tried when the movement has gone on.
    #[inline(never)]
    fn accept(&mut self, changes: Changes) -> bool {
        let Some(mut governor) = self.governor.take() else { return false };
        let accepted = governor.admits(self, changes);
        if accepted {
            self.take_up(changes, governor.share);
            std::mem::swap(&mut governor.ahead, &mut governor.candidate);
            std::mem::swap(&mut governor.origin, &mut governor.trial);
            governor.pending = governor.share < 1.0;
            governor.share = (2.0 * governor.share).min(1.0);
        } else {
            governor.share *= 0.5;
            if governor.share < MIN_SHARE {
                governor.share = 1.0;
                governor.look_ahead(self);
            }
        }
        self.governor = Some(governor);
        accepted
    }

    /// Returns whether a part of a commanded style, goal, anchor or amplitude is not yet accepted, as the movement ahead would
    /// leave its limits with it.
    pub fn is_pending(&self) -> bool {
        self.governor.as_ref().is_some_and(|governor| governor.pending)
    }

    /// Visits the state of the governor. The path ahead follows from the controller that it was sampled for.
    pub(super) fn walk_governor(&mut self, visit: &mut Visitor) -> Result<()> {
        self.limit_path();
        let Some(governor) = &mut self.governor else { return Ok(()) };
        governor.origin.walk_motion(visit)?;
        let mut position = governor.ahead.position;
        position.walk(visit)?;
        governor.ahead.compute(&governor.origin, &mut governor.sampler, &governor.limits);
        governor.ahead.position = position;
        visit_flag(visit, &mut governor.pending)?;
        visit_number(visit, &mut governor.share, [MIN_SHARE, 1.0])
    }
}
