//! Steady movements: many movements of one primitive between changes of their commands, in compact memory.
//!
//! A movement is steady while its commands rest on their targets, nothing perturbs or limits it, its frame follows no new
//! goal, and it is before its end. Its tick is then that of `step` without the branches that cannot be taken: the formulas
//! are the same functions of the same numbers, so that the motion is that of a [`Controller`] to the bit. The state of a
//! movement takes 0.5 kB in consecutive memory (D = 7), a controller 4 kB in some thirty allocations.

use super::group::{ForcingSample, Gate, add_frame_motion};
use super::step::{MAX_SUBSTEPS, ROUNDING, first_element};
use super::{Controller, Status};
use crate::dynamics::canonical::{Canonical, CompensatedSum, amplitude};
use crate::dynamics::output_system::{CubicSample, Propagator, State};
use crate::dynamics::transport::TransportSample;
use crate::model::primitive::Primitive;
use crate::motion::command::Command;
use crate::numerics::simd::{F64x4, Kernel, Register, WIDTH, compute, flush, groups, unpack, unpad};

/// Number of movements by which the forcing table is prefetched: the latency of the third-level cache over the time of a
/// tick.
const PREFETCH: usize = 3;

/// Clock and scalar state of a movement.
#[derive(Clone, Copy, Debug)]
struct SteadyClock {
    time: CompensatedSum,
    clock: CompensatedSum,
    /// ρ.
    rate: f64,
    /// Amplitude r, and its command r₀.
    r: f64,
    amplitude: f64,
    /// Lag ℓ of the frame at the clock.
    lag: f64,
}

/// State and commands of a group of DoFs.
#[derive(Clone, Copy, Debug, Default)]
struct SteadyGroup {
    position: F64x4,
    z: F64x4,
    w: CubicSample<F64x4>,
    centre: F64x4,
    displacement: F64x4,
}

/// Output of many movements, by rows (B, D) of the caller.
#[derive(Debug)]
pub(in crate::motion) struct Rows<'a> {
    pub(in crate::motion) position: &'a mut [f64],
    pub(in crate::motion) velocity: &'a mut [f64],
    pub(in crate::motion) acceleration: &'a mut [f64],
}

/// Settings of a tick that all movements share.
#[derive(Clone, Copy, Debug)]
pub(in crate::motion) struct SteadyTick {
    dt: f64,
    max_clock_step: f64,
    flush_level: f64,
}

/// Places for movements of one primitive, steady or empty.
#[derive(Clone, Debug)]
pub(in crate::motion) struct SteadyMovements {
    n_groups: usize,
    n_style_groups: usize,
    is_steady: Vec<bool>,
    clocks: Vec<SteadyClock>,
    /// Cell of the transport profile.
    cells: Vec<u32>,
    /// Place whose propagator a movement uses: an earlier movement of the same rate, or itself.
    propagator_of: Vec<u32>,
    propagators: Vec<Propagator>,
    /// Number of movements that use the propagator of a place.
    n_users: Vec<u32>,
    /// Place of the propagator that was used last.
    last_propagator: usize,
    groups: Vec<SteadyGroup>,
    styles: Vec<F64x4>,
}

impl Controller {
    /// Returns the settings of its steady ticks.
    pub(in crate::motion) fn steady_tick(&self) -> SteadyTick {
        SteadyTick { dt: self.dt, max_clock_step: self.max_clock_step, flush_level: self.flush_level }
    }

    /// Returns whether the next tick is a steady one.
    pub(in crate::motion) fn is_steady(&self) -> bool {
        let rate = first_element(self.rate.value());
        let (h, n_substeps) = (rate * self.dt, substeps(rate * self.dt, self.max_clock_step));
        let before_end = match self.primitive.canonical() {
            Canonical::Discrete { u_end, .. } => u_end - self.clock.value() > h * (1.0 + ROUNDING),
            Canonical::Rhythmic { .. } => true,
        };
        before_end
            && self.started
            && self.status == Status::Working
            && self.pose.is_none()
            && self.rate.is_settled()
            && self.are_commands_settled()
            && !self.goal_transition.is_active()
            && !self.approaching
            && !self.limiter.is_active()
            && self.governor.is_none()
            && self.rate_slope.is_none()
            && !self.perturbation.has_measurement()
            && self.perturbation.terms().is_none()
            && self.perturbation.phase_rate() == 1.0
            && self.forcing_phase_rate == 1.0
            && h > 0.0
            && self.propagator.step() == rate * (self.dt / n_substeps)
    }

