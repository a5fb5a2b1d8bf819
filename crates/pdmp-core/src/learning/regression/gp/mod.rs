//! Gaussian process regression with hyperparameters of maximum marginal likelihood.

mod interpolation;
mod kalman_filter;
mod kernel;
mod likelihood;
mod matern_sde;
mod periodic;
mod posterior;
mod rts_smoother;
mod state_space;

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView2};

pub use self::kernel::Kernel;
use self::likelihood::{Gradient, Likelihood, Profile};
pub use self::posterior::{GpPosterior, GpPrediction};
use self::state_space::StateSpace;
use super::hyperparameter_search::{Axis, maximise};
use super::{Domain, magnitude};
use crate::error::{Error, Result};
use crate::validate::{check_positive, check_range};

/// Smallest ratio of noise to signal variance: below it, rounding makes the covariance matrix indefinite.
const MIN_NOISE: f64 = 1e-10;
/// Largest ratio that the search considers. The signal's deviation is then a hundredth of the noise's, and more noise no
/// longer changes the likelihood.
const MAX_NOISE: f64 = 1e4;
/// Largest ratio that an ill-conditioned factorisation is regularised with.
const MAX_REGULARISATION: f64 = 1.0;
/// Samples of which the search scans the likelihood.
const SCANNED: usize = 256;
/// Samples between two progress reports.
const PORTION: usize = 4096;

/// Gaussian process regression.
///
/// The P outputs are independent zero-mean Gaussian processes over the clock with one covariance σ²K,
/// K = k(u, u′; ℓ) + νI. The signal variance has its maximum-likelihood value σ̂² = Σ fᵀK⁻¹f/(CP). Length scale ℓ and
/// noise ratio ν, unless given, maximise the profile log likelihood −CP/2·ln σ̂² − P/2·ln|K| over ν from 1e-10 to 1e4
/// and over ℓ from the sampling interval to twice the extent of the clock. In the landscape of a primitive,
/// [`NoiseBound::LANDSCAPE`] bounds the noise further.
///
/// The outputs share one variance because basis targets share their noise: S has orthonormal columns, so that equal
/// noise on the demonstrations is equal noise on every row of ΣVᵀ, strong or weak. With one variance per output, the
/// weak factors of real recordings, which are mostly noise, would determine the hyperparameters of the strong ones.
///
/// Matérn processes are Markov: a Kalman filter and smoother give the likelihood, its gradient and the posterior
/// exactly, in O(CP) time and memory, for any inputs. The search scans the likelihood of at most 256 samples, evenly
/// thinned, and ascends from its best points with the gradient for all samples.
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Sections 2.2 and 5.4; J. Hartikainen and
/// S. Särkkä, Kalman filtering and smoothing solutions to temporal Gaussian process regression models, MLSP 2010,
/// <https://doi.org/10.1109/MLSP.2010.5589113>.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::learning::regression::{Domain, Gp, Regression};
///
/// let u: Vec<f64> = (0..50).map(|i| f64::from(i) / 49.0).collect();
/// let targets = Array2::from_shape_fn((50, 1), |(i, _)| (3.0 * u[i]).sin());
/// let posterior = Gp::default().regress(Domain::Interval { end: 1.0 }, &u, targets.view(), &mut |_| Ok(()))?;
/// let (mut value, mut slope) = ([0.0], [0.0]);
/// posterior.evaluate(0.5, &mut value, &mut slope);
/// assert!((value[0] - 1.5f64.sin()).abs() < 1e-3);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gp {
    /// Covariance function.
    pub kernel: Kernel,
    /// Length scale ℓ in units of u, from 1e-6 to 1e6 times the extent of the clock.
    pub length: Option<f64>,
    /// Ratio ν of noise to signal variance, from 1e-10 to 1e6.
    pub noise: Option<f64>,
}

/// Upper bound of the noise that a hyperparameter search may attribute to the targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseBound {
    /// Largest ratio ν of noise to signal variance.
    ratio: f64,
    /// Largest noise νσ̂² as a share of the targets' mean square, where it is bounded.
    share: Option<f64>,
    /// Number of ratios that the scan evaluates.
    points: usize,
}

impl NoiseBound {
    /// Noise of maximum likelihood, up to a ratio of 1e4.
    pub const NONE: Self = Self { ratio: MAX_NOISE, share: None, points: 15 };

