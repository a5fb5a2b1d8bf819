//! Partial fit: all that a fit needs of the demonstrations so far.

use ndarray::{Array2, ArrayView1, Axis};

use super::row_factor::RowFactor;
use super::settings::{ContextScale, Settings};
use super::summaries::{Summaries, Values};
use crate::demonstration::Demonstration;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::options::FitOptions;
use crate::learning::targets::Targets;
use crate::learning::transport_profile::{ProfileSums, profile_samples};
use crate::model::Finding;
use crate::numerics::threads::Threads;
use crate::preprocessing::inspection::{Inspected, cycle_ends, inspect_block};
use crate::validate::zeros;

/// Largest number of findings that are kept.
const MAX_FINDINGS: usize = 100;

/// Summary of the demonstrations so far from which a fit follows, in bounded memory: a factor R (K, N) of their targets
/// F (M, C·D), N = C·D + D + 1 and a few numbers for each context value, and O(D) numbers of each demonstration. K is the
/// number of dimensions in which the demonstrations vary, to 1e-12, if it is at most N/8; otherwise K = N.
///
/// RᵀR = FᵀF, so that R has the singular values and F_basis of F. Partial fits of parts are merged in any tree; the result
/// does not depend on it, but for rounding. Number of samples C, cut-offs of smoothing and the clock at the end of the
/// movement are chosen from the first block, and hold for all others. Styles, one row for each demonstration, need a second
/// pass over the blocks.
///
/// Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206–A239.
///
/// ```
/// # use pdmp_core::{Demonstration, FitOptions, fit};
/// use pdmp_core::learning::PartialFit;
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// let options = FitOptions::discrete();
/// let mut partial = PartialFit::new(&demos[..1], &options)?;
/// partial.update(&demos[..1])?;
/// let mut others = partial.empty();
/// others.update_with(&demos[1..], &mut |_| Ok(()))?;
/// partial.merge(&PartialFit::from_bytes(&others.to_bytes()?)?)?;
/// assert_eq!(partial.n_demos(), 3);
///
/// let factorised = partial.factorise(&options, &mut |_, _| Ok(()))?;
/// let styles = factorised.styles(&demos, 0)?;
/// let model = factorised.finish(vec![styles], &mut |_, _| Ok(()))?;
/// let whole = fit(&demos, &options)?;
/// let difference = &model.demonstrated().styles - &whole.demonstrated().styles;
/// assert!(difference.iter().all(|x| x.abs() < 1e-10));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct PartialFit {
    pub(super) settings: Settings,
    pub(super) summaries: Summaries,
    /// Columns of the factor after the targets and reaches.
    pub(super) regressors: Vec<Regressor>,
    pub(super) factor: RowFactor,
    /// Sums for the transport profile of discrete movements.
    pub(super) profile: ProfileSums,
    /// Largest ranges (D,).
    pub(super) ranges: Vec<f64>,
    /// Largest |y″| (D,) with respect to the clock.
    pub(super) accelerations: Vec<f64>,
    pub(super) findings: Vec<Finding>,
    pub(super) threads: Threads,
}

/// Regressor of the styles on the contexts.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Regressor {
    Constant,
    /// Number of a column, shifted and scaled.
    Number(usize),
    /// Square of the shifted and scaled number of a column.
    Square(usize),
    /// Indicator of a label of a column.
    Label(usize, String),
}

impl PartialFit {
    /// Returns a partial fit of no demonstration, with the settings that suit a sample, such as the first block.
    ///
    /// # Errors
    /// Options that need all demonstrations at once, or as for a fit of the sample.
    pub fn new(sample: &[Demonstration], options: &FitOptions) -> Result<Self> {
        Self::with(Settings::of(sample, options)?, options.threads)
    }

    /// Returns a partial fit of no demonstration.
    pub(super) fn with(settings: Settings, threads: Threads) -> Result<Self> {
        let n_dofs = settings.n_dofs();
        let n_profile = match settings.canonical.kind() {
            Kind::Discrete => profile_samples(settings.n_samples).len(),
            Kind::Rhythmic => 0,
        };
        let mut regressors = vec![Regressor::Constant];
        for (q, scale) in settings.contexts.iter().enumerate() {
            if let ContextScale::Number { .. } = scale {
                regressors.extend([Regressor::Number(q), Regressor::Square(q)]);
            }
        }
        let n = settings.n_samples * n_dofs + n_dofs + regressors.len();
        // An error instead of an abort where the factor does not fit into memory.
        zeros("triangular factor of the targets", (n, 2 * n)).map(drop)?;
        Ok(Self {
            summaries: Summaries::none(n_dofs, &settings.contexts),
            factor: RowFactor::zero(n),
            profile: ProfileSums::zero(n_profile, n_dofs),
            ranges: vec![0.0; n_dofs],
            accelerations: vec![0.0; n_dofs],
            findings: Vec::new(),
            regressors,
            settings,
            threads,
        })
    }

    /// Returns a partial fit of no demonstration with the same settings, to which other blocks are added elsewhere.
    pub fn empty(&self) -> Self {
        Self::with(self.settings.clone(), self.threads).unwrap_or_else(|_| unreachable!("as large as this one"))
    }

    /// Returns the number of demonstrations M so far.
    pub fn n_demos(&self) -> usize {
        self.summaries.len()
    }

    /// Returns the kind of the movements.
    pub fn kind(&self) -> Kind {
        self.settings.canonical.kind()
    }

    /// Returns the number of degrees of freedom D.
    pub fn n_dofs(&self) -> usize {
        self.settings.n_dofs()
    }

    /// Returns the number of samples C of the aligned demonstrations.
    pub fn n_samples(&self) -> usize {
        self.settings.n_samples
    }

