//! Prior distribution of the parameters of a movement.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};

use super::calibration::Calibration;
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Model;
use crate::validate::{check_finite, check_length, check_matrix, check_range};

/// Smallest number of demonstrations of a prior.
pub(crate) const MIN_DEMOS: usize = 3;
/// Smallest standard deviation of the logarithm of the duration: recordings of one length have none.
pub(crate) const MIN_LOG_DEVIATION: f64 = 0.003;
/// Largest relative difference of equal parameters of demonstrations.
const ROUNDING: f64 = 1e-6;
/// Share of the covariance of the demonstrations that its diagonal replaces.
const SHRINKAGE: f64 = 0.1;

/// Settings of a prior, chosen by cross-validation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Bandwidth c of the kernel on each demonstration, in (0, 1], relative to the deviations of the demonstrations.
    pub bandwidth: f64,
    /// Exponent β of the likelihood, in (0, 1].
    pub tempering: f64,
    /// Correlation time of the residual, in seconds.
    pub correlation_time: f64,
}

/// Mixture of Gaussian kernels on M demonstrations, with the settings and factors of a recogniser.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    /// Style (J,), goal (D,) and start (D,) of each demonstration, or style and anchor (D,) of a rhythmic movement (M, K).
    pub parameters: Array2<f64>,
    /// Logarithms (M,) of the durations in seconds.
    pub log_durations: Vec<f64>,
    /// Settings.
    pub settings: Settings,
    /// Factors of the bands.
    pub calibration: Calibration,
}

/// Prior distribution of style, goal, start or anchor, and duration, from the demonstrations of a model.
///
/// A mixture of Gaussian kernels, one on each of the M demonstrations, of covariance c²Σ about centres drawn towards the
/// mean so that the mixture keeps mean and covariance of the demonstrations (M. West, J. R. Stat. Soc. B 55, 1993),
///
/// ```text
/// p(θ, log T) = 1/M Σₘ N(μ + √(1−c²)(θₘ − μ), c²Σ).
/// ```
///
/// In a given context ([`Prior::given`]) the demonstrations are replaced by the prediction for it plus their deviations.
///
/// A movement deviates from y = Φ(u)θ by a residual of standard deviation σ_d: an Ornstein-Uhlenbeck process, which stands
/// for the shapes that the styles lack, plus white noise. The exponent β of the likelihood limits the confidence of a
/// model that is not exact (P. Grünwald, T. van Ommen, Bayesian Analysis 12, 2017, doi:10.1214/17-BA1085).
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    kind: Kind,
    n_styles: usize,
    residual: Vec<f64>,
    mixture: Mixture,
    /// Deviations of the demonstrations from the predictions for their contexts, if there are any.
    deviations: Option<Mixture>,
    /// Parameters and logarithms of the durations (M, K + 1) of the demonstrations of the model, if that is known.
    demonstrated: Option<Array2<f64>>,
}

impl Settings {
    fn check(&self) -> Result<()> {
        let share = |value: f64| (1e-6..=1.0).contains(&value);
        let &Self { bandwidth, tempering, correlation_time } = self;
        check_range("bandwidth", bandwidth, share(bandwidth), "must lie between 1e-6 and 1")?;
        check_range("tempering", tempering, share(tempering), "must lie between 1e-6 and 1")?;
        let valid = (1e-9..=1e9).contains(&correlation_time);
        check_range("correlation_time", correlation_time, valid, "seconds must lie between 1e-9 and 1e9")
    }
}

impl Mixture {
    /// Returns the mixture if it is valid, with its parameters in one order in memory, on which rounding depends.
    fn checked(self) -> Result<Self> {
        check_matrix("parameters", self.parameters.view())?;
        if self.parameters.nrows() < MIN_DEMOS {
            let problem = "of fewer than three demonstrations: a prior needs at least three";
            return Err(Error::Argument { name: "parameters", problem });
        }
        check_length("log_durations", self.log_durations.len(), self.parameters.nrows(), "demonstration")?;
        check_finite("log_durations", &self.log_durations)?;
        let allowed = "must be the logarithms of durations between 1e-9 and 1e9 s";
        let valid = |log: f64| log.abs() <= 20.8;
        self.log_durations.iter().try_for_each(|&log| check_range("log_durations", log, valid(log), allowed))?;
        self.settings.check()?;
        self.calibration.check()?;
        Ok(Self { parameters: self.parameters.as_standard_layout().into_owned(), ..self })
    }
}

