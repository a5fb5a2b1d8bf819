//! Tick of steady movements, in blocks.
//!
//! A block first advances the clocks of its movements and finds their places in the tables, then their output systems:
//! the second part waits for neither the first nor the memory of the forcing table.

use super::super::group::{ForcingSample, Gate, add_frame_motion};
use super::super::substeps::ROUNDING;
use super::{Rows, SteadyMovements, SteadyTick};
use crate::dynamics::canonical::{Canonical, amplitude};
use crate::dynamics::forcing_table::TableIndex;
use crate::dynamics::output_system::{CubicSample, State};
use crate::dynamics::transport::TransportSample;
use crate::model::primitive::Primitive;
use crate::numerics::simd::{Kernel, Register, WIDTH, flush, unpack, unpad};

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

impl Kernel for Steps<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Register>(mut self) {
        // Constants of a discrete movement are known when the formulas are compiled.
        match self.primitive.canonical() {
            Canonical::Discrete { .. } => self.advance::<T, false>(),
            Canonical::Rhythmic { .. } => self.advance::<T, true>(),
        }
    }
}

impl Steps<'_, '_> {
    #[inline(always)]
    fn advance<T: Register, const RHYTHMIC: bool>(&mut self) {
        let (mut block, mut n) = ([Substep::default(); BLOCK], 0);
        for place in 0..self.movements.clocks.len() {
            if !self.movements.is_steady[place] || self.mask.is_some_and(|mask| !mask[place]) {
                continue;
            }
            let clock = &mut self.movements.clocks[place];
            let n_substeps = clock.n_substeps;
            if let Canonical::Discrete { u_end, .. } = self.primitive.canonical()
                && u_end - clock.clock.value() <= f64::from(n_substeps) * clock.h * (1.0 + ROUNDING)
            {
                self.ending.push(place as u32);
                continue;
            }
            clock.time.add(self.tick.dt);
            for _ in 1..n_substeps {
                let substep = self.begin::<RHYTHMIC>(place);
                self.finish::<T, RHYTHMIC>(&[substep]);
            }
            block[n] = self.begin::<RHYTHMIC>(place);
            n += 1;
            if n == BLOCK {
                self.finish::<T, RHYTHMIC>(&block);
                n = 0;
            }
        }
        self.finish::<T, RHYTHMIC>(&block[..n]);
    }

    /// Advances the clock of a movement by a substep.
    #[inline(always)]
    fn begin<const RHYTHMIC: bool>(&mut self, place: usize) -> Substep {
        let Self { movements: SteadyMovements { clocks, amplitudes, .. }, primitive, last, .. } = self;
        let clock = &mut clocks[place];
        clock.clock.add(clock.h);
        let mut r = [1.0, 0.0];
        if RHYTHMIC && let Canonical::Rhythmic { mu } = primitive.canonical() {
            clock.clock.wrap();
            let [value, target] = &mut amplitudes[place];
            *value = amplitude(mu, *value, *target, clock.h);
            r = [*value, mu * (*target - *value)];
        }
        let u = clock.clock.value();
        let TransportSample { value, slope, bend } = primitive.transport.lag_from(&mut clock.cell, u);
        let lags = [std::mem::replace(&mut clock.lag, value), value];
        let index = primitive.forcing_table().demonstrated_index(u);
        if !index.is_in_cell_of(*last) {
            primitive.forcing_table().prefetch_at(index);
        }
        *last = index;
        let propagator = clock.propagator as usize;
        Substep { place, propagator, index, rate: clock.rate, r, lags, frame_slopes: [slope, bend] }
    }

    /// Advances the output systems of movements by a substep, and writes their motion.
    #[inline(always)]
    fn finish<T: Register, const RHYTHMIC: bool>(&mut self, substeps: &[Substep]) {
        let Self { movements, primitive, rows, .. } = self;
        let (n_groups, n_style_groups) = (movements.n_groups, movements.n_style_groups);
        let (n_styles, n_dofs) = (primitive.n_styles(), primitive.n_dofs());
        let (table, attractor) = (primitive.forcing_table(), primitive.attractor());
        let flush_level = T::splat(self.tick.flush_level);
        for &Substep { place, propagator, index, rate, r, lags, frame_slopes } in substeps {
            let gate = Gate { r: r[0], r_slope: r[1], phase_rate: 1.0, rate: [rate, 0.0] };
            let propagator = &movements.propagators[propagator];
            let style = unpack(&movements.styles[place * n_style_groups..][..n_style_groups], n_styles);
            let row = place * n_dofs..(place + 1) * n_dofs;
            let position = &mut rows.position[row.clone()];
            let velocity = &mut rows.velocity[row.clone()];
            let acceleration = &mut rows.acceleration[row];
            let groups = &mut movements.groups[place * n_groups..][..n_groups];
            for (group, state) in groups.iter_mut().enumerate() {
                let from = CubicSample { value: T::load(&state.w.value), slope: T::load(&state.w.slope) };
                let to = if RHYTHMIC {
                    gate.forcing::<T>(&ForcingSample::read::<T>(table, index, group, style, None))
                } else {
                    // The same for r = 1 and r′ = 0, with one of the sums with zero, which gives zero its sign.
                    let CubicSample { value, slope } = table.sample::<T>(index, group, style);
                    CubicSample { value, slope: slope + T::default() }
                };
                state.w = CubicSample { value: to.value.store(), slope: to.slope.store() };
                let (centre, displacement) = (T::load(&state.centre), T::load(&state.displacement));
                let (start, origin) = (centre + displacement * lags[0], centre + displacement * lags[1]);
                let w = add_frame_motion(to, displacement, frame_slopes);
                let before = State { e: T::load(&state.position) - start, z: T::load(&state.z) };
                let next = propagator.advance(before, [from, to]);
                let (y, z) = (flush(origin + next.e, flush_level), flush(next.z, flush_level));
                (state.position, state.z) = (y.store(), z.store());
                let [y_dot, y_ddot] = gate.motion(attractor, State { e: y - origin, z }, w);
                let dofs = group * WIDTH..n_dofs.min((group + 1) * WIDTH);
                unpad(y.store(), &mut position[dofs.clone()]);
                unpad(y_dot.store(), &mut velocity[dofs.clone()]);
                unpad(y_ddot.store(), &mut acceleration[dofs]);
            }
        }
    }
}
