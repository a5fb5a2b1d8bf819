//! Regression of the basis targets over the clock (step 4 of Section 3.2).

mod gp;
mod hyperparameter_search;
mod ngnet;

use std::f64::consts::TAU;
use std::fmt;

use ndarray::ArrayView2;

pub use self::gp::{Gp, GpPosterior, GpPrediction, Kernel, NoiseBound};
pub use self::ngnet::{NGnet, NGnetRegression};
use crate::error::{Error, Result};
use crate::validate::{check_length, check_positive};

/// Domain of the clock on which the landscape is learnt.
///
/// ```
/// use pdmp_core::learning::regression::Domain;
///
/// assert_eq!(Domain::Interval { end: 2.0 }.extent(), 2.0);
/// assert_eq!(Domain::Circle.extent(), std::f64::consts::TAU);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// Interval [0, end] of discrete movements.
    Interval {
        /// Clock at the end of the demonstrated movement.
        end: f64,
    },
    /// Circle [0, 2π) of rhythmic movements.
    Circle,
}

impl Domain {
    /// Returns the length of the domain: `end`, or 2π.
    pub fn extent(self) -> f64 {
        match self {
            Domain::Interval { end } => end,
            Domain::Circle => TAU,
        }
    }
}

/// Fitted function of the clock with several outputs, which can be evaluated from several threads.
pub trait Regression: fmt::Debug + Sync {
    /// Writes the outputs and their derivatives with respect to `u`, each (outputs,).
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]);

    /// Writes the outputs and their derivatives at each of `u` (n,), each (n, outputs) in row-major order.
    fn evaluate_all(&self, u: &[f64], values: &mut [f64], slopes: &mut [f64]) {
        let n_outputs = values.len() / u.len().max(1);
        let rows = values.chunks_exact_mut(n_outputs.max(1)).zip(slopes.chunks_exact_mut(n_outputs.max(1)));
        for (&u, (value, slope)) in u.iter().zip(rows) {
            self.evaluate(u, value, slope);
        }
    }

    /// Returns a one-line description of the regressor and its hyperparameters.
    fn describe(&self) -> String;
}

/// Function approximator of the landscape.
///
/// ```
/// # use ndarray::Array2;
/// use pdmp_core::learning::regression::{Basis, Domain, NGnet};
///
/// let u: Vec<f64> = (0..50).map(|i| f64::from(i) / 49.0).collect();
/// let targets = Array2::from_shape_fn((50, 1), |(i, _)| (3.0 * u[i]).sin());
/// let basis = Basis::NGnet(NGnet::default());
/// let regression = basis.regress(Domain::Interval { end: 1.0 }, &u, targets.view(), &mut |_| Ok(()))?;
/// let (mut value, mut slope) = ([0.0], [0.0]);
/// regression.evaluate(0.5, &mut value, &mut slope);
/// assert!((value[0] - 1.5f64.sin()).abs() < 1e-3);
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Basis {
    /// Gaussian process regression, the paper's choice.
    Gp(Gp),
    /// Normalised Gaussian network.
    NGnet(NGnet),
}

impl Basis {
    /// Regresses the landscape's `targets` (C, outputs) on the clock `u` (C,), which must not decrease.
    ///
    /// The noise of a Gaussian process is bounded by [`NoiseBound::LANDSCAPE`]. `progress` is called periodically with
    /// the completed fraction; an error it returns cancels the regression.
    ///
    /// # Errors
    /// Settings out of range, arrays that do not match, values that are not finite, an ill-posed problem, or the error
    /// that `progress` returned.
    pub fn regress(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        progress: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Box<dyn Regression>> {
        Ok(match self {
            Basis::Gp(gp) => Box::new(gp.regress_within(NoiseBound::LANDSCAPE, domain, u, targets, progress)?),
            Basis::NGnet(ngnet) => Box::new(ngnet.regress(domain, u, targets)?),
        })
    }
}

/// Checks the arguments that all regressors share.
fn check(domain: Domain, u: &[f64], targets: ArrayView2<f64>) -> Result<()> {
    if u.is_empty() {
        return Err(Error::Argument { name: "u", problem: "is empty: at least one sample is needed" });
    }
    check_length("u", u.len(), targets.nrows(), "row of targets")?;
    if let Some((index, &value)) = u.iter().enumerate().find(|(_, u)| !u.is_finite()) {
        return Err(Error::NotFinite { name: "u", index, value });
    }
    if u.windows(2).any(|pair| pair[1] < pair[0]) {
        return Err(Error::Argument { name: "u", problem: "must not decrease" });
    }
    check_positive("end", domain.extent())?;
    // Targets may exceed the bound on positions, of which they hold the derivative.
    match targets.indexed_iter().find(|(_, value)| !value.is_finite()) {
        Some(((row, column), &value)) => Err(Error::NotFiniteAt { name: "targets", row, column, value }),
        None => Ok(()),
    }
}

/// Returns the largest magnitude of the values, or 1 where all are zero.
///
/// Divided by it, values of any magnitude can be squared and summed.
fn magnitude<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    let largest = values.into_iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    if largest > 0.0 { largest } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn every_regressor_rejects_malformed_input() {
        let (interval, two) = (Domain::Interval { end: 1.0 }, Array2::ones((2, 1)));
        let nan = f64::NAN;
        for basis in [Basis::Gp(Gp::default()), Basis::NGnet(NGnet::default())] {
            let error = |domain, u: &[f64], targets: &Array2<f64>| {
                basis.regress(domain, u, targets.view(), &mut |_| Ok(())).unwrap_err()
            };
            for end in [0.0, -1.0, nan, f64::INFINITY] {
                assert!(matches!(error(Domain::Interval { end }, &[0.0, 1.0], &two), Error::Range { name: "end", .. }));
            }
            assert!(matches!(error(interval, &[], &Array2::ones((0, 1))), Error::Argument { name: "u", .. }));
            assert!(matches!(error(interval, &[0.0], &two), Error::Length { expected: 2, found: 1, .. }));
            assert!(matches!(error(interval, &[0.0, nan], &two), Error::NotFinite { index: 1, .. }));
            assert!(matches!(error(interval, &[1.0, 0.9], &two), Error::Argument { name: "u", .. }));
            let gap = array![[1.0, 1.0], [nan, 1.0]];
            assert!(matches!(error(interval, &[0.0, 1.0], &gap), Error::NotFiniteAt { row: 1, column: 0, .. }));
        }
    }
}
