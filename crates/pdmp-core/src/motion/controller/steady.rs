//! Steady movements: many movements of one primitive between changes of their commands, in compact memory.
//!
//! A movement is steady while its commands rest on their targets, nothing perturbs or limits it, its frame follows no new
//! goal, and it is before its end. Its tick is then that of `step` without the branches that cannot be taken: the formulas
//! are the same functions of the same numbers, so that the motion is that of a [`Controller`] to the bit. The state of a
//! movement takes 0.6 kB in consecutive memory (D = 7), a controller 4 kB in some thirty allocations.

mod substeps;
mod tick;

use super::group::add_frame_motion;
use super::step::first_element;
use super::substeps::{MAX_SUBSTEPS, ROUNDING};
use super::{Controller, Status};
use crate::dynamics::canonical::{Canonical, CompensatedSums};
use crate::dynamics::output_system::{CubicSample, RestingPropagator, State};
use crate::dynamics::transport::{TransportCells, TransportSample};
use crate::model::primitive::Primitive;
use crate::motion::command::Command;
use crate::numerics::blocks::{Block, Line, compute_blocks};
use crate::numerics::simd::F64x4;
use tick::Steps;

/// Number of movements in a block: their cubics (0.8 kB each at D = 7 and J = 3) fit into the first-level cache.
const BLOCK: usize = 16;

/// Clocks, scalar state and propagators of a block of places.
#[derive(Clone, Copy, Debug)]
struct SteadyBlock {
    time: CompensatedSums<BLOCK>,
    clock: CompensatedSums<BLOCK>,
    /// ρ.
    rate: [f64; BLOCK],
    /// Clock interval of a substep.
    h: [f64; BLOCK],
    /// Clock from which on a tick would reach the end.
    last: [f64; BLOCK],
    /// Lag ℓ of the frame at the clock.
    lag: [f64; BLOCK],
    /// Amplitudes r, and their commands r₀.
    amplitude: [[f64; BLOCK]; 2],
    /// Cells of the transport profile.
    cells: TransportCells<BLOCK>,
    /// Number of substeps of a tick, zero for an empty place.
    n_substeps: [u32; BLOCK],
    propagators: [RestingPropagator; BLOCK],
}

/// State and commands of two groups of DoFs, the second of which may be unused.
#[derive(Clone, Copy, Debug, Default)]
struct SteadyPair {
    position: Line,
    z: Line,
    w: CubicSample<Line>,
    centre: Line,
    displacement: Line,
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
    flush_level: f64,
}

/// Places for movements of one primitive, steady or empty.
#[derive(Clone, Debug)]
pub(in crate::motion) struct SteadyMovements {
    n_groups: usize,
    /// Number of movements.
    n_steady: usize,
    blocks: Vec<SteadyBlock>,
    /// By movements and pairs of groups, of whole blocks as the styles.
    pairs: Vec<SteadyPair>,
    styles: Vec<F64x4>,
}

impl Controller {
    /// Returns the settings of its steady ticks.
    pub(in crate::motion) fn steady_tick(&self) -> SteadyTick {
        SteadyTick { dt: self.dt, flush_level: self.flush_level }
    }

    /// Returns whether the next tick is a steady one.
    pub(in crate::motion) fn is_steady(&self) -> bool {
        let rate = first_element(self.rate.value());
        self.clock.value() < self.last_steady_clock()
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
            && rate * self.dt > 0.0
            && self.propagator.step() == rate * (self.dt / self.steady_substeps())
    }

    /// Returns the clock from which on a steady tick would reach the end.
    fn last_steady_clock(&self) -> f64 {
        match self.primitive.canonical() {
            Canonical::Discrete { u_end, .. } => u_end - first_element(self.rate.value()) * self.dt * (1.0 + ROUNDING),
            Canonical::Rhythmic { .. } => f64::INFINITY,
        }
    }

