//! Regression of the basis targets over the clock (step 4 of Section 3.2): one regressor a file.

mod gp;
mod hyperparameter_search;
mod ngnet;

use std::f64::consts::TAU;
use std::fmt;

use ndarray::ArrayView2;

pub use self::gp::{Gp, GpPosterior, Kernel, NoiseBound};
pub use self::ngnet::{NGnet, NGnetRegression};
use crate::error::{Error, Result};
use crate::validate::check_positive;

/// The stretch of the clock over which the landscape is learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// [0, end], discrete movements.
    Interval {
        /// Clock at the end of the demonstrated movement.
        end: f64,
    },
    /// [0, 2π) with its ends joined, rhythmic movements.
    Circle,
}

impl Domain {
    /// Its length: `end`, or one turn.
    pub fn extent(self) -> f64 {
        match self {
            Domain::Interval { end } => end,
            Domain::Circle => TAU,
        }
    }
}

/// A fitted function of the clock with several outputs, which several threads may read.
pub trait Regression: fmt::Debug + Sync {
    /// Writes the outputs and their derivatives with respect to `u`, each (outputs,).
    fn evaluate(&self, u: f64, value: &mut [f64], slope: &mut [f64]);

    /// The same at every one of `u` (n,), each (n, outputs) by rows.
    fn evaluate_all(&self, u: &[f64], values: &mut [f64], slopes: &mut [f64]) {
        let n_outputs = values.len() / u.len().max(1);
        let rows = values.chunks_exact_mut(n_outputs.max(1)).zip(slopes.chunks_exact_mut(n_outputs.max(1)));
        for (&u, (value, slope)) in u.iter().zip(rows) {
            self.evaluate(u, value, slope);
        }
    }

    /// What was chosen, in one line.
    fn describe(&self) -> String;
}

/// Which function approximator learns the landscape.
#[derive(Clone, Debug, PartialEq)]
pub enum Basis {
    /// Gaussian process regression, the paper's choice.
    Gp(Gp),
    /// Normalised Gaussian network.
    NGnet(NGnet),
}

impl Basis {
    /// Regresses the landscape's `targets` (C, outputs) on the clock `u` (C,): a Gaussian process within
    /// [`NoiseBound::LANDSCAPE`].
    ///
    /// `proceed` is asked now and then whether to go on, with the share done in [0, 1].
    ///
    /// # Errors
    /// An ill-posed problem, or an interruption through `proceed`.
    pub fn regress(
        &self,
        domain: Domain,
        u: &[f64],
        targets: ArrayView2<f64>,
        proceed: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<Box<dyn Regression>> {
        Ok(match self {
            Basis::Gp(gp) => Box::new(gp.regress_within(NoiseBound::LANDSCAPE, domain, u, targets, proceed)?),
            Basis::NGnet(ngnet) => Box::new(ngnet.regress(domain, u, targets)?),
        })
    }
}

/// Checks what every regressor is given.
fn check(domain: Domain, u: &[f64], targets: ArrayView2<f64>) -> Result<()> {
    if u.is_empty() {
        return Err(Error::Arguments("u is empty: at least one sample is needed"));
    }
    if u.len() != targets.nrows() {
        return Err(Error::Length { name: "u", expected: targets.nrows(), found: u.len(), per: "row of targets" });
    }
    if let Some((index, &value)) = u.iter().enumerate().find(|(_, u)| !u.is_finite()) {
        return Err(Error::NotFinite { name: "u", index, value });
    }
    if u.windows(2).any(|pair| pair[1] < pair[0]) {
        return Err(Error::Arguments("u must not decrease"));
    }
    check_positive("end", domain.extent())?;
    // Targets may exceed the bound on positions, of which they hold the derivative.
    match targets.indexed_iter().find(|(_, value)| !value.is_finite()) {
        Some(((row, column), &value)) => Err(Error::NotFiniteAt { name: "targets", row, column, value }),
        None => Ok(()),
    }
}

/// Largest magnitude of the values, or 1 where all are zero.
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
    fn malformed_input_is_refused_by_every_regressor() {
        let (interval, two) = (Domain::Interval { end: 1.0 }, Array2::ones((2, 1)));
        let nan = f64::NAN;
        for basis in [Basis::Gp(Gp::default()), Basis::NGnet(NGnet::default())] {
            let error = |domain, u: &[f64], targets: &Array2<f64>| {
                basis.regress(domain, u, targets.view(), &mut |_| Ok(())).unwrap_err()
            };
            for end in [0.0, -1.0, nan, f64::INFINITY] {
                assert!(matches!(error(Domain::Interval { end }, &[0.0, 1.0], &two), Error::Range { name: "end", .. }));
            }
            assert!(matches!(error(interval, &[], &Array2::ones((0, 1))), Error::Arguments(_)));
            assert!(matches!(error(interval, &[0.0], &two), Error::Length { expected: 2, found: 1, .. }));
            assert!(matches!(error(interval, &[0.0, nan], &two), Error::NotFinite { index: 1, .. }));
            assert!(matches!(error(interval, &[1.0, 0.9], &two), Error::Arguments(_)));
            let gap = array![[1.0, 1.0], [nan, 1.0]];
            assert!(matches!(error(interval, &[0.0, 1.0], &gap), Error::NotFiniteAt { row: 1, column: 0, .. }));
        }
    }
}
