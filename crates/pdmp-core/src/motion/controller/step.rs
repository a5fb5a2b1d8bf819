//! One tick of the control loop.

use super::group::{ForcingSample, Gate, Group, add_frame_motion};
use super::substeps::{MAX_SUBSTEPS, ROUNDING};
use super::{Controller, Status};
use crate::dynamics::canonical::{Canonical, CompensatedSum, amplitude, faded};
use crate::dynamics::forcing_table::Fade;
use crate::dynamics::output_system::{CubicSample, State};
use crate::dynamics::transport::TransportSample;
use crate::error::{Error, Result};
use crate::motion::perturbation::PerturbationTerms;
use crate::numerics::simd::{F64x4, Kernel, Register, compute, flush, unpack};

/// Maximum length of a tick, in units of τ.
const MAX_TICK: f64 = 1000.0;

impl Controller {
    /// Checks that a tick is not too long for the present rate and the commanded one.
    pub(in crate::motion) fn check_tick_length(&self, dt: f64, tau: Option<f64>) -> Result<()> {
        let commanded = tau.map_or(first_element(self.rate.target()), |tau| self.rate_at(tau));
        let max_rate = if !self.started {
            commanded.max(self.initial_rate(tau.unwrap_or(self.conditions.tau)))
        } else if self.command_gains.is_immediate() {
            commanded
        } else {
            commanded.max(first_element(self.rate.value()))
        };
        if dt * max_rate > MAX_TICK {
            return Err(Error::Range { name: "dt", value: dt, allowed: "must not exceed 1000 tau" });
        }
        Ok(())
    }

    /// Performs one tick of `dt` seconds and `h` on the clock, in substeps that cubics describe.
    pub(super) fn tick(&mut self, dt: f64, h: f64) -> Status {
        self.started = true;
        let rate = first_element(self.rate.value());
        let mut substeps = h / self.max_clock_step;
        if !self.are_commands_settled() {
            substeps = substeps.max(self.command_gains.substeps(h));
        }
        if !self.rate.is_settled() {
            substeps = substeps.max(self.rate_gains.substeps(dt));
        }
        if substeps <= 1.0 {
            self.substep(dt, h);
        } else {
            let n_substeps = substeps.ceil().min(MAX_SUBSTEPS);
            for _ in 0..n_substeps as u32 {
                let h = self.clock_step(dt / n_substeps);
                self.substep(dt / n_substeps, h);
            }
        }
        self.time.add(dt);
        if self.limiter.is_active() {
            self.enforce_limits(dt, h, rate);
        }
        // The style's transition and perturbations change the arrival that the final velocity compensates for.
        if self.approaching && !(self.style.is_settled() && self.perturbation.terms().is_none()) {
            self.correct_arrival();
        }
        // A settled movement remains settled until it is perturbed or commanded.
        if self.status == Status::Working || self.perturbation.terms().is_some() {
            let past = self.primitive.forcing_table().is_past(self.clock.value());
            self.status = if past { self.settled() } else { Status::Working };
        }
        // Limits have converted the motion already.
        if !self.limiter.is_active() {
            self.publish_pose();
        }
        self.status
    }

    /// Returns the clock interval of the next `dt` seconds, ∫ρ dt.
    #[inline(always)]
    pub(super) fn clock_step(&mut self, dt: f64) -> f64 {
        if let Some(governor) = &self.governor {
            self.rate_slope = None;
            if !self.admits_rate(governor)
                && let Some(h) = self.limit_rate(dt)
            {
                return h;
            }
        }
        if self.rate.is_settled() {
            return first_element(self.rate.value()) * dt;
        }
        self.update_rate_step(dt);
        // The integral is positive but for rounding.
        self.rate.integral(&self.rate_step).max(0.0)
    }

    /// Computes the filter step of the rate for `dt` seconds, unless the last one had that length.
    pub(super) fn update_rate_step(&mut self, dt: f64) {
        if dt != self.rate_step.dt() {
            self.rate_step = self.rate_gains.step_with_integral(dt);
        }
    }

    /// Computes the filter steps of commands in transition for a clock interval `h`, unless the last ones had that length.
    #[inline(always)]
    fn update_command_steps(&mut self, h: f64) {
        if !self.are_commands_settled() && h != self.command_step.dt() {
            self.command_step = self.command_gains.step(h);
        }
    }

    /// Returns whether style, centre and amplitude rest on their targets.
    #[inline(always)]
    pub(super) fn are_commands_settled(&self) -> bool {
        self.style.is_settled() && self.centre.is_settled() && self.amplitude.is_settled()
    }

    /// Advances by `dt` seconds and `h` on the clock.
    #[inline(always)]
    pub(super) fn substep(&mut self, dt: f64, h: f64) {
        if self.rate_slope.is_some() {
            return self.limited_substep(dt, h);
        }
        self.free_substep(dt, h);
    }

