//! Regressors of the attractor landscape: options of a fit, and stand-alone regression on the clock.

use numpy::IntoPyArray;
use pdmp_core::learning::regression::{self, Domain, GpPosterior, GpPrediction, Kernel, Regression};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::choice::Choice;
use crate::convert::{Matrix, matrix, vector};
use crate::error::{ascii, raise};
use crate::scalar::{Scalar, optional_number};

/// Gaussian process regression, the paper's choice of basis functions.
///
/// All outputs share kernel, length scale and noise ratio. Hyperparameters that are not given maximise the marginal
/// likelihood (Rasmussen and Williams 2006, Section 5.4.1). `regress` searches noise ratios from 1e-10 to 1e4. In
/// `fit`, a noise ratio that is not given is at most 1e-6, and the noise variance at most 1e-6 of the targets' mean
/// square: no style can restore a signal that the landscape takes for noise, and `smoothing` removes the noise of
/// demonstrations.
///
/// Parameters
/// ----------
/// kernel : {"matern52", "matern32"}
///     Covariance function over the clock u; periodic for rhythmic movements.
/// length : float, optional
///     Length scale, in units of the clock u = t / tau; positive. Estimated if not given.
/// noise : float, optional
///     Ratio of noise variance to signal variance, from 1e-10 to 1e6. Estimated if not given.
///
/// Raises
/// ------
/// ValueError
///     `kernel` is unknown, or `length` or `noise` is out of range.
#[pyclass(frozen, name = "GP", module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct Gp(pub(crate) regression::Gp);

#[pymethods]
impl Gp {
    #[new]
    #[pyo3(
        signature = (kernel=Choice::FIRST, length=None, noise=None),
        text_signature = "(kernel='matern52', length=None, noise=None)"
    )]
    fn new(kernel: Choice<'_>, length: Option<Scalar<'_>>, noise: Option<Scalar<'_>>) -> PyResult<Self> {
        let (length, noise) = (optional_number("length", length)?, optional_number("noise", noise)?);
        let kernel =
            kernel.of("kernel", &[Kernel::Matern52, Kernel::Matern32].map(|kernel| (kernel.name(), kernel)))?;
        regression::Gp::new(kernel, length, noise).map(Self).map_err(raise)
    }

    /// Name of the covariance function.
    #[getter]
    fn kernel(&self) -> &'static str {
        self.0.kernel.name()
    }

    /// Length scale in units of the clock; None if it is estimated.
    #[getter]
    fn length(&self) -> Option<f64> {
        self.0.length
    }

    /// Ratio of noise variance to signal variance; None if it is estimated.
    #[getter]
    fn noise(&self) -> Option<f64> {
        self.0.noise
    }

    /// Conditions the process on targets over the clock.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (C,)
    ///     Increasing clock values, from 0; in rad and within [0, 2π) if periodic.
    /// targets : array_like, (C, P)
    ///     Values of the P outputs, in any unit.
    /// periodic : bool
    ///     Identify u = 2π with u = 0.
    ///
    /// Returns
    /// -------
    /// GPRegression
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `u` does not increase from 0, lengths differ, or a number is not finite.
    #[pyo3(
        signature = (u, targets, *, periodic=Choice::FIRST),
        text_signature = "($self, u, targets, *, periodic=False)"
    )]
    fn regress(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        targets: &Bound<'_, PyAny>,
        periodic: Choice<'_>,
    ) -> PyResult<GpRegression> {
        let periodic = periodic.flag("periodic")?;
        let (u, targets) = (vector("u", u)?, matrix("targets", "(C, P)", targets)?);
        let gp = &self.0;
        let posterior = py.detach(|| gp.regress(domain(&u, periodic), &u, targets.view(), &mut |_| Ok(())));
        posterior.map(GpRegression).map_err(raise)
    }

    fn __getnewargs__(&self) -> (&'static str, Option<f64>, Option<f64>) {
        (self.kernel(), self.length(), self.noise())
    }

    fn __repr__(&self) -> String {
        let number = |value: Option<f64>| value.map_or("None".to_string(), |value| value.to_string());
        format!("pdmp.GP({:?}, length={}, noise={})", self.kernel(), number(self.length()), number(self.noise()))
    }
}

/// Gaussian process conditioned on data: f(u) ~ N(0, σ̂²K) for each of P outputs, with K = k(u, u′) + νI.
///
/// Returned by `GP.regress`.
#[pyclass(frozen, name = "GPRegression", module = "pdmp")]
pub(crate) struct GpRegression(GpPosterior);

#[pymethods]
impl GpRegression {
    /// Name of the covariance function.
    #[getter]
    fn kernel(&self) -> &'static str {
        self.0.kernel().name()
    }

    /// Length scale in units of the clock, as given or estimated.
    #[getter]
    fn length(&self) -> f64 {
        self.0.length()
    }

    /// Ratio ν of noise variance to signal variance, as given or estimated.
    #[getter]
    fn noise(&self) -> f64 {
        self.0.noise()
    }

    /// Maximum-likelihood signal variance σ̂² = Σ fᵀK⁻¹f/(CP), in the squared unit of the outputs.
    ///
    /// All outputs share it. The noise variance is `noise * signal_variance`.
    #[getter]
    fn signal_variance(&self) -> f64 {
        self.0.signal_variance()
    }

    /// Log marginal likelihood of the data, −CP/2·(ln 2πσ̂² + 1) − P/2·ln|K|, summed over the outputs.
    ///
    /// Densities are in the unit of the outputs. It is 0 if all outputs are zero.
    #[getter]
    fn log_likelihood(&self) -> f64 {
        self.0.log_likelihood()
    }

    /// Computes the posterior mean and variance of the outputs without noise.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock values.
    ///
    /// Returns
    /// -------
    /// mean : ndarray, (n, P)
    ///     In the unit of the outputs.
    /// variance : ndarray, (n, P)
    ///     σ̂²(1 − kᵀK⁻¹k), equal for all outputs, in their squared unit.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A clock value is not finite.
    fn predict<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let u = clock(u)?;
        let GpPrediction { mean, variance } = self.0.predict(&u);
        Ok((mean.into_pyarray(py), variance.into_pyarray(py)))
    }

    fn __repr__(&self) -> String {
        ascii(&format!("<pdmp.GPRegression: {}>", self.0.describe()))
    }
}

