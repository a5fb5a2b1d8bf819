//! One tick.

use super::{Controller, Status};
use crate::dynamics::canonical::{Canonical, CompensatedSum, amplitude, faded};
use crate::dynamics::forcing_table::{Fade, Landscape, Place};
use crate::dynamics::output_system::{Attractor, Jet, State};
use crate::dynamics::transport::Lag;
use crate::error::{Error, Result};
use crate::motion::perturbation::Push;
use crate::numerics::simd::{Lanes, Real, Register, flush, unpack};

/// Most pieces of a tick; a longer one is still stable, only less exact.
const MOST_PIECES: f64 = 1000.0;
/// Lowest rate, relative to the nominal one, at which terms of the user's own act in full.
const LEAST_RATE: f64 = 1e-6;
/// Longest tick, in units of τ.
const LONGEST_TICK: f64 = 1000.0;

/// What the landscape gives a group of DoFs at the clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Forcing {
    /// sᵀb.
    pub(super) shape: Lanes,
    /// Its derivative with respect to the phase's clock.
    slope: Lanes,
    /// ṡᵀb, per second at the nominal rate.
    swing: Lanes,
}

impl Forcing {
    /// Reads a group at a place, for a style s and, while it is on its way, ṡ.
    #[inline(always)]
    fn read<T: Register>(landscape: &Landscape, place: Place, group: usize, s: &[f64], rate: Option<&[f64]>) -> Self {
        let [along, swing] = match rate {
            Some(rate) => landscape.blend_both::<T>(place, group, [s, rate]),
            None => [landscape.blend(place, group, s), Jet::default()],
        };
        Self { shape: along.value.store(), slope: along.slope.store(), swing: swing.value.store() }
    }
}

/// What turns a [`Forcing`] into w = r·sᵀb and its slope along the motion, w′ = rκ·sᵀb′ + rτ_n·ṡᵀb + r′·sᵀb. Past the
/// end of a discrete movement r stands for the fading phase, and b for what is faded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    pub(super) r: f64,
    /// The landscape is read at the phase's pace κ; style and amplitude keep the output system's clock.
    along: f64,
    swing: f64,
    growth: f64,
    /// ρ and ρ̇.
    rate: [f64; 2],
}

impl Gate {
    #[inline(always)]
    fn jet<T: Register>(&self, forcing: &Forcing) -> Jet<T> {
        let [shape, slope, swing] = [&forcing.shape, &forcing.slope, &forcing.swing].map(T::load);
        Jet { value: shape * self.r, slope: slope * self.along + (swing * self.swing + shape * self.growth) }
    }

    /// ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′ with y′ = z + w, where w has the motion c′ of the frame in it.
    #[inline(always)]
    fn motion<T: Real>(&self, attractor: Attractor, state: State<T>, w: Jet<T>) -> [T; 2] {
        let ([rate, change], flow) = (self.rate, state.z + w.value);
        [flow * rate, (attractor.z_slope(state) + w.slope) * (rate * rate) + flow * change]
    }
}

/// Adds the motion of a frame that covers a `way` to the forcing, for m with respect to the output system's clock.
#[inline(always)]
fn carried<T: Real>(w: Jet<T>, way: T, [slope, bend]: [f64; 2]) -> Jet<T> {
    Jet { value: w.value + way * slope, slope: w.slope + way * bend }
}

impl Controller {
    /// Checks that a tick is not too long for the rates at which it starts and to which it goes.
    pub(super) fn check_length(&self, dt: f64, tau: Option<f64>) -> Result<()> {
        let commanded = tau.map_or(first(self.rate.target()), |tau| self.speed / tau);
        let at_once = !self.started || self.filter.immediate();
        let fastest = if at_once { commanded } else { commanded.max(first(self.rate.value())) };
        if dt * fastest > LONGEST_TICK {
            return Err(Error::Range { name: "dt", value: dt, allowed: "must not exceed 1000 tau" });
        }
        Ok(())
    }