    /// Advances by `dt` seconds and `h` on the clock, split at u_end, where the forcing has a kink.
    #[inline(always)]
    pub(super) fn free_substep(&mut self, dt: f64, h: f64) {
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else {
            return self.advance(dt, h);
        };
        let (remaining, advance) = (u_end - self.clock.value(), self.perturbation.phase_rate() * h);
        // The substep that ends at u_end up to rounding is one that reaches it.
        if remaining <= 0.0 || remaining > advance * (1.0 + ROUNDING) {
            self.advance(dt, h);
            return self.end_goal_transition();
        }
        let before = self.time_to(remaining / self.perturbation.phase_rate(), dt);
        // A remainder of rounding, where the last substep ended at u_end, is skipped.
        if remaining > ROUNDING * advance {
            let h = self.clock_step(before);
            self.advance(before, h);
        }
        self.clock = CompensatedSum::at(u_end);
        self.end_goal_transition();
        self.read_frame();
        self.read_forcing();
        let h = self.clock_step(dt - before);
        self.advance(dt - before, h);
    }

    /// Advances by `dt` seconds and `h` on the clock.
    #[inline(always)]
    pub(super) fn advance(&mut self, dt: f64, h: f64) {
        if h <= 0.0 {
            return self.pause(dt);
        }
        compute(Advance { controller: self, dt, h });
    }

    /// Advances the rate alone, in a pause.
    fn pause(&mut self, dt: f64) {
        self.advance_rate::<F64x4>(dt);
        self.perturbation.clear_terms();
        self.read_out();
    }

    /// Advances by `dt` seconds and `h` > 0 on the clock, in registers of type `T`.
    #[inline(always)]
    pub(super) fn advance_with<T: Register>(&mut self, dt: f64, h: f64) {
        self.update_command_steps(h);
        if h != self.propagator.step() {
            self.propagator = self.series.propagator::<T>(h);
        }
        let demonstrated = !self.primitive.forcing_table().is_past(self.clock.value());
        let inputs = self.perturbation.terms().map(|_| self.unit_inputs());
        if self.perturbation.phase_rate() != self.forcing_phase_rate {
            self.change_phase_rate();
        }
        self.style.advance::<T>(&self.command_step);
        self.advance_rate::<T>(dt);
        let moving = self.centre.begin_step(&self.command_step);
        let phase_step = self.perturbation.phase_rate() * h;
        self.clock.add(phase_step);
        if let Some(governor) = &mut self.governor {
            governor.ahead.advance(phase_step);
        }
        if let Canonical::Rhythmic { mu } = self.primitive.canonical() {
            self.clock.wrap();
            self.r = if self.amplitude.is_settled() {
                amplitude(mu, self.r, self.conditions.amplitude, h)
            } else {
                let r = faded(self.command_gains.first_order_response(&self.amplitude, self.r, mu, h));
                self.amplitude.advance::<T>(&self.command_step);
                r
            };
        }
        if !self.transport_segment.reaches(self.clock.value()) {
            self.transport_segment = self.primitive.transport.segment_at(self.clock.value());
        }
        let TransportSample { value, slope, bend } = self.transport_segment.lag(self.clock.value());
        let lags = [std::mem::replace(&mut self.frame_lag, value), value];
        let frame_slopes = self.frame_slopes(slope, bend);
        // At u_end the substep that reaches it takes the slopes from the demonstrated side.
        let fade = if demonstrated { None } else { self.primitive.forcing_table().fade(self.clock.value()) };
        let gate = self.faded_gate(fade);

        let (primitive, propagator) = (&*self.primitive, &self.propagator);
        let (forcing_table, attractor, clock) = (primitive.forcing_table(), primitive.attractor(), self.clock.value());
        let table_index = forcing_table.faded_index(clock, fade);
        let style = unpack(self.style.value(), primitive.n_styles());
        let style_rate = (!self.style.is_settled()).then(|| unpack(self.style.rate(), primitive.n_styles()));
        let additional = self.conditions.forcing.as_deref();
        let (transition, gate_phase_rate) = (self.goal_transition.is_active(), self.perturbation.phase_rate());
        let (n, flush_level, centre) = (self.groups.len(), T::splat(self.flush_level), &mut self.centre);
        let (position, velocity, acceleration) =
            (&mut self.position[..n], &mut self.velocity[..n], &mut self.acceleration[..n]);
        for (index, group) in self.groups.iter_mut().enumerate() {
            let from = CubicSample { value: T::load(&group.w.value), slope: T::load(&group.w.slope) };
            group.forcing = ForcingSample::read::<T>(forcing_table, table_index, index, style, style_rate);
            let to = gate.forcing::<T>(&group.forcing);
            group.w = CubicSample { value: to.value.store(), slope: to.slope.store() };

            let (goal, displacement) = (T::load(&centre.value()[index]), T::load(&group.displacement));
            let (mut start, mut origin) = (goal + displacement * lags[0], goal + displacement * lags[1]);
            let mut w = add_frame_motion(to, displacement, frame_slopes);
            if transition {
                let frame = self.goal_transition.sample::<T>(index, clock);
                start = start + T::load(&self.goal_transition.value[index]);
                origin = origin + frame.value;
                self.goal_transition.value[index] = frame.value.store();
                let motion = frame.motion(gate_phase_rate);
                w = CubicSample { value: w.value + motion.value, slope: w.slope + motion.slope };
            }
            let mut shift = T::default();
            if let Some(additional) = additional {
                let frame = additional.sample::<T>(index, clock);
                start = start + T::load(&group.shift);
                shift = frame.value;
                group.shift = shift.store();
                let motion = frame.motion(gate_phase_rate);
                w = CubicSample { value: w.value + motion.value, slope: w.slope + motion.slope };
            }
            let state = State { e: T::load(&position[index]) - start, z: T::load(&group.z) };
            let mut next = propagator.advance(state, [from, to]);
            let mut y = origin + next.e;
            if moving {
                let before = CubicSample { value: T::default(), slope: T::load(&centre.rate()[index]) };
                let [new_goal, slope] = centre.advance_group::<T>(index, &self.command_step);
                let response = propagator.follow([before, CubicSample { value: new_goal - goal, slope }]);
                y = y + response.e;
                origin = new_goal + displacement * lags[1];
                next.z = next.z + response.z;
            }
            if additional.is_some() {
                (y, origin) = (y + shift, origin + shift);
            }
            let (y, z) = (flush(y, flush_level), flush(next.z, flush_level));
            (position[index], group.z) = (y.store(), z.store());
            let [y_dot, y_ddot] = gate.motion(attractor, State { e: y - origin, z }, w);
            (velocity[index], acceleration[index]) = (y_dot.store(), y_ddot.store());
        }
        forcing_table.prefetch(clock + self.prefetch_ticks * self.perturbation.phase_rate() * h);
        if let Some(inputs) = inputs {
            self.add_perturbation(inputs);
            self.read_out();
        }
    }