/// Normalised Gaussian network, a weighted mean of radial basis functions over the clock.
///
/// b(u) = Σ wₖψₖ(u) / Σ ψₖ(u) with ψₖ = exp(−(u − cₖ)²/2s²), or ψₖ = exp((cos(u − cₖ) − 1)/s²) for rhythmic movements.
/// The centres cₖ have equal distances h and extend up to 2h beyond the ends of discrete movements; s = overlap·h.
///
/// Parameters
/// ----------
/// n_basis : int
///     Number N of basis functions, from 2 to 1000.
/// overlap : float
///     Width s of a basis function in units of the spacing h, from 0.3 to 3. Narrow functions ripple between their
///     centres; wide functions are nearly linearly dependent.
///
/// Raises
/// ------
/// ValueError
///     `n_basis` or `overlap` is out of range.
///
/// References
/// ----------
/// Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, Neural Computation 25 (2013), https://doi.org/10.1162/NECO_a_00393
#[pyclass(frozen, module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct NGnet(pub(crate) regression::NGnet);

#[pymethods]
impl NGnet {
    #[new]
    #[pyo3(
        signature = (
            n_basis=Scalar::Count(regression::NGnet::default().n_basis),
            overlap=Scalar::Number(regression::NGnet::default().overlap)
        ),
        text_signature = "(n_basis=50, overlap=1.2)"
    )]
    fn new(n_basis: Scalar<'_>, overlap: Scalar<'_>) -> PyResult<Self> {
        regression::NGnet::new(n_basis.count("n_basis")?, overlap.number("overlap")?).map(Self).map_err(raise)
    }

    /// Number N of basis functions.
    #[getter]
    fn n_basis(&self) -> usize {
        self.0.n_basis
    }

    /// Width of a basis function in units of the centre spacing.
    #[getter]
    fn overlap(&self) -> f64 {
        self.0.overlap
    }

    /// Fits the network to targets over the clock by least squares.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (C,)
    ///     Increasing clock values, from 0; in rad and within [0, 2π) if periodic.
    /// targets : array_like, (C, P)
    ///     Values of the P outputs, in any unit.
    /// periodic : bool
    ///     Identify u = 2π with u = 0.
    ///
    /// Returns
    /// -------
    /// NGnetRegression
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `u` does not increase from 0, lengths differ, or a number is not finite.
    #[pyo3(
        signature = (u, targets, *, periodic=Choice::FIRST),
        text_signature = "($self, u, targets, *, periodic=False)"
    )]
    fn regress(
        &self,
        u: &Bound<'_, PyAny>,
        targets: &Bound<'_, PyAny>,
        periodic: Choice<'_>,
    ) -> PyResult<NGnetRegression> {
        let periodic = periodic.flag("periodic")?;
        let (u, targets) = (vector("u", u)?, matrix("targets", "(C, P)", targets)?);
        let n_outputs = targets.ncols();
        let regression = self.0.regress(domain(&u, periodic), &u, targets.view()).map_err(raise)?;
        Ok(NGnetRegression { regression, n_outputs })
    }

    fn __getnewargs__(&self) -> (usize, f64) {
        (self.0.n_basis, self.0.overlap)
    }

    fn __repr__(&self) -> String {
        format!("pdmp.NGnet({}, overlap={})", self.0.n_basis, self.0.overlap)
    }
}

/// Normalised Gaussian network fitted to data, returned by `NGnet.regress`.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct NGnetRegression {
    regression: regression::NGnetRegression,
    n_outputs: usize,
}

#[pymethods]
impl NGnetRegression {
    /// Computes the outputs.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (n,)
    ///     Clock values.
    ///
    /// Returns
    /// -------
    /// mean : ndarray, (n, P)
    ///     In the unit of the outputs.
    /// variance : None
    ///     The network has no variance; `GPRegression.predict` returns one in this place.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A clock value is not finite.
    fn predict<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<(Matrix<'py>, Option<Matrix<'py>>)> {
        let u = clock(u)?;
        let mut values = ndarray::Array2::zeros((u.len(), self.n_outputs));
        let (mut value, mut slope) = (vec![0.0; self.n_outputs], vec![0.0; self.n_outputs]);
        for (&u, mut row) in u.iter().zip(values.rows_mut()) {
            self.regression.evaluate(u, &mut value, &mut slope);
            row.assign(&ndarray::aview1(&value));
        }
        Ok((values.into_pyarray(py), None))
    }
}

/// Converts clock values, which must be finite.
fn clock(u: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let u = vector("u", u)?;
    match u.iter().position(|u| !u.is_finite()) {
        Some(index) => Err(PyValueError::new_err(format!("u[{index}] = {}: every number must be finite", u[index]))),
        None => Ok(u),
    }
}

/// Returns the domain of the inputs, unchecked: the regressors check them.
fn domain(u: &[f64], periodic: bool) -> Domain {
    if periodic { Domain::Circle } else { Domain::Interval { end: u.last().copied().unwrap_or(0.0) } }
}
