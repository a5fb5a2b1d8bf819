//! Ends of recordings at rest.
//!
//! A spline that minimises the roughness alone has no curvature at its ends, f̈ = 0. Where a movement starts from rest with an
//! acceleration, it begins with a velocity that the movement does not have, the larger the lower the cut-off: up to a seventh
//! of the peak velocity. With ḟ = 0 at such an end the error of the first samples is a fourth to a half less. The score of
//! generalised cross-validation, which estimates the prediction error, distinguishes the two.

use std::ops::Range;

use super::roughness::Roughness;
use super::{Samples, Solution};
use crate::error::Result;
use crate::numerics::simd::{F64x4, WIDTH};
use crate::numerics::threads::Threads;

/// Ends of a recording at rest, the first and the last.
pub(crate) type Rest = [bool; 2];

/// Ends without a condition.
pub(crate) const NATURAL: Rest = [false; 2];

/// Largest increase of n·ln of the scores with an end at rest, of all recordings together and of one of them. A velocity of z
/// standard deviations increases it by about z² − 1.
const MAX_INCREASES: [f64; 2] = [9.0, 20.0];

/// Finds the ends (D,) at which the recordings are at rest: those where they contradict zero velocity neither together nor one of
/// them. Columns without cut-off and recordings with a period have none.
///
/// # Errors
/// Threads that the system does not provide.
pub(super) fn at_rest(
    recordings: &[Samples],
    cut_offs: &[Option<f64>],
    vectors: &[Range<usize>],
    threads: Threads,
) -> Result<Vec<Rest>> {
    let mut ends = vec![NATURAL; cut_offs.len()];
    let columns: Vec<usize> = (0..cut_offs.len()).filter(|&d| cut_offs[d].is_some()).collect();
    if columns.is_empty() || recordings.iter().any(|samples| samples.period.is_some()) {
        return Ok(ends);
    }
    let mut increases: Vec<Vec<[f64; 2]>> = vec![Vec::new(); recordings.len()];
    let tasks = recordings.iter().zip(&mut increases).collect();
    threads.try_for_each(tasks, |(samples, increases): (&Samples, &mut Vec<[f64; 2]>)| {
        *increases = samples.increases(&columns, cut_offs, vectors);
        Ok(())
    })?;
    for (column, &d) in columns.iter().enumerate() {
        ends[d] = [0, 1].map(|end| {
            let of_each = increases.iter().map(|of_recording| of_recording[column][end]);
            of_each.clone().sum::<f64>() < MAX_INCREASES[0] && of_each.fold(0.0, f64::max) < MAX_INCREASES[1]
        });
    }
    Ok(ends)
}

