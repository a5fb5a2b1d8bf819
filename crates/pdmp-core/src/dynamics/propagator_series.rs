//! Propagator of the output system over short steps, as a power series in the length of the step.
//!
//! While τ changes, every tick covers another clock interval h and needs another [`Propagator`]. All its weights are
//! entire functions of h,
//!
//! ```text
//! exp(Ah) = Σ Aⁿhⁿ/n!,     φₖ(Ah) = Σ Aⁿhⁿ/(n + k)!,
//! ```
//!
//! with coefficients that depend only on α_z and β_z. A dozen of them suffice for the steps of a control loop, which is
//! faster than scaling and squaring, and as accurate.

use crate::dynamics::output_system::{Attractor, Propagator, RestingPropagator};
use crate::numerics::simd::{F64x4, Register, WIDTH};
use crate::numerics::state::clone_in_place;

/// Truncation error of the series, relative to its value.
const TOLERANCE: f64 = 1e-17;
/// Maximum of h times the spectral bound of A; larger terms of the series would cancel.
const MAX_SCALED_STEP: f64 = 1.0;
/// Maximum spectral bound of A: its powers stay finite up to here, and no control loop has steps short enough for more.
const MAX_SPECTRAL_BOUND: f64 = 1e9;
/// Number of groups of four weights in a propagator: responses of e and z to forcing and to the goal, and exp(Ah).
const GROUPS: usize = 5;

/// Power series of the weights of a propagator.
#[derive(Debug)]
pub(crate) struct Series {
    attractor: Attractor,
    /// Pairs of an even and an odd coefficient for each group.
    coefficients: Vec<[[F64x4; 2]; GROUPS]>,
    /// Maximum step of the series.
    max_step: f64,
}

clone_in_place!(Series { attractor, coefficients, max_step });

impl Series {
    /// Returns the series for steps up to `max_step`, or up to its radius of accuracy if that is smaller.
    pub(crate) fn new(attractor: Attractor, max_step: f64) -> Self {
        let Attractor { alpha_z, beta_z } = attractor;
        let stiffness = alpha_z * beta_z;
        // Bound of the eigenvalues. A is not normal, but the norm of Aⁿ exceeds the bound's n-th power by a factor of n at
        // most, for which the factorials compensate within a term or two.
        let bound = 0.5 * (alpha_z + (alpha_z * alpha_z + 4.0 * stiffness).sqrt());
        let max_step = if bound < MAX_SPECTRAL_BOUND { max_step.min(MAX_SCALED_STEP / bound) } else { 0.0 };
        // The lowest power of h in a weight is at most the third.
        let (mut terms, mut remainder) = (3, 1.0);
        while remainder > TOLERANCE {
            terms += 1;
            remainder *= bound * max_step / f64::from(terms);
        }
        // Aⁿ by columns and 1/n!, up to the orders that the last pair of coefficients and φ₄ need.
        let mut power = vec![[[1.0, 0.0], [0.0, 1.0]]];
        let mut inverse_factorial = vec![1.0];
        for n in 1..=terms as usize + 6 {
            let times_a = |[e, z]: [f64; 2]| [z, -stiffness * e - alpha_z * z];
            power.push(power[n - 1].map(times_a));
            inverse_factorial.push(inverse_factorial[n - 1] / n as f64);
        }
        let coefficient = |n: usize| {
            // Coefficients of hⁿ: the weights of values have one more power of h than of A, those of slopes two more.
            let phi = |k: usize, shift: usize| if n >= shift { inverse_factorial[n - shift + k] } else { 0.0 };
            let end_value = 6.0 * phi(3, 1) - 12.0 * phi(4, 1);
            let values = [phi(1, 1) - end_value, end_value];
            let slopes = [phi(2, 2) - 4.0 * phi(3, 2) + 6.0 * phi(4, 2), 6.0 * phi(4, 2) - 2.0 * phi(3, 2)];
            let cubic = |column: usize, row: usize, scale: f64| {
                let entry = |shift: usize| if n >= shift { scale * power[n - shift][column][row] } else { 0.0 };
                let (first, second) = (entry(1), entry(2));
                F64x4::new([values[0] * first, values[1] * first, slopes[0] * second, slopes[1] * second])
            };
            let [e, z] = power[n].map(|column| column.map(|x| x * phi(0, 0)));
            [
                cubic(0, 0, 1.0),
                cubic(0, 1, 1.0),
                cubic(1, 0, stiffness),
                cubic(1, 1, stiffness),
                F64x4::new([e[0], z[0], e[1], z[1]]),
            ]
        };
        let pair = |k: usize| {
            let (even, odd) = (coefficient(2 * k), coefficient(2 * k + 1));
            std::array::from_fn(|group| [even[group], odd[group]])
        };
        Self { attractor, coefficients: (0..=terms as usize / 2).map(pair).collect(), max_step }
    }

    /// Returns the propagator over a clock interval `h`; steps beyond the range of the series are computed by scaling and
    /// squaring.
    #[inline(always)]
    pub(crate) fn propagator<T: Register>(&self, h: f64) -> Propagator {
        if h > self.max_step {
            return self.attractor.propagator(h);
        }
        let square = h * h;
        let mut sums = [[T::default(); 2]; GROUPS];
        for pairs in self.coefficients.iter().rev() {
            for (sum, [even, odd]) in sums.iter_mut().zip(pairs) {
                *sum = [sum[0] * square + T::load(even), sum[1] * square + T::load(odd)];
            }
        }
        let mut rows = [[0.0; WIDTH]; GROUPS];
        for (row, [even, odd]) in rows.iter_mut().zip(sums) {
            *row = (even + odd * h).store().to_array();
        }
        let [forcing_e, forcing_z, goal_e, goal_z, [ee, ez, ze, zz]] = rows;
        let resting = RestingPropagator { transition: [[ee, ez], [ze, zz]], forcing: [forcing_e, forcing_z] };
        Propagator { h, resting, goal: [goal_e, goal_z] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn weights(p: &Propagator) -> Vec<f64> {
        p.resting
            .transition
            .as_flattened()
            .iter()
            .chain(p.resting.forcing.as_flattened())
            .chain(p.goal.as_flattened())
            .copied()
            .collect()
    }

    proptest! {
        /// The series equals the weights by scaling and squaring, for repeated, complex and real eigenvalues.
        #[test]
        fn series_is_the_propagator(
            exponent in -12.0..12.0f64, ratio in 0.05..2.0f64, share in 0.0..1.0f64, max_step in 1e-4..0.1f64,
        ) {
            let alpha_z = 10f64.powf(exponent);
            let attractor = Attractor { alpha_z, beta_z: alpha_z * ratio };
            let series = Series::new(attractor, max_step);
            let h = share * max_step;
            let (found, expected) = (series.propagator::<F64x4>(h), attractor.propagator(h));
            // One weight of a pair may pass through zero; the error is relative to the larger one.
            for (found, expected) in weights(&found).chunks(2).zip(weights(&expected).chunks(2)) {
                let size = expected[0].abs().max(expected[1].abs());
                for (found, expected) in found.iter().zip(expected) {
                    prop_assert!((found - expected).abs() <= 1e-11 * size, "{found:e} {expected:e} {size:e}");
                }
            }
        }
    }
}
