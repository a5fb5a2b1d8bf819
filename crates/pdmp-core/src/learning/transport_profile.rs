//! Learning of the transport profile m(u), the share of the displacement from start to goal that is covered.
//!
//! In this model the difference of two aligned demonstrations is Δy₀(1 − m) + Δg·m. The least-squares fit over all pairs
//! reduces to sums over demonstrations: with x = y − y₀, r = g − y₀ and means over the demonstrations,
//!
//! ```text
//! m(u) = η·Σₙ⟨xₙ(u) − x̄(u), rₙ − r̄⟩/V + (1 − η)·a(u),     V = Σₙ‖rₙ − r̄‖²,     η = V²/(V² + V₀²),
//! ```
//!
//! where a is the mean arc-length progress, which alone determines m if starts and goals do not vary. This is a fit with the
//! regularisation V₀²/V: it fades faster with the variation than a constant one, so that noise of constant starts and goals
//! has less effect and real variation more. The values are made monotone by isotonic regression and smoothed to a uniform
//! cubic B-spline p that minimises ∫(p − m)² + δ⁶∫p‴², with δ a share of the movement. A cubic B-spline is C². It increases
//! where its coefficients do, which isotonic regression ensures, and has zero slope where three of them are equal, as at
//! both ends.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array1, Array2, Array3, ArrayView3, Axis, concatenate, s, stack};

use crate::dynamics::canonical::Canonical;
use crate::dynamics::transport::{DEGREE, MIN_CELLS, Transport};
use crate::error::{Error, Result};

/// Largest number of cells of the profile.
const MAX_CELLS: usize = 16;
/// Smoothing length δ. On recordings of sixty tasks the relative prediction error is lower by 0.005 with 0.046, but a goal
/// moved at the start causes 1.6 times the acceleration; with 0.1 the error is higher by 0.015.
const SMOOTHING: f64 = 0.068;
/// Largest number of samples of a demonstration in the fit: sixteen per cell.
const MAX_SAMPLES: usize = 16 * MAX_CELLS + 1;
/// Variation of starts and goals, as a share of the movement's size, at which they weigh as much as the arc-length
/// progress. On 61 recorded tasks (`benches/transport`) the prediction error relative to m ≡ 1 is 0.809 on average with
/// 0.03 to 0.05. With 0.035, 0.045, 0.05 it is at most 1.048, 1.035, 1.032 for a leaf whose starts vary little, with a
/// standard error of 0.04, and at most 1.012, 1.015, 1.021 elsewhere. A constant regularisation of 0.04² gives 1.050 and
/// 1.017, and noise of 1 % of constant starts and goals then raises the acceleration to 2.6 instead of 1.35 times.
const PRIOR_VARIATION: f64 = 0.045;

/// Sums over demonstrations from which the profile is learnt; those of two sets of demonstrations can be merged.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProfileSums {
    /// Number of demonstrations.
    n: f64,
    /// Mean reach r̄ (D,).
    reach: Array1<f64>,
    /// Mean displacement x̄ (S, D).
    displacement: Array2<f64>,
    /// Σₙ (xₙ − x̄)(rₙ − r̄) of each DoF (S, D).
    covered: Array2<f64>,
    /// Σₙ (rₙ − r̄)² of each DoF (D,).
    variation: Array1<f64>,
    /// Σₙ xₙ² of each DoF, averaged over the samples (D,).
    size: Array1<f64>,
    /// Sum of the arc-length progress (S,) of the movements that are not at rest.
    progress: Array1<f64>,
    /// Number of movements that are not at rest.
    n_moving: f64,
}

impl ProfileSums {
    /// Returns the sums over no demonstration.
    pub(crate) fn zero(n_samples: usize, n_dofs: usize) -> Self {
        Self {
            n: 0.0,
            reach: Array1::zeros(n_dofs),
            displacement: Array2::zeros((n_samples, n_dofs)),
            covered: Array2::zeros((n_samples, n_dofs)),
            variation: Array1::zeros(n_dofs),
            size: Array1::zeros(n_dofs),
            progress: Array1::zeros(n_samples),
            n_moving: 0.0,
        }
    }

    /// Sums over demonstrations with displacements x = y − y₀ (M, S, D), at equal steps of the clock, and reaches
    /// r = g − y₀ (M, D). Both are in units in which the DoFs are comparable, and their squares neither overflow nor
    /// underflow.
    pub(crate) fn of(displacements: ArrayView3<f64>, mut reaches: Array2<f64>) -> Self {
        let (n_demos, n_samples, n_dofs) = displacements.dim();
        let mut sums = Self::zero(n_samples, n_dofs);
        sums.n = n_demos as f64;
        sums.reach = reaches.mean_axis(Axis(0)).unwrap_or(sums.reach);
        sums.displacement = displacements.mean_axis(Axis(0)).unwrap_or(sums.displacement);
        reaches -= &sums.reach;
        for (displacement, reach) in displacements.outer_iter().zip(reaches.rows()) {
            sums.covered += &(&displacement * &reach);
            sums.size += &(displacement.map_axis(Axis(0), |x| x.dot(&x)) / n_samples as f64);
        }
        sums.variation = reaches.map_axis(Axis(0), |r| r.dot(&r));
        (sums.progress, sums.n_moving) = arc_length_progress(displacements);
        sums
    }