impl Samples<'_> {
    /// Returns the increases of n·ln of the score of some columns with the first end at rest, and with the last.
    fn increases(&self, columns: &[usize], cut_offs: &[Option<f64>], vectors: &[Range<usize>]) -> Vec<[f64; 2]> {
        let [natural, first, last] =
            [NATURAL, [true, false], [false, true]].map(|rest| self.log_scores(rest, columns, cut_offs, vectors));
        let n = self.len() as f64;
        natural
            .iter()
            .zip(first.iter().zip(last))
            .map(|(natural, (first, last))| [n * (first - natural), n * (last - natural)])
            .collect()
    }

    /// Returns ln(‖y − f‖²/tr(I − A)²) of some columns, up to a constant of each. The components of a vector share theirs.
    fn log_scores(
        &self,
        rest: Rest,
        columns: &[usize],
        cut_offs: &[Option<f64>],
        vectors: &[Range<usize>],
    ) -> Vec<f64> {
        let roughness = Roughness::new(&self.knots(0), rest);
        let (mut residuals, mut traces) = (Vec::new(), Vec::new());
        for columns in columns.chunks(WIDTH) {
            let Solution { scale, factors, gamma, .. } = self.solve(columns, cut_offs, &roughness, 0);
            let squares = roughness.residuals(&gamma).take(self.len()).fold(F64x4::ZERO, |sum, r| sum + r * r);
            residuals.extend_from_slice(&(squares.sqrt() * scale).to_array()[..columns.len()]);
            let trace = roughness.trace(&factors, 0..roughness.n_differences()).to_array();
            traces.extend_from_slice(&trace[..columns.len()]);
        }
        for vector in vectors {
            let members: Vec<usize> = (0..columns.len()).filter(|&c| vector.contains(&columns[c])).collect();
            let length = members.iter().fold(0.0, |length: f64, &c| length.hypot(residuals[c]));
            members.iter().for_each(|&c| residuals[c] = length);
        }
        residuals.iter().zip(traces).map(|(r, trace)| 2.0 * (r.max(f64::MIN_POSITIVE) / trace).ln()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{distance, irregular, minimum_jerk, noise, uniform};
    use super::super::{Noise, Smoothing};
    use super::*;
    use approx::assert_abs_diff_eq;
    use ndarray::Array2;

    /// An end at rest is the axis of the natural spline of samples and of their mirror images.
    #[test]
    fn an_end_at_rest_is_that_of_mirrored_samples() {
        let (mut normal, axis) = (noise(3), 1e-6);
        let time = irregular(30, 1.0);
        let knots: Vec<f64> = time.iter().map(|t| t - time[0] + axis).collect();
        let y: Vec<f64> = (0..30).map(|_| normal()).collect();
        let mirrored =
            |x: &[f64], sign: f64| -> Vec<f64> { x.iter().rev().map(|x| sign * x).chain(x.to_vec()).collect() };
        let fitted = |knots: &[f64], y: &[f64], rest| {
            let roughness = Roughness::new(knots, rest);
            let mut gamma: Vec<F64x4> = y.iter().map(|y| F64x4::splat(*y)).collect();
            roughness.extend(&mut gamma);
            roughness.second_differences(&mut gamma);
            roughness.factorize(F64x4::splat(2.0)).solve(&mut gamma);
            let residuals = roughness.residuals(&gamma).map(|r| 2.0 * r.to_array()[0]);
            y.iter().zip(residuals).map(|(y, residual)| y - residual).collect::<Vec<f64>>()
        };
        let reversed: Vec<f64> = knots.iter().rev().map(|t| -t).collect();
        let images = fitted(&mirrored(&knots, -1.0), &mirrored(&y, 1.0), NATURAL);
        let first = fitted(&knots, &y, [true, false]);
        let last = fitted(&reversed, &y.iter().rev().copied().collect::<Vec<f64>>(), [false, true]);
        for i in 0..30 {
            assert_abs_diff_eq!(first[i], images[30 + i], epsilon = 1e-5);
            assert_abs_diff_eq!(last[29 - i], first[i], epsilon = 1e-10);
        }
        assert!(distance(&first, &fitted(&knots, &y, NATURAL)) > 1e-2);
    }

    /// Returns the ends at rest of noisy recordings of a movement, which differ in their size.
    fn ends_of(movement: impl Fn(f64) -> f64, level: f64) -> (Rest, Noise) {
        let (time, mut normal) = (uniform(150, 1.0 / 149.0), noise(7));
        let recordings: Vec<Array2<f64>> = (0..8)
            .map(|m| {
                let size = 0.7 + 0.1 * f64::from(m);
                Array2::from_shape_fn((150, 1), |(i, _)| size * movement(time[i]) + level * normal())
            })
            .collect();
        let samples: Vec<Samples> =
            recordings.iter().map(|y| Samples { time: &time, period: None, values: y.view() }).collect();
        let noise = Noise::estimate(Smoothing::Auto, &samples, &[], 64, Threads::ONE).unwrap();
        let noise = noise.with_ends(&samples, &[], Threads::ONE).unwrap();
        (noise.ends()[0], noise)
    }

    #[test]
    fn ends_at_rest_are_told_from_ends_in_motion() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for level in [1e-4, 1e-3, 3e-3, 1e-2] {
            assert_eq!(ends_of(minimum_jerk, level).0, [true; 2], "{level}");
            assert_eq!(ends_of(|t| (2.0 * quarter * t).sin().powi(2), level).0, [true; 2], "{level}");
            // From three tenths of a sine on, to its crest.
            assert_eq!(ends_of(|t| (quarter * (0.2 + 0.8 * t)).sin(), level).0, [false, true], "{level}");
            assert_eq!(ends_of(|t| 1.0 - (quarter * (1.0 - 0.8 * t)).sin(), level).0, [true, false], "{level}");
        }
    }

    #[test]
    fn movements_from_rest_are_smoothed_with_less_error() {
        let squared_sine = |t: f64| (std::f64::consts::FRAC_PI_2 * t).sin().powi(2);
        let (_, noise_at_rest) = ends_of(squared_sine, 3e-3);
        let (time, mut normal) = (uniform(150, 1.0 / 149.0), noise(8));
        let (mut natural, mut at_rest) = (0.0, 0.0);
        let truth: Vec<f64> = time.iter().map(|t| squared_sine(*t)).collect();
        for _ in 0..20 {
            let y = Array2::from_shape_fn((150, 1), |(i, _)| truth[i] + 3e-3 * normal());
            let samples = Samples { time: &time, period: None, values: y.view() };
            for (sum, ends) in [(&mut natural, &[NATURAL][..]), (&mut at_rest, noise_at_rest.ends())] {
                let smoothed = samples.smoothed(noise_at_rest.cut_offs(), ends);
                *sum += distance(&smoothed.column(0).to_vec()[..15], &truth[..15]);
            }
        }
        assert!(at_rest < 0.8 * natural, "{at_rest:e} {natural:e}");
    }

    #[test]
    fn one_recording_in_motion_leaves_the_ends_natural() {
        let (time, mut normal) = (uniform(150, 1.0 / 149.0), noise(9));
        let mut recording = |first: f64| {
            Array2::from_shape_fn((150, 1), |(i, _)| minimum_jerk(first + (1.0 - first) * time[i]) + 1e-3 * normal())
        };
        let mut recordings: Vec<Array2<f64>> = (0..20).map(|_| recording(0.0)).collect();
        let ends = |recordings: &[Array2<f64>]| {
            let samples: Vec<Samples> =
                recordings.iter().map(|y| Samples { time: &time, period: None, values: y.view() }).collect();
            at_rest(&samples, &[Some(6.0)], &[], Threads::ONE).unwrap()[0]
        };
        assert_eq!(ends(&recordings), [true; 2]);
        recordings.push(recording(0.2));
        assert_eq!(ends(&recordings), [false, true]);
    }
}
