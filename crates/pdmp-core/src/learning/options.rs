//! Options and progress stages of a fit.

use crate::context::MapSelection;
use crate::demonstration::ContextValue;
use crate::error::Result;
use crate::kind::Kind;
use crate::learning::alignment::{Alignment, TimeScaling};
use crate::learning::factorization::Truncation;
use crate::learning::regression::{Basis, Gp};
use crate::model::Frame;
use crate::numerics::smoothing_spline::Smoothing;
use crate::numerics::threads::Threads;
use crate::validate::{check_range, check_vector};

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
        let check = |&value: &f64| {
            check_range("dof_scale", value, (1e-100..=1e100).contains(&value), "must lie between 1e-100 and 1e100")
        };
        scale.iter().try_for_each(check).map(|()| Some(scale.as_slice()))
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

/// Canonical system of a movement with its constants.
#[derive(Clone, Debug, PartialEq)]
pub enum CanonicalOptions {
    /// A discrete movement, τẋ = −α_x x.
    Discrete {
        /// Time constant τ in seconds; otherwise the nominal duration.
        tau: Option<f64>,
        /// Rate α_x, from 1e-6 to 1e6; otherwise such that x = 0.01 at the end of the nominal demonstration.
        alpha_x: Option<f64>,
        /// Transport profile.
        transport: TransportSelection,
    },
    /// A rhythmic movement, τφ̇ = 1 and τṙ = μ(r₀ − r).
    Rhythmic {
        /// Rate μ, from 1e-6 to 1e6.
        mu: f64,
        /// Periods in seconds of cycles with time stamps: one for all, or one each; empty where the sampling intervals
        /// give them.
        periods: Vec<f64>,
    },
}

impl CanonicalOptions {
    /// Returns the kind of movement.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Discrete { .. } => Kind::Discrete,
            Self::Rhythmic { .. } => Kind::Rhythmic,
        }
    }
}

impl From<Kind> for CanonicalOptions {
    /// Returns the defaults: a learnt transport profile, μ = 1, and otherwise values from the demonstrations.
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Discrete => Self::Discrete { tau: None, alpha_x: None, transport: TransportSelection::Learnt },
            Kind::Rhythmic => Self::Rhythmic { mu: 1.0, periods: Vec::new() },
        }
    }
}

/// Options of a fit.
///
/// ```
/// use pdmp_core::FitOptions;
/// use pdmp_core::learning::Truncation;
/// use pdmp_core::numerics::Smoothing;
///
/// let options = FitOptions::discrete().n_styles(Truncation::Rank(3)).smoothing(Smoothing::CutOff { hz: 6.0 });
/// assert_eq!(options.alpha_z, 25.0);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FitOptions {
    /// Canonical system with its constants.
    pub canonical: CanonicalOptions,
    /// Sampling interval in seconds of demonstrations that carry none.
    pub dt: Option<f64>,
    /// Treatment of measurement noise.
    pub smoothing: Smoothing,
    /// Index of the nominal demonstration; otherwise that of median duration.
    pub nominal: Option<usize>,
    /// Samples C of aligned demonstrations; otherwise those of the nominal one, with steps divided into equal parts where
    /// there are fewer than 150.
    pub n_samples: Option<usize>,
    /// Scaling of time to that of the nominal demonstration.
    pub time_scaling: TimeScaling,
    /// Contexts of the demonstrations (M rows of Q); otherwise those that they carry.
    pub contexts: Option<Vec<Vec<ContextValue>>>,
    /// Names of the context columns (Q,); empty where unknown.
    pub context_names: Vec<String>,
    /// Map from contexts to movements.
    pub map: MapSelection,
    /// Style dimension J.
    pub n_styles: NStyles,
    /// Function approximator of the landscape.
    pub basis: Basis,
    /// Scale of each DoF in the factorisation.
    pub dof_scale: DofScaling,
    /// Length that weighs positions against rotations: as much of the other DoFs, in their scale, as weighs 1 rad, from 1e-6
    /// to 1e6. The default is the ratio of their deviations from the mean of the demonstrations, by root mean square.
    pub rotation_length: Option<f64>,
    /// Frame of the angular velocities and accelerations of a model with rotations.
    pub frame: Frame,
    /// Gain α_z of the output system, from 1e-6 to 1e6.
    pub alpha_z: f64,
    /// Gain β_z of the output system, from 1e-6 to 1e6; otherwise α_z/4, critical damping.
    pub beta_z: Option<f64>,
    /// Largest number of threads. The model does not depend on it, bit for bit.
    pub threads: Threads,
}