/// Moments of the demonstrations.
pub(crate) struct Moments {
    /// Mean of the parameters (K,).
    pub(crate) mean: Vec<f64>,
    /// Covariance (K, K) of the parameters given the duration.
    pub(crate) covariance: Array2<f64>,
    /// Mean of the logarithms of the durations.
    pub(crate) log_mean: f64,
    /// Their standard deviation.
    pub(crate) log_deviation: f64,
    /// Regression (K,) of the parameters on the logarithm of the duration.
    pub(crate) slope: Vec<f64>,
}

impl Prior {
    /// Creates a prior from the demonstrations, and the standard deviations (D,) of the residual.
    ///
    /// ```
    /// use ndarray::array;
    /// use pdmp_core::Kind;
    /// use pdmp_core::inference::{Calibration, Mixture, Prior, Settings};
    ///
    /// let mixture = Mixture {
    ///     parameters: array![[0.1, 1.0, 0.0], [0.2, 1.1, 0.0], [0.4, 1.3, 0.1]],
    ///     log_durations: vec![0.0, 0.1, 0.2],
    ///     settings: Settings { bandwidth: 0.5, tempering: 1.0, correlation_time: 0.1 },
    ///     calibration: Calibration::NONE,
    /// };
    /// let prior = Prior::new(Kind::Discrete, mixture, vec![0.01])?;
    /// assert_eq!((prior.n_demos(), prior.n_styles()), (3, 1));
    /// # Ok::<(), pdmp_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Fewer than three demonstrations, lengths that do not match, numbers that are not finite, durations outside of 1e-9 to
    /// 1e9 s, or settings or factors out of range.
    pub fn new(kind: Kind, mixture: Mixture, residual: Vec<f64>) -> Result<Self> {
        let mixture = mixture.checked()?;
        check_finite("residual", &residual)?;
        let (n_positions, found) = (frame_size(kind) * residual.len(), mixture.parameters.ncols());
        if residual.is_empty() || found <= n_positions {
            let (name, per) = ("parameters", "style, and goal and start of each DoF");
            return Err(Error::Length { name, expected: n_positions + 1, found, per });
        }
        let allowed = "must lie between 1e-100 and 1e100";
        let valid = |sd: f64| (1e-100..=1e100).contains(&sd);
        residual.iter().try_for_each(|&sd| check_range("residual", sd, valid(sd), allowed))?;
        Ok(Self { kind, n_styles: found - n_positions, residual, mixture, deviations: None, demonstrated: None })
    }

    /// Returns the prior as one of a model with given parameters and logarithms of the durations (M, K + 1) of the
    /// demonstrations, which [`Prior::demonstrated`] returns. Other models then refuse it.
    ///
    /// ```
    /// # use ndarray::array;
    /// # use pdmp_core::Kind;
    /// # use pdmp_core::inference::{Calibration, Mixture, Prior, Settings};
    /// # let settings = Settings { bandwidth: 0.5, tempering: 1.0, correlation_time: 0.1 };
    /// # let parameters = array![[0.1, 1.0, 0.0], [0.2, 1.1, 0.0], [0.4, 1.3, 0.1]];
    /// # let (log_durations, calibration) = (vec![0.0, 0.1, 0.2], Calibration::NONE);
    /// # let mixture = Mixture { parameters, log_durations, settings, calibration };
    /// let demonstrated = array![[0.1, 1.0, 0.0, 0.0], [0.2, 1.1, 0.0, 0.1], [0.4, 1.3, 0.1, 0.2]];
    /// let prior = Prior::new(Kind::Discrete, mixture, vec![0.01])?.with_demonstrated(demonstrated.clone())?;
    /// assert_eq!(prior.demonstrated(), Some(demonstrated.view()));
    /// # Ok::<(), pdmp_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Another number of columns than the prior has parameters, and one, or a number that is not finite.
    pub fn with_demonstrated(self, demonstrated: Array2<f64>) -> Result<Self> {
        check_matrix("demonstrated", demonstrated.view())?;
        let expected = self.mixture.parameters.ncols() + 1;
        check_length("demonstrated", demonstrated.ncols(), expected, "parameter, and the logarithm of the duration")?;
        Ok(Self { demonstrated: Some(demonstrated), ..self })
    }

    /// Returns the prior as one of a model.
    pub(crate) fn of_model(self, model: &Model) -> Self {
        Self { demonstrated: Some(model.demonstrated().outputs(model.kind())), ..self }
    }