    /// Bound in the landscape of a primitive: a thousandth of the deviation of the signal, and of the targets.
    ///
    /// No style restores what the landscape treats as noise, and noise of the demonstrations is removed by smoothing.
    /// With ratios up to 1 the likelihood took the impact in recorded walking forces for noise, and half of the signal
    /// with it: reproductions were off by 23 % of the range, against 6 % with three styles and 3 % with all of them
    /// below 1e-4. Below 1e-6 handwriting is reproduced to 1e-4 at worst. The ratio alone is no bound: with long
    /// lengths the signal variance is far larger than the targets' mean square, and at a ratio of 1e-6 recorded robot
    /// paths were reproduced worse than by a network.
    pub const LANDSCAPE: Self = Self { ratio: 1e-6, share: Some(1e-6), points: 3 };
}

impl Gp {
    /// Returns a process with the given kernel and hyperparameters; those that are `None` are estimated.
    ///
    /// ```
    /// # use pdmp_core::learning::regression::{Gp, Kernel};
    /// # fn main() -> pdmp_core::Result<()> {
    /// let given = Gp::new(Kernel::Matern52, Some(0.5), None)?;
    /// assert!(Gp::new(Kernel::Matern52, Some(-0.5), None).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A length that is not positive, or noise outside [1e-10, 1e6].
    pub fn new(kernel: Kernel, length: Option<f64>, noise: Option<f64>) -> Result<Self> {
        length.map_or(Ok(()), |length| check_positive("length", length))?;
        check_noise(noise)?;
        Ok(Self { kernel, length, noise })
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must not decrease, with noise of maximum likelihood.
    ///
    /// # Errors
    /// As for [`Gp::regress_within`].
    pub fn regress(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<GpPosterior> {
        self.regress_within(NoiseBound::NONE, domain, u, targets, progress)
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must not decrease, with noise of maximum likelihood
    /// within a bound. A given noise is not bounded.
    ///
    /// `progress` is called before each evaluation of the likelihood, and every 4096 samples within one, with the
    /// completed fraction; an error it returns cancels the regression.
    ///
    /// If rounding makes K indefinite, ν is raised tenfold, at most to 1; [`GpPosterior::noise`] returns the value used.
    ///
    /// ```
    /// # use ndarray::Array2;
    /// # use pdmp_core::learning::regression::{Domain, Gp, NoiseBound};
    /// # let u: Vec<f64> = (0..50).map(|i| f64::from(i) / 49.0).collect();
    /// # let targets = Array2::from_shape_fn((50, 1), |(i, _)| (3.0 * u[i]).sin() + 0.1 * (i % 2) as f64);
    /// # let (domain, bound) = (Domain::Interval { end: 1.0 }, NoiseBound::LANDSCAPE);
    /// let posterior = Gp::default().regress_within(bound, domain, &u, targets.view(), &mut |_| Ok(()))?;
    /// assert!(posterior.noise() <= 1e-6);
    /// # Ok::<(), pdmp_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Hyperparameters out of range, arrays that do not match, values that are not finite; a covariance matrix that
    /// stays indefinite; the error that `progress` returned.
    pub fn regress_within(
        &self,
        bound: NoiseBound,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<GpPosterior> {
        super::check(domain, u, targets)?;
        self.check(domain)?;
        let progress = &mut Progress { progress, share: 0.0 };
        match self.kernel {
            Kernel::Matern32 => self.learn::<2>(bound, domain, u, targets, progress),
            Kernel::Matern52 => self.learn::<3>(bound, domain, u, targets, progress),
        }
    }

    fn learn<const D: usize>(
        &self,
        bound: NoiseBound,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        progress: &mut Progress,
    ) -> Result<GpPosterior> {
        let samples = Samples::new(u, targets);
        let process = StateSpace::<D>::new(domain, &samples);
        let mut at = self.hyperparameters(bound, domain, &samples, &process, progress)?;
        progress.reach(0.9)?;
        let (profile, posterior) = loop {
            match process.fit(at, progress)? {
                Some(fitted) => break fitted,
                None if at.noise < MAX_REGULARISATION => at.noise = (10.0 * at.noise).min(MAX_REGULARISATION),
                None => {
                    let (kernel, Hyperparameters { length, noise }) = (self.kernel, at);
                    return Err(Error::Fit(format!(
                        "the {kernel} covariance matrix of length {length} and noise {noise:e} is not positive \
                         definite: give a shorter length or more noise"
                    )));
                }
            }
        };
        progress.reach(1.0)?;

        let deviation = profile.variance.sqrt() * samples.scale;
        // The terms that the search omits: densities are per unit of the outputs.
        let constant = if deviation > 0.0 { (TAU.sqrt() * samples.scale).ln() + 0.5 } else { 0.0 };
        let log_likelihood = profile.value() - targets.len() as f64 * constant;
        let (kernel, scale, n_outputs) = (self.kernel, samples.scale, targets.ncols());
        Ok(GpPosterior { kernel, at, function: Box::new(posterior), scale, n_outputs, deviation, log_likelihood })
    }

    fn check(&self, domain: Domain) -> Result<()> {
        if let Some(length) = self.length {
            let allowed = "must lie between 1e-6 and 1e6 times the extent of the clock";
            check_range("length", length, (1e-6..=1e6).contains(&(length / domain.extent())), allowed)?;
        }
        check_noise(self.noise)
    }

    /// Returns the given hyperparameters; those not given maximise the likelihood of the samples.
    fn hyperparameters<const D: usize>(
        &self,
        within: NoiseBound,
        domain: Domain,
        samples: &Samples,
        process: &StateSpace<D>,
        progress: &mut Progress,
    ) -> Result<Hyperparameters> {
        let extent = domain.extent();
        let lengths = (extent / samples.u.len() as f64, 2.0 * extent);
        if let (Some(length), Some(noise)) = (self.length, self.noise) {
            return Ok(Hyperparameters { length, noise });
        }
        if samples.targets.iter().all(|&value| value == 0.0) {
            // Every hyperparameter has the same likelihood.
            let length = self.length.unwrap_or((lengths.0 * lengths.1).sqrt());
            return Ok(Hyperparameters { length, noise: self.noise.unwrap_or(MIN_NOISE) });
        }
        let axis = |given: Option<f64>, (low, high): (f64, f64), points| {
            given.map_or(Axis { low: low.ln(), high: high.ln(), points }, |given| Axis::fixed(given.ln()))
        };
        let noises = (MIN_NOISE, within.ratio);
        let axes = [axis(self.length, lengths, 12), axis(self.noise, noises, within.points)];
        let mean_square = || samples.targets.iter().map(|f| f * f).sum::<f64>() / samples.targets.len() as f64;
        let bound = within.share.filter(|_| self.noise.is_none()).map(|share| share * mean_square());
        let scanned = StateSpace::new(domain, &samples.thinned(SCANNED));
        let [length, noise] = maximise(&axes, &mut Likelihood { scanned, process, bound, progress })?;
        // Given values are returned without the rounding of exp(ln x).
        Ok(Hyperparameters {
            length: self.length.unwrap_or(length.exp()),
            noise: self.noise.unwrap_or(noise.exp().clamp(noises.0, noises.1)),
        })
    }
}

fn check_noise(noise: Option<f64>) -> Result<()> {
    noise.map_or(Ok(()), |noise| {
        check_range("noise", noise, (MIN_NOISE..=1e6).contains(&noise), "must lie between 1e-10 and 1e6")
    })
}

/// Length scale ℓ and noise ratio ν.
#[derive(Clone, Copy, Debug)]
struct Hyperparameters {
    length: f64,
    noise: f64,
}

/// Samples divided by their largest magnitude.
struct Samples {
    u: Vec<f64>,
    scale: f64,
    /// (C, P).
    targets: Array2<f64>,
}

impl Samples {
    fn new(u: &[f64], targets: ArrayView2<f64>) -> Self {
        let scale = magnitude(targets);
        Self { u: u.to_vec(), scale, targets: targets.mapv(|value| value / scale) }
    }

    /// Returns every k-th sample, with the smallest k that leaves at most `n`.
    fn thinned(&self, n: usize) -> Self {
        let step = self.u.len().div_ceil(n);
        let targets = self.targets.slice(ndarray::s![..;step, ..]).to_owned();
        Self { u: self.u.iter().copied().step_by(step).collect(), scale: self.scale, targets }
    }
}

/// Progress callback of a regression.
struct Progress<'a> {
    progress: &'a mut dyn FnMut(f64) -> Result<()>,
    share: f64,
}

impl Progress<'_> {
    /// Reports the current share again.
    fn report(&mut self) -> Result<()> {
        (self.progress)(self.share)
    }

    fn reach(&mut self, share: f64) -> Result<()> {
        self.share = share;
        self.report()
    }

    /// Reports another evaluation of the likelihood. Their number is not known in advance, but rarely exceeds 100.
    fn advance(&mut self) -> Result<()> {
        self.reach(self.share + 0.03 * (0.9 - self.share))
    }
}

#[cfg(test)]
mod tests;