    /// Returns the number of samples S.
    pub(crate) fn n_samples(&self) -> usize {
        self.progress.len()
    }

    /// Returns the sums of the samples (S, 2D + 1) and of the DoFs (3, D), and the numbers of all and of moving demonstrations.
    pub(crate) fn numbers(&self) -> (Array2<f64>, Array2<f64>, [f64; 2]) {
        let progress = self.progress.view().insert_axis(Axis(1));
        let samples = concatenate![Axis(1), self.displacement, self.covered, progress];
        let dofs = stack![Axis(0), self.reach, self.variation, self.size];
        (samples, dofs, [self.n, self.n_moving])
    }

    /// Returns the sums with the given numbers.
    pub(crate) fn from_numbers(samples: &Array2<f64>, dofs: &Array2<f64>, [n, n_moving]: [f64; 2]) -> Self {
        let n_dofs = dofs.ncols();
        let [reach, variation, size] = [0, 1, 2].map(|k| dofs.row(k).to_owned());
        Self {
            n,
            reach,
            displacement: samples.slice(s![.., ..n_dofs]).to_owned(),
            covered: samples.slice(s![.., n_dofs..2 * n_dofs]).to_owned(),
            variation,
            size,
            progress: samples.column(2 * n_dofs).to_owned(),
            n_moving,
        }
    }

    /// Adds the sums over further demonstrations (Chan, Golub, LeVeque, COMPSTAT 1982, 30–41).
    pub(crate) fn merge(&mut self, other: &Self) {
        let n = self.n + other.n;
        if other.n == 0.0 {
            return;
        }
        let (reach, displacement) = (&other.reach - &self.reach, &other.displacement - &self.displacement);
        let (share, weight) = (other.n / n, self.n * other.n / n);
        self.covered += &(&other.covered + &(&displacement * &reach * weight));
        self.variation += &(&other.variation + &(&reach * &reach * weight));
        self.reach.scaled_add(share, &reach);
        self.displacement.scaled_add(share, &displacement);
        self.size += &other.size;
        self.progress += &other.progress;
        (self.n, self.n_moving) = (n, self.n_moving + other.n_moving);
    }

    /// Learns the profile, with DoFs weighted by the squares of the given factors (D,).
    pub(crate) fn profile(&self, factors: &[f64], canonical: Canonical) -> Result<Transport> {
        let n_samples = self.progress.len();
        let weights = Array1::from_iter(factors.iter().map(|factor| factor * factor));
        let covered = self.covered.dot(&weights);
        let (size, variation) = (self.size.dot(&weights), self.variation.dot(&weights));
        let prior = PRIOR_VARIATION * PRIOR_VARIATION * size.max(f64::EPSILON);
        let weight = variation * variation / (variation * variation + prior * prior);
        let per_variation = weight / variation.max(f64::MIN_POSITIVE);
        let arc = |c: usize| match self.n_moving {
            0.0 => c as f64 / (n_samples - 1) as f64,
            n => self.progress[c] / n,
        };
        let share = |c: usize| (covered[c] * per_variation + (1.0 - weight) * arc(c)).clamp(0.0, 1.0);
        Transport::from_coefficients(spline(&isotonic((0..n_samples).map(share)))?, canonical)
    }
}

/// Learns the profile from displacements x = y − y₀ (M, S, D), at equal steps of the clock, and reaches r = g − y₀ (M, D).
///
/// Both are in units in which the DoFs are comparable.
pub(super) fn transport_profile(
    mut displacements: Array3<f64>,
    mut reaches: Array2<f64>,
    canonical: Canonical,
) -> Result<Transport> {
    // Scaled so that squares neither overflow nor underflow.
    let largest = displacements.iter().chain(&reaches).fold(0.0f64, |largest, x| largest.max(x.abs()));
    if largest > 0.0 {
        displacements.mapv_inplace(|x| x / largest);
        reaches.mapv_inplace(|x| x / largest);
    }
    let factors = vec![1.0; reaches.ncols()];
    ProfileSums::of(displacements.view(), reaches).profile(&factors, canonical)
}

