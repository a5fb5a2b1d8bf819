//! One tick.

use super::group::{Forcing, Gate, Group, carried};
use super::{Controller, Status};
use crate::dynamics::canonical::{Canonical, CompensatedSum, amplitude, faded};
use crate::dynamics::forcing_table::Fade;
use crate::dynamics::output_system::{Attractor, CubicSample, State};
use crate::dynamics::transport::Lag;
use crate::error::{Error, Result};
use crate::motion::perturbation::PerturbationTerms;
use crate::numerics::simd::{F64x4, Register, flush, unpack};

/// Most pieces of a tick; a longer one is still stable, only less exact.
const MAX_PIECES: f64 = 1000.0;
/// Lowest rate, relative to the nominal one, at which terms of the user's own act in full.
const MIN_RATE: f64 = 1e-6;
/// Longest tick, in units of τ.
const MAX_TICK: f64 = 1000.0;

impl Controller {
    /// Checks that a tick is not too long for the rates at which it starts and to which it goes.
    pub(super) fn check_length(&self, dt: f64, tau: Option<f64>) -> Result<()> {
        let commanded = tau.map_or(first(self.rate.target()), |tau| self.speed / tau);
        let at_once = !self.started || self.filter.immediate();
        let fastest = if at_once { commanded } else { commanded.max(first(self.rate.value())) };
        if dt * fastest > MAX_TICK {
            return Err(Error::Range { name: "dt", value: dt, allowed: "must not exceed 1000 tau" });
        }
        Ok(())
    }

    /// One tick of `dt` seconds, `h` on the clock.
    pub(super) fn tick(&mut self, dt: f64, h: f64) -> Status {
        self.started = true;
        let mut parts = h / self.finest;
        if !(self.style.settled() && self.amplitude.settled()) {
            parts = parts.max(self.filter.parts(h));
        }
        if !self.centre.settled() {
            parts = parts.max(self.centre_filter.parts(h));
        }
        if !self.rate.settled() {
            parts = parts.max(self.rate_filter.parts(dt));
        }
        if parts <= 1.0 {
            self.piece(dt, h);
        } else {
            let pieces = parts.ceil().min(MAX_PIECES);
            for _ in 0..pieces as u32 {
                let h = self.stretch(dt / pieces);
                self.piece(dt / pieces, h);
            }
        }
        self.time.add(dt);
        // What has settled stays settled, unless it is pushed or commanded.
        if self.status == Status::Working || self.held.push().is_some() {
            let past = self.primitive.forcing_table().is_past(self.clock.value());
            self.status = if past { self.settled() } else { Status::Working };
        }
        self.status
    }

    /// The stretch of the clock that `dt` seconds from now on cover.
    #[inline(always)]
    pub(super) fn stretch(&mut self, dt: f64) -> f64 {
        if self.rate.settled() {
            return first(self.rate.value()) * dt;
        }
        self.measure(dt);
        self.rate.integral(&self.glide)
    }

    /// Gets the filter of the rate ready for `dt` seconds.
    fn measure(&mut self, dt: f64) {
        if dt != self.glide.dt() {
            self.glide = self.rate_filter.glide(dt);
        }
    }

    /// Gets the filters on the clock that are at work ready for a stretch `h` of it.
    #[inline(always)]
    fn measure_clock(&mut self, h: f64) {
        if !(self.style.settled() && self.amplitude.settled()) && h != self.course.dt() {
            self.course = self.filter.pass(h);
        }
        if !self.centre.settled() && h != self.centre_course.dt() {
            self.centre_course = self.centre_filter.pass(h);
        }
    }

