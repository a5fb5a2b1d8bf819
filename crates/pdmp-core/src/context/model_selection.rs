//! The choice of a map: ratios by evidence, length and weights by the errors at contexts left out.

use std::fmt;

use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::kernel::Kernel;
use super::kriging::{Kriging, Values};
use super::stacking::Stack;
use crate::error::Result;

/// Lengths that are tried, in units of the contexts' spread.
const LENGTHS: [f64; 9] = [8.0, 5.2, 3.4, 2.2, 1.4, 0.92, 0.59, 0.39, 0.25];
/// Grid of ln(ρ·mean λ), and how far the search goes on from its best.
const GRID: (f64, f64, f64) = (-7.0, 16.0, 0.5);
const HALVINGS: usize = 12;
/// Fewest different contexts of a Gaussian process: through two there is a line.
const MIN_CONTEXTS: usize = 3;
/// Most contexts of a map whose cost grows with their cube.
pub(crate) const MOST: usize = 1024;

/// What leads from contexts to movements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContextMapKind {
    /// Least squares, as in Section 4.1.2 of the paper.
    Linear,
    /// Ridge regression on polynomials of second degree, the penalty of each output by its evidence.
    Polynomial,
    /// A Gaussian process (Matérn-5/2), the noise of each output by its evidence, the length by the error left out.
    Gp,
    /// The Gaussian process and a line whose slopes are held small by the evidence, weighted by their errors at contexts
    /// left out: inside of the contexts of the demonstrations the two alone, outside with the mean.
    Stacked,
}

impl ContextMapKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Stacked, Self::Gp, Self::Polynomial, Self::Linear];

    /// The name used in files and in Python.
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

/// How the map from contexts is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapSelection {
    /// Stacked. Labels alone, two different contexts, or more than 1024: least squares, which gives each label the mean
    /// of its demonstrations.
    #[default]
    Auto,
    /// This one.
    Given(ContextMapKind),
}

/// A map of one kind, with all its constants.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) kind: ContextMapKind,
    pub(super) kernel: Option<Kernel>,
    pub(super) kriging: Kriging,
    pub(super) values: Values,
    pub(super) ratios: Vec<f64>,
}

/// Places (n, F) and what was shown there (n, P).
pub(super) struct Shown<'a> {
    pub(super) inputs: ArrayView2<'a, f64>,
    pub(super) n_inputs: usize,
    pub(super) outputs: ArrayView2<'a, f64>,
}

impl Candidate {
    /// The best map of a kind.
    pub(super) fn of(kind: ContextMapKind, shown: &Shown) -> Result<Self> {
        match kind {
            ContextMapKind::Linear => Self::with(kind, None, shown, |_, _| vec![0.0; shown.outputs.ncols()]),
            ContextMapKind::Polynomial => Self::with(kind, Some(Kernel::Quadratic), shown, ratios),
            ContextMapKind::Gp | ContextMapKind::Stacked => {
                let of_length = |length| {
                    let candidate = Self::with(kind, Some(Kernel::Matern { length }), shown, ratios)?;
                    Ok((candidate.errors().sum(), candidate))
                };
                // From the longest down: what few contexts cannot tell is left smooth.
                let mut best = of_length(LENGTHS[0])?;
                for &length in &LENGTHS[1..] {
                    let found = of_length(length)?;
                    if found.0 < best.0 {
                        best = found;
                    }
                }
                Ok(best.1)
            }
        }
    }

    /// The map with a known kernel, and ratios as `ratios` finds them.
    pub(super) fn with(
        kind: ContextMapKind,
        kernel: Option<Kernel>,
        shown: &Shown,
        ratios: impl FnOnce(&Kriging, &Values) -> Vec<f64>,
    ) -> Result<Self> {
        let kriging = Kriging::new(shown.inputs, shown.n_inputs, kernel.is_none(), kernel)?;
        let values = kriging.project(shown.outputs);
        let ratios = ratios(&kriging, &values);
        Ok(Self { kind, kernel, kriging, values, ratios })
    }

    /// Squared errors at each context left out (n,).
    fn errors(&self) -> Array1<f64> {
        let errors = self.kriging.leave_one_out_errors(&self.values, &self.ratios);
        if errors.iter().any(|error| !error.is_finite()) {
            return Array1::from_elem(errors.nrows(), f64::INFINITY);
        }
        errors.map_axis(Axis(1), |row| row.dot(&row))
    }
}

/// The line of a stacked map, and its weight.
#[derive(Clone, Debug)]
pub(super) struct Trend {
    pub(super) line: Candidate,
    pub(super) stack: Stack,
}

/// The map of a choice, its trend if it has one, and the error of each map that was tried at contexts left out.
pub(super) struct Choice {
    pub(super) candidate: Candidate,
    pub(super) trend: Option<Trend>,
    pub(super) errors: Vec<(ContextMapKind, f64)>,
}

