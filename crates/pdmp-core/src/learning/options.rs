//! Options and progress stages of a fit.

use crate::context::MapSelection;
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::{Alignment, TimeScaling};
use crate::learning::factorization::Truncation;
use crate::learning::regression::{Basis, Gp};
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;
use crate::validate::check_vector;

/// Scale of each degree of freedom in the factorisation.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum DofScaling {
    /// 1 where all DoFs have the same unit, or none is known. Otherwise DoFs with the same unit share one scale, the
    /// largest range among them, so that a DoF that hardly moves stays small.
    #[default]
    Auto,
    /// 1: values as recorded.
    Unit,
    /// Range of each DoF, which gives all DoFs equal weight.
    Range,
    /// Given scales (D,), in the unit of each DoF, from 1e-100 to 1e100.
    Given(Vec<f64>),
}

impl DofScaling {
    /// Returns the given scales (D,), or `None`.
    ///
    /// # Errors
    /// Another number of scales than DoFs, or a scale out of range.
    pub(super) fn given(&self, n_dofs: usize) -> Result<Option<&[f64]>> {
        let Self::Given(scale) = self else { return Ok(None) };
        check_vector("dof_scale", scale, n_dofs, "DoF")?;
        match scale.iter().find(|value| !(1e-100..=1e100).contains(*value)) {
            Some(&value) => {
                Err(Error::Range { name: "dof_scale", value, allowed: "must lie between 1e-100 and 1e100" })
            }
            None => Ok(Some(scale)),
        }
    }

    /// Returns the scales (D,) of DoFs with the given ranges and units.
    pub(super) fn of(&self, ranges: &[f64], units: &[String]) -> Vec<f64> {
        // A DoF at rest has a range of zero, and targets of zero.
        let moving = |range: f64| if range > 0.0 { range } else { 1.0 };
        match self {
            Self::Auto if units.iter().any(|unit| *unit != units[0]) => {
                let largest = |unit: &String| {
                    let alike = ranges.iter().zip(units).filter(|(_, other)| *other == unit);
                    alike.fold(0.0f64, |most, (range, _)| most.max(*range))
                };
                units.iter().map(|unit| moving(largest(unit))).collect()
            }
            Self::Auto | Self::Unit => vec![1.0; ranges.len()],
            Self::Range => ranges.iter().map(|&range| moving(range)).collect(),
            Self::Given(scale) => scale.clone(),
        }
    }
}

/// Options of a fit.
///
/// ```
/// use pdmp_core::learning::{FitOptions, Truncation};
/// use pdmp_core::Kind;
///
/// let options = FitOptions { n_styles: Truncation::Rank(3).into(), ..FitOptions::new(Kind::Discrete) };
/// assert_eq!(options.alpha_z, 25.0);
/// ```
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Sampling, smoothing and alignment of the demonstrations.
    pub alignment: Alignment,
    /// Contexts of the demonstrations (M rows of Q); otherwise those that they carry.
    pub contexts: Option<Vec<Vec<ContextValue>>>,
    /// Map from contexts to movements.
    pub map: MapSelection,
    /// Style dimension J.
    pub n_styles: NStyles,
    /// Function approximator of the landscape.
    pub basis: Basis,
    /// Transport profile of discrete movements.
    pub transport: TransportSelection,
    /// Scale of each DoF in the factorisation.
    pub dof_scale: DofScaling,
    /// Time constant τ in seconds of discrete movements; otherwise the nominal duration.
    pub tau: Option<f64>,
    /// Gain α_z of the output system, from 1e-6 to 1e6.
    pub alpha_z: f64,
    /// Gain β_z of the output system, from 1e-6 to 1e6; otherwise α_z/4, critical damping.
    pub beta_z: Option<f64>,
    /// Rate α_x of the discrete canonical system; otherwise such that x = 0.01 at the end of the nominal demonstration.
    pub alpha_x: Option<f64>,
    /// Rate μ of the rhythmic canonical system.
    pub mu: f64,
    /// Largest number of threads. The model does not depend on it, bit for bit.
    pub threads: Threads,
}

impl FitOptions {
    /// Returns the defaults: smoothing by cross-validation, the systematic styles, a Gaussian process, a learnt transport
    /// profile, α_z = 25, μ = 1, every available thread, and otherwise values from the demonstrations.
    pub fn new(kind: Kind) -> Self {
        Self {
            alignment: Alignment {
                kind,
                dt: None,
                period: Vec::new(),
                smoothing: Smoothing::Auto,
                nominal: None,
                n_samples: None,
                time_scaling: TimeScaling::Linear,
            },
            contexts: None,
            map: MapSelection::Auto,
            n_styles: NStyles::AboveNoise,
            basis: Basis::Gp(Gp::default()),
            transport: TransportSelection::Learnt,
            dof_scale: DofScaling::Auto,
            tau: None,
            alpha_z: 25.0,
            beta_z: None,
            alpha_x: None,
            mu: 1.0,
            threads: Threads::available(),
        }
    }
}

/// Selection of the style dimension J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NStyles {
    /// Smallest J that carries nine tenths of the sum of the singular values, but at least five, and at least the number
    /// of styles that the contexts explain; at most the number of singular values above the measurement noise.
    #[default]
    AboveNoise,
    /// Given J, or J by the singular values.
    Truncated(Truncation),
    /// Smallest J within one standard error of the lowest cross-validation error (one-standard-error rule), with at most
    /// ten folds of the contexts.
    CrossValidated,
}

impl From<Truncation> for NStyles {
    fn from(count: Truncation) -> Self {
        Self::Truncated(count)
    }
}

/// Stage of a fit.
///
/// ```
/// assert_eq!(pdmp_core::learning::Stage::Regress.name(), "regress");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Time warps of step 1, where time is not scaled linearly.
    Align,
    /// Resampling of step 1, and step 2.
    Targets,
    /// Step 3: factorisation of the targets.
    Factorise,
    /// Step 4: regression of the landscape.
    Regress,
    /// Tabulation of the landscape.
    Compile,
}

impl Stage {
    /// Returns the name for display.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Align => "align",
            Stage::Targets => "targets",
            Stage::Factorise => "factorise",
            Stage::Regress => "regress",
            Stage::Compile => "compile",
        }
    }
}

/// Transport profile m(u): share of the displacement from start to goal that a discrete movement has covered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransportSelection {
    /// Profile learnt from the demonstrations.
    #[default]
    Learnt,
    /// m ≡ 1, as in the paper.
    Immediate,
}