    /// Moves on by `dt` seconds, `h` on the clock, stopping at the demonstrated end, where the forcing has a kink.
    #[inline(always)]
    fn piece(&mut self, dt: f64, h: f64) {
        let Canonical::Discrete { u_end, .. } = self.primitive.canonical() else {
            return self.advance(dt, h);
        };
        let (left, way) = (u_end - self.clock.value(), self.held.pace() * h);
        // A tick that ends here but for rounding is one that does.
        if left <= 0.0 || left > way * (1.0 + 1e-9) {
            return self.advance(dt, h);
        }
        let before = self.rate.time_to(left / self.held.pace(), dt, &self.rate_filter);
        // What rounding left of a tick that should have ended here is not worth a piece of its own.
        if left > 1e-9 * way {
            let h = self.stretch(before);
            self.advance(before, h);
        }
        self.clock = CompensatedSum::at(u_end);
        self.read_frame();
        self.read_forcing();
        let h = self.stretch(dt - before);
        self.advance(dt - before, h);
    }

    /// Moves on by `dt` seconds, `h` on the clock.
    #[inline(always)]
    pub(super) fn advance(&mut self, dt: f64, h: f64) {
        if h <= 0.0 {
            return self.pause(dt);
        }
        #[cfg(target_arch = "x86_64")]
        if super::avx::advance(self, dt, h) {
            return;
        }
        self.advance_anywhere(dt, h);
    }

    /// A pause: nothing moves but the rate.
    fn pause(&mut self, dt: f64) {
        self.measure(dt);
        self.rate.advance::<F64x4>(&self.glide);
        self.held.rest();
        self.read_out();
    }

    /// Moves on as any processor can. A call of its own, so that [`Controller::advance`] stays small.
    #[inline(never)]
    fn advance_anywhere(&mut self, dt: f64, h: f64) {
        self.advance_in::<F64x4>(dt, h);
    }

    /// The same in registers of one kind.
    #[inline(always)]
    pub(super) fn advance_in<T: Register>(&mut self, dt: f64, h: f64) {
        self.measure(dt);
        self.measure_clock(h);
        if h != self.propagator.step() {
            self.propagator = self.series.propagator::<T>(h);
        }
        let demonstrated = !self.primitive.forcing_table().is_past(self.clock.value());
        let levers = self.held.push().map(|_| self.levers());
        if self.held.pace() != self.paced {
            self.open_gate();
        }
        self.style.advance::<T>(&self.course);
        self.rate.advance::<T>(&self.glide);
        let moving = self.centre.elapse(&self.centre_course);
        self.clock.add(self.held.pace() * h);
        if let Canonical::Rhythmic { mu } = self.primitive.canonical() {
            self.clock.wrap();
            self.r = if self.amplitude.settled() {
                amplitude(mu, self.r, self.conditions.amplitude, h)
            } else {
                let r = faded(self.filter.lag(&self.amplitude, self.r, mu, h));
                self.amplitude.advance::<T>(&self.course);
                r
            };
        }
        if !self.stretch.reaches(self.clock.value()) {
            self.stretch = self.primitive.transport.stretch(self.clock.value());
        }
        let Lag { value, slope, bend } = self.stretch.lag(self.clock.value());
        let lags = [std::mem::replace(&mut self.lag, value), value];
        let carry = self.carry(slope, bend);
        // A piece that reaches u_end has the slopes of the demonstrated side at both its ends.
        let after = if demonstrated { self.gate_within() } else { self.gate() };

        let (primitive, propagator) = (&*self.primitive, &self.propagator);
        let (forcing_table, attractor, clock) = (primitive.forcing_table(), primitive.attractor(), self.clock.value());
        let place = if demonstrated { forcing_table.place_within(clock) } else { forcing_table.place(clock) };
        let style = unpack(self.style.value(), primitive.n_styles());
        let swing = (!self.style.settled()).then(|| unpack(self.style.rate(), primitive.n_styles()));
        let (n, rest, centre) = (self.groups.len(), T::splat(self.rest), &mut self.centre);
        let (position, velocity, acceleration) =
            (&mut self.position[..n], &mut self.velocity[..n], &mut self.acceleration[..n]);
        for (index, group) in self.groups.iter_mut().enumerate() {
            let from = CubicSample { value: T::load(&group.w.value), slope: T::load(&group.w.slope) };
            group.forcing = Forcing::read::<T>(forcing_table, place, index, style, swing);
            let to = after.jet::<T>(&group.forcing);
            group.w = CubicSample { value: to.value.store(), slope: to.slope.store() };

            let (goal, way) = (T::load(&centre.value()[index]), T::load(&group.way));
            let [start, mut origin] = lags.map(|lag| goal + way * lag);
            let state = State { e: T::load(&position[index]) - start, z: T::load(&group.z) };
            let mut next = propagator.advance(state, [from, to]);
            let mut y = origin + next.e;
            if moving {
                let set_out = CubicSample { value: T::default(), slope: T::load(&centre.rate()[index]) };
                let [arrived, slope] = centre.advance_group::<T>(index, &self.centre_course);
                let moved = propagator.follow([set_out, CubicSample { value: arrived - goal, slope }]);
                y = y + moved.e;
                origin = arrived + way * lags[1];
                next.z = next.z + moved.z;
            }
            let (y, z) = (flush(y, rest), flush(next.z, rest));
            (position[index], group.z) = (y.store(), z.store());
            let [speed, change] = after.motion(attractor, State { e: y - origin, z }, carried(to, way, carry));
            (velocity[index], acceleration[index]) = (speed.store(), change.store());
        }
        forcing_table.prefetch(clock + self.lead * self.held.pace() * h);
        if let Some(before) = levers {
            self.add_perturbation(before);
            self.read_out();
        }
    }

