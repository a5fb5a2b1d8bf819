//! What the loop keeps of a group of DoFs, and its forcing term w from what the landscape holds.

use super::SETTLED;
use crate::attractor::{Attractor, Jet, State};
use crate::landscape::{Landscape, Place};
use crate::lanes::{Lanes, Real, Register, pack};
use crate::perturbation::{STILL, widest};

/// What the loop keeps of a group of DoFs beside its motion.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Group {
    pub(super) forcing: Forcing,
    /// The forcing term at the clock.
    pub(super) w: Jet<Lanes>,
    /// The auxiliary state of Eq. (1).
    pub(super) z: Lanes,
    /// The way g − y₀ at the start, which the frame covers; zero where rhythmic.
    pub(super) way: Lanes,
    /// Distance from the goal at which each DoF has settled, and the least it may be.
    pub(super) tolerance: Lanes,
    pub(super) least: Lanes,
}

impl Group {
    /// As many as DoFs of these ranges need.
    pub(super) fn all(ranges: &[f64]) -> Vec<Self> {
        let still = Lanes::splat(STILL * widest(ranges));
        let group = |range: &Lanes| Self { least: range.max(still) * SETTLED, ..Self::default() };
        pack(ranges).iter().map(group).collect()
    }
}

/// What the landscape gives a group of DoFs at the clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Forcing {
    /// sᵀb.
    pub(super) shape: Lanes,
    /// Its derivative with respect to the phase's clock.
    pub(super) slope: Lanes,
    /// s′ᵀb.
    swing: Lanes,
}

impl Forcing {
    /// Reads a group at a place, for a style s and, while it is on its way, s′.
    #[inline(always)]
    pub(super) fn read<T: Register>(
        landscape: &Landscape,
        place: Place,
        group: usize,
        s: &[f64],
        rate: Option<&[f64]>,
    ) -> Self {
        let [along, swing] = match rate {
            Some(rate) => landscape.blend_both::<T>(place, group, [s, rate]),
            None => [landscape.blend(place, group, s), Jet::default()],
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
    pub(super) fn jet<T: Register>(&self, forcing: &Forcing) -> Jet<T> {
        let [shape, slope, swing] = [&forcing.shape, &forcing.slope, &forcing.swing].map(T::load);
        Jet { value: shape * self.r, slope: (slope * self.pace + swing) * self.r + shape * self.growth }
    }

    /// ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′ with y′ = z + w, where w has the motion c′ of the frame in it.
    #[inline(always)]
    pub(super) fn motion<T: Real>(&self, attractor: Attractor, state: State<T>, w: Jet<T>) -> [T; 2] {
        let ([rate, change], flow) = (self.rate, state.z + w.value);
        [flow * rate, (attractor.z_slope(state) + w.slope) * (rate * rate) + flow * change]
    }
}

/// Adds the motion of a frame that covers a `way` to the forcing, for m with respect to the output system's clock.
#[inline(always)]
pub(super) fn carried<T: Real>(w: Jet<T>, way: T, [slope, bend]: [f64; 2]) -> Jet<T> {
    Jet { value: w.value + way * slope, slope: w.slope + way * bend }
}
