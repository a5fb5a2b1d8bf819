//! Movements predicted for a context.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::conditions::Conditions;
use crate::convert::{Reduced, to_numpy};

/// Movement predicted for a context, returned by `Model.predict`.
#[pyclass(frozen, get_all, module = "pdmp")]
pub(crate) struct Prediction {
    /// Predicted style, goal and start or anchor, and segment durations.
    conditions: Py<Conditions>,
    /// Predicted duration or period in s.
    duration: f64,
    /// Covariance (P, P) of style, goal and start or anchor, and segment durations of a new movement, in this order;
    /// None if the demonstrations leave no degree of freedom to estimate it.
    covariance: Option<Py<PyArray2<f64>>>,
    /// Degrees of freedom of the covariance estimate.
    degrees_of_freedom: usize,
    /// Distance (Q,) of each context value from the demonstrated range, relative to that range: 0 inside and for
    /// labels, inf for a value that differs from a constant one.
    extrapolation: Py<PyArray1<f64>>,
}

impl Prediction {
    pub(crate) fn new(py: Python<'_>, prediction: pdmp_core::model::Prediction) -> PyResult<Self> {
        Ok(Self {
            conditions: Py::new(py, Conditions(prediction.conditions))?,
            duration: prediction.duration,
            covariance: prediction.covariance.map(|covariance| covariance.into_pyarray(py).unbind()),
            degrees_of_freedom: prediction.degrees_of_freedom,
            extrapolation: to_numpy(py, &prediction.extrapolation).unbind(),
        })
    }
}

#[pymethods]
impl Prediction {
    /// Rebuilds a pickled prediction.
    #[staticmethod]
    fn _of(
        conditions: Py<Conditions>,
        duration: f64,
        covariance: Option<Py<PyArray2<f64>>>,
        degrees_of_freedom: usize,
        extrapolation: Py<PyArray1<f64>>,
    ) -> Self {
        Self { conditions, duration, covariance, degrees_of_freedom, extrapolation }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let Self { conditions, duration, covariance, degrees_of_freedom, extrapolation } = self;
        let parts = (conditions, *duration, covariance, *degrees_of_freedom, extrapolation);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let distances = self.extrapolation.bind(py).readonly();
        let note = match distances.as_array().fold(0.0f64, |most, distance| most.max(*distance)) {
            0.0 => String::new(),
            most if most.is_finite() => format!("; extrapolated by {most:.2} of the demonstrated range of contexts"),
            _ => "; extrapolated along a context value that never varied".to_string(),
        };
        let style: Vec<f64> = self.conditions.bind(py).getattr("style")?.extract()?;
        Ok(format!("<pdmp.Prediction: style {style:.4?}, duration {:.4} s{note}>", self.duration))
    }
}
