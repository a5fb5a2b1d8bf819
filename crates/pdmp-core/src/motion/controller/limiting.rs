//! Limits in the control loop.
//!
//! After each tick the motion of every DoF is compared with its limits (`viability`). A DoF that keeps them moves on bit for
//! bit as without limits. Any other one takes the acceleration closest to the wanted one, (ẏ_wanted − ẏ)/h, in the interval
//! that keeps the limits, and z takes the value with which the primitive continues from the commanded position and velocity.
//! While a velocity or acceleration is limited, the phase waits: with the excess δ = (ÿ_wanted − ÿ)τ²/(α_zβ_z) as a
//! displacement of the goal, its rate is divided by 1 + k_s‖δ/range‖², as for a tracking error. A limit of the position does
//! not slow the phase, which would stop for good on a path beyond it.

use super::limiter::MAX_SUBSTEPS;
use super::step::first_element;
use super::{Controller, Status};
use crate::dynamics::output_system::Attractor;
use crate::error::Result;
use crate::motion::limits::{Limit, Limits};
use crate::numerics::simd::{F64x4, WIDTH};

/// Rate ρ, relative to the nominal one, below which the change of z is that of this rate: it would be unbounded in a pause.
const MIN_RATE: f64 = 0.01;

impl Controller {
    /// Sets the limits of position, velocity and acceleration; those of [`Limits::default`] are none.
    ///
    /// From then on every tick keeps them, whatever is commanded, measured or coupled, for any sequence of tick lengths: lower
    /// ≤ y ≤ upper at and between ticks, |ẏ| ≤ V, |Δẏ|/Δt ≤ A, and the state can always brake to rest inside. A motion inside
    /// the limits is not changed. A goal or anchor outside is moved to the limit. A state outside, after limits that shrink or
    /// at a start outside, brakes with A and returns. [`Controller::limited`] names the limits that bind. The limits remain in
    /// force after [`Controller::reset`].
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
    /// A wrong length, a lower limit that is not below the upper one, a velocity or acceleration that is not positive, or
    /// limits too tight for a tick of [`Controller::dt`]. The limits then remain unchanged.
    pub fn set_limits(&mut self, limits: &Limits) -> Result<()> {
        self.limiter.set(limits, self.primitive.duration(), self.dt)?;
        self.limit_path();
        if !self.started {
            self.begin();
            return Ok(());
        }
        self.limiter.begin(&self.position, &self.velocity);
        self.command_centre();
        self.status = Status::Working;
        if self.has_frame() {
            self.start_goal_transition();
        }
        self.look_ahead();
        self.read_out();
        Ok(())
    }

    /// Returns the limits; infinite elements are none.
    pub fn limits(&self) -> Limits {
        self.limiter.limits()
    }

    /// Returns for each DoF the limit that determined its acceleration in the last tick, `None` for a free one.
    pub fn limited(&self) -> &[Option<Limit>] {
        self.limiter.limited()
    }

    /// Applies the limits to the tick of `dt` seconds that has just been computed.
    #[inline(always)]
    pub(super) fn enforce_limits(&mut self, dt: f64) {
        let mut kept_by_all = true;
        for index in 0..self.groups.len() {
            let (bounds, before) = (&self.limiter.bounds[index], self.limiter.before[index]);
            let motion = [self.position[index], self.velocity[index]];
            // The acceleration at the end of the tick, of which little belongs to this tick, is published within its limit.
            self.acceleration[index] = self.acceleration[index].max(-bounds.acceleration).min(bounds.acceleration);
            kept_by_all &= bounds.admits(before, motion, self.acceleration[index], dt).all();
        }
        if !(kept_by_all && self.limiter.is_free) {
            self.limit(dt);
        }
        self.limiter.begin(&self.position, &self.velocity);
    }

    /// Limits the DoFs that do not keep their limits over a tick of `dt` seconds.
    #[inline(never)]
    fn limit(&mut self, dt: f64) {
        self.limiter.is_free = true;
        self.limiter.limited.fill(None);
        self.leave_path();
        for index in 0..self.groups.len() {
            let (bounds, before) = (self.limiter.bounds[index], self.limiter.before[index]);
            let wanted = [self.position[index], self.velocity[index]];
            let kept = bounds.admits(before, wanted, self.acceleration[index], dt);
            self.limiter.excess[index] = F64x4::ZERO;
            if !kept.all() {
                self.limiter.is_free = false;
                self.limiter.excess[index] = self.limit_group(index, kept, dt);
            }
        }
        self.perturbation.set_excess(self.limiter.excess.iter().copied());
    }

    /// Limits the DoFs of a group that are not `kept`, and returns the excess δ of those whose velocity or acceleration is
    /// limited.
    fn limit_group(&mut self, index: usize, kept: F64x4, dt: f64) -> F64x4 {
        let bounds = self.limiter.bounds[index];
        let [mut y, mut v] = self.limiter.before[index];
        let wanted = (self.velocity[index] - v) * (1.0 / dt);
        let n_substeps = (dt * self.limiter.substep_rate).ceil().clamp(1.0, MAX_SUBSTEPS);
        let h = dt / n_substeps;
        let mut interval = bounds.interval(y, v, h);
        let mut a = wanted;
        for substep in 0..n_substeps as u32 {
            if substep > 0 {
                interval = bounds.interval(y, v, h);
            }
            a = interval.clamp(wanted);
            let inside = y.simd_ge(bounds.lower) & y.simd_le(bounds.upper);
            let next = y + v * h + a * (0.5 * h * h);
            // From inside, a position past the limit is one of rounding.
            y = inside.select(next.max(bounds.lower).min(bounds.upper), next);
            v += a * h;
        }
        let rate = first_element(self.rate.value()).max(MIN_RATE / self.primitive.tau());
        let Attractor { alpha_z, beta_z } = self.primitive.attractor();
        let group = &mut self.groups[index];
        group.z = kept.select(group.z, group.z + (v - self.velocity[index]) * (1.0 / rate));
        self.position[index] = kept.select(self.position[index], y);
        self.velocity[index] = kept.select(self.velocity[index], v);
        self.acceleration[index] = kept.select(self.acceleration[index], a);
        let mut excess = ((wanted - a) * (1.0 / (rate * rate * alpha_z * beta_z))).to_array();
        let limited = self.limiter.limited.iter_mut().skip(index * WIDTH).zip(&mut excess).enumerate();
        for (lane, (limited, excess)) in limited {
            if kept.to_bitmask() & (1 << lane) == 0 {
                *limited = Some(interval.limit(wanted, lane));
            }
            if matches!(limited, None | Some(Limit::Position)) {
                *excess = 0.0;
            }
        }
        F64x4::new(excess)
    }
}
