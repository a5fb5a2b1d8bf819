//! The output system's solution over short steps, as a power series in their length.
//!
//! While τ is on its way every tick covers another stretch h of the clock, and every tick needs another
//! [`Propagator`]. All its weights are entire functions of h,
//!
//! ```text
//! exp(Ah) = Σ Aⁿhⁿ/n!,     φₖ(Ah) = Σ Aⁿhⁿ/(n + k)!,
//! ```
//!
//! with coefficients that depend on α_z and β_z alone. For the steps of a control loop a dozen of them suffice, which is
//! faster than scaling and squaring, and as exact.

use crate::dynamics::output_system::{Attractor, Propagator};
use crate::numerics::simd::{Lanes, Register};

/// What is left off, relative to what is kept.
const TOLERANCE: f64 = 1e-17;
/// Largest step times the size of A: beyond, large terms would cancel.
const LARGEST_STEP: f64 = 1.0;
/// A size of A up to which its powers stay finite; beyond, no loop has steps short enough for a series.
const LARGEST_SIZE: f64 = 1e9;
/// The weights of a propagator in groups of four: responses of e and z to the forcing, to the goal, and exp(Ah).
const GROUPS: usize = 5;

/// The weights as power series, an even and an odd coefficient at a time.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    attractor: Attractor,
    coefficients: Vec<[[Lanes; 2]; GROUPS]>,
    /// Longest step.
    reach: f64,
}

impl Series {
    /// The series for steps up to `reach`, or up to what a series can serve.
    pub(crate) fn new(attractor: Attractor, reach: f64) -> Self {
        let Attractor { alpha_z, beta_z } = attractor;
        let stiffness = alpha_z * beta_z;
        // No eigenvalue is larger. A is not normal, but its powers exceed those of its eigenvalues by a factor of their
        // number at most, which the factorials make up for within a term or two.
        let size = 0.5 * (alpha_z + (alpha_z * alpha_z + 4.0 * stiffness).sqrt());
        let reach = if size < LARGEST_SIZE { reach.min(LARGEST_STEP / size) } else { 0.0 };
        // No weight begins with a higher power of h than the third.
        let (mut terms, mut left) = (3, 1.0);
        while left > TOLERANCE {
            terms += 1;
            left *= size * reach / f64::from(terms);
        }
        // Aⁿ by its columns, and 1/n!, as far as the last pair of coefficients and φ₄ ask.
        let mut power = vec![[[1.0, 0.0], [0.0, 1.0]]];
        let mut inverse_factorial = vec![1.0];
        for n in 1..=terms as usize + 6 {
            let times_a = |[e, z]: [f64; 2]| [z, -stiffness * e - alpha_z * z];
            power.push(power[n - 1].map(times_a));
            inverse_factorial.push(inverse_factorial[n - 1] / n as f64);
        }
        let coefficient = |n: usize| {
            // Of Aⁿ in h φ₁ − …: the values' weights carry one more power of h than of A, the slopes' two.
            let phi = |k: usize, shift: usize| if n >= shift { inverse_factorial[n - shift + k] } else { 0.0 };
            let late = 6.0 * phi(3, 1) - 12.0 * phi(4, 1);
            let values = [phi(1, 1) - late, late];
            let slopes = [phi(2, 2) - 4.0 * phi(3, 2) + 6.0 * phi(4, 2), 6.0 * phi(4, 2) - 2.0 * phi(3, 2)];
            let cubic = |column: usize, row: usize, scale: f64| {
                let at = |shift: usize| if n >= shift { scale * power[n - shift][column][row] } else { 0.0 };
                let (first, second) = (at(1), at(2));
                Lanes::new([values[0] * first, values[1] * first, slopes[0] * second, slopes[1] * second])
            };
            let [e, z] = power[n].map(|column| column.map(|x| x * phi(0, 0)));
            [
                cubic(0, 0, 1.0),
                cubic(0, 1, 1.0),
                cubic(1, 0, stiffness),
                cubic(1, 1, stiffness),
                Lanes::new([e[0], z[0], e[1], z[1]]),
            ]
        };
        let pair = |k: usize| {
            let (even, odd) = (coefficient(2 * k), coefficient(2 * k + 1));
            std::array::from_fn(|group| [even[group], odd[group]])
        };
        Self { attractor, coefficients: (0..=terms as usize / 2).map(pair).collect(), reach }
    }

    /// The exact solution over a stretch `h` of the clock.
    #[inline(always)]
    pub(crate) fn propagator<T: Register>(&self, h: f64) -> Propagator {
        if h > self.reach {
            return self.attractor.propagator(h);
        }
        let square = h * h;
        let mut sums = [[T::default(); 2]; GROUPS];
        for pairs in self.coefficients.iter().rev() {
            for (sum, [even, odd]) in sums.iter_mut().zip(pairs) {
                *sum = [sum[0] * square + T::load(even), sum[1] * square + T::load(odd)];
            }
        }
        let [forcing_e, forcing_z, goal_e, goal_z, [ee, ez, ze, zz]] =
            sums.map(|[even, odd]| (even + odd * h).store().to_array());
        Propagator { h, transition: [[ee, ez], [ze, zz]], forcing: [forcing_e, forcing_z], goal: [goal_e, goal_z] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn weights(p: &Propagator) -> Vec<f64> {
        p.transition
            .as_flattened()
            .iter()
            .chain(p.forcing.as_flattened())
            .chain(p.goal.as_flattened())
            .copied()
            .collect()
    }

    proptest! {
        /// The series gives the weights of scaling and squaring, with repeated, complex and real roots.
        #[test]
        fn series_is_the_propagator(size in -12.0..12.0f64, ratio in 0.05..2.0f64, share in 0.0..1.0f64, reach in 1e-4..0.1f64) {
            let alpha_z = 10f64.powf(size);
            let attractor = Attractor { alpha_z, beta_z: alpha_z * ratio };
            let series = Series::new(attractor, reach);
            let h = share * reach;
            let (found, expected) = (series.propagator::<Lanes>(h), attractor.propagator(h));
            // The weights of two values or of two slopes are of one size, where one of them may pass through zero.
            for (found, expected) in weights(&found).chunks(2).zip(weights(&expected).chunks(2)) {
                let size = expected[0].abs().max(expected[1].abs());
                for (found, expected) in found.iter().zip(expected) {
                    prop_assert!((found - expected).abs() <= 1e-11 * size, "{found:e} {expected:e} {size:e}");
                }
            }
        }
    }
}
