//! Properties of a model.

use numpy::ToPyArray;
use pdmp_core::context::ContextColumn;
use pdmp_core::dynamics::Canonical;
use pdmp_core::model::{Coordinates, Frame};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::context::ContextMap;
use crate::convert::{Matrix, Vector, context_to_python, locked, read_only};
use crate::error::{ascii, raise};
use crate::model::Model;
use crate::rotations::rotations_to_python;

#[pymethods]
impl Model {
    /// Kind of the primitive, "discrete" or "rhythmic".
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

    /// Number of coordinates, the length of positions, goals and starts: one more than the degrees of freedom for each
    /// rotation.
    #[getter]
    fn n_coordinates(&self) -> usize {
        self.0.n_coordinates()
    }

    /// Names of the coordinates.
    #[getter]
    fn coordinate_names(&self) -> Vec<String> {
        self.0.coordinate_names().to_vec()
    }

    /// Units of the coordinates; an unknown unit is "".
    #[getter]
    fn coordinate_units(&self) -> Vec<String> {
        self.0.coordinate_units().to_vec()
    }

    /// First column of each unit quaternion in positions, and the order of its components, "wxyz" or "xyzw".
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        rotations_to_python(py, &self.0.coordinates().map(Coordinates::columns).unwrap_or_default())
    }

    /// Frame of angular velocities and accelerations, "body" or "world"; None without rotations.
    #[getter]
    fn rotation_frame(&self) -> Option<&'static str> {
        self.0.coordinates().map(|coordinates| match coordinates.frame() {
            Frame::Body => "body",
            Frame::World => "world",
        })
    }

    /// Style dimension J.
    #[getter]
    fn n_styles(&self) -> usize {
        self.0.n_styles()
    }

    /// Time constant τ of the nominal demonstration in s: its duration if discrete, its period over 2π if rhythmic.
    #[getter]
    fn tau(&self) -> f64 {
        self.0.tau()
    }

    /// Rate α_z of the output system, without unit.
    #[getter]
    fn alpha_z(&self) -> f64 {
        self.0.attractor().alpha_z
    }

    /// Stiffness β_z of the output system, without unit.
    #[getter]
    fn beta_z(&self) -> f64 {
        self.0.attractor().beta_z
    }

    /// Braking rate of a discrete movement past its end, per unit of the clock.
    ///
    /// None if the primitive is rhythmic, or if transport is immediate, so that the forcing fades with the phase.
    #[getter]
    fn braking(&self) -> Option<f64> {
        self.0.braking()
    }

    /// Rate α_x of the discrete canonical system, without unit; None if rhythmic.
    #[getter]
    fn alpha_x(&self) -> Option<f64> {
        match self.0.canonical() {
            Canonical::Discrete { alpha_x, .. } => Some(alpha_x),
            Canonical::Rhythmic { .. } => None,
        }
    }

    /// Rate μ of the amplitude, without unit; None if discrete.
    #[getter]
    fn mu(&self) -> Option<f64> {
        match self.0.canonical() {
            Canonical::Discrete { .. } => None,
            Canonical::Rhythmic { mu } => Some(mu),
        }
    }

    /// Names of the degrees of freedom (D,).
    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.names().to_vec()
    }

    /// Units of the degrees of freedom (D,); "" if unknown.
    #[getter]
    fn units(&self) -> Vec<String> {
        self.0.units().to_vec()
    }

    /// Index of the nominal demonstration.
    #[getter]
    fn nominal(&self) -> usize {
        self.0.demonstrated().nominal
    }

    /// Styles S (M, J) of the demonstrations, without unit.
    #[getter]
    fn styles<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.demonstrated().styles.to_pyarray(py))
    }

    /// Singular values of the targets in decreasing order.
    ///
    /// All min(M, C·D), or the first J if a small `n_styles` was given and the others were not computed.
    #[getter]
    fn singular_values<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, &self.0.learnt().singular_values)
    }

    /// Truncation error ‖F − S·F_basis‖/‖F‖ of the targets F in the Frobenius norm.
    #[getter]
    fn truncation_error(&self) -> f64 {
        self.0.learnt().truncation_error
    }

    /// Standard deviation (D,) of the measurement noise in the unit of each degree of freedom, by generalised
    /// cross-validation.
    ///
    /// 0 if no noise was found, or with `smoothing=None`.
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, self.0.learnt().noise.levels())
    }

    /// Cut-off frequencies (D,) of the smoothing in Hz, at a gain of one half; inf without smoothing.
    #[getter]
    fn cut_offs<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let cut_offs: Vec<f64> =
            self.0.learnt().noise.cut_offs().iter().map(|hz| hz.unwrap_or(f64::INFINITY)).collect();
        read_only(py, &cut_offs)
    }

    /// Scale (D,) of each degree of freedom in the factorisation, in its unit.
    #[getter]
    fn dof_scale<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, &self.0.learnt().dof_scale)
    }

    /// Goals (M, D) of the demonstrations in the unit of each degree of freedom.
    #[getter]
    fn goals<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.goals().to_pyarray(py))
    }

    /// First positions (M, D) of the demonstrations in the unit of each degree of freedom.
    #[getter]
    fn starts<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.starts().to_pyarray(py))
    }

    /// Mean positions (M, D) of the demonstrations, the anchors of cycles, in the unit of each degree of freedom.
    #[getter]
    fn anchors<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.anchors().to_pyarray(py))
    }

    /// Bounds (K+1,) of the segments as shares of the movement, from 0 to 1; K = 1 with linear scaling of time.
    #[getter]
    fn breaks<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, self.0.breaks())
    }

    /// Time (M, K) in s of each demonstration in each segment between `breaks`.
    #[getter]
    fn segment_durations<'py>(&self, py: Python<'py>) -> Matrix<'py> {
        locked(self.0.demonstrated().segment_durations.to_pyarray(py))
    }

    /// Duration of the nominal demonstration in s if discrete, its period if rhythmic.
    #[getter]
    fn duration(&self) -> f64 {
        self.0.duration()
    }

    /// Durations or periods (M,) of the demonstrations in s, the sums of their segment durations.
    #[getter]
    fn durations<'py>(&self, py: Python<'py>) -> Vector<'py> {
        read_only(py, &self.0.demonstrated().durations)
    }

    /// Contexts (M, Q) of the demonstrations, an array of numbers or lists with labels; None without contexts.
    #[getter]
    fn contexts<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let (Some(contexts), Some(map)) = (&self.0.demonstrated().contexts, self.0.map()) else { return Ok(None) };
        if map.columns().iter().all(|column| *column == ContextColumn::Number) {
            return Ok(Some(locked(contexts.to_pyarray(py)).into_any()));
        }
        let rows = contexts.rows().into_iter().map(|row| {
            let context = map.context(&row.to_vec()).map_err(raise)?;
            context_to_python(py, &context)
        });
        Ok(Some(PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)?.into_any()))
    }

    /// Names (Q,) of the context columns; None where the contexts had none.
    #[getter]
    fn context_names(&self) -> Option<Vec<String>> {
        self.0.map().map(|map| map.names().to_vec()).filter(|names| !names.is_empty())
    }

    /// Map from contexts to style, goal, start or anchor, and duration; None without contexts.
    #[getter]
    fn map(&self) -> Option<ContextMap> {
        self.0.map().cloned().map(ContextMap)
    }

    /// Description of the regression of the landscape.
    #[getter]
    fn regression(&self) -> String {
        ascii(&self.0.learnt().regression)
    }

    /// Estimated interpolation error of the tabulated landscape, relative to its largest value.
    #[getter]
    fn table_error(&self) -> f64 {
        self.0.forcing_table().error()
    }
}
