//! Learning of the transport profile m.
//!
//! Where it is the share of the way from start to goal that movements have covered, the difference of two
//! aligned demonstrations is Δy₀(1 − m) + Δg·m. Least squares over all pairs need no pairs: with x = y − y₀, r = g − y₀ and
//! means over the demonstrations,
//!
//! ```text
//! m(u) = (Σₙ⟨xₙ(u) − x̄(u), rₙ − r̄⟩ + λ·a(u)) / (Σₙ‖rₙ − r̄‖² + λ),
//! ```
//!
//! where a is the mean progress along the arc, which serves alone where starts and goals do not vary. The values are made
//! monotone (isotonic regression) and smoothed to a uniform cubic B-spline p, by the least of ∫(p − m)² + δ⁶∫p‴² with δ a
//! share of the movement. A B-spline is C²; it increases if its coefficients do, as isotonic regression sees to, and is
//! level where three of them are equal, as they are at both ends.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, Array3, ArrayView3, Axis};

use crate::dynamics::canonical::Canonical;
use crate::dynamics::transport::{DEGREE, MIN_CELLS, Transport};
use crate::error::{Error, Result};

/// Cells of the profile where there are as many samples.
const CELLS: usize = 16;
/// δ. On recordings of sixty tasks 0.046 predicts better by half a hundredth, but accelerates a goal that is moved from the
/// start 1.6 times as hard; 0.1 predicts worse by a hundredth and a half.
const SMOOTHING: f64 = 0.068;
/// Most samples of a demonstration that a profile is learnt from: sixteen to a cell.
const MOST_SAMPLES: usize = 16 * CELLS + 1;
/// Share of its size by which a movement's starts and goals must vary to count as much as the progress along the arc does.
/// Below a hundredth the noise of starts and goals is learnt where they do not vary; above a tenth, what they tell of
/// real movements is lost.
const TRUSTED: f64 = 0.05;

/// Learns the profile from movements less their starts, x (M, S, D) at equal steps of the clock from start to end, and
/// from their ways r = g − y₀ (M, D), both in units in which DoFs are comparable.
pub(super) fn transport_profile(
    mut moved: Array3<f64>,
    mut ways: Array2<f64>,
    canonical: Canonical,
) -> Result<Transport> {
    let n_samples = moved.len_of(Axis(1));
    // Numbers whose squares neither overflow nor vanish.
    let largest = moved.iter().chain(&ways).fold(0.0f64, |largest, x| largest.max(x.abs()));
    if largest > 0.0 {
        moved.mapv_inplace(|x| x / largest);
        ways.mapv_inplace(|x| x / largest);
    }
    ways -= &ways.mean_axis(Axis(0)).unwrap_or_default();
    let (mut covered, mut size) = (vec![0.0; n_samples], 0.0);
    for (moved, way) in moved.outer_iter().zip(ways.rows()) {
        for (covered, x) in covered.iter_mut().zip(moved.rows()) {
            *covered += x.dot(&way);
            size += x.dot(&x) / n_samples as f64;
        }
    }
    let varied: f64 = ways.iter().map(|x| x * x).sum();
    let doubt = TRUSTED * TRUSTED * size.max(f64::EPSILON);
    let share = |(covered, arc): (&f64, f64)| ((covered + doubt * arc) / (varied + doubt)).clamp(0.0, 1.0);
    let profile = isotonic(covered.iter().zip(progress(moved.view())).map(share));
    Transport::from_coefficients(spline(&profile)?, canonical)
}

/// Which of `n` samples a profile is learnt from.
pub(super) fn profile_samples(n: usize) -> impl ExactSizeIterator<Item = usize> + Clone {
    let kept = n.min(MOST_SAMPLES);
    (0..kept).map(move |k| k * (n - 1) / (kept - 1))
}

