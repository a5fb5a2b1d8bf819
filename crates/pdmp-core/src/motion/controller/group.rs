//! What the loop keeps of a group of DoFs, and its forcing term w from what the landscape holds.

use super::SETTLED;
use crate::dynamics::forcing_table::{ForcingTable, TableIndex};
use crate::dynamics::output_system::{Attractor, CubicSample, State};
use crate::motion::perturbation::{MIN_RANGE_RATIO, widest};
use crate::numerics::simd::{F64x4, Real, Register, pack};

/// What the loop keeps of a group of DoFs beside its motion.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Group {
    pub(super) forcing: Forcing,
    /// The forcing term at the clock.
    pub(super) w: CubicSample<F64x4>,
    /// The auxiliary state of Eq. (1).
    pub(super) z: F64x4,
    /// The way g − y₀ at the start, which the frame covers; zero where rhythmic.
    pub(super) way: F64x4,
    /// Distance from the goal at which each DoF has settled, and the least it may be.
    pub(super) tolerance: F64x4,
    pub(super) least: F64x4,
}

impl Group {
    /// As many as DoFs of these ranges need.
    pub(super) fn all(ranges: &[f64]) -> Vec<Self> {
        let still = F64x4::splat(MIN_RANGE_RATIO * widest(ranges));
        let group = |range: &F64x4| Self { least: range.max(still) * SETTLED, ..Self::default() };
        pack(ranges).iter().map(group).collect()
    }
}

/// What the landscape gives a group of DoFs at the clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Forcing {
    /// sᵀb.
    pub(super) shape: F64x4,
    /// Its derivative with respect to the phase's clock.
    pub(super) slope: F64x4,
    /// s′ᵀb.
    swing: F64x4,
}

impl Forcing {
    /// Reads a group at a place, for a style s and, while it is on its way, s′.
    #[inline(always)]
    pub(super) fn read<T: Register>(
        forcing_table: &ForcingTable,
        place: TableIndex,
        group: usize,
        s: &[f64],
        rate: Option<&[f64]>,
    ) -> Self {
        let [along, swing] = match rate {
            Some(rate) => forcing_table.blend_both::<T>(place, group, [s, rate]),
            None => [forcing_table.blend(place, group, s), CubicSample::default()],
        };
        Self { shape: along.value.store(), slope: along.slope.store(), swing: swing.value.store() }
    }
}

/// What turns a [`Forcing`] into w = r·sᵀb and its slope along the motion, w′ = r(κ·sᵀb′ + s′ᵀb) + r′·sᵀb. Past the end
/// of a discrete movement r stands for the fading phase, and b for what is faded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    pub(super) r: f64,
    /// κ: the landscape is read at the phase's pace; style and amplitude keep the output system's clock.
    pub(super) pace: f64,
    /// r′.
    pub(super) growth: f64,
    /// ρ and ρ̇.
    pub(super) rate: [f64; 2],
}

impl Gate {
    /// w and w′.
    #[inline(always)]
    pub(super) fn jet<T: Register>(&self, forcing: &Forcing) -> CubicSample<T> {
        let [shape, slope, swing] = [&forcing.shape, &forcing.slope, &forcing.swing].map(T::load);
        CubicSample { value: shape * self.r, slope: (slope * self.pace + swing) * self.r + shape * self.growth }
    }

    /// ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′ with y′ = z + w, where w has the motion c′ of the frame in it.
    #[inline(always)]
    pub(super) fn motion<T: Real>(&self, attractor: Attractor, state: State<T>, w: CubicSample<T>) -> [T; 2] {
        let ([rate, change], flow) = (self.rate, state.z + w.value);
        [flow * rate, (attractor.z_slope(state) + w.slope) * (rate * rate) + flow * change]
    }
}

/// Adds the motion of a frame that covers a `way` to the forcing, for m with respect to the output system's clock.
#[inline(always)]
pub(super) fn carried<T: Real>(w: CubicSample<T>, way: T, [slope, bend]: [f64; 2]) -> CubicSample<T> {
    CubicSample { value: w.value + way * slope, slope: w.slope + way * bend }
}
