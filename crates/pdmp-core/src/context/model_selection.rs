//! Model selection: signal-to-noise ratios by restricted maximum likelihood, length scale and stacking weights by
//! leave-one-out errors.
//!
//! H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58, 1971,
//! doi:10.1093/biomet/58.3.545.

use std::fmt;
use std::iter::once;

use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::kernel::Kernel;
use super::kriging::{Kriging, Observations};
use super::stacking::StackingWeights;
use crate::error::Result;

/// Length scales of the search, in standard deviations of the contexts. The search begins with the longest, so that equal
/// errors select the smoothest function.
const LENGTHS: [f64; 9] = [8.0, 5.2, 3.4, 2.2, 1.4, 0.92, 0.59, 0.39, 0.25];
/// Grid of ln(ρ·mean λ): lowest value, highest value and step.
const GRID: (f64, f64, f64) = (-7.0, 16.0, 0.5);
/// Halvings of the step from the best grid point on.
const N_HALVINGS: usize = 12;
/// Least number of distinct contexts for a Gaussian process; two determine a line.
const MIN_CONTEXTS: usize = 3;
/// Largest number of distinct contexts for a map with a kernel, whose cost grows with its cube.
pub(super) const MAX_CONTEXTS: usize = 1024;

/// Kind of a context map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContextMapKind {
    /// Least squares, as in Section 4.1.2 of the paper.
    Linear,
    /// Ridge regression on polynomials of second degree, with the penalty of each output by restricted maximum likelihood.
    Polynomial,
    /// Gaussian process with a Matérn-5/2 kernel: the signal-to-noise ratio of each output by restricted maximum likelihood,
    /// the length scale by the leave-one-out error.
    Gp,
    /// The Gaussian process and a line with penalised slopes, weighted by their leave-one-out errors. Beyond the
    /// demonstrated contexts the mean of the outputs has a weight too.
    Stacked,
}

impl ContextMapKind {
    /// Every kind, the most general one first.
    pub const ALL: [Self; 4] = [Self::Stacked, Self::Gp, Self::Polynomial, Self::Linear];

    /// Returns the name in files and in bindings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Polynomial => "polynomial",
            Self::Gp => "gp",
            Self::Stacked => "stacked",
        }
    }
}

impl fmt::Display for ContextMapKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Polynomial => "polynomial",
            Self::Gp => "Gaussian process",
            Self::Stacked => "Gaussian process and line",
        })
    }
}

/// Selection of the kind of a context map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapSelection {
    /// Stacked for 3 to 1024 distinct contexts with a number, otherwise linear. For labels alone, least squares predicts the
    /// mean of the demonstrations of each label.
    #[default]
    Auto,
    /// The given kind.
    Given(ContextMapKind),
}

/// Features (n, F) of the distinct contexts, with `n_inputs` values each, and their outputs (n, P).
pub(super) struct TrainingSet<'a> {
    pub(super) features: ArrayView2<'a, f64>,
    pub(super) n_inputs: usize,
    pub(super) outputs: ArrayView2<'a, f64>,
}

/// Kriging of a training set with its hyperparameters.
#[derive(Clone, Debug)]
pub(super) struct KrigingModel {
    pub(super) kernel: Option<Kernel>,
    pub(super) kriging: Kriging,
    pub(super) observations: Observations,
    /// Signal-to-noise ratios ρ (P,).
    pub(super) ratios: Vec<f64>,
}

impl KrigingModel {
    /// Fits the model of a kind; of a stacked map, its Gaussian process.
    fn fit(kind: ContextMapKind, training: &TrainingSet) -> Result<Self> {
        match kind {
            ContextMapKind::Linear => Self::with_ratios(None, training, vec![0.0; training.outputs.ncols()]),
            ContextMapKind::Polynomial => Self::with_kernel(Kernel::Quadratic, training),
            ContextMapKind::Gp | ContextMapKind::Stacked => {
                let of_length = |length| {
                    let model = Self::with_kernel(Kernel::Matern { length }, training)?;
                    Ok((model.squared_errors().sum(), model))
                };
                let mut best = of_length(LENGTHS[0])?;
                for &length in &LENGTHS[1..] {
                    let model = of_length(length)?;
                    if model.0 < best.0 {
                        best = model;
                    }
                }
                Ok(best.1)
            }
        }
    }

