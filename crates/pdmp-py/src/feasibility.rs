//! Comparison of movements with limits, and the nearest conditions that keep them.

use pdmp_core::model::Prediction;
use pdmp_core::motion::{Extreme, Margins as Inner, Vary, feasible, feasible_prediction, nearest_feasible};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::choice::Choice;
use crate::conditions::{Conditions, conditions_of, predicted_conditions_of};
use crate::convert::Reduced;
use crate::error::raise;
use crate::instance;
use crate::model::Model;

/// Ratio, degree of freedom and time in s.
type Place = (f64, usize, f64);

/// Largest ratios of a movement to its limits, returned by `Model.feasible`. Their truth value is `feasible`.
#[pyclass(frozen, eq, get_all, module = "pdmp")]
#[derive(PartialEq)]
pub(crate) struct Margins {
    /// Largest distance of the position outside its limits, relative to the range between them, or to the demonstrated one
    /// if a side has none, at most 0 inside; with the index of its degree of freedom and the time in s. None without limits
    /// of the position.
    position: Option<Place>,
    /// Largest ratio |ẏ| / V, at most 1 inside, with the index of its degree of freedom and the time in s. None without
    /// limits of the velocity.
    velocity: Option<Place>,
    /// Largest ratio |ÿ| / A, at most 1 inside, with the index of its degree of freedom and the time in s. None without
    /// limits of the acceleration.
    acceleration: Option<Place>,
    /// True if the movement keeps all limits, within 1e-9 of them.
    feasible: bool,
}

impl Margins {
    pub(crate) fn new(margins: Inner) -> Self {
        let place = |extreme: Extreme| (extreme.ratio, extreme.dof, extreme.time);
        let Inner { position, velocity, acceleration } = margins;
        let [position, velocity, acceleration] = [position, velocity, acceleration].map(|extreme| extreme.map(place));
        Self { position, velocity, acceleration, feasible: margins.is_feasible() }
    }
}

#[pymethods]
impl Margins {
    /// Rebuilds pickled margins.
    #[staticmethod]
    fn _of(position: Option<Place>, velocity: Option<Place>, acceleration: Option<Place>, feasible: bool) -> Self {
        Self { position, velocity, acceleration, feasible }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let parts = (self.position, self.velocity, self.acceleration, self.feasible);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
    }

    fn __bool__(&self) -> bool {
        self.feasible
    }

    fn __repr__(&self) -> String {
        let state = if self.feasible { "feasible" } else { "not feasible" };
        let quantities =
            [("position", self.position), ("velocity", self.velocity), ("acceleration", self.acceleration)];
        let text = |(name, place): (&str, Option<Place>)| {
            place.map(|(ratio, dof, time)| format!("; {name} {ratio:.4} of DoF {dof} at {time:.4} s"))
        };
        let texts: String = quantities.into_iter().filter_map(text).collect();
        format!("<pdmp.Margins: {state}{texts}>")
    }
}