    /// Returns the number of substeps of a tick while no command is in transition.
    fn steady_substeps(&self) -> f64 {
        let n = first_element(self.rate.value()) * self.dt / self.max_clock_step;
        if n <= 1.0 { 1.0 } else { n.ceil().min(MAX_SUBSTEPS) }
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

impl SteadyMovements {
    /// Returns `n` empty places.
    pub(in crate::motion) fn new(controller: &Controller, n: usize) -> Self {
        let (n_groups, n_style_groups) = (controller.groups.len(), controller.style.value().len());
        let (numbers, n) = ([0.0; BLOCK], n.next_multiple_of(BLOCK));
        let block = SteadyBlock {
            time: CompensatedSums::ZERO,
            clock: CompensatedSums::ZERO,
            rate: numbers,
            h: numbers,
            last: numbers,
            lag: numbers,
            amplitude: [numbers; 2],
            cells: TransportCells::FIRST,
            n_substeps: [0; BLOCK],
            propagators: [controller.propagator.resting; BLOCK],
        };
        Self {
            n_groups,
            n_steady: 0,
            blocks: vec![block; n / BLOCK],
            pairs: vec![SteadyPair::default(); n * n_groups.div_ceil(2)],
            styles: vec![F64x4::ZERO; n * n_style_groups],
        }
    }

    /// Returns whether a place holds a movement.
    pub(in crate::motion) fn holds(&self, place: usize) -> bool {
        self.blocks[place / BLOCK].n_substeps[place % BLOCK] > 0
    }

    /// Returns the number of movements.
    pub(in crate::motion) fn len(&self) -> usize {
        self.n_steady
    }

    /// Takes a movement over if it is steady.
    pub(in crate::motion) fn admit(&mut self, place: usize, controller: &Controller) {
        if !controller.is_steady() {
            return;
        }
        self.n_steady += 1;
        let (block, i) = (&mut self.blocks[place / BLOCK], place % BLOCK);
        block.time.set(i, controller.time);
        block.clock.set(i, controller.clock);
        block.rate[i] = first_element(controller.rate.value());
        block.h[i] = controller.propagator.step();
        block.lag[i] = controller.frame_lag;
        (block.amplitude[0][i], block.amplitude[1][i]) = (controller.r, first_element(controller.amplitude.value()));
        block.cells.set(i, &controller.transport_segment, &controller.primitive.transport);
        block.last[i] = controller.last_steady_clock();
        // A tick has far fewer substeps.
        block.n_substeps[i] = controller.steady_substeps() as u32;
        block.propagators[i] = controller.propagator.resting;
        let style = controller.style.value();
        self.styles[place * style.len()..][..style.len()].copy_from_slice(style);
        let n_pairs = self.n_groups.div_ceil(2);
        for (index, group) in controller.groups.iter().enumerate() {
            let pair = &mut self.pairs[place * n_pairs + index / 2];
            Block::store(controller.position[index], &mut pair.position, index);
            Block::store(group.z, &mut pair.z, index);
            Block::store(group.w.value, &mut pair.w.value, index);
            Block::store(group.w.slope, &mut pair.w.slope, index);
            Block::store(controller.centre.value()[index], &mut pair.centre, index);
            Block::store(group.displacement, &mut pair.displacement, index);
        }
    }

    /// Empties a place; [`Self::write`] has the state.
    pub(in crate::motion) fn release(&mut self, place: usize) {
        if std::mem::take(&mut self.blocks[place / BLOCK].n_substeps[place % BLOCK]) > 0 {
            self.n_steady -= 1;
        }
    }

    /// Writes the state of a movement to its controller, whose commands are those of the movement.
    pub(in crate::motion) fn write(&self, place: usize, controller: &mut Controller) {
        let (block, i) = (&self.blocks[place / BLOCK], place % BLOCK);
        let (time, clock) = (block.time.get(i), block.clock.get(i));
        let (r, lag) = (block.amplitude[0][i], block.lag[i]);
        (controller.time, controller.clock, controller.r, controller.frame_lag) = (time, clock, r, lag);
        controller.transport_segment = controller.primitive.transport.segment_of_cell(block.cells.get(i));
        controller.read_forcing();
        let (gate, attractor) = (controller.gate(), controller.primitive.attractor());
        let TransportSample { slope, bend, .. } = controller.transport_segment.lag(clock.value());
        let n_pairs = self.n_groups.div_ceil(2);
        for (index, group) in controller.groups.iter_mut().enumerate() {
            let SteadyPair { position, z, w, centre, displacement } = &self.pairs[place * n_pairs + index / 2];
            let [position, z, centre, displacement] =
                [position, z, centre, displacement].map(|line| <F64x4 as Block>::load(line, index));
            let w = CubicSample { value: Block::load(&w.value, index), slope: Block::load(&w.slope, index) };
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
        let n_groups = self.n_groups;
        compute_blocks(Steps { movements: self, primitive, tick, mask, rows, ending }, n_groups);
    }
}
