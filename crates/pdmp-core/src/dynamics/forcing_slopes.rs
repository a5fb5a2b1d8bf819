//! First and second derivative of the forcing term.

use crate::dynamics::forcing_table::{Ending, Fade, ForcingTable, TableIndex};
use crate::numerics::simd::F64x4;

impl ForcingTable {
    /// Returns the position of clock `u`, and the weights of the coefficients of its cubics in w′ and in w″.
    ///
    /// w is C¹ between start and end, so that w″ jumps at the knots; there and at the end it is that of a later clock.
    pub(crate) fn slope_weights(&self, u: f64) -> (TableIndex, [[f64; 4]; 2]) {
        let fade = self.fade(u);
        let index = self.faded_index(u, fade);
        let t = index.t;
        let weights = match fade {
            None => [[0.0, 1.0, 2.0 * t, 3.0 * t * t], [0.0, 0.0, 2.0, 6.0 * t]],
            Some(Fade { r, r_slope, p_slope, .. }) if r > 0.0 => {
                // w = r·(a + b·p), in which r is an exponential: r″ = r′²/r.
                let p_bend = match self.ending {
                    Ending::Braked { braking, .. } => braking.forcing_bend(u - self.canonical().extent(), p_slope),
                    Ending::Phase => 0.0,
                };
                let r_bend = r_slope * (r_slope / r);
                let slope = r_slope * t + r * p_slope;
                let bend = r_bend * t + 2.0 * r_slope * p_slope + r * p_bend;
                [[r_slope, slope, 0.0, 0.0], [r_bend, bend, 0.0, 0.0]]
            }
            Some(_) => [[0.0; 4]; 2],
        };
        (index, weights)
    }

    /// Returns the weighted sum of the coefficients of the cubics of a style at a position, for one group of DoFs.
    pub(crate) fn weighted(&self, index: TableIndex, group: usize, weights: &[f64; 4], style: &[f64]) -> F64x4 {
        let mut sum = F64x4::ZERO;
        for (cubic, s) in self.cubics(index.first, group).iter().zip(style) {
            for (coefficient, weight) in cubic.0.iter().zip(weights) {
                sum += *coefficient * (*weight * *s);
            }
        }
        sum
    }
}