    /// Returns the prior with the deviations of the demonstrations from the predictions for their contexts, with settings
    /// and factors of recognition in a given context.
    ///
    /// ```
    /// # use ndarray::array;
    /// # use pdmp_core::Kind;
    /// # use pdmp_core::inference::{Calibration, Mixture, Prior, Settings};
    /// # let settings = Settings { bandwidth: 0.5, tempering: 1.0, correlation_time: 0.1 };
    /// # let parameters = array![[0.1, 1.0, 0.0], [0.2, 1.1, 0.0], [0.4, 1.3, 0.1]];
    /// # let (log_durations, calibration) = (vec![0.0, 0.1, 0.2], Calibration::NONE);
    /// # let mixture = Mixture { parameters, log_durations, settings, calibration };
    /// # let prior = Prior::new(Kind::Discrete, mixture.clone(), vec![0.01])?;
    /// let parameters = array![[-0.01, 0.02, 0.0], [0.02, -0.01, 0.0], [-0.01, -0.01, 0.0]];
    /// let deviations = Mixture { parameters, log_durations: vec![0.02, -0.04, 0.02], ..mixture };
    /// let prior = prior.with_deviations(deviations)?;
    /// assert!(prior.deviations().is_some());
    /// # Ok::<(), pdmp_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// A shape other than that of the demonstrations, and as for [`Prior::new`].
    pub fn with_deviations(self, deviations: Mixture) -> Result<Self> {
        let deviations = deviations.checked()?;
        let (rows, columns) = deviations.parameters.dim();
        check_length("deviations", rows, self.n_demos(), "demonstration")?;
        check_length("deviations", columns, self.mixture.parameters.ncols(), "parameter of a demonstration")?;
        Ok(Self { deviations: Some(deviations), ..self })
    }

    /// Returns the prior of movements in a context (Q,) of a model: kernels on the sums of the prediction θ(h) for the context
    /// and the deviation of each demonstration from the prediction for its context by the other demonstrations,
    ///
    /// ```text
    /// p(θ, log T | h) = 1/M Σₘ N(μ + √(1−c²)(θ'ₘ − μ), c²Σ),  θ'ₘ = θ(h) + θₘ − θ₋ₘ(hₘ),
    /// ```
    ///
    /// with mean μ and covariance Σ of the sums.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::learning::learn_prior;
    /// # use pdmp_core::numerics::Threads;
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # // Each obstacle is passed twice.
    /// # let demos = [demos.clone(), demos].concat();
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let prior = learn_prior(&model, &demos, None, Threads::ONE)?;
    /// // The height of the obstacle is known.
    /// let given = prior.given(&model, &[0.15])?;
    /// assert_eq!(given.n_demos(), prior.n_demos());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A prior of another model or without deviations, or a context that [`Model::predict`] refuses.
    pub fn given<V: Clone + Into<ContextValue>>(&self, model: &Model, context: &[V]) -> Result<Self> {
        self.check_model(model)?;
        let (prediction, durations) = (model.map_of_context()?.predict(context)?.mean, model.predicted_durations());
        let problem = "does not apply: the prior has no contexts; learn it from a model with contexts, with two demonstrations of each label";
        let deviations = self.deviations.as_ref().ok_or(Error::Argument { name: "context", problem })?;
        let n_parameters = self.mixture.parameters.ncols();
        let log_duration = prediction[n_parameters].clamp(durations.start().ln(), durations.end().ln());
        let mixture = Mixture {
            parameters: &deviations.parameters + &ndarray::aview1(&prediction[..n_parameters]),
            log_durations: deviations.log_durations.iter().map(|deviation| log_duration + deviation).collect(),
            ..*deviations
        };
        let given = Self::new(self.kind, mixture, self.residual.clone())?;
        Ok(Self { demonstrated: self.demonstrated.clone(), ..given })
    }

    /// Returns the prior with other settings.
    ///
    /// # Errors
    /// A bandwidth or exponent outside 1e-6 to 1, or a correlation time that is not positive.
    pub(crate) fn with_settings(self, settings: Settings) -> Result<Self> {
        settings.check()?;
        Ok(Self { mixture: Mixture { settings, ..self.mixture }, ..self })
    }

    /// Checks that the prior may be one of a model.
    ///
    /// # Errors
    /// Its kind, styles, degrees of freedom or demonstrations differ.
    pub(crate) fn check_model(&self, model: &Model) -> Result<()> {
        let n_parameters = model.n_styles() + frame_size(model.kind()) * model.n_dofs();
        let same = self.kind == model.kind() && self.residual.len() == model.n_dofs();
        if !same || self.mixture.parameters.ncols() != n_parameters {
            let problem = "is of another model: its kind, styles or degrees of freedom differ";
            return Err(Error::Argument { name: "prior", problem });
        }
        let own = self.demonstrated.as_ref().map(|_| model.demonstrated().outputs(model.kind()));
        if self.demonstrated.iter().zip(&own).any(|(other, own)| !are_equal(other, own)) {
            let problem = "is of another model: their demonstrations differ; learn a prior from the demonstrations of this \
                           model, or load the one in its file";
            return Err(Error::Argument { name: "prior", problem });
        }
        Ok(())
    }