    /// Fits the ratios of a model with a kernel.
    fn with_kernel(kernel: Kernel, training: &TrainingSet) -> Result<Self> {
        let mut model = Self::with_ratios(Some(kernel), training, Vec::new())?;
        model.ratios = RestrictedLikelihood::new(&model.kriging, &model.observations).maximise();
        Ok(model)
    }

    /// Returns the model with given hyperparameters; without a kernel it is least squares, and the ratios are unused.
    pub(super) fn with_ratios(kernel: Option<Kernel>, training: &TrainingSet, ratios: Vec<f64>) -> Result<Self> {
        let kriging = Kriging::new(training.features, training.n_inputs, kernel.is_none(), kernel)?;
        let observations = kriging.project(training.outputs);
        Ok(Self { kernel, kriging, observations, ratios })
    }

    /// Computes the leave-one-out errors (n, P).
    pub(super) fn leave_one_out_errors(&self) -> Array2<f64> {
        self.kriging.leave_one_out_errors(&self.observations, &self.ratios)
    }

    /// Computes the squared leave-one-out errors (n,), all infinite if one is.
    fn squared_errors(&self) -> Array1<f64> {
        let errors = self.leave_one_out_errors();
        if errors.iter().any(|error| !error.is_finite()) {
            return Array1::from_elem(errors.nrows(), f64::INFINITY);
        }
        row_squares(&errors)
    }
}

/// Line of a stacked map, with the weights of the stack.
#[derive(Clone, Debug)]
pub(super) struct StackedLine {
    pub(super) model: KrigingModel,
    pub(super) weights: StackingWeights,
}

impl StackedLine {
    /// Fits a line with penalised slopes, and its weights beside a Gaussian process. Returns the mean squared leave-one-out
    /// error of the stack too.
    fn fit(process: &KrigingModel, training: &TrainingSet) -> Result<(Self, f64)> {
        let model = KrigingModel::with_kernel(Kernel::Linear, training)?;
        let deviations = &training.outputs - &training.outputs.mean_axis(Axis(0)).unwrap_or_default();
        let (process, line) = (process.leave_one_out_errors(), model.leave_one_out_errors());
        let weights = StackingWeights::fit(&deviations, &process, &line);
        let [g, l] = weights.interpolation;
        let error = mean(&row_squares(&(process * g + line * l)));
        Ok((Self { model, weights }, error))
    }

    /// Returns the line with given ratios and weights.
    pub(super) fn with_ratios(training: &TrainingSet, ratios: Vec<f64>, weights: StackingWeights) -> Result<Self> {
        Ok(Self { model: KrigingModel::with_ratios(Some(Kernel::Linear), training, ratios)?, weights })
    }
}

/// Selected map.
pub(super) struct SelectedMap {
    pub(super) kind: ContextMapKind,
    pub(super) model: KrigingModel,
    pub(super) line: Option<StackedLine>,
    /// Mean squared leave-one-out error of the map, and of its members if it is stacked.
    pub(super) errors: Vec<(ContextMapKind, f64)>,
}

/// Selects a map for a training set, and fits it. `only_labels` states that no context value is a number.
pub(super) fn select(selection: MapSelection, only_labels: bool, training: &TrainingSet) -> Result<SelectedMap> {
    let kind = match selection {
        MapSelection::Given(kind) => kind,
        MapSelection::Auto if only_labels || !(MIN_CONTEXTS..=MAX_CONTEXTS).contains(&training.features.nrows()) => {
            ContextMapKind::Linear
        }
        MapSelection::Auto => ContextMapKind::Stacked,
    };
    let model = KrigingModel::fit(kind, training)?;
    let error = mean(&model.squared_errors());
    if kind != ContextMapKind::Stacked {
        return Ok(SelectedMap { kind, model, line: None, errors: vec![(kind, error)] });
    }
    let (line, stacked_error) = StackedLine::fit(&model, training)?;
    let line_error = mean(&line.model.squared_errors());
    let errors = vec![(kind, stacked_error), (ContextMapKind::Gp, error), (ContextMapKind::Linear, line_error)];
    Ok(SelectedMap { kind, model, line: Some(line), errors })
}

fn row_squares(errors: &Array2<f64>) -> Array1<f64> {
    errors.map_axis(Axis(1), |row| row.dot(&row))
}

