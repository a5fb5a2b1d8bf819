# Types of the compiled module, and copies of its docstrings, which `.ci/stubs.py --write` writes.
#
# Shapes: M demonstrations, T samples, D degrees of freedom, J style parameters, Q context values, B movements of a batch,
# C samples of a regression with P outputs. Times are in s, positions in the unit of each degree of freedom. Arguments are
# any objects that numpy converts to float64; results are float64.

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Literal, TypeAlias, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp.explorer import Explorer

_Array: TypeAlias = NDArray[np.float64]
_Kind: TypeAlias = Literal["discrete", "rhythmic"]
_Map: TypeAlias = Literal["auto", "stacked", "gp", "linear", "polynomial"]
_Vector: TypeAlias = ArrayLike | Mapping[str, float]
_Context: TypeAlias = ArrayLike | Sequence[float | str] | Mapping[str, float | str]
_Contexts: TypeAlias = (
    ArrayLike
    | Sequence[Sequence[float | str]]
    | Sequence[Mapping[str, float | str]]
    | Mapping[str, Sequence[float | str] | ArrayLike]
)
_Demo: TypeAlias = Demonstration | Trajectory | ArrayLike
_Demos: TypeAlias = Sequence[_Demo] | Mapping[str, _Demo] | ArrayLike
_Kernel: TypeAlias = Literal["matern32", "matern52"]
_Order: TypeAlias = Literal["wxyz", "xyzw"]
_Variable: TypeAlias = Literal[
    "style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude", "tau"
]

__all__ = [
    "AdditionalForcing",
    "BlockStyles",
    "Conditions",
    "ContextMap",
    "Continuation",
    "Controller",
    "Controllers",
    "Demonstration",
    "Estimate",
    "FactorisedFit",
    "Factors",
    "FitError",
    "GP",
    "GPRegression",
    "Limits",
    "Margins",
    "Model",
    "ModelFileError",
    "NGnet",
    "NGnetRegression",
    "Passage",
    "PartialFit",
    "PdmpError",
    "Prediction",
    "Prior",
    "Recogniser",
    "RolloutChunks",
    "Status",
    "StyleProjection",
    "TimeWarp",
    "Trajectory",
    "ViaPoint",
    "__version__",
    "absolute_relative",
    "axis_angles_to_quaternions",
    "blend",
    "context_rows",
    "cycles",
    "euler_to_quaternions",
    "factorise",
    "fill_gaps",
    "fit",
    "from_tangent",
    "inspected",
    "left_right",
    "load",
    "lowpass",
    "matrices_to_quaternions",
    "mean_pose",
    "mean_positions",
    "period",
    "poses_to_transforms",
    "quaternions_to_euler",
    "quaternions_to_matrices",
    "quaternions_to_rotation_vectors",
    "resample",
    "residuals",
    "rotation_vectors_to_quaternions",
    "split_at",
    "to_tangent",
    "transforms_to_poses",
    "trim",
    "turn_of",
]
__version__: str

class PdmpError(Exception):
    """Base class of the errors that do not concern an argument."""

class FitError(PdmpError):
    """Numerical failure of a fit to well-formed demonstrations."""

class ModelFileError(PdmpError):
    """Model file that is damaged, not a model, or of another version."""

