//! What a model in Python tells of what was learnt.

use numpy::ToPyArray;
use pdmp_core::context::ContextColumn;
use pdmp_core::dynamics::Canonical;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::context::ContextMap;
use crate::convert::{Matrix, Vector, shown_context, to_numpy};
use crate::error::raise;
use crate::model::Model;

#[pymethods]
impl Model {
    /// "discrete" or "rhythmic".
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind().name()
    }

    /// Number of demonstrations M.
    #[getter]
    fn n_demos(&self) -> usize {
        self.0.n_demos()
    }

    /// Number of degrees of freedom D.
    #[getter]
    fn n_dofs(&self) -> usize {
        self.0.n_dofs()
    }

    /// Dimension J of the style parameter.
    #[getter]
    fn n_styles(&self) -> usize {
        self.0.n_styles()
    }

    /// Time constant of the nominal demonstration in s.
    #[getter]
    fn tau(&self) -> f64 {
        self.0.tau()
    }

    /// Rate of the output system.
    #[getter]
    fn alpha_z(&self) -> f64 {
        self.0.attractor().alpha_z
    }

    /// Stiffness of the output system.
    #[getter]
    fn beta_z(&self) -> f64 {
        self.0.attractor().beta_z
    }

    /// Rate per unit of the clock at which a discrete movement brakes past its end; None if rhythmic, or if transport
    /// is immediate, where the forcing fades with the phase.
    #[getter]
    fn braking(&self) -> Option<f64> {
        self.0.braking()
    }

    /// Rate of the discrete canonical system; None if rhythmic.
    #[getter]
    fn alpha_x(&self) -> Option<f64> {
        match self.0.canonical() {
            Canonical::Discrete { alpha_x, .. } => Some(alpha_x),
            Canonical::Rhythmic { .. } => None,
        }
    }

    /// Rate of the amplitude; None if discrete.
    #[getter]
    fn mu(&self) -> Option<f64> {
        match self.0.canonical() {
            Canonical::Discrete { .. } => None,
            Canonical::Rhythmic { mu } => Some(mu),
        }
    }

    /// Names of the degrees of freedom.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.names().to_vec()
    }

    /// Units of the degrees of freedom; "" where one is not known.
    #[getter]
    fn units(&self) -> Vec<String> {
        self.0.units().to_vec()
    }

    /// Index of the nominal demonstration.
    #[getter]
    fn nominal(&self) -> usize {
        self.0.demonstrated().nominal
    }

    /// Styles S of the demonstrations (M, J).
    #[getter]
    fn styles<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.demonstrated().styles.to_pyarray(py)
    }

    /// Singular values of the targets, in decreasing order: all min(M, C·D) of them, or the first J alone, where
    /// n_styles was given and is so small beside the library that the others were not computed.
    #[getter]
    fn singular_values<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_numpy(py, &self.0.learnt().singular_values)
    }

    /// Share of the targets F, by root mean square, that the J styles leave out: ‖F − S·F_basis‖/‖F‖.
    #[getter]
    fn truncation_error(&self) -> f64 {
        self.0.learnt().truncation_error
    }

    /// Standard deviation of the measurement noise of each degree of freedom (D,), in its unit, by generalised
    /// cross-validation: 0 where none was found, or none was looked for (`smoothing=None`).
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_numpy(py, self.0.learnt().noise.levels())
    }

    /// Cut-offs of the smoothing (D,) in Hz, at which a sine keeps half of its amplitude; inf where every sample is met.
    #[getter]
    fn cut_offs<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let cut_offs: Vec<f64> =
            self.0.learnt().noise.cut_offs().iter().map(|hz| hz.unwrap_or(f64::INFINITY)).collect();
        to_numpy(py, &cut_offs)
    }

    /// Unit of each degree of freedom in the factorisation (D,).
    #[getter]
    fn dof_scale<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_numpy(py, &self.0.learnt().dof_scale)
    }

    /// Goals of the demonstrations (M, D).
    #[getter]
    fn goals<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.demonstrated().goals.to_pyarray(py)
    }

    /// First positions of the demonstrations (M, D).
    #[getter]
    fn starts<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.demonstrated().starts.to_pyarray(py)
    }

    /// Mean positions of the demonstrations (M, D), the anchors of cycles.
    #[getter]
    fn anchors<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.demonstrated().anchors.to_pyarray(py)
    }

    /// Phases (K+1,) from 0 to 1 that divide the movement into segments; K = 1 where time is scaled linearly.
    #[getter]
    fn breaks<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_numpy(py, self.0.breaks())
    }

    /// Timings of the demonstrations (M, K): the time in s that each spends in each segment.
    #[getter]
    fn segment_durations<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        self.0.demonstrated().segment_durations.to_pyarray(py)
    }

    /// Durations or periods of the demonstrations (M,) in s: the sums of their segment_durations.
    #[getter]
    fn durations<'py>(&self, py: Python<'py>) -> Vector<'py> {
        to_numpy(py, &self.0.demonstrated().durations)
    }

    /// Contexts of the demonstrations (M, Q), if they had any: an array, or lists where there are labels.
    #[getter]
    fn contexts<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let (Some(contexts), Some(map)) = (&self.0.demonstrated().contexts, self.0.map()) else { return Ok(None) };
        if map.columns().iter().all(|column| *column == ContextColumn::Number) {
            return Ok(Some(contexts.to_pyarray(py).into_any()));
        }
        let rows = contexts.rows().into_iter().map(|row| {
            let context = map.context(&row.to_vec()).map_err(raise)?;
            shown_context(py, &context)
        });
        Ok(Some(PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)?.into_any()))
    }

    /// What leads from contexts to movements, if there are any.
    #[getter]
    fn map(&self) -> Option<ContextMap> {
        self.0.map().cloned().map(ContextMap)
    }

    /// What was chosen for the basis functions, in one line.
    #[getter]
    fn regression(&self) -> &str {
        &self.0.learnt().regression
    }

    /// Estimated error of the compiled landscape, relative to its largest value.
    #[getter]
    fn table_error(&self) -> f64 {
        self.0.forcing_table().error()
    }
}
