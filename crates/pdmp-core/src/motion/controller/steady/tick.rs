//! Tick of steady movements, in blocks.
//!
//! A block first advances the clocks of its movements and finds their places in the tables (`substeps`), then their output
//! systems: the second part waits for neither the first nor the memory of the forcing table.

use super::super::group::{Gate, add_frame_motion};
use super::substeps::{BLOCK, Substeps};
use super::{Rows, SteadyMovements, SteadyTick};
use crate::dynamics::canonical::Canonical;
use crate::dynamics::output_system::{CubicSample, State};
use crate::model::primitive::Primitive;
use crate::numerics::blocks::{Block, BlockKernel};
use crate::numerics::simd::{WIDTH, flush, groups, unpack};

/// Kernel of [`SteadyMovements::step`].
pub(super) struct Steps<'a, 'b> {
    pub(super) movements: &'a mut SteadyMovements,
    pub(super) primitive: &'a Primitive,
    pub(super) tick: SteadyTick,
    pub(super) mask: Option<&'a [bool]>,
    pub(super) rows: &'a mut Rows<'b>,
    pub(super) ending: &'a mut Vec<u32>,
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
        let (mut substeps, mut remaining, mut responses) =
            (Substeps::default(), [0; BLOCK], [State::<B>::default(); BLOCK]);
        for first in (0..self.movements.clocks.n_substeps.len()).step_by(BLOCK) {
            let is_whole = self.begin_all::<RHYTHMIC>(first, &mut substeps);
            if !is_whole {
                self.begin_some(first, &mut remaining);
            }
            loop {
                let n =
                    if is_whole { BLOCK } else { self.begin_next::<RHYTHMIC>(first, &mut remaining, &mut substeps) };
                self.finish::<B, RHYTHMIC>(&substeps, n, is_whole, &mut responses);
                if is_whole || n == 0 {
                    break;
                }
            }
        }
    }

    /// Advances the output systems of a block of movements by a substep, and writes their motion. `is_whole` if their rows
    /// follow each other.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn finish<B: Block, const RHYTHMIC: bool>(
        &mut self,
        substeps: &Substeps,
        n: usize,
        is_whole: bool,
        responses: &mut [State<B>; BLOCK],
    ) {
        let Self { movements, primitive, rows, .. } = self;
        let n_groups = movements.n_groups;
        let (n_styles, n_dofs, n_pairs) = (primitive.n_styles(), primitive.n_dofs(), n_groups.div_ceil(2));
        let attractor = primitive.attractor();
        let flush_level = B::splat(self.tick.flush_level);
        let n = n.min(BLOCK);
        let mut group = 0;
        while group < n_groups {
            // Two short loops, of which the processor overlaps more movements than of a long one.
            // A known number of styles saves a fifth of the first one.
            match n_styles {
                1 => respond::<B, RHYTHMIC, 1>(movements, primitive, substeps, n, group, responses),
                2 => respond::<B, RHYTHMIC, 2>(movements, primitive, substeps, n, group, responses),
                3 => respond::<B, RHYTHMIC, 3>(movements, primitive, substeps, n, group, responses),
                4 => respond::<B, RHYTHMIC, 4>(movements, primitive, substeps, n, group, responses),
                _ => respond::<B, RHYTHMIC, 0>(movements, primitive, substeps, n, group, responses),
            }
            for i in 0..n {
                let (place, propagator) = (substeps.place[i], &movements.propagators[substeps.propagator[i] as usize]);
                let pair = &mut movements.pairs[place * n_pairs + group / 2];
                let (centre, displacement) = (B::load(&pair.centre, group), B::load(&pair.displacement, group));
                let (start, origin) =
                    (centre + displacement * substeps.lags[0][i], centre + displacement * substeps.lags[1][i]);
                let before = State { e: B::load(&pair.position, group) - start, z: B::load(&pair.z, group) };
                let next = propagator.advance_by(before, responses[i]);
                let (y, z) = (flush(origin + next.e, flush_level), flush(next.z, flush_level));
                y.store(&mut pair.position, group);
                z.store(&mut pair.z, group);
                let gate = Gate { r: 1.0, r_slope: 0.0, phase_rate: 1.0, rate: [substeps.rate[i], 0.0] };
                let frame_slopes = [substeps.frame_slopes[0][i], substeps.frame_slopes[1][i]];
                let w = CubicSample { value: B::load(&pair.w.value, group), slope: B::load(&pair.w.slope, group) };
                let w = add_frame_motion(w, displacement, frame_slopes);
                let [y_dot, y_ddot] = gate.motion(attractor, State { e: y - origin, z }, w);
                let first = place * n_dofs + group * WIDTH;
                if is_whole && i + 1 < n && n_groups <= B::GROUPS {
                    // The lanes beyond the last DoF fall into the next row, all of which is written next.
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

/// Evaluates w and w′ of a block of movements at the end of a substep, and the responses of their states to the forcing; J is
/// the number of styles, or zero for any number.
#[inline(always)]
#[allow(clippy::needless_range_loop)] // See `Kernel`.
fn respond<B: Block, const RHYTHMIC: bool, const J: usize>(
    movements: &mut SteadyMovements,
    primitive: &Primitive,
    substeps: &Substeps,
    n: usize,
    group: usize,
    responses: &mut [State<B>; BLOCK],
) {
    let (n_styles, table) = (if J == 0 { primitive.n_styles() } else { J }, primitive.forcing_table());
    let (n_style_groups, n_pairs) = (groups(n_styles), movements.n_groups.div_ceil(2));
    for i in 0..n.min(BLOCK) {
        let (place, index) = (substeps.place[i], substeps.index[i]);
        let style = unpack(&movements.styles[place * n_style_groups..][..n_style_groups], n_styles);
        let CubicSample { value, slope } = table.sample_block::<B, J>(index, group, style);
        // The slope is one of the sums with zero of `Gate::forcing`, which give zero its sign.
        let slope = slope + B::default();
        let next = if RHYTHMIC {
            let r = [substeps.r[0][i], substeps.r[1][i]];
            CubicSample { value: value * r[0], slope: slope * r[0] + value * r[1] }
        } else {
            CubicSample { value, slope }
        };
        let propagator = &movements.propagators[substeps.propagator[i] as usize];
        let pair = &mut movements.pairs[place * n_pairs + group / 2];
        let w = CubicSample { value: B::load(&pair.w.value, group), slope: B::load(&pair.w.slope, group) };
        next.value.store(&mut pair.w.value, group);
        next.slope.store(&mut pair.w.slope, group);
        responses[i] = propagator.respond([w, next]);
    }
}
