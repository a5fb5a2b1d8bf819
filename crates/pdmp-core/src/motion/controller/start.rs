//! Start of a movement.

use super::group::Group;
use super::step::first_element;
use super::{Controller, Status};
use crate::dynamics::canonical::CompensatedSum;
use crate::dynamics::output_system::State;
use crate::error::Result;
use crate::kind::Kind;
use crate::model::conditions::Conditions;
use crate::motion::perturbation::largest_range;
use crate::numerics::simd::{F64x4, WIDTH, padded, repack};

/// Peak velocity of a movement of minimum jerk, relative to range / duration.
const MINIMUM_JERK_PEAK: f64 = 1.875;
/// Peak velocity of a sine, relative to range / period.
const SINE_PEAK: f64 = std::f64::consts::PI;
/// Rounding error of a velocity at the start, relative to it and to that of one range per τ.
const ROUNDING: f64 = 1e-9;

impl Controller {
    /// Restarts the movement under other conditions.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// controller.step()?;
    /// controller.reset(&Conditions { goal: Some(vec![0.8, 0.0]), ..Conditions::default() })?;
    /// assert_eq!((controller.time(), controller.centre()), (0.0, [0.8, 0.0].as_slice()));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Controller::new`]. The movement then remains unchanged.
    pub fn reset(&mut self, conditions: &Conditions) -> Result<()> {
        self.conditions = conditions.complete(&self.primitive)?;
        self.keep_final_velocity(conditions);
        self.begin();
        Ok(())
    }

    /// Sets clock, commands and state to the start of the movement.
    pub(super) fn begin(&mut self) {
        self.started = false;
        self.status = Status::Working;
        self.perturbation.clear();
        self.limiter.clear();
        (self.time, self.clock) = (CompensatedSum::default(), CompensatedSum::default());
        let rate = self.commanded_rate();
        let conditions = &self.conditions;
        self.max_tau = conditions.tau;
        self.r = conditions.amplitude;
        self.style.reset(&conditions.style);
        self.rate.reset(&[rate]);
        self.amplitude.reset(&[conditions.amplitude]);
        // A rhythmic movement starts where its commanded anchor places it, and moves to the anchor within the limits.
        let rhythmic = self.primitive.kind() == Kind::Rhythmic;
        self.centre.reset(if rhythmic { &conditions.centre } else { self.limiter.accept(&conditions.centre) });
        if let (Kind::Discrete, Some(start)) = (self.primitive.kind(), &conditions.start) {
            for ((group, goal), start) in self.groups.iter_mut().zip(self.centre.value()).zip(start.chunks(WIDTH)) {
                group.displacement = *goal - padded(start);
            }
        }
        self.goal_transition.clear();
        self.approaching = false;
        self.read_frame();
        self.read_forcing();
        self.set_initial_state();
        if rhythmic && self.changes_centre() {
            self.move_centre(1.0);
        }
        if self.conditions.has_goal_velocity {
            self.start_goal_transition();
        }
        self.update_lengths();
        self.read_out();
        self.start_rate();
        self.begin_first_tick();
        self.publish_pose();
        self.begin_turns();
    }

    /// Sets the motion from which the first tick begins to the present one.
    ///
    /// A DoF with a limit of the jerk begins without acceleration, or with the present one if it goes on from the present
    /// position and velocity.
    pub(super) fn begin_first_tick(&mut self) {
        let rate = first_element(self.rate.value());
        for index in 0..self.groups.len() {
            let (position, velocity) = (self.position[index], self.velocity[index]);
            let [y, v, present] = self.limiter.before[index];
            let rounding = (v.abs() + self.groups[index].range * rate) * ROUNDING;
            let goes_on = position.simd_eq(y) & (velocity - v).abs().simd_le(rounding);
            let first = goes_on.select(present, F64x4::ZERO);
            let limited = self.limiter.jerk_limited(index);
            self.acceleration[index] = limited.select(first, self.acceleration[index]);
            self.limiter.before[index] = [position, velocity, limited.select(first, F64x4::ZERO)];
        }
    }

    /// Returns the rate ρ at the start of a movement with the time constant `tau`: that of the speed, but for a given velocity
    /// ẏ = ρy′ no less than the rate at which it is as large as the peak of a smooth movement over the demonstrated range, up to
    /// 1/τ.
    ///
    /// At a lower rate y′ would exceed that of every movement, without bound in a pause, and with it the way to rest and the
    /// velocity once the speed rises again. The rate then falls to that of the speed as after a change of it.
    pub(super) fn initial_rate(&self, tau: f64) -> f64 {
        let Some(velocity) = &self.conditions.velocity else { return self.rate_at(tau) };
        if self.speed.is_infinite() {
            return tau.recip();
        }
        let largest = largest_range(self.primitive.ranges());
        let extent = self.primitive.duration() / self.primitive.tau();
        let peak = if self.primitive.kind() == Kind::Discrete { MINIMUM_JERK_PEAK } else { SINE_PEAK };
        let share = |(group, velocity): (&Group, &[f64])| {
            let length = group.length_at(F64x4::ZERO, largest);
            let shares = padded(velocity).abs() * (extent * peak.recip()) / length;
            shares.to_array().into_iter().fold(0.0, f64::max)
        };
        let least = self.groups.iter().zip(velocity.chunks(WIDTH)).map(share).fold(0.0, f64::max);
        self.rate_at(tau).max(least.min(tau.recip()))
    }

    /// Sets position and z at the start: z = 0 for a discrete movement, the limit cycle of the style for a rhythmic one.
    fn set_initial_state(&mut self) {
        let Self { primitive, conditions, r, .. } = self;
        for (index, (position, group)) in self.position.iter_mut().zip(&mut self.groups).enumerate() {
            let cycle = &primitive.cycle[index * primitive.n_styles()..];
            let on_cycle = conditions.style.iter().zip(cycle).fold(State::<F64x4>::default(), |sum, (s, cycle)| {
                State { e: sum.e + cycle.e * (*r * s), z: sum.z + cycle.z * (*r * s) }
            });
            *position = self.centre.value()[index] + on_cycle.e + group.shift;
            group.z = on_cycle.z;
        }
        let phase = conditions.phase;
        if phase > 0.0 {
            // The limit cycle is known at phase 0 only, and is followed from there.
            let substeps = (phase / self.max_clock_step).ceil();
            (0..substeps as u32).for_each(|_| self.advance(self.dt, phase / substeps));
            self.clock = CompensatedSum::at(phase);
            self.read_forcing();
        }
        let rate = self.initial_rate(self.conditions.tau);
        if rate != self.commanded_rate() {
            self.rate.start(rate, &self.rate_gains);
        }
        // Without motion along the path, the rate of τ stands for one of zero.
        let tau = if rate > 0.0 { rate.recip() } else { self.conditions.tau };
        let Self { conditions, r, .. } = self;
        if let Some(start) = &conditions.start {
            repack(&mut self.position, start);
        }
        if let Some(velocity) = &conditions.velocity {
            for (group, velocity) in self.groups.iter_mut().zip(velocity.chunks(WIDTH)) {
                group.z = padded(velocity) * tau - group.forcing.value * *r;
            }
        }
        if conditions.velocity.is_some() {
            self.add_additional_slope(-1.0);
        }
        let Self { conditions, .. } = self;
        if let Some(drift) = &conditions.drift {
            for (group, drift) in self.groups.iter_mut().zip(drift.chunks(WIDTH)) {
                group.z -= padded(drift);
            }
        }
    }
}
