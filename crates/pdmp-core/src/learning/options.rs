//! What can be chosen about a fit, and what a fit tells on its way.

use crate::context::MapChoice;
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::learning::alignment::{Alignment, TimeScaling};
use crate::learning::factorization::StyleCount;
use crate::learning::regression::{Basis, Gp};
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;
use crate::validate::check_vector;

/// The unit of each degree of freedom in the factorisation.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum DofScale {
    /// As recorded where all DoFs have one unit, or none is known. Of DoFs in different units, those in one unit are
    /// scaled together, by the largest range among them: what hardly moves, or not at all, stays small.
    #[default]
    Auto,
    /// As recorded.
    Unit,
    /// The range of each DoF, so that all weigh alike.
    Range,
    /// Given (D,), in the unit of each DoF.
    Given(Vec<f64>),
}

impl DofScale {
    /// The units (D,) that were given, if any were.
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

    /// The scales (D,) of DoFs with these ranges and units.
    pub(super) fn of(&self, ranges: &[f64], units: &[String]) -> Vec<f64> {
        // A DoF at rest has no range; it has no target to be scaled either.
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

/// Everything that can be chosen about a fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// How demonstrations are read and aligned.
    pub alignment: Alignment,
    /// Conditions of the demonstrations (M rows of Q); otherwise those that they carry.
    pub contexts: Option<Vec<Vec<ContextValue>>>,
    /// What leads from contexts to movements.
    pub map: MapChoice,
    /// Style dimension J.
    pub styles: StyleChoice,
    /// Function approximator of the landscape.
    pub basis: Basis,
    /// How the way from start to goal is spread over a discrete movement.
    pub transport: TransportChoice,
    /// Unit of each DoF in the factorisation.
    pub dof_scale: DofScale,
    /// Time constant τ in seconds, discrete; otherwise the nominal duration.
    pub tau: Option<f64>,
    /// α_z of the output system.
    pub alpha_z: f64,
    /// β_z of the output system; otherwise α_z/4, critical damping.
    pub beta_z: Option<f64>,
    /// α_x of the canonical system, discrete; otherwise x = 0.01 at the end of the nominal demonstration.
    pub alpha_x: Option<f64>,
    /// μ of the canonical system, rhythmic.
    pub mu: f64,
    /// How many threads may work on it. The model does not depend on it, to the last bit.
    pub threads: Threads,
}

impl FitOptions {
    /// The defaults: smoothing by cross-validation, the systematic styles, a Gaussian process, a learnt transport, α_z = 25,
    /// μ = 1, as many threads as the system allows, and all else from the demonstrations.
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
            map: MapChoice::Auto,
            styles: StyleChoice::Systematic,
            basis: Basis::Gp(Gp::default()),
            transport: TransportChoice::Learnt,
            dof_scale: DofScale::Auto,
            tau: None,
            alpha_z: 25.0,
            beta_z: None,
            alpha_x: None,
            mu: 1.0,
            threads: Threads::available(),
        }
    }
}

/// The choice of the style dimension J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StyleChoice {
    /// As many as carry nine tenths of the sum of the singular values, at least five, and at least as many as the
    /// contexts explain; never more than exceed the measurement noise.
    #[default]
    Systematic,
    /// By number, or by the spectrum.
    Given(StyleCount),
    /// The fewest that foresee movements, in contexts held out, with an error above the least that any number has by no
    /// more than the standard error of the difference: cross-validation over the contexts, in at most ten folds.
    Auto,
}

impl From<StyleCount> for StyleChoice {
    fn from(count: StyleCount) -> Self {
        Self::Given(count)
    }
}

/// Where a fit is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The warps of step 1, where time is not scaled linearly.
    Align,
    /// The rest of step 1, and step 2, demonstration by demonstration.
    Targets,
    /// Step 3.
    Factorise,
    /// Step 4.
    Regress,
    /// Compiling the landscape to its table.
    Compile,
}

impl Stage {
    /// The name shown to a user.
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

/// How the way from start to goal is spread over a discrete movement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransportChoice {
    /// By a profile learnt from the demonstrations.
    #[default]
    Learnt,
    /// At once, as in the paper: m ≡ 1.
    Immediate,
}
