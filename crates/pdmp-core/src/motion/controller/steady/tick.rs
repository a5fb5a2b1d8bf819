//! Tick of steady movements, in blocks.
//!
//! A block first advances the clocks of its movements and finds their places in the tables (`substeps`), then their output
//! systems: the second part waits for neither the first nor the memory of the forcing table.

use super::super::group::{Gate, add_frame_motion};
use super::substeps::Substep;
use super::{BLOCK, Rows, SteadyBlock, SteadyMovements, SteadyPair, SteadyTick};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{CubicSample, State};
use crate::model::primitive::Primitive;
use crate::numerics::blocks::{Block, BlockKernel};
use crate::numerics::simd::{F64x4, WIDTH, flush, groups, unpack};

/// Kernel of [`SteadyMovements::step`].
pub(super) struct Steps<'a, 'b> {
    pub(super) movements: &'a mut SteadyMovements,
    pub(super) primitive: &'a Primitive,
    pub(super) tick: SteadyTick,
    pub(super) mask: Option<&'a [bool]>,
    pub(super) rows: &'a mut Rows<'b>,
    pub(super) ending: &'a mut Vec<u32>,
}

/// Block of movements and the groups of a register over a substep.
#[derive(Clone, Copy)]
struct Part<'a> {
    block: &'a SteadyBlock,
    substep: &'a Substep,
    primitive: &'a Primitive,
    /// Place of the first movement.
    first: usize,
    /// First group.
    group: usize,
}

impl BlockKernel for Steps<'_, '_> {
    #[inline(always)]
    fn run<B: Block>(self) {
        // Constants of a discrete movement are known when the formulas are compiled.
        match self.primitive.canonical() {
            Canonical::Discrete { .. } => self.advance::<B, false>(),
            Canonical::Rhythmic { .. } => self.advance::<B, true>(),
        }
    }
}

impl Steps<'_, '_> {
    #[inline(always)]
    fn advance<B: Block, const RHYTHMIC: bool>(self) {
        let Self { movements: SteadyMovements { n_groups, blocks, pairs, styles, .. }, primitive, rows, .. } = self;
        let SteadyTick { dt, flush_level } = self.tick;
        let (pairs_of_block, styles_of_block) = (pairs.len() / blocks.len(), styles.len() / blocks.len());
        let vectors = pairs.chunks_exact_mut(pairs_of_block).zip(styles.chunks_exact(styles_of_block));
        let (mut substep, mut forcing) = (Substep::EMPTY, [CubicSample::<B>::default(); BLOCK]);
        for (index, (block, (pairs, styles))) in blocks.iter_mut().zip(vectors).enumerate() {
            let first = index * BLOCK;
            let mut remaining = block.begin::<B>(first, dt, self.mask, self.ending);
            while remaining != [0; BLOCK] {
                block.advance::<B, RHYTHMIC>(&mut remaining, primitive, &mut substep);
                for group in (0..*n_groups).step_by(B::GROUPS) {
                    let part = Part { block, substep: &substep, primitive, first, group };
                    // Two short loops, of which the processor overlaps more movements than of a long one.
                    // A known number of styles saves a fifth of the first one.
                    match primitive.n_styles() {
                        1 => part.force::<B, RHYTHMIC, 1>(styles, &mut forcing),
                        2 => part.force::<B, RHYTHMIC, 2>(styles, &mut forcing),
                        3 => part.force::<B, RHYTHMIC, 3>(styles, &mut forcing),
                        4 => part.force::<B, RHYTHMIC, 4>(styles, &mut forcing),
                        _ => part.force::<B, RHYTHMIC, 0>(styles, &mut forcing),
                    }
                    part.finish(pairs, &forcing, flush_level, rows);
                }
            }
        }
    }
}

