//! Partial fits of blocks of demonstrations.

use std::sync::{Mutex, MutexGuard, PoisonError};

use pdmp_core::FitOptions;
use pdmp_core::learning::Stage;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::blocks::Blocks;
use crate::choice::Choice;
use crate::convert::{FilePath, Reduced};
use crate::error::{detached, raise};
use crate::factorised_fit::{FactorisedFit, StagedProgress};
use crate::fit::{KINDS, SmoothingArgument, basis_of, canonical_of, demonstrations, dof_scale_of, map_of, n_styles_of};
use crate::model::Model;
use crate::scalar::{Scalar, optional_count, optional_number};

/// Partial fit of a growing collection of demonstrations, which blocks and other partial fits are added to.
///
/// Its size is that of a factor R with RᵀR = FᵀF for the targets F (M, C·D) of the demonstrations, with a row for each of the
/// dimensions in which they vary, and of a few numbers for each demonstration. The order in which parts are merged matters to rounding only. `finish` reads the blocks
/// once more, for their styles.
///
/// Parameters
/// ----------
/// demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
///     First block. Number of samples, cut-offs of smoothing and, with `tau`, the nominal duration are chosen from it,
///     and hold for all others.
/// kind, dt, period, smoothing, n_samples, dof_scale, tau, alpha_z, beta_z, alpha_x, mu, threads
///     As for `fit`; `period` is one number.
///
/// Raises
/// ------
/// ValueError
///     The demonstrations or options are invalid, or have rotations.
///
/// References
/// ----------
/// Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206–A239, https://doi.org/10.1137/080731992
///
/// Examples
/// --------
/// >>> s = np.linspace(0.0, 1.0, 161)
/// >>> def reach(height):
/// ...     return np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), height * np.sin(np.pi * s) ** 2])
/// >>> blocks = [[reach(0.1), reach(0.2)], [reach(0.3)]]
/// >>> partial = pdmp.PartialFit(blocks[0], dt=0.01)
/// >>> other = partial.empty()
/// >>> other.update(blocks[1])
/// >>> partial.merge(other)
/// >>> partial.n_demos
/// 3
/// >>> whole = pdmp.fit([demo for block in blocks for demo in block], dt=0.01)
/// >>> np.allclose(partial.finish(blocks).styles, whole.styles, rtol=0.0, atol=1e-10)
/// True
#[pyclass(frozen, module = "pdmp")]
pub(crate) struct PartialFit(Mutex<pdmp_core::learning::PartialFit>);

