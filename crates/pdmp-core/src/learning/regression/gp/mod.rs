//! Gaussian process regression, with hyperparameters by marginal likelihood.

mod dense;
mod interpolation;
mod kalman_filter;
mod kernel;
mod matern_sde;
mod periodic;
mod posterior;
mod rts_smoother;
mod squared_exponential;
mod state_space;

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView2};

use self::dense::Dense;
pub use self::kernel::Kernel;
use self::posterior::Form;
pub use self::posterior::GpPosterior;
use self::state_space::Chain;
use super::hyperparameter_search::{Axis, Objective, Score, maximise};
use super::{Domain, magnitude};
use crate::error::{Error, Result};
use crate::validate::check_positive;

/// Smallest ratio of noise to signal variance: below, rounding makes the covariance matrix indefinite.
const LEAST_NOISE: f64 = 1e-10;
/// Largest ratio that the search considers: the signal is a hundredth of the noise, in deviations, and what more there is
/// of noise no longer changes the likelihood.
const MOST_NOISE: f64 = 1e4;
/// Weight, in halves of the number of values, of the square by which the logarithm of the noise exceeds its bound. The
/// likelihood pulls by no more than half of that number: it is exceeded by a twentieth at most.
const BARRIER: f64 = 20.0;
/// Largest ratio that a failing factorisation is helped with.
const MOST_HELP: f64 = 1.0;
/// Samples that the scan for the neighbourhood of the likeliest hyperparameters looks at.
const SCANNED: usize = 256;
/// Most samples of the squared exponential, whose covariance matrix is dense.
const MOST_SAMPLES: usize = 10_000;
/// Samples between two questions whether to go on.
const PORTION: usize = 4096;

/// Gaussian process regression.
///
/// The P outputs are independent Gaussian processes of mean zero over the clock with one covariance σ²K,
/// K = k(u, u′; ℓ) + νI. The signal variance has the maximum-likelihood value σ̂² = Σ fᵀK⁻¹f/(CP). Length ℓ and noise
/// ratio ν, where not given, maximise the log marginal likelihood with that value put in, −CP/2·ln σ̂² − P/2·ln|K|,
/// over ν from 1e-10 to 1e4 and ℓ from the distance of the samples to twice the extent of the clock. Noise in the
/// landscape of a primitive is bounded further, by [`NoiseBound::LANDSCAPE`].
///
/// The variance is shared because basis targets share their noise: S has orthonormal columns, so equal noise on the
/// demonstrations is equal noise on every row of ΣVᵀ, strong or weak. With a variance each, the weak factors of real
/// recordings, which are mostly noise, would choose the hyperparameters of the strong ones.
///
/// The Matérn processes are Markov: a Kalman filter and smoother give the likelihood, its gradient and the posterior
/// exactly, in O(CP) time and memory, on any inputs. The squared exponential factorises its dense matrix once for all
/// outputs, in O(C³) time and O(C²) memory, for at most 10 000 samples. The search scans the likelihood of at most 256
/// samples, evenly thinned, and climbs from its best places with the gradient for all samples (squared exponential:
/// at most 400).
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Sections 2.2 and 5.4.1,
/// <https://gaussianprocess.org/gpml>; Hartikainen and Särkkä, MLSP 2010,
/// <https://doi.org/10.1109/MLSP.2010.5589113>.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gp {
    /// The covariance function.
    pub kernel: Kernel,
    /// Length scale ℓ in units of u, from 1e-6 to 1e6 times the extent of the clock.
    pub length: Option<f64>,
    /// Ratio ν of noise to signal variance, from 1e-10 to 1e6.
    pub noise: Option<f64>,
}

/// How much of the targets a search may take for noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseBound {
    /// Largest ratio ν of noise to signal variance.
    ratio: f64,
    /// Largest noise νσ̂² as a share of the targets' mean square, where it is bounded.
    share: Option<f64>,
    /// Ratios that the scan looks at.
    points: usize,
}