    /// Adds what a perturbation does; the system is linear.
    fn add_perturbation(&mut self, before: [CubicSample; 2]) {
        let after = self.levers();
        let by_velocity = self.propagator.advance(State::default(), [before[0], after[0]]);
        let by_acceleration = self.propagator.follow([before[1], after[1]]);
        let Some(PerturbationTerms { velocity, acceleration }) = self.held.push() else { return };
        for (index, group) in self.groups.iter_mut().enumerate() {
            let (v, a) = (velocity[index], acceleration[index]);
            self.position[index] += v * by_velocity.e + a * by_acceleration.e;
            group.z += v * by_velocity.z + a * by_acceleration.z;
        }
    }

    /// What a unit of c_v adds to the forcing, τ, and a unit of c_a to the centre: τ²/(α_zβ_z), for that is how far the
    /// centre must move to add τ² to the row of Eq. (1).
    fn levers(&self) -> [CubicSample; 2] {
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        // On the way into a pause the terms fade with it once τ lies beyond all that can be commanded.
        let least = MIN_RATE / self.primitive.tau();
        let (rate, change) = (first(self.rate.value()), first(self.rate.rate()));
        let tau = 1.0 / rate.max(least);
        // dτ/du = τ·dτ/dt.
        let slope = if rate < least { 0.0 } else { -change * tau.powi(3) };
        let centre = tau / (alpha_z * beta_z);
        [CubicSample { value: tau, slope }, CubicSample { value: tau * centre, slope: 2.0 * slope * centre }]
    }

    /// The gate at the clock, at u_end with the slope of what follows.
    #[inline(always)]
    pub(super) fn gate(&self) -> Gate {
        let within = self.gate_within();
        match self.primitive.forcing_table().fading(self.clock.value()) {
            Some(Fade { value, growth, along, .. }) => {
                let pace = self.held.pace();
                Gate { r: value, pace: pace * along, growth: pace * growth, ..within }
            }
            None => within,
        }
    }

    /// The gate of the demonstrated stretch.
    #[inline(always)]
    fn gate_within(&self) -> Gate {
        let (r, rate) = (self.r, [self.rate.value(), self.rate.rate()].map(first));
        let growth = match self.primitive.canonical() {
            Canonical::Discrete { .. } => 0.0,
            Canonical::Rhythmic { mu } => mu * (first(self.amplitude.value()) - r),
        };
        Gate { r, pace: self.held.pace(), growth, rate }
    }

    /// m′ and m″ with respect to the output system's clock, from those with respect to the phase's.
    #[inline(always)]
    fn carry(&self, slope: f64, bend: f64) -> [f64; 2] {
        let pace = self.held.pace();
        [slope * pace, bend * (pace * pace)]
    }