    /// Returns the gate at the clock, at u_end with the slope past the end.
    #[inline(always)]
    pub(super) fn gate(&self) -> Gate {
        self.faded_gate(self.primitive.forcing_table().fade(self.clock.value()))
    }

    /// Returns the gate past the end, or that of the demonstrated interval.
    #[inline(always)]
    fn faded_gate(&self, fade: Option<Fade>) -> Gate {
        let demonstrated = self.demonstrated_gate();
        match fade {
            Some(Fade { r, r_slope, p_slope, .. }) => {
                let phase_rate = self.perturbation.phase_rate();
                Gate { r, r_slope: phase_rate * r_slope, phase_rate: phase_rate * p_slope, ..demonstrated }
            }
            None => demonstrated,
        }
    }

    /// Returns the gate of the demonstrated interval.
    #[inline(always)]
    fn demonstrated_gate(&self) -> Gate {
        let (r, rate) = (self.r, [self.rate.value(), self.rate.rate()].map(first_element));
        let r_slope = match self.primitive.canonical() {
            Canonical::Discrete { .. } => 0.0,
            Canonical::Rhythmic { mu } => mu * (first_element(self.amplitude.value()) - r),
        };
        Gate { r, r_slope, phase_rate: self.perturbation.phase_rate(), rate }
    }

    /// Returns m′ and m″ on the clock of the output system from those on the clock of the phase.
    #[inline(always)]
    fn frame_slopes(&self, slope: f64, bend: f64) -> [f64; 2] {
        let phase_rate = self.perturbation.phase_rate();
        [slope * phase_rate, bend * (phase_rate * phase_rate)]
    }

    /// Evaluates the frame after the clock was set.
    pub(super) fn read_frame(&mut self) {
        self.transport_segment = self.primitive.transport.segment_at(self.clock.value());
        self.frame_lag = self.transport_segment.lag(self.clock.value()).value;
        for index in 0..self.groups.len() {
            self.groups[index].shift = self.additional_frame(index).value;
        }
    }

    /// Evaluates the forcing after clock or style was set.
    pub(super) fn read_forcing(&mut self) {
        let primitive = &self.primitive;
        let table_index = primitive.forcing_table().index(self.clock.value());
        let [style, style_rate] =
            [self.style.value(), self.style.rate()].map(|style| unpack(style, primitive.n_styles()));
        for (index, group) in self.groups.iter_mut().enumerate() {
            let forcing_table = primitive.forcing_table();
            group.forcing = ForcingSample::read::<F64x4>(forcing_table, table_index, index, style, Some(style_rate));
        }
        self.update_forcing();
    }

