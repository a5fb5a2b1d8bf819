//! Selection of the systematic styles: those above the measurement noise, and at least those that contexts explain.
//!
//! Noise adds singular values to those of the movements. Parallel analysis (Horn, Psychometrika 30, 1965,
//! doi:10.1007/BF02289447) compares them with those of noise alone: white noise of the estimated level, with the
//! durations of the demonstrations, passed through the same smoothing and converted to targets in the same way.

use std::cmp::Ordering;

use ndarray::{Array2, ArrayView1, ArrayView2};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::context::ContextColumn;
use crate::demonstration::{Demonstration, Sampling};
use crate::dynamics::transport::Transport;
use crate::error::Result;
use crate::learning::alignment::Alignment;
use crate::learning::constants::Constants;
use crate::learning::factorization::{Factors, Truncation};
use crate::learning::targets::Targets;
use crate::numerics::orthonormal_span::OrthonormalSpan;
use crate::numerics::smoothing_spline::{Noise, Smoothing};
use crate::numerics::statistics::pseudo_random;
use crate::numerics::threads::Threads;

/// Share of the sum of the singular values that the styles carry, as in the paper.
const SHARE: f64 = 0.9;

/// Margin over the largest singular value of simulated noise. In simulations of 20 to 200 demonstrations with 51 to 1001
/// samples the largest one of the noise in the data was at most 1.23 times that of noise alone.
const MARGIN: f64 = 1.5;

/// Largest number of simulated demonstrations; the largest singular value of more is extrapolated.
const MAX_ROWS: usize = 64;

/// Smallest number of samples of a simulated demonstration, unless the recording has fewer.
const MIN_SAMPLES: usize = 64;
/// Samples per period of the highest cut-off, which suffice for smoothed noise.
const SAMPLES_PER_PERIOD: f64 = 5.0;

/// Significance level of the F-tests of all styles together (Bonferroni).
const SIGNIFICANCE: f64 = 0.01;

/// Different contexts per coefficient from which the squares of numbers are among the regressors.
const CONTEXTS_PER_SQUARE: usize = 4;

/// Quantities of the demonstrations on which the noise in their targets depends.
pub(crate) struct Recorded<'a> {
    pub(crate) noise: &'a Noise,
    /// Durations (M,) in seconds.
    pub(crate) durations: &'a [f64],
    /// Numbers of recorded samples (M,).
    pub(crate) n_recorded: &'a [usize],
    /// Number of samples C after alignment.
    pub(crate) n_samples: usize,
}

/// Returns the largest singular value that measurement noise causes in the targets, with a margin; 0 without noise.
///
/// If P rows of noise have the largest singular value ν and the root mean square row norm t, then M rows of the same
/// distribution have t + (ν − t)√(M/P) on average (Gordon's inequality, used as an equation).
pub(crate) fn noise_limit(
    recorded: &Recorded,
    constants: &Constants,
    transport: &Transport,
    dof_scale: &[f64],
    threads: Threads,
) -> Result<f64> {
    let Recorded { noise: measured, durations, n_recorded, n_samples: n_aligned } = *recorded;
    let Some(highest) = measured.cut_offs().iter().flatten().copied().reduce(f64::max) else { return Ok(0.0) };
    let n_demos = durations.len();
    let kind = constants.canonical.kind();
    let n_rows = n_demos.min(MAX_ROWS);
    // Sums of many random signs are normally distributed.
    let mut random = 0;
    let noise = |row: usize| {
        let m = row * n_demos / n_rows;
        let recorded = n_recorded[m];
        let sufficient = (SAMPLES_PER_PERIOD * highest * durations[m]).ceil() as usize;
        let n = sufficient.max(MIN_SAMPLES).min(recorded);
        // White noise of the same power density at a lower sampling rate.
        let ratio = (n as f64 / recorded as f64).sqrt();
        let size: Vec<f64> = measured.levels().iter().map(|level| level * ratio).collect();
        let position =
            Array2::from_shape_fn((n, size.len()), |(_, d)| size[d].copysign(pseudo_random(&mut random) as f64));
        Demonstration::new(position, Sampling::Uniform { dt: durations[m] / kind.steps(n) as f64 })
    };
    let noise = (0..n_rows).map(noise).collect::<Result<Vec<_>>>()?;
    let n_samples = noise.iter().map(Demonstration::n_samples).max();
    let alignment = Alignment {
        kind,
        dt: None,
        period: Vec::new(),
        smoothing: Smoothing::Interpolate,
        nominal: None,
        n_samples,
        vectors: Vec::new(),
    };
    let mut rows = alignment.align(&noise, threads)?;
    rows.noise = measured.clone();
    let mut targets = Targets::of(&rows, constants.attractor, constants.canonical, threads, &mut |_| Ok(()))?;
    targets.carry(transport, constants.attractor, constants.canonical);
    targets.scale(dof_scale);
    let squares: f64 = targets.forcing.iter().map(|f| f * f).sum();
    let factors = Factors::of(targets.forcing.view(), Truncation::Rank(1), &mut |_| Ok(()))?;
    let norm = (squares / n_rows as f64).sqrt();
    let growth = (n_demos as f64 / n_rows as f64).sqrt();
    let largest = norm + (factors.singular_values[0] - norm) * growth;
    let density = n_aligned as f64 / rows.n_samples as f64;
    Ok(MARGIN * largest * density.sqrt())
}