    /// Reads the frame at a clock that was set.
    pub(super) fn read_frame(&mut self) {
        self.stretch = self.primitive.transport.stretch(self.clock.value());
        self.lag = self.stretch.lag(self.clock.value()).value;
    }

    /// Reads the forcing at a clock or style that was set.
    pub(super) fn read_forcing(&mut self) {
        let (primitive, place) = (&self.primitive, self.primitive.forcing_table().place(self.clock.value()));
        let [style, swing] = [self.style.value(), self.style.rate()].map(|style| unpack(style, primitive.n_styles()));
        for (index, group) in self.groups.iter_mut().enumerate() {
            group.forcing = Forcing::read::<F64x4>(primitive.forcing_table(), place, index, style, Some(swing));
        }
        self.open_gate();
    }

    /// Computes w at the clock for the pace at work. A tick does so for its end, where the next one starts.
    fn open_gate(&mut self) {
        self.paced = self.held.pace();
        let gate = self.gate();
        self.groups.iter_mut().for_each(|group| group.w = gate.jet(&group.forcing));
    }

    /// Velocity and acceleration of the present state.
    pub(super) fn read_out(&mut self) {
        let (gate, attractor) = (self.gate(), self.primitive.attractor());
        let Lag { value, slope, bend } = self.primitive.transport.lag(self.clock.value());
        let carry = self.carry(slope, bend);
        for (index, &Group { forcing, way, z, .. }) in self.groups.iter().enumerate() {
            let w = carried(gate.jet(&forcing), way, carry);
            let e = self.position[index] - (self.centre.value()[index] + way * value);
            [self.velocity[index], self.acceleration[index]] = gate.motion(attractor, State { e, z }, w);
        }
        if let Some(PerturbationTerms { velocity, acceleration }) = self.held.push() {
            for group in 0..self.groups.len() {
                self.velocity[group] += velocity[group];
                self.acceleration[group] += acceleration[group];
            }
        }
    }

    /// Whether a movement is over: how far a DoF may still go is at most about |y − g| + 2|z + w|/α_z + |w|/β_z, what is
    /// left of its way, of its speed at critical damping, and of its forcing, be it of the style that is on its way, and
    /// as far as the goal itself still goes.
    fn settled(&self) -> Status {
        let Some(fade) = self.primitive.forcing_table().fading(self.clock.value()) else {
            return Status::Working;
        };
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let (forcing_table, target) =
            (self.primitive.forcing_table(), unpack(self.style.target(), self.primitive.n_styles()));
        let place = forcing_table.place(self.clock.value());
        let over = self.groups.iter().enumerate().all(|(index, group)| {
            let way = (self.position[index] - self.centre.target()[index]).abs();
            let Forcing { shape, slope, .. } = group.forcing;
            let forcing = shape * fade.value;
            let flow = (group.z + forcing).abs() * (2.0 / alpha_z);
            let mut push = fade.push(CubicSample { value: shape, slope });
            if !self.style.settled() {
                push = push.max(fade.push(forcing_table.blend(place, index, target)));
            }
            let left = way + flow + push * (1.0 / beta_z) + self.centre_filter.left(&self.centre, index);
            left.simd_le(group.tolerance).all()
        });
        if over { Status::Finished } else { Status::Working }
    }
}

/// The first of several commands, or the only one.
fn first(lanes: &[F64x4]) -> f64 {
    lanes[0].as_array()[0]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use ndarray::Array2;

    use super::*;
    use crate::{Conditions, Demonstration, FitOptions, Kind, Sampling, fit};

    /// Registers of any width round alike: the motion is the same to the last bit.
    #[test]
    fn every_width_moves_alike() {
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
            let h = any.stretch(1e-3);
            any.advance(1e-3, h);
            four.stretch(1e-3);
            four.advance_in::<F64x4>(1e-3, h);
            assert_eq!(any.position(), four.position());
            assert_eq!(any.acceleration(), four.acceleration());
        }
    }
}