#[pymethods]
impl Model {
    /// Compares the whole movement under constant conditions with limits.
    ///
    /// Of a rotation, the sizes of angular velocity and acceleration count, under the index of its first degree of freedom.
    ///
    /// A discrete movement counts from its start until it rests past its end, a rhythmic one over a period, and from a given
    /// start until it has reached its cycle.
    ///
    /// Parameters
    /// ----------
    /// limits : Limits
    ///     Limits of position, velocity and acceleration; those of the jerk do not count.
    /// conditions : Conditions, optional
    ///     Conditions at the start.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// Margins
    ///     Largest ratios of the movement to its limits.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `rollout` rejects the conditions, or a limit has a wrong length.
    /// TypeError
    ///     A keyword is unknown, or `conditions` or `limits` has another type.
    ///
    /// Examples
    /// --------
    /// >>> margins = model.feasible(pdmp.Limits(velocity=0.5))
    /// >>> margins.feasible
    /// False
    /// >>> ratio, dof, time = margins.velocity
    /// >>> bool(np.isclose(ratio * 0.5, abs(model.rollout(dt=0.001).velocity).max(), rtol=1e-3))
    /// True
    #[pyo3(
        signature = (limits, conditions=None, *, context=None, **changes),
        text_signature = "($self, limits, conditions=None, *, context=None, **changes)"
    )]
    fn feasible(
        &self,
        py: Python<'_>,
        limits: &Bound<'_, PyAny>,
        conditions: Option<&Bound<'_, PyAny>>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Margins> {
        let (limits, conditions) = (instance::limits(limits)?, conditions_of(&self.0, conditions, context, changes)?);
        py.detach(|| feasible(self.0.primitive(), limits, &conditions)).map(Margins::new).map_err(raise)
    }

    /// Computes the conditions nearest to the requested ones whose movement keeps limits.
    ///
    /// Start, tau and the other conditions remain, so that the movement is affine in style s and goal g, or anchor of a
    /// rhythmic movement. The change (Δs, Δg) minimises Δsᵀ Σ_s⁻¹ Δs + Δgᵀ Σ_g⁻¹ Δg, with the covariances of the
    /// demonstrations plus squares of a tenth of the range of styles and positions, subject to the limits over the whole
    /// movement: a quadratic program. With `context`, the covariance is that of style and goal together in the prediction,
    /// plus squares of a hundredth of the standard deviations above: what the context determines changes least. The sizes of
    /// angular velocities and accelerations are linearised: within limits of rotations the conditions are the nearest ones up to
    /// their curvature.
    ///
    /// Parameters
    /// ----------
    /// limits : Limits
    ///     Limits of position, velocity and acceleration; those of the jerk do not count.
    /// conditions : Conditions, optional
    ///     Requested conditions.
    /// vary : {"both", "style", "goal"}
    ///     Conditions that change; "goal" is the anchor of a rhythmic movement.
    /// context : array_like or list, (Q,), optional
    ///     Context whose prediction supplies absent conditions, and the covariance.
    /// **changes
    ///     Single conditions by name, as in `rollout`.
    ///
    /// Returns
    /// -------
    /// Conditions
    ///     Requested conditions with another style, goal or anchor; unchanged if they keep the limits.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     `rollout` rejects the conditions, a limit has a wrong length, or no change of the varied conditions keeps the
    ///     limits.
    /// TypeError
    ///     A keyword is unknown, or `conditions` or `limits` has another type.
    ///
    /// Examples
    /// --------
    /// >>> limits = pdmp.Limits(velocity=1.5)
    /// >>> near = model.nearest_feasible(limits)
    /// >>> model.feasible(limits).feasible, model.feasible(limits, near).feasible
    /// (False, True)
    ///
    /// References
    /// ----------
    /// Kelley, Journal of the Society for Industrial and Applied Mathematics 8(4), 1960, doi:10.1137/0108053.
    #[pyo3(
        signature = (limits, conditions=None, *, vary=Choice::FIRST, context=None, **changes),
        text_signature = "($self, limits, conditions=None, *, vary='both', context=None, **changes)"
    )]
    fn nearest_feasible(
        &self,
        py: Python<'_>,
        limits: &Bound<'_, PyAny>,
        conditions: Option<&Bound<'_, PyAny>>,
        vary: Choice<'_>,
        context: Option<&Bound<'_, PyAny>>,
        changes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Conditions> {
        let vary = vary.of("vary", &[("both", Vary::Both), ("style", Vary::Style), ("goal", Vary::Goal)])?;
        let limits = instance::limits(limits)?;
        let (conditions, prediction) = predicted_conditions_of(&self.0, conditions, context, changes)?;
        let nearest = py.detach(|| match prediction {
            None => nearest_feasible(&self.0, limits, &conditions, vary),
            Some(prediction) => {
                let prediction = Prediction { conditions, ..prediction };
                feasible_prediction(&self.0, limits, prediction, vary).map(|prediction| prediction.conditions)
            }
        });
        nearest.map(Conditions).map_err(raise)
    }
}