impl PartialFit {
    fn locked(&self) -> MutexGuard<'_, pdmp_core::learning::PartialFit> {
        // A panic cannot occur within an update; its state is consistent in any case.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl PartialFit {
    #[new]
    #[pyo3(
        signature = (
            demos, *, kind=Choice::FIRST, dt=None, period=None, smoothing=SmoothingArgument(pdmp_core::numerics::Smoothing::Auto),
            n_samples=None, dof_scale=None, tau=None, alpha_z=Scalar::Number(25.0), beta_z=None, alpha_x=None, mu=None,
            threads=None
        ),
        text_signature = "(demos, *, kind='discrete', dt=None, period=None, smoothing='auto', n_samples=None, \
                          dof_scale=None, tau=None, alpha_z=25.0, beta_z=None, alpha_x=None, mu=None, threads=None)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        demos: &Bound<'_, PyAny>,
        kind: Choice<'_>,
        dt: Option<Scalar<'_>>,
        period: Option<&Bound<'_, PyAny>>,
        smoothing: SmoothingArgument,
        n_samples: Option<Scalar<'_>>,
        dof_scale: Option<&Bound<'_, PyAny>>,
        tau: Option<Scalar<'_>>,
        alpha_z: Scalar<'_>,
        beta_z: Option<Scalar<'_>>,
        alpha_x: Option<Scalar<'_>>,
        mu: Option<Scalar<'_>>,
        threads: Option<Scalar<'_>>,
    ) -> PyResult<Self> {
        let block = demonstrations("demos", demos)?;
        let discrete = (optional_number("tau", tau)?, optional_number("alpha_x", alpha_x)?, None);
        let rhythmic = (optional_number("mu", mu)?, period);
        let mut options = FitOptions::new(canonical_of(kind.of("kind", &KINDS)?, discrete, rhythmic)?);
        options.dt = optional_number("dt", dt)?;
        options.smoothing = smoothing.0;
        options.n_samples = optional_count("n_samples", n_samples)?;
        options.dof_scale = dof_scale_of(dof_scale)?;
        options.alpha_z = alpha_z.number("alpha_z")?;
        options.beta_z = optional_number("beta_z", beta_z)?;
        options.threads = crate::convert::threads(threads)?;
        let started = py.detach(|| {
            let mut partial = pdmp_core::learning::PartialFit::new(&block, &options)?;
            partial.update(&block).map(|()| partial)
        });
        started.map(|partial| Self(Mutex::new(partial))).map_err(raise)
    }

    /// Number of demonstrations M so far.
    #[getter]
    fn n_demos(&self, py: Python<'_>) -> usize {
        py.detach(|| self.locked().n_demos())
    }

    /// Number of degrees of freedom D.
    #[getter]
    fn n_dofs(&self, py: Python<'_>) -> usize {
        py.detach(|| self.locked().n_dofs())
    }

    /// Number of samples C of the aligned demonstrations.
    #[getter]
    fn n_samples(&self, py: Python<'_>) -> usize {
        py.detach(|| self.locked().n_samples())
    }

    /// Kind of the movements, "discrete" or "rhythmic".
    #[getter]
    fn kind(&self, py: Python<'_>) -> &'static str {
        py.detach(|| self.locked().kind().name())
    }

    /// Returns a partial fit of no demonstration with the same settings, for blocks that are added elsewhere.
    fn empty(&self, py: Python<'_>) -> Self {
        py.detach(|| Self(Mutex::new(self.locked().empty())))
    }

    /// Adds a block of demonstrations.
    ///
    /// Parameters
    /// ----------
    /// demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
    ///     Further demonstrations of the skill.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The demonstrations are invalid or do not match the others; none is added then.
    fn update(&self, py: Python<'_>, demos: &Bound<'_, PyAny>) -> PyResult<()> {
        let block = demonstrations("demos", demos)?;
        let report = |_: Python<'_>, (), _: f64| Ok(());
        detached(py, report, |progress| self.locked().update_with(&block, &mut |share| progress((), share)))
    }

    /// Adds the demonstrations of another partial fit after those of this one.
    ///
    /// Parameters
    /// ----------
    /// other : PartialFit
    ///     Made with `empty` of this one or of a common one.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `other` has other settings, or is this partial fit.
    fn merge(&self, py: Python<'_>, other: &Self) -> PyResult<()> {
        if std::ptr::eq(self, other) {
            let text =
                "other is this partial fit: its demonstrations would count twice; make one with `empty` for others";
            return Err(PyValueError::new_err(text));
        }
        // The other one is copied first: two locks could wait for each other.
        py.detach(|| {
            let other = other.locked().clone();
            self.locked().merge(&other)
        })
        .map_err(raise)
    }

    /// Factorises the targets, and returns what a second pass over the blocks needs.
    ///
    /// Parameters
    /// ----------
    /// map, n_styles, singular_value_share, basis, nominal, transport, dof_scale, threads
    ///     As for `fit`; `n_styles` is a number.
    ///
    /// Returns
    /// -------
    /// FactorisedFit
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An option is invalid, or there is no demonstration.
    #[pyo3(
        signature = (
            *, map=Choice::FIRST, n_styles=None, singular_value_share=None, basis=None, nominal=None, transport=None,
            dof_scale=None, threads=None
        ),
        text_signature = "($self, *, map='auto', n_styles=None, singular_value_share=None, basis='gp', nominal=None, \
                          transport=None, dof_scale=None, threads=None)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn factorise(
        &self,
        py: Python<'_>,
        map: Choice<'_>,
        n_styles: Option<&Bound<'_, PyAny>>,
        singular_value_share: Option<Scalar<'_>>,
        basis: Option<&Bound<'_, PyAny>>,
        nominal: Option<Scalar<'_>>,
        transport: Option<Choice<'_>>,
        dof_scale: Option<&Bound<'_, PyAny>>,
        threads: Option<Scalar<'_>>,
    ) -> PyResult<FactorisedFit> {
        let kind = py.detach(|| self.locked().kind());
        let canonical = canonical_of(kind, (None, None, transport), (None, None))?;
        let mut options = FitOptions::new(canonical);
        options.map = map_of(map)?;
        options.n_styles = n_styles_of(n_styles, optional_number("singular_value_share", singular_value_share)?)?;
        options.basis = basis_of(basis)?;
        options.nominal = optional_count("nominal", nominal)?;
        options.dof_scale = dof_scale_of(dof_scale)?;
        options.threads = crate::convert::threads(threads)?;
        let report = |_: Python<'_>, _: Stage, _: f64| Ok(());
        let factorised = detached(py, report, |progress| self.locked().factorise(&options, progress))?;
        Ok(FactorisedFit(factorised))
    }

    /// Fits a model to the demonstrations so far, whose blocks are read once more.
    ///
    /// Parameters
    /// ----------
    /// blocks : iterable of blocks, or function that returns one
    ///     The demonstrations so far, in the same order, in any blocks.
    /// map, n_styles, singular_value_share, basis, nominal, transport, dof_scale, threads
    ///     As for `fit`; `n_styles` is a number.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An option is invalid, there is no demonstration, or the blocks are others.
    #[pyo3(
        signature = (
            blocks, *, map=Choice::FIRST, n_styles=None, singular_value_share=None, basis=None, nominal=None,
            transport=None, dof_scale=None, threads=None
        ),
        text_signature = "($self, blocks, *, map='auto', n_styles=None, singular_value_share=None, basis='gp', \
                          nominal=None, transport=None, dof_scale=None, threads=None)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn finish(
        &self,
        py: Python<'_>,
        blocks: &Bound<'_, PyAny>,
        map: Choice<'_>,
        n_styles: Option<&Bound<'_, PyAny>>,
        singular_value_share: Option<Scalar<'_>>,
        basis: Option<&Bound<'_, PyAny>>,
        nominal: Option<Scalar<'_>>,
        transport: Option<Choice<'_>>,
        dof_scale: Option<&Bound<'_, PyAny>>,
        threads: Option<Scalar<'_>>,
    ) -> PyResult<Model> {
        let blocks = Blocks::from_source(blocks);
        let factorised =
            self.factorise(py, map, n_styles, singular_value_share, basis, nominal, transport, dof_scale, threads)?;
        let report: StagedProgress = |_, _, _| Ok(());
        let model = detached(py, report, |progress| factorised.0.clone().finish_blocks(blocks.pass(), progress));
        FactorisedFit::model(py, blocks.checked_result(model)?)
    }

    /// Writes a file, atomically.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written, or its folder does not exist.
    ///
    /// Examples
    /// --------
    /// >>> import tempfile, pathlib
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "collection.safetensors"
    /// >>> partial = pdmp.PartialFit([np.sin(np.linspace(0.0, 3.0, 200))[:, None]], dt=0.01)
    /// >>> partial.save(path)
    /// >>> pdmp.PartialFit.load(path).n_demos
    /// 1
    fn save(&self, py: Python<'_>, path: FilePath) -> PyResult<()> {
        py.detach(|| self.locked().save(&path.0)).map_err(raise)
    }

    /// Reads a file that `save` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path-like
    ///
    /// Returns
    /// -------
    /// PartialFit
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be read.
    /// ModelFileError
    ///     The file is damaged, not a partial fit, or of another version.
    #[staticmethod]
    fn load(py: Python<'_>, path: FilePath) -> PyResult<Self> {
        let loaded = py.detach(|| pdmp_core::learning::PartialFit::load(&path.0));
        loaded.map(|partial| Self(Mutex::new(partial))).map_err(raise)
    }

    /// Returns the contents of a file as bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &py.detach(|| self.locked().to_bytes()).map_err(raise)?))
    }

    /// Reads a partial fit from the contents of a file.
    ///
    /// Parameters
    /// ----------
    /// data : bytes
    ///     Result of `to_bytes`.
    ///
    /// Returns
    /// -------
    /// PartialFit
    ///
    /// Raises
    /// ------
    /// ModelFileError
    ///     The data are damaged, not a partial fit, or of another version.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let read = py.detach(|| pdmp_core::learning::PartialFit::from_bytes(data));
        read.map(|partial| Self(Mutex::new(partial))).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,).into_pyobject(py)?))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let (kind, n_demos, n_dofs) = (self.kind(py), self.n_demos(py), self.n_dofs(py));
        format!("PartialFit(kind='{kind}', n_demos={n_demos}, n_dofs={n_dofs}, n_samples={})", self.n_samples(py))
    }
}
