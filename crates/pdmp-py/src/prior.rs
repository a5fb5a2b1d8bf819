//! Prior distributions of the parameters of a movement.

use pdmp_core::inference::{BandFactors, Calibration, Mixture, Settings};
use pdmp_core::learning::learn_prior;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods, PyTuple};

use crate::convert::{FilePath, Matrix, Reduced, Vector, items, locked, matrix, quoted, read_only, threads, vector};
use crate::error::raise;
use crate::fit::demonstrations;
use crate::model::Model;
use crate::scalar::Scalar;

/// Prior distribution of style, goal, start or anchor, and duration of a movement, returned by `Model.prior`.
///
/// A mixture of Gaussian kernels, one on each of the M demonstrations, of covariance c²Σ about centres drawn towards the
/// mean, so that the mixture keeps mean and covariance of the demonstrations::
///
///     p(θ, log T) = 1/M Σₘ N(μ + √(1−c²)(θₘ − μ), c²Σ)
///
/// The prior of a model with contexts has a form for a given context h too, in which the kernels are on the prediction θ(h)
/// plus the deviation of each demonstration from the prediction by the others, θ'ₘ = θ(h) + θₘ − θ₋ₘ(hₘ). Settings and
/// bands of both forms are learnt apart; the attributes are those of the form without a context.
///
/// Priors are immutable and can be pickled. `Model.save` keeps a prior in the file of its model.
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct Prior(pub(crate) pdmp_core::inference::Prior);

#[pymethods]
impl Prior {
    /// Rebuilds a pickled prior.
    #[staticmethod]
    #[pyo3(signature = (rhythmic, mixture, residual, deviations, demonstrated=None))]
    fn _of(
        rhythmic: bool,
        mixture: &Bound<'_, PyAny>,
        residual: &Bound<'_, PyAny>,
        deviations: Option<&Bound<'_, PyAny>>,
        demonstrated: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let kind = if rhythmic { pdmp_core::Kind::Rhythmic } else { pdmp_core::Kind::Discrete };
        let residual = vector("residual", residual)?;
        let mut prior = pdmp_core::inference::Prior::new(kind, unpickled(mixture)?, residual).map_err(raise)?;
        if let Some(demonstrated) = demonstrated {
            prior = prior.with_demonstrated(matrix("demonstrated", "(M, K + 1)", demonstrated)?).map_err(raise)?;
        }
        match deviations {
            Some(deviations) => prior.with_deviations(unpickled(deviations)?).map(Self).map_err(raise),
            None => Ok(Self(prior)),
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let prior = &self.0;
        let deviations = prior.deviations().map(|deviations| pickled(py, deviations)).transpose()?;
        let rhythmic = prior.kind() == pdmp_core::Kind::Rhythmic;
        let demonstrated = prior.demonstrated().map(|demonstrated| numpy::PyArray2::from_array(py, &demonstrated));
        let arguments = (rhythmic, pickled(py, prior.mixture())?, self.residual(py), deviations, demonstrated);
        Ok((py.get_type::<Self>().getattr("_of")?, arguments.into_pyobject(py)?))
    }

    /// Reads the prior that `Model.save` has written into the file of its model.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///     A model file; `pdmp.load` reads the model from it.
    ///
    /// Returns
    /// -------
    /// Prior
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ModelFileError
    ///     The file is damaged, not a model, without a prior, or of another version.
    ///
    /// Examples
    /// --------
    /// >>> import tempfile, pathlib
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
    /// >>> model.save(path, prior=model.prior(demos))
    /// >>> recogniser = pdmp.load(path).recogniser(pdmp.Prior.load(path))
    #[staticmethod]
    fn load(py: Python<'_>, path: FilePath) -> PyResult<Self> {
        py.detach(|| pdmp_core::inference::Prior::load(&path.0)).map(Self).map_err(raise)
    }

    /// Reads the prior from the contents of a model file.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    ///     Result of `Model.to_bytes` with a prior, or the contents of a file.
    ///
    /// Returns
    /// -------
    /// Prior
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     The data are damaged, not a model, without a prior, or of another version.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| pdmp_core::inference::Prior::from_bytes(data)).map(Self).map_err(raise)
    }

    /// Parameters (M, K) of the demonstrations: style, goal and start, or style and anchor, in degrees of freedom.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(numpy::PyArray2::from_owned_array(py, self.0.parameters().to_owned()))
    }

    /// Standard deviations (D,) of the movements from those of the model.
    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, self.0.residual())
    }

    /// Bandwidth c of the kernels, relative to the deviations of the demonstrations, in (0, 1].
    #[getter]
    fn bandwidth(&self) -> f64 {
        self.0.settings().bandwidth
    }

    /// Exponent of the likelihood, in (0, 1]: it limits the confidence in a model that is not exact.
    #[getter]
    fn tempering(&self) -> f64 {
        self.0.settings().tempering
    }

    /// Correlation time of the residual in s.
    #[getter]
    fn correlation_time(&self) -> f64 {
        self.0.settings().correlation_time
    }

    fn __repr__(&self) -> String {
        let Settings { bandwidth, tempering, correlation_time } = self.0.settings();
        let n = self.0.n_demos();
        format!(
            "<pdmp.Prior: {n} demonstrations, bandwidth {bandwidth}, tempering {tempering}, correlation time {correlation_time:.4} s>"
        )
    }
}

