//! State of a group of DoFs in the control loop, and its forcing term w.

use crate::dynamics::forcing_table::{ForcingTable, TableIndex};
use crate::dynamics::output_system::{Attractor, CubicSample, State};
use crate::error::Result;
use crate::motion::perturbation::{MIN_RANGE_RATIO, largest_range};
use crate::numerics::simd::{F64x4, Real, Register, pack};
use crate::numerics::state::Visitor;

/// State of a group of DoFs besides position, velocity and acceleration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Group {
    pub(super) forcing: ForcingSample,
    /// w and w′ at the clock.
    pub(super) w: CubicSample<F64x4>,
    /// Auxiliary state z of Eq. (1).
    pub(super) z: F64x4,
    /// Displacement g − y₀ of the frame from start to goal; zero for a rhythmic movement.
    pub(super) displacement: F64x4,
    /// Displacement δ by an additional forcing at the clock.
    pub(super) shift: F64x4,
    /// Length that the tolerance of a settled movement is relative to.
    pub(super) length: F64x4,
    /// Rounding error of the distance from the goal.
    pub(super) rounding: F64x4,
    /// Largest demonstrated range of each DoF, of stationary ones a small share of the others'.
    pub(super) range: F64x4,
}

impl Group {
    /// Returns the groups of DoFs with the given ranges.
    pub(super) fn all(ranges: &[f64]) -> Vec<Self> {
        let min_range = F64x4::splat(MIN_RANGE_RATIO * largest_range(ranges));
        let group = |range: &F64x4| Self { range: range.max(min_range), ..Self::default() };
        pack(ranges).iter().map(group).collect()
    }

    /// Returns the length that the tolerance is relative to: the larger of range and distance from the goal. A DoF that neither
    /// moved in the demonstrations nor has to has no length of its own, and that of the largest range.
    pub(super) fn length_at(&self, distance: F64x4, largest_range: f64) -> F64x4 {
        let length = self.range.max(distance);
        let least = F64x4::splat(MIN_RANGE_RATIO * largest_range);
        length.simd_le(least).select(F64x4::splat(largest_range), length)
    }

    /// Visits the state, with the bounds of a quantity in units of a DoF and the largest distance from start to goal.
    pub(super) fn walk(&mut self, visit: &mut Visitor, quantity: [f64; 2], distance: f64) -> Result<()> {
        let Self { forcing, w, z, displacement, shift, length, rounding, range: _ } = self;
        let ForcingSample { value, slope, style_slope } = forcing;
        for lanes in [value, slope, style_slope, &mut w.value, &mut w.slope, z, shift, length, rounding] {
            visit(lanes.as_mut_array(), quantity)?;
        }
        visit(displacement.as_mut_array(), [-distance, distance])
    }
}

/// Forcing of a group of DoFs at the clock, without the factor r.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ForcingSample {
    /// sᵀb.
    pub(super) value: F64x4,
    /// sᵀb′, with respect to the clock of the phase.
    pub(super) slope: F64x4,
    /// s′ᵀb.
    style_slope: F64x4,
}

impl ForcingSample {
    /// Evaluates the table for a style s and, while the style is in transition, its derivative s′.
    #[inline(always)]
    pub(super) fn read<T: Register>(
        forcing_table: &ForcingTable,
        index: TableIndex,
        group: usize,
        style: &[f64],
        style_rate: Option<&[f64]>,
    ) -> Self {
        let [forcing, change] = match style_rate {
            Some(style_rate) => forcing_table.sample_pair::<T>(index, group, [style, style_rate]),
            None => [forcing_table.sample(index, group, style), CubicSample::default()],
        };
        Self { value: forcing.value.store(), slope: forcing.slope.store(), style_slope: change.value.store() }
    }
}

/// Factors that turn a [`ForcingSample`] into w = r·sᵀb and w′ = r(κ·sᵀb′ + s′ᵀb) + r′·sᵀb, ′ being the derivative with
/// respect to the clock of the output system. Past the end of a discrete movement r is the decaying factor of the forcing
/// table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    pub(super) r: f64,
    /// r′.
    pub(super) r_slope: f64,
    /// κ, past the end κp′. It scales the derivative of b alone: style and amplitude are filtered on the clock of the output system.
    pub(super) phase_rate: f64,
    /// ρ and ρ̇.
    pub(super) rate: [f64; 2],
}

impl Gate {
    /// Returns w and w′.
    #[inline(always)]
    pub(super) fn forcing<T: Register>(&self, sample: &ForcingSample) -> CubicSample<T> {
        let [value, slope, style_slope] = T::load_all([&sample.value, &sample.slope, &sample.style_slope]);
        CubicSample {
            value: value * self.r,
            slope: (slope * self.phase_rate + style_slope) * self.r + value * self.r_slope,
        }
    }

    /// Returns ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′ with y′ = z + w, where w includes the motion c′ of the frame.
    #[inline(always)]
    pub(super) fn motion<T: Real>(&self, attractor: Attractor, state: State<T>, w: CubicSample<T>) -> [T; 2] {
        let ([rate, rate_change], flow) = (self.rate, state.z + w.value);
        let bend = (attractor.z_slope(state) + w.slope) * (rate * rate);
        // The rate of most ticks is constant.
        [flow * rate, if rate_change == 0.0 { bend } else { bend + flow * rate_change }]
    }
}

/// Adds the motion c′ of a frame with the given displacement to w and w′, for m′ and m″ on the clock of the output system.
#[inline(always)]
pub(super) fn add_frame_motion<T: Real>(w: CubicSample<T>, displacement: T, [slope, bend]: [f64; 2]) -> CubicSample<T> {
    CubicSample { value: w.value + displacement * slope, slope: w.slope + displacement * bend }
}
