//! Tick of steady movements, in blocks.
//!
//! A block first advances the clocks of its movements and finds their places in the tables, then their output systems:
//! the second part waits for neither the first nor the memory of the forcing table.

use super::super::group::{Gate, add_frame_motion};
use super::super::substeps::ROUNDING;
use super::{Rows, SteadyMovements, SteadyTick};
use crate::dynamics::canonical::{Canonical, amplitude};
use crate::dynamics::forcing_table::TableIndex;
use crate::dynamics::output_system::{CubicSample, State};
use crate::dynamics::transport::TransportSample;
use crate::model::primitive::Primitive;
use crate::numerics::blocks::{Block, BlockKernel};
use crate::numerics::simd::{WIDTH, flush, unpack};

/// Number of movements in a block: their cubics (0.8 kB each at D = 7 and J = 3) fit into the first-level cache.
const BLOCK: usize = 16;

/// Kernel of [`SteadyMovements::step`].
pub(super) struct Steps<'a, 'b> {
    pub(super) movements: &'a mut SteadyMovements,
    pub(super) primitive: &'a Primitive,
    pub(super) tick: SteadyTick,
    pub(super) mask: Option<&'a [bool]>,
    pub(super) rows: &'a mut Rows<'b>,
    pub(super) ending: &'a mut Vec<u32>,
    /// Position in the forcing table that was prefetched last.
    pub(super) last: TableIndex,
}

/// Clock of a movement over a substep.
#[derive(Clone, Copy, Default)]
struct Substep {
    place: usize,
    propagator: usize,
    index: TableIndex,
    rate: f64,
    /// Amplitude r and r′.
    r: [f64; 2],
    /// Lags ℓ of the frame at both ends, and ℓ′ and ℓ″ at the end.
    lags: [f64; 2],
    frame_slopes: [f64; 2],
}

impl BlockKernel for Steps<'_, '_> {
    #[inline(always)]
    fn run<B: Block>(mut self) {
        // Constants of a discrete movement are known when the formulas are compiled.
        match self.primitive.canonical() {
            Canonical::Discrete { .. } => self.advance::<B, false>(),
            Canonical::Rhythmic { .. } => self.advance::<B, true>(),
        }
    }
}

impl Steps<'_, '_> {
    #[inline(always)]
    fn advance<B: Block, const RHYTHMIC: bool>(&mut self) {
        let mut block = [Substep::default(); BLOCK];
        for first in (0..self.movements.is_steady.len()).step_by(BLOCK) {
            if self.begin_all::<RHYTHMIC>(first, &mut block) {
                self.finish::<B, RHYTHMIC>(&block, true);
            } else {
                let n = self.begin_some::<B, RHYTHMIC>(first, &mut block);
                self.finish::<B, RHYTHMIC>(&block[..n], false);
            }
        }
    }

