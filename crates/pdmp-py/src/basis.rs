//! The regressors of the landscape: choices for a fit, and functions to try by themselves.

use numpy::IntoPyArray;
use pdmp_core::learning::regression::{self, Domain, GpPosterior, Kernel, Regression};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::convert::{Matrix, count, matrix, vector};
use crate::error::{ascii, raise};

/// Gaussian process regression, the paper's choice of basis functions.
///
/// All outputs share kernel, length and noise ratio. What is not given is found by maximising the marginal likelihood
/// (Rasmussen and Williams 2006, Section 5.4.1): `regress` by itself searches noise ratios from 1e-10 to 1e4. As a basis
/// of `fit`, noise that is not given is at most 1e-6 of the signal's variance and of the targets' mean square: what the
/// landscape takes for noise no style brings back, and noise on demonstrations is what smoothing is for.
///
/// Parameters
/// ----------
/// kernel : {"matern52", "matern32"}
///     Covariance function of the clock; wrapped around the circle where the movement is rhythmic.
/// length : float, optional
///     Length scale, in units of the clock u = t / tau.
/// noise : float, optional
///     Ratio of noise variance to signal variance, at least 1e-10.
///
/// Raises
/// ------
/// ValueError
///     An unknown kernel, or a number out of range.
#[pyclass(frozen, name = "GP", module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct Gp(pub(crate) regression::Gp);

#[pymethods]
impl Gp {
    #[new]
    #[pyo3(signature = (kernel="matern52", length=None, noise=None))]
    fn new(kernel: &str, length: Option<f64>, noise: Option<f64>) -> PyResult<Self> {
        let kernel = Kernel::from_name(kernel).ok_or_else(|| {
            PyValueError::new_err(format!("kernel = {kernel:?}: must be \"matern32\" or \"matern52\""))
        })?;
        regression::Gp::new(kernel, length, noise).map(Self).map_err(raise)
    }

    /// Name of the covariance function.
    #[getter]
    fn kernel(&self) -> &'static str {
        self.0.kernel.name()
    }

    /// Length scale, if one was given.
    #[getter]
    fn length(&self) -> Option<f64> {
        self.0.length
    }

    /// Noise ratio, if one was given.
    #[getter]
    fn noise(&self) -> Option<f64> {
        self.0.noise
    }

    /// Regress targets on the clock.
    ///
    /// Parameters
    /// ----------
    /// u : array_like, (C,)
    ///     Increasing inputs from 0; within [0, 2π) if periodic.
    /// targets : array_like, (C, P)
    ///     Outputs.
    /// periodic : bool
    ///     Whether 2π and 0 are one.
    ///
    /// Returns
    /// -------
    /// GPRegression
    #[pyo3(signature = (u, targets, *, periodic=false))]
    fn regress(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        targets: &Bound<'_, PyAny>,
        periodic: bool,
    ) -> PyResult<GpRegression> {
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

/// A Gaussian process given data, f(u) ~ N(0, σ̂²K) for each of P outputs, with K = k(u, u′) + νI.
#[pyclass(frozen, name = "GPRegression", module = "pdmp")]
pub(crate) struct GpRegression(GpPosterior);

#[pymethods]
impl GpRegression {
    /// Name of the covariance function.
    #[getter]
    fn kernel(&self) -> &'static str {
        self.0.kernel().name()
    }

    /// Length scale that was used, in units of the clock.
    #[getter]
    fn length(&self) -> f64 {
        self.0.length()
    }

    /// Ratio ν of noise to signal variance that was used.
    #[getter]
    fn noise(&self) -> f64 {
        self.0.noise()
    }

    /// Signal variance σ̂² = Σ fᵀK⁻¹f/(CP), its likeliest value, in the squared unit of the outputs.
    ///
    /// All outputs share it. The variance of the noise is noise * signal_variance.
    #[getter]
    fn signal_variance(&self) -> f64 {
        self.0.signal_variance()
    }

    /// Log marginal likelihood of the data, −CP/2·(ln 2πσ̂² + 1) − P/2·ln|K|, summed over the outputs.
    ///
    /// Of densities in the unit of the outputs; 0 where all of them are zero.
    #[getter]
    fn log_likelihood(&self) -> f64 {
        self.0.log_likelihood()
    }

    /// Mean and variance (n, P) of the outputs, without their noise, at u (n,).
    ///
    /// The variance, σ̂²(1 − kᵀK⁻¹k), is the same for all outputs.
    fn predict<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let u = clock(u)?;
        let (mean, variance) = self.0.predict(&u);
        Ok((mean.into_pyarray(py), variance.into_pyarray(py)))
    }

    fn __repr__(&self) -> String {
        ascii(&format!("<pdmp.GPRegression: {}>", self.0.describe()))
    }
}

/// Normalised Gaussian network: weighted bell functions on the clock, over their sum.
///
/// b(u) = Σ wₖψₖ(u) / Σ ψₖ(u) with ψₖ = exp(−(u − cₖ)²/2s²), or exp((cos(u − cₖ) − 1)/s²) where the movement is
/// rhythmic. The centres cₖ lie at equal distances h, for discrete movements up to 2h beyond the ends, and
/// s = overlap·h.
///
/// Parameters
/// ----------
/// n_basis : int
///     Number of functions N, from 2 to 1000.
/// overlap : float
///     Width s of a function in centre spacings h, from 0.3 to 3. Narrow functions ripple between their centres, wide
///     ones are nearly dependent.
///
/// Raises
/// ------
/// ValueError
///     A number out of range.
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
        signature = (n_basis=regression::NGnet::default().n_basis as isize, overlap=regression::NGnet::default().overlap),
        text_signature = "(n_basis=50, overlap=1.2)"
    )]
    fn new(n_basis: isize, overlap: f64) -> PyResult<Self> {
        regression::NGnet::new(count("n_basis", n_basis)?, overlap).map(Self).map_err(raise)
    }

    /// Number of functions N.
    #[getter]
    fn n_basis(&self) -> usize {
        self.0.n_basis
    }

    /// Width of a function in centre spacings.
    #[getter]
    fn overlap(&self) -> f64 {
        self.0.overlap
    }

    /// Regress targets (C, P) on the clock u (C,), from 0; within [0, 2π) if periodic.
    #[pyo3(signature = (u, targets, *, periodic=false))]
    fn regress(&self, u: &Bound<'_, PyAny>, targets: &Bound<'_, PyAny>, periodic: bool) -> PyResult<NGnetRegression> {
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

/// A normalised Gaussian network given data.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct NGnetRegression {
    regression: regression::NGnetRegression,
    n_outputs: usize,
}

#[pymethods]
impl NGnetRegression {
    /// The outputs (n, P) at u (n,), and None: the network knows no variance.
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

/// Finite clock values.
fn clock(u: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let u = vector("u", u)?;
    match u.iter().position(|u| !u.is_finite()) {
        Some(index) => Err(PyValueError::new_err(format!("u[{index}] = {}: every number must be finite", u[index]))),
        None => Ok(u),
    }
}

/// The stretch of the clock that the inputs cover; the regressors check the inputs themselves.
fn domain(u: &[f64], periodic: bool) -> Domain {
    if periodic { Domain::Circle } else { Domain::Interval { end: u.last().copied().unwrap_or(0.0) } }
}