    /// Returns whether a valid command changes a condition or perturbs the movement.
    pub(in crate::motion) fn is_changed_by(&self, command: &Command) -> bool {
        let conditions = &self.conditions;
        let differs = |commanded: Option<&[f64]>, present: &[f64]| commanded.is_some_and(|new| new != present);
        command.measured.is_some()
            || command.coupling.is_some()
            || command.phase.is_some()
            || command.goal_velocity.is_some()
            || differs(command.style, &conditions.style)
            || differs(command.goal.or(command.anchor), &conditions.centre)
            || command.tau.is_some_and(|tau| tau != conditions.tau)
            || command.amplitude.is_some_and(|amplitude| amplitude != conditions.amplitude)
    }
}

/// Returns the number of substeps of a tick of `h` on the clock while no command is in transition.
#[inline(always)]
fn substeps(h: f64, max_clock_step: f64) -> f64 {
    let n = h / max_clock_step;
    if n <= 1.0 { 1.0 } else { n.ceil().min(MAX_SUBSTEPS) }
}

impl SteadyMovements {
    /// Returns `n` empty places.
    pub(in crate::motion) fn new(controller: &Controller, n: usize) -> Self {
        let (n_groups, n_style_groups) = (controller.groups.len(), groups(controller.primitive.n_styles()));
        let (time, clock) = (CompensatedSum::default(), CompensatedSum::default());
        Self {
            n_groups,
            n_style_groups,
            is_steady: vec![false; n],
            clocks: vec![SteadyClock { time, clock, rate: 0.0, r: 1.0, amplitude: 1.0, lag: 0.0 }; n],
            cells: vec![0; n],
            propagator_of: vec![0; n],
            propagators: vec![controller.propagator; n],
            n_users: vec![0; n],
            last_propagator: 0,
            groups: vec![SteadyGroup::default(); n * n_groups],
            styles: vec![F64x4::ZERO; n * n_style_groups],
        }
    }

    /// Returns whether a place holds a movement.
    pub(in crate::motion) fn holds(&self, place: usize) -> bool {
        self.is_steady[place]
    }

    /// Takes a movement over if it is steady.
    pub(in crate::motion) fn admit(&mut self, place: usize, controller: &Controller) {
        if !controller.is_steady() || !self.share_propagator(place, &controller.propagator) {
            return;
        }
        self.is_steady[place] = true;
        self.cells[place] = controller.primitive.transport.cell(&controller.transport_segment) as u32;
        self.clocks[place] = SteadyClock {
            time: controller.time,
            clock: controller.clock,
            rate: first_element(controller.rate.value()),
            r: controller.r,
            amplitude: first_element(controller.amplitude.value()),
            lag: controller.frame_lag,
        };
        let styles = &mut self.styles[place * self.n_style_groups..][..self.n_style_groups];
        styles.copy_from_slice(controller.style.value());
        let places = &mut self.groups[place * self.n_groups..][..self.n_groups];
        for (index, (to, group)) in places.iter_mut().zip(&controller.groups).enumerate() {
            let (position, centre) = (controller.position[index], controller.centre.value()[index]);
            *to = SteadyGroup { position, z: group.z, w: group.w, centre, displacement: group.displacement };
        }
    }

    /// Assigns a propagator. Returns false if another movement still uses that of the place for another rate.
    fn share_propagator(&mut self, place: usize, propagator: &Propagator) -> bool {
        let last = self.last_propagator;
        if !(self.n_users[last] > 0 && self.propagators[last].step() == propagator.step()) {
            if self.n_users[place] > 0 && self.propagators[place].step() != propagator.step() {
                return false;
            }
            self.propagators[place] = *propagator;
            self.last_propagator = place;
        }
        self.propagator_of[place] = self.last_propagator as u32;
        self.n_users[self.last_propagator] += 1;
        true
    }

    /// Empties a place; [`Self::write`] has the state.
    pub(in crate::motion) fn release(&mut self, place: usize) {
        if std::mem::take(&mut self.is_steady[place]) {
            self.n_users[self.propagator_of[place] as usize] -= 1;
        }
    }

    /// Writes the state of a movement to its controller, whose commands are those of the movement.
    pub(in crate::motion) fn write(&self, place: usize, controller: &mut Controller) {
        let SteadyClock { time, clock, r, lag, .. } = self.clocks[place];
        (controller.time, controller.clock, controller.r, controller.frame_lag) = (time, clock, r, lag);
        controller.transport_segment = controller.primitive.transport.segment_of_cell(self.cells[place] as usize);
        controller.read_forcing();
        let (gate, attractor) = (controller.gate(), controller.primitive.attractor());
        let TransportSample { slope, bend, .. } = controller.transport_segment.lag(clock.value());
        let states = &self.groups[place * self.n_groups..][..self.n_groups];
        for (index, (group, state)) in controller.groups.iter_mut().zip(states).enumerate() {
            let SteadyGroup { position, z, w, centre, displacement } = *state;
            (group.z, group.w) = (z, w);
            let state = State { e: position - (centre + displacement * lag), z };
            let w = add_frame_motion(w, displacement, [slope, bend]);
            controller.position[index] = position;
            [controller.velocity[index], controller.acceleration[index]] = gate.motion(attractor, state, w);
        }
    }

