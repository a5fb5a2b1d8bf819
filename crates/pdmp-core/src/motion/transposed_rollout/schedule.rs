//! Substeps of a rollout, as a controller divides its ticks.

use crate::dynamics::canonical::{Canonical, CompensatedSum};
use crate::dynamics::forcing_table::TableIndex;
use crate::dynamics::output_system::Propagator;
use crate::model::conditions::ResolvedConditions;
use crate::model::primitive::Primitive;
use crate::motion::controller::substeps::{MAX_SUBSTEPS, ROUNDING, max_clock_step};
use crate::motion::rollout::Clock;

/// Sample of a substep without one.
pub(super) const NO_SAMPLE: usize = usize::MAX;

/// Clock at an end of a substep.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) u: f64,
    pub(super) index: TableIndex,
    /// Factors r, r′ and κ of the forcing, as in a tick.
    pub(super) gate: [f64; 3],
    pub(super) is_past: bool,
}

impl Point {
    /// Returns the clock `u` before the end, or past it.
    pub(super) fn new(primitive: &Primitive, u: f64, is_past: bool) -> Self {
        let table = primitive.forcing_table();
        let fade = if is_past { table.fade(u) } else { None };
        let gate = fade.map_or([1.0, 0.0, 1.0], |fade| [fade.r, fade.r_slope, fade.p_slope]);
        Self { u, index: table.faded_index(u, fade), gate, is_past }
    }
}

/// Substep that ends at a point.
pub(super) struct Substep {
    pub(super) to: Point,
    /// Index of its propagator.
    pub(super) propagator: usize,
    /// Index of the sample at its end, or [`NO_SAMPLE`].
    pub(super) sample: usize,
    /// True for the first substep past the end of a discrete movement.
    pub(super) leaves_end: bool,
}

/// Substeps of a movement.
pub(super) struct Schedule {
    pub(super) first: Point,
    pub(super) substeps: Vec<Substep>,
    pub(super) propagators: Vec<Propagator>,
    /// Factors of the cotangents of ẏ and ÿ in that of y′, and of ÿ in that of y″, for each sample or for all.
    pub(super) rates: Vec<[f64; 3]>,
    /// Clock at which the frame ends a transition with the final velocity, if there is one.
    pub(super) transition: Option<f64>,
}

impl Schedule {
    /// Returns the substeps of the ticks up to the last sample, as a controller divides them.
    pub(super) fn of_ticks(
        primitive: &Primitive,
        conditions: &ResolvedConditions,
        ticks: &mut Clock,
        dt: f64,
        n_samples: usize,
    ) -> Self {
        let (rate, longest) = (1.0 / conditions.tau, max_clock_step(primitive));
        let transition = conditions.has_goal_velocity.then(|| primitive.canonical().extent());
        let mut schedule = Self::at(primitive, conditions.phase, n_samples, transition);
        let mut clock = CompensatedSum::at(conditions.phase);
        for k in 0..n_samples {
            if k > 0 {
                let dt = ticks.tick(k as f64 * dt).unwrap_or(dt);
                let n_substeps = (rate * dt / longest).ceil().clamp(1.0, MAX_SUBSTEPS);
                for _ in 0..n_substeps as u32 {
                    schedule.advance(primitive, &mut clock, rate, dt / n_substeps);
                }
                if let Some(last) = schedule.substeps.last_mut() {
                    last.sample = k;
                }
            }
            let [speed, change] = ticks.speed();
            let scaled = rate * speed;
            schedule.rates.push([scaled, rate * change, scaled * scaled]);
        }
        schedule
    }

    /// Returns the substeps in which a controller follows the limit cycle from phase 0.
    pub(super) fn of_phase(primitive: &Primitive, phase: f64) -> Self {
        let n_substeps = (phase / max_clock_step(primitive)).ceil();
        let mut schedule = Self::at(primitive, 0.0, n_substeps as usize, None);
        let mut clock = CompensatedSum::default();
        for _ in 0..n_substeps as u32 {
            schedule.add(primitive, &mut clock, phase / n_substeps);
        }
        schedule
    }

    fn at(primitive: &Primitive, u: f64, n: usize, transition: Option<f64>) -> Self {
        let (substeps, rates) = (Vec::with_capacity(n + 1), Vec::with_capacity(n));
        Self { first: Point::new(primitive, u, false), substeps, propagators: Vec::new(), rates, transition }
    }

    /// Adds a substep of `dt` seconds, split at the end of a discrete movement.
    fn advance(&mut self, primitive: &Primitive, clock: &mut CompensatedSum, rate: f64, dt: f64) {
        let h = rate * dt;
        let Canonical::Discrete { u_end, .. } = primitive.canonical() else {
            return self.add(primitive, clock, h);
        };
        let remaining = u_end - clock.value();
        if remaining <= 0.0 || remaining > h * (1.0 + ROUNDING) {
            return self.add(primitive, clock, h);
        }
        if remaining > ROUNDING * h {
            self.add(primitive, clock, remaining.min(h));
        }
        *clock = CompensatedSum::at(u_end);
        self.add(primitive, clock, (h - remaining).max(0.0));
        if let Some(last) = self.substeps.last_mut() {
            last.leaves_end = true;
        }
    }

    /// Adds a substep of the clock interval `h`.
    fn add(&mut self, primitive: &Primitive, clock: &mut CompensatedSum, h: f64) {
        let is_past = primitive.forcing_table().is_past(clock.value());
        clock.add(h);
        if let Canonical::Rhythmic { .. } = primitive.canonical() {
            clock.wrap();
        }
        if self.propagators.last().is_none_or(|last| last.step() != h) {
            self.propagators.push(primitive.attractor().propagator(h));
        }
        let (to, propagator) = (Point::new(primitive, clock.value(), is_past), self.propagators.len() - 1);
        self.substeps.push(Substep { to, propagator, sample: NO_SAMPLE, leaves_end: false });
    }
}