/// Returns the parts of a mixture in a pickled prior.
fn pickled<'py>(py: Python<'py>, mixture: &Mixture) -> PyResult<Bound<'py, PyTuple>> {
    let Settings { bandwidth, tempering, correlation_time } = mixture.settings;
    let factors = mixture.calibration.0.map(<[f64; 4]>::from);
    let parameters = numpy::PyArray2::from_array(py, &mixture.parameters);
    let logs = read_only(py, &mixture.log_durations);
    (parameters, logs, [bandwidth, tempering, correlation_time], factors).into_pyobject(py)
}

/// Returns the mixture of parts.
fn unpickled(parts: &Bound<'_, PyAny>) -> PyResult<Mixture> {
    let (parameters, logs, settings, factors): (Bound<'_, PyAny>, Bound<'_, PyAny>, [f64; 3], [[f64; 4]; 4]) =
        parts.extract()?;
    let [bandwidth, tempering, correlation_time] = settings;
    Ok(Mixture {
        parameters: matrix("parameters", "(M, K)", &parameters)?,
        log_durations: vector("log_durations", &logs)?,
        settings: Settings { bandwidth, tempering, correlation_time },
        calibration: Calibration(factors.map(BandFactors::from)),
    })
}

#[pymethods]
impl Model {
    /// Learns the prior of style, goal, start or anchor, and duration from the demonstrations of the fit.
    ///
    /// Recognition of held-out demonstrations is simulated: up to ten folds are held out in turn, the model is fitted again
    /// without each, and the rest of the held-out movements is predicted after 10, 30, 50 and 70 % of them. Bandwidth,
    /// exponent of the likelihood and correlation time of the residual are those with the smallest error; the bands are
    /// scaled to hold 90 % of the errors. With contexts, recognition in a given context is simulated as well.
    ///
    /// Parameters
    /// ----------
    /// demonstrations : list of Demonstration
    ///     The M demonstrations, in the order of the fit.
    /// groups : list of str or int, (M,), optional
    ///     Person, session or object of each demonstration. A group at a time is held out: the prior is one for new groups.
    ///     By default it is one for those demonstrated.
    /// threads : int, optional
    ///     Largest number of threads; by default all.
    ///
    /// Returns
    /// -------
    /// Prior
    ///     Prior of `recogniser`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     Other demonstrations than those of the fit, fewer than four, a single group, or a model with a time warp.
    /// TypeError
    ///     An argument has another type.
    ///
    /// Examples
    /// --------
    /// >>> prior = model.prior(demos)
    /// >>> len(prior.parameters) == len(demos)
    /// True
    ///
    /// References
    /// ----------
    /// West, Journal of the Royal Statistical Society B 55 (1993) 409-422 (the shrunken kernels).
    /// Lei, G'Sell, Rinaldo, Tibshirani, Wasserman, JASA 113 (2018), doi:10.1080/01621459.2017.1307116 (the bands).
    #[pyo3(signature = (demonstrations, *, groups=None, threads=None))]
    fn prior(
        &self,
        py: Python<'_>,
        demonstrations: &Bound<'_, PyAny>,
        groups: Option<&Bound<'_, PyAny>>,
        threads: Option<Scalar<'_>>,
    ) -> PyResult<Prior> {
        let demos = self::demonstrations("demonstrations", demonstrations)?;
        let groups = groups.map(group_indices).transpose()?;
        let threads = self::threads(threads)?;
        py.detach(|| learn_prior(&self.0, &demos, groups.as_deref(), threads)).map(Prior).map_err(raise)
    }
}

/// Returns the index of the first equal name for each name of a group.
fn group_indices(names: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    let indices = PyDict::new(names.py());
    items("groups", names, |name, item| {
        let wrong = |_| PyTypeError::new_err(format!("{name} = {}: expected a text or a whole number", quoted(item)));
        match indices.get_item(item).map_err(wrong)? {
            Some(index) => index.extract(),
            None => {
                indices.set_item(item, indices.len())?;
                Ok(indices.len() - 1)
            }
        }
    })
}