/// Returns the indices of the samples, out of `n`, that the profile is learnt from.
pub(super) fn profile_samples(n: usize) -> impl ExactSizeIterator<Item = usize> + Clone {
    let n_selected = n.min(MAX_SAMPLES);
    (0..n_selected).map(move |k| k * (n - 1) / (n_selected - 1))
}

/// Returns the sum of the arc-length progress (S,), from 0 to 1, of the movements (M, S, D) that are not at rest, and their
/// number.
fn arc_length_progress(displacements: ArrayView3<f64>) -> (Array1<f64>, f64) {
    let n_samples = displacements.len_of(Axis(1));
    let (mut sum, mut n) = (Array1::zeros(n_samples), 0.0);
    let mut along = vec![0.0; n_samples];
    for displacement in displacements.outer_iter() {
        for c in 1..n_samples {
            let steps = displacement.row(c).into_iter().zip(displacement.row(c - 1));
            along[c] = along[c - 1] + steps.map(|(x, before)| (x - before).powi(2)).sum::<f64>().sqrt();
        }
        let length = along[n_samples - 1];
        if length > 0.0 {
            n += 1.0;
            sum.iter_mut().zip(&along).for_each(|(sum, along)| *sum += along / length);
        }
    }
    (sum, n)
}

/// Returns the coefficients of the increasing smoothing spline through equally spaced values of a profile.
fn spline(profile: &[f64]) -> Result<Vec<f64>> {
    let n = profile.len();
    let cells = (n - 1).clamp(MIN_CELLS, MAX_CELLS);
    let mut coefficients = vec![0.0; cells + DEGREE];
    coefficients[cells..].fill(1.0);
    // Adds one weighted equation to the normal equations: the coefficients from `first` on have the value `expected`.
    let mut normal = DMatrix::<f64>::zeros(cells - DEGREE, cells - DEGREE);
    let mut right = DVector::<f64>::zeros(cells - DEGREE);
    let mut add = |first: usize, weights: [f64; DEGREE + 1], expected: f64, weight_of_row: f64| {
        let free = |i: usize| (first + i).checked_sub(DEGREE).filter(|k| *k < cells - DEGREE);
        let fixed: f64 = weights.iter().zip(&coefficients[first..]).map(|(weight, c)| weight * c).sum();
        for (i, k) in (0..=DEGREE).filter_map(|i| Some((i, free(i)?))) {
            right[k] += weight_of_row * weights[i] * (expected - fixed);
            for (j, l) in (0..=DEGREE).filter_map(|j| Some((j, free(j)?))) {
                normal[(k, l)] += weight_of_row * weights[i] * weights[j];
            }
        }
    };
    for (c, &value) in profile.iter().enumerate() {
        let position = (c * cells) as f64 / (n - 1) as f64;
        let cell = (position as usize).min(cells - 1);
        let t = position - cell as f64;
        let s = 1.0 - t;
        let inner = |t: f64| (4.0 + t * t * (3.0 * t - 6.0)) / 6.0;
        add(cell, [s.powi(3) / 6.0, inner(t), inner(s), t.powi(3) / 6.0], value, 1.0 / n as f64);
    }
    let roughness = (SMOOTHING * cells as f64).powi(6) / cells as f64;
    (0..cells).for_each(|cell| add(cell, [-1.0, 3.0, -3.0, 1.0], 0.0, roughness));
    let solution = normal
        .cholesky()
        .ok_or_else(|| Error::Fit("no transport profile fits the demonstrations".into()))?
        .solve(&right);
    for (c, value) in coefficients[DEGREE..].iter_mut().zip(isotonic(solution.iter().map(|c| c.clamp(0.0, 1.0)))) {
        *c = value;
    }
    Ok(coefficients)
}

