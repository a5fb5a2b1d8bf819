//! Clocks of steady movements over a substep, and their positions in the tables.

use super::{BLOCK, SteadyBlock};
use crate::dynamics::canonical::{Canonical, amplitude};
use crate::model::primitive::Primitive;
use crate::numerics::blocks::Block;
use crate::numerics::simd::{Register, WIDTH};

/// Substep of the movements of a block.
pub(super) struct Substep {
    /// True for a movement that takes the substep.
    pub(super) is_active: [bool; BLOCK],
    /// Cell of the forcing table at the end, and the clock since its first knot.
    pub(super) cell: [f64; BLOCK],
    pub(super) t: [f64; BLOCK],
    /// Amplitude r′ at the end.
    pub(super) amplitude_slope: [f64; BLOCK],
    /// Lag ℓ of the frame at the begin, and ℓ′ and ℓ″ at the end.
    pub(super) lag: [f64; BLOCK],
    pub(super) frame_slopes: [[f64; BLOCK]; 2],
}

impl Substep {
    pub(super) const EMPTY: Self = Self {
        is_active: [false; BLOCK],
        cell: [0.0; BLOCK],
        t: [0.0; BLOCK],
        amplitude_slope: [0.0; BLOCK],
        lag: [0.0; BLOCK],
        frame_slopes: [[0.0; BLOCK]; 2],
    };
}

// Blocks that move as a whole are advanced in registers: loops over arrays are no vector instructions in the wheel, of which the
// last pass optimises for size.
#[allow(clippy::needless_range_loop)] // See `Kernel`.
impl SteadyBlock {
    /// Begins a tick of the movements that are steady, of this tick and before their end. Returns their numbers of substeps, zero
    /// for the others, and adds those at their end to `ending`. The block begins with place `first`.
    #[inline(always)]
    pub(super) fn begin<B: Block>(
        &mut self,
        first: usize,
        dt: f64,
        mask: Option<&[bool]>,
        ending: &mut Vec<u32>,
    ) -> [u32; BLOCK] {
        let mut remaining = self.n_substeps;
        if let Some(mask) = mask {
            for (remaining, is_selected) in remaining.iter_mut().zip(&mask[first..]) {
                *remaining *= u32::from(*is_selected);
            }
        }
        for start in (0..BLOCK).step_by(WIDTH) {
            let (u, last) =
                (B::Group::read_all(&self.clock.values()[start..]), B::Group::read_all(&self.last[start..]));
            if last.simd_le(u).to_bitmask() != 0 {
                for i in (start..start + WIDTH).filter(|i| self.clock.get(*i).value() >= self.last[*i]) {
                    if std::mem::take(&mut remaining[i]) > 0 {
                        ending.push((first + i) as u32);
                    }
                }
            }
        }
        if remaining == [1; BLOCK] {
            for i in (0..BLOCK).step_by(B::LANES) {
                self.time.add_block(i, B::splat(dt));
            }
        } else {
            for i in (0..BLOCK).filter(|i| remaining[*i] > 0) {
                self.time.add(i, dt);
            }
        }
        remaining
    }

    /// Advances the clocks of the movements with remaining substeps by one of these.
    #[inline(always)]
    pub(super) fn advance<B: Block, const RHYTHMIC: bool>(
        &mut self,
        remaining: &mut [u32; BLOCK],
        primitive: &Primitive,
        substep: &mut Substep,
    ) {
        let (table, canonical) = (primitive.forcing_table(), primitive.canonical());
        substep.lag = self.lag;
        if !RHYTHMIC && *remaining == [1; BLOCK] {
            (substep.is_active, *remaining) = ([true; BLOCK], [0; BLOCK]);
            for i in (0..BLOCK).step_by(B::LANES) {
                let [cell, t] = table.positions(self.clock.add_block(i, B::read_all(&self.h[i..])));
                cell.write_all(&mut substep.cell[i..]);
                t.write_all(&mut substep.t[i..]);
            }
        } else {
            for i in 0..BLOCK {
                substep.is_active[i] = remaining[i] > 0;
                if !substep.is_active[i] {
                    continue;
                }
                remaining[i] -= 1;
                let mut u = self.clock.add(i, self.h[i]);
                if RHYTHMIC && let Canonical::Rhythmic { mu } = canonical {
                    u = self.clock.wrap(i);
                    let [r, target] = [self.amplitude[0][i], self.amplitude[1][i]];
                    self.amplitude[0][i] = amplitude(mu, r, target, self.h[i]);
                    substep.amplitude_slope[i] = mu * (target - self.amplitude[0][i]);
                }
                let (cell, t) = table.position(u);
                (substep.cell[i], substep.t[i]) = (f64::from(cell), t);
            }
        }
        let [slopes, bends] = &mut substep.frame_slopes;
        primitive.transport.lags_from::<B, BLOCK>(&mut self.cells, self.clock.values(), [&mut self.lag, slopes, bends]);
    }
}
