//! Significance threshold of the autocorrelation of a recording.
//!
//! A(k) is the mean over F traits of the correlations between m samples and those k samples later. For noise with a memory
//! of L samples it is normal about 0 with the variance 1/N of N independent pairs (Bartlett's formula),
//!
//! ```text
//! 1/N = 1/m Σ_{|j| ≤ L} (1 − |j|/m) 1/F² Σ_fg r_fg(j)²
//! ```
//!
//! where r_fg(j) is the correlation of trait f with trait g j samples later, and a trait of weight w enters as √w of one.
//! Traits that move together thus count once, and so do samples within the memory of the noise. Fisher's atanh A is normal
//! up to large correlations. The largest of K independent lags exceeds z/√N by chance with a probability below
//! K exp(−z²/2), which is set to [`LEVEL`].
//!
//! - M. S. Bartlett, Some aspects of the time-correlation problem in regard to tests of significance, Journal of the Royal
//!   Statistical Society 98, 1935, doi:10.2307/2342284;
//! - R. A. Fisher, Statistical methods for research workers, Oliver and Boyd 1925, section 35.

use ndarray::{ArrayView2, s};

/// Significance level: the probability of detecting a period in noise.
const LEVEL: f64 = 0.03;
/// Memory L of noise, relative to the first zero of the autocorrelation.
const MEMORY: f64 = 1.5;
/// Most lags within the memory at which correlations are computed; the sum over all lags is that of the trapezoidal rule.
const MAX_LAGS: usize = 50;
/// Most samples from which correlations within the memory are estimated.
const MAX_SAMPLES: usize = 4000;

/// Significance threshold of the autocorrelation at each lag.
pub(super) struct SignificanceThreshold {
    /// Number of samples n.
    n_samples: usize,
    /// Correlations at lags j > 0 within the memory.
    memory: Vec<LaggedCorrelation>,
    /// Σ_fg r_fg(0)², with weights.
    without_lag: f64,
    /// z²/F², with weights.
    scale: f64,
}

/// Correlation of the traits at one lag.
struct LaggedCorrelation {
    /// Lag j in samples.
    lag: f64,
    /// Number of lags that this one represents.
    step: f64,
    /// Σ_fg r_fg(j)², with weights.
    squares: f64,
}

impl SignificanceThreshold {
    /// Estimates the threshold from traits (n, F) and their autocorrelation, whose central lobe ends at lag `lobe_end`.
    pub(super) fn new(traits: ArrayView2<f64>, autocorrelation: &[f64], lobe_end: usize) -> Self {
        let n_samples = traits.nrows();
        let zero = autocorrelation.iter().position(|a| *a <= 0.0).unwrap_or(autocorrelation.len()).max(1);
        let last = ((MEMORY * zero as f64) as usize).clamp(1, n_samples - 2);
        let step = last.div_ceil(MAX_LAGS);
        let memory = (1..=last.div_ceil(step)).map(|k| (k * step).min(last)).map(|lag| LaggedCorrelation {
            lag: lag as f64,
            step: step as f64,
            squares: squared_correlations(traits, lag),
        });
        let n_independent = ((autocorrelation.len() - lobe_end) as f64 / (2 * lobe_end.max(1)) as f64).max(1.0);
        let z_squared = 2.0 * (n_independent / LEVEL).ln();
        let weights = traits.iter().map(|y| y * y).sum::<f64>() / n_samples as f64;
        Self {
            n_samples,
            memory: memory.collect(),
            without_lag: squared_correlations(traits, 0),
            scale: z_squared / (weights * weights),
        }
    }

    /// Returns the least significant correlation at a lag in samples.
    pub(super) fn at(&self, lag: f64) -> f64 {
        let m = self.n_samples as f64 - lag;
        let terms = self.memory.iter().map(|j| 2.0 * j.step * (1.0 - j.lag / m).max(0.0) * j.squares);
        (self.scale * (self.without_lag + terms.sum::<f64>()) / m).sqrt().tanh()
    }
}

/// Computes Σ_fg r_fg(lag)² over all pairs of traits (n, F), with weights.
fn squared_correlations(traits: ArrayView2<f64>, lag: usize) -> f64 {
    let n = traits.nrows();
    // The middle of a long recording represents it.
    let used = (n - lag).min(MAX_SAMPLES);
    let from = (n - lag - used) / 2;
    let (now, later) = (traits.slice(s![from..from + used, ..]), traits.slice(s![from + lag..from + lag + used, ..]));
    let products = now.t().dot(&later) / used as f64;
    products.iter().map(|r| r * r).sum::<f64>()
}