/// Mean progress along the arc (S,), from 0 to 1, of the movements (M, S, D) that have any length.
fn progress(moved: ArrayView3<f64>) -> Vec<f64> {
    let n_samples = moved.len_of(Axis(1));
    let (mut mean, mut n) = (vec![0.0; n_samples], 0.0);
    for moved in moved.outer_iter() {
        let mut along = Vec::with_capacity(n_samples);
        let mut length = 0.0;
        along.push(0.0);
        for c in 1..n_samples {
            let step = &moved.row(c) - &moved.row(c - 1);
            length += step.dot(&step).sqrt();
            along.push(length);
        }
        if length > 0.0 {
            n += 1.0;
            mean.iter_mut().zip(along).for_each(|(mean, along)| *mean += along / length);
        }
    }
    if n > 0.0 {
        mean.iter_mut().for_each(|mean| *mean /= n);
    } else {
        mean.iter_mut().enumerate().for_each(|(c, mean)| *mean = c as f64 / (n_samples - 1) as f64);
    }
    mean
}

/// Coefficients of the increasing spline through a profile of equally spaced values from start to end.
fn spline(profile: &[f64]) -> Result<Vec<f64>> {
    let n = profile.len();
    let cells = (n - 1).clamp(MIN_CELLS, CELLS);
    let mut coefficients = vec![0.0; cells + DEGREE];
    coefficients[cells..].fill(1.0);
    // A row of a least-squares problem: where its weights begin, they, and what they are to give.
    let mut normal = DMatrix::<f64>::zeros(cells - DEGREE, cells - DEGREE);
    let mut right = DVector::<f64>::zeros(cells - DEGREE);
    let mut add = |first: usize, weights: [f64; DEGREE + 1], wanted: f64, share: f64| {
        let free = |i: usize| (first + i).checked_sub(DEGREE).filter(|k| *k < cells - DEGREE);
        let known: f64 = weights.iter().zip(&coefficients[first..]).map(|(weight, c)| weight * c).sum();
        for (i, k) in (0..=DEGREE).filter_map(|i| Some((i, free(i)?))) {
            right[k] += share * weights[i] * (wanted - known);
            for (j, l) in (0..=DEGREE).filter_map(|j| Some((j, free(j)?))) {
                normal[(k, l)] += share * weights[i] * weights[j];
            }
        }
    };
    for (c, &value) in profile.iter().enumerate() {
        let place = (c * cells) as f64 / (n - 1) as f64;
        let cell = (place as usize).min(cells - 1);
        let t = place - cell as f64;
        let s = 1.0 - t;
        let inner = |t: f64| (4.0 + t * t * (3.0 * t - 6.0)) / 6.0;
        add(cell, [s.powi(3) / 6.0, inner(t), inner(s), t.powi(3) / 6.0], value, 1.0 / n as f64);
    }
    let rough = (SMOOTHING * cells as f64).powi(6) / cells as f64;
    (0..cells).for_each(|cell| add(cell, [-1.0, 3.0, -3.0, 1.0], 0.0, rough));
    let solved =
        normal.cholesky().ok_or(Error::Arguments("no transport profile fits the demonstrations"))?.solve(&right);
    for (c, solved) in coefficients[DEGREE..].iter_mut().zip(isotonic(solved.iter().map(|c| c.clamp(0.0, 1.0)))) {
        *c = solved;
    }
    Ok(coefficients)
}