    /// Returns the kind of movement.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Returns the number of demonstrations M.
    pub fn n_demos(&self) -> usize {
        self.mixture.parameters.nrows()
    }

    /// Returns the style dimension J.
    pub fn n_styles(&self) -> usize {
        self.n_styles
    }

    /// Returns the parameters (M, K) of the demonstrations.
    pub fn parameters(&self) -> ArrayView2<'_, f64> {
        self.mixture.parameters.view()
    }

    /// Returns the logarithms (M,) of the durations in seconds.
    pub fn log_durations(&self) -> &[f64] {
        &self.mixture.log_durations
    }

    /// Returns the standard deviations σ (D,) of the residual.
    pub fn residual(&self) -> &[f64] {
        &self.residual
    }

    /// Returns the settings.
    pub fn settings(&self) -> Settings {
        self.mixture.settings
    }

    /// Returns the factors of the bands.
    pub fn calibration(&self) -> &Calibration {
        &self.mixture.calibration
    }

    /// Returns the demonstrations, with settings and factors.
    pub fn mixture(&self) -> &Mixture {
        &self.mixture
    }

    /// Returns their deviations from the predictions for their contexts, with settings and factors of recognition in a given
    /// context; `None` without contexts.
    pub fn deviations(&self) -> Option<&Mixture> {
        self.deviations.as_ref()
    }

    /// Returns the parameters and logarithms of the durations (M, K + 1) of the demonstrations of its model; `None` of a
    /// prior that [`Prior::new`] creates, which every model of the same kind, styles and degrees of freedom accepts.
    pub fn demonstrated(&self) -> Option<ArrayView2<'_, f64>> {
        self.demonstrated.as_ref().map(|demonstrated| demonstrated.view())
    }

    /// Computes the moments of the demonstrations. The covariance is shrunk towards its diagonal (O. Ledoit, M. Wolf,
    /// J. Multivar. Anal. 88, 2004), since it is singular with fewer demonstrations than parameters.
    ///
    /// The diagonal is that of any frame: the three components of each of the `vectors`, by its first DoF, share their mean.
    pub(crate) fn moments(&self, vectors: &[usize]) -> Moments {
        let n = self.n_demos() as f64;
        let Mixture { parameters, log_durations, .. } = &self.mixture;
        let mean = parameters.sum_axis(Axis(0)) / n;
        let log_mean = log_durations.iter().sum::<f64>() / n;
        let deviations = parameters - &mean;
        let logs: ndarray::Array1<f64> = log_durations.iter().map(|log| log - log_mean).collect();
        let log_variance = logs.dot(&logs) / n + MIN_LOG_DEVIATION * MIN_LOG_DEVIATION;
        let slope = deviations.t().dot(&logs) * ((1.0 - SHRINKAGE) / n / log_variance);
        let mut covariance = deviations.t().dot(&deviations) / n;
        let mut diagonal = covariance.diag().to_owned();
        let positions = (self.n_styles..diagonal.len()).step_by(self.residual.len());
        for first in positions.flat_map(|position| vectors.iter().map(move |dof| position + dof)) {
            let mean = (0..3).map(|i| diagonal[first + i]).sum::<f64>() / 3.0;
            (0..3).for_each(|i| diagonal[first + i] = mean);
        }
        // A parameter that does not vary keeps a small variance, so that the covariance is regular.
        let least = 1e-9 * diagonal.sum() / diagonal.len() as f64 + f64::MIN_POSITIVE.sqrt();
        covariance *= 1.0 - SHRINKAGE;
        covariance.diag_mut().scaled_add(SHRINKAGE, &diagonal);
        covariance.diag_mut().iter_mut().for_each(|variance| *variance += least);
        for ((i, j), entry) in covariance.indexed_iter_mut() {
            *entry -= slope[i] * slope[j] * log_variance;
        }
        Moments { mean: mean.to_vec(), covariance, log_mean, log_deviation: log_variance.sqrt(), slope: slope.to_vec() }
    }
}

/// Returns true if two matrices are equal but for rounding, relative to the largest number of each column.
fn are_equal(a: &Array2<f64>, b: &Array2<f64>) -> bool {
    let equal_columns = |(a, b): (ArrayView1<f64>, ArrayView1<f64>)| {
        let largest = a.iter().chain(&b).fold(0.0f64, |largest, x| largest.max(x.abs()));
        a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= ROUNDING * largest)
    };
    a.dim() == b.dim() && a.columns().into_iter().zip(b.columns()).all(equal_columns)
}

/// Returns the number of positions of each DoF among the parameters: goal and start, or the anchor.
pub(crate) fn frame_size(kind: Kind) -> usize {
    match kind {
        Kind::Discrete => 2,
        Kind::Rhythmic => 1,
    }
}