impl NoiseBound {
    /// As much as is likeliest, up to a ratio of 1e4.
    pub const NONE: Self = Self { ratio: MOST_NOISE, share: None, points: 15 };

    /// The bound in the landscape of a primitive: a thousandth of the signal's deviation, and of the targets.
    ///
    /// What the landscape takes for noise, no style brings back, and noise on the demonstrations is what smoothing is
    /// for. With ratios up to 1 the likelihood took the impact in recorded walking forces for noise, and with it half of
    /// the signal: reproductions were off by 23 % of the range, against 6 % with three styles and 3 % with all below
    /// 1e-4. Handwriting is met to 1e-4 at worst below 1e-6. The ratio alone is no bound: long lengths have signal
    /// variances far beyond the targets' mean square, and with 1e-6 of it recorded robot paths were reproduced worse
    /// than by a network.
    pub const LANDSCAPE: Self = Self { ratio: 1e-6, share: Some(1e-6), points: 3 };
}

impl Gp {
    /// A process with the given kernel, and hyperparameters where they are not to be found.
    ///
    /// # Errors
    /// A length that is not positive, or noise outside [1e-10, 1e6].
    pub fn new(kernel: Kernel, length: Option<f64>, noise: Option<f64>) -> Result<Self> {
        length.map_or(Ok(()), |length| check_positive("length", length))?;
        check_noise(noise)?;
        Ok(Self { kernel, length, noise })
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must not decrease, with the likeliest noise.
    ///
    /// # Errors
    /// As for [`Gp::regress_within`].
    pub fn regress(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<GpPosterior> {
        self.regress_within(NoiseBound::NONE, domain, u, targets, proceed)
    }

    /// Regresses `targets` (C, outputs) on the clock `u` (C,), which must not decrease, with the likeliest noise within
    /// a bound. A noise that is given is used as it is.
    ///
    /// `proceed` is asked before each evaluation of the likelihood, and now and then in a long one, with the share done
    /// in [0, 1].
    ///
    /// If rounding makes K indefinite, ν is raised tenfold, up to 1 at most; [`GpPosterior::noise`] is what was used.
    ///
    /// # Errors
    /// Hyperparameters out of range, arrays that do not match, numbers that are not finite; more samples than a dense
    /// matrix can have; a covariance matrix that stays indefinite; whatever `proceed` returns.
    pub fn regress_within(
        &self,
        bound: NoiseBound,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<GpPosterior> {
        super::check(domain, u, targets)?;
        self.check(domain)?;
        let progress = &mut Progress { proceed, share: 0.0 };
        match self.kernel {
            Kernel::Matern32 => self.learn::<Chain<2>>(bound, domain, u, targets, progress),
            Kernel::Matern52 => self.learn::<Chain<3>>(bound, domain, u, targets, progress),
            Kernel::SquaredExponential if u.len() > MOST_SAMPLES => {
                let allowed = "a squared exponential takes at most 10000; pass a smaller n_samples, or a Matérn kernel";
                Err(Error::Range { name: "samples", value: u.len() as f64, allowed })
            }
            Kernel::SquaredExponential => self.learn::<Dense>(bound, domain, u, targets, progress),
        }
    }

    fn learn<P: Process>(
        &self,
        bound: NoiseBound,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        progress: &mut Progress,
    ) -> Result<GpPosterior> {
        let samples = Samples::new(u, targets);
        let mut at = self.hyperparameters::<P>(bound, domain, &samples, progress)?;
        let process = P::new(domain, &samples);
        progress.reach(0.9)?;
        let fitted = loop {
            match process.fit(at, progress)? {
                Some(fitted) => break fitted,
                None if at.noise < MOST_HELP => at.noise = (10.0 * at.noise).min(MOST_HELP),
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

        let Fitted { profile, form } = fitted;
        let deviation = profile.variance.sqrt() * samples.scale;
        // What the search may leave out: that the densities are per unit of the outputs.
        let constant = if deviation > 0.0 { (TAU.sqrt() * samples.scale).ln() + 0.5 } else { 0.0 };
        let log_likelihood = profile.value() - targets.len() as f64 * constant;
        let (kernel, scale, n_outputs) = (self.kernel, samples.scale, targets.ncols());
        Ok(GpPosterior { kernel, at, form, scale, n_outputs, deviation, log_likelihood })
    }

    fn check(&self, domain: Domain) -> Result<()> {
        if let Some(value) = self.length
            && !(1e-6..=1e6).contains(&(value / domain.extent()))
        {
            let allowed = "must lie between 1e-6 and 1e6 times the extent of the clock";
            return Err(Error::Range { name: "length", value, allowed });
        }
        check_noise(self.noise)
    }

    /// Length and noise: what is given, and for the rest what makes the targets most likely.
    fn hyperparameters<P: Process>(
        &self,
        within: NoiseBound,
        domain: Domain,
        samples: &Samples,
        progress: &mut Progress,
    ) -> Result<Hyperparameters> {
        let extent = domain.extent();
        let lengths = (extent / samples.u.len() as f64, 2.0 * extent);
        if let (Some(length), Some(noise)) = (self.length, self.noise) {
            return Ok(Hyperparameters { length, noise });
        }
        if samples.targets.iter().all(|&value| value == 0.0) {
            // Nothing to learn, and nothing to learn from.
            let length = self.length.unwrap_or((lengths.0 * lengths.1).sqrt());
            return Ok(Hyperparameters { length, noise: self.noise.unwrap_or(LEAST_NOISE) });
        }
        let axis = |given: Option<f64>, (low, high): (f64, f64), points| {
            given.map_or(Axis { low: low.ln(), high: high.ln(), points }, |given| Axis::given(given.ln()))
        };
        let noises = (LEAST_NOISE, within.ratio);
        let axes = [axis(self.length, lengths, 12), axis(self.noise, noises, within.points)];
        let mean_square = || samples.targets.iter().map(|f| f * f).sum::<f64>() / samples.targets.len() as f64;
        let bound = within.share.filter(|_| self.noise.is_none()).map(|share| share * mean_square());
        let process = |most: usize| P::new(domain, &samples.thinned(most));
        let mut likelihood = Likelihood { scanned: process(SCANNED), searched: process(P::SEARCHED), bound, progress };
        let [length, noise] = maximise(&axes, &mut likelihood)?;
        // What is given comes out as it was.
        Ok(Hyperparameters {
            length: self.length.unwrap_or(length.exp()),
            noise: self.noise.unwrap_or(noise.exp().clamp(noises.0, noises.1)),
        })
    }
}

fn check_noise(noise: Option<f64>) -> Result<()> {
    match noise {
        Some(value) if !(LEAST_NOISE..=1e6).contains(&value) => {
            Err(Error::Range { name: "noise", value, allowed: "must lie between 1e-10 and 1e6" })
        }
        _ => Ok(()),
    }
}

/// ℓ and ν.
#[derive(Clone, Copy, Debug)]
struct Hyperparameters {
    length: f64,
    noise: f64,
}

/// What is regressed, divided by its largest magnitude.
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

    /// At most so many of them, evenly chosen.
    fn thinned(&self, most: usize) -> Self {
        let step = self.u.len().div_ceil(most);
        let targets = self.targets.slice(ndarray::s![..;step, ..]).to_owned();
        Self { u: self.u.iter().copied().step_by(step).collect(), scale: self.scale, targets }
    }
}

/// A way to compute with samples of a process.
trait Process {
    /// Most samples that the search climbs with.
    const SEARCHED: usize;

    fn new(domain: Domain, samples: &Samples) -> Self;

    /// How likely the samples are; nothing where rounding makes K indefinite.
    fn profile(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Profile>>;

    /// The same, and how it changes with ln ℓ and ln ν.
    fn slope(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<(Profile, Slope)>>;

    /// The process given the samples; nothing where rounding makes K indefinite.
    fn fit(&self, at: Hyperparameters, progress: &mut Progress) -> Result<Option<Fitted>>;
}

/// The likelihood of samples whose signal has its likeliest variance.
#[derive(Clone, Copy, Debug)]
struct Profile {
    /// CP.
    n_values: f64,
    /// σ̂² = Σ fᵀK⁻¹f/(CP).
    variance: f64,
    /// P·ln|K|.
    log_determinant: f64,
}

/// Derivatives with respect to (ln ℓ, ln ν).
#[derive(Clone, Copy, Debug)]
struct Slope {
    /// ½Σ αᵀdKα/σ̂², α = K⁻¹f.
    pull: [f64; 2],
    /// P/2·tr(K⁻¹dK).
    spread: [f64; 2],
}

impl Profile {
    /// −CP/2·ln σ̂² − P/2·ln|K|, the log likelihood but for a constant; nothing is said by outputs that are all zero.
    fn value(&self) -> f64 {
        if self.variance == 0.0 { 0.0 } else { -0.5 * (self.n_values * self.variance.ln() + self.log_determinant) }
    }

    fn gradient(&self, slope: &Slope) -> [f64; 2] {
        [0, 1].map(|k| if self.variance == 0.0 { 0.0 } else { slope.pull[k] - slope.spread[k] })
    }
}

/// A process given its samples.
struct Fitted {
    profile: Profile,
    form: Form,
}

/// The likelihood as a function of (ln ℓ, ln ν), less what keeps the noise within its bound.
struct Likelihood<'a, 'b, P> {
    scanned: P,
    searched: P,
    /// Largest νσ̂², if it has one.
    bound: Option<f64>,
    progress: &'a mut Progress<'b>,
}

impl<P> Likelihood<'_, '_, P> {
    /// ln(νσ̂²) above its bound.
    fn excess(&self, profile: &Profile, noise: f64) -> f64 {
        self.bound.map_or(0.0, |bound| (noise * profile.variance / bound).ln().max(0.0))
    }
}

impl<P: Process> Objective for Likelihood<'_, '_, P> {
    fn glance(&mut self, at: [f64; 2]) -> Result<f64> {
        self.progress.advance()?;
        let [length, noise] = at.map(f64::exp);
        let found = self.scanned.profile(Hyperparameters { length, noise }, self.progress)?;
        Ok(found.map_or(f64::NEG_INFINITY, |profile| {
            profile.value() - 0.25 * BARRIER * profile.n_values * self.excess(&profile, noise).powi(2)
        }))
    }

    fn score(&mut self, at: [f64; 2]) -> Result<Score> {
        self.progress.advance()?;
        let [length, noise] = at.map(f64::exp);
        let Some((profile, slope)) = self.searched.slope(Hyperparameters { length, noise }, self.progress)? else {
            return Ok(Score::IMPOSSIBLE);
        };
        // σ̂² falls where K pulls: d ln σ̂² = −2·pull/(CP).
        let (excess, weight) = (self.excess(&profile, noise), 0.5 * BARRIER * profile.n_values);
        let rise = [0, 1].map(|k| k as f64 - 2.0 * slope.pull[k] / profile.n_values);
        let gradient = profile.gradient(&slope);
        Ok(Score {
            value: profile.value() - 0.5 * weight * excess * excess,
            gradient: [0, 1].map(|k| gradient[k] - weight * excess * rise[k]),
        })
    }
}

/// Whom to ask whether to go on.
struct Progress<'a> {
    proceed: &'a mut dyn FnMut(f64) -> Result<()>,
    share: f64,
}

impl Progress<'_> {
    /// Asks, no further than before.
    fn ask(&mut self) -> Result<()> {
        (self.proceed)(self.share)
    }

    fn reach(&mut self, share: f64) -> Result<()> {
        self.share = share;
        self.ask()
    }

    /// Asks before another evaluation of the likelihood. How many there will be is open, but rarely more than 100.
    fn advance(&mut self) -> Result<()> {
        self.reach(self.share + 0.03 * (0.9 - self.share))
    }
}

#[cfg(test)]
mod tests;
