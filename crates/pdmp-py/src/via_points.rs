//! Movements through points.

use std::sync::Arc;

use numpy::PyArray1;
use pdmp_core::dynamics::AdditionalForcing as Forcing;
use pdmp_core::inference::{PassageOptions, through};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::conditions::{Conditions, own_and_predicted};
use crate::controller::Controller;
use crate::convert::{Reduced, Vector, items, to_numpy};
use crate::error::{raise, warn};
use crate::instance;
use crate::model::Model;
use crate::scalar::{Scalar, optional_number};
use crate::via_point::ViaPoint;

/// Additional forcing of one movement, which displaces it; see `Model.through`.
///
/// It moves the frame of the movement by delta(u), so that a movement under constant conditions becomes y(u) + delta(u).
/// That of a discrete movement vanishes at its end, and that of a rhythmic one is periodic. `Conditions.forcing` and
/// `Controller.add_forcing` take it; it can be pickled.
#[pyclass(frozen, eq, module = "pdmp")]
#[derive(Clone, PartialEq)]
pub(crate) struct AdditionalForcing(pub(crate) Arc<Forcing>);

#[pymethods]
impl AdditionalForcing {
    /// Returns the displacement and its derivatives at a clock.
    ///
    /// Parameters
    /// ----------
    /// u : float
    ///     Clock, t / tau since the start, or the phase of a rhythmic movement.
    ///
    /// Returns
    /// -------
    /// tuple of three ndarray, (D,)
    ///     The displacement in the unit of each degree of freedom, and its first and second derivative per unit of u.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `u` is not a number.
    fn displacement<'py>(&self, py: Python<'py>, u: Scalar<'_>) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>)> {
        let [value, slope, bend] = self.0.displacement(u.number("u")?).map(|jet| to_numpy(py, &jet));
        Ok((value, slope, bend))
    }

    /// Clock u at which the displacement begins.
    #[getter]
    fn begins(&self) -> f64 {
        self.0.begins()
    }

    /// Rebuilds a pickled forcing.
    #[staticmethod]
    fn _of(numbers: &Bound<'_, PyAny>) -> PyResult<Self> {
        let numbers = crate::convert::vector("numbers", numbers)?;
        Forcing::from_numbers(&numbers).map(|forcing| Self(Arc::new(forcing))).map_err(raise)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let numbers = to_numpy(py, &self.0.to_numbers());
        Ok((py.get_type::<Self>().getattr("_of")?, (numbers,).into_pyobject(py)?))
    }

    fn __repr__(&self) -> String {
        format!("<pdmp.AdditionalForcing: {} DoFs from u = {:.4}>", self.0.n_dofs(), self.0.begins())
    }
}

/// Movement through points, returned by `Model.through`.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Passage {
    /// Conditions of the movement, with its additional forcing.
    conditions: Py<Conditions>,
    /// Additional forcing, which `Controller.add_forcing` adds to a movement under way.
    forcing: Py<AdditionalForcing>,
    /// Mahalanobis distance of the points from the movements of the demonstrators. Its square is chi-squared distributed
    /// with `n_constraints` degrees of freedom for their movements.
    distance: f64,
    /// Number of positions and velocities.
    n_constraints: usize,
    /// Largest displacement (D,) by the additional forcing, relative to the ranges.
    displacement: Py<PyArray1<f64>>,
    /// True if the points lie farther from the demonstrations than 999 of 1000 movements of the demonstrators would.
    far: bool,
}

#[pymethods]
impl Passage {
    /// Rebuilds a pickled passage.
    #[staticmethod]
    fn _of(
        conditions: Py<Conditions>,
        forcing: Py<AdditionalForcing>,
        distance: f64,
        n_constraints: usize,
        displacement: Py<PyArray1<f64>>,
        far: bool,
    ) -> Self {
        Self { conditions, forcing, distance, n_constraints, displacement, far }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Self { conditions, forcing, distance, n_constraints, displacement, far } = self;
        let parts = (conditions, forcing, *distance, *n_constraints, displacement, *far);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
    }

    fn __repr__(&self) -> String {
        let Self { distance, n_constraints, far, .. } = self;
        let note = if *far { ", far from the demonstrations" } else { "" };
        format!("<pdmp.Passage: {n_constraints} constraints at a distance of {distance:.2}{note}>")
    }
}