impl Part<'_> {
    /// Evaluates w and w′ at the end of the substep; J is the number of styles, or zero for any number.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn force<B: Block, const RHYTHMIC: bool, const J: usize>(
        self,
        styles: &[F64x4],
        forcing: &mut [CubicSample<B>; BLOCK],
    ) {
        let Self { block, substep, primitive, group, .. } = self;
        let (n_styles, table) = (if J == 0 { primitive.n_styles() } else { J }, primitive.forcing_table());
        let n_style_groups = groups(n_styles);
        for (i, style) in (0..BLOCK).zip(styles.chunks_exact(n_style_groups)) {
            if !substep.is_active[i] {
                continue;
            }
            let style = unpack(style, n_styles);
            let CubicSample { value, slope } =
                table.sample_block::<B, J>([substep.cell[i], substep.t[i]], group, style);
            // The slope is one of the sums with zero of `Gate::forcing`, which give zero its sign.
            let slope = slope + B::default();
            forcing[i] = if RHYTHMIC {
                let r = [block.amplitude[0][i], substep.amplitude_slope[i]];
                CubicSample { value: value * r[0], slope: slope * r[0] + value * r[1] }
            } else {
                CubicSample { value, slope }
            };
        }
    }

    /// Advances the output systems by a substep, and writes their motion.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn finish<B: Block>(
        self,
        pairs: &mut [SteadyPair],
        forcing: &[CubicSample<B>; BLOCK],
        flush_level: f64,
        rows: &mut Rows,
    ) {
        let Self { block, substep, primitive, first, group } = self;
        let (attractor, flush_level, n_dofs) = (primitive.attractor(), B::splat(flush_level), primitive.n_dofs());
        let (n_groups, n_pairs) = (groups(n_dofs), groups(n_dofs).div_ceil(2));
        let overlaps = (substep.is_active == [true; BLOCK]) & (n_groups <= B::GROUPS);
        let pairs = &mut pairs[group / 2..];
        let Rows { position, velocity, acceleration } = rows;
        for i in 0..BLOCK {
            if !substep.is_active[i] {
                continue;
            }
            let pair = &mut pairs[i * n_pairs];
            let (centre, displacement) = (B::load(&pair.centre, group), B::load(&pair.displacement, group));
            let (start, origin) = (centre + displacement * substep.lag[i], centre + displacement * block.lag[i]);
            let before = State { e: B::load(&pair.position, group) - start, z: B::load(&pair.z, group) };
            let w = CubicSample { value: B::load(&pair.w.value, group), slope: B::load(&pair.w.slope, group) };
            let next = block.propagators[i].advance(before, [w, forcing[i]]);
            forcing[i].value.store(&mut pair.w.value, group);
            forcing[i].slope.store(&mut pair.w.slope, group);
            let (y, z) = (flush(origin + next.e, flush_level), flush(next.z, flush_level));
            y.store(&mut pair.position, group);
            z.store(&mut pair.z, group);
            let gate = Gate { r: 1.0, r_slope: 0.0, phase_rate: 1.0, rate: [block.rate[i], 0.0] };
            let frame_slopes = [substep.frame_slopes[0][i], substep.frame_slopes[1][i]];
            let w = add_frame_motion(forcing[i], displacement, frame_slopes);
            let [y_dot, y_ddot] = gate.motion(attractor, State { e: y - origin, z }, w);
            let begin = (first + i) * n_dofs + group * WIDTH;
            if overlaps && i + 1 < BLOCK {
                // The lanes beyond the last DoF fall into the next row, all of which is written next.
                let lanes = begin..begin + B::GROUPS * WIDTH;
                y.write_all(&mut position[lanes.clone()]);
                y_dot.write_all(&mut velocity[lanes.clone()]);
                y_ddot.write_all(&mut acceleration[lanes]);
            } else {
                let dofs = begin..begin + (n_dofs - group * WIDTH).min(B::GROUPS * WIDTH);
                y.write(&mut position[dofs.clone()]);
                y_dot.write(&mut velocity[dofs.clone()]);
                y_ddot.write(&mut acceleration[dofs]);
            }
        }
    }
}
