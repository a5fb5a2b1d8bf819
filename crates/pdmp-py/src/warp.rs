//! Settings of a time warp in Python.

use pyo3::prelude::*;

use crate::convert::count;
use crate::error::raise;

/// Monotone time warp of the demonstrations to the nominal one.
///
/// Movements are compared by q = ẏ/√|ẏ|, of unit size: γ minimises ∫|q₀ − (q∘γ)√γ̇|² + λ ln²γ̇ dp over the phase p, exactly
/// among the warps that are linear in each segment, with ends on a grid of a tenth of a segment.
///
/// Parameters
/// ----------
/// segments : int
///     Number K of segments of equal phase; 1 is linear. At most half the samples of each demonstration, and 1000.
/// slope : float
///     Bound of a segment's time, from 1 to 10: at most `slope` times that of linear scaling, at least 1 / `slope`.
///
/// Raises
/// ------
/// ValueError
///     A number out of range.
///
/// References
/// ----------
/// Srivastava, Klassen, Joshi, Jermyn, IEEE TPAMI 33 (2011), https://doi.org/10.1109/TPAMI.2010.184; Nielsen, Carstensen,
/// Smedsgaard, J. Chromatography A 805 (1998), https://doi.org/10.1016/S0021-9673(98)00021-1
#[pyclass(frozen, module = "pdmp", from_py_object)]
#[derive(Clone)]
pub(crate) struct Warp(pub(crate) pdmp_core::model::Warp);

#[pymethods]
impl Warp {
    #[new]
    #[pyo3(
        signature = (segments=pdmp_core::model::Warp::default().segments as isize, slope=pdmp_core::model::Warp::default().slope),
        text_signature = "(segments=8, slope=2.5)"
    )]
    fn new(segments: isize, slope: f64) -> PyResult<Self> {
        pdmp_core::model::Warp::new(count("segments", segments)?, slope).map(Self).map_err(raise)
    }

    /// Number K of segments.
    #[getter]
    fn segments(&self) -> usize {
        self.0.segments
    }

    /// Bound of a segment's time, relative to linear scaling.
    #[getter]
    fn slope(&self) -> f64 {
        self.0.slope
    }

    fn __getnewargs__(&self) -> (usize, f64) {
        (self.0.segments, self.0.slope)
    }

    fn __repr__(&self) -> String {
        format!("pdmp.Warp({}, slope={})", self.0.segments, self.0.slope)
    }
}