    /// One tick of `dt` seconds, `h` on the clock.
    pub(super) fn tick(&mut self, dt: f64, h: f64) -> Status {
        self.started = true;
        let mut parts = h / self.finest;
        if !(self.style.settled() && self.amplitude.settled()) {
            parts = parts.max(self.filter.parts(h * self.model.tau()));
        }
        if !self.centre.settled() {
            parts = parts.max(self.centre_filter.parts(h * self.model.tau()));
        }
        if !self.rate.settled() {
            parts = parts.max(self.filter.parts(dt));
        }
        if parts <= 1.0 {
            self.piece(dt, h);
        } else {
            let pieces = parts.ceil().min(MOST_PIECES);
            for _ in 0..pieces as u32 {
                let h = self.stretch(dt / pieces);
                self.piece(dt / pieces, h);
            }
        }
        self.time.add(dt);
        // What has settled stays settled, unless it is pushed or commanded.
        if self.status == Status::Working || self.held.push().is_some() {
            let past = self.model.landscape().is_past(self.clock.value());
            self.status = if past { self.settled() } else { Status::Working };
        }
        self.status
    }

    /// The stretch of the clock that `dt` seconds from now on cover.
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
            self.glide = self.filter.glide(dt);
        }
    }

    /// Gets the filters on the clock that are at work ready for a stretch `h` of it.
    #[inline(always)]
    fn measure_clock(&mut self, h: f64) {
        let seconds = h * self.model.tau();
        if seconds != self.course.dt() && !(self.style.settled() && self.amplitude.settled()) {
            self.course = self.filter.pass(seconds);
        }
        if seconds != self.centre_course.dt() && !self.centre.settled() {
            self.centre_course = self.centre_filter.pass(seconds);
        }
    }

    /// Moves on by `dt` seconds, `h` on the clock, stopping at the demonstrated end, where the forcing has a kink.
    fn piece(&mut self, dt: f64, h: f64) {
        let Canonical::Discrete { u_end, .. } = self.model.canonical() else {
            return self.advance(dt, h);
        };
        let (left, way) = (u_end - self.clock.value(), self.held.pace() * h);
        // A tick that ends here but for rounding is one that does.
        if left <= 0.0 || left > way * (1.0 + 1e-9) {
            return self.advance(dt, h);
        }
        let before = self.rate.time_to(left / self.held.pace(), dt, &self.filter);
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
    pub(super) fn advance(&mut self, dt: f64, h: f64) {
        if h <= 0.0 {
            // A pause: nothing moves but the rate.
            self.measure(dt);
            self.rate.advance::<Lanes>(&self.glide);
            self.held.rest();
            return self.read_out();
        }
        #[cfg(target_arch = "x86_64")]
        if super::avx::advance(self, dt, h) {
            return;
        }
        self.advance_in::<Lanes>(dt, h);
    }

    /// The same in registers of one kind.
    #[inline(always)]
    pub(super) fn advance_in<T: Register>(&mut self, dt: f64, h: f64) {
        self.measure(dt);
        self.measure_clock(h);
        if h != self.propagator.step() {
            self.propagator = self.series.propagator::<T>(h);
        }
        let demonstrated = !self.model.landscape().is_past(self.clock.value());
        let levers = self.held.push().map(|_| self.levers());
        let before = if demonstrated { self.gate_within() } else { self.gate() };
        for (from, forcing) in self.from.iter_mut().zip(&self.forcing) {
            let Jet { value, slope } = before.jet::<T>(forcing);
            *from = Jet { value: value.store(), slope: slope.store() };
        }
        self.style.advance::<T>(&self.course);
        self.rate.advance::<T>(&self.glide);
        let moving = self.centre.elapse(&self.centre_course);
        self.clock.add(self.held.pace() * h);
        if let Canonical::Rhythmic { mu } = self.model.canonical() {
            self.clock.wrap();
            self.r = if self.amplitude.settled() {
                amplitude(mu, self.r, self.conditions.amplitude, h)
            } else {
                let (tau, dt) = (self.model.tau(), self.course.dt());
                let r = faded(self.filter.lag(&self.amplitude, self.r, mu / tau, dt));
                self.amplitude.advance::<T>(&self.course);
                r
            };
        }
        if !self.stretch.reaches(self.clock.value()) {
            self.stretch = self.model.transport.stretch(self.clock.value());
        }
        let Lag { value, slope, bend } = self.stretch.lag(self.clock.value());
        let lags = [std::mem::replace(&mut self.lag, value), value];
        let carry = self.carry(slope, bend);
        // A piece that reaches u_end has the slopes of the demonstrated side at both its ends.
        let after = if demonstrated { self.gate_within() } else { self.gate() };

        let (model, propagator) = (&*self.model, &self.propagator);
        let (landscape, attractor, clock) = (model.landscape(), model.attractor(), self.clock.value());
        let place = if demonstrated { landscape.place_within(clock) } else { landscape.place(clock) };
        let style = unpack(self.style.value(), model.n_styles());
        let swing = (!self.style.settled()).then(|| unpack(self.style.rate(), model.n_styles()));
        let (n, rest, nominal) = (self.forcing.len(), T::splat(self.rest), model.tau());
        let (forcing, centre) = (&mut self.forcing[..n], &mut self.centre);
        let (starts, way) = (&self.from[..n], &self.way[..n]);
        let (position, z) = (&mut self.position[..n], &mut self.z[..n]);
        let (velocity, acceleration) = (&mut self.velocity[..n], &mut self.acceleration[..n]);
        for group in 0..n {
            let from = Jet { value: T::load(&starts[group].value), slope: T::load(&starts[group].slope) };
            forcing[group] = Forcing::read::<T>(landscape, place, group, style, swing);
            let to = after.jet(&forcing[group]);

            let (goal, way) = (T::load(&centre.value()[group]), T::load(&way[group]));
            let [start, mut origin] = lags.map(|lag| goal + way * lag);
            let state = State { e: T::load(&position[group]) - start, z: T::load(&z[group]) };
            let mut next = propagator.advance(state, [from, to]);
            let mut y = origin + next.e;
            if moving {
                let set_out = Jet { value: T::default(), slope: T::load(&centre.rate()[group]) * nominal };
                centre.advance_group::<T>(group, &self.centre_course);
                let arrived = T::load(&centre.value()[group]);
                let slope = T::load(&centre.rate()[group]) * nominal;
                let moved = propagator.follow([set_out, Jet { value: arrived - goal, slope }]);
                y = y + moved.e;
                origin = arrived + way * lags[1];
                next.z = next.z + moved.z;
            }
            let (y, z_next) = (flush(y, rest), flush(next.z, rest));
            (position[group], z[group]) = (y.store(), z_next.store());
            let [speed, change] = after.motion(attractor, State { e: y - origin, z: z_next }, carried(to, way, carry));
            (velocity[group], acceleration[group]) = (speed.store(), change.store());
        }
        landscape.prefetch(clock + self.lead * self.held.pace() * h);
        if let Some(before) = levers {
            self.add_perturbation(before);
            self.read_out();
        }
    }

    /// Adds what a perturbation does; the system is linear.
    fn add_perturbation(&mut self, before: [Jet; 2]) {
        let after = self.levers();
        let by_velocity = self.propagator.advance(State::default(), [before[0], after[0]]);
        let by_acceleration = self.propagator.follow([before[1], after[1]]);
        let Some(Push { velocity, acceleration }) = self.held.push() else { return };
        for group in 0..self.z.len() {
            let (v, a) = (velocity[group], acceleration[group]);
            self.position[group] += v * by_velocity.e + a * by_acceleration.e;
            self.z[group] += v * by_velocity.z + a * by_acceleration.z;
        }
    }

    /// What a unit of c_v adds to the forcing, τ, and a unit of c_a to the centre: τ²/(α_zβ_z), for that is how far the
    /// centre must move to add τ² to the row of Eq. (1).
    fn levers(&self) -> [Jet; 2] {
        let Attractor { alpha_z, beta_z } = self.model.attractor();
        // On the way into a pause the terms fade with it once τ lies beyond all that can be commanded.
        let least = LEAST_RATE / self.model.tau();
        let (rate, change) = (first(self.rate.value()), first(self.rate.rate()));
        let tau = 1.0 / rate.max(least);
        // dτ/du = τ·dτ/dt.
        let slope = if rate < least { 0.0 } else { -change * tau.powi(3) };
        let centre = tau / (alpha_z * beta_z);
        [Jet { value: tau, slope }, Jet { value: tau * centre, slope: 2.0 * slope * centre }]
    }

    /// The gate at the clock, at u_end with the slope of what follows.
    #[inline(always)]
    pub(super) fn gate(&self) -> Gate {
        let within = self.gate_within();
        match self.model.landscape().fading(self.clock.value()) {
            Some(Fade { value, growth, along, .. }) => {
                let [along, growth] = [along, growth].map(|slope| self.held.pace() * slope);
                Gate { r: value, along, swing: value * within.swing, growth, ..within }
            }
            None => within,
        }
    }

    /// The gate of the demonstrated stretch.
    #[inline(always)]
    fn gate_within(&self) -> Gate {
        let (r, rate) = (self.r, [self.rate.value(), self.rate.rate()].map(first));
        let growth = match self.model.canonical() {
            Canonical::Discrete { .. } => 0.0,
            Canonical::Rhythmic { mu } => mu * (first(self.amplitude.value()) - r),
        };
        Gate { r, along: r * self.held.pace(), swing: r * self.model.tau(), growth, rate }
    }

    /// m′ and m″ with respect to the output system's clock, from those with respect to the phase's.
    #[inline(always)]
    fn carry(&self, slope: f64, bend: f64) -> [f64; 2] {
        let pace = self.held.pace();
        [slope * pace, bend * (pace * pace)]
    }

    /// Reads the frame at a clock that was set.
    pub(super) fn read_frame(&mut self) {
        self.stretch = self.model.transport.stretch(self.clock.value());
        self.lag = self.stretch.lag(self.clock.value()).value;
    }

    /// Reads the forcing at the clock.
    pub(super) fn read_forcing(&mut self) {
        let (model, place) = (&self.model, self.model.landscape().place(self.clock.value()));
        let [style, swing] = [self.style.value(), self.style.rate()].map(|style| unpack(style, model.n_styles()));
        for (group, forcing) in self.forcing.iter_mut().enumerate() {
            *forcing = Forcing::read::<Lanes>(model.landscape(), place, group, style, Some(swing));
        }
    }

    /// Velocity and acceleration of the present state.
    pub(super) fn read_out(&mut self) {
        let (gate, attractor) = (self.gate(), self.model.attractor());
        let Lag { value, slope, bend } = self.model.transport.lag(self.clock.value());
        let carry = self.carry(slope, bend);
        for group in 0..self.z.len() {
            let way = self.way[group];
            let w = carried(gate.jet(&self.forcing[group]), way, carry);
            let e = self.position[group] - (self.centre.value()[group] + way * value);
            let state = State { e, z: self.z[group] };
            [self.velocity[group], self.acceleration[group]] = gate.motion(attractor, state, w);
        }
        if let Some(Push { velocity, acceleration }) = self.held.push() {
            for group in 0..self.z.len() {
                self.velocity[group] += velocity[group];
                self.acceleration[group] += acceleration[group];
            }
        }
    }

    /// Whether a movement is over: how far a DoF may still go is at most about |y − g| + 2|z + w|/α_z + |w|/β_z, what is
    /// left of its way, of its speed at critical damping, and of its forcing, be it of the style that is on its way, and
    /// as far as the goal itself still goes.
    fn settled(&self) -> Status {
        let Some(fade) = self.model.landscape().fading(self.clock.value()) else {
            return Status::Working;
        };
        let Attractor { alpha_z, beta_z } = self.model.attractor();
        let (landscape, target) = (self.model.landscape(), unpack(self.style.target(), self.model.n_styles()));
        let place = landscape.place(self.clock.value());
        let over = (0..self.z.len()).all(|group| {
            let way = (self.position[group] - self.centre.target()[group]).abs();
            let Forcing { shape, slope, .. } = self.forcing[group];
            let forcing = shape * fade.value;
            let flow = (self.z[group] + forcing).abs() * (2.0 / alpha_z);
            let mut push = fade.push(Jet { value: shape, slope });
            if !self.style.settled() {
                push = push.max(fade.push(landscape.blend(place, group, target)));
            }
            let left = way + flow + push * (1.0 / beta_z) + self.centre_filter.left(&self.centre, group);
            left.simd_le(self.tolerance[group]).all()
        });
        if over { Status::Finished } else { Status::Working }
    }
}

/// The first of several commands, or the only one.
fn first(lanes: &[Lanes]) -> f64 {
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
        let options = FitOptions {
            basis: crate::learning::regression::Basis::NGnet(Default::default()),
            ..FitOptions::new(Kind::Discrete)
        };
        let model = Arc::new(fit(&demos, &options).unwrap());
        let mut any = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
        any.step().unwrap();
        any.set_goal(&[0.3; 6]).unwrap();
        any.set_tau(0.8).unwrap();
        any.set_style(&vec![0.5; any.model.n_styles()]).unwrap();
        let mut four = any.clone();
        for _ in 0..1500 {
            let h = any.stretch(1e-3);
            any.advance(1e-3, h);
            four.stretch(1e-3);
            four.advance_in::<Lanes>(1e-3, h);
            assert_eq!(any.position(), four.position());
            assert_eq!(any.acceleration(), four.acceleration());
        }
    }
}