impl FitOptions {
    /// Returns the defaults for a kind of movement or a canonical system: smoothing by cross-validation, the styles above
    /// the noise, a Gaussian process, α_z = 25, every available thread, and otherwise values from the demonstrations.
    pub fn new(canonical: impl Into<CanonicalOptions>) -> Self {
        Self {
            canonical: canonical.into(),
            dt: None,
            smoothing: Smoothing::Auto,
            nominal: None,
            n_samples: None,
            time_scaling: TimeScaling::Linear,
            contexts: None,
            context_names: Vec::new(),
            map: MapSelection::Auto,
            n_styles: NStyles::AboveNoise,
            basis: Basis::Gp(Gp::default()),
            dof_scale: DofScaling::Auto,
            rotation_length: None,
            frame: Frame::Body,
            alpha_z: 25.0,
            beta_z: None,
            threads: Threads::available(),
        }
    }

    /// Returns the defaults for discrete movements.
    pub fn discrete() -> Self {
        Self::new(Kind::Discrete)
    }

    /// Returns the defaults for rhythmic movements.
    pub fn rhythmic() -> Self {
        Self::new(Kind::Rhythmic)
    }

    /// Sets the sampling interval, in seconds, of demonstrations that carry none.
    pub fn dt(self, dt: f64) -> Self {
        Self { dt: Some(dt), ..self }
    }

    /// Sets the treatment of measurement noise.
    pub fn smoothing(self, smoothing: Smoothing) -> Self {
        Self { smoothing, ..self }
    }

    /// Sets the scaling of time.
    pub fn time_scaling(self, time_scaling: TimeScaling) -> Self {
        Self { time_scaling, ..self }
    }

    /// Sets the contexts of the demonstrations (M rows of Q).
    pub fn contexts(self, contexts: Vec<Vec<ContextValue>>) -> Self {
        Self { contexts: Some(contexts), ..self }
    }

    /// Sets the names of the context columns (Q,).
    pub fn context_names(self, context_names: Vec<String>) -> Self {
        Self { context_names, ..self }
    }

    /// Sets the map from contexts to movements.
    pub fn map(self, map: MapSelection) -> Self {
        Self { map, ..self }
    }

    /// Sets the style dimension J.
    pub fn n_styles(self, n_styles: impl Into<NStyles>) -> Self {
        Self { n_styles: n_styles.into(), ..self }
    }

    /// Sets the function approximator of the landscape.
    pub fn basis(self, basis: Basis) -> Self {
        Self { basis, ..self }
    }

    /// Sets the scale of each DoF in the factorisation.
    pub fn dof_scale(self, dof_scale: DofScaling) -> Self {
        Self { dof_scale, ..self }
    }

    /// Sets the length that weighs as much as 1 rad.
    pub fn rotation_length(self, rotation_length: f64) -> Self {
        Self { rotation_length: Some(rotation_length), ..self }
    }

    /// Sets the frame of angular velocities and accelerations.
    pub fn frame(self, frame: Frame) -> Self {
        Self { frame, ..self }
    }

    /// Sets the gain α_z of the output system.
    pub fn alpha_z(self, alpha_z: f64) -> Self {
        Self { alpha_z, ..self }
    }

    /// Sets the largest number of threads.
    pub fn threads(self, threads: Threads) -> Self {
        Self { threads, ..self }
    }

    /// Returns the options of the alignment.
    pub(super) fn alignment(&self) -> Alignment {
        let periods = match &self.canonical {
            CanonicalOptions::Rhythmic { periods, .. } => periods.clone(),
            CanonicalOptions::Discrete { .. } => Vec::new(),
        };
        Alignment {
            kind: self.canonical.kind(),
            dt: self.dt,
            period: periods,
            smoothing: self.smoothing,
            nominal: self.nominal,
            n_samples: self.n_samples,
            vectors: Vec::new(),
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