/// Returns the systematic factors of the targets, including those that `contexts` explain.
///
/// `targets` may be any matrix A with AᵀA = FᵀF for the targets F of `n_demos` demonstrations, with regressors of the same
/// inner products with its rows.
pub(crate) fn systematic(
    targets: ArrayView2<f64>,
    n_demos: usize,
    noise: f64,
    regressors: Option<&OrthonormalSpan>,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Factors> {
    let count = Truncation::AboveNoise { noise, share: SHARE };
    let Some(regressors) = regressors else { return Factors::of_compressed(targets, n_demos, count, progress) };
    let all = Factors::of_compressed(targets, n_demos, Truncation::AboveNoise { noise, share: 1.0 }, progress)?;
    let explained = explained(regressors, &all.styles, n_demos);
    let n_styles = count.among(&all.singular_values, n_demos).max(explained);
    Ok(all.leading(n_styles))
}

/// Returns the span of the regressors of contexts (M, Q), of which the first is constant: the numbers of the contexts, their
/// squares where there are enough contexts, and indicators of their labels.
pub(crate) fn regressors(columns: &[ContextColumn], contexts: &Array2<f64>) -> OrthonormalSpan {
    let numbers = || columns.iter().zip(contexts.columns()).filter(|(column, _)| **column == ContextColumn::Number);
    let mut span = OrthonormalSpan::default();
    span.add(ArrayView1::from(&vec![1.0; contexts.nrows()]));
    for (column, values) in columns.iter().zip(contexts.columns()) {
        match column {
            ContextColumn::Number => span.add(values),
            ContextColumn::Label(labels) => {
                (0..labels.len()).for_each(|k| span.add(values.map(|&v| f64::from(u8::from(v == k as f64))).view()));
            }
        }
    }
    if squares_are_regressors(columns, contexts) {
        for (_, values) in numbers() {
            let centre = values.mean().unwrap_or(0.0);
            span.add(values.map(|value| (value - centre).powi(2)).view());
        }
    }
    span
}

/// Returns whether there are enough different contexts (M, Q) for the squares of their numbers.
pub(crate) fn squares_are_regressors(columns: &[ContextColumn], contexts: &Array2<f64>) -> bool {
    let n_numbers = columns.iter().filter(|column| **column == ContextColumn::Number).count();
    crate::context::group_equal_contexts(contexts).len() >= CONTEXTS_PER_SQUARE * (2 * n_numbers + 1)
}

/// Returns the number of leading styles, the columns of a matrix, up to the last one that the contexts explain significantly.
///
/// Each style is regressed on the span of the regressors, and tested by an F-test.
fn explained(span: &OrthonormalSpan, styles: &Array2<f64>, n_demos: usize) -> usize {
    let n_styles = styles.ncols();
    let n_regressors = span.0.len() - 1;
    let constant = OrthonormalSpan(span.0[..1].to_vec());
    let degrees_of_freedom = n_demos.saturating_sub(n_regressors + 1);
    let Ok(distribution) = FisherSnedecor::new(n_regressors as f64, degrees_of_freedom as f64) else { return 1 };
    let is_explained = |j: &usize| {
        let [total, residual] = [&constant, span].map(|span| {
            let rest = span.rest(styles.column(*j));
            rest.dot(&rest)
        });
        let ratio = (total - residual).max(0.0) / n_regressors as f64 / (residual / degrees_of_freedom as f64);
        match residual.partial_cmp(&(1e-12 * total)) {
            Some(Ordering::Less | Ordering::Equal) => total > 0.0,
            _ => distribution.sf(ratio) * (n_styles as f64) < SIGNIFICANCE,
        }
    };
    (0..n_styles).rev().find(is_explained).map_or(1, |j| j + 1)
}
