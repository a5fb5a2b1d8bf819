//! Limits in the control loop.
//!
//! After each tick the motion of every DoF is compared with its limits (`viability`). A DoF that keeps them moves on bit for
//! bit as without limits. Any other one takes the acceleration closest to the wanted one, (ẏ_wanted − ẏ)/h, in the interval
//! that keeps the limits, and z takes the value with which the primitive continues from the commanded position and velocity.
//! While a velocity or acceleration is limited, the phase waits: with the excess δ = (ÿ_wanted − ÿ)τ²/(α_zβ_z) as a
//! displacement of the goal, its rate is divided by 1 + k_s‖δ/range‖², as for a tracking error, through a filter with the
//! natural frequency of the attractor: unfiltered, κ alternates between its bounds, and with it the acceleration. A limit of
//! the position does not slow the phase, which would stop for good on a path beyond it.
//!
//! A DoF whose jerk is limited follows its stopping motions instead (`jerk`).

use super::limiter::MAX_SUBSTEPS;
use super::step::first_element;
use super::{Controller, Status};
use crate::dynamics::output_system::Attractor;
use crate::error::Result;
use crate::motion::limits::{Limit, Limits};
use crate::motion::viability::MIN_TICK;
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute, unpack};

/// Rate ρ, relative to the nominal one, below which the change of z is that of this rate: it would be unbounded in a pause.
const MIN_RATE: f64 = 0.01;
/// Rounding error of a position, relative to its terms.
const ROUNDING: f64 = 1e-13;
/// Rounding error of the number of parts of a tick, relative to it.
const ROUNDING_OF_RATE: f64 = 1e-9;

/// Share of a limit from which a DoF slows the clock; the margins of the path ahead are smaller.
pub(super) const NEAR_LIMIT: f64 = 0.95;

