//! Options of the scaling of time.

use ndarray::Array2;
use pdmp_core::learning::TimeScaling;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::convert::{matrix, quoted};
use crate::error::raise;
use crate::scalar::Scalar;

/// Monotone time warp of the demonstrations to the nominal one.
///
/// Movements are compared by their square-root velocity q = ẏ/√|ẏ|, scaled to unit norm. Over the phase p the warp γ
/// minimises ∫|q₀ − (q∘γ)√γ̇|² + λ ln²γ̇ dp, exactly among warps that are linear in each segment with ends on a
/// grid of a tenth of a segment.
///
/// Parameters
/// ----------
/// n_segments : int
///     Number K of segments of equal phase, from 1 (linear scaling) to 1000 and half the samples of each demonstration.
/// max_slope : float
///     Bound of the slope of the warp, from 1 to 10: the duration of a segment is at most `max_slope` times that of
///     linear scaling and at least 1 / `max_slope` of it.
///
/// Raises
/// ------
/// ValueError
///     `n_segments` or `max_slope` is out of range.
///
/// References
/// ----------
/// Srivastava, Klassen, Joshi, Jermyn, IEEE TPAMI 33 (2011), https://doi.org/10.1109/TPAMI.2010.184
///
/// Nielsen, Carstensen, Smedsgaard, J. Chromatography A 805 (1998), https://doi.org/10.1016/S0021-9673(98)00021-1
#[pyclass(frozen, module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct TimeWarp(pub(crate) pdmp_core::model::TimeWarp);

#[pymethods]
impl TimeWarp {
    #[new]
    #[pyo3(
        signature = (
            n_segments=Scalar::Count(pdmp_core::model::TimeWarp::default().n_segments),
            max_slope=Scalar::Number(pdmp_core::model::TimeWarp::default().max_slope)
        ),
        text_signature = "(n_segments=8, max_slope=2.5)"
    )]
    fn new(n_segments: Scalar<'_>, max_slope: Scalar<'_>) -> PyResult<Self> {
        let (n_segments, max_slope) = (n_segments.count("n_segments")?, max_slope.number("max_slope")?);
        pdmp_core::model::TimeWarp::new(n_segments, max_slope).map(Self).map_err(raise)
    }

    /// Number K of segments.
    #[getter]
    fn n_segments(&self) -> usize {
        self.0.n_segments
    }

    /// Bound of the slope of the warp, relative to linear scaling.
    #[getter]
    fn max_slope(&self) -> f64 {
        self.0.max_slope
    }

    fn __getnewargs__(&self) -> (usize, f64) {
        (self.0.n_segments, self.0.max_slope)
    }

    fn __repr__(&self) -> String {
        format!("pdmp.TimeWarp({}, max_slope={})", self.0.n_segments, self.0.max_slope)
    }
}

/// Returns the time scaling of the arguments `alignment` and `landmarks`.
pub(crate) fn time_scaling_of(
    alignment: Option<&Bound<'_, PyAny>>,
    landmarks: Option<&Bound<'_, PyAny>>,
) -> PyResult<TimeScaling> {
    let alignment = alignment.map_or(Ok(TimeScaling::Linear), alignment_of)?;
    let landmarks: Option<Array2<f64>> =
        landmarks.map(|landmarks| matrix("landmarks", "(M, E)", landmarks)).transpose()?;
    match (alignment, landmarks) {
        (TimeScaling::Linear, Some(landmarks)) => Ok(TimeScaling::Landmarks(landmarks)),
        (_, Some(_)) => Err(PyValueError::new_err("alignment and landmarks: pass a warp or landmarks, not both")),
        (alignment, None) => Ok(alignment),
    }
}

fn alignment_of(alignment: &Bound<'_, PyAny>) -> PyResult<TimeScaling> {
    if let Ok(warp) = alignment.cast::<TimeWarp>() {
        return Ok(TimeScaling::Warp(warp.get().0.clone()));
    }
    match alignment.extract::<String>().as_deref() {
        Ok("linear") => Ok(TimeScaling::Linear),
        Ok("warp") => Ok(TimeScaling::WarpIfBetter),
        _ => {
            let allowed = "must be \"linear\", \"warp\" or pdmp.TimeWarp(...)";
            Err(PyValueError::new_err(format!("alignment = {}: {allowed}", quoted(alignment))))
        }
    }
}