/// Makes a choice.
pub(super) fn choose(choice: MapSelection, labels_alone: bool, shown: &Shown) -> Result<Choice> {
    let kind = match choice {
        MapSelection::Given(kind) => kind,
        MapSelection::Auto if labels_alone || !(MIN_CONTEXTS..=MOST).contains(&shown.inputs.nrows()) => {
            ContextMapKind::Linear
        }
        MapSelection::Auto => ContextMapKind::Stacked,
    };
    let candidate = Candidate::of(kind, shown)?;
    let mut tried = vec![(kind, mean(&candidate.errors()))];
    let trend = match kind {
        ContextMapKind::Stacked => {
            let line = Candidate::with(ContextMapKind::Linear, Some(Kernel::Linear), shown, ratios)?;
            let deviations = &shown.outputs - &shown.outputs.mean_axis(Axis(0)).unwrap_or_default();
            let missed = |of: &Candidate| of.kriging.leave_one_out_errors(&of.values, &of.ratios);
            let (process, straight) = (missed(&candidate), missed(&line));
            let stack = Stack::find(&deviations, &process, &straight);
            let [g, l] = stack.inside;
            let errors = (process * g + straight * l).map_axis(Axis(1), |row| row.dot(&row));
            tried = vec![
                (kind, mean(&errors)),
                (ContextMapKind::Gp, tried[0].1),
                (ContextMapKind::Linear, mean(&line.errors())),
            ];
            Some(Trend { line, stack })
        }
        _ => None,
    };
    Ok(Choice { candidate, trend, errors: tried })
}

/// The trend of a stacked map with known constants.
pub(super) fn trend(shown: &Shown, ratios: Vec<f64>, stack: Stack) -> Result<Trend> {
    let line = Candidate::with(ContextMapKind::Linear, Some(Kernel::Linear), shown, |_, _| ratios)?;
    Ok(Trend { line, stack })
}

fn mean(values: &Array1<f64>) -> f64 {
    values.mean().unwrap_or(0.0)
}

/// The ratio ρ of each output, by its evidence.
fn ratios(kriging: &Kriging, values: &Values) -> Vec<f64> {
    let evidence = Evidence::new(kriging, values);
    evidence.best().iter().enumerate().map(|(p, &(at, value))| evidence.refined(p, at, value)).collect()
}

/// Restricted log likelihood of the ratio ρ, and a weak prior on it (Patterson and Thompson, Biometrika 58, 1971).
struct Evidence<'a> {
    eigenvalues: &'a [f64],
    squares: Array2<f64>,
    /// Mean of the eigenvalues: of the same size as a ratio's inverse.
    unit: f64,
}

impl<'a> Evidence<'a> {
    fn new(kriging: &'a Kriging, values: &Values) -> Self {
        let eigenvalues = kriging.eigenvalues().map(crate::validate::row_major).unwrap_or_default();
        let unit = (eigenvalues.iter().sum::<f64>() / eigenvalues.len().max(1) as f64).max(f64::MIN_POSITIVE);
        Self { eigenvalues, squares: values.rest.mapv(|b| b * b), unit }
    }

    fn ratio(&self, at: f64) -> f64 {
        if at == f64::NEG_INFINITY { 0.0 } else { at.exp() / self.unit }
    }

    /// The best place of the grid for each output, as ln(ρ·mean λ), and its evidence.
    fn best(&self) -> Vec<(f64, f64)> {
        let (low, high, step) = GRID;
        let places = 1 + ((high - low) / step) as usize;
        let mut best = vec![(f64::NEG_INFINITY, f64::NEG_INFINITY); self.squares.ncols()];
        for at in std::iter::once(f64::NEG_INFINITY).chain((0..places).map(|k| low + k as f64 * step)) {
            let ratio = self.ratio(at);
            let shrinkage: Array1<f64> = self.eigenvalues.iter().map(|l| 1.0 / (ratio * l + 1.0)).collect();
            let volume: f64 = self.eigenvalues.iter().map(|l| (ratio * l).ln_1p()).sum();
            for (best, sum) in best.iter_mut().zip(shrinkage.dot(&self.squares)) {
                let value = self.value(at, sum, volume);
                if value > best.1 {
                    *best = (at, value);
                }
            }
        }
        best
    }

    fn value(&self, at: f64, sum: f64, volume: f64) -> f64 {
        let degrees_of_freedom = self.eigenvalues.len() as f64;
        let prior = ((at.exp() + 1e-3).ln() / 3.0).powi(2);
        -0.5 * (degrees_of_freedom * (sum / degrees_of_freedom).max(1e-300).ln() + volume + prior)
    }

    /// The ratio of one output, from the best place of the grid on.
    fn refined(&self, p: usize, mut at: f64, mut value: f64) -> f64 {
        let mut step = 0.5 * GRID.2;
        for _ in 0..if at.is_finite() { HALVINGS } else { 0 } {
            for side in [at - step, at + step] {
                let ratio = self.ratio(side);
                let terms = self.eigenvalues.iter().zip(self.squares.column(p));
                let (sum, volume) = terms.fold((0.0, 0.0), |(sum, volume), (l, square)| {
                    (sum + square / (ratio * l + 1.0), volume + (ratio * l).ln_1p())
                });
                let found = self.value(side, sum, volume);
                if found > value {
                    (at, value) = (side, found);
                }
            }
            step *= 0.5;
        }
        self.ratio(at)
    }
}