    /// Computes w and w′ for a phase rate κ that has changed since the last tick.
    ///
    /// The frame then moves with another velocity κc′: z takes up the difference, so that the velocity stays continuous and
    /// the attractor follows the frame.
    pub(super) fn change_phase_rate(&mut self) {
        let change = self.forcing_phase_rate - self.perturbation.phase_rate();
        self.take_up_drift(change);
        self.add_additional_slope(change);
        if self.has_frame() {
            let TransportSample { slope, .. } = self.primitive.transport.lag(self.clock.value());
            for (index, group) in self.groups.iter_mut().enumerate() {
                let frame = self.goal_transition.sample::<F64x4>(index, self.clock.value());
                group.z += (group.displacement * slope + frame.slope) * change;
            }
        }
        self.update_forcing();
    }

    /// Computes w and w′ at the clock for the present phase rate.
    fn update_forcing(&mut self) {
        self.forcing_phase_rate = self.perturbation.phase_rate();
        let gate = self.gate();
        self.groups.iter_mut().for_each(|group| group.w = gate.forcing(&group.forcing));
    }

    /// Computes velocity and acceleration of the present state.
    pub(super) fn read_out(&mut self) {
        let (gate, attractor) = (self.gate(), self.primitive.attractor());
        let TransportSample { value, slope, bend } = self.primitive.transport.lag(self.clock.value());
        let frame_slopes = self.frame_slopes(slope, bend);
        for (index, &Group { forcing, displacement, z, .. }) in self.groups.iter().enumerate() {
            let frame = self.goal_transition.sample::<F64x4>(index, self.clock.value());
            let motion = frame.motion(self.perturbation.phase_rate());
            let mut w = add_frame_motion(gate.forcing(&forcing), displacement, frame_slopes);
            w = CubicSample { value: w.value + motion.value, slope: w.slope + motion.slope };
            let additional = self.additional_frame(index);
            let motion = additional.motion(self.perturbation.phase_rate());
            w = CubicSample { value: w.value + motion.value, slope: w.slope + motion.slope };
            let frame = self.centre.value()[index] + displacement * value + frame.value + additional.value;
            let e = self.position[index] - frame;
            [self.velocity[index], self.acceleration[index]] = gate.motion(attractor, State { e, z }, w);
        }
        if let Some(PerturbationTerms { velocity, acceleration }) = self.perturbation.terms() {
            let ([tau, slope], [rate, rate_change]) = (self.coupling_tau(), gate.rate);
            // c_v adds c_v·ρτ to the velocity, and its derivative to the acceleration.
            let (fade, change) = (rate * tau, rate_change * tau + rate * rate * slope);
            for group in 0..self.groups.len() {
                self.velocity[group] += velocity[group] * fade;
                self.acceleration[group] += acceleration[group] * (fade * fade) + velocity[group] * change;
            }
        }
    }
}

/// Kernel of [`Controller::advance`].
struct Advance<'a> {
    controller: &'a mut Controller,
    dt: f64,
    h: f64,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        self.controller.advance_with::<T>(self.dt, self.h);
    }
}

/// Returns the first command of a filter, or its only one.
pub(super) fn first_element(lanes: &[F64x4]) -> f64 {
    lanes[0].as_array()[0]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use ndarray::Array2;

    use super::*;
    use crate::{Conditions, Demonstration, FitOptions, Kind, Sampling, fit};

    /// AVX2 and portable registers yield the same motion to the last bit.
    #[test]
    fn motion_does_not_depend_on_the_register_width() {
        let reach = |h: f64| {
            let position = Array2::from_shape_fn((101, 6), |(c, d)| {
                let s = c as f64 / 100.0;
                s * s * (3.0 - 2.0 * s) + h * (d as f64 * s).sin() * s * (1.0 - s)
            });
            Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
        };
        let demos = [0.0, 0.4, 1.0].map(reach);
        let options =
            FitOptions::new(Kind::Discrete).basis(crate::learning::regression::Basis::NGnet(Default::default()));
        let model = Arc::new(fit(&demos, &options).unwrap());
        let mut any = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        any.step().unwrap();
        any.set_goal(&[0.3; 6]).unwrap();
        any.set_tau(0.8).unwrap();
        any.set_style(&vec![0.5; any.primitive.n_styles()]).unwrap();
        let mut four = any.clone();
        for _ in 0..1500 {
            let h = any.clock_step(1e-3);
            any.advance(1e-3, h);
            four.clock_step(1e-3);
            four.advance_with::<F64x4>(1e-3, h);
            assert_eq!(any.position(), four.position());
            assert_eq!(any.acceleration(), four.acceleration());
        }
    }
}
