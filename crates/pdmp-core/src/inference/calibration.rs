//! Factors by which the bands of a recogniser are scaled, from cross-validation.

use crate::error::Result;
use crate::validate::check_range;

/// Shares of a movement that was seen at which the factors are measured.
pub(crate) const SHARES: [f64; 4] = [0.1, 0.3, 0.5, 0.7];

/// Factors at one share of a movement that was seen: the quantile of 0.9 of cross-validated errors, each divided by the
/// quantile of its Gaussian band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandFactors {
    /// Factor of the standard deviations of the positions to come.
    pub position: f64,
    /// Factor of the standard deviations of the goal or anchor.
    pub goal: f64,
    /// Factor of the standard deviation of the logarithm of the duration.
    pub duration: f64,
    /// Mean squared whitened residual that one movement in ten of the demonstrations exceeds.
    pub misfit: f64,
}

impl BandFactors {
    /// Factors of a model whose assumptions hold.
    pub const ONE: Self = Self { position: 1.0, goal: 1.0, duration: 1.0, misfit: 1.0 };

    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            position: f(self.position, other.position),
            goal: f(self.goal, other.goal),
            duration: f(self.duration, other.duration),
            misfit: f(self.misfit, other.misfit),
        }
    }
}

impl From<[f64; 4]> for BandFactors {
    /// Returns the factors in the order of the members.
    fn from([position, goal, duration, misfit]: [f64; 4]) -> Self {
        Self { position, goal, duration, misfit }
    }
}

impl From<BandFactors> for [f64; 4] {
    /// Returns the factors in the order of the members.
    fn from(BandFactors { position, goal, duration, misfit }: BandFactors) -> Self {
        [position, goal, duration, misfit]
    }
}

/// Factors at 10, 30, 50 and 70 % of a movement.
///
/// Coverage holds by exchangeability: a new movement is as likely as each held-out one to have the larger error
/// (conformal prediction; J. Lei et al., JASA 113, 2018, doi:10.1080/01621459.2017.1307116).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration(pub [BandFactors; SHARES.len()]);

impl Calibration {
    /// Calibration of a model whose assumptions hold.
    pub const NONE: Self = Self([BandFactors::ONE; SHARES.len()]);

    /// Checks that all factors are positive, and that their squares are finite.
    ///
    /// # Errors
    /// A factor is not.
    pub(crate) fn check(&self) -> Result<()> {
        let valid = |factor: f64| (1e-100..=1e100).contains(&factor);
        let allowed = "must lie between 1e-100 and 1e100";
        self.0
            .into_iter()
            .flat_map(<[f64; 4]>::from)
            .try_for_each(|factor| check_range("calibration", factor, valid(factor), allowed))
    }

    /// Returns the factors at a share, linear between the measured ones and constant beyond.
    pub(crate) fn at(&self, share: f64) -> BandFactors {
        let after = SHARES.iter().position(|&s| s >= share).unwrap_or(SHARES.len() - 1).max(1);
        let span = SHARES[after] - SHARES[after - 1];
        let weight = ((share - SHARES[after - 1]) / span).clamp(0.0, 1.0);
        self.0[after - 1].map2(self.0[after], |a, b| a + (b - a) * weight)
    }
}