/// Returns the non-decreasing least-squares fit, by the pool-adjacent-violators algorithm.
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
    use crate::dynamics::transport::TransportSample;

    const CANONICAL: Canonical = Canonical::Discrete { alpha_x: 4.6, u_end: 2.0 };

    fn rise(s: f64) -> f64 {
        s.powi(3) * (10.0 + s * (6.0 * s - 15.0))
    }

    /// Movements that differ only by transported starts and goals yield the profile of the transport.
    #[test]
    fn profile_of_transported_movements_is_recovered() {
        let reaches = Array2::from_shape_fn((6, 2), |(m, d)| ((3 * m + 5 * d) as f64).sin());
        let shared = |s: f64, d: usize| 4.0 * (s * (1.0 - s)) * (9.0 * s + d as f64).sin();
        let displacements = Array3::from_shape_fn((6, 257, 2), |(m, c, d)| {
            let s = c as f64 / 256.0;
            reaches[[m, d]] * rise(s) + shared(s, d)
        });
        let transport = transport_profile(displacements, reaches.clone(), CANONICAL).unwrap();
        for c in 0..=100 {
            let s = f64::from(c) / 100.0;
            assert_relative_eq!(1.0 + transport.lag(2.0 * s).value, rise(s), epsilon = 3e-3);
        }
    }

    /// With constant starts and goals the profile is the arc-length progress.
    #[test]
    fn profile_is_arc_length_progress_where_nothing_varies() {
        for n_demos in [1, 5] {
            let reaches = Array2::from_elem((n_demos, 2), 1.0);
            let displacements = Array3::from_shape_fn((n_demos, 257, 2), |(_, c, _)| rise(c as f64 / 256.0));
            let transport = transport_profile(displacements, reaches.clone(), CANONICAL).unwrap();
            for s in [0.1, 0.3, 0.5, 0.8] {
                assert_relative_eq!(1.0 + transport.lag(2.0 * s).value, rise(s), epsilon = 2e-3);
            }
        }
    }

    /// Starts and goals that vary by one percent without any transport hardly change the profile.
    #[test]
    fn noise_of_constant_starts_and_goals_is_not_learnt() {
        let noise = |m: usize, c: usize| 0.01 * ((m % 4 + 3) as f64 * c as f64 / 64.0 + (m * m) as f64).sin();
        let displacements = Array3::from_shape_fn((7, 257, 1), |(m, c, _)| {
            let s = c as f64 / 256.0;
            rise(s) + noise(m, c) - noise(m, 0)
        });
        let reaches = displacements.index_axis(Axis(1), 256).to_owned();
        let transport = transport_profile(displacements, reaches, CANONICAL).unwrap();
        for s in [0.1, 0.3, 0.5, 0.7, 0.9] {
            assert_relative_eq!(1.0 + transport.lag(2.0 * s).value, rise(s), epsilon = 0.015);
        }
    }

    /// Movements at rest have a profile.
    #[test]
    fn movements_at_rest_have_a_profile() {
        let transport = transport_profile(Array3::zeros((2, 4, 3)), Array2::zeros((2, 3)), CANONICAL).unwrap();
        assert!(transport.lag(0.0).value == -1.0 && transport.lag(2.0) == TransportSample::default());
    }

    proptest! {
        /// For any movements, the profile increases from 0 to 1, with zero slope and curvature at both ends.
        #[test]
        fn profiles_increase_from_rest_to_rest(
            numbers in prop::collection::vec(-1.0..1.0f64, 3 * 40 * 2),
            reaches in prop::collection::vec(-1.0..1.0f64, 3 * 2),
        ) {
            let displacements = Array3::from_shape_vec((3, 40, 2), numbers).unwrap();
            let reaches = Array2::from_shape_vec((3, 2), reaches).unwrap();
            let transport = transport_profile(displacements, reaches.clone(), CANONICAL).unwrap();
            let lags: Vec<TransportSample> = (0..=1000).map(|k| transport.lag(0.002 * f64::from(k))).collect();
            prop_assert!(lags.windows(2).all(|pair| pair[0].value <= pair[1].value + 1e-15));
            prop_assert!(lags.iter().all(|lag| lag.slope >= -1e-12));
            let start = TransportSample { value: -1.0, ..TransportSample::default() };
            prop_assert_eq!(lags[0], start);
            let last = transport.lag(2.0 - 1e-9);
            prop_assert!(last.value.abs() < 1e-15 && last.slope.abs() < 1e-12 && last.bend.abs() < 1e-4);
        }

        /// Slope and curvature are the derivatives of the value, also across knots.
        #[test]
        fn slopes_are_those_of_the_values(u in 0.01..1.99f64) {
            let displacements = Array3::from_shape_fn((1, 257, 1), |(_, c, _)| rise(c as f64 / 256.0));
            let transport = transport_profile(displacements, Array2::ones((1, 1)), CANONICAL).unwrap();
            let [before, at, after] = [-1e-5, 0.0, 1e-5].map(|by| transport.lag(u + by));
            prop_assert!(((after.value - before.value) / 2e-5 - at.slope).abs() < 1e-7);
            prop_assert!(((after.slope - before.slope) / 2e-5 - at.bend).abs() < 1e-2);
        }
    }

    /// m ≡ 1 has no lag anywhere.
    #[test]
    fn immediate_transport_has_no_lag() {
        for u in [-1.0, 0.0, 0.5, 1e300] {
            assert_eq!(Transport::immediate().lag(u), TransportSample::default());
        }
    }

    #[test]
    fn values_out_of_order_are_pooled_to_their_mean() {
        assert_eq!(isotonic([1.0, 3.0, 2.0, 4.0, 0.0, 5.0].into_iter()), [1.0, 2.25, 2.25, 2.25, 2.25, 5.0]);
    }
}
