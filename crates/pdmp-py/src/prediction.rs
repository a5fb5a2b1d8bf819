//! The prediction of a context map in Python.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::convert::{Reduced, to_numpy};

/// The movement predicted for a condition; what the kind of primitive does not have is None.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Prediction {
    /// Style (J,).
    style: Py<PyArray1<f64>>,
    /// Goal (D,), discrete.
    goal: Option<Py<PyArray1<f64>>>,
    /// Start (D,), discrete.
    start: Option<Py<PyArray1<f64>>>,
    /// Anchor (D,), rhythmic.
    anchor: Option<Py<PyArray1<f64>>>,
    /// Time in each segment of the movement (K,) in s.
    timing: Py<PyArray1<f64>>,
    /// Duration or period in s: the sum of the timing.
    duration: f64,
    /// Covariance (P, P) of style, goal and start or anchor, and timing, in this order, for a new movement; None where
    /// the demonstrations leave no degree of freedom to estimate it.
    covariance: Option<Py<PyArray2<f64>>>,
    /// Degrees of freedom from which the covariance is known.
    freedom: usize,
    /// How far each value of the context lies outside of those demonstrated, in their range (Q,): 0 inside and for
    /// labels, infinite where a value that was never varied differs.
    outside: Py<PyArray1<f64>>,
}

impl Prediction {
    pub(crate) fn new(py: Python<'_>, prediction: pdmp_core::model::Prediction) -> Self {
        let optional = |values: Option<Vec<f64>>| values.map(|values| to_numpy(py, &values).unbind());
        let conditions = prediction.conditions;
        Self {
            style: to_numpy(py, &conditions.style.unwrap_or_default()).unbind(),
            goal: optional(conditions.goal),
            start: optional(conditions.start),
            anchor: optional(conditions.anchor),
            timing: to_numpy(py, &conditions.timing.unwrap_or_default()).unbind(),
            duration: prediction.duration,
            covariance: prediction.covariance.map(|covariance| covariance.into_pyarray(py).unbind()),
            freedom: prediction.freedom,
            outside: to_numpy(py, &prediction.outside).unbind(),
        }
    }
}

#[pymethods]
impl Prediction {
    /// One of what another one told.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)]
    fn _of(
        style: Py<PyArray1<f64>>,
        goal: Option<Py<PyArray1<f64>>>,
        start: Option<Py<PyArray1<f64>>>,
        anchor: Option<Py<PyArray1<f64>>>,
        timing: Py<PyArray1<f64>>,
        duration: f64,
        covariance: Option<Py<PyArray2<f64>>>,
        freedom: usize,
        outside: Py<PyArray1<f64>>,
    ) -> Self {
        Self { style, goal, start, anchor, timing, duration, covariance, freedom, outside }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Self { style, goal, start, anchor, timing, duration, covariance, freedom, outside } = self;
        let told = (style, goal, start, anchor, timing, *duration, covariance, *freedom, outside);
        Ok((py.get_type::<Self>().getattr("_of")?, told.into_pyobject(py)?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let most = self.outside.bind(py).readonly().as_array().fold(0.0f64, |most, outside| most.max(*outside));
        let warning = match most {
            0.0 => String::new(),
            most if most.is_finite() => format!("; outside of the demonstrated contexts by {most:.2} of their range"),
            _ => "; outside of the demonstrated contexts, which do not vary in this".to_string(),
        };
        Ok(format!(
            "<pdmp.Prediction: style {}, duration {:.4} s{warning}>",
            self.style.bind(py).repr()?,
            self.duration
        ))
    }
}