fn mean(values: &Array1<f64>) -> f64 {
    values.mean().unwrap_or(0.0)
}

/// Restricted log likelihood of the ratio ρ of each output, with a weak prior.
///
/// With the contrasts b_k and eigenvalues λ_k, k = 1 … r, and the noise variance at its maximum, it is
///
/// ```text
/// −½ (r ln(1/r Σ b_k²/(ρλ_k + 1)) + Σ ln(ρλ_k + 1) + (ln(ρ·mean λ + 10⁻³)/3)²)
/// ```
struct RestrictedLikelihood<'a> {
    eigenvalues: &'a [f64],
    /// Squared contrasts (r, P).
    squares: Array2<f64>,
    mean_eigenvalue: f64,
}

/// Value x = ln(ρ·mean λ) and its restricted log likelihood.
#[derive(Clone, Copy)]
struct LogRatio {
    x: f64,
    likelihood: f64,
}

impl<'a> RestrictedLikelihood<'a> {
    fn new(kriging: &'a Kriging, observations: &Observations) -> Self {
        let eigenvalues = kriging.eigenvalues().map(crate::validate::row_major).unwrap_or_default();
        let mean_eigenvalue =
            (eigenvalues.iter().sum::<f64>() / eigenvalues.len().max(1) as f64).max(f64::MIN_POSITIVE);
        Self { eigenvalues, squares: observations.contrasts.mapv(|b| b * b), mean_eigenvalue }
    }

    /// Returns the ratios ρ (P,) of maximum likelihood.
    fn maximise(&self) -> Vec<f64> {
        self.search_grid().into_iter().enumerate().map(|(p, best)| self.ratio(self.refine(p, best).x)).collect()
    }

    fn ratio(&self, x: f64) -> f64 {
        if x == f64::NEG_INFINITY { 0.0 } else { x.exp() / self.mean_eigenvalue }
    }

    /// Returns the best grid point of each output (P,). The grid includes ρ = 0.
    fn search_grid(&self) -> Vec<LogRatio> {
        let (low, high, step) = GRID;
        let n_steps = ((high - low) / step) as usize;
        let worst = LogRatio { x: f64::NEG_INFINITY, likelihood: f64::NEG_INFINITY };
        let mut best = vec![worst; self.squares.ncols()];
        for x in once(f64::NEG_INFINITY).chain((0..=n_steps).map(|k| low + k as f64 * step)) {
            let ratio = self.ratio(x);
            let shrinkage: Array1<f64> = self.eigenvalues.iter().map(|l| 1.0 / (ratio * l + 1.0)).collect();
            let log_determinant: f64 = self.eigenvalues.iter().map(|l| (ratio * l).ln_1p()).sum();
            for (best, sum) in best.iter_mut().zip(shrinkage.dot(&self.squares)) {
                let likelihood = self.likelihood(x, sum, log_determinant);
                if likelihood > best.likelihood {
                    *best = LogRatio { x, likelihood };
                }
            }
        }
        best
    }

    /// Computes the likelihood from Σ b_k²/(ρλ_k + 1) and Σ ln(ρλ_k + 1).
    fn likelihood(&self, x: f64, sum: f64, log_determinant: f64) -> f64 {
        let r = self.eigenvalues.len() as f64;
        let prior = ((x.exp() + 1e-3).ln() / 3.0).powi(2);
        -0.5 * (r * (sum / r).max(1e-300).ln() + log_determinant + prior)
    }

    /// Refines the best grid point of output `p` by a search with halved steps.
    fn refine(&self, p: usize, mut best: LogRatio) -> LogRatio {
        let mut step = 0.5 * GRID.2;
        for _ in 0..if best.x.is_finite() { N_HALVINGS } else { 0 } {
            for x in [best.x - step, best.x + step] {
                let ratio = self.ratio(x);
                let terms = self.eigenvalues.iter().zip(self.squares.column(p));
                let (sum, log_determinant) = terms.fold((0.0, 0.0), |(sum, log_determinant), (l, square)| {
                    (sum + square / (ratio * l + 1.0), log_determinant + (ratio * l).ln_1p())
                });
                let likelihood = self.likelihood(x, sum, log_determinant);
                if likelihood > best.likelihood {
                    best = LogRatio { x, likelihood };
                }
            }
            step *= 0.5;
        }
        best
    }
}