    /// Advances the clocks of a whole block if all its movements are steady, of this tick, before their end and take one
    /// substep. Returns false if not, and then changes nothing.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn begin_all<const RHYTHMIC: bool>(&mut self, first: usize, block: &mut [Substep; BLOCK]) -> bool {
        let Self { movements: SteadyMovements { clocks, is_steady, .. }, primitive, mask, tick, .. } = self;
        let (Some(&steps), Some(present)) =
            (clocks.h[first..].first_chunk::<BLOCK>(), clocks.clock.block::<BLOCK>(first))
        else {
            return false;
        };
        let mut is_one = true;
        for i in first..first + BLOCK {
            is_one &= is_steady[i] & (clocks.n_substeps[i] == 1);
        }
        if let Some(mask) = mask {
            for i in first..first + BLOCK {
                is_one &= mask[i];
            }
        }
        if let Canonical::Discrete { u_end, .. } = primitive.canonical() {
            for i in 0..BLOCK {
                is_one &= u_end - present[i] > steps[i] * (1.0 + ROUNDING);
            }
        }
        if !is_one {
            return false;
        }
        clocks.time.add_each(first, &[tick.dt; BLOCK]);
        let ahead = clocks.clock.add_each(first, &steps);
        for i in 0..BLOCK {
            block[i] = self.locate::<RHYTHMIC>(first + i, ahead[i]);
        }
        true
    }

    /// Advances the clocks of the movements of a block one by one, and of those with several substeps all but the last. Returns
    /// the number of movements whose substep is left.
    #[inline(always)]
    fn begin_some<B: Block, const RHYTHMIC: bool>(&mut self, first: usize, block: &mut [Substep; BLOCK]) -> usize {
        let mut n = 0;
        for place in first..self.movements.is_steady.len().min(first + BLOCK) {
            if !self.movements.is_steady[place] || self.mask.is_some_and(|mask| !mask[place]) {
                continue;
            }
            let clocks = &mut self.movements.clocks;
            let (n_substeps, h) = (clocks.n_substeps[place], clocks.h[place]);
            if let Canonical::Discrete { u_end, .. } = self.primitive.canonical()
                && u_end - clocks.clock.get(place).value() <= f64::from(n_substeps) * h * (1.0 + ROUNDING)
            {
                self.ending.push(place as u32);
                continue;
            }
            clocks.time.add_each(place, &[self.tick.dt]);
            for k in 1..=n_substeps {
                let [u] = self.movements.clocks.clock.add_each(place, &[h]);
                block[n] = self.locate::<RHYTHMIC>(place, u);
                if k < n_substeps {
                    let substep = [block[n]];
                    self.finish::<B, RHYTHMIC>(&substep, false);
                }
            }
            n += 1;
        }
        n
    }

    /// Finds the place of a movement in the tables at clock `u`, to which its clock has advanced.
    #[inline(always)]
    fn locate<const RHYTHMIC: bool>(&mut self, place: usize, mut u: f64) -> Substep {
        let Self { movements: SteadyMovements { clocks, amplitudes, .. }, primitive, last, .. } = self;
        let mut r = [1.0, 0.0];
        if RHYTHMIC && let Canonical::Rhythmic { mu } = primitive.canonical() {
            let mut clock = clocks.clock.get(place);
            clock.wrap();
            clocks.clock.set(place, clock);
            u = clock.value();
            let [value, target] = &mut amplitudes[place];
            *value = amplitude(mu, *value, *target, clocks.h[place]);
            r = [*value, mu * (*target - *value)];
        }
        let TransportSample { value, slope, bend } = primitive.transport.lag_from(&mut clocks.cell[place], u);
        let lags = [std::mem::replace(&mut clocks.lag[place], value), value];
        let index = primitive.forcing_table().demonstrated_index(u);
        if !index.is_in_cell_of(*last) {
            primitive.forcing_table().prefetch_at(index);
        }
        *last = index;
        let propagator = clocks.propagator[place] as usize;
        Substep { place, propagator, index, rate: clocks.rate[place], r, lags, frame_slopes: [slope, bend] }
    }

    /// Advances the output systems of a block of movements by a substep, and writes their motion. `is_whole` if their rows
    /// follow each other.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn finish<B: Block, const RHYTHMIC: bool>(&mut self, substeps: &[Substep], is_whole: bool) {
        let Self { movements, primitive, rows, .. } = self;
        let n_groups = movements.n_groups;
        let (n_styles, n_dofs, n_pairs) = (primitive.n_styles(), primitive.n_dofs(), n_groups.div_ceil(2));
        let attractor = primitive.attractor();
        let flush_level = B::splat(self.tick.flush_level);
        let substeps = &substeps[..substeps.len().min(BLOCK)];
        let (mut forcing, mut distances) = ([CubicSample::<B>::default(); BLOCK], [B::default(); BLOCK]);
        let mut group = 0;
        while group < n_groups {
            // Three short loops, of which the processor overlaps more movements than of a long one.
            // A known number of styles saves a fifth of the first one.
            match n_styles {
                1 => force::<B, RHYTHMIC, 1>(movements, primitive, substeps, group, &mut forcing),
                2 => force::<B, RHYTHMIC, 2>(movements, primitive, substeps, group, &mut forcing),
                3 => force::<B, RHYTHMIC, 3>(movements, primitive, substeps, group, &mut forcing),
                4 => force::<B, RHYTHMIC, 4>(movements, primitive, substeps, group, &mut forcing),
                _ => force::<B, RHYTHMIC, 0>(movements, primitive, substeps, group, &mut forcing),
            }
            for i in 0..substeps.len() {
                let Substep { place, propagator, lags, .. } = substeps[i];
                let propagator = &movements.propagators[propagator];
                let pair = &mut movements.pairs[place * n_pairs + group / 2];
                let from = CubicSample { value: B::load(&pair.w.value, group), slope: B::load(&pair.w.slope, group) };
                forcing[i].value.store(&mut pair.w.value, group);
                forcing[i].slope.store(&mut pair.w.slope, group);
                let (centre, displacement) = (B::load(&pair.centre, group), B::load(&pair.displacement, group));
                let (start, origin) = (centre + displacement * lags[0], centre + displacement * lags[1]);
                let before = State { e: B::load(&pair.position, group) - start, z: B::load(&pair.z, group) };
                let next = propagator.advance(before, [from, forcing[i]]);
                let (y, z) = (flush(origin + next.e, flush_level), flush(next.z, flush_level));
                y.store(&mut pair.position, group);
                z.store(&mut pair.z, group);
                distances[i] = y - origin;
            }
            for i in 0..substeps.len() {
                let Substep { place, rate, frame_slopes, .. } = substeps[i];
                let gate = Gate { r: 1.0, r_slope: 0.0, phase_rate: 1.0, rate: [rate, 0.0] };
                let pair = &movements.pairs[place * n_pairs + group / 2];
                let w = add_frame_motion(forcing[i], B::load(&pair.displacement, group), frame_slopes);
                let state = State { e: distances[i], z: B::load(&pair.z, group) };
                let [y_dot, y_ddot] = gate.motion(attractor, state, w);
                let y = B::load(&pair.position, group);
                let first = place * n_dofs + group * WIDTH;
                if is_whole && i + 1 < substeps.len() && group + B::GROUPS == n_groups {
                    // The lanes beyond the last DoF fall into the next row, which is written next.
                    let lanes = first..first + B::GROUPS * WIDTH;
                    y.write_all(&mut rows.position[lanes.clone()]);
                    y_dot.write_all(&mut rows.velocity[lanes.clone()]);
                    y_ddot.write_all(&mut rows.acceleration[lanes]);
                } else {
                    let dofs = first..first + (n_dofs - group * WIDTH).min(B::GROUPS * WIDTH);
                    y.write(&mut rows.position[dofs.clone()]);
                    y_dot.write(&mut rows.velocity[dofs.clone()]);
                    y_ddot.write(&mut rows.acceleration[dofs]);
                }
            }
            group += B::GROUPS;
        }
    }
}

/// Evaluates w and w′ of a block of movements; J is the number of styles, or zero for any number.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // See `Kernel`.
fn force<B: Block, const RHYTHMIC: bool, const J: usize>(
    movements: &SteadyMovements,
    primitive: &Primitive,
    substeps: &[Substep],
    group: usize,
    forcing: &mut [CubicSample<B>; BLOCK],
) {
    let (n_styles, n_style_groups, table) = (primitive.n_styles(), movements.n_style_groups, primitive.forcing_table());
    for i in 0..substeps.len().min(BLOCK) {
        let Substep { place, index, r, .. } = substeps[i];
        let style = unpack(&movements.styles[place * n_style_groups..][..n_style_groups], n_styles);
        let CubicSample { value, slope } = table.sample_block::<B, J>(index, group, style);
        // The slope is one of the sums with zero of `Gate::forcing`, which give zero its sign.
        let slope = slope + B::default();
        forcing[i] = if RHYTHMIC {
            CubicSample { value: value * r[0], slope: slope * r[0] + value * r[1] }
        } else {
            CubicSample { value, slope }
        };
    }
}
