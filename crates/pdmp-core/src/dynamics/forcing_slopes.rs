//! First and second derivative of the forcing term.

use crate::dynamics::forcing_table::{Ending, Fade, ForcingTable};
use crate::dynamics::output_system::CubicSample;
use crate::numerics::simd::F64x4;

impl ForcingTable {
    /// Returns w′ and w″ of a style at clock `u`, for one group of DoFs.
    ///
    /// w is C¹ between start and end, so that w″ jumps at the knots; there and at the end it is that of a later clock.
    pub(crate) fn slopes(&self, u: f64, group: usize, style: &[f64]) -> CubicSample<F64x4> {
        let fade = self.fade(u);
        let index = self.faded_index(u, fade);
        let mut sum = [F64x4::ZERO; 4];
        for (cubic, s) in self.cubics(index.first, group).iter().zip(style) {
            sum.iter_mut().zip(cubic.0).for_each(|(sum, coefficient)| *sum += coefficient * *s);
        }
        let [value, slope, square, cube] = sum;
        let Some(Fade { r, r_slope, p_slope, .. }) = fade else {
            let (twice, rest) = (square + square, cube * (6.0 * index.t));
            return CubicSample { value: slope + (twice + rest * 0.5) * index.t, slope: twice + rest };
        };
        if r == 0.0 {
            return CubicSample::default();
        }
        // w = r·(a + b·p), in which r is an exponential: r″ = r′²/r.
        let p_bend = match self.ending {
            Ending::Braked { braking, .. } => braking.forcing_bend(u - self.canonical().extent(), p_slope),
            Ending::Phase => 0.0,
        };
        let w = value + slope * index.t;
        CubicSample {
            value: w * r_slope + slope * (r * p_slope),
            slope: w * (r_slope * (r_slope / r)) + slope * (2.0 * r_slope * p_slope + r * p_bend),
        }
    }
}