#[pymethods]
impl Model {
    /// Computes the most probable movement through points.
    ///
    /// A movement of the demonstrators is y(u) = Phi(u) theta + delta(u), with style, goal and start theta, or style and
    /// anchor, as scattered as those of the demonstrations, and a residual delta of zero mean with a Matérn-5/2 covariance. The
    /// result is the mean given the points: conditions, and the residual as additional forcing. Points without tolerance are
    /// passed to 1e-9 of the range; a rhythmic movement passes them on its limit cycle, in every period. A warning says that
    /// the points are far from the demonstrations.
    ///
    /// Parameters
    /// ----------
    /// points : ViaPoint, or sequence of ViaPoint
    ///     Points, with at most 500 positions and velocities.
    /// conditions : Conditions, optional
    ///     Conditions that remain. The others follow from the demonstrations, or from the context.
    /// from_phase : float, optional
    ///     Phase from which on a movement under way under `conditions` departs from them, such as `Controller.phase`. All
    ///     conditions then remain, and the additional forcing alone leads the movement through the points.
    /// deviation : float, optional
    ///     Standard deviation of delta relative to the ranges, 0.03 by default. With 0 the conditions carry all that they can,
    ///     and the additional forcing the least; larger ones bend the movement near the points alone.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies mean and covariance of the conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// Passage
    ///     Conditions for `rollout` and `controller`, and the distance of the points from the demonstrations.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     There is no point, or one outside of the movement, at a fixed end or before `from_phase`; a length is wrong; a
    ///     number is not finite; a rotation has a velocity without an orientation; a tolerance or `deviation` is negative; or
    ///     points contradict each other.
    ///
    /// Warns
    /// -----
    /// UserWarning
    ///     The points are far from the demonstrations.
    ///
    /// Examples
    /// --------
    /// >>> passage = model.through(pdmp.ViaPoint(0.4, [0.2], dofs=[1]))
    /// >>> trajectory = model.rollout(passage.conditions, dt=0.1)
    /// >>> bool(abs(trajectory.position[4, 1] - 0.2) < 1e-9)
    /// True
    ///
    /// References
    /// ----------
    /// Paraschos, Daniel, Peters, Neumann, Autonomous Robots 42 (2018), doi:10.1007/s10514-017-9648-7 (via-points of ProMPs).
    #[pyo3(
        signature = (points, conditions=None, *, from_phase=None, deviation=None, context=None, **changes),
        text_signature = "($self, points, conditions=None, *, from_phase=None, deviation=None, context=None, **changes)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn through(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        conditions: Option<&Bound<'_, PyAny>>,
        from_phase: Option<Scalar<'_>>,
        deviation: Option<Scalar<'_>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Passage> {
        let names = self.0.coordinate_names();
        let points = match points.cast::<ViaPoint>() {
            Ok(point) => vec![point.get().of(names)?],
            Err(_) => items("points", points, |name, item| instance::via_point(name, item)?.of(names))?,
        };
        let (own, prediction) = own_and_predicted(&self.0, conditions, context, changes)?;
        let from_phase = optional_number("from_phase", from_phase)?;
        let options = PassageOptions { prediction, from_phase, deviation: optional_number("deviation", deviation)? };
        let passage = through(&self.0, &points, &own, &options).map_err(raise)?;
        let far = passage.is_far();
        if far {
            let text = format!(
                "the points are far from the demonstrations: at a distance of {:.1} standard deviations, farther than 999 of \
                 1000 movements of the demonstrators would be",
                passage.distance
            );
            warn(py, &text)?;
        }
        Ok(Passage {
            conditions: Py::new(py, Conditions(passage.conditions))?,
            forcing: Py::new(py, AdditionalForcing(passage.forcing))?,
            distance: passage.distance,
            n_constraints: passage.n_constraints,
            displacement: to_numpy(py, &passage.displacement).unbind(),
            far,
        })
    }
}

#[pymethods]
impl Controller {
    /// Additional forcing in force, or None.
    #[getter]
    fn forcing(&self) -> Option<AdditionalForcing> {
        self.inner.forcing().map(|forcing| AdditionalForcing(Arc::clone(forcing)))
    }

    /// Adds an additional forcing to that in force.
    ///
    /// Position and velocity stay continuous, and the acceleration too if the forcing begins at the present phase or later
    /// (`from_phase` of `Model.through`); one that began earlier is joined as a goal that has moved. Before the first tick it
    /// acts from the start. `reset` ends it.
    ///
    /// Parameters
    /// ----------
    /// forcing : AdditionalForcing
    ///     Forcing of `Model.through`, as `Passage.forcing`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The forcing belongs to another model, or is the ninth with another beginning. The movement then continues.
    ///
    /// Examples
    /// --------
    /// >>> controller = model.controller(dt=0.01)
    /// >>> for _ in range(20):
    /// ...     _ = controller.step()
    /// >>> point = pdmp.ViaPoint(0.4, [0.15], dofs=[1])
    /// >>> passage = model.through(point, model.conditions(model.nominal), from_phase=controller.phase)
    /// >>> controller.add_forcing(passage.forcing)
    /// >>> for _ in range(20):
    /// ...     _ = controller.step()
    /// >>> bool(abs(controller.position[1] - 0.15) < 1e-6)
    /// True
    fn add_forcing(&mut self, forcing: &Bound<'_, PyAny>) -> PyResult<()> {
        let result = self.inner.add_forcing(instance::forcing("forcing", forcing)?);
        self.command(result)
    }
}