@final
class Demonstration:
    """Recorded movement.

    Parameters
    ----------
    position : array_like, (T, D), or Trajectory
        Positions in the unit of each degree of freedom; at least four samples. The columns of a data frame supply
        names, and a trajectory supplies time stamps, names and units, unless they are given.
    dt : float, optional
        Sampling interval in s. Without `dt` and `time`, `fit` needs it.
    time : array_like, (T,), optional
        Strictly increasing time stamps in s, or datetimes of numpy, counted from the first.
    goal : array_like, (D,), optional
        Goal g in the unit of each degree of freedom; by default the last sample.
    context : array_like or list, (Q,), optional
        Numbers and labels that describe the task, such as the height of an obstacle, in any unit.
    names : sequence of str, (D,), optional
        Names of the degrees of freedom, all different.
    units : sequence of str, (D,), optional
        Units of the degrees of freedom, such as "rad" or "m"; "" if unknown.
    rotations : mapping, optional
        First column of each unit quaternion, as an index or a name, and the order of its components: {3: "wxyz"} or
        {3: "xyzw"}. A quaternion rotates from the body frame to the world frame; the other convention is not
        recognised. Norms become 1, and signs continuous along time. `position`, `goal`, `names` and `units` have one element
        per column; a rotation has four columns and three degrees of freedom. The three columns before it, else after it,
        with one unit that is none of an angle are the point of the pose: its components share their noise and range.

    Raises
    ------
    ValueError
        Samples are too few, a number is not finite, times do not increase, or lengths differ.

    Examples
    --------
    >>> s = np.linspace(0.0, 1.0, 61)
    >>> reach = np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), 0.2 * np.sin(np.pi * s) ** 2])
    >>> pdmp.Demonstration(reach, dt=0.02, names=["x", "y"], units=["m", "m"])
    <pdmp.Demonstration: 61 samples x 2 DoFs, dt 0.02 s>
    """
    def __new__(
        cls,
        position: ArrayLike | Trajectory,  # (T, D)
        *,
        dt: float | None = None,
        time: ArrayLike | None = None,  # (T,)
        goal: ArrayLike | None = None,  # (D,)
        context: ArrayLike | Sequence[float | str] | None = None,  # (Q,)
        names: Sequence[str] | None = None,  # D of them
        units: Sequence[str] | None = None,  # D of them
        rotations: Mapping[int, _Order] | Mapping[str, _Order] | None = None,
    ) -> Demonstration: ...
    def __getnewargs_ex__(self) -> tuple[tuple[_Array], dict[str, Any]]: ...
    @property
    def position(self) -> _Array:  # (T, D)
        """Positions (T, D) in the unit of each degree of freedom."""
    @property
    def time(self) -> _Array | None:  # (T,); None while the rate is unknown
        """Times of the samples (T,) in s; None if unknown."""
    @property
    def dt(self) -> float | None:  # None unless given
        """Sampling interval in s; None if not given."""
    @property
    def goal(self) -> _Array | None:
        """Goal g (D,); None if not given."""
    @property
    def context(self) -> _Array | list[float | str] | None:
        """Context (Q,), an array of numbers or a list with labels; None if not given."""
    @property
    def names(self) -> list[str] | None:
        """Names of the degrees of freedom (D,); None if not given."""
    @property
    def units(self) -> list[str] | None:
        """Units of the degrees of freedom (D,); None if not given."""
    @property
    def n_samples(self) -> int:
        """Number of samples T."""
    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom D."""
    @property
    def n_coordinates(self) -> int:
        """Number of coordinates, the columns of `position`: one more than the degrees of freedom for each rotation."""
    @property
    def rotations(self) -> dict[int, _Order]:
        """First column of each unit quaternion, and the order of its components, "wxyz" or "xyzw"."""

def fit(
    demos: _Demos | Sequence[_Demos] | Callable[[], Iterable[_Demos]],  # M of them, or (M, T, D)
    *,
    kind: _Kind = "discrete",
    dt: float | None = None,
    period: ArrayLike | None = None,  # one, or (M,)
    contexts: _Contexts | None = None,  # (M, Q)
    map: _Map = "auto",
    n_styles: int | Literal["auto"] | None = None,
    singular_value_share: float | None = None,
    basis: Literal["gp", "ngnet"] | GP | NGnet = "gp",
    smoothing: Literal["auto"] | float | None = "auto",
    nominal: int | None = None,
    n_samples: int | None = None,
    transport: Literal["learnt", "immediate"] | None = None,
    dof_scale: Literal["unit", "range"] | ArrayLike | None = None,  # (D,)
    rotation_length: float | None = None,
    rotation_frame: Literal["body", "world"] = "body",
    alignment: Literal["linear", "warp"] | TimeWarp = "linear",
    landmarks: ArrayLike | None = None,  # (M, E)
    tau: float | None = None,
    alpha_z: float = 25.0,
    beta_z: float | None = None,
    alpha_x: float | None = None,
    mu: float | None = None,
    threads: int | None = None,
    progress: Callable[[str, float], object] | None = None,  # stage, share in [0, 1]
) -> Model:
    """Fits a movement primitive to demonstrations.

    The four steps of Section 3.2: align the demonstrations to a nominal one, compute the targets f = τẏ − z exactly,
    factorise them, F ≈ S·F_basis (Eq. 7), and regress the attractor landscape on the phase.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (M, T, D), or blocks
        Demonstrations of one skill. A rhythmic one is a single cycle without its end point. Of a mapping, as the
        readers return, the values are used. The columns of data frames name the degrees of freedom. More demonstrations
        than memory holds are passed in blocks: a list of blocks, or a function without arguments that returns an
        iterable of them, the same at each of two to four calls. A block is a list of demonstrations, an array (B, T, D),
        or a function that returns one, as `io.read_blocks` gives for files. Memory then holds one block, a triangular
        factor of C·D columns and a few numbers for each demonstration; the model is the same but for rounding. Contexts
        are then those of the demonstrations; warps, landmarks, rotations and `n_styles="auto"` need all demonstrations
        at once.
    kind : {"discrete", "rhythmic"}
        Movement from a start to a goal, or around an anchor, the default for the result of `preprocessing.cycles`.
    dt : float, optional
        Sampling interval in s of demonstrations without one.
    period : float or array_like, (M,), optional
        Periods in s of time-stamped cycles.
    contexts : array_like, (M, Q) or (M,), or M lists of Q numbers and labels, or mapping, optional
        Contexts of the demonstrations, numbers in any unit; by default those that the demonstrations carry, with
        the names that readers of `pdmp.io` found. The model keeps the names of the columns of a data frame, of
        records, of M mappings, or of a mapping from names to columns (M,).
    map : {"auto", "stacked", "gp", "linear", "polynomial"}
        Map from contexts to style, goal, start and duration. "stacked" weights a Gaussian process and a ridge
        regression by their leave-one-out errors, and the mean too outside the range of the contexts; "gp" is the
        process alone, "linear" least squares as in the paper, "polynomial" ridge regression of second degree. "auto" is
        "stacked"; it is "linear" for labels alone, each of which then has the mean of its demonstrations, for two
        different contexts and for more than 1024. The repr of `model.map` states the weights.
    n_styles : int or "auto", optional
        Style dimension J. By default the number that carries nine tenths of the sum of the singular
        values, at least five (or half of the demonstrations) and those that the contexts explain (F-test), without
        those that measurement noise alone would give (parallel analysis). "auto" applies the one-standard-error rule to
        the error of cross-validation over contexts, in at most ten folds.
    singular_value_share : float, optional
        Share in (0, 1], the paper's rule: J is the smallest number of singular values whose sum exceeds this share of
        the sum of all, for example 0.9.
    basis : {"gp", "ngnet"}, GP or NGnet
        Regression of the landscape.
    smoothing : "auto", float or None
        Smoothing of the positions: by generalised cross-validation over all demonstrations for each degree of freedom,
        which leaves clean ones unchanged; by a cut-off frequency in Hz; or none, so that every sample is interpolated.
        Recordings that do not contradict zero velocity at their start or end are smoothed with it there.
        `model.noise` and `model.cut_offs` hold the result.
    nominal : int, optional
        Index of the nominal demonstration; by default the one of median duration.
    n_samples : int, optional
        Number C of samples after alignment, from 4 to 1e6; by default that of the nominal demonstration, and more if
        that has fewer than 150.
    transport : {"learnt", "immediate"}, optional
        Motion of the frame of a discrete movement from start to goal: by default along the learnt profile of the
        demonstrations (`Model.transport`), or at once as in the paper, where a moved goal shifts the whole path. Past
        its end the movement brakes (`Model.braking`); with "immediate" transport the forcing fades with the phase, as
        in the paper.
    dof_scale : None, "unit", "range" or array_like, (D,)
        Scale of each degree of freedom in the factorisation. "unit" keeps the data as recorded, the default if all
        units are equal or unknown. Otherwise the degrees of freedom of each unit are divided by the largest range among
        them. "range" divides each by its own range. Numbers are divisors in the unit of each degree of freedom, and
        also apply to a time warp.
    rotation_length : float, optional
        Length that weighs as much as 1 rad where positions and rotations are factorised together, in the unit of the
        positions; by default the ratio of the deviations from the mean of the demonstrations, by root mean square.
    rotation_frame : {"body", "world"}
        Frame of the angular velocities and accelerations of a model with rotations.
    alignment : {"linear", "warp"} or TimeWarp
        Scaling of time to that of the nominal demonstration: linear, or by the monotone warps that bring the
        demonstrations closest to each other. A `TimeWarp` is always applied. "warp" has eight segments, fewer if a
        demonstration has fewer than 16 samples; with three or more different contexts it is applied only if it lowers
        the cross-validation error over contexts by more than its standard error, and `model.segment_durations` has one
        column if it is not.
    landmarks : array_like, (M, E), optional
        Times in s of E landmarks in each demonstration, from its first sample or on the clock of its time stamps. They
        are aligned to those of the nominal demonstration, in place of a warp.
    tau : float, optional
        Time constant τ in s of a discrete primitive; by default the nominal duration.
    alpha_z : float
        Rate α_z of the output system, from 1e-6 to 1e6, without unit.
    beta_z : float, optional
        Stiffness β_z of the output system, from 1e-6 to 1e6, without unit; by default `alpha_z / 4` (critical damping).
    alpha_x : float, optional
        Rate α_x of the discrete canonical system, without unit; by default such that x = 0.01 at the end. With
        "immediate" transport the forcing fades with x past the end: if a movement leaves its goal there before it
        settles, `alpha_x = alpha_z` reduces the deviation most.
    mu : float, optional
        Rate μ of the amplitude of a rhythmic primitive, from 1e-6 to 1e6, without unit; 1 by default.
    threads : int, optional
        Largest number of threads; by default all that the system offers. The model does not depend on it.
    progress : callable, optional
        Called as `progress(stage, fraction)` with the name of a stage and its completed fraction. An exception that it
        raises cancels the fit.

    Returns
    -------
    Model

    Warns
    -----
    UserWarning
        Implausible samples, with their positions: outliers, jumps, stuck sensors, dropouts recorded as zeros, padding,
        missing rows, time stamps much closer than the others, counters or time stamps among the columns, wrapped angles,
        angles of different demonstrations whole turns apart (subtracted if units mark them as angles); ranges or a
        duration 15 times those of the other demonstrations; and an `alpha_z` too high for the sampling rate.

    Raises
    ------
    ValueError
        Demonstrations or options are invalid or do not fit together.
    FitError
        The numerical problem of well-formed demonstrations has no solution.
    MemoryError
        The targets do not fit into memory.

    References
    ----------
    Matsubara, Hyon, Morimoto, Neural Networks 24 (2011), https://doi.org/10.1016/j.neunet.2011.02.004

    Examples
    --------
    >>> s = np.linspace(0.0, 1.0, 61)
    >>> reach = s**3 * (10 - 15 * s + 6 * s**2)
    >>> demos = [np.column_stack([reach, height * np.sin(np.pi * s) ** 2]) for height in (0.1, 0.2, 0.3)]
    >>> fitted = pdmp.fit(demos, dt=0.02, contexts=[[0.1], [0.2], [0.3]], n_styles=1)
    >>> fitted.n_demos, fitted.n_dofs, fitted.n_styles
    (3, 2, 1)
    """

def context_rows(contexts: Any) -> list[list[float | str]]:
    """Converts contexts of M demonstrations as `fit` does.

    Parameters
    ----------
    contexts : array_like, (M, Q) or (M,), or M lists of Q numbers and labels, or mapping
        Contexts of the demonstrations.

    Returns
    -------
    list of list of float or str
        Q numbers and labels of each demonstration.

    Raises
    ------
    ValueError
        Another shape, or columns of different lengths.
    TypeError
        A value that is neither a number nor a text.
    """

def inspected(
    demos: Sequence[Demonstration], *, dt: float | None = None
) -> tuple[list[Demonstration], list[str]]:
    """Inspects demonstrations as `fit` does.

    Parameters
    ----------
    demos : list of Demonstration
        Demonstrations of one skill.
    dt : float, optional
        Sampling interval in s of demonstrations without one.

    Returns
    -------
    demos : list of Demonstration
        The demonstrations as `fit` learns from them, without whole turns between their angles.
    findings : list of str
        Descriptions of implausible samples, with their positions.

    Raises
    ------
    ValueError
        `dt` is not a number.
    """

def factorise(
    targets: ArrayLike,  # (M, C*D)
    *,
    n_styles: int | None = None,
    singular_value_share: float = 0.9,
) -> Factors:
    """Factorises stacked targets by a truncated singular value decomposition (step 3 of Section 3.2).

    F = UΣVᵀ; S is the first J columns of U and F_basis the first J rows of ΣVᵀ, the best approximation of F of rank J.
    `fit` factorises its targets so. A few factors of many demonstrations are computed by Krylov iteration, others from
    the Gram matrix or by Householder reflections, depending on J, the shape and the singular values.

    Parameters
    ----------
    targets : array_like, (M, C·D)
        Targets F, one row per demonstration, in any unit.
    n_styles : int, optional
        Number J of factors, at most min(M, C·D). By default `singular_value_share` decides.
    singular_value_share : float
        Share in (0, 1]: J is the smallest number of singular values whose sum exceeds this share of the sum of all.

    Returns
    -------
    Factors
        Residuals ‖F·v − σ·u‖ are at most 1e-11 times the largest singular value.

    Raises
    ------
    ValueError
        `n_styles` or `singular_value_share` is out of range, or `targets` is empty or not finite.

    References
    ----------
    Eckart and Young, Psychometrika 1 (1936), https://doi.org/10.1007/BF02288367
    """

def load(path: str | PathLike[str]) -> Model:
    """Reads a model file.

    Parameters
    ----------
    path : path-like
        A `.safetensors` file that `Model.save` wrote. Files of unknown origin are safe to load: a file contains no code
        and no reference to other files, needs memory and time in proportion to its size, and generates finite numbers
        or an error. The checksum detects damage, not intent: the author of a file decides its movements and texts.

    Returns
    -------
    Model

    Raises
    ------
    OSError
        The file cannot be read.
    ModelFileError
        The file is damaged, not a model, or of another version.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
    >>> model.save(path)
    >>> loaded = pdmp.load(path)
    >>> np.array_equal(loaded.styles, model.styles)
    True
    """

def resample(demo: Demonstration, dt: float) -> Demonstration:
    """Resamples a recording at even intervals.

    The samples are at t₀, t₀ + dt, … up to the end of the recording; the returned clock starts at 0. On a grid no
    denser than the recording, samples are those of the cubic smoothing spline of generalised cross-validation plus the
    residuals of the nearest recorded samples: noise stays white, so that a fit can still smooth it. A denser grid
    samples the spline through all samples. Remove frequencies above 1/(2 dt) with `lowpass` first.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    dt : float
        Sampling interval in s.

    Returns
    -------
    Demonstration
        Recording with the same names, units, context and goal.

    Raises
    ------
    ValueError
        `dt` is not positive or leaves fewer than four samples, or the recording has no times.
    """

def trim(demo: Demonstration, threshold: float = 0.05) -> Demonstration:
    """Trims the rests before and after the movement of a recording.

    The movement extends from the first to the last sample with a speed of at least `threshold` times the peak speed,
    where v² = Σ_d (ẏ_d / (max y_d − min y_d))² of the smoothed recording (generalised cross-validation). If noise
    exceeds the threshold, only stretches above the threshold that also exceed the noise count. The samples remain as
    recorded.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    threshold : float
        Share of the peak speed, in (0, 1).

    Returns
    -------
    Demonstration
        Recording with the same names, units, context, goal and time stamps.

    Raises
    ------
    ValueError
        `threshold` is out of range, or the recording has no movement, fewer than four samples of it, or no times.
    """

def split_at(demo: Demonstration, times: ArrayLike) -> list[Demonstration]:  # one fewer than times
    """Cuts a recording at given times.

    Each part extends from one time to the next, both included. It is sampled evenly, at most as densely as the
    recording. As with `resample`, noise stays white.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    times : array_like, (K,)
        Two or more increasing times in s on the clock of the recording.

    Returns
    -------
    list of Demonstration
        K − 1 parts with the same names, units and context.

    Raises
    ------
    ValueError
        `times` do not increase or lie outside the recording, a part is shorter than three sampling intervals, or the
        recording has no times.
    """

def lowpass(demo: Demonstration, cut_off: float) -> Demonstration:
    """Filters a recording with a low-pass of zero phase.

    The filter is the cubic smoothing spline, with gain 1/(1 + (f/f_c)⁴) at frequency f: one half at the cut-off f_c.
    `pdmp.plot.cut_off` plots residuals over the cut-off.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`, even or not.
    cut_off : float
        Cut-off frequency in Hz.

    Returns
    -------
    Demonstration
        Recording at the same times, with the same names, units, context and goal.

    Raises
    ------
    ValueError
        `cut_off` is not between a ten-thousandth and half of the sampling rate, or the recording has no times.

    References
    ----------
    C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967), https://doi.org/10.1007/BF02162161
    """

def residuals(demo: Demonstration, cut_offs: ArrayLike) -> _Array:  # (K, D)
    """Computes the residuals of `lowpass` over its cut-off.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    cut_offs : array_like, (K,)
        Cut-off frequencies in Hz.

    Returns
    -------
    ndarray, (K, D)
        Root mean square of the residual, in the unit of each degree of freedom.

    Raises
    ------
    ValueError
        A cut-off that `lowpass` rejects, or a recording without times.
    """

def turn_of(unit: str) -> float | None:
    """Returns a full turn in a unit of angles, "rad", "deg", "°" or their names, and None for other units.

    Parameters
    ----------
    unit : str
        Unit of a degree of freedom.

    Raises
    ------
    TypeError
        `unit` is not a string.
    """

def period(demo: Demonstration) -> float:
    """Estimates the period of a cyclic recording by autocorrelation.

    A(k) is the mean autocorrelation at lag k of the positions and velocities of all degrees of freedom, after removal
    of linear trends. The period is the first peak of A that equals the highest peak within the variation between
    cycles, at the vertex of the parabola through three samples; peaks at half a cycle and at periods of harmonics are
    lower. A peak must exceed the significance level for noise of the same autocorrelation, which rises as fewer
    independent samples overlap.

    Parameters
    ----------
    demo : Demonstration
        A recording of one and a half cycles or more, with `dt` or `time`.

    Returns
    -------
    float
        Period in s.

    Raises
    ------
    ValueError
        All peaks are below 0.35 or not significant, or the recording has no movement or no times.

    References
    ----------
    P. McLeod, G. Wyvill, A smarter way to find pitch, International Computer Music Conference 2005
    """

def fill_gaps(
    position: ArrayLike,  # (T, D)
    time: ArrayLike,  # (T,)
    names: Sequence[str],  # D of them
    turns: Sequence[float],  # D of them; 0 where no angle
    max_gap: float,
) -> _Array:  # (T, D)
    """Interpolates missing samples.

    Parameters
    ----------
    position : array_like, (T, D)
        Positions in the unit of each degree of freedom, NaN where missing.
    time : array_like, (T,)
        Time stamps in s.
    names : sequence of str, (D,)
        Names of the degrees of freedom.
    turns : array_like, (D,)
        Full turn of each angle in its unit, 0 for other units, NaN if the unit is unknown.
    max_gap : float
        Longest gap in s that is interpolated.

    Returns
    -------
    ndarray, (T, D)
        Positions without missing samples.

    Raises
    ------
    ValueError
        A gap is longer than `max_gap`, or lies at an end; or time stamps are further apart than a
        positive `max_gap` and than five usual intervals.
    """

def cycles(
    recordings: _Demos,
    onsets: Sequence[ArrayLike] | None,  # one (K,) for each recording
    average: bool,
) -> tuple[
    list[Demonstration],
    _Array,  # (K,)
    list[list[float]],  # (K, D)
    list[int],
    list[tuple[int, float, float, str, bool]],
    list[tuple[int, int, float, int]],
]:
    """Cuts recordings into cycles, for `pdmp.preprocessing.cycles`.

    Parameters
    ----------
    recordings : sequence of Demonstration
        Recordings with `dt` or `time`.
    onsets : list of array_like, (K,), or None
        Times in s at which the cycles of each recording begin; the last ends the last cycle.
    average : bool
        Return one mean cycle of each recording.

    Returns
    -------
    tuple
        Cycles, their periods (K,) in s, their gains (K, D) in the unit of each degree of freedom, the indices of their
        recordings, the rejected cycles and the growths.

    Raises
    ------
    ValueError
        Recordings without a period or without times, or invalid onsets.
    """

@final
class PartialFit:
    """Partial fit of a growing collection of demonstrations, which blocks and other partial fits are added to.

    Its size is that of a factor R with RᵀR = FᵀF for the targets F (M, C·D) of the demonstrations, with a row for each of the
    dimensions in which they vary, and of a few numbers for each demonstration. The order in which parts are merged matters to rounding only. `finish` reads the blocks
    once more, for their styles.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
        First block. Number of samples, cut-offs of smoothing and, with `tau`, the nominal duration are chosen from it,
        and hold for all others.
    kind, dt, period, smoothing, n_samples, dof_scale, tau, alpha_z, beta_z, alpha_x, mu, threads
        As for `fit`; `period` is one number.

    Raises
    ------
    ValueError
        The demonstrations or options are invalid, or have rotations.

    References
    ----------
    Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206–A239, https://doi.org/10.1137/080731992

    Examples
    --------
    >>> s = np.linspace(0.0, 1.0, 161)
    >>> def reach(height):
    ...     return np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), height * np.sin(np.pi * s) ** 2])
    >>> blocks = [[reach(0.1), reach(0.2)], [reach(0.3)]]
    >>> partial = pdmp.PartialFit(blocks[0], dt=0.01)
    >>> other = partial.empty()
    >>> other.update(blocks[1])
    >>> partial.merge(other)
    >>> partial.n_demos
    3
    >>> whole = pdmp.fit([demo for block in blocks for demo in block], dt=0.01)
    >>> np.allclose(partial.finish(blocks).styles, whole.styles, rtol=0.0, atol=1e-10)
    True
    """
    def __new__(
        cls,
        demos: _Demos,
        *,
        kind: _Kind = "discrete",
        dt: float | None = None,
        period: float | None = None,
        smoothing: Literal["auto"] | float | None = "auto",
        n_samples: int | None = None,
        dof_scale: Literal["unit", "range"] | ArrayLike | None = None,  # (D,)
        tau: float | None = None,
        alpha_z: float = 25.0,
        beta_z: float | None = None,
        alpha_x: float | None = None,
        mu: float | None = None,
        threads: int | None = None,
    ) -> PartialFit: ...
    @property
    def n_demos(self) -> int:
        """Number of demonstrations M so far."""
    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom D."""
    @property
    def n_samples(self) -> int:
        """Number of samples C of the aligned demonstrations."""
    @property
    def kind(self) -> _Kind:
        """Kind of the movements, "discrete" or "rhythmic"."""
    def empty(self) -> PartialFit:
        """Returns a partial fit of no demonstration with the same settings, for blocks that are added elsewhere."""
    def update(self, demos: _Demos) -> None:
        """Adds a block of demonstrations.

        Parameters
        ----------
        demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
            Further demonstrations of the skill.

        Raises
        ------
        ValueError
            The demonstrations are invalid or do not match the others; none is added then.
        """
    def merge(self, other: PartialFit) -> None:
        """Adds the demonstrations of another partial fit after those of this one.

        Parameters
        ----------
        other : PartialFit
            Made with `empty` of this one or of a common one.

        Raises
        ------
        ValueError
            `other` has other settings, or is this partial fit.
        """
    def factorise(
        self,
        *,
        map: _Map = "auto",
        n_styles: int | None = None,
        singular_value_share: float | None = None,
        basis: Literal["gp", "ngnet"] | GP | NGnet = "gp",
        nominal: int | None = None,
        transport: Literal["learnt", "immediate"] | None = None,
        dof_scale: Literal["unit", "range"] | ArrayLike | None = None,  # (D,)
        threads: int | None = None,
    ) -> FactorisedFit:
        """Factorises the targets, and returns what a second pass over the blocks needs.

        Parameters
        ----------
        map, n_styles, singular_value_share, basis, nominal, transport, dof_scale, threads
            As for `fit`; `n_styles` is a number.

        Returns
        -------
        FactorisedFit

        Raises
        ------
        ValueError
            An option is invalid, or there is no demonstration.
        """
    def finish(
        self,
        blocks: Iterable[_Demos] | Callable[[], Iterable[_Demos]],
        *,
        map: _Map = "auto",
        n_styles: int | None = None,
        singular_value_share: float | None = None,
        basis: Literal["gp", "ngnet"] | GP | NGnet = "gp",
        nominal: int | None = None,
        transport: Literal["learnt", "immediate"] | None = None,
        dof_scale: Literal["unit", "range"] | ArrayLike | None = None,  # (D,)
        threads: int | None = None,
    ) -> Model:
        """Fits a model to the demonstrations so far, whose blocks are read once more.

        Parameters
        ----------
        blocks : iterable of blocks, or function that returns one
            The demonstrations so far, in the same order, in any blocks.
        map, n_styles, singular_value_share, basis, nominal, transport, dof_scale, threads
            As for `fit`; `n_styles` is a number.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            An option is invalid, there is no demonstration, or the blocks are others.
        """
    def save(self, path: str | PathLike[str]) -> None:
        """Writes a file, atomically.

        Parameters
        ----------
        path : path-like

        Raises
        ------
        OSError
            The file cannot be written, or its folder does not exist.

        Examples
        --------
        >>> import tempfile, pathlib
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "collection.safetensors"
        >>> partial = pdmp.PartialFit([np.sin(np.linspace(0.0, 3.0, 200))[:, None]], dt=0.01)
        >>> partial.save(path)
        >>> pdmp.PartialFit.load(path).n_demos
        1
        """
    @staticmethod
    def load(path: str | PathLike[str]) -> PartialFit:
        """Reads a file that `save` wrote.

        Parameters
        ----------
        path : path-like

        Returns
        -------
        PartialFit

        Raises
        ------
        OSError
            The file cannot be read.
        ModelFileError
            The file is damaged, not a partial fit, or of another version.
        """
    def to_bytes(self) -> bytes:
        """Returns the contents of a file as bytes."""
    @staticmethod
    def from_bytes(data: bytes) -> PartialFit:
        """Reads a partial fit from the contents of a file.

        Parameters
        ----------
        data : bytes
            Result of `to_bytes`.

        Returns
        -------
        PartialFit

        Raises
        ------
        ModelFileError
            The data are damaged, not a partial fit, or of another version.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class FactorisedFit:
    """Factorised targets of a `PartialFit`, which await the styles of its demonstrations.

    Examples
    --------
    >>> blocks = [[np.sin(np.linspace(0.0, k, 160))[:, None] for k in (1.0, 2.0)], [np.linspace(0.0, 1.0, 160)[:, None]]]
    >>> partial = pdmp.PartialFit(blocks[0], dt=0.01)
    >>> partial.update(blocks[1])
    >>> factorised = partial.factorise(n_styles=2)
    >>> projection = factorised.projection
    >>> parts = [projection.styles(blocks[1], 2), projection.styles(blocks[0], 0)]  # on any machine, in any order
    >>> factorised.finish(parts).styles.shape
    (3, 2)
    """
    @property
    def n_styles(self) -> int:
        """Number of styles J."""
    @property
    def projection(self) -> StyleProjection:
        """Projection of blocks to their styles, which can be sent to other processes."""
    def finish(self, styles: Iterable[BlockStyles]) -> Model:
        """Returns the model, given the styles of all blocks in any order.

        Parameters
        ----------
        styles : list of BlockStyles
            Results of `projection.styles`, each demonstration in one of them.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            Demonstrations are missing, repeated or others than those of the partial fit.
        """

@final
class StyleProjection:
    """Projection of demonstrations to their styles."""
    def styles(self, demos: _Demos, first: int) -> BlockStyles:
        """Computes the styles of a block.

        Parameters
        ----------
        demos : sequence or mapping of Demonstration, Trajectory or array_like (T, D), or array_like (B, T, D)
            Demonstrations of the partial fit that follow each other.
        first : int
            Index of the first of them among all, from 0.

        Returns
        -------
        BlockStyles

        Raises
        ------
        ValueError
            The demonstrations do not match those of the partial fit.
        """
    def to_bytes(self) -> bytes:
        """Returns the projection as bytes."""
    @staticmethod
    def from_bytes(data: bytes) -> StyleProjection:
        """Reads a projection from bytes.

        Parameters
        ----------
        data : bytes
            Result of `to_bytes`.

        Raises
        ------
        ModelFileError
            The data are damaged, of another type or of another version.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class BlockStyles:
    """Styles of a block of demonstrations."""
    @property
    def styles(self) -> _Array:  # (B, J)
        """Styles (B, J); `FactorisedFit.finish` may change their signs."""
    def to_bytes(self) -> bytes:
        """Returns the styles as bytes."""
    @staticmethod
    def from_bytes(data: bytes) -> BlockStyles:
        """Reads styles from bytes.

        Parameters
        ----------
        data : bytes
            Result of `to_bytes`.

        Raises
        ------
        ModelFileError
            The data are damaged, of another type or of another version.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Model:
    """Parametric dynamic movement primitive, returned by `fit` and `load`.

    Models are immutable, their arrays are read-only copies, and they can be pickled.
    """
    @property
    def kind(self) -> _Kind:
        """Kind of the primitive, "discrete" or "rhythmic"."""
    @property
    def n_demos(self) -> int:
        """Number of demonstrations M."""
    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom D."""
    @property
    def n_coordinates(self) -> int:
        """Number of coordinates, the length of positions, goals and starts: one more than the degrees of freedom for each
        rotation.
        """
    @property
    def coordinate_names(self) -> list[str]:
        """Names of the coordinates."""
    @property
    def coordinate_units(self) -> list[str]:
        """Units of the coordinates; an unknown unit is ""."""
    @property
    def rotations(self) -> dict[int, _Order]:
        """First column of each unit quaternion in positions, and the order of its components, "wxyz" or "xyzw"."""
    @property
    def rotation_frame(self) -> Literal["body", "world"] | None:
        """Frame of angular velocities and accelerations, "body" or "world"; None without rotations."""
    @property
    def n_styles(self) -> int:
        """Style dimension J."""
    @property
    def tau(self) -> float:
        """Time constant τ of the nominal demonstration in s: its duration if discrete, its period over 2π if rhythmic."""
    @property
    def alpha_z(self) -> float:
        """Rate α_z of the output system, without unit."""
    @property
    def beta_z(self) -> float:
        """Stiffness β_z of the output system, without unit."""
    @property
    def alpha_x(self) -> float | None:  # None if rhythmic
        """Rate α_x of the discrete canonical system, without unit; None if rhythmic."""
    @property
    def braking(self) -> float | None:  # None if rhythmic or transport is immediate
        """Braking rate of a discrete movement past its end, per unit of the clock.

        None if the primitive is rhythmic, or if transport is immediate, so that the forcing fades with the phase.
        """
    @property
    def mu(self) -> float | None:  # None if discrete
        """Rate μ of the amplitude, without unit; None if discrete."""
    @property
    def names(self) -> list[str]:
        """Names of the degrees of freedom (D,)."""
    @property
    def units(self) -> list[str]:  # "" where unknown
        """Units of the degrees of freedom (D,); "" if unknown."""
    @property
    def nominal(self) -> int:
        """Index of the nominal demonstration."""
    @property
    def styles(self) -> _Array:  # (M, J)
        """Styles S (M, J) of the demonstrations, without unit."""
    @property
    def singular_values(self) -> _Array:  # decreasing: all, or of a large library the first J
        """Singular values of the targets in decreasing order.

        All min(M, C·D), or the first J if a small `n_styles` was given and the others were not computed.
        """
    @property
    def truncation_error(
        self,
    ) -> float:  # share of the targets, by RMS, that J styles leave out
        """Truncation error ‖F − S·F_basis‖/‖F‖ of the targets F in the Frobenius norm."""
    @property
    def noise(self) -> _Array:  # (D,), standard deviation
        """Standard deviation (D,) of the measurement noise in the unit of each degree of freedom, by generalised
        cross-validation.

        0 if no noise was found, or with `smoothing=None`.
        """
    @property
    def cut_offs(self) -> _Array:  # (D,), Hz, inf where nothing is smoothed
        """Cut-off frequencies (D,) of the smoothing in Hz, at a gain of one half; inf without smoothing."""
    @property
    def dof_scale(self) -> _Array:  # (D,)
        """Scale (D,) of each degree of freedom in the factorisation, in its unit."""
    @property
    def goals(self) -> _Array:  # (M, D)
        """Goals (M, D) of the demonstrations in the unit of each degree of freedom."""
    @property
    def starts(self) -> _Array:  # (M, D)
        """First positions (M, D) of the demonstrations in the unit of each degree of freedom."""
    @property
    def anchors(self) -> _Array:  # (M, D)
        """Mean positions (M, D) of the demonstrations, the anchors of cycles, in the unit of each degree of freedom."""
    @property
    def breaks(self) -> _Array:  # (K+1,), K = 1 where time is scaled linearly
        """Bounds (K+1,) of the segments as shares of the movement, from 0 to 1; K = 1 with linear scaling of time."""
    @property
    def segment_durations(self) -> _Array:  # (M, K)
        """Time (M, K) in s of each demonstration in each segment between `breaks`."""
    @property
    def duration(self) -> float:
        """Duration of the nominal demonstration in s if discrete, its period if rhythmic."""
    @property
    def durations(self) -> _Array:  # (M,)
        """Durations or periods (M,) of the demonstrations in s, the sums of their segment durations."""
    @property
    def contexts(self) -> _Array | list[list[float | str]] | None:  # (M, Q)
        """Contexts (M, Q) of the demonstrations, an array of numbers or lists with labels; None without contexts."""
    @property
    def context_names(self) -> list[str] | None:
        """Names (Q,) of the context columns; None where the contexts had none."""
    @property
    def map(self) -> ContextMap | None:
        """Map from contexts to style, goal, start or anchor, and duration; None without contexts."""
    @property
    def regression(self) -> str:  # what was chosen, in one line
        """Description of the regression of the landscape."""
    @property
    def table_error(self) -> float:  # estimated error of the compiled landscape
        """Estimated interpolation error of the tabulated landscape, relative to its largest value."""
    def rollout(
        self,
        conditions: Conditions | None = None,
        *,
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | None = None,  # (Q,)
        **changes: Unpack[_Changes],
    ) -> Trajectory:
        """Computes the movement under constant conditions.

        Integrates τż = α_z(β_z(c − y) − z), τẏ = z + w about the frame c exactly, with the forcing term w = x·sᵀb
        (discrete) or w = r·sᵀb (rhythmic). Conditions that are absent are those of the nominal demonstration.

        Parameters
        ----------
        conditions : Conditions, optional
            Conditions at the start.
        dt : float
            Interval between samples in s.
        duration : float, optional
            Length in s. By default the demonstrated duration scaled by `tau`, the sum of `segment_durations`, or one
            period of a rhythmic movement.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions: style, goal, start or anchor, and duration.
        **changes
            Single conditions by name, which replace those of `conditions`; see `Conditions`. A mapping or a row of a data
            frame whose elements have the names of the degrees of freedom may have them in any order.

        Returns
        -------
        Trajectory
            n + 1 samples, where n is duration / dt rounded down.

        Raises
        ------
        ValueError
            A length is wrong, a number is not finite, or a condition belongs to the other kind of primitive.
        TypeError
            A keyword is unknown, or `conditions` has another type.

        Warns
        -----
        UserWarning
            The context lies outside the demonstrated ones by more than a tenth of their range, or `dt` is longer than the
            movement.

        Examples
        --------
        >>> trajectory = model.rollout(goal=[1.1, 0.0], tau=2.0, dt=0.001)
        >>> trajectory.position.shape
        (2001, 2)
        >>> np.allclose(trajectory.position[-1], [1.1, 0.0], atol=1e-3)
        True
        """
    def conditions(self, demos: int | Sequence[int]) -> Conditions:
        """Returns the conditions of one demonstration, or the mean of several.

        Parameters
        ----------
        demos : int or sequence of int
            Indices of demonstrations, from 0 to M - 1.

        Returns
        -------
        Conditions
            Style, goal and start or anchor, and segment durations.

        Raises
        ------
        ValueError
            `demos` is empty, not a whole number, or out of range.

        Examples
        --------
        >>> trajectory = model.rollout(model.conditions(2))
        >>> np.allclose(trajectory.position[0], model.starts[2])
        True
        """
    def rollouts(
        self,
        conditions: Conditions | Sequence[Conditions] | None = None,
        *,
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | _Contexts | None = None,
        derivatives: int = 1,  # at most 2
        out: Sequence[_Array] | None = None,
        threads: int | None = None,
        **changes: Unpack[_RowChanges],  # vectors (n,) or (B, n)
    ) -> tuple[_Array, ...]:  # position and its `derivatives`, each (B, T, D)
        """Computes the movements of many conditions.

        A movement under constant conditions is linear in them, so that a batch is one product of coefficients with
        response curves. The model caches these for a few recent (dt, tau, duration). Results equal those of `rollout`
        to rounding.

        Movements that differ in tau, follow `segment_durations`, or start at a `phase` have no response curves in
        common: each then costs a rollout, which it equals to the bit. All are sampled at the same times. Without
        `duration`, these reach to the end of the longest movement; the others continue past their end as in `rollout`,
        discrete ones at rest on their goal.

        Parameters
        ----------
        conditions : Conditions, or B Conditions, optional
            Conditions of all movements, or of each.
        context : array_like or list, (Q,) or (B, Q), optional
            Context of all movements, or of each, whose prediction supplies absent conditions, durations included. One
            `tau` for all keeps the response curves.
        dt : float
            Interval between samples in s.
        duration : float, optional
            Length of all movements in s, as in `rollout`.
        derivatives : int
            Order of the highest derivative to return: 0 for positions, 1 for velocities too, 2 for accelerations too.
        out : tuple of ndarray, (B, T, D), optional
            Writable float64 arrays for the results, one per order of derivative.
        threads : int, optional
            Largest number of threads; by default all that the system offers. Results do not depend on it.
        **changes
            Single conditions by name, which replace those of `conditions`; see `Conditions`. All may have a leading axis
            with one entry for each of B movements: vectors (B, n), and tau, amplitude and phase (B,).

        Returns
        -------
        tuple of ndarray, (B, T, D)
            Positions in the unit of each degree of freedom, velocities per s, accelerations per s².

        Raises
        ------
        ValueError
            An argument has a wrong shape, is not finite, belongs to the other kind of primitive, or `out` does not fit;
            leading axes differ. Nothing is written then.
        TypeError
            A keyword is unknown, or `conditions` has another type.
        MemoryError
            The results do not fit into memory; use `rollout_chunks`.

        Examples
        --------
        >>> positions, velocities = model.rollouts(style=model.styles, goal=model.goals, dt=0.1)
        >>> positions.shape
        (5, 13, 2)
        >>> at_own_pace, _ = model.rollouts(style=model.styles, tau=[0.6, 0.8, 1.0, 1.2, 1.4], dt=0.1)
        """
    def rollouts_vjp(
        self,
        wrt: _Variable | Sequence[_Variable],
        cotangents: ArrayLike | tuple[ArrayLike, ...],  # each (B, T, D)
        conditions: Conditions | Sequence[Conditions] | None = None,
        *,
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | _Contexts | None = None,
        threads: int | None = None,
        **changes: Unpack[_RowChanges],  # vectors (n,) or (B, n)
    ) -> tuple[_Array, ...]:  # each (B, n) or (B,)
        """Computes the gradients of a function of many movements with respect to their conditions.

        For a function L of the results of `rollouts`, with the cotangents v = ∂L/∂y, returns the vector-Jacobian products
        ∂L/∂x = Σ_t v(t)·∂y(t)/∂x of the conditions x. A movement is linear in all conditions but tau, so that the products
        are exact; no Jacobian is formed, and a call takes about as long as `rollouts`, also of movements that differ in tau,
        phase or segment durations. With respect to tau, they hold at fixed times, for accelerations as in `jacobian`.
        `pdmp.autodiff` wraps both calls for torch and jax.

        In a model with rotations, the gradient by a unit quaternion q of a goal, anchor or start is that of L as a function of
        q/|q|, orthogonal to q, and the part of a cotangent along its quaternion has no effect. Velocities are angular
        velocities in the frame of the model.

        Parameters
        ----------
        wrt : str or sequence of str
            Conditions x: "style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude" or "tau".
        cotangents : array_like, (B, T, D), or tuple of array_like
            ∂L/∂y of the positions, or of positions, velocities and accelerations as far as L depends on them, of the shapes
            that `rollouts` returns: with rotations, positions have a column for each coordinate.
        conditions : Conditions, or B Conditions, optional
            As in `rollouts`.
        context : array_like or list, (Q,) or (B, Q), optional
            As in `rollouts`.
        dt, duration : float, optional
            As in `rollouts`.
        threads : int, optional
            As in `rollouts`.
        **changes
            As in `rollouts`.

        Returns
        -------
        tuple of ndarray
            ∂L/∂x in the order of `wrt`, of the shape of B of these conditions: (B, J) for the style, (B,) for amplitude and
            tau, else (B, D). Row b is the gradient by the condition of movement b; the gradient by a condition that all share
            is the sum of the rows.

        Raises
        ------
        ValueError
            An argument that `rollouts` rejects; cotangents of another shape, or not finite; a condition of the other kind of
            primitive; a velocity or start of which there is none to differentiate by; or tau with `segment_durations`, which
            are given in place of it, or with accelerations of a model with rotations.
        TypeError
            As in `rollouts`.

        Examples
        --------
        >>> goals = model.goals + 0.1
        >>> (positions,) = model.rollouts(goal=goals, style=model.styles, dt=0.1, derivatives=0)
        >>> loss, cotangents = 0.5 * (positions**2).sum(), positions
        >>> by_style, by_goal = model.rollouts_vjp(
        ...     ["style", "goal"], cotangents, goal=goals, style=model.styles, dt=0.1
        ... )
        >>> by_style.shape, by_goal.shape
        ((5, 2), (5, 2))
        """
    def rollout_chunks(
        self,
        conditions: Conditions | Sequence[Conditions] | None = None,
        *,
        size: int = 1000,
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | _Contexts | None = None,
        derivatives: int = 1,
        threads: int | None = None,
        **changes: Unpack[_RowChanges],
    ) -> RolloutChunks:
        """Computes the movements of many conditions in chunks.

        Memory holds one chunk at a time. Results equal those of `rollouts` bit for bit. This call checks all arguments.

        Parameters
        ----------
        conditions : Conditions, or B Conditions, optional
            As in `rollouts`.
        size : int
            Number of movements in a chunk; the last may have fewer.
        context : array_like or list, (Q,) or (B, Q), optional
            As in `rollouts`.
        dt, duration : float, optional
            As in `rollouts`.
        derivatives, threads : int, optional
            As in `rollouts`.
        **changes
            As in `rollouts`.

        Returns
        -------
        RolloutChunks
            Iterator over the results of `rollouts` for each chunk, with arrays (size, T, D).

        Raises
        ------
        ValueError
            An argument that `rollouts` rejects, or a `size` below 1.
        TypeError
            As in `rollouts`.

        Examples
        --------
        >>> cost = []
        >>> for positions, velocities in model.rollout_chunks(style=model.styles, size=2):
        ...     cost.extend((velocities**2).sum(axis=(1, 2)))
        >>> len(cost) == model.n_demos
        True
        """
    def feasible(
        self,
        limits: Limits,
        conditions: Conditions | None = None,
        *,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Margins:
        """Compares the whole movement under constant conditions with limits.

        Of a rotation, the sizes of angular velocity and acceleration count, under the index of its first degree of freedom.

        A discrete movement counts from its start until it rests past its end, a rhythmic one over a period, and from a given
        start until it has reached its cycle.

        Parameters
        ----------
        limits : Limits
            Limits of position, velocity and acceleration; those of the jerk do not count.
        conditions : Conditions, optional
            Conditions at the start.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        Margins
            Largest ratios of the movement to its limits.

        Raises
        ------
        ValueError
            `rollout` rejects the conditions, or a limit has a wrong length.
        TypeError
            A keyword is unknown, or `conditions` or `limits` has another type.

        Examples
        --------
        >>> margins = model.feasible(pdmp.Limits(velocity=0.5))
        >>> margins.feasible
        False
        >>> ratio, dof, time = margins.velocity
        >>> bool(np.isclose(ratio * 0.5, abs(model.rollout(dt=0.001).velocity).max(), rtol=1e-3))
        True
        """
    def nearest_feasible(
        self,
        limits: Limits,
        conditions: Conditions | None = None,
        *,
        vary: Literal["both", "style", "goal"] = "both",
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Conditions:
        """Computes the conditions nearest to the requested ones whose movement keeps limits.

        Start, tau and the other conditions remain, so that the movement is affine in style s and goal g, or anchor of a
        rhythmic movement. The change (Δs, Δg) minimises Δsᵀ Σ_s⁻¹ Δs + Δgᵀ Σ_g⁻¹ Δg, with the covariances of the
        demonstrations plus squares of a tenth of the range of styles and positions, subject to the limits over the whole
        movement: a quadratic program. With `context`, the covariance is that of style and goal together in the prediction,
        plus squares of a hundredth of the standard deviations above: what the context determines changes least. The sizes of
        angular velocities and accelerations are linearised: within limits of rotations the conditions are the nearest ones up to
        their curvature.

        Parameters
        ----------
        limits : Limits
            Limits of position, velocity and acceleration; those of the jerk do not count.
        conditions : Conditions, optional
            Requested conditions.
        vary : {"both", "style", "goal"}
            Conditions that change; "goal" is the anchor of a rhythmic movement.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions, and the covariance.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        Conditions
            Requested conditions with another style, goal or anchor; unchanged if they keep the limits.

        Raises
        ------
        ValueError
            `rollout` rejects the conditions, a limit has a wrong length, or no change of the varied conditions keeps the
            limits.
        TypeError
            A keyword is unknown, or `conditions` or `limits` has another type.

        Examples
        --------
        >>> limits = pdmp.Limits(velocity=1.5)
        >>> near = model.nearest_feasible(limits)
        >>> model.feasible(limits).feasible, model.feasible(limits, near).feasible
        (False, True)

        References
        ----------
        Kelley, Journal of the Society for Industrial and Applied Mathematics 8(4), 1960, doi:10.1137/0108053.
        """
    def through(
        self,
        points: ViaPoint | Sequence[ViaPoint],
        conditions: Conditions | None = None,
        *,
        from_phase: float | None = None,
        deviation: float | None = None,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Passage:
        """Computes the most probable movement through points.

        A movement of the demonstrators is y(u) = Phi(u) theta + delta(u), with style, goal and start theta, or style and
        anchor, as scattered as those of the demonstrations, and a residual delta of zero mean with a Matérn-5/2 covariance. The
        result is the mean given the points: conditions, and the residual as additional forcing. Points without tolerance are
        passed to 1e-9 of the range; a rhythmic movement passes them on its limit cycle, in every period. A warning says that
        the points are far from the demonstrations.

        Parameters
        ----------
        points : ViaPoint, or sequence of ViaPoint
            Points, with at most 500 positions and velocities.
        conditions : Conditions, optional
            Conditions that remain. The others follow from the demonstrations, or from the context.
        from_phase : float, optional
            Phase from which on a movement under way under `conditions` departs from them, such as `Controller.phase`. All
            conditions then remain, and the additional forcing alone leads the movement through the points.
        deviation : float, optional
            Standard deviation of delta relative to the ranges, 0.03 by default. With 0 the conditions carry all that they can,
            and the additional forcing the least; larger ones bend the movement near the points alone.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies mean and covariance of the conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        Passage
            Conditions for `rollout` and `controller`, and the distance of the points from the demonstrations.

        Raises
        ------
        ValueError
            There is no point, or one outside of the movement, at a fixed end or before `from_phase`; a length is wrong; a
            number is not finite; a rotation has a velocity without an orientation; a tolerance or `deviation` is negative; or
            points contradict each other.

        Warns
        -----
        UserWarning
            The points are far from the demonstrations.

        Examples
        --------
        >>> passage = model.through(pdmp.ViaPoint(0.4, [0.2], dofs=[1]))
        >>> trajectory = model.rollout(passage.conditions, dt=0.1)
        >>> bool(abs(trajectory.position[4, 1] - 0.2) < 1e-9)
        True

        References
        ----------
        Paraschos, Daniel, Peters, Neumann, Autonomous Robots 42 (2018), doi:10.1007/s10514-017-9648-7 (via-points of ProMPs).
        """
    def jacobian(
        self,
        wrt: _Variable,
        conditions: Conditions | None = None,
        *,
        derivative: int = 0,  # at most 2
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> _Array:  # (T, D, J), (T, D, 1) or (T, D, D)
        """Computes the Jacobian ∂y/∂v of a rollout with respect to one of its conditions v.

        A movement is linear in all conditions but tau: y(v + Δv) = y(v) + (∂y/∂v)Δv exactly, with the same Jacobian for
        all values of v. It depends on tau, and on the presence of `start`, `velocity` and `goal_velocity`; that by the
        style also on the amplitude, and that by the amplitude on the style. With respect to tau it is the derivative at
        fixed times, with velocities among the conditions constant. `rollouts_vjp` gives gradients without a Jacobian.

        The derivative of accelerations with respect to tau contains the third derivative of y, which jumps where the clock
        passes a knot of the forcing table or of the transport profile: at such a sample, its mean is used. At the end of a
        movement that does not end at rest the accelerations jump, and the sample there has no derivative.

        Parameters
        ----------
        wrt : {"style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude", "tau"}
            Condition v.
        conditions : Conditions, optional
            Conditions at the start.
        derivative : int
            Order of the time derivative of y: 0 for positions, 1 for velocities, 2 for accelerations.
        dt : float
            Interval between samples in s.
        duration : float, optional
            Length in s, as in `rollout`.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        ndarray, (T, D, J), (T, D, 1) or (T, D, D)
            ∂y/∂v in the unit of y per unit of v, at the samples of `rollout`; (T, D, J) for the style, (T, D, 1) for
            amplitude and tau.

        Raises
        ------
        ValueError
            Conditions that `rollout` rejects, a condition of the other kind of primitive, or several segment durations.

        Examples
        --------
        >>> jacobian = model.jacobian("goal", dt=0.1)
        >>> shift = np.array([0.1, 0.0])
        >>> base, moved = (model.rollout(goal=model.goals[0] + k * shift, dt=0.1).position for k in (0, 1))
        >>> np.allclose(moved - base, jacobian @ shift)
        True
        """
    def style_of(
        self,
        demonstration: Demonstration,
        *,
        dt: float | None = None,
        period: float | None = None,
        landmarks: ArrayLike | None = None,  # (E,)
    ) -> _Array:  # (J,)
        """Estimates the style of a new demonstration.

        The maximum a posteriori estimate minimises ‖f − As‖²/σ² + Σ s_j²/v_j, with the target f, the forcing terms A of
        the styles, the least-squares residual variance σ² and the largest square v_j of the demonstrations' styles. A
        cycle with another initial phase is first shifted to that of the model's. The demonstration is inspected as in
        `fit`, with the same warnings. A model with a time warp warps the demonstration too.

        Parameters
        ----------
        demonstration : Demonstration
            A movement of the same degrees of freedom.
        dt : float, optional
            Sampling interval in s of a demonstration without one.
        period : float, optional
            Period in s of a time-stamped cycle.
        landmarks : array_like, (E,), optional
            Times in s of its landmarks; required if the model was fitted with landmarks.

        Returns
        -------
        ndarray, (J,)
            Style s.

        Raises
        ------
        ValueError
            Names or units differ from those of the model, or the model does not describe the demonstration: its closest
            movement deviates by more than half of the demonstration's deviation from its mean while the forcing left
            out exceeds three times that of the fitted demonstrations, or its style is more than ten times as large as
            theirs.

        Examples
        --------
        >>> new = pdmp.Demonstration(model.rollout(model.conditions(1), dt=0.02))
        >>> np.allclose(model.style_of(new), model.styles[1], atol=0.01)
        True
        """
    def landscape(self, u: ArrayLike) -> _Array:  # (len(u), J, D)
        """Computes the attractor landscape b(u) of each style dimension and degree of freedom.

        Parameters
        ----------
        u : array_like, (n,)
            Clock: t / tau of a discrete movement, phase in rad of a rhythmic one.

        Returns
        -------
        ndarray, (n, J, D)
            In the unit of each degree of freedom.

        Raises
        ------
        ValueError
            A clock value is not finite, or negative for a discrete movement.
        """
    def transport(self, u: ArrayLike) -> _Array:  # (n,)
        """Computes the transport m(u), the share of the distance from start to goal that a discrete movement has covered.

        The frame of the output system is c(u) = y₀ + (g − y₀)·m(u). m increases from 0 at the start to 1 at the end and
        stays 1; with `transport="immediate"`, m = 1 everywhere.

        Parameters
        ----------
        u : array_like, (n,)
            Clock t / tau.

        Returns
        -------
        ndarray, (n,)
            Shares from 0 to 1.

        Raises
        ------
        ValueError
            The primitive is rhythmic, or a clock value is negative or not finite.
        """
    def tau_at(self, phase: float, segment_durations: ArrayLike) -> float:  # (K,)
        """Computes the time constant τ at a phase for given segment durations.

        A control loop follows segment durations, as `rollout` does, if it sets
        `controller.tau = model.tau_at(controller.phase, segment_durations)` before each tick, with `transition=0`.

        Parameters
        ----------
        phase : float
            Phase of a controller: x in (0, 1] of a discrete movement, φ in rad of a rhythmic one.
        segment_durations : array_like, (K,)
            Time in s in each segment between `breaks`.

        Returns
        -------
        float
            Time constant τ in s.

        Raises
        ------
        ValueError
            `segment_durations` has a wrong length or is not positive, or `phase` is out of range.
        """
    def predict(self, context: _Context, *, limits: Limits | None = None) -> Prediction:
        """Predicts the movement for a context (Section 4.1.2).

        Parameters
        ----------
        context : array_like, list or mapping, (Q,)
            Numbers and labels, in the units of the demonstrations' contexts; by name where these had names.
        limits : Limits, optional
            Limits of position, velocity and acceleration that the whole movement keeps; see `feasible`. Style and goal, or
            anchor, of `conditions` are then the most probable ones of the prediction that keep them, as
            `nearest_feasible(limits, context=context)` returns. The other attributes, and `band`, describe demonstrators
            without these limits.

        Returns
        -------
        Prediction

        Raises
        ------
        ValueError
            The model was fitted without contexts, `context` has a wrong length, an unknown label, or a number that
            is not finite, or no style and goal keep the limits.
        TypeError
            `limits` has another type.

        Examples
        --------
        >>> prediction = model.predict([0.05])
        >>> trajectory = model.rollout(prediction.conditions)
        >>> np.allclose(trajectory.position, model.rollout(context=[0.05]).position)
        True
        >>> limits = pdmp.Limits(velocity=0.9 * abs(trajectory.velocity).max())
        >>> model.feasible(limits, model.predict([0.05], limits=limits).conditions).feasible
        True
        """
    def band(
        self,
        context: _Context,  # (Q,)
        *,
        level: float = 0.9,
        dt: float = 0.01,
    ) -> tuple[_Array, _Array]:  # lower, upper (T, D)
        """Computes the prediction band of a new movement for a context.

        y ± t·√(aᵀΣa + v), with the covariance Σ of the prediction, the derivatives a of y with respect to the predicted
        conditions, the residual variance v of the demonstrations, and the quantile t of Student's distribution. The
        band compares movements at equal shares of their durations; `Prediction.covariance` has the variance of these. It
        describes demonstrators, whom limits of a robot do not bind.

        Parameters
        ----------
        context : array_like, list or mapping, (Q,)
            Numbers and labels, in the units of the demonstrations' contexts; by name where these had names.
        level : float
            Probability in (0, 1) that a position of the new movement lies within its bounds.
        dt : float
            Interval between samples in s.

        Returns
        -------
        lower, upper : ndarray, (T, D)
            Bounds at the samples of `rollout(context=context, dt=dt)`, in the unit of each degree of freedom. Those of a
            rotation are bounds of the rotation vector in rad from the predicted orientation, in `rotation_frame`.

        Raises
        ------
        ValueError
            `level` is not in (0, 1), `predict` rejects `context`, or the demonstrations are too few for a covariance.
        """
    def in_frame(self, frame: Literal["body", "world"]) -> Model:
        """Returns the model with angular velocities and accelerations in another frame; it moves alike.

        Parameters
        ----------
        frame : {"body", "world"}
            Frame that rotates, or the frame in which orientations are measured.

        Returns
        -------
        Model

        Raises
        ------
        ValueError
            The model has no rotations.
        """
    def explorer(
        self,
        path: str | PathLike[str] | None = None,
        *,
        demonstrations: Sequence[Demonstration] | Mapping[str, Demonstration] | None = None,  # M
        limits: Limits | None = None,
        kinematics: Callable[[_Array], ArrayLike] | None = None,  # (D,) to (P, 2) or (P, 3)
        links: Sequence[tuple[int, int]] | None = None,
        dofs: Sequence[str | int] | None = None,
        title: str | None = None,
    ) -> Explorer:
        """Makes a page with the model to explore in a browser or a notebook.

        The page is one HTML file that needs neither a server nor a network. It has sliders for style, goal and start, or
        anchor and amplitude, τ and context; positions, velocities, accelerations and paths that follow them; limits; the
        plane of styles, with the demonstrations as points; and the call of `rollout` for the present movement. Positions,
        velocities and accelerations equal those of `rollout` with the same `style`, `goal`, `start` and `tau` to rounding.

        Time is linear: a movement of a model with several segments is that for their total duration. Contexts step over
        predictions made in advance, on a grid over the demonstrated range.

        Parameters
        ----------
        path : path-like, optional
            File to write.
        demonstrations : sequence or mapping of Demonstration, optional
            The M demonstrations, in the order of the fit, to draw behind the movement. By default, their reproductions are
            drawn.
        limits : Limits, optional
            Limits of position, velocity and acceleration to draw and to compare the movement with.
        kinematics : callable, optional
            Forward kinematics of a stick figure: points (P, 2) or (P, 3) at a position (n,) with the columns of a
            demonstration. Each point may depend on at most eight degrees of freedom, on each as a + b·cos q + c·sin q, as
            for revolute joints in rad or degrees, or, in a unit of length, as a + b·q; and linearly on the matrix of a
            rotation, which counts three. The page then computes the points exactly.
        links : sequence of (int, int), optional
            Pairs of points to connect; by default each with the next one.
        dofs : sequence of str or int, optional
            Coordinates with diagrams, by name or index; by default all, the first 12 of more.
        title : str, optional
            Heading of the page.

        Returns
        -------
        Explorer
            The page, `html`, which notebooks display.

        Raises
        ------
        ValueError
            A number of demonstrations other than M, unknown degrees of freedom, limits of a wrong length, kinematics of
            another form, or a page of more than 2 MB.
        TypeError
            An argument has another type.
        OSError
            The file cannot be written, or its folder does not exist.

        Examples
        --------
        >>> page = model.explorer(limits=pdmp.Limits(velocity=2.0))
        >>> page.html.startswith("<!DOCTYPE html>")
        True
        """
    def _unit_curves(self, steps: int) -> tuple[_Array, _Array, _Array, int]:
        """Computes the curves of which movements under constant conditions consist, per unit of the clock: responses to the
        styles (3, J, T, D) and to the start (3, T), mean rotations with their velocity and acceleration (R, T, 10), and
        the sample of these to which goals or anchors are relative.
        """
    def prior(
        self,
        demonstrations: _Demos,
        *,
        groups: Sequence[str | int] | NDArray[Any] | None = None,
        threads: int | None = None,
    ) -> Prior:
        """Learns the prior of style, goal, start or anchor, and duration from the demonstrations of the fit.

        Recognition of held-out demonstrations is simulated: up to ten folds are held out in turn, the model is fitted again
        without each, and the rest of the held-out movements is predicted after 10, 30, 50 and 70 % of them. Bandwidth,
        exponent of the likelihood and correlation time of the residual are those with the smallest error; the bands are
        scaled to hold 90 % of the errors. With contexts, recognition in a given context is simulated as well.

        Parameters
        ----------
        demonstrations : list of Demonstration
            The M demonstrations, in the order of the fit.
        groups : list of str or int, (M,), optional
            Person, session or object of each demonstration. A group at a time is held out: the prior is one for new groups.
            By default it is one for those demonstrated.
        threads : int, optional
            Largest number of threads; by default all.

        Returns
        -------
        Prior
            Prior of `recogniser`.

        Raises
        ------
        ValueError
            Other demonstrations than those of the fit, fewer than four, a single group, or a model with a time warp.
        TypeError
            An argument has another type.

        Examples
        --------
        >>> prior = model.prior(demos)
        >>> len(prior.parameters) == len(demos)
        True

        References
        ----------
        West, Journal of the Royal Statistical Society B 55 (1993) 409-422 (the shrunken kernels).
        Lei, G'Sell, Rinaldo, Tibshirani, Wasserman, JASA 113 (2018), doi:10.1080/01621459.2017.1307116 (the bands).
        """
    def recogniser(
        self,
        prior: Prior,
        *,
        context: _Context | None = None,  # (Q,)
        starts: tuple[float, float] | None = None,
        duration: float | None = None,
    ) -> Recogniser:
        """Creates a filter that estimates a movement while it is observed.

        Parameters
        ----------
        prior : Prior
            Prior of the movement, from `prior`.
        context : array_like, (Q,), or mapping, optional
            Context of the movement, if it is known: the prior is then that of movements in this context.
        starts : (float, float), optional
            Earliest and latest start of a discrete movement, in s from the first observation; a negative one is a movement
            joined on its way. By default it starts with the first observation. A rhythmic one is joined at any phase.
        duration : float, optional
            Duration or period in s, if it is known.

        Returns
        -------
        Recogniser

        Raises
        ------
        ValueError
            The prior is of another model or, with `context`, of a model without contexts; the context has another length or an
            unknown label; or a time is out of range.
        TypeError
            An argument has another type.

        Examples
        --------
        >>> recogniser = model.recogniser(model.prior(demos))
        >>> seen = demos[0].n_samples // 2
        >>> for time, position in zip(demos[0].time[:seen], demos[0].position[:seen]):
        ...     recogniser.update(time, position)
        >>> estimate = recogniser.estimate()
        >>> bool(np.abs(estimate.goal - demos[0].position[-1]).max() < 0.2)
        True
        >>> rest = model.rollout(dt=0.01, conditions=estimate.conditions)
        """
    def save(self, path: str | PathLike[str], *, prior: Prior | None = None) -> None:
        """Writes a model file.

        The file is replaced atomically: an interrupted call leaves the old one. A killed process may leave a temporary
        file `.pdmp-*.draft` beside it.

        Parameters
        ----------
        path : path-like
            File to write, conventionally with the suffix `.safetensors`.
        prior : Prior, optional
            Prior that the file keeps with the model, from `Model.prior`; `Prior.load` reads it.

        Raises
        ------
        OSError
            The file cannot be written, or its folder does not exist.
        ValueError
            The prior is of another model.

        Examples
        --------
        >>> import tempfile, pathlib
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
        >>> model.save(path)
        >>> path.exists()
        True
        >>> model.save(path, prior=model.prior(demos))
        >>> len(pdmp.Prior.load(path).parameters) == model.n_demos
        True
        """
    def fastest_tau(
        self,
        limits: Limits,
        conditions: Conditions | None = None,
        *,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> float:
        """Computes the smallest constant tau with which a discrete movement keeps limits of velocity and acceleration.

        The path y(u) over the clock u = t / tau does not depend on tau. With ẏ = y′ / tau and ÿ = y″ / tau², the smallest
        tau is max(max |y′| / V, √(max |y″| / A)) over degrees of freedom and time, until the movement rests past its end. Of a
        rotation, the sizes of angular velocity and acceleration count.

        Parameters
        ----------
        limits : Limits
            Limits V of the velocity and A of the acceleration, at least one of them; those of the position do not count.
        conditions : Conditions, optional
            Conditions at the start. Velocities among them are those at their tau, and scale with the result.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        float
            tau in s.

        Raises
        ------
        ValueError
            `rollout` rejects the conditions, the model is rhythmic, a limit has a wrong length, or there is neither a
            limit of the velocity nor of the acceleration.
        TypeError
            A keyword is unknown, or `conditions` or `limits` has another type.

        Examples
        --------
        >>> tau = model.fastest_tau(pdmp.Limits(velocity=0.5))
        >>> bool(np.isclose(abs(model.rollout(tau=tau, dt=0.001).velocity).max(), 0.5, rtol=1e-3))
        True
        """
    def fastest(
        self,
        limits: Limits,
        conditions: Conditions | None = None,
        *,
        dt: float = 0.01,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Trajectory:
        """Computes the discrete movement that follows its path as fast as limits allow.

        The path y(u) over the clock u does not depend on the rate ρ = du/dt, so that ẏ = ρy′ and ÿ = ρ²y″ + ρ̇y′. The
        rate is the largest with |ẏ| ≤ V and |ÿ| ≤ A for every degree of freedom, found by a pass from the end to the
        start and one back. The movement starts and ends at rest; with `velocity` or `goal_velocity` among the
        conditions, it starts or ends with that.

        Limits hold at the ends and in the middle of each thousandth of the path. In between, recordings exceed them by up to
        0.5 %, paths with corners by 2 %; a controller with the limits keeps them at every tick. Where the axis of a rotation turns, up to
        1.9 % of the limit of its angular acceleration remain unused.

        Parameters
        ----------
        limits : Limits
            Limits V of the velocity and A of the acceleration, at least one of them, and of the position, which the path
            has to keep.
        conditions : Conditions, optional
            Conditions at the start. Their tau matters for velocities among them only.
        dt : float
            Interval between samples in s.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        Trajectory
            Samples from the start to the end of the movement.

        Raises
        ------
        ValueError
            `rollout` rejects the conditions, the model is rhythmic, a limit has a wrong length, there is neither a limit
            of the velocity nor of the acceleration, the path leaves the limits of the position, or the start is too fast
            for the limits.
        TypeError
            A keyword is unknown, or `conditions` or `limits` has another type.

        Examples
        --------
        >>> limits = pdmp.Limits(velocity=1.5, acceleration=8.0)
        >>> fastest = model.fastest(limits, dt=0.001)
        >>> bool(fastest.time[-1] < model.fastest_tau(limits))
        True

        References
        ----------
        Pham, Pham, IEEE Transactions on Robotics 34(3), 2018, doi:10.1109/TRO.2018.2819195.
        """
    def controllers(
        self,
        n_movements: int,
        dt: float = 0.001,
        conditions: Conditions | Sequence[Conditions] | None = None,
        *,
        limits: Limits | None = None,
        transition: float | None = None,
        context: _Context | _Contexts | None = None,
        out: Sequence[_Array] | None = None,  # three arrays (B, D)
        threads: int | None = None,
        **changes: Unpack[_RowChanges],  # one value, or rows (B, n)
    ) -> Controllers:
        """Starts many movements that are computed together, tick by tick.

        Parameters
        ----------
        n_movements : int
            Number B of movements.
        dt : float
            Length of a tick in s.
        conditions : Conditions, or B Conditions, optional
            Conditions of all movements at the start, or of each.
        limits : Limits, optional
            Limits of every movement, see `Controller.limits`.
        transition : float, optional
            As in `controller`.
        context : array_like or list, (Q,) or (B, Q), optional
            Context of all movements, or of each, whose prediction supplies absent conditions.
        out : tuple of ndarray, (B, D), optional
            Writable float64 arrays, contiguous by rows, for positions, velocities and accelerations.
        threads : int, optional
            Number of threads of a tick, by default one. The others wait for the next tick, for some fifty microseconds without
            sleep, and end with the movements. The motion does not depend on it.
        **changes
            Single conditions by name, as in `rollout`; each may have a leading axis, with one row for each movement.

        Returns
        -------
        Controllers

        Raises
        ------
        ValueError
            An argument that `controller` rejects, no movement, more than fit into memory, or rows or `out` that do not fit.
        TypeError
            As in `controller`.

        Warns
        -----
        UserWarning
            As in `controller`, of the context that lies farthest outside.

        Examples
        --------
        >>> goals = [[1.0, 0.1], [1.1, 0.0], [0.9, 0.2]]
        >>> controllers = model.controllers(3, dt=0.01, goal=goals)
        >>> while controllers.step().any():
        ...     pass
        >>> np.allclose(controllers.position, goals, atol=0.01)
        True
        """
    def controller(
        self,
        dt: float = 0.001,
        conditions: Conditions | None = None,
        *,
        limits: Limits | None = None,
        transition: float | None = None,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Controller:
        """Starts a movement that is computed tick by tick in a control loop.

        Parameters
        ----------
        dt : float
            Length of a tick in s.
        conditions : Conditions, optional
            Conditions at the start. The controller takes the sum of segment durations; see `tau_at` to follow them.
        limits : Limits, optional
            Limits that every tick keeps, see `Controller.limits`.
        transition : float, optional
            Time in s to 99 % of a change of style, anchor, amplitude, tau or speed, at the model's tau; 0 switches
            immediately, as in the paper. By default a tenth of the nominal duration (discrete) or a quarter of the period
            (rhythmic). It filters a new goal with immediate transport; with learnt transport a goal takes the time that
            `Controller.goal` states, which grows with `transition`.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `rollout`.

        Returns
        -------
        Controller

        Raises
        ------
        ValueError
            `dt` or `transition` is out of range, `rollout` rejects the conditions, or limits have a wrong length.
        TypeError
            A keyword is unknown, or `conditions` or `limits` has another type.

        Warns
        -----
        UserWarning
            The context lies outside the demonstrated ones by more than a tenth of their range, or `dt` is longer than the
            movement.

        Examples
        --------
        >>> controller = model.controller(dt=0.01, goal=[1.0, 0.1])
        >>> controller.step()
        Status.WORKING
        >>> controller.goal = [1.1, 0.0]
        >>> while controller.step():
        ...     pass
        >>> np.allclose(controller.position, [1.1, 0.0], atol=0.01)
        True
        """
    def to_bytes(self, *, prior: Prior | None = None) -> bytes:
        """Returns the contents of a model file as bytes.

        Parameters
        ----------
        prior : Prior, optional
            Prior that the file keeps with the model, as for `save`.

        Raises
        ------
        ValueError
            The prior is of another model.
        """
    @staticmethod
    def from_bytes(data: bytes) -> Model:
        """Reads a model from the contents of a model file.

        Parameters
        ----------
        data : bytes
            Result of `to_bytes`, or the contents of a file that `save` wrote.

        Returns
        -------
        Model

        Raises
        ------
        ModelFileError
            The data are damaged, not a model, or of another version.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class RolloutChunks:
    """Iterator over the chunks of a batch, returned by `Model.rollout_chunks`."""
    def __iter__(self) -> RolloutChunks: ...
    def __next__(self) -> tuple[_Array, ...]: ...

@final
class Factors:
    """Leading factors of targets F ≈ S·F_basis (Eq. 7), returned by `factorise`."""
    @property
    def styles(self) -> _Array:  # (M, J)
        """Styles S (M, J) with orthonormal columns. The entry of largest magnitude in each column is positive."""
    @property
    def basis_targets(self) -> _Array:  # (J, C*D)
        """Basis targets F_basis = SᵀF (J, C·D). Their rows are orthogonal with the singular values as norms."""
    @property
    def singular_values(self) -> _Array:  # decreasing: all, or of a large library the first J
        """Singular values in decreasing order: all min(M, C·D), or the first J if the others were not computed."""
    @property
    def truncation_error(self) -> float:
        """Truncation error ‖F − S·F_basis‖/‖F‖ in the Frobenius norm."""

class _Changes(TypedDict, total=False):
    style: ArrayLike | None  # (J,)
    goal: _Vector | None  # (D,), as are start, both velocities and anchor
    start: _Vector | None
    velocity: _Vector | None
    goal_velocity: _Vector | None
    anchor: _Vector | None
    amplitude: float | None
    tau: float | None
    segment_durations: ArrayLike | None  # (K,)
    phase: float | None
    forcing: AdditionalForcing | None

class _RowChanges(TypedDict, total=False):  # one value, or one for each of B movements
    style: ArrayLike | None
    goal: _Vector | None
    start: _Vector | None
    velocity: _Vector | None
    goal_velocity: _Vector | None
    anchor: _Vector | None
    amplitude: ArrayLike | None  # () or (B,), as are tau and phase
    tau: ArrayLike | None
    segment_durations: ArrayLike | None
    phase: ArrayLike | None
    forcing: AdditionalForcing | None

@final
class Conditions:
    """Conditions of a movement.

    A condition that is None is that of the nominal demonstration. `Model.rollout`, `Model.controller` and
    `Model.jacobian` take conditions, and keywords of the same names that replace single ones; `Model.conditions`,
    `Model.predict` and `blend` return conditions.

    Parameters
    ----------
    style : array_like, (J,), optional
        Style parameter s. ``style=model.styles[m]`` alone keeps start, goal and duration of the nominal demonstration;
        ``model.conditions(m)`` has all of demonstration m.
    goal : array_like, (D,), optional
        Goal g in the unit of each degree of freedom; discrete.
    start : array_like, (D,), optional
        Start position y₀ in the unit of each degree of freedom. A rhythmic movement starts on its limit cycle by
        default.
    velocity : array_like, (D,), optional
        Start velocity per s; by default that of the demonstrations.
    goal_velocity : array_like, (D,), optional
        Final velocity per s with which a discrete movement passes its goal at the end, such as that of a strike; by
        default that of the demonstrations. It needs learnt transport. See `Controller.goal_velocity` for changes on the
        way.
    anchor : array_like, (D,), optional
        Anchor y_a, the centre of oscillation, in the unit of each degree of freedom; rhythmic.
    amplitude : float, optional
        Amplitude r₀ relative to the demonstrations, 1 by default; rhythmic.
    tau : float, optional
        Time constant τ in s: the duration of a discrete movement, the period over 2π of a rhythmic one.
    segment_durations : array_like, (K,), optional
        Time in s in each segment between `Model.breaks`, in place of `tau`. Time over phase is the monotone cubic
        through their sums. A rollout follows it; a controller takes the total, and `Model.tau_at` returns τ at each
        phase.
    phase : float, optional
        Phase φ in rad at which a rhythmic movement starts on its limit cycle; 0 by default.
    forcing : AdditionalForcing, optional
        Additional forcing, which displaces the movement; see `Model.through`.

    Raises
    ------
    ValueError
        A condition is not a number or a vector of numbers. Models check lengths and finiteness when they take
        conditions.
    TypeError
        A keyword is unknown.

    Examples
    --------
    >>> slow = pdmp.Conditions(goal=[0.4, 0.1], tau=2.0)
    >>> fast = slow.replace(tau=0.5)
    >>> pdmp.blend(slow, fast, 0.5).tau
    1.25
    """
    def __new__(cls, **conditions: Unpack[_Changes]) -> Conditions: ...
    def replace(self, **changes: Unpack[_Changes]) -> Conditions:
        """Returns a copy with some conditions replaced.

        Parameters
        ----------
        **changes
            Conditions by name; None stands for that of the nominal demonstration. `tau` replaces `segment_durations`
            and vice versa.

        Returns
        -------
        Conditions

        Raises
        ------
        ValueError, TypeError
            As for `Conditions`.
        """
    @property
    def style(self) -> _Array | None:  # (J,)
        """Style parameter s (J,), or None."""
    @property
    def goal(self) -> _Array | None:  # (D,)
        """Goal g (D,) of a discrete movement, or None."""
    @property
    def start(self) -> _Array | None:
        """Start position y₀ (D,), or None."""
    @property
    def velocity(self) -> _Array | None:
        """Start velocity (D,) per s, or None."""
    @property
    def goal_velocity(self) -> _Array | None:
        """Final velocity (D,) per s of a discrete movement, or None."""
    @property
    def anchor(self) -> _Array | None:
        """Anchor y_a (D,) of a rhythmic movement, or None."""
    @property
    def amplitude(self) -> float | None:
        """Amplitude r₀ of a rhythmic movement, or None."""
    @property
    def tau(self) -> float | None:
        """Time constant τ in s, or None."""
    @property
    def segment_durations(self) -> _Array | None:  # (K,)
        """Time in s in each segment (K,), or None."""
    @property
    def phase(self) -> float | None:
        """Phase φ in rad at which a rhythmic movement starts, or None."""
    @property
    def forcing(self) -> AdditionalForcing | None:
        """Additional forcing, or None."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Limits:
    """Limits of position, velocity, acceleration and jerk.

    Each limit is one number for all degrees of freedom or an array (D,); None and infinity are no limit.
    `Model.controller` keeps them at every tick, `Model.fastest` along a path, and `Model.fastest_tau` with a constant
    tau.

    The three degrees of freedom of a rotation have equal limits, in rad/s and rad/s², of the sizes of its angular velocity and
    acceleration, which depend on no frame; its position and jerk have none.

    Parameters
    ----------
    position : tuple of two float or array_like, (D,), optional
        Lower and upper limits in the unit of each degree of freedom; either may be None.
    velocity : float or array_like, (D,), optional
        Limit of the velocity's magnitude per s, positive.
    acceleration : float or array_like, (D,), optional
        Limit of the acceleration's magnitude per s², positive.
    jerk : float or array_like, (D,), optional
        Limit of the jerk's magnitude per s³, positive; it needs a limit of the acceleration. Controllers keep it,
        `Model.fastest` does not.
    synchronous : bool
        True: a controller slows all degrees of freedom along the path if one cannot follow it, and only then limits single
        ones. False: it limits every degree of freedom on its own.

    Raises
    ------
    ValueError
        A limit is not a number or a vector, lengths differ, a lower limit is not below the upper one, a velocity,
        acceleration or jerk is not positive, or a jerk has no acceleration. Models check lengths when they take limits.
    TypeError
        `position` does not have two items.

    Examples
    --------
    >>> limits = pdmp.Limits(position=(-2.9, 2.9), velocity=2.0, acceleration=[8.0, 10.0])
    >>> limits
    pdmp.Limits(position=([-2.9], [2.9]), velocity=[2.0], acceleration=[8.0, 10.0])
    >>> controller = model.controller(limits=limits)
    >>> controller.limits.velocity
    array([2., 2.])
    """
    def __new__(
        cls,
        position: tuple[ArrayLike | None, ArrayLike | None] | None = None,  # each one, or (D,)
        velocity: ArrayLike | None = None,  # one, or (D,)
        acceleration: ArrayLike | None = None,  # one, or (D,)
        jerk: ArrayLike | None = None,  # one, or (D,)
        *,
        synchronous: bool = True,
    ) -> Limits: ...
    @staticmethod
    def from_urdf(
        path: str | PathLike[str],
        joints: Sequence[str] | None = None,
        *,
        velocity: ArrayLike | None = None,  # one, or (D,)
        acceleration: ArrayLike | None = None,  # one, or (D,)
        jerk: ArrayLike | None = None,  # one, or (D,)
    ) -> Limits:
        """Reads the joint limits of a robot from a URDF file.

        Positions are in rad or m. Continuous joints have no limits of position. Joints that are fixed,
        that mimic another one or that have several degrees of freedom, floating and planar, are left
        out. The soft limits of a safety controller are not used.

        Parameters
        ----------
        path : path
            A URDF file; one in xacro must be expanded first.
        joints : sequence of str, optional
            Joints in the order of the degrees of freedom, such as those of a fitted model;
            by default all that can be moved, in the order of the file.
        velocity, acceleration, jerk : float or array_like, (D,), optional
            Bounds per s, s² and s³, where the file has none or where the task needs smaller ones: of
            two bounds of a joint the smaller holds. Most files have no acceleration and jerk, which
            URDF has since version 1.2; of acceleration and deceleration the smaller holds.

        Raises
        ------
        ValueError
            A file that is not URDF, incomplete or has a document type declaration; a joint that is
            missing or cannot be moved; a limit that is missing, not a number or, as some exporters
            write it, 0 for unknown, unless the argument replaces it.
        OSError
            A file that cannot be read.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> path = pathlib.Path(tempfile.mkdtemp(), "arm.urdf")
        >>> _ = path.write_text(
        ...     "<robot name='arm'><joint name='elbow' type='revolute'>"
        ...     "<limit lower='-1.5' upper='2' velocity='3' effort='10'/></joint></robot>"
        ... )
        >>> pdmp.Limits.from_urdf(path, acceleration=8.0)
        pdmp.Limits(position=([-1.5], [2.0]), velocity=[3.0], acceleration=[8.0])
        """
    @staticmethod
    def from_mujoco(
        model: Any,  # path or mujoco.MjModel
        joints: Sequence[str] | None = None,
        *,
        velocity: ArrayLike | None = None,  # one, or (D,)
        acceleration: ArrayLike | None = None,  # one, or (D,)
        jerk: ArrayLike | None = None,  # one, or (D,)
    ) -> Limits:
        """Reads the joint limits of a robot from a MuJoCo model; needs the package mujoco.

        Positions are in rad or m, for files in degrees too. A joint that is not limited has no limits
        of position. Joints that follow another one through an active equality constraint, free
        joints and ball joints are left out. MuJoCo has limits of the position alone.

        Parameters
        ----------
        model : path or mujoco.MjModel
            A file in MJCF, with its meshes, or a compiled model.
        joints : sequence of str, optional
            Joints in the order of the degrees of freedom, such as those of a fitted model;
            by default all that can be moved, in the order of the MuJoCo model.
        velocity, acceleration, jerk : float or array_like, (D,), optional
            Bounds per s, s² and s³.

        Raises
        ------
        ImportError
            The package mujoco is not installed.
        ValueError
            A file that MuJoCo does not compile, or a joint that is missing or cannot be moved.
        TypeError
            A model that is neither a path nor a compiled model.
        OSError
            A file that cannot be read.
        """
    @property
    def position(self) -> tuple[_Array, _Array] | None:
        """Lower and upper limits of the position, each (1,) or (D,) and infinite where there is none, or None."""
    @property
    def velocity(self) -> _Array | None:
        """Limit of the velocity's magnitude (1,) or (D,) per s, or None."""
    @property
    def acceleration(self) -> _Array | None:
        """Limit of the acceleration's magnitude (1,) or (D,) per s², or None."""
    @property
    def jerk(self) -> _Array | None:
        """Limit of the jerk's magnitude (1,) or (D,) per s³, or None."""
    @property
    def synchronous(self) -> bool:
        """True if a controller slows all degrees of freedom along the path before it limits single ones."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __getnewargs_ex__(
        self,
    ) -> tuple[
        tuple[
            tuple[list[float] | None, list[float] | None] | None,
            list[float] | None,
            list[float] | None,
            list[float] | None,
        ],
        dict[str, bool],
    ]: ...

def blend(a: Conditions, b: Conditions, share: float) -> Conditions:
    """Computes the conditions (1 − share)·a + share·b.

    Parameters
    ----------
    a, b : Conditions
        Conditions of equal names and lengths, such as two of `Model.conditions`.
    share : float
        Share of `b`, from 0 to 1; values outside extrapolate.

    Returns
    -------
    Conditions

    Raises
    ------
    ValueError
        A condition is given for only one of the two, lengths differ, or `share` is not finite.

    Examples
    --------
    >>> between = pdmp.blend(model.conditions(0), model.conditions(1), 0.25)
    >>> np.allclose(between.goal, 0.75 * model.goals[0] + 0.25 * model.goals[1])
    True
    """

@final
class Margins:
    """Largest ratios of a movement to its limits, returned by `Model.feasible`. Their truth value is `feasible`."""
    @property
    def position(self) -> tuple[float, int, float] | None:
        """Largest distance of the position outside its limits, relative to the range between them, or to the demonstrated one
        if a side has none, at most 0 inside; with the index of its degree of freedom and the time in s. None without limits
        of the position.
        """
    @property
    def velocity(self) -> tuple[float, int, float] | None:
        """Largest ratio |ẏ| / V, at most 1 inside, with the index of its degree of freedom and the time in s. None without
        limits of the velocity.
        """
    @property
    def acceleration(self) -> tuple[float, int, float] | None:
        """Largest ratio |ÿ| / A, at most 1 inside, with the index of its degree of freedom and the time in s. None without
        limits of the acceleration.
        """
    @property
    def feasible(self) -> bool:
        """True if the movement keeps all limits, within 1e-9 of them."""
    def __bool__(self) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Prediction:
    """Movement predicted for a context, returned by `Model.predict`."""
    @property
    def conditions(self) -> Conditions:
        """Predicted style, goal and start or anchor, and segment durations."""
    @property
    def duration(self) -> float:
        """Predicted duration or period in s."""
    @property
    def covariance(self) -> _Array | None:  # of all conditions in this order, (P, P)
        """Covariance (P, P) of style, goal and start or anchor, and segment durations of a new movement, in this order;
        None if the demonstrations leave no degree of freedom to estimate it.
        """
    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the covariance estimate."""
    @property
    def extrapolation(self) -> _Array:  # (Q,), in ranges of the demonstrated contexts
        """Distance (Q,) of each context value from the demonstrated range, relative to that range: 0 inside and for
        labels, inf for a value that differs from a constant one.
        """

@final
class ViaPoint:
    """Point that a movement passes at a time or a phase.

    Parameters
    ----------
    time : float, optional
        Time since the start in s; either this or `phase`.
    position : array_like, (n,), optional
        Position in the unit of each degree of freedom, one number for each of `dofs`.
    phase : float, optional
        Phase x of a discrete movement, in rad of a rhythmic one, as `Controller.phase`.
    velocity : array_like, (n,), optional
        Velocity per s, one number for each of `dofs`. A rotation has three in place of its four coordinates: its angular velocity
        in rad/s, in the model's `rotation_frame`, at the orientation that `position` gives.
    dofs : sequence of int or str, optional
        Indices or names of the n degrees of freedom, or of coordinates if the model has rotations; all by default. A rotation
        has all four coordinates or none.
    tolerance : float
        Standard deviation of the point relative to the range of each degree of freedom; a point with 0 is passed exactly.

    Raises
    ------
    ValueError
        `time` and `phase` are both given or both absent, or a value is not a number or a vector of numbers. `Model.through`
        checks the others.

    Examples
    --------
    >>> pdmp.ViaPoint(0.4, [0.2], dofs=[1])
    pdmp.ViaPoint(time=0.4, position=[0.2], dofs=[1])
    """
    def __new__(
        cls,
        time: float | None = None,
        position: ArrayLike | None = None,  # (n,)
        *,
        phase: float | None = None,
        velocity: ArrayLike | None = None,
        dofs: Sequence[int | str] | None = None,
        tolerance: float = 0.0,
    ) -> ViaPoint: ...
    @property
    def time(self) -> float | None:
        """Time since the start in s, or None."""
    @property
    def phase(self) -> float | None:
        """Phase, or None."""
    @property
    def position(self) -> _Array | None:  # (n,)
        """Position (n,), or None."""
    @property
    def velocity(self) -> _Array | None:  # (n,)
        """Velocity (n,) per s, or None."""
    @property
    def dofs(self) -> list[int | str] | None:
        """Indices or names of the degrees of freedom, or None for all."""
    @property
    def tolerance(self) -> float:
        """Standard deviation relative to the ranges."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __getnewargs_ex__(self) -> tuple[Any, ...]: ...

@final
class AdditionalForcing:
    """Additional forcing of one movement, which displaces it; see `Model.through`.

    It moves the frame of the movement by delta(u), so that a movement under constant conditions becomes y(u) + delta(u).
    That of a discrete movement vanishes at its end, and that of a rhythmic one is periodic. `Conditions.forcing` and
    `Controller.add_forcing` take it; it can be pickled.
    """
    def displacement(self, u: float) -> tuple[_Array, _Array, _Array]:  # each (D,)
        """Returns the displacement and its derivatives at a clock.

        Parameters
        ----------
        u : float
            Clock, t / tau since the start, or the phase of a rhythmic movement.

        Returns
        -------
        tuple of three ndarray, (D,)
            The displacement in the unit of each degree of freedom, and its first and second derivative per unit of u.

        Raises
        ------
        ValueError
            `u` is not a number.
        """
    @property
    def begins(self) -> float:
        """Clock u at which the displacement begins."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Passage:
    """Movement through points, returned by `Model.through`."""
    @property
    def conditions(self) -> Conditions:
        """Conditions of the movement, with its additional forcing."""
    @property
    def forcing(self) -> AdditionalForcing:
        """Additional forcing, which `Controller.add_forcing` adds to a movement under way."""
    @property
    def distance(self) -> float:
        """Mahalanobis distance of the points from the movements of the demonstrators. Its square is chi-squared distributed
        with `n_constraints` degrees of freedom for their movements.
        """
    @property
    def n_constraints(self) -> int:
        """Number of positions and velocities."""
    @property
    def displacement(self) -> _Array:  # (D,)
        """Largest displacement (D,) by the additional forcing, relative to the ranges."""
    @property
    def far(self) -> bool:
        """True if the points lie farther from the demonstrations than 999 of 1000 movements of the demonstrators would."""

@final
class Prior:
    """Prior distribution of style, goal, start or anchor, and duration of a movement, returned by `Model.prior`.

    A mixture of Gaussian kernels, one on each of the M demonstrations, of covariance c²Σ about centres drawn towards the
    mean, so that the mixture keeps mean and covariance of the demonstrations::

        p(θ, log T) = 1/M Σₘ N(μ + √(1−c²)(θₘ − μ), c²Σ)

    The prior of a model with contexts has a form for a given context h too, in which the kernels are on the prediction θ(h)
    plus the deviation of each demonstration from the prediction by the others, θ'ₘ = θ(h) + θₘ − θ₋ₘ(hₘ). Settings and
    bands of both forms are learnt apart; the attributes are those of the form without a context.

    Priors are immutable and can be pickled. `Model.save` keeps a prior in the file of its model.
    """
    @staticmethod
    def load(path: str | PathLike[str]) -> Prior:
        """Reads the prior that `Model.save` has written into the file of its model.

        Parameters
        ----------
        path : path-like
            A model file; `pdmp.load` reads the model from it.

        Returns
        -------
        Prior

        Raises
        ------
        OSError
            The file cannot be read.
        ModelFileError
            The file is damaged, not a model, without a prior, or of another version.

        Examples
        --------
        >>> import tempfile, pathlib
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "reach.safetensors"
        >>> model.save(path, prior=model.prior(demos))
        >>> recogniser = pdmp.load(path).recogniser(pdmp.Prior.load(path))
        """
    @staticmethod
    def from_bytes(data: bytes) -> Prior:
        """Reads the prior from the contents of a model file.

        Parameters
        ----------
        data : bytes
            Result of `Model.to_bytes` with a prior, or the contents of a file.

        Returns
        -------
        Prior

        Raises
        ------
        ModelFileError
            The data are damaged, not a model, without a prior, or of another version.
        """
    @property
    def parameters(self) -> _Array:  # (M, K)
        """Parameters (M, K) of the demonstrations: style, goal and start, or style and anchor, in degrees of freedom."""
    @property
    def residual(self) -> _Array:  # (D,)
        """Standard deviations (D,) of the movements from those of the model."""
    @property
    def bandwidth(self) -> float:
        """Bandwidth c of the kernels, relative to the deviations of the demonstrations, in (0, 1]."""
    @property
    def tempering(self) -> float:
        """Exponent of the likelihood, in (0, 1]: it limits the confidence in a model that is not exact."""
    @property
    def correlation_time(self) -> float:
        """Correlation time of the residual in s."""

@final
class Recogniser:
    """Filter that estimates style, goal, start and duration of a movement while it is observed.

    At a given clock a movement is linear in style, goal and start, or anchor. Each of 64 hypotheses of the duration has the
    posterior of these under the mixture of the prior, in closed form, and is weighed by its likelihood. An observation
    takes the same time and memory at any time. A rotation counts as three degrees of freedom, the rotation vector about the
    mean of the demonstrations at the clock of each hypothesis.

    The movement may pause: where it is slow against its prediction, the clock of all hypotheses rests until it goes on.
    """
    @property
    def n_hypotheses(self) -> int:
        """Number of hypotheses of duration, and start or phase."""
    def update(self, time: float, position: ArrayLike) -> None:
        """Includes an observation.

        Parameters
        ----------
        time : float
            Time in s, after that of the observation before; intervals are arbitrary.
        position : array_like, (nq,)
            Position in the columns of the demonstrations; NaN where one is missing. A quaternion with a NaN is missing; its
            sign does not matter.

        Raises
        ------
        ValueError
            The time is not after the one before, the positions have another number or are infinite, or the norm of a
            quaternion is not 1. The recogniser then remains as it was.
        """
    def estimate(self) -> Estimate:
        """Returns the estimate from all observations so far.

        Returns
        -------
        Estimate
            Style, goal, duration and phase, with standard deviations.

        Raises
        ------
        ValueError
            There is no observation, or the observations are in another unit than the demonstrations.
        """
    def continuation(self, time: ArrayLike) -> Continuation:
        """Predicts the positions at times from the last observation on. A movement that is stopped goes on at once.

        Parameters
        ----------
        time : array_like, (T,)
            Times in s, on the clock of the observations.

        Returns
        -------
        Continuation
            Means and standard deviations of the positions.

        Raises
        ------
        ValueError
            A time is before the last observation, and as for `estimate`.
        """
    def reset(self) -> None:
        """Forgets all observations."""

@final
class Estimate:
    """Estimate of a movement from a part of it, returned by `Recogniser.estimate`.

    Standard deviations are scaled so that 90 % of the held-out demonstrations lie within 1.645 of them.
    """
    @property
    def conditions(self) -> Conditions:
        """Conditions of the whole movement: style, goal and start, or anchor and present phase, and duration."""
    @property
    def style(self) -> _Array:  # (J,)
        """Style (J,)."""
    @property
    def style_deviation(self) -> _Array:  # (J,)
        """Standard deviations (J,) of the style."""
    @property
    def goal(self) -> _Array:  # (D,)
        """Goal (nq,), or the anchor of a rhythmic movement."""
    @property
    def goal_deviation(self) -> _Array:  # (D,)
        """Standard deviations (D,) of the goal or anchor; those of a rotation are of the components of the rotation vector in rad
        from it, in the frame of angular velocities.
        """
    @property
    def duration(self) -> float:
        """Duration or period in s."""
    @property
    def duration_deviation(self) -> float:
        """Standard deviation of the logarithm of the duration."""
    @property
    def arrival(self) -> float | None:
        """Time of arrival at the goal in s, on the clock of the observations; None for a rhythmic movement."""
    @property
    def fraction(self) -> float:
        """Time from the start to the last observation over the estimated duration, more than 1 after the end of the movement;
        fraction of the cycle, in [0, 1), for a rhythmic one.
        """
    @property
    def fraction_deviation(self) -> float:
        """Standard deviation of `fraction`."""
    @property
    def stopped(self) -> float:
        """Probability that the movement is stopped. From 0.9 on, its clock rests until it is below 0.5: fraction and
        continuation are those of a movement that goes on at once, and the arrival is later by the pause.
        """
    @property
    def surprise(self) -> float:
        """Mean squared residual, relative to that which one in ten held-out demonstrations exceeds. Above 1 the movement is
        unlike the demonstrations.
        """

@final
class Continuation:
    """Positions to come, returned by `Recogniser.continuation`."""
    @property
    def time(self) -> _Array:  # (T,)
        """Times (T,) in s, on the clock of the observations."""
    @property
    def position(self) -> _Array:  # (T, D)
        """Mean positions (T, nq), with unit quaternions of continuous signs."""
    @property
    def deviation(self) -> _Array:  # (T, D)
        """Standard deviations (T, D): 90 % of held-out positions lie within 1.645 of them. Those of a rotation are of the
        components of the rotation vector in rad from the mean, in the frame of angular velocities, as in a prediction band.
        """

@final
class ContextMap:
    """Regression from contexts to outputs with predictive covariance.

    `fit` uses it from contexts to style, goal, start and duration (Section 4.1.2 of the paper); here outputs are
    arbitrary. Each principal component of the outputs is modelled as y = φ(h)ᵀβ + f(h) + ε:

    - "linear" is least squares with φ = (1, h) and f = 0.
    - "gp" and "polynomial" have φ = 1 and a Gaussian process f, whose kernel is Matérn-5/2 or that of polynomials of
      second degree. Restricted maximum likelihood estimates the ratio of f to the noise for each component;
      leave-one-out error decides the length scale.
    - "stacked" is the mean plus w_g·g + w_l·l, with the deviations g of "gp" and l of a ridge regression. The weights
      minimise the leave-one-out error under w_g + w_l = 1 inside the range of the contexts, and under w_g + w_l ≤ 1
      beyond a tenth of their range outside.

    Numbers are scaled by their spread; labels are equal or not. Repetitions of a context are averaged and count once.

    Parameters
    ----------
    contexts : array_like, (M, Q), or M lists of Q numbers and labels
        Contexts h, numbers in any unit.
    outputs : array_like, (M, P)
        Outputs y for each context, in any unit.
    map : {"auto", "stacked", "gp", "linear", "polynomial"}
        Model of the outputs; "auto" as in `fit`.

    Raises
    ------
    ValueError
        Lengths differ, `map` is unknown, or a number is not finite.

    References
    ----------
    Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 2.7
    """
    def __new__(
        cls,
        contexts: _Contexts,  # (M, Q)
        outputs: ArrayLike,  # (M, P)
        map: _Map = "auto",
    ) -> ContextMap: ...
    @property
    def kind(self) -> Literal["stacked", "gp", "linear", "polynomial"]:
        """Name of the model: "stacked", "gp", "linear" or "polynomial"."""
    @property
    def errors(self) -> list[tuple[str, float]]:
        """Mean squared leave-one-out error of each model that was fitted, with hyperparameters of all contexts.

        Pairs (name, error), in the squared unit of the principal components.
        """
    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the covariance estimate."""
    def predict(self, contexts: _Contexts) -> tuple[_Array, _Array | None]:
        """Computes the predictive mean and covariance of new outputs.

        Parameters
        ----------
        contexts : array_like, (B, Q), or B lists of Q numbers and labels
            Contexts.

        Returns
        -------
        mean : ndarray, (B, P)
            In the unit of the outputs.
        covariance : ndarray, (B, P, P), or None
            None if no degree of freedom is left to estimate it.

        Raises
        ------
        ValueError
            A context has a wrong length, an unknown label, or a number that is not finite.
        """

@final
class Trajectory:
    """Generated movement, returned by `Model.rollout`. Row k of each array is the state at `time[k]`.

    `Demonstration(trajectory)` makes a demonstration of it, and `fit` takes trajectories as demonstrations.
    """
    @property
    def time(self) -> _Array:  # (T,)
        """Times (T,) in s, starting at 0."""
    @property
    def position(self) -> _Array:  # (T, D)
        """Positions (T, D) in the unit of each degree of freedom."""
    @property
    def velocity(self) -> _Array:  # (T, D)
        """Velocities (T, D) per s."""
    @property
    def acceleration(self) -> _Array:  # (T, D)
        """Accelerations (T, D) per s²."""
    @property
    def names(self) -> list[str]:
        """Names of the columns of `position`."""
    @property
    def units(self) -> list[str]:  # "" where unknown
        """Units of the columns of `position`; "" if unknown."""
    @property
    def dof_names(self) -> list[str]:
        """Names of the columns of `velocity` and `acceleration`; those of `position` without rotations."""
    @property
    def dof_units(self) -> list[str]:
        """Units of the columns of `velocity` and `acceleration`, without "per second"."""
    @property
    def rotations(self) -> dict[int, _Order]:
        """First column of each unit quaternion in `position`, and the order of its components, "wxyz" or "xyzw"."""
    def to_dict(self) -> dict[str, Any]:
        """Returns the arrays, names and units in a dictionary.

        `io.read_npz` reads the file that `numpy.savez(path, **trajectory.to_dict())` writes.

        Returns
        -------
        dict
            Keys are the names of the attributes.
        """
    def to_dataframe(self) -> Any:  # pandas.DataFrame
        """Returns a data frame of positions, velocities and accelerations.

        `Demonstration(frame[names], time=frame.index)` makes a demonstration of it.

        Returns
        -------
        pandas.DataFrame
            The index is the time `t` in s. Columns are positions `<name>`, velocities `<name>_velocity` and
            accelerations `<name>_acceleration`; `attrs["units"]` maps each column to its unit.

        Raises
        ------
        ImportError
            pandas is not installed.
        """
    def to_csv(self, path: str | PathLike[str]) -> None:
        """Writes a CSV file as `io.write_csv` does.

        Parameters
        ----------
        path : path-like
            File to write.

        Raises
        ------
        OSError
            The file cannot be written, or its folder does not exist.
        ValueError
            A name could not be read back by `io.read_csv`.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Status:
    """State of a movement: in progress (`WORKING`, 1, true) or settled on its goal (`FINISHED`, 2, false)."""

    WORKING: ClassVar[Status]
    FINISHED: ClassVar[Status]
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __bool__(self) -> bool: ...
    def __int__(self) -> int: ...

@final
class Controller:
    """Running movement, returned by `Model.controller`.

    `step` advances by one tick and updates `position`, `velocity` and `acceleration`, read-only views that remain
    valid. `goal`, `goal_velocity`, `style`, `tau`, `amplitude`, `anchor`, `phase`, `speed`, `tolerance`, `limits`,
    `compliance` and `phase_gain` can be set at any tick; a value that is rejected leaves the present one in force. A controller can be
    copied (`copy`, `deepcopy`) and pickled, and continues from its state to the bit.
    """
    def __copy__(self) -> Controller: ...
    def __deepcopy__(self, _memo: Any, /) -> Controller: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def step(
        self,
        dt: float | None = None,
        *,
        measured: ArrayLike | None = None,  # (D,)
        coupling: tuple[ArrayLike, ArrayLike] | None = None,  # velocity and acceleration (D,)
        phase: float | None = None,
    ) -> Status:
        """Advances the movement by one tick.

        A measured position and coupling terms perturb the equations::

            tau y' = z + w(u) + k_t d + tau c_v
            tau z' = alpha_z (beta_z (c - y) - z) + tau**2 c_a
            tau u' = max(0, k + k_phi sin(phase - phi))     k = 1 / (1 + k_s |d / range|**2)
            tau o' = 5 k (e - o) / extent

        about the frame c, which is the goal or anchor with immediate transport, with the gains (k_s, k_t) of
        `compliance` and the phase x = exp(-alpha_x u) or phi = u. e = m - y is the tracking error, o its estimated systematic part, and d the part of e beyond o; extent is T / tau or 2 pi. All
        terms are evaluated at the start of the tick and constant over it. A tick of any length pulls y no further than
        m. A robot that is blocked thus holds the movement and nearly stops its phase; released, it continues from
        there. A robot with a constant tracking error ends no further from the goal than that error, and the movement
        finishes. A measured phase pulls the phase of a rhythmic movement with the gain k_phi of `phase_gain`, without
        overshoot for a tick of any length.

        Parameters
        ----------
        dt : float, optional
            Length of this tick in s; by default that of the controller. A tick of length zero changes nothing.
        measured : array_like, (D,), optional
            Measured position m in the unit of each degree of freedom. Errors of angles (rad, deg, °) are wrapped to
            half a turn. None means no new measurement: the last error m - y stays in force until the next one or
            `release`, so that a sensor may be slower than the loop.
        coupling : tuple of two array_like, (D,), optional
            Terms (c_v, c_a), per s and per s². c_v adds to the velocity, including its jumps; c_a to the acceleration.
        phase : float, optional
            Measured phase in rad of a rhythmic movement, for this tick only. A sensor slower than the loop passes its
            last phase plus the time since then over tau.

        Returns
        -------
        Status
            `FINISHED` once the time of a discrete movement is over and it has settled on its goal.

        Raises
        ------
        ValueError
            The tick is negative or longer than 1000 tau, a length is wrong, a number is not finite, or a phase is passed
            to a discrete movement. The state then stays as it was.

        Examples
        --------
        >>> controller = model.controller(dt=0.01)
        >>> while controller.step():
        ...     command = controller.position
        >>> np.allclose(command, controller.goal, atol=0.01)
        True

        References
        ----------
        Ijspeert, Nakanishi, Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739 (phase stopping, term in y').
        Schaal, Mohajerian, Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9.
        Pastor, Hoffmann, Asfour, Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385 (terms in z').
        Acebrón, Bonilla, Pérez Vicente, Ritort, Spigler, Reviews of Modern Physics 77, 137, 2005 (pull of the phase).
        """
    def release(self) -> None:
        """Discards the measured position.

        The movement is unperturbed until the next measurement.
        """
    @property
    def forcing(self) -> AdditionalForcing | None:
        """Additional forcing in force, or None."""
    def add_forcing(self, forcing: AdditionalForcing) -> None:
        """Adds an additional forcing to that in force.

        Position and velocity stay continuous, and the acceleration too if the forcing begins at the present phase or later
        (`from_phase` of `Model.through`); one that began earlier is joined as a goal that has moved. Before the first tick it
        acts from the start. `reset` ends it.

        Parameters
        ----------
        forcing : AdditionalForcing
            Forcing of `Model.through`, as `Passage.forcing`.

        Raises
        ------
        ValueError
            The forcing belongs to another model, or is the ninth with another beginning. The movement then continues.

        Examples
        --------
        >>> controller = model.controller(dt=0.01)
        >>> for _ in range(20):
        ...     _ = controller.step()
        >>> point = pdmp.ViaPoint(0.4, [0.15], dofs=[1])
        >>> passage = model.through(point, model.conditions(model.nominal), from_phase=controller.phase)
        >>> controller.add_forcing(passage.forcing)
        >>> for _ in range(20):
        ...     _ = controller.step()
        >>> bool(abs(controller.position[1] - 0.15) < 1e-6)
        True
        """
    def forecast(self, horizon: float, dt: float | None = None) -> Trajectory:
        """Computes the motion over the next seconds under the present commands, without a change of the controller.

        Commands in transition continue. A measured position remains in force as in `step`; coupling terms and a measured
        phase, which apply to one tick, do not. Ticks are exact for any length, so that a coarse `dt` is as accurate as a
        fine one, except for a measured position, whose terms are constant over a tick. The call allocates and belongs
        outside the real-time loop, which another thread may step meanwhile.

        Parameters
        ----------
        horizon : float
            Length in s.
        dt : float, optional
            Interval between samples in s; by default that of the controller, for which the samples are those of the loop
            to the bit.

        Returns
        -------
        Trajectory
            n + 1 samples, where n is horizon / dt rounded down. Times are from now, and the first sample is the present
            motion.

        Raises
        ------
        ValueError
            `horizon` is negative or not finite, `dt` is not positive or longer than 1000 tau, or there are more than 1e7
            samples.

        Examples
        --------
        >>> controller = model.controller(dt=0.01)
        >>> controller.goal = [1.1, 0.0]
        >>> ahead = controller.forecast(0.5)
        >>> for _ in range(50):
        ...     _ = controller.step()
        >>> np.array_equal(ahead.position[-1], controller.position)
        True
        """
    def reset(
        self,
        conditions: Conditions | None = None,
        *,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> None:
        """Restarts the movement.

        Speed, limits, tolerance and gains stay in force. With `start` and `velocity` of the present motion, position and
        velocity stay continuous, also in a pause; see `speed`.

        Parameters
        ----------
        conditions : Conditions, optional
            Conditions at the start. One that is absent is that of the nominal demonstration, not an earlier command.
        context : array_like or list, (Q,), optional
            Context whose prediction supplies absent conditions.
        **changes
            Single conditions by name, as in `Model.rollout`.

        Raises
        ------
        ValueError
            Conditions that `Model.rollout` rejects. The movement then continues.
        """
    @property
    def dt(self) -> float:
        """Length of a tick in s."""
    @property
    def position(self) -> _Array:  # (D,), a read-only view that each step updates
        """Position y (D,) in the unit of each degree of freedom; a read-only view."""
    @property
    def velocity(self) -> _Array:
        """Velocity (D,) per s; a read-only view."""
    @property
    def acceleration(self) -> _Array:
        """Acceleration (D,) per s²; a read-only view."""
    @property
    def status(self) -> Status:
        """Result of the last `step`, or `WORKING` after a later command."""
    @property
    def phase(self) -> float:  # x in (0, 1], or phi in [0, 2 pi)
        """Phase: x in (0, 1] of a discrete movement, φ in [0, 2π) rad of a rhythmic one.

        Assigning the phase of a rhythmic movement resets it, for example at the heel strike of a gait. Position and
        velocity are continuous, the acceleration jumps, and the deviation from the cycle at the new phase decays. Before
        the first tick the movement starts at this phase. A discrete movement rejects it.

        Examples
        --------
        Reset the phase at each heel strike, and adapt the frequency by the measured stride:

        >>> walk = np.sin(2 * np.pi * np.arange(100) / 100)[:, None]
        >>> gait = pdmp.fit([pdmp.Demonstration(walk, dt=0.01)], kind="rhythmic")
        >>> controller = gait.controller(dt=0.01)
        >>> stride, heel, gain = 1.25, 0.0, 0.5
        >>> for _ in range(12):
        ...     for _ in range(125):
        ...         _ = controller.step()
        ...     controller.phase = heel
        ...     omega = 1 / controller.tau
        ...     controller.tau = 1 / (omega + gain * (2 * np.pi / stride - omega))
        >>> round(2 * np.pi * controller.tau, 2)
        1.25

        References
        ----------
        Nakanishi, Morimoto, Endo, Cheng, Schaal, Kawato, Robotics and Autonomous Systems 47 (2004) 79-91 (the rule).
        The same authors, IROS 2004, doi:10.1109/IROS.2004.1389470 (phase resetting).
        """
    @phase.setter
    def phase(self, phase: float, /) -> None: ...
    @property
    def phase_gain(self) -> float:
        """Gain k_phi of a measured phase in `step`, per unit of u, from 0 to 1000; 1 by default, 0 disables the pull.

        An error of the phase decays with exp(-k_phi t / tau). A movement whose frequency differs from the measured one
        by the share e lags by asin(e / k_phi), and is synchronised for e < k_phi. The gain stays in force after `reset`.
        """
    @phase_gain.setter
    def phase_gain(self, gain: float, /) -> None: ...
    @property
    def time(self) -> float:
        """Time since the start in s."""
    @property
    def goal(self) -> _Array:
        """Goal g (D,) of a discrete movement; a read-only copy. Assign all values at once.

        With learnt transport the movement goes to a new goal with minimum jerk, until its end, or for the shortest duration
        in which it is no faster than the paper's equations if less time is left. On the way to a final velocity, a goal
        that comes later than that is taken up past the end.
        """
    @goal.setter
    def goal(self, goal: ArrayLike, /) -> None: ...
    @property
    def style(self) -> _Array:
        """Style s (J,); a read-only copy. Assign all values at once."""
    @style.setter
    def style(self, style: ArrayLike, /) -> None: ...
    @property
    def goal_velocity(self) -> _Array | None:
        """Final velocity (D,) per s with which a discrete movement passes its goal at the end, or None for that of the
        demonstrations; a read-only copy. Assign all values at once.

        It is met to rounding after any change of it or of tau before the last tenth of the movement, and of goal or style
        before the last third (at the default transition). Later changes do not affect the arrival.
        """
    @goal_velocity.setter
    def goal_velocity(self, velocity: ArrayLike | None, /) -> None: ...
    @property
    def anchor(self) -> _Array:
        """Anchor y_a (D,) of a rhythmic movement; a read-only copy. Assign all values at once."""
    @anchor.setter
    def anchor(self, anchor: ArrayLike, /) -> None: ...
    @property
    def tau(self) -> float:
        """Time constant τ in s."""
    @tau.setter
    def tau(self, tau: float, /) -> None: ...
    @property
    def amplitude(self) -> float:
        """Amplitude r₀ of a rhythmic movement; 1 of a discrete one."""
    @amplitude.setter
    def amplitude(self, amplitude: float, /) -> None: ...
    @property
    def speed(self) -> float:
        """Speed along the path relative to the rate 1 / tau: 0 pauses on the path, 1 resumes.

        A change passes the filter of tau and stays in force after `reset`. A movement that starts with a given `velocity`
        keeps it at any speed: ẏ = ρy′ with a rate ρ of at least max |ẏ|T / (k · range) at the start, up to 1 / tau, where
        k = 15/8 for a discrete and π for a rhythmic movement. From there ρ passes the filter to speed / tau, so that a robot
        in motion brakes into a pause, within the limits.
        """
    @speed.setter
    def speed(self, speed: float, /) -> None: ...
    @property
    def tolerance(self) -> float:
        """Tolerance within which the movement has settled on its goal, 0.005 by default, at most 1.

        It is relative to the larger of two lengths of each degree of freedom: its largest demonstrated range, and its
        distance from the goal when this was last set. It stays in force after `reset`.
        """
    @tolerance.setter
    def tolerance(self, tolerance: float, /) -> None: ...
    @property
    def limits(self) -> Limits | None:
        """Limits of position, velocity and acceleration (D,) in force, or None.

        Every tick keeps them, for any commands, measurements, coupling terms and tick lengths: at its end lower ≤ y ≤ upper,
        |ẏ| ≤ V, |ÿ| ≤ A and a change of ẏ by at most A·dt, and between its ends lower ≤ y ≤ upper on the cubic through
        position and velocity at both, by which a robot interpolates; the mean velocity of a tick is at most V, too. A degree
        of freedom brakes with A, or with V / (2 dt) or (upper - lower) / dt² for the default tick if that is less. A longer
        tick is limited in parts of constant acceleration, and is no single cubic. A movement inside the limits is not changed.

        With a limit of the jerk, ÿ changes by at most J·dt, the degree of freedom can always stop inside, and a movement
        begins with ÿ = 0, or with the present ÿ if it goes on from the present position and velocity. Where a degree of freedom
        comes to rest within a tick, the cubic may pass the limit by J·dt³/150.

        The limits of a rotation are those of the sizes of its angular velocity and acceleration: at the end of every tick |ω| ≤ V and
        |ω̇| ≤ A, over it a change of ω by at most A·dt in the frame of the tool and in that of the world, and a turn by at most V·dt. A limited
        tick ends with the closest ω within them, and turns about a fixed axis.

        A goal or anchor outside is moved to the limit: `goal` and `anchor` return it, and a movement finishes there. A
        movement outside, after limits that shrink or at a start outside, brakes with A and returns at V or below. Along a path that
        leaves the limits of the position from its start on, a degree of freedom is held at its limit and continues from there
        when the path returns; `Model.nearest_feasible` finds conditions that stay inside. A command during the movement is
        accepted in part instead, see `pending`. Where the acceleration along the path steps, a limit of the jerk binds single
        degrees of freedom. The limits stay in force after `reset`; None removes them.
        """
    @limits.setter
    def limits(self, limits: Limits | None, /) -> None: ...
    @property
    def pending(self) -> bool:
        """True while a part of a commanded style, goal, anchor or amplitude is not yet accepted, as the movement ahead would leave
        its limits with it.
        """
    @property
    def limited(self) -> list[Literal["position", "velocity", "acceleration", "jerk"] | None]:  # D
        """Limit that determined the acceleration of each degree of freedom in the last tick: "position", "velocity",
        "acceleration", "jerk", or None for a free one.

        A limit of the position counts from where the degree of freedom brakes in front of it.
        """
    @property
    def compliance(self) -> tuple[float, float]:  # stopping k_s, tracking k_t
        """Gains (k_s, k_t) of the tracking error: phase stopping, and pull per unit of u. 0 disables each."""
    @compliance.setter
    def compliance(self, compliance: tuple[float, float], /) -> None: ...

@final
class Controllers:
    """Running movements of one model, returned by `Model.controllers`.

    `step` advances B movements by one tick and writes `position`, `velocity` and `acceleration`, which are arrays of numpy
    that remain the same. Each movement is that of a `Controller` of its own, to the bit: `controllers[b]` is a copy of it,
    and `controllers[b] = controller` puts one in its place.
    """
    def step(
        self,
        *,
        style: ArrayLike | None = None,  # (B, J) or (J,)
        goal: ArrayLike | None = None,  # (B, D) or (D,)
        goal_velocity: ArrayLike | None = None,
        anchor: ArrayLike | None = None,
        tau: ArrayLike | None = None,  # (B,) or a number
        amplitude: ArrayLike | None = None,
        speed: ArrayLike | None = None,
        measured: ArrayLike | None = None,  # (B, D) or (D,)
        phase: ArrayLike | None = None,  # (B,) or a number
        mask: ArrayLike | None = None,  # (B,) of bool
    ) -> NDArray[np.bool_]:  # (B,)
        """Advances movements by one tick.

        Commands are those of a `Controller`: an absent one leaves its quantity unchanged, a repeated one has no effect. Each
        has one row for each movement, or is one vector or number for all. Movements that `mask` leaves out neither move nor
        take commands, and their rows of the outputs keep their values.

        Parameters
        ----------
        style : array_like, (B, J) or (J,), optional
            New styles.
        goal, anchor : array_like, (B, D) or (D,), optional
            New goals of discrete, anchors of rhythmic movements.
        goal_velocity : array_like, (B, D) or (D,), optional
            New final velocities of discrete movements, per s.
        tau : array_like, (B,), or float, optional
            New time constants in s.
        amplitude : array_like, (B,), or float, optional
            New amplitudes of rhythmic movements.
        speed : array_like, (B,), or float, optional
            New speeds along the path, see `Controller.speed`.
        measured : array_like, (B, D), optional
            Measured positions, see `Controller.step`.
        phase : array_like, (B,), optional
            Measured phases of rhythmic movements in rad, see `Controller.step`.
        mask : array_like of bool, (B,), optional
            True for the movements of this tick; by default all.

        Returns
        -------
        ndarray of bool, (B,)
            `working`: False for movements that have settled on their goals.

        Raises
        ------
        ValueError
            A shape is wrong, a number is not finite, or `Controller` rejects a command. No movement is changed then.

        Examples
        --------
        >>> controllers = model.controllers(4, dt=0.01)
        >>> _ = controllers.step(goal=model.goals[:4], tau=[0.8, 1.0, 1.2, 1.4])
        >>> _ = controllers.step(mask=[True, True, False, True])
        >>> controllers.time.round(2)
        array([0.02, 0.02, 0.01, 0.02])
        """
    def reset(
        self,
        movements: ArrayLike | None = None,  # (N,) of indices, or (B,) of bool
        conditions: Conditions | Sequence[Conditions] | None = None,
        *,
        context: _Context | _Contexts | None = None,
        **changes: Unpack[_Changes],  # one value, or rows (N, n)
    ) -> None:
        """Restarts movements.

        Parameters
        ----------
        movements : array_like of int or bool, optional
            Indices of the N movements to restart, or a mask (B,); by default all.
        conditions : Conditions, or N Conditions, optional
            Conditions of these movements at the start, or of each, as in `Controller.reset`.
        context : array_like or list, (Q,) or (N, Q), optional
            Context of these movements, or of each, whose prediction supplies absent conditions.
        **changes
            Single conditions by name; each may have a leading axis, with one row for each of these movements.

        Raises
        ------
        ValueError
            A movement that does not exist, or conditions that `Model.controllers` rejects. No movement is changed then.

        Examples
        --------
        >>> controllers = model.controllers(4, dt=0.01)
        >>> for _ in range(1000):
        ...     working = controllers.step(mask=controllers.working)
        >>> controllers.reset(~working, goal=[1.1, 0.0])
        >>> bool(controllers.working.all())
        True
        """
    def release(self, movements: ArrayLike | None = None) -> None:
        """Discards measured positions.

        Parameters
        ----------
        movements : array_like of int or bool, optional
            Indices of movements, or a mask (B,); by default all.

        Raises
        ------
        ValueError
            A movement that does not exist.
        """
    @property
    def position(self) -> _Array:  # (B, D) or (B, nq), written by each tick
        """Positions y (B, D), or (B, nq) in coordinates; the array that every tick writes."""
    @property
    def velocity(self) -> _Array:  # (B, D), written by each tick
        """Velocities (B, D) per s; the array that every tick writes."""
    @property
    def acceleration(self) -> _Array:  # (B, D), written by each tick
        """Accelerations (B, D) per s²; the array that every tick writes."""
    @property
    def working(self) -> NDArray[np.bool_]:  # (B,), written by each tick
        """False for movements that have settled on their goals (B,); the array that every tick writes."""
    @property
    def time(self) -> _Array:  # (B,)
        """Times (B,) since the start in s."""
    @property
    def phase(self) -> _Array:  # (B,)
        """Phases (B,): x in (0, 1] of discrete movements, φ in [0, 2π) rad of rhythmic ones."""
    @property
    def dt(self) -> float:
        """Length of a tick in s."""
    def __len__(self) -> int: ...
    def __getitem__(self, movement: int, /) -> Controller: ...
    def __setitem__(self, movement: int, controller: Controller, /) -> None: ...

@final
class GP:
    """Gaussian process regression, the paper's choice of basis functions.

    All outputs share kernel, length scale and noise ratio. Hyperparameters that are not given maximise the marginal
    likelihood (Rasmussen and Williams 2006, Section 5.4.1). `regress` searches noise ratios from 1e-10 to 1e4. In
    `fit`, a noise ratio that is not given is at most 1e-6, and the noise variance at most 1e-6 of the targets' mean
    square: no style can restore a signal that the landscape takes for noise, and `smoothing` removes the noise of
    demonstrations.

    Parameters
    ----------
    kernel : {"matern52", "matern32"}
        Covariance function over the clock u; periodic for rhythmic movements.
    length : float, optional
        Length scale, in units of the clock u = t / tau; positive. Estimated if not given.
    noise : float, optional
        Ratio of noise variance to signal variance, from 1e-10 to 1e6. Estimated if not given.

    Raises
    ------
    ValueError
        `kernel` is unknown, or `length` or `noise` is out of range.
    """
    def __new__(
        cls,
        kernel: _Kernel = "matern52",
        length: float | None = None,
        noise: float | None = None,
    ) -> GP: ...
    @property
    def kernel(self) -> _Kernel:
        """Name of the covariance function."""
    @property
    def length(self) -> float | None:
        """Length scale in units of the clock; None if it is estimated."""
    @property
    def noise(self) -> float | None:
        """Ratio of noise variance to signal variance; None if it is estimated."""
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> GPRegression:
        """Conditions the process on targets over the clock.

        Parameters
        ----------
        u : array_like, (C,)
            Increasing clock values, from 0; in rad and within [0, 2π) if periodic.
        targets : array_like, (C, P)
            Values of the P outputs, in any unit.
        periodic : bool
            Identify u = 2π with u = 0.

        Returns
        -------
        GPRegression

        Raises
        ------
        ValueError
            `u` does not increase from 0, lengths differ, or a number is not finite.
        """

@final
class GPRegression:
    """Gaussian process conditioned on data: f(u) ~ N(0, σ̂²K) for each of P outputs, with K = k(u, u′) + νI.

    Returned by `GP.regress`.
    """
    @property
    def kernel(self) -> _Kernel:
        """Name of the covariance function."""
    @property
    def length(self) -> float:
        """Length scale in units of the clock, as given or estimated."""
    @property
    def noise(self) -> float:
        """Ratio ν of noise variance to signal variance, as given or estimated."""
    @property
    def signal_variance(self) -> float:  # in the squared unit of the outputs
        """Maximum-likelihood signal variance σ̂² = Σ fᵀK⁻¹f/(CP), in the squared unit of the outputs.

        All outputs share it. The noise variance is `noise * signal_variance`.
        """
    @property
    def log_likelihood(self) -> float:  # summed over the outputs
        """Log marginal likelihood of the data, −CP/2·(ln 2πσ̂² + 1) − P/2·ln|K|, summed over the outputs.

        Densities are in the unit of the outputs. It is 0 if all outputs are zero.
        """
    def predict(self, u: ArrayLike) -> tuple[_Array, _Array]:  # mean, variance (len(u), P)
        """Computes the posterior mean and variance of the outputs without noise.

        Parameters
        ----------
        u : array_like, (n,)
            Clock values.

        Returns
        -------
        mean : ndarray, (n, P)
            In the unit of the outputs.
        variance : ndarray, (n, P)
            σ̂²(1 − kᵀK⁻¹k), equal for all outputs, in their squared unit.

        Raises
        ------
        ValueError
            A clock value is not finite.
        """

@final
class TimeWarp:
    """Monotone time warp of the demonstrations to the nominal one.

    Movements are compared by their square-root velocity q = ẏ/√|ẏ|, scaled to unit norm. Over the phase p the warp γ
    minimises ∫|q₀ − (q∘γ)√γ̇|² + λ ln²γ̇ dp, exactly among warps that are linear in each segment with ends on a
    grid of a tenth of a segment.

    Parameters
    ----------
    n_segments : int
        Number K of segments of equal phase, from 1 (linear scaling) to 1000 and half the samples of each demonstration.
    max_slope : float
        Bound of the slope of the warp, from 1 to 10: the duration of a segment is at most `max_slope` times that of
        linear scaling and at least 1 / `max_slope` of it.

    Raises
    ------
    ValueError
        `n_segments` or `max_slope` is out of range.

    References
    ----------
    Srivastava, Klassen, Joshi, Jermyn, IEEE TPAMI 33 (2011), https://doi.org/10.1109/TPAMI.2010.184

    Nielsen, Carstensen, Smedsgaard, J. Chromatography A 805 (1998), https://doi.org/10.1016/S0021-9673(98)00021-1
    """
    def __new__(cls, n_segments: int = 8, max_slope: float = 2.5) -> TimeWarp: ...
    @property
    def n_segments(self) -> int:
        """Number K of segments."""
    @property
    def max_slope(self) -> float:
        """Bound of the slope of the warp, relative to linear scaling."""
    def __getnewargs__(self) -> tuple[int, float]: ...

@final
class NGnet:
    """Normalised Gaussian network, a weighted mean of radial basis functions over the clock.

    b(u) = Σ wₖψₖ(u) / Σ ψₖ(u) with ψₖ = exp(−(u − cₖ)²/2s²), or ψₖ = exp((cos(u − cₖ) − 1)/s²) for rhythmic movements.
    The centres cₖ have equal distances h and extend up to 2h beyond the ends of discrete movements; s = overlap·h.

    Parameters
    ----------
    n_basis : int
        Number N of basis functions, from 2 to 1000.
    overlap : float
        Width s of a basis function in units of the spacing h, from 0.3 to 3. Narrow functions ripple between their
        centres; wide functions are nearly linearly dependent.

    Raises
    ------
    ValueError
        `n_basis` or `overlap` is out of range.

    References
    ----------
    Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, Neural Computation 25 (2013), https://doi.org/10.1162/NECO_a_00393
    """
    def __new__(cls, n_basis: int = 50, overlap: float = 1.2) -> NGnet: ...
    @property
    def n_basis(self) -> int:
        """Number N of basis functions."""
    @property
    def overlap(self) -> float:  # in centre spacings
        """Width of a basis function in units of the centre spacing."""
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> NGnetRegression:
        """Fits the network to targets over the clock by least squares.

        Parameters
        ----------
        u : array_like, (C,)
            Increasing clock values, from 0; in rad and within [0, 2π) if periodic.
        targets : array_like, (C, P)
            Values of the P outputs, in any unit.
        periodic : bool
            Identify u = 2π with u = 0.

        Returns
        -------
        NGnetRegression

        Raises
        ------
        ValueError
            `u` does not increase from 0, lengths differ, or a number is not finite.
        """

@final
class NGnetRegression:
    """Normalised Gaussian network fitted to data, returned by `NGnet.regress`."""
    def predict(self, u: ArrayLike) -> tuple[_Array, None]:  # mean (len(u), P), no variance
        """Computes the outputs.

        Parameters
        ----------
        u : array_like, (n,)
            Clock values.

        Returns
        -------
        mean : ndarray, (n, P)
            In the unit of the outputs.
        variance : None
            The network has no variance; `GPRegression.predict` returns one in this place.

        Raises
        ------
        ValueError
            A clock value is not finite.
        """

def absolute_relative(
    left: ArrayLike,  # (..., 7)
    right: ArrayLike,  # (..., 7)
    *,
    reference: ArrayLike | None = None,  # (4,)
) -> tuple[_Array, _Array]:
    """Converts the poses of two arms to an absolute and a relative pose.

    With positions p and unit quaternions q of the left and the right arm::

        r = inverse(q_left) * q_right          h = (1 + r) / |1 + r|, half of this rotation
        absolute:  (p_left + p_right) / 2      q_left * h
        relative:  R(q_absolute).T @ (p_right - p_left)      r

    The absolute rotation is the midpoint of the geodesic between both arms. The pose of the right arm in the frame of the
    left one depends on the relative pose alone: a primitive of absolute and relative pose, whose demonstrations have one
    relative pose, keeps a rigid object between the arms for any style, goal and tau. Where the recorded relative poses vary
    by noise, replace them by `mean_pose` of them before the fit. For compliance of the absolute pose alone, pass the
    commanded relative pose as the measured one.

    The quaternions r and -r are the same rotation, with midpoints that differ by half a turn about its axis. The sign is that
    on the side of `reference`. The default is the shorter geodesic, which is undefined where the arms are half a turn
    apart, as grippers that face each other are: pass a relative rotation of the task there, in both directions of the
    conversion.

    Parameters
    ----------
    left, right : array_like, (..., 7)
        Poses x, y, z, qw, qx, qy, qz: position, and unit quaternion from the frame of the arm to the world frame. One pose
        (7,) serves for each of the other arm.
    reference : array_like, (4,), optional
        Rotation inverse(q_left) * q_right as qw, qx, qy, qz, of either sign; by default the identity.

    Returns
    -------
    absolute, relative : ndarray, (..., 7)
        The inverse is `left_right`.

    Raises
    ------
    ValueError
        Shapes that differ, a number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a
        relative rotation of more than 175 degrees from the reference.

    Examples
    --------
    >>> left, right = [0.5, 0.2, 0.3, 1, 0, 0, 0], [0.5, -0.2, 0.3, 0, 0, 0, 1]
    >>> absolute, relative = pdmp.robots.absolute_relative(left, right, reference=[0, 0, 0, 1])
    >>> absolute.round(3).tolist(), relative.round(3).tolist()
    ([0.5, 0.0, 0.3, 0.707, 0.0, 0.0, 0.707], [-0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    """

def left_right(
    absolute: ArrayLike,  # (..., 7)
    relative: ArrayLike,  # (..., 7)
    *,
    reference: ArrayLike | None = None,  # (4,)
) -> tuple[_Array, _Array]:
    """Converts an absolute and a relative pose to the poses of two arms.

    The inverse of `absolute_relative`, exact to rounding with the same reference::

        p_left, p_right = p_absolute -/+ R(q_absolute) @ p_relative / 2
        q_left, q_right = q_absolute * inverse(h), q_absolute * h         h * h = q_relative

    Parameters
    ----------
    absolute, relative : array_like, (..., 7)
        Poses x, y, z, qw, qx, qy, qz as from `absolute_relative`, with quaternions of either sign. One pose (7,) serves for
        each of the other argument.
    reference : array_like, (4,), optional
        Reference of `absolute_relative`.

    Returns
    -------
    left, right : ndarray, (..., 7)
        Poses of the arms.

    Raises
    ------
    ValueError
        As for `absolute_relative`.
    """

def axis_angles_to_quaternions(
    axes: ArrayLike,
    angles: ArrayLike,
    *,
    unit: Literal["rad", "deg"],
    order: Literal["wxyz", "xyzw"],
) -> _Array:
    """Converts axes and angles to unit quaternions.

    Parameters
    ----------
    axes : array_like, (T, 3) or (3,)
        Axes of any length along time, or one for all angles.
    angles : array_like, (T,) or float
        Angles about them.
    unit : {"rad", "deg"}
        Unit of the angles.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 4) or (4,)
        Quaternions, whose signs are continuous along time.

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, or a turn about an axis of norm below 1e-9.

    Examples
    --------
    >>> turn = pdmp.preprocessing.axis_angles_to_quaternions([0, 0, 2], 180, unit="deg", order="wxyz")
    >>> turn.round(12).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """

def euler_to_quaternions(
    angles: ArrayLike, sequence: str, *, unit: Literal["rad", "deg"], order: Literal["wxyz", "xyzw"]
) -> _Array:
    """Converts Euler angles to unit quaternions.

    Parameters
    ----------
    angles : array_like, (T, 3) or (3,)
        Angles along time, or one triple, in the order of the sequence.
    sequence : str
        Axes of the three rotations in their order: small letters such as "xyz" for the fixed axes of the world (extrinsic),
        capital letters such as "ZYX" for the moving axes of the body (intrinsic), as in SciPy. Roll, pitch and yaw are
        usually "xyz" in this order.
    unit : {"rad", "deg"}
        Unit of the angles.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 4) or (4,)
        Quaternions, whose signs are continuous along time.

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, or a sequence with other letters, capital and small ones, or one axis
        twice in succession.

    Examples
    --------
    >>> angles = [90, 0, 0]
    >>> pdmp.preprocessing.euler_to_quaternions(angles, "ZYX", unit="deg", order="wxyz").round(4).tolist()
    [0.7071, 0.0, 0.0, 0.7071]
    """

def matrices_to_quaternions(matrices: ArrayLike, *, order: Literal["wxyz", "xyzw"]) -> _Array:
    """Converts rotation matrices to unit quaternions.

    The columns of a matrix are the axes of the body in the world frame. Matrices whose M.T @ M deviates from the identity by
    at most 1e-3 are replaced by the closest rotation. The signs are continuous along time, from w ≥ 0 in the first sample.

    Parameters
    ----------
    matrices : array_like, (T, 3, 3) or (3, 3)
        Rotation matrices along time, or one.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 4) or (4,)

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, a larger deviation, or a reflection (determinant −1).

    Examples
    --------
    >>> pdmp.preprocessing.matrices_to_quaternions(np.diag([1, -1, -1]), order="xyzw").tolist()
    [1.0, 0.0, 0.0, 0.0]
    """

def poses_to_transforms(poses: ArrayLike, *, order: Literal["wxyz", "xyzw"]) -> _Array:
    """Converts poses to homogeneous transforms.

    Parameters
    ----------
    poses : array_like, (T, 7) or (7,)
        Positions x, y, z and unit quaternions along time, or one.
    order : {"wxyz", "xyzw"}
        Order of the components of the quaternions.

    Returns
    -------
    ndarray, (T, 4, 4) or (4, 4)

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, or a quaternion whose norm deviates from 1 by more than 1e-3.
    """

def quaternions_to_euler(
    quaternions: ArrayLike,
    sequence: str,
    *,
    unit: Literal["rad", "deg"],
    order: Literal["wxyz", "xyzw"],
) -> _Array:
    """Converts unit quaternions to Euler angles.

    The first and third angle of the first sample lie within ±180°, the second within ±90° for three different axes, 0° and
    180° for a repeated one. The other samples have the angles closest to the sample before, so that they have no jumps.

    In gimbal lock, at the bounds of the second angle, only the sum or the difference of the others is determined. Within
    1e-7 rad of it the third angle is that of the sample before, 0 at first; near it small rotations are large changes of
    angles.

    Parameters
    ----------
    quaternions : array_like, (T, 4) or (4,)
        Unit quaternions along time, or one.
    sequence : str
        Sequence of the axes, as for `euler_to_quaternions`.
    unit : {"rad", "deg"}
        Unit of the angles.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 3) or (3,)

    Raises
    ------
    ValueError
        As for `quaternions_to_matrices` and the sequence of `euler_to_quaternions`.

    Warns
    -----
    UserWarning
        Samples in gimbal lock.
    """

def quaternions_to_matrices(quaternions: ArrayLike, *, order: Literal["wxyz", "xyzw"]) -> _Array:
    """Converts unit quaternions to rotation matrices.

    Parameters
    ----------
    quaternions : array_like, (T, 4) or (4,)
        Unit quaternions along time, or one.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 3, 3) or (3, 3)
        Matrices, whose columns are the axes of the body in the world frame.

    Raises
    ------
    ValueError
        Another shape, a number that is not finite, or a norm that deviates from 1 by more than 1e-3.
    """

def quaternions_to_rotation_vectors(
    quaternions: ArrayLike, *, order: Literal["wxyz", "xyzw"]
) -> _Array:
    """Converts unit quaternions to rotation vectors.

    The first is that of the shortest rotation; of the others, that closest to the sample before, with whole turns added about
    its axis. A path that passes half a turn has no jump.

    Parameters
    ----------
    quaternions : array_like, (T, 4) or (4,)
        Unit quaternions along time, or one.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 3) or (3,)
        Rotation vectors in rad.

    Raises
    ------
    ValueError
        As for `quaternions_to_matrices`.
    """

def rotation_vectors_to_quaternions(
    vectors: ArrayLike, *, order: Literal["wxyz", "xyzw"]
) -> _Array:
    """Converts rotation vectors to unit quaternions.

    Parameters
    ----------
    vectors : array_like, (T, 3) or (3,)
        Rotation vectors along time, or one: the axis times the angle in rad.
    order : {"wxyz", "xyzw"}
        Order of the components.

    Returns
    -------
    ndarray, (T, 4) or (4,)
        Quaternions, whose signs are continuous along time.

    Raises
    ------
    ValueError
        Another shape, or a number that is not finite.
    """

def transforms_to_poses(transforms: ArrayLike, *, order: Literal["wxyz", "xyzw"]) -> _Array:
    """Converts homogeneous transforms to poses.

    Parameters
    ----------
    transforms : array_like, (T, 4, 4) or (4, 4)
        Transforms from the body frame to the world frame along time, or one, with the last row 0, 0, 0, 1. Their rotations
        are converted as by `matrices_to_quaternions`.
    order : {"wxyz", "xyzw"}
        Order of the components of the quaternions.

    Returns
    -------
    ndarray, (T, 7) or (7,)
        Positions x, y, z and unit quaternions, for a demonstration with `rotations={3: order}`.

    Raises
    ------
    ValueError
        As for `matrices_to_quaternions`, or another last row.

    Examples
    --------
    >>> transforms = np.tile(np.eye(4), (50, 1, 1))
    >>> transforms[:, 2, 3] = np.linspace(0, 0.3, 50)
    >>> poses = pdmp.preprocessing.transforms_to_poses(transforms, order="wxyz")
    >>> pdmp.Demonstration(poses, dt=0.01, rotations={3: "wxyz"}).n_dofs
    6
    """

def to_tangent(reference: ArrayLike, position: ArrayLike, rotations: Mapping[int, str]) -> _Array:
    """Converts positions to degrees of freedom, whose rotations are rotation vectors from those of a reference.

    Parameters
    ----------
    reference, position : array_like, (T, n_coordinates)
        Positions with unit quaternions.
    rotations : dict of int to str
        First column and order of each quaternion, as of `Demonstration`.

    Returns
    -------
    ndarray, (T, n_dofs)
        Rotation vectors in rad in the body frame of the reference; the other coordinates are those of `position`.

    Raises
    ------
    ValueError
        Shapes that differ, or a quaternion whose norm deviates from 1 by more than 1e-3.
    """

def from_tangent(reference: ArrayLike, dofs: ArrayLike, rotations: Mapping[int, str]) -> _Array:
    """Converts degrees of freedom relative to a reference to positions: the inverse of `to_tangent`.

    Parameters
    ----------
    reference : array_like, (T, n_coordinates)
        Positions with unit quaternions.
    dofs : array_like, (T, n_dofs)
        Degrees of freedom, whose rotations are rotation vectors in rad.
    rotations : dict of int to str
        First column and order of each quaternion.

    Returns
    -------
    ndarray, (T, n_coordinates)

    Raises
    ------
    ValueError
        As for `to_tangent`.
    """

def mean_positions(positions: Sequence[ArrayLike], rotations: Mapping[int, str]) -> _Array:
    """Computes the mean of positions with rotations, their Karcher mean.

    Parameters
    ----------
    positions : list of array_like, (T, n_coordinates)
        Positions with unit quaternions.
    rotations : dict of int to str
        First column and order of each quaternion.

    Returns
    -------
    ndarray, (T, n_coordinates)

    Raises
    ------
    ValueError
        As for `to_tangent`.
    """

def mean_pose(poses: ArrayLike) -> _Array:  # (..., 7)
    """Computes the mean of poses.

    The position is the arithmetic mean, the rotation the Karcher mean, about which the rotation vectors add up to zero.

    Parameters
    ----------
    poses : array_like, (..., 7)
        Poses x, y, z, qw, qx, qy, qz, such as the relative poses of all demonstrations one after the other.

    Returns
    -------
    ndarray, (7,)
        Mean pose.

    Raises
    ------
    ValueError
        No pose, a number that is not finite, a quaternion whose norm deviates from 1 by more than 1e-3, or a rotation of more
        than 90 degrees from the mean.
    """