/// The closest numbers that do not decrease, by least squares: neighbours out of order are pooled.
fn isotonic(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for value in values {
        let mut pool = (value, 1);
        while let Some((mean, n)) = pools.pop_if(|(mean, _)| *mean >= pool.0) {
            let sum = n + pool.1;
            pool = ((mean * n as f64 + pool.0 * pool.1 as f64) / sum as f64, sum);
        }
        pools.push(pool);
    }
    pools.into_iter().flat_map(|(mean, n)| std::iter::repeat_n(mean, n)).collect()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;
    use crate::dynamics::transport::Lag;

    const CANONICAL: Canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 2.0 };

    fn rise(s: f64) -> f64 {
        s.powi(3) * (10.0 + s * (6.0 * s - 15.0))
    }

    /// Movements that differ by their starts and goals alone give the profile by which they do, whatever else they share.
    #[test]
    fn profile_is_found_in_movements_that_are_transported() {
        let ways = Array2::from_shape_fn((6, 2), |(m, d)| ((3 * m + 5 * d) as f64).sin());
        let shared = |s: f64, d: usize| 4.0 * (s * (1.0 - s)) * (9.0 * s + d as f64).sin();
        let moved = Array3::from_shape_fn((6, 257, 2), |(m, c, d)| {
            let s = c as f64 / 256.0;
            ways[[m, d]] * rise(s) + shared(s, d)
        });
        let transport = transport_profile(moved, ways.clone(), CANONICAL).unwrap();
        for c in 0..=100 {
            let s = f64::from(c) / 100.0;
            assert_relative_eq!(1.0 + transport.lag(2.0 * s).value, rise(s), epsilon = 3e-3);
        }
    }

    /// Where starts and goals do not vary the profile is the progress along the arc.
    #[test]
    fn progress_along_the_arc_serves_alone_where_nothing_varies() {
        for n_demos in [1, 5] {
            let ways = Array2::from_elem((n_demos, 2), 1.0);
            let moved = Array3::from_shape_fn((n_demos, 257, 2), |(_, c, _)| rise(c as f64 / 256.0));
            let transport = transport_profile(moved, ways.clone(), CANONICAL).unwrap();
            for s in [0.1, 0.3, 0.5, 0.8] {
                assert_relative_eq!(1.0 + transport.lag(2.0 * s).value, rise(s), epsilon = 2e-3);
            }
        }
    }

    /// Movements without any length have a profile too.
    #[test]
    fn movements_at_rest_have_a_profile() {
        let transport = transport_profile(Array3::zeros((2, 4, 3)), Array2::zeros((2, 3)), CANONICAL).unwrap();
        assert!(transport.lag(0.0).value == -1.0 && transport.lag(2.0) == Lag::default());
    }

    proptest! {
        /// Whatever is learnt from, the profile increases from 0 to 1, and is level and unbent at both ends.
        #[test]
        fn profiles_increase_from_level_to_level(
            numbers in prop::collection::vec(-1.0..1.0f64, 3 * 40 * 2),
            ways in prop::collection::vec(-1.0..1.0f64, 3 * 2),
        ) {
            let moved = Array3::from_shape_vec((3, 40, 2), numbers).unwrap();
            let ways = Array2::from_shape_vec((3, 2), ways).unwrap();
            let transport = transport_profile(moved, ways.clone(), CANONICAL).unwrap();
            let lags: Vec<Lag> = (0..=1000).map(|k| transport.lag(0.002 * f64::from(k))).collect();
            prop_assert!(lags.windows(2).all(|pair| pair[0].value <= pair[1].value + 1e-15));
            prop_assert!(lags.iter().all(|lag| lag.slope >= -1e-12));
            let start = Lag { value: -1.0, ..Lag::default() };
            prop_assert_eq!(lags[0], start);
            let last = transport.lag(2.0 - 1e-9);
            prop_assert!(last.value.abs() < 1e-15 && last.slope.abs() < 1e-12 && last.bend.abs() < 1e-4);
        }

        /// Value, slope and bend belong together, across the knots too.
        #[test]
        fn slopes_are_those_of_the_values(u in 0.01..1.99f64) {
            let moved = Array3::from_shape_fn((1, 257, 1), |(_, c, _)| rise(c as f64 / 256.0));
            let transport = transport_profile(moved, Array2::ones((1, 1)), CANONICAL).unwrap();
            let [before, at, after] = [-1e-5, 0.0, 1e-5].map(|by| transport.lag(u + by));
            prop_assert!(((after.value - before.value) / 2e-5 - at.slope).abs() < 1e-7);
            prop_assert!(((after.slope - before.slope) / 2e-5 - at.bend).abs() < 1e-2);
        }
    }

    /// m ≡ 1 has no lag anywhere.
    #[test]
    fn immediate_transport_has_no_lag() {
        for u in [-1.0, 0.0, 0.5, 1e300] {
            assert_eq!(Transport::immediate().lag(u), Lag::default());
        }
    }

    #[test]
    fn pools_are_means_of_what_is_out_of_order() {
        assert_eq!(isotonic([1.0, 3.0, 2.0, 4.0, 0.0, 5.0].into_iter()), [1.0, 2.25, 2.25, 2.25, 2.25, 5.0]);
    }
}