impl Controller {
    /// Sets the limits of position, velocity, acceleration and jerk; those of [`Limits::default`] are none.
    ///
    /// From then on every tick keeps them, for any commands, measurements, coupling terms and tick lengths: at its end lower ≤ y
    /// ≤ upper, |ẏ| ≤ V, |Δẏ|/Δt ≤ A, |ÿ| ≤ A, and the state can brake to rest inside; between its ends lower ≤ y ≤ upper on the
    /// cubic through position and velocity at both, by which a robot interpolates, and |Δy|/Δt ≤ V. A DoF brakes with A, or
    /// with V/2Δt or (upper − lower)/Δt² for the tick Δt = [`Controller::dt`] if that is less. A longer tick is limited in parts
    /// of constant acceleration, each of which keeps the limits, and is no single cubic. Commands between ticks change neither
    /// position nor velocity at once. A motion inside the limits is not changed.
    ///
    /// With a limit J of the jerk, |Δÿ|/Δt ≤ J, ẏ changes as it can with that jerk, and the state can stop inside with it. A
    /// movement then begins with ÿ = 0, or where it goes on from the present position and velocity, with the present ÿ. Where a
    /// DoF comes to rest within a tick, the cubic may pass the limit by J·Δt³/150.
    ///
    /// A goal or anchor outside is moved to the limit, where a movement is finished as at any goal; [`Controller::centre`] returns
    /// it. A state outside, after limits that shrink or at a start outside, brakes with A and returns at V or below: until then the
    /// limit of the position gives way to the others. Along a path that leaves the limits of the position from its start on, a
    /// DoF is held at its limit and continues from there when the path returns; `nearest_feasible` finds conditions that stay
    /// inside. A command during the movement is accepted in part instead ([`Controller::is_pending`]). Where the acceleration
    /// along the path steps, a limit of the jerk binds single DoFs. [`Controller::limited`] names the limits that bind.
    ///
    /// Limits of a rotation bound the sizes of its angular velocity and acceleration: |ω| ≤ Ω and |ω̇| ≤ A at the end of every tick,
    /// |Δω|/Δt ≤ A in the frame of the tool and in that of the world, and an angle of at most Ω·Δt between the ends. A limited tick ends
    /// with the ω within both that is closest to the wanted one, and turns about a fixed axis.
    ///
    /// The limits remain in force after [`Controller::reset`]. The first time, this function allocates memory for the path ahead,
    /// unless every DoF is limited on its own; later calls do not.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Controller, Demonstration, FitOptions, Kind, Status, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None)?;
    /// use pdmp_core::motion::Limits;
    ///
    /// controller.set_limits(&Limits { velocity: Some(vec![1.0; 2]), acceleration: Some(vec![8.0; 2]), ..Limits::default() })?;
    /// while controller.step()? == Status::Working {
    ///     assert!(controller.velocity().iter().all(|v| v.abs() <= 1.0));
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Limits::check`]. The limits then remain unchanged.
    pub fn set_limits(&mut self, limits: &Limits) -> Result<()> {
        limits.check_rotations(&self.primitive)?;
        let was_active = self.limiter.is_active();
        self.limiter.set(limits, self.primitive.duration(), self.dt)?;
        self.limit_path();
        if !self.started {
            self.begin();
            return Ok(());
        }
        // Within limits, the next tick continues the last one.
        if !was_active {
            self.keep_motion();
        }
        self.limiter.reduce_accelerations();
        if self.changes_centre() {
            self.move_centre(1.0);
            self.status = Status::Working;
            if self.has_frame() {
                self.start_goal_transition();
            }
        }
        self.look_ahead();
        self.publish();
        Ok(())
    }

    /// Returns whether the commanded goal or anchor inside the limits differs from the present target.
    pub(super) fn changes_centre(&mut self) -> bool {
        self.limiter.accept(&self.conditions.centre) != unpack(self.centre.target(), self.primitive.n_dofs())
    }

    /// Returns the limits; infinite elements are none.
    pub fn limits(&self) -> Limits {
        self.limiter.limits()
    }

    /// Returns for each DoF the limit that determined its acceleration in the last tick, `None` for a free one.
    pub fn limited(&self) -> &[Option<Limit>] {
        self.limiter.limited()
    }

    /// Computes velocity and acceleration after a command between ticks.
    ///
    /// Within limits, a DoF keeps the velocity and acceleration of the last tick where the new ones break a limit: no time has
    /// passed for a change of the velocity. The next tick begins the change.
    pub(super) fn publish(&mut self) {
        self.publish_dofs();
        self.publish_pose();
        self.keep_turns();
    }

    /// Keeps the motion at the end of the last tick, from which limits count that are set later.
    fn keep_motion(&mut self) {
        if self.limiter.keep(self.time.value(), &self.position, &self.velocity, &self.acceleration) {
            self.begin_turns();
        }
    }

    fn publish_dofs(&mut self) {
        if !self.limiter.is_active() {
            self.keep_motion();
        }
        self.read_out();
        if !self.started {
            return self.begin_first_tick();
        }
        if !self.limiter.is_active() {
            return;
        }
        for (index, &[y, v, a]) in self.limiter.before.iter().enumerate() {
            let (bounds, velocity) = (&self.limiter.bounds[index], &mut self.velocity[index]);
            let kept = bounds.admits_change(y, v, *velocity);
            *velocity = kept.select(*velocity, v);
            let acceleration = &mut self.acceleration[index];
            let kept = kept & acceleration.abs().simd_le(bounds.acceleration);
            *acceleration = self.limiter.jerk_limited(index).select(a, kept.select(*acceleration, a));
        }
    }

    /// Applies the limits to the tick of `dt` seconds and `h` on the clock that has just been computed, from ρ = `rate`.
    #[inline(always)]
    pub(super) fn enforce_limits(&mut self, dt: f64, h: f64, rate: f64) {
        let kept_by_all = compute(Admission { controller: self, dt }) & self.admits_turns(dt)
            && !(self.limiter.has_jerk() && (0..self.groups.len()).any(|index| self.breaks_jerk(index, dt).any()));
        if !(kept_by_all && self.limiter.is_free && self.perturbation.limited_rate() == 1.0) {
            self.limit(dt, h, rate);
        }
        if self.perturbation.terms().is_some() {
            self.leave_path();
        }
        let slows = self.governor.as_mut().is_some_and(|governor| std::mem::take(&mut governor.slows));
        if slows || self.limiter.slows {
            self.name_limits(dt, slows);
        }
        self.limiter.begin(&self.position, &self.velocity, &self.acceleration);
        self.begin_turns();
    }

    /// Reduces the accelerations at the end of a tick of `dt` seconds, of which little belongs to this tick, to their limits.
    /// Returns whether all DoFs kept the other limits.
    #[inline(always)]
    fn admits_tick<T: Register>(&mut self, dt: f64) -> bool {
        let Self { limiter, position, velocity, acceleration, .. } = self;
        let mut kept_by_all = true;
        for (index, (bounds, [y, v, _])) in limiter.bounds.iter().zip(&limiter.before).enumerate() {
            let largest = T::load(&bounds.acceleration);
            let reduced = T::load(&acceleration[index]).fast_max(-largest).fast_min(largest);
            acceleration[index] = reduced.store();
            let (from, to) = (T::load_all([y, v]), T::load_all([&position[index], &velocity[index]]));
            kept_by_all &= bounds.admits(from, to, reduced, dt).all();
        }
        kept_by_all
    }

    /// Names the DoFs that are near a limit which slows the clock.
    #[inline(never)]
    fn name_limits(&mut self, dt: f64, slows: bool) {
        if self.limiter.is_free {
            self.limiter.limited.fill(None);
        }
        self.limiter.slows = slows;
        let before = self.limiter.before.iter().flat_map(|[_, v, _]| v.to_array());
        let after = self.velocity.iter().flat_map(|v| v.to_array());
        let bounds = self
            .limiter
            .bounds
            .iter()
            .flat_map(|bounds| bounds.velocity.to_array().into_iter().zip(bounds.acceleration.to_array()));
        for (limited, ((v, next), (velocity, acceleration))) in self
            .limiter
            .limited
            .iter_mut()
            .zip(before.zip(after).zip(bounds))
            .filter(|(limited, _)| slows && limited.is_none())
        {
            if next.abs() > NEAR_LIMIT * velocity {
                *limited = Some(Limit::Velocity);
            } else if (next - v).abs() > NEAR_LIMIT * acceleration * dt {
                *limited = Some(Limit::Acceleration);
            }
        }
        if slows {
            self.name_turns(dt);
        }
    }

    /// Limits the DoFs that do not keep their limits over a tick of `dt` seconds and `h` on the clock.
    #[inline(never)]
    fn limit(&mut self, dt: f64, h: f64, rate: f64) {
        let mut squares = [F64x4::ZERO; 2];
        self.limiter.is_free = true;
        self.limiter.limited.fill(None);
        self.leave_path();
        for index in 0..self.groups.len() {
            let (bounds, [y, v, _]) = (self.limiter.bounds[index], self.limiter.before[index]);
            let wanted = [self.position[index], self.velocity[index]];
            let mut kept = bounds.admits([y, v], wanted, self.acceleration[index], dt);
            let mut passed = kept;
            if self.limiter.has_jerk() {
                kept = self.breaks_jerk(index, dt).select(F64x4::ZERO, kept);
                passed = kept | self.limiter.jerk_limited(index);
            }
            self.limiter.excess[index] = F64x4::ZERO;
            let scale = F64x4::ONE / self.groups[index].range;
            let wanted_rate = wanted[1] * scale;
            squares[0] += wanted_rate * wanted_rate;
            if !kept.all() {
                self.limiter.is_free = false;
                if !passed.all() {
                    self.limiter.excess[index] = self.limit_group(index, passed, dt);
                }
                if self.limiter.has_jerk() {
                    let excess = self.limit_jerk(index, kept, dt);
                    self.limiter.excess[index] += excess;
                }
            }
            let limited_rate = self.velocity[index] * scale;
            squares[1] += limited_rate * limited_rate;
        }
        let by_turns = self.limit_turns(dt);
        let squares = [0, 1].map(|i| (squares[i].reduce_add() + by_turns[i]).max(0.0));
        self.hold_rate(rate, squares);
        self.follow_turns();
        self.publish_limited();
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        self.perturbation.set_excess(self.limiter.excess.iter().copied(), h * (alpha_z * beta_z).sqrt());
    }

    /// Raises a rate that has fallen over a tick from `start`, with the same velocities, for the squares of the wanted velocities
    /// and the limited ones: it falls no faster than these.
    ///
    /// Otherwise y′ = ẏ/ρ would grow, and the velocity as soon as the rate rises again.
    fn hold_rate(&mut self, start: f64, [wanted, limited]: [f64; 2]) {
        let rate = self.finite_rate();
        let held = start.min(rate * (limited / wanted).sqrt());
        if held <= rate {
            return;
        }
        for (group, velocity) in self.groups.iter_mut().zip(&self.velocity) {
            group.z += *velocity * (held.recip() - rate.recip());
        }
        self.hold_turns(held - rate, held);
        self.rate.start(held, &self.rate_gains);
    }

    /// Limits the DoFs of a group that are not `kept`, and returns the excess δ of those whose velocity or acceleration is
    /// limited.
    fn limit_group(&mut self, index: usize, kept: F64x4, dt: f64) -> F64x4 {
        let bounds = self.limiter.bounds[index];
        let [mut y, mut v, _] = self.limiter.before[index];
        let (wanted, at_end) = ((self.velocity[index] - v) * (1.0 / dt.max(MIN_TICK)), self.acceleration[index]);
        let n_substeps = (dt * self.limiter.substep_rate * (1.0 - ROUNDING_OF_RATE)).ceil().clamp(1.0, MAX_SUBSTEPS);
        let h = dt / n_substeps;
        let mut interval = bounds.interval(y, v, h);
        let mut a = wanted;
        for substep in 0..n_substeps as u32 {
            if substep > 0 {
                interval = bounds.interval(y, v, h);
            }
            a = interval.nearest(wanted);
            let inside = y.simd_ge(bounds.lower) & y.simd_le(bounds.upper);
            let next = y + v * h + a * (0.5 * h * h);
            // From inside, a position just past the limit is one of rounding.
            let inner = next.max(bounds.lower).min(bounds.upper);
            let rounding = (y.abs() + next.abs() + (v * h).abs()) * ROUNDING;
            y = (inside & (next - inner).abs().simd_le(rounding)).select(inner, next);
            v += a * h;
        }
        let rate = self.finite_rate();
        let group = &mut self.groups[index];
        group.z = kept.select(group.z, group.z + (v - self.velocity[index]) * (1.0 / rate));
        self.position[index] = kept.select(self.position[index], y);
        self.velocity[index] = kept.select(self.velocity[index], v);
        self.acceleration[index] = kept.select(self.acceleration[index], a);
        let mut excess = self.excess_of(wanted - a).to_array();
        let limited = self.limiter.limited.iter_mut().skip(index * WIDTH).zip(&mut excess).enumerate();
        for (lane, (limited, excess)) in limited {
            if kept.to_bitmask() & (1 << lane) == 0 {
                *limited = Some(interval.limit(wanted, at_end, lane));
            }
            if matches!(limited, None | Some(Limit::Position)) {
                *excess = 0.0;
            }
        }
        F64x4::new(excess)
    }

    /// Returns the rate ρ, or a small one in a pause.
    pub(super) fn finite_rate(&self) -> f64 {
        first_element(self.rate.value()).max(MIN_RATE / self.primitive.tau())
    }

    /// Returns the displacement δ of the goal that is equivalent to an excess of the acceleration.
    pub(super) fn excess_of(&self, acceleration: F64x4) -> F64x4 {
        let (rate, largest) = (self.finite_rate(), F64x4::splat(f64::MAX));
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        (acceleration * (1.0 / (rate * rate * alpha_z * beta_z))).max(-largest).min(largest)
    }
}

/// Kernel of [`Controller::admits_tick`].
struct Admission<'a> {
    controller: &'a mut Controller,
    dt: f64,
}

impl Kernel for Admission<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<T: Register>(self) -> bool {
        self.controller.admits_tick::<T>(self.dt)
    }
}
