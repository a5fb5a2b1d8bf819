//! Clocks of steady movements over a substep, and their places in the tables.

use super::super::substeps::ROUNDING;
use super::SteadyMovements;
use super::tick::Steps;
use crate::dynamics::canonical::{Canonical, amplitude};
use crate::dynamics::forcing_table::TableIndex;

/// Number of movements in a block: their cubics (0.8 kB each at D = 7 and J = 3) fit into the first-level cache.
pub(super) const BLOCK: usize = 16;

/// Clocks of the movements of a block over a substep.
pub(super) struct Substeps {
    pub(super) place: [usize; BLOCK],
    pub(super) propagator: [u32; BLOCK],
    pub(super) index: [TableIndex; BLOCK],
    pub(super) rate: [f64; BLOCK],
    /// Amplitudes r and r′.
    pub(super) r: [[f64; BLOCK]; 2],
    /// Lags ℓ of the frame at both ends, and ℓ′ and ℓ″ at the end.
    pub(super) lags: [[f64; BLOCK]; 2],
    pub(super) frame_slopes: [[f64; BLOCK]; 2],
}

impl Default for Substeps {
    fn default() -> Self {
        Self {
            place: [0; BLOCK],
            propagator: [0; BLOCK],
            index: [TableIndex::default(); BLOCK],
            rate: [0.0; BLOCK],
            r: [[1.0; BLOCK], [0.0; BLOCK]],
            lags: [[0.0; BLOCK]; 2],
            frame_slopes: [[0.0; BLOCK]; 2],
        }
    }
}

impl Steps<'_, '_> {
    /// Advances the clocks of a whole block if all its movements are steady, of this tick, before their end and take one
    /// substep. Returns false if not, and then changes nothing.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    pub(super) fn begin_all<const RHYTHMIC: bool>(&mut self, first: usize, substeps: &mut Substeps) -> bool {
        let Self { movements: SteadyMovements { clocks, .. }, primitive, mask, tick, .. } = self;
        let (Some(counts), Some(&steps), Some(present)) = (
            clocks.n_substeps[first..].first_chunk::<BLOCK>(),
            clocks.h[first..].first_chunk::<BLOCK>(),
            clocks.clock.block::<BLOCK>(first),
        ) else {
            return false;
        };
        let mut is_one = true;
        for i in 0..BLOCK {
            is_one &= counts[i] == 1;
        }
        if let Some(mask) = mask.and_then(|mask| mask[first..].first_chunk::<BLOCK>()) {
            for i in 0..BLOCK {
                is_one &= mask[i];
            }
        }
        if let Canonical::Discrete { u_end, .. } = primitive.canonical() {
            for i in 0..BLOCK {
                is_one &= u_end - present[i] > steps[i] * (1.0 + ROUNDING);
            }
        }
        if is_one {
            clocks.time.add_each(first, &[tick.dt; BLOCK]);
            let ahead = clocks.clock.add_each(first, &steps);
            self.locate::<RHYTHMIC, BLOCK>(first, ahead, 0, substeps);
        }
        is_one
    }

    /// Advances the times of the movements of a block that are steady, of this tick and before their end, and writes their
    /// numbers of substeps to `remaining`, zero for the others.
    pub(super) fn begin_some(&mut self, first: usize, remaining: &mut [u16; BLOCK]) {
        *remaining = [0; BLOCK];
        let clocks = &mut self.movements.clocks;
        for (i, place) in (first..clocks.n_substeps.len().min(first + BLOCK)).enumerate() {
            let n_substeps = clocks.n_substeps[place];
            if n_substeps == 0 || self.mask.is_some_and(|mask| !mask[place]) {
                continue;
            }
            if let Canonical::Discrete { u_end, .. } = self.primitive.canonical()
                && u_end - clocks.clock.get(place).value() <= f64::from(n_substeps) * clocks.h[place] * (1.0 + ROUNDING)
            {
                self.ending.push(place as u32);
                continue;
            }
            clocks.time.add_each(place, &[self.tick.dt]);
            remaining[i] = n_substeps;
        }
    }

    /// Advances the clocks of the movements of a block with remaining substeps by one. Returns the number of these movements.
    #[inline(always)]
    pub(super) fn begin_next<const RHYTHMIC: bool>(
        &mut self,
        first: usize,
        remaining: &mut [u16; BLOCK],
        substeps: &mut Substeps,
    ) -> usize {
        let mut n = 0;
        for (i, remaining) in remaining.iter_mut().enumerate() {
            if *remaining > 0 {
                *remaining -= 1;
                let clocks = &mut self.movements.clocks;
                let ahead = clocks.clock.add_each(first + i, &[clocks.h[first + i]]);
                self.locate::<RHYTHMIC, 1>(first + i, ahead, n, substeps);
                n += 1;
            }
        }
        n
    }

    /// Finds the places of N consecutive movements in the tables at clocks `u`, to which their clocks have advanced.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // See `Kernel`.
    fn locate<const RHYTHMIC: bool, const N: usize>(
        &mut self,
        first: usize,
        mut u: [f64; N],
        at: usize,
        to: &mut Substeps,
    ) {
        let Self { movements: SteadyMovements { clocks, amplitudes, .. }, primitive, .. } = self;
        if RHYTHMIC && let Canonical::Rhythmic { mu } = primitive.canonical() {
            for i in 0..N {
                let mut clock = clocks.clock.get(first + i);
                clock.wrap();
                clocks.clock.set(first + i, clock);
                u[i] = clock.value();
                let [value, target] = &mut amplitudes[first + i];
                *value = amplitude(mu, *value, *target, clocks.h[first + i]);
                (to.r[0][at + i], to.r[1][at + i]) = (*value, mu * (*target - *value));
            }
        }
        let (Some(cells), Some(lags), Some(rates), Some(propagators)) = (
            clocks.cell[first..].first_chunk_mut::<N>(),
            clocks.lag[first..].first_chunk_mut::<N>(),
            clocks.rate[first..].first_chunk::<N>(),
            clocks.propagator[first..].first_chunk::<N>(),
        ) else {
            return;
        };
        let [values, slopes, bends] = primitive.transport.lags_from(cells, &u);
        for i in 0..N {
            to.place[at + i] = first + i;
            to.propagator[at + i] = propagators[i];
            to.rate[at + i] = rates[i];
            to.lags[0][at + i] = lags[i];
            to.lags[1][at + i] = values[i];
            lags[i] = values[i];
            to.frame_slopes[0][at + i] = slopes[i];
            to.frame_slopes[1][at + i] = bends[i];
        }
        let table = primitive.forcing_table();
        for i in 0..N {
            to.index[at + i] = table.demonstrated_index(u[i]);
        }
    }
}