    /// Advances the steady movements that `mask` selects by a tick and writes their motion to `rows`. Those that this tick
    /// would bring to their end stay as they are and are added to `ending`.
    pub(in crate::motion) fn step(
        &mut self,
        primitive: &Primitive,
        tick: SteadyTick,
        mask: Option<&[bool]>,
        rows: &mut Rows,
        ending: &mut Vec<u32>,
    ) {
        compute(Steps { movements: self, primitive, tick, mask, rows, ending });
    }
}

/// Kernel of [`SteadyMovements::step`].
struct Steps<'a, 'b> {
    movements: &'a mut SteadyMovements,
    primitive: &'a Primitive,
    tick: SteadyTick,
    mask: Option<&'a [bool]>,
    rows: &'a mut Rows<'b>,
    ending: &'a mut Vec<u32>,
}

impl Kernel for Steps<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(self) {
        let Self { movements, primitive, tick: SteadyTick { dt, max_clock_step, flush_level }, mask, rows, ending } =
            self;
        let SteadyMovements { n_groups, n_style_groups, is_steady, clocks, cells, propagator_of, .. } = movements;
        let (n_groups, n_style_groups, n_styles) = (*n_groups, *n_style_groups, primitive.n_styles());
        let (propagators, styles) = (&movements.propagators, &movements.styles);
        let (table, attractor, transport) = (primitive.forcing_table(), primitive.attractor(), &primitive.transport);
        let (canonical, n_dofs, flush_level) = (primitive.canonical(), primitive.n_dofs(), T::splat(flush_level));
        let n = clocks.len();
        for b in 0..n {
            if !is_steady[b] || mask.is_some_and(|mask| !mask[b]) {
                continue;
            }
            table.prefetch(clocks[(b + PREFETCH).min(n - 1)].clock.value());
            let SteadyClock { time, clock, rate, r, amplitude: target, lag } = &mut clocks[b];
            let n_substeps = substeps(*rate * dt, max_clock_step);
            let h = *rate * (dt / n_substeps);
            if let Canonical::Discrete { u_end, .. } = canonical
                && u_end - clock.value() <= n_substeps * h * (1.0 + ROUNDING)
            {
                ending.push(b as u32);
                continue;
            }
            time.add(dt);
            let propagator = &propagators[propagator_of[b] as usize];
            let style = unpack(&styles[b * n_style_groups..][..n_style_groups], n_styles);
            let groups = &mut movements.groups[b * n_groups..][..n_groups];
            for _ in 0..n_substeps as u32 {
                clock.add(h);
                let mut r_slope = 0.0;
                if let Canonical::Rhythmic { mu } = canonical {
                    clock.wrap();
                    *r = amplitude(mu, *r, *target, h);
                    r_slope = mu * (*target - *r);
                }
                let u = clock.value();
                let mut segment = transport.segment_of_cell(cells[b] as usize);
                if !segment.reaches(u) {
                    segment = transport.segment_at(u);
                    cells[b] = transport.cell(&segment) as u32;
                }
                let TransportSample { value, slope, bend } = segment.lag(u);
                let lags = [std::mem::replace(lag, value), value];
                let gate = Gate { r: *r, r_slope, phase_rate: 1.0, rate: [*rate, 0.0] };
                let index = table.demonstrated_index(u);
                for (group, state) in groups.iter_mut().enumerate() {
                    let from = CubicSample { value: T::load(&state.w.value), slope: T::load(&state.w.slope) };
                    let to = gate.forcing::<T>(&ForcingSample::read::<T>(table, index, group, style, None));
                    state.w = CubicSample { value: to.value.store(), slope: to.slope.store() };
                    let (centre, displacement) = (T::load(&state.centre), T::load(&state.displacement));
                    let [start, origin] = lags.map(|lag| centre + displacement * lag);
                    let w = add_frame_motion(to, displacement, [slope, bend]);
                    let before = State { e: T::load(&state.position) - start, z: T::load(&state.z) };
                    let next = propagator.advance(before, [from, to]);
                    let (y, z) = (flush(origin + next.e, flush_level), flush(next.z, flush_level));
                    (state.position, state.z) = (y.store(), z.store());
                    let [y_dot, y_ddot] = gate.motion(attractor, State { e: y - origin, z }, w);
                    let dofs = b * n_dofs + group * WIDTH..b * n_dofs + n_dofs.min((group + 1) * WIDTH);
                    unpad(y.store(), &mut rows.position[dofs.clone()]);
                    unpad(y_dot.store(), &mut rows.velocity[dofs.clone()]);
                    unpad(y_ddot.store(), &mut rows.acceleration[dofs]);
                }
            }
        }
    }
}