    /// Adds a block of demonstrations.
    ///
    /// # Errors
    /// Demonstrations that do not match the others; none is added then.
    pub fn update(&mut self, block: &[Demonstration]) -> Result<()> {
        self.update_with(block, &mut |_| Ok(()))
    }

    /// Adds a block of demonstrations, and reports the completed share of its targets.
    ///
    /// # Errors
    /// As for [`Self::update`], or the error that `progress` returned; no demonstration is added then.
    pub fn update_with(&mut self, block: &[Demonstration], progress: &mut dyn FnMut(f64) -> Result<()>) -> Result<()> {
        if block.is_empty() {
            return Ok(());
        }
        let first = self.n_demos();
        let inside = |error| in_all(error, first);
        let (settings, threads) = (&self.settings, self.threads);
        let demos = settings.prepared(block).map_err(inside)?;
        let aligned = settings.aligned(&demos, threads).map_err(inside)?;
        let mut targets = Targets::of(&aligned, settings.attractor(), settings.canonical, threads, progress)?;
        self.summaries.add(&demos, &targets, &aligned.durations()).map_err(inside)?;
        self.inspect(block, first);
        if self.settings.canonical.kind() == Kind::Discrete {
            self.profile.merge(&targets.profile_sums(&self.settings.unit));
        }
        for (own, others) in
            [(&mut self.ranges, targets.ranges()), (&mut self.accelerations, targets.largest_accelerations())]
        {
            own.iter_mut().zip(others).for_each(|(own, other)| *own = own.max(other));
        }
        self.add_labels();
        let sizes = ArrayView1::from(&self.settings.sizes);
        for mut samples in targets.forcing.axis_chunks_iter_mut(Axis(1), self.n_dofs()) {
            samples /= &sizes;
        }
        let reaches = (&targets.goals - &targets.starts) / sizes;
        let columns = self.regressors(first);
        self.factor.update(&[targets.forcing.view(), reaches.view(), columns.view()], threads)
    }

    /// Adds the demonstrations of another partial fit after those of this one.
    ///
    /// # Errors
    /// Different settings.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        if self.settings != other.settings {
            let problem = "has other settings: make both with `empty` of the same partial fit";
            return Err(Error::Argument { name: "other", problem });
        }
        let first = self.n_demos();
        self.summaries.merge(&other.summaries);
        self.profile.merge(&other.profile);
        for (own, others) in [(&mut self.ranges, &other.ranges), (&mut self.accelerations, &other.accelerations)] {
            own.iter_mut().zip(others).for_each(|(own, other)| *own = own.max(*other));
        }
        self.keep(other.findings.iter().map(|finding| finding.clone().shifted(first)));
        self.add_labels();
        // Labels may appear in another order.
        let n = other.factor.n_columns() - other.regressors.len();
        let place = |regressor| self.regressors.iter().position(|own| own == regressor);
        let others = other.regressors.iter().filter_map(place).map(|place| n + place);
        self.factor.merge(&other.factor, &(0..n).chain(others).collect::<Vec<_>>(), self.threads)
    }

    /// Adds columns for labels that are new.
    fn add_labels(&mut self) {
        for (q, values) in self.summaries.contexts.iter().enumerate() {
            let Values::Labels(labels, _) = values else { continue };
            for label in labels {
                let regressor = Regressor::Label(q, label.clone());
                if !self.regressors.contains(&regressor) {
                    self.regressors.push(regressor);
                }
            }
        }
        let n = self.settings.n_samples * self.n_dofs() + self.n_dofs() + self.regressors.len();
        if n > self.factor.n_columns() {
            self.factor.extend(n);
        }
    }

    /// Returns the regressors of the demonstrations from `first` on.
    fn regressors(&self, first: usize) -> Array2<f64> {
        let number = |q: usize, m: usize| match (&self.summaries.contexts[q], &self.settings.contexts[q]) {
            (Values::Numbers(numbers), ContextScale::Number { offset, scale }) => (numbers[m] - offset) / scale,
            _ => 0.0,
        };
        let is = |q: usize, m: usize, label: &String| match &self.summaries.contexts[q] {
            Values::Labels(labels, indices) => labels[indices[m]] == *label,
            Values::Numbers(_) => false,
        };
        Array2::from_shape_fn((self.n_demos() - first, self.regressors.len()), |(m, k)| match &self.regressors[k] {
            Regressor::Constant => 1.0,
            Regressor::Number(q) => number(*q, first + m),
            Regressor::Square(q) => number(*q, first + m).powi(2),
            Regressor::Label(q, label) => f64::from(u8::from(is(*q, first + m, label))),
        })
    }

    /// Keeps the findings about a block, and the magnitudes of its demonstrations.
    fn inspect(&mut self, block: &[Demonstration], first: usize) {
        let Inspected { mut findings, magnitudes } = inspect_block(block, self.settings.dt);
        self.summaries.magnitudes.extend(magnitudes.into_iter().flatten());
        if self.settings.canonical.kind() == Kind::Rhythmic {
            findings.extend(cycle_ends(block));
        }
        self.keep(findings.into_iter().map(|finding| finding.shifted(first)));
    }

    fn keep(&mut self, findings: impl Iterator<Item = Finding>) {
        for finding in findings {
            if self.findings.len() < MAX_FINDINGS && !self.findings.contains(&finding) {
                self.findings.push(finding);
            }
        }
    }
}

/// Returns the error of a demonstration of a block with its index among all.
pub(super) fn in_all(error: Error, first: usize) -> Error {
    match error {
        Error::Demo { demo, source } => Error::Demo { demo: first + demo, source },
        other => other,
    }
}
