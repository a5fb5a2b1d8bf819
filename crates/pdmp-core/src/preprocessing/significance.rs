//! The least correlation of a recording with itself that chance does not explain.
//!
//! The mean A over F traits of the correlations between m samples and those a lag later is, for noise that forgets itself
//! within L samples, normal about 0 with the variance 1/N of as many independent pairs (Bartlett's formula),
//!
//! ```text
//! 1/N = 1/m Σ_{|j| ≤ L} (1 − |j|/m) 1/F² Σ_fg r_fg(j)²
//! ```
//!
//! where r_fg(j) correlates trait f with trait g j samples later, traits of weight w as √w of one: traits that move together count once, and so do samples
//! within the memory of the noise. Fisher's atanh A is normal up to large correlations. Of K independent lags the largest
//! surpasses z/√N by chance with a probability below K exp(−z²/2), which is held at [`LEVEL`].
//!
//! - M. S. Bartlett, Some aspects of the time-correlation problem in regard to tests of significance, Journal of the Royal
//!   Statistical Society 98, 1935, doi:10.2307/2342284;
//! - R. A. Fisher, Statistical methods for research workers, Oliver and Boyd 1925, section 35.

use ndarray::{ArrayView2, s};

/// Probability of finding a period in noise.
const LEVEL: f64 = 0.03;
/// Memory of noise, over the lag at which its correlation is first zero.
const MEMORY: f64 = 1.5;
/// Lags within the memory at which correlations are computed; the sum between them is the trapezium's.
const MAX_LAGS: usize = 50;
/// Samples from which correlations within the memory are estimated.
const MAX_SAMPLES: usize = 4000;

/// What chance makes of the correlations of a recording with itself.
pub(super) struct Chance {
    /// Samples of the recording.
    n: usize,
    /// Lags j > 0, how many each stands for, and the sum of squared correlations there.
    memory: Vec<(f64, f64, f64)>,
    /// The same sum without lag.
    at_once: f64,
    /// z²/F² of the largest of all lags.
    scale: f64,
}

impl Chance {
    /// Of traits (n, F), whose `agreement` after each lag first falls below what makes a lobe at lag `fallen`.
    pub(super) fn of(traits: ArrayView2<f64>, agreement: &[f64], fallen: usize) -> Self {
        let n = traits.nrows();
        let zero = agreement.iter().position(|a| *a <= 0.0).unwrap_or(agreement.len()).max(1);
        let last = ((MEMORY * zero as f64) as usize).clamp(1, n - 2);
        let step = last.div_ceil(MAX_LAGS);
        let memory = (1..=last.div_ceil(step))
            .map(|k| (k * step).min(last))
            .map(|j| (j as f64, step as f64, squares(traits, j)));
        let independent = ((agreement.len() - fallen) as f64 / (2 * fallen.max(1)) as f64).max(1.0);
        let square = 2.0 * (independent / LEVEL).ln();
        let weights = traits.iter().map(|y| y * y).sum::<f64>() / n as f64;
        Self { n, memory: memory.collect(), at_once: squares(traits, 0), scale: square / (weights * weights) }
    }

    /// The least correlation after a lag, in samples, that is not by chance.
    pub(super) fn least(&self, lag: f64) -> f64 {
        let m = self.n as f64 - lag;
        let later = self.memory.iter().map(|(j, step, square)| 2.0 * step * (1.0 - j / m).max(0.0) * square);
        (self.scale * (self.at_once + later.sum::<f64>()) / m).sqrt().tanh()
    }
}

/// Sum over all pairs of traits (n, F) of the square of their correlation after `lag` samples, by their weights.
fn squares(traits: ArrayView2<f64>, lag: usize) -> f64 {
    let n = traits.nrows();
    // Of a long recording a part in its middle stands for all.
    let used = (n - lag).min(MAX_SAMPLES);
    let from = (n - lag - used) / 2;
    let (now, later) = (traits.slice(s![from..from + used, ..]), traits.slice(s![from + lag..from + lag + used, ..]));
    let products = now.t().dot(&later) / used as f64;
    products.iter().map(|r| r * r).sum::<f64>()
}
