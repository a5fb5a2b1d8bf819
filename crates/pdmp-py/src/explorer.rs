//! Page with a model to explore.

use numpy::{IntoPyArray, PyArray2, PyArray3, PyArray4};
use pdmp_core::motion::unit_curves;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyTuple};

use crate::error::raise;
use crate::model::Model;

type Curves<'py> = (Bound<'py, PyArray4<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, usize);

#[pymethods]
impl Model {
    /// Makes a page with the model to explore in a browser or a notebook.
    ///
    /// The page is one HTML file that needs neither a server nor a network. It has sliders for style, goal and start, or
    /// anchor and amplitude, τ and context; positions, velocities, accelerations and paths that follow them; limits; the
    /// plane of styles, with the demonstrations as points; and the call of `rollout` for the present movement. Positions,
    /// velocities and accelerations equal those of `rollout` with the same `style`, `goal`, `start` and `tau` to rounding.
    ///
    /// Time is linear: a movement of a model with several segments is that for their total duration. Contexts step over
    /// predictions made in advance, on a grid over the demonstrated range.
    ///
    /// Parameters
    /// ----------
    /// path : path-like, optional
    ///     File to write.
    /// demonstrations : sequence or mapping of Demonstration, optional
    ///     The M demonstrations, in the order of the fit, to draw behind the movement. By default, their reproductions are
    ///     drawn.
    /// limits : Limits, optional
    ///     Limits of position, velocity and acceleration to draw and to compare the movement with.
    /// kinematics : callable, optional
    ///     Forward kinematics of a stick figure: points (P, 2) or (P, 3) at a position (n,) with the columns of a
    ///     demonstration. Each point may depend on at most eight degrees of freedom, on each as a + b·cos q + c·sin q, as
    ///     for revolute joints in rad or degrees, or, in a unit of length, as a + b·q; and linearly on the matrix of a
    ///     rotation, which counts three. The page then computes the points exactly.
    /// links : sequence of (int, int), optional
    ///     Pairs of points to connect; by default each with the next one.
    /// dofs : sequence of str or int, optional
    ///     Coordinates with diagrams, by name or index; by default all, the first 12 of more.
    /// title : str, optional
    ///     Heading of the page.
    ///
    /// Returns
    /// -------
    /// Explorer
    ///     The page, `html`, which notebooks display.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     A number of demonstrations other than M, unknown degrees of freedom, limits of a wrong length, kinematics of
    ///     another form, or a page of more than 2 MB.
    /// TypeError
    ///     An argument has another type.
    /// OSError
    ///     The file cannot be written, or its folder does not exist.
    ///
    /// Examples
    /// --------
    /// >>> page = model.explorer(limits=pdmp.Limits(velocity=2.0))
    /// >>> page.html.startswith("<!DOCTYPE html>")
    /// True
    #[pyo3(signature = (
        path=None, *, demonstrations=None, limits=None, kinematics=None, links=None, dofs=None, title=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn explorer<'py>(
        slf: &Bound<'py, Self>,
        path: Option<&Bound<'py, PyAny>>,
        demonstrations: Option<&Bound<'py, PyAny>>,
        limits: Option<&Bound<'py, PyAny>>,
        kinematics: Option<&Bound<'py, PyAny>>,
        links: Option<&Bound<'py, PyAny>>,
        dofs: Option<&Bound<'py, PyAny>>,
        title: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let options = [
            ("demonstrations", demonstrations),
            ("limits", limits),
            ("kinematics", kinematics),
            ("links", links),
            ("dofs", dofs),
            ("title", title),
        ];
        let arguments = PyTuple::new(py, [Some(slf.as_any()), path])?;
        py.import("pdmp.explorer")?.getattr("explorer")?.call(arguments, Some(&options.into_py_dict(py)?))
    }

    /// Computes the curves of which movements under constant conditions consist, per unit of the clock: responses to the
    /// styles (3, J, T, D) and to the start (3, T), mean rotations with their velocity and acceleration (R, T, 10), and
    /// the sample of these to which goals or anchors are relative.
    fn _unit_curves<'py>(&self, py: Python<'py>, steps: usize) -> PyResult<Curves<'py>> {
        let curves = py.detach(|| unit_curves(self.0.primitive(), steps)).map_err(raise)?;
        Ok((
            curves.styles.into_pyarray(py),
            curves.start.into_pyarray(py),
            curves.mean_rotations.into_pyarray(py),
            curves.centre,
        ))
    }
}
