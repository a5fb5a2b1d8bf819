# Types of the compiled half. Its documentation lives with the code in crates/pdmp-py: see help().
#
# Shapes: M demonstrations, T samples, D degrees of freedom, J style parameters, Q context values,
# B trajectories, C samples of a regression with P outputs. Times are in s, positions in the unit of
# each degree of freedom. Whatever numpy can turn into float64 is accepted; float64 comes back.

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Literal, TypeAlias, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array: TypeAlias = NDArray[np.float64]
_Kind: TypeAlias = Literal["discrete", "rhythmic"]
_Map: TypeAlias = Literal["auto", "stacked", "gp", "linear", "polynomial"]
_Context: TypeAlias = ArrayLike | Sequence[float | str]
_Contexts: TypeAlias = ArrayLike | Sequence[Sequence[float | str]]
_Demo: TypeAlias = Demonstration | Trajectory | ArrayLike
_Demos: TypeAlias = Sequence[_Demo] | Mapping[str, _Demo] | ArrayLike
_Kernel: TypeAlias = Literal["matern32", "matern52"]

__all__ = [
    "Conditions",
    "ContextMap",
    "Controller",
    "Demonstration",
    "Factors",
    "FitError",
    "GP",
    "GPRegression",
    "Model",
    "ModelFileError",
    "NGnet",
    "NGnetRegression",
    "PdmpError",
    "Prediction",
    "RolloutChunks",
    "Status",
    "TimeWarp",
    "Trajectory",
    "__version__",
    "blend",
    "cut",
    "cycles",
    "factorise",
    "fill",
    "fit",
    "inspected",
    "load",
    "lowpass",
    "period",
    "resample",
    "residuals",
    "trim",
]
__version__: str

class PdmpError(Exception):
    """Base of the errors that are not about an argument."""

class FitError(PdmpError):
    """Learning did not succeed on well-formed demonstrations."""

class ModelFileError(PdmpError):
    """A model file that is damaged, foreign or of another version."""

@final
class Demonstration:
    """One recorded movement.

    Parameters
    ----------
    position : array_like (T, D) or Trajectory
        Positions in the unit of each degree of freedom; at least four samples. A data frame gives names too, those of
        its columns, and a trajectory time stamps, names and units, where they are not given.
    dt : float, optional
        Sampling interval in s. Without `dt` and `time`, the fit is told.
    time : array_like, (T,), optional
        Strictly increasing time stamps in s, or dates of numpy, which count from the first.
    goal : array_like, (D,), optional
        Point attractor; the last sample serves otherwise.
    context : array_like or list, (Q,), optional
        The condition under which the movement was made, such as an obstacle's height.
    names : sequence of str, optional
        One name per degree of freedom.
    units : sequence of str, optional
        One unit per degree of freedom, such as "rad" or "m"; "" where it is not known.

    Raises
    ------
    ValueError
        Too few samples, numbers that are not finite, times that do not increase, or lengths that do not agree.
    """
    def __new__(
        cls,
        position: ArrayLike | Trajectory,  # (T, D)
        *,
        dt: float | None = None,
        time: ArrayLike | None = None,  # (T,)
        goal: ArrayLike | None = None,  # (D,)
        context: _Context | None = None,  # (Q,)
        names: Sequence[str] | None = None,  # D of them
        units: Sequence[str] | None = None,  # D of them
    ) -> Demonstration: ...
    def __getnewargs_ex__(self) -> tuple[tuple[_Array], dict[str, Any]]: ...
    @property
    def position(self) -> _Array:  # (T, D)
        """Positions (T, D)."""
    @property
    def time(self) -> _Array | None:  # (T,); None while the rate is unknown
        """Times of the samples (T,) in s; None while the rate is unknown."""
    @property
    def dt(self) -> float | None:  # None unless given
        """Sampling interval in s; None unless it was given."""
    @property
    def goal(self) -> _Array | None:
        """Point attractor (D,), if one was given."""
    @property
    def context(self) -> _Array | list[float | str] | None:
        """Condition (Q,), if one was given: an array, or a list where there are labels."""
    @property
    def names(self) -> list[str] | None:
        """Names of the degrees of freedom, if they were given."""
    @property
    def units(self) -> list[str] | None:
        """Units of the degrees of freedom, if they were given."""
    @property
    def n_samples(self) -> int:
        """Number of samples T."""
    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom D."""

def fit(
    demos: _Demos,  # M of them, or (M, T, D)
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
    alignment: Literal["linear", "warp"] | TimeWarp = "linear",
    events: ArrayLike | None = None,  # (M, E)
    tau: float | None = None,
    alpha_z: float = 25.0,
    beta_z: float | None = None,
    alpha_x: float | None = None,
    mu: float | None = None,
    threads: int | None = None,
    progress: Callable[[str, float], object] | None = None,  # stage, share in [0, 1]
) -> Model:
    """Learn one movement primitive from several demonstrations.

    The four steps of Section 3.2: align the demonstrations to a nominal one, compute the targets
    f = τẏ − z exactly, factorise F ≈ S·F_basis (Eq. 7), and regress the landscape on the phase.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration, of Trajectory or of (T, D) array_like, or (M, T, D) array_like
        Demonstrations of one skill; if rhythmic, each is one cycle without its end point. Of a mapping, such as the
        readers return, the values count. Data frames name their degrees of freedom by their columns.
    kind : {"discrete", "rhythmic"}
        From a start to a goal, or around an anchor.
    dt : float, optional
        Sampling interval in s of the demonstrations that carry none.
    period : float or (M,) array_like, optional
        Periods in s of time-stamped cycles.
    contexts : (M, Q) array_like, or M lists of Q numbers and labels, optional
        The condition of each demonstration; otherwise those that they carry.
    map : {"auto", "stacked", "gp", "linear", "polynomial"}
        Map from contexts to movements: a Gaussian process and a penalised line, weighted by their errors at contexts
        left out, outside of the contexts of the demonstrations together with the mean ("stacked"); the process alone;
        least squares as in the paper; or ridge regression on polynomials of second degree. "auto" is "stacked", and
        "linear" for labels alone, which get the mean of their demonstrations each, for two different contexts and for
        more than 1024. The repr of `model.map` has the weights.
    n_styles : int or "auto", optional
        Style dimension J. By default the systematic styles: as many as carry nine tenths of the sum of the singular
        values, at least five (or half of the demonstrations) and as many as the contexts explain (F-test), but none
        that measurement noise alone would give (parallel analysis). "auto" is cross-validation over contexts by the
        one-standard-error rule, in at most ten folds.
    singular_value_share : float, optional
        The paper's rule instead: the fewest singular values whose sum exceeds this share of the sum of all, such as 0.9.
    basis : {"gp", "ngnet"}, GP or NGnet
        Function approximator of the landscape.
    smoothing : "auto", float or None
        Smooth each degree of freedom by generalised cross-validation over all demonstrations, which leaves clean ones as
        they are; or with this cut-off in Hz; or interpolate every sample. `model.noise` and `model.cut_offs` hold what
        was found.
    nominal : int, optional
        Index of the nominal demonstration; otherwise the one of median duration.
    n_samples : int, optional
        Samples C after alignment; otherwise as many as the nominal demonstration has, and more where these are fewer
        than 150.
    transport : {"learnt", "immediate"}
        How the way from start to goal is spread over a discrete movement: along the profile by which the demonstrations
        cover theirs (:meth:`Model.transport`), or at once as in the paper, where a moved goal shifts the whole path.
        Past its end a movement brakes (:attr:`Model.braking`), or its forcing fades with the phase as in the paper.
    dof_scale : None, "unit", "range" or (D,) array_like
        Unit of each degree of freedom in the factorisation. By default as recorded ("unit") where all units are equal or
        unknown; otherwise the degrees of freedom of each unit are scaled together by the largest range among them.
        "range" scales each by its own range. If given as numbers, in a warp of time too.
    alignment : {"linear", "warp"} or TimeWarp
        How time is scaled to that of the nominal demonstration: linearly, or by the monotone warp that brings the
        demonstrations closest to each other, where they pause or hurry in different places. A `TimeWarp` is applied as given;
        "warp" has eight segments, fewer where a demonstration has fewer than 16 samples, and with at least three
        different contexts is applied only if it lowers the error at contexts held out by more than its standard error;
        `model.segment_durations` has one column where it is not.
    events : (M, E) array_like, optional
        Times in s of E landmarks in each demonstration, from its first sample or of its time stamps, in place of a
        warp: all are aligned to those of the nominal demonstration.
    tau : float, optional
        Time constant in s, discrete; otherwise the nominal duration.
    alpha_z, beta_z : float
        Constants of the output system; `beta_z` is `alpha_z / 4` (critical damping) unless given.
    alpha_x : float, optional
        Constant of the discrete canonical system; otherwise x = 0.01 at the end. Where transport is immediate the
        forcing fades with x past the end of the demonstrations: if a movement drifts off its goal there before it
        settles, `alpha_x = alpha_z` keeps it closest.
    mu : float
        Constant of the rhythmic canonical system.
    threads : int, optional
        How many threads may work on it; otherwise as many as the system allows. The model does not depend on it.
    progress : callable, optional
        Called with the stage and the share of it that is done; an exception it raises ends the fit.

    Returns
    -------
    Model

    Warns
    -----
    UserWarning
        Samples that no movement makes, with their place: time stamps far closer than the others, dropouts written as
        zeros, padding, counters and time stamps among the columns, wrapped angles, angles of different demonstrations
        whole turns apart (taken off where units say that they are angles), and an `alpha_z` too high for the samples.

    Raises
    ------
    ValueError
        Demonstrations or options that do not fit together.
    FitError
        Well-formed demonstrations from which nothing could be learnt.

    References
    ----------
    Matsubara, Hyon, Morimoto, Neural Networks 24 (2011), https://doi.org/10.1016/j.neunet.2011.02.004
    """

def inspected(
    demos: Sequence[Demonstration], *, dt: float | None = None
) -> tuple[list[Demonstration], list[str]]:
    """Inspect demonstrations as `fit` does.

    Parameters
    ----------
    demos : list of Demonstration
        Demonstrations of one skill.
    dt : float, optional
        Sampling interval in s of those that carry none.

    Returns
    -------
    list of Demonstration
        The same, without the whole turns by which angles lie apart, as `fit` learns from them.
    list of str
        What is implausible about them, with its place.
    """

def factorise(
    targets: ArrayLike,  # (M, C*D)
    *,
    n_styles: int | None = None,
    singular_value_share: float = 0.9,
) -> Factors:
    """Factorise stacked targets: the truncated singular value decomposition of step 3 of Section 3.2.

    F = UΣVᵀ, S = the first J columns of U, F_basis = the first J rows of ΣVᵀ: of all products of this shape the one
    nearest to F. `fit` does this to its targets. Few factors of many demonstrations are found from products with F
    alone, the others from its Gram matrix or by reflections; which, depends on J, the shape and the singular values.

    Parameters
    ----------
    targets : (M, C·D) array_like
        One row per demonstration.
    n_styles : int, optional
        Number of factors J, at most min(M, C·D); otherwise from `singular_value_share`.
    singular_value_share : float
        Keep the fewest singular values whose sum exceeds this share of the sum of all.

    Returns
    -------
    Factors
        Residuals ‖F·v − σ·u‖ are at most 1e-11 times the largest singular value.

    Raises
    ------
    ValueError
        A J or share out of range; targets that are empty, or not finite.

    References
    ----------
    Eckart and Young, Psychometrika 1 (1936), https://doi.org/10.1007/BF02288367
    """

def load(path: str | PathLike[str]) -> Model:
    """Read a model file.

    Parameters
    ----------
    path : path-like
        A `.safetensors` file written by `Model.save`. A file from elsewhere is data: it runs no code and names no other
        file, takes memory and time in proportion to its size, and moves in finite numbers or not at all. Its checksum
        finds damage, not intent: the movement itself, and all texts in it, are whatever its author wrote.

    Returns
    -------
    Model

    Raises
    ------
    OSError
        A file that cannot be read.
    ModelFileError
        A file that is damaged, not a model, or of another version.
    """

def resample(demo: Demonstration, dt: float) -> Demonstration:
    """Sample a recording anew, at even intervals.

    Samples at t₀, t₀ + dt, … as far as the recording goes; the clock of what is returned starts at 0. Of irregular time
    stamps it makes even ones. They are those of the cubic smoothing spline that generalised cross-validation chooses,
    which meets clean samples. No denser than the recording, they also carry what smoothing takes off the nearest recorded
    ones: noise stays white, and a fit can still smooth it. A denser grid is that of the spline through all samples. Frequencies above 1/(2 dt) are to be
    taken off first, by `lowpass`.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    dt : float
        Sampling interval in s.

    Returns
    -------
    Demonstration
        With its names, units, context and goal.

    Raises
    ------
    ValueError
        An interval that is not positive or leaves fewer than four samples, or a recording without times.
    """

def trim(demo: Demonstration, threshold: float = 0.05) -> Demonstration:
    """Keep the part of a recording in which there is movement.

    That is from the first to the last sample whose speed is at least the share `threshold` of the largest, with the
    speed of all degrees of freedom together, v² = Σ_d (ẏ_d / (max y_d − min y_d))², of the recording as generalised
    cross-validation smooths it. Where noise is faster than the threshold, a movement counts that surpasses noise
    somewhere, from where the threshold is passed. The samples stay as they were recorded.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    threshold : float
        Share of the peak speed, between 0 and 1.

    Returns
    -------
    Demonstration
        With its names, units, context and goal. Time stamps stay as they are.

    Raises
    ------
    ValueError
        A threshold that is no share, or a recording that stands still, moves for fewer than four samples, or has no
        times.
    """

def cut(demo: Demonstration, times: ArrayLike) -> list[Demonstration]:  # one fewer than times
    """Cut a recording at given times into one movement from each to the next.

    Each is sampled evenly, as densely as the recording at most, with both ends: it begins and ends at the very times that
    are given. As with `resample`, noise stays white.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`.
    times : (K,) array_like
        At least two times in s of the recording's clock, increasing.

    Returns
    -------
    list of Demonstration
        K − 1 of them, with the names, units and context.

    Raises
    ------
    ValueError
        Times that do not increase or lie outside, a part shorter than three sampling intervals, or a recording without
        times.
    """

def lowpass(demo: Demonstration, cut_off: float) -> Demonstration:
    """Filter a recording by a low-pass without phase lag.

    It is the cubic smoothing spline: of a sine of frequency f the share 1/(1 + (f/f_c)⁴) is left, half at the cut-off
    f_c. `pdmp.plot.cut_off` draws what helps to choose that.

    Parameters
    ----------
    demo : Demonstration
        A recording with `dt` or `time`, even or not.
    cut_off : float
        Cut-off frequency in Hz.

    Returns
    -------
    Demonstration
        At the same times, with its names, units, context and goal.

    Raises
    ------
    ValueError
        A cut-off that is not positive, not below half the sampling rate or below a ten-thousandth of it, or a recording
        without times.

    References
    ----------
    C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967), https://doi.org/10.1007/BF02162161
    """

def residuals(demo: Demonstration, cut_offs: ArrayLike) -> _Array:  # (K, D)
    """What `lowpass` takes off at each of K cut-offs [Hz]: root mean squares (K, D), in the unit of each degree of freedom."""

def period(demo: Demonstration) -> float:
    """Find the period of a cyclic recording.

    Positions and velocities of all degrees of freedom, each less its linear trend, are correlated with themselves k
    samples later; A(k) is the mean of these correlations. The period is the first peak of A that is as high as the
    highest, but for what varies from cycle to cycle; half a cycle, and the period of a harmonic, make lower ones, and
    an odd cycle is no matter. A parabola finds it to a part of a sample. Peaks that noise of the same memory makes by
    chance are none: the fewer independent samples overlap, the higher a peak must be.

    Parameters
    ----------
    demo : Demonstration
        A recording of at least one cycle and a half, with `dt` or `time`.

    Returns
    -------
    float
        The period in s.

    Raises
    ------
    ValueError
        A recording whose peaks are all below 0.35 or by chance, that stands still, or has no times.

    References
    ----------
    P. McLeod, G. Wyvill, A smarter way to find pitch, International Computer Music Conference 2005
    """

def fill(
    position: ArrayLike,  # (T, D)
    time: ArrayLike,  # (T,)
    names: Sequence[str],  # D of them
    turns: Sequence[float],  # D of them; 0 where no angle
    max_gap: float,
) -> _Array:  # (T, D)
    """Positions (T, D) with NaN interpolated in gaps up to `max_gap` seconds; `turns` (D,) of angles, 0 of others, NaN where it is
    not known.
    """

def cycles(
    recordings: _Demos,
    events: Sequence[ArrayLike] | None,  # one (K,) for each recording
    average: bool,
) -> tuple[
    list[Demonstration],
    _Array,  # (K,)
    list[list[float]],  # (K, D)
    list[int],
    list[tuple[int, float, float, str, bool]],
    list[tuple[int, int, float, int]],
]:
    """Cuts recordings into cycles: what `pdmp.preprocessing.cycles` calls."""

@final
class Model:
    """A parametric dynamic movement primitive: immutable, picklable, saved by `save`.

    Made by `fit` and `load`.
    """
    @property
    def kind(self) -> _Kind:
        """ "discrete" or "rhythmic"."""
    @property
    def n_demos(self) -> int:
        """Number of demonstrations M."""
    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom D."""
    @property
    def n_styles(self) -> int:
        """Dimension J of the style parameter."""
    @property
    def tau(self) -> float:
        """Time constant of the nominal demonstration in s."""
    @property
    def alpha_z(self) -> float:
        """Rate of the output system."""
    @property
    def beta_z(self) -> float:
        """Stiffness of the output system."""
    @property
    def alpha_x(self) -> float | None:  # None if rhythmic
        """Rate of the discrete canonical system; None if rhythmic."""
    @property
    def braking(self) -> float | None:  # None if rhythmic or transport is immediate
        """Rate per unit of the clock at which a discrete movement brakes past its end; None if rhythmic, or if transport
        is immediate, where the forcing fades with the phase.
        """
    @property
    def mu(self) -> float | None:  # None if discrete
        """Rate of the amplitude; None if discrete."""
    @property
    def names(self) -> list[str]:
        """Names of the degrees of freedom."""
    @property
    def units(self) -> list[str]:  # "" where unknown
        """Units of the degrees of freedom; "" where one is not known."""
    @property
    def nominal(self) -> int:
        """Index of the nominal demonstration."""
    @property
    def styles(self) -> _Array:  # (M, J)
        """Styles S of the demonstrations (M, J)."""
    @property
    def singular_values(self) -> _Array:  # decreasing: all, or of a large library the first J
        """Singular values of the targets, in decreasing order: all min(M, C·D) of them, or the first J alone, where
        n_styles was given and is so small beside the library that the others were not computed.
        """
    @property
    def truncation_error(
        self,
    ) -> float:  # share of the targets, by RMS, that J styles leave out
        """Share of the targets F, by root mean square, that the J styles leave out: ‖F − S·F_basis‖/‖F‖."""
    @property
    def noise(self) -> _Array:  # (D,), standard deviation
        """Standard deviation of the measurement noise of each degree of freedom (D,), in its unit, by generalised
        cross-validation: 0 where none was found, or none was looked for (`smoothing=None`).
        """
    @property
    def cut_offs(self) -> _Array:  # (D,), Hz, inf where nothing is smoothed
        """Cut-offs of the smoothing (D,) in Hz, at which a sine keeps half of its amplitude; inf where every sample is met."""
    @property
    def dof_scale(self) -> _Array:  # (D,)
        """Unit of each degree of freedom in the factorisation (D,)."""
    @property
    def goals(self) -> _Array:  # (M, D)
        """Goals of the demonstrations (M, D)."""
    @property
    def starts(self) -> _Array:  # (M, D)
        """First positions of the demonstrations (M, D)."""
    @property
    def anchors(self) -> _Array:  # (M, D)
        """Mean positions of the demonstrations (M, D), the anchors of cycles."""
    @property
    def breaks(self) -> _Array:  # (K+1,), K = 1 where time is scaled linearly
        """Phases (K+1,) from 0 to 1 that divide the movement into segments; K = 1 where time is scaled linearly."""
    @property
    def segment_durations(self) -> _Array:  # (M, K)
        """Timings of the demonstrations (M, K): the time in s that each spends in each segment."""
    @property
    def durations(self) -> _Array:  # (M,)
        """Durations or periods of the demonstrations (M,) in s: the sums of their segment_durations."""
    @property
    def contexts(self) -> _Array | list[list[float | str]] | None:  # (M, Q)
        """Contexts of the demonstrations (M, Q), if they had any: an array, or lists where there are labels."""
    @property
    def map(self) -> ContextMap | None:
        """What leads from contexts to movements, if there are any."""
    @property
    def regression(self) -> str:  # what was chosen, in one line
        """What was chosen for the basis functions, in one line."""
    @property
    def table_error(self) -> float:  # estimated error of the compiled landscape
        """Estimated error of the compiled landscape, relative to its largest value."""
    def rollout(
        self,
        conditions: Conditions | None = None,
        *,
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | None = None,  # (Q,)
        **changes: Unpack[_Changes],
    ) -> Trajectory:
        """Compute the movement under constant conditions.

        Integrates τż = α_z(β_z(c − y) − z), τẏ = z + w about the frame c, with w = x·sᵀb (discrete) or r·sᵀb (rhythmic),
        exactly. Conditions that are not given are those of the nominal demonstration.

        Parameters
        ----------
        conditions : Conditions, optional
            Conditions at the start.
        dt : float
            Interval between samples in s.
        duration : float, optional
            Length in s; otherwise the demonstrated duration scaled by `tau`, or the sum of `segment_durations`; one period if
            rhythmic.
        context : array_like, (Q,), optional
            Context whose prediction supplies style, goal, start or anchor, and duration where they are not given.
        **changes
            Single conditions by name (see `Conditions`), in place of those of `conditions`.

        Returns
        -------
        Trajectory
            n + 1 samples, n = duration / dt rounded down.

        Raises
        ------
        ValueError
            A wrong length, a number that is not finite, or a condition that this kind of primitive does not have.
        TypeError
            An unknown keyword, or conditions of another type.

        Examples
        --------
        >>> model.rollout(goal=[0.4, 0.1], tau=2.0, dt=0.001).position.shape
        (2001, 2)
        """
    def conditions(self, demos: int | Sequence[int]) -> Conditions:
        """Return the conditions of one demonstration, or the mean of several.

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
            No index, one that is no whole number, or one outside the demonstrations.

        Examples
        --------
        >>> trajectory = model.rollout(model.conditions(3))
        """
    def rollouts(
        self,
        styles: ArrayLike,  # (B, J)
        *,
        goals: ArrayLike | None = None,  # (D,) or (B, D), as are starts, velocities and anchors
        starts: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        anchors: ArrayLike | None = None,
        amplitude: float | None = None,
        tau: float | None = None,
        dt: float = 0.01,
        duration: float | None = None,
        derivatives: int = 1,  # at most 2
        out: Sequence[_Array] | None = None,
        threads: int | None = None,
    ) -> tuple[_Array, ...]:  # positions and as many derivatives (B, T, D)
        """Movements of many styles.

        For constant style, goal and tau a movement is linear in its conditions: a batch is one product of coefficients
        with response curves, which the model remembers for a few of the last (dt, tau, duration). Agrees with `rollout`
        to rounding.

        Parameters
        ----------
        styles : array_like, (B, J)
            Style parameters s.
        goals : array_like, (D,) or (B, D), optional
            Goals g of all or of each, discrete.
        starts : array_like, (D,) or (B, D), optional
            Start positions; rhythmic movements otherwise start on their cycles.
        velocities : array_like, (D,) or (B, D), optional
            Start velocities per s; otherwise as in the demonstrations.
        anchors : array_like, (D,) or (B, D), optional
            Anchors y_a of all or of each, rhythmic.
        amplitude, tau, dt, duration
            As in `rollout`, of all.
        derivatives : int
            0 for positions alone, 1 with velocities, 2 with accelerations too.
        out : tuple of float64 arrays (B, T, D), optional
            Where to write, one array for positions and each derivative.
        threads : int, optional
            How many threads may work; otherwise as many as the system has. The numbers do not depend on it.

        Returns
        -------
        tuple of ndarray, (B, T, D)
            Positions, velocities per s, accelerations per s².

        Raises
        ------
        ValueError
            Rows that do not match the styles, a wrong length, a number that is not finite, an argument of the other
            kind of primitive, or an output that does not fit; nothing is written then.
        MemoryError
            More numbers than memory holds: see `rollout_chunks`.
        """
    def rollout_chunks(
        self,
        styles: ArrayLike,  # (B, J)
        *,
        size: int = 1000,
        goals: ArrayLike | None = None,  # (D,) or (B, D), as are starts, velocities and anchors
        starts: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        anchors: ArrayLike | None = None,
        amplitude: float | None = None,
        tau: float | None = None,
        dt: float = 0.01,
        duration: float | None = None,
        derivatives: int = 1,
        threads: int | None = None,
    ) -> RolloutChunks:
        """Movements of many styles, a piece at a time: what `rollouts` returns for each piece, in order.

        Only one piece is in memory at a time, and the numbers are those of `rollouts` to the last bit. All arguments are
        checked by this call.

        Parameters
        ----------
        styles, goals, starts, velocities, anchors, amplitude, tau, dt, duration, derivatives, threads
            As in `rollouts`.
        size : int
            Movements in a piece; the last may have fewer.

        Returns
        -------
        iterator of tuple of ndarray, (size, T, D)

        Raises
        ------
        ValueError
            As for `rollouts`, or a size below 1.

        Examples
        --------
        >>> for positions, velocities in model.rollout_chunks(styles, size=1000):
        ...     cost.append((velocities**2).sum(axis=(1, 2)))
        """
    def jacobian(
        self,
        wrt: Literal["style", "goal", "anchor", "start"],
        conditions: Conditions | None = None,
        *,
        derivative: int = 0,  # at most 2
        dt: float = 0.01,
        duration: float | None = None,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> _Array:  # (T, D, J) or (T, D, D)
        """Compute the Jacobian ∂y/∂v of a rollout's positions with respect to one of its conditions v.

        A movement is linear in style, goal, anchor and start: y(v + Δv) = y(v) + (∂y/∂v)Δv exactly, with the same
        Jacobian for all their values. It depends on which of `start` and `velocity` are given, on amplitude and on tau.

        Parameters
        ----------
        wrt : {"style", "goal", "anchor", "start"}
            Condition with respect to which to differentiate.
        conditions : Conditions, optional
            Conditions at the start.
        derivative : int
            0 for positions, 1 for velocities, 2 for accelerations.
        dt, duration, context, **changes
            As in `rollout`.

        Returns
        -------
        ndarray, (T, D, J) with respect to the style, (T, D, D) otherwise

        Raises
        ------
        ValueError
            Conditions that do not fit, a condition that this kind of primitive does not have, or segment durations of
            several segments.

        Examples
        --------
        >>> model.jacobian("goal", dt=0.001).shape
        (1001, 2, 2)
        """
    def style_of(
        self,
        demonstration: Demonstration,
        *,
        dt: float | None = None,
        period: float | None = None,
        events: ArrayLike | None = None,  # (E,)
    ) -> _Array:  # (J,)
        """The style (J,) of a new demonstration: the likeliest given its target.

        Minimises ‖f − As‖²/σ² + Σ s_j²/v_j, with A the forcing of the styles, σ² what least squares leave of the target f
        and v_j the largest square of the demonstrations' styles. A cycle that begins in another phase than those of the
        model is turned to theirs first. The demonstration is inspected as in `fit`, with the same warnings.

        Parameters
        ----------
        demonstration : Demonstration
            A movement of the same degrees of freedom.
        dt, period : float, optional
            As in `fit`.
        events : array_like, (E,), optional
            Times of its events in s, if the model was fitted with events; where time was warped, its own is too.

        Returns
        -------
        ndarray, (J,)

        Raises
        ------
        ValueError
            Names or units other than those of the model; a demonstration that it does not describe, where the movement of
            the closest style deviates by more than half of the demonstration's own and its forcing by more than three times
            what is left out of those fitted, or where the style is more than ten times as large as any of theirs.
        """
    def landscape(self, u: ArrayLike) -> _Array:  # (len(u), J, D)
        """The attractor landscape b(u) of each style dimension and degree of freedom.

        Parameters
        ----------
        u : array_like, (n,)
            Clock: t / tau where discrete, the phase in rad where rhythmic.

        Returns
        -------
        ndarray, (n, J, D)
        """
    def transport(self, u: ArrayLike) -> _Array:  # (n,)
        """Share m(u) of the way from start to goal that a discrete movement has covered, from 0 at the start to 1 from
        the end on.

        The output system moves about the frame c(u) = y₀ + (g − y₀)·m(u); m ≡ 1 where the model was fitted with
        ``transport="immediate"``.

        Parameters
        ----------
        u : array_like, (n,)
            Clock: t / tau.

        Returns
        -------
        ndarray, (n,)

        Raises
        ------
        ValueError
            A rhythmic primitive, or a clock that is negative or not finite.
        """
    def tau_at(self, phase: float, segment_durations: ArrayLike) -> float:  # (K,)
        """The time constant in s at a phase of a movement with the given timing.

        A control loop that sets it at every tick follows the timing, as `rollout` does:
        `controller.tau = model.tau_at(controller.phase, grid)`, with `transition=0`.

        Parameters
        ----------
        phase : float
            Phase of a controller: x in (0, 1] where discrete, φ in rad where rhythmic.
        timing : array_like, (K,)
            Time in s in each segment between `breaks`.

        Raises
        ------
        ValueError
            A timing that does not fit the model, or a phase out of range.
        """
    def predict(self, context: _Context) -> Prediction:
        """The movement for a condition, as in Section 4.1.2.

        Parameters
        ----------
        context : array_like or list, (Q,)
            The condition.

        Returns
        -------
        Prediction

        Raises
        ------
        ValueError
            A model fitted without contexts, a wrong length, a label never shown, or a number that is not finite.
        """
    def band(
        self,
        context: _Context,  # (Q,)
        *,
        level: float = 0.9,
        dt: float = 0.01,
    ) -> tuple[_Array, _Array]:  # lower, upper (T, D)
        """Bounds within which a new movement of a condition lies, for each sample of `rollout(context=context, dt=dt)`.

        y ± t·√(aᵀΣa + v), with the covariance Σ of the prediction, the derivatives a of y with respect to what is
        predicted, the variance v that the styles leave out of the demonstrations, and Student's quantile t for the
        degrees of freedom. Movements are compared at equal shares of their durations: how these vary is in the
        prediction.

        Parameters
        ----------
        context : array_like or list, (Q,)
            The condition.
        level : float
            Probability that a number lies within its bounds.
        dt : float
            Interval between samples in s.

        Returns
        -------
        lower, upper : (T, D) ndarray
            In the unit of each degree of freedom.

        Raises
        ------
        ValueError
            A level that is no probability, what `predict` refuses, or demonstrations too few to tell a band.
        """
    def save(self, path: str | PathLike[str]) -> None:
        """Write a model file. It appears whole or not at all, whatever interrupts the writing; a process that is killed
        meanwhile leaves a draft `.pdmp-*.draft` beside it.

        Parameters
        ----------
        path : path-like
            Where to, by custom with the suffix `.safetensors`.

        Raises
        ------
        OSError
            A path that cannot be written.
        """
    def controller(
        self,
        dt: float = 0.001,
        conditions: Conditions | None = None,
        *,
        transition: float | None = None,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> Controller:
        """Start a control loop.

        Parameters
        ----------
        dt : float
            Length of a tick in s.
        conditions : Conditions, optional
            Conditions at the start. Of segment durations the loop takes the total, and follows them where `tau_at` sets
            its τ.
        transition : float, optional
            Time in s to 99 % of a changed style, goal, anchor, amplitude, tau or speed, at the model's own tau; 0 is the
            paper's immediate switch. By default a tenth of the nominal duration (discrete) or a quarter of the period
            (rhythmic). A goal takes the remaining time of the movement if that is longer, unless transport is immediate.
        context, **changes
            As in `rollout`.

        Returns
        -------
        Controller
        """
    def to_bytes(self) -> bytes:
        """The bytes of a model file."""
    @staticmethod
    def from_bytes(data: bytes) -> Model:
        """A model from the bytes of a model file."""
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class RolloutChunks:
    """An iterator over pieces of a batch, made by `Model.rollout_chunks`."""
    def __iter__(self) -> RolloutChunks: ...
    def __next__(self) -> tuple[_Array, ...]: ...

@final
class Factors:
    """The leading factors of targets F ≈ S·F_basis (Eq. 7), as `pdmp.factorise` finds them."""
    @property
    def styles(self) -> _Array:  # (M, J)
        """Styles S (M, J) with orthonormal columns, in each of which the entry of largest magnitude is positive."""
    @property
    def basis(self) -> _Array:  # (J, C*D)
        """Basis targets F_basis (J, C·D) = SᵀF, whose rows are orthogonal and as long as the singular values."""
    @property
    def singular_values(self) -> _Array:  # decreasing: all, or of a large library the first J
        """Singular values in decreasing order: all min(M, C·D), or the first J alone, where the others were not computed."""
    @property
    def truncation_error(self) -> float:
        """Share of the targets, by root mean square, that the factors leave out: ‖F − S·F_basis‖/‖F‖."""

class _Changes(TypedDict, total=False):
    style: ArrayLike | None  # (J,)
    goal: ArrayLike | None  # (D,), as are start, velocity and anchor
    start: ArrayLike | None
    velocity: ArrayLike | None
    anchor: ArrayLike | None
    amplitude: float | None
    tau: float | None
    segment_durations: ArrayLike | None  # (K,)
    phase: float | None

@final
class Conditions:
    """Conditions under which a movement starts. A condition that is None is that of the nominal demonstration.

    Rollouts, controllers and Jacobians take conditions, with keywords of the same names in place of single ones;
    `Model.conditions`, `Model.predict` and `blend` return them.

    Parameters
    ----------
    style : array_like, (J,), optional
        Style parameter s.
    goal : array_like, (D,), optional
        Goal g; discrete.
    start : array_like, (D,), optional
        Start position y₀. A rhythmic movement otherwise starts on its limit cycle.
    velocity : array_like, (D,), optional
        Start velocity per s; otherwise that of the demonstrations.
    anchor : array_like, (D,), optional
        Anchor y_a, the centre of oscillation; rhythmic.
    amplitude : float, optional
        Amplitude r₀, 1 as demonstrated; rhythmic.
    tau : float, optional
        Time constant τ in s.
    segment_durations : array_like, (K,), optional
        Time in s in each segment between `Model.breaks`, in place of `tau`. Time over phase is the monotone cubic through
        them. A rollout follows it; a controller takes the total, and `Model.tau_at` gives its τ at each phase.
    phase : float, optional
        Phase φ in rad at which a rhythmic movement starts, on its limit cycle; 0 otherwise.

    Raises
    ------
    ValueError
        A condition that is not a number or a vector of numbers. Lengths and kind are checked where a model takes them.

    Examples
    --------
    >>> slow = pdmp.Conditions(goal=[0.4, 0.1], tau=2.0)
    >>> fast = slow.replace(tau=0.5)
    >>> pdmp.blend(slow, fast, 0.5).tau
    1.25
    """
    def __new__(cls, **conditions: Unpack[_Changes]) -> Conditions: ...
    def replace(self, **changes: Unpack[_Changes]) -> Conditions:
        """Return the same conditions with others in place of those named; None leaves one to the nominal demonstration.

        Parameters
        ----------
        **changes
            Conditions by name. `tau` takes the place of `segment_durations`, and the other way round.

        Returns
        -------
        Conditions
        """
    @property
    def style(self) -> _Array | None:  # (J,)
        """Style parameter s (J,)."""
    @property
    def goal(self) -> _Array | None:  # (D,)
        """Goal g (D,), discrete."""
    @property
    def start(self) -> _Array | None:
        """Start position y₀ (D,)."""
    @property
    def velocity(self) -> _Array | None:
        """Start velocity (D,), per s."""
    @property
    def anchor(self) -> _Array | None:
        """Anchor y_a (D,), rhythmic."""
    @property
    def amplitude(self) -> float | None:
        """Amplitude r₀, rhythmic."""
    @property
    def tau(self) -> float | None:
        """Time constant τ in s."""
    @property
    def segment_durations(self) -> _Array | None:  # (K,)
        """Time in s in each segment (K,)."""
    @property
    def phase(self) -> float | None:
        """Phase φ in rad at which a rhythmic movement starts."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

def blend(a: Conditions, b: Conditions, share: float) -> Conditions:
    """Returns the conditions (1 − share)·a + share·b.

    Parameters
    ----------
    a, b : Conditions
        Conditions with the same names, such as two of `Model.conditions`.
    share : float
        0 gives `a`, 1 gives `b`; values outside [0, 1] extrapolate.

    Returns
    -------
    Conditions

    Raises
    ------
    ValueError
        A condition that one of the two lacks, lengths that differ, or a share that is not finite.
    """

@final
class Prediction:
    """Movement predicted for a context."""
    @property
    def conditions(self) -> Conditions:
        """Style, goal and start or anchor, and segment durations."""
    @property
    def duration(self) -> float:
        """Duration or period in s."""
    @property
    def covariance(self) -> _Array | None:  # of all conditions in this order, (P, P)
        """Covariance (P, P) of style, goal and start or anchor, and segment durations of a new movement, in this order; None
        where the demonstrations leave no degree of freedom to estimate it.
        """
    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the covariance."""
    @property
    def extrapolation(self) -> _Array:  # (Q,), in ranges of the demonstrated contexts
        """Distance of each context value from the demonstrated ones, in their range (Q,): 0 inside and for labels, infinite
        where a value that never varied differs.
        """

@final
class ContextMap:
    """A map from contexts to outputs, with the covariance of what it predicts.

    What `fit` learns from contexts to style, goal, start and duration (Section 4.1.2 of the paper), for any outputs:
    y = φ(h)ᵀβ + f(h) + ε for each principal component. "linear" is least squares, φ = (1, h) and no f; "polynomial" and
    "gp" have a constant and a Gaussian process f, with the kernel of the polynomials of second degree or Matérn-5/2. The
    ratio of f to the noise is found by restricted maximum likelihood, for each component; the length, by the error at
    contexts left out. "stacked" combines the deviations g of "gp" and l of a line with penalised slopes from the mean,
    w_g·g + w_l·l, with the weights of least error at contexts left out: w_g + w_l = 1 inside of the contexts given,
    w_g + w_l ≤ 1 from a tenth of their range outside on. Numbers are compared by their spread, labels by whether they are
    the same; repetitions of one context are averaged and count once.

    Parameters
    ----------
    contexts : (M, Q) array_like, or M lists of Q numbers and labels
        Conditions.
    outputs : (M, P) array_like
        What was shown in each.
    map : {"auto", "stacked", "gp", "linear", "polynomial"}
        As for `fit`.

    Raises
    ------
    ValueError
        Contexts and outputs that do not fit together, or numbers that are not finite.

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
        """Which kind of map it is."""
    @property
    def errors(self) -> list[tuple[str, float]]:
        """Mean squared error of each kind that was tried, at contexts left out one by one, with the constants of all."""
    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom from which the covariance is known."""
    def predict(self, contexts: _Contexts) -> tuple[_Array, _Array | None]:
        """Expected outputs (B, P) for contexts (B, Q), and the covariance (B, P, P) of new ones, or None if unknown."""

@final
class Trajectory:
    """A generated movement: row k of each array is the state at `time[k]`.

    `Demonstration(trajectory)` is the movement as a demonstration, as is a trajectory in a list for `fit`.
    """
    @property
    def time(self) -> _Array:  # (T,)
        """Times (T,) in s, from 0."""
    @property
    def position(self) -> _Array:  # (T, D)
        """Positions (T, D), in the unit of each degree of freedom."""
    @property
    def velocity(self) -> _Array:  # (T, D)
        """Velocities (T, D), per s."""
    @property
    def acceleration(self) -> _Array:  # (T, D)
        """Accelerations (T, D), per s²."""
    @property
    def names(self) -> list[str]:
        """Names of the degrees of freedom."""
    @property
    def units(self) -> list[str]:  # "" where unknown
        """Units of the degrees of freedom; "" where one is not known."""
    def to_dict(self) -> dict[str, Any]:
        """Returns arrays, names and units by their names; `numpy.savez(path, **trajectory.to_dict())` writes what
        `io.read_npz` reads.
        """
    def to_dataframe(self) -> Any:  # pandas.DataFrame
        """Returns a pandas.DataFrame.

        Its index is the time `t` in s. Its columns are the position of each degree of freedom under its name, then
        velocities under `<name>_velocity` and accelerations under `<name>_acceleration`; `attrs["units"]` has the unit
        of each column. `Demonstration(frame[names], time=frame.index)` is the movement as a demonstration.

        Raises
        ------
        ImportError
            pandas is not installed.
        """
    def to_csv(self, path: str | PathLike[str]) -> None:
        """Writes a CSV file, whose positions `io.read_csv` reads back: `io.write_csv` describes it.

        Parameters
        ----------
        path : path-like
            Where to write.

        Raises
        ------
        OSError
            A file that cannot be written.
        ValueError
            Names that would not be read back.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Status:
    """Whether a movement goes on (`WORKING`, 1) or has settled on its goal (`FINISHED`, 2, and false)."""

    WORKING: ClassVar[Status]
    FINISHED: ClassVar[Status]
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __bool__(self) -> bool: ...
    def __int__(self) -> int: ...

@final
class Controller:
    """A running primitive, made by `Model.controller`.

    `step` moves on by one tick and writes into `position`, `velocity` and `acceleration`, which are read-only views
    that stay valid. `goal`, `style`, `tau`, `amplitude`, `anchor` and `compliance` can be set at any tick; values that
    are refused leave the last good ones in force.
    """
    def __copy__(self) -> Controller: ...
    def __deepcopy__(self, _memo: Any, /) -> Controller: ...
    def step(
        self,
        dt: float | None = None,
        *,
        measured: ArrayLike | None = None,  # (D,)
        coupling: tuple[ArrayLike, ArrayLike] | None = None,  # velocity and acceleration (D,)
    ) -> Status:
        """One tick, perturbed if the robot is measured or terms of one's own are given:

            tau y' = z + w(u) + k_t d + tau c_v
            tau z' = alpha_z (beta_z (g - y) - z) + tau**2 c_a
            tau u' = k = 1 / (1 + k_s |d / range|**2)
            tau o' = 5 k (e - o) / extent

        with the gains (k_s, k_t) of `compliance` and the phase x = exp(-alpha_x u) or phi = u. Of the error e = m - y
        counts d, what lies beyond the error o that is expected by now; extent is T / tau or 2 pi. All is evaluated at
        the start of the tick and held over it; however long it is, y is pulled no further than m. A robot that is held
        fast so holds the movement, all but stops its phase, and, let go, continues from there; one that always lags or
        sags by the same comes no further from the goal than that, and finishes.

        Parameters
        ----------
        dt : float, optional
            Length of this tick in s, if it differs from the controller's. A tick of length zero changes nothing.
        measured : array_like (D,), optional
            Position m at which the robot is, in the unit of each DoF; the error of an angle (rad, deg, °) is taken the
            short way round. None is no new measurement: the last distance m - y stays in force until the next one or
            `release`, so that a sensor may be slower than the loop.
        coupling : tuple of two array_like (D,), optional
            Terms (c_v, c_a), per s and per s²: the velocity gains c_v, and jumps where it does; the acceleration c_a.

        Returns
        -------
        Status
            `FINISHED` once a discrete movement's time is over and it has settled on its goal.

        Raises
        ------
        ValueError
            A tick that is negative or longer than 1000 tau, a wrong length, or a number that is not finite; the
            state then stays as it was.

        References
        ----------
        Ijspeert, Nakanishi, Schaal, ICRA 2002, doi:10.1109/ROBOT.2002.1014739 (phase stopping, term in y').
        Schaal, Mohajerian, Ijspeert, Progress in Brain Research 165, 2007, doi:10.1016/S0079-6123(06)65027-9.
        Pastor, Hoffmann, Asfour, Schaal, ICRA 2009, doi:10.1109/ROBOT.2009.5152385 (terms in z').
        """
    def release(self) -> None:
        """Forget the measured position: no robot follows any more, until the next one is measured."""
    def reset(
        self,
        conditions: Conditions | None = None,
        *,
        context: _Context | None = None,
        **changes: Unpack[_Changes],
    ) -> None:
        """Start again.

        Parameters
        ----------
        conditions : Conditions, optional
            Conditions at the start. One that is not given is that of the nominal demonstration, not a command of before.
        context, **changes
            As in `Model.rollout`.

        Raises
        ------
        ValueError
            Conditions that `Model.rollout` rejects; the movement then continues.
        """
    @property
    def dt(self) -> float:
        """Length of a tick in s."""
    @property
    def position(self) -> _Array:  # (D,), a read-only view that each step updates
        """Position y (D,): a read-only view."""
    @property
    def velocity(self) -> _Array:
        """Velocity (D,) per s: a read-only view."""
    @property
    def acceleration(self) -> _Array:
        """Acceleration (D,) per s²: a read-only view."""
    @property
    def status(self) -> Status:
        """Whether the movement goes on: what the last `step` returned, or `WORKING` if something was commanded since."""
    @property
    def phase(self) -> float:  # x in (0, 1], or phi in [0, 2 pi)
        """Phase: x in (0, 1] where discrete, φ in [0, 2π) where rhythmic."""
    @property
    def time(self) -> float:
        """Time since the start in s."""
    @property
    def goal(self) -> _Array:
        """Goal g (D,), discrete: a read-only copy, to be set as a whole."""
    @goal.setter
    def goal(self, goal: ArrayLike, /) -> None: ...
    @property
    def style(self) -> _Array:
        """Style s (J,): a read-only copy, to be set as a whole."""
    @style.setter
    def style(self, style: ArrayLike, /) -> None: ...
    @property
    def anchor(self) -> _Array:
        """Anchor y_a (D,), rhythmic: a read-only copy, to be set as a whole."""
    @anchor.setter
    def anchor(self, anchor: ArrayLike, /) -> None: ...
    @property
    def tau(self) -> float:
        """Time constant in s."""
    @tau.setter
    def tau(self, tau: float, /) -> None: ...
    @property
    def amplitude(self) -> float:
        """Amplitude r₀, rhythmic; 1 where discrete."""
    @amplitude.setter
    def amplitude(self, amplitude: float, /) -> None: ...
    @property
    def speed(self) -> float:
        """Speed: the share of the rate 1 / tau at which the path is followed. 0 pauses on the path, 1 goes on; a change
        passes the filter of tau, and stays in force over `reset`.
        """
    @speed.setter
    def speed(self, speed: float, /) -> None: ...
    @property
    def compliance(self) -> tuple[float, float]:  # stopping k_s, tracking k_t
        """Gains (k_s, k_t) of a measured position: how much it stops the phase, and pulls per unit of u. 0 is without."""
    @compliance.setter
    def compliance(self, compliance: tuple[float, float], /) -> None: ...

@final
class GP:
    """Gaussian process regression, the paper's choice of basis functions.

    All outputs share kernel, length and noise ratio. What is not given is found by maximising the marginal likelihood
    (Rasmussen and Williams 2006, Section 5.4.1): `regress` by itself searches noise ratios from 1e-10 to 1e4. As a basis
    of `fit`, noise that is not given is at most 1e-6 of the signal's variance and of the targets' mean square: what the
    landscape takes for noise no style brings back, and noise on demonstrations is what smoothing is for.

    Parameters
    ----------
    kernel : {"matern52", "matern32"}
        Covariance function of the clock; wrapped around the circle where the movement is rhythmic.
    length : float, optional
        Length scale, in units of the clock u = t / tau.
    noise : float, optional
        Ratio of noise variance to signal variance, at least 1e-10.

    Raises
    ------
    ValueError
        An unknown kernel, or a number out of range.
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
        """Length scale, if one was given."""
    @property
    def noise(self) -> float | None:
        """Noise ratio, if one was given."""
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> GPRegression:
        """Regress targets on the clock.

        Parameters
        ----------
        u : array_like, (C,)
            Increasing inputs from 0; within [0, 2π) if periodic.
        targets : array_like, (C, P)
            Outputs.
        periodic : bool
            Whether 2π and 0 are one.

        Returns
        -------
        GPRegression
        """

@final
class GPRegression:
    """A Gaussian process given data, f(u) ~ N(0, σ̂²K) for each of P outputs, with K = k(u, u′) + νI."""
    @property
    def kernel(self) -> _Kernel:
        """Name of the covariance function."""
    @property
    def length(self) -> float:
        """Length scale that was used, in units of the clock."""
    @property
    def noise(self) -> float:
        """Ratio ν of noise to signal variance that was used."""
    @property
    def signal_variance(self) -> float:  # in the squared unit of the outputs
        """Signal variance σ̂² = Σ fᵀK⁻¹f/(CP), its likeliest value, in the squared unit of the outputs.

        All outputs share it. The variance of the noise is noise * signal_variance.
        """
    @property
    def log_likelihood(self) -> float:  # summed over the outputs
        """Log marginal likelihood of the data, −CP/2·(ln 2πσ̂² + 1) − P/2·ln|K|, summed over the outputs.

        Of densities in the unit of the outputs; 0 where all of them are zero.
        """
    def predict(self, u: ArrayLike) -> tuple[_Array, _Array]:  # mean, variance (len(u), P)
        """Mean and variance (n, P) of the outputs, without their noise, at u (n,).

        The variance, σ̂²(1 − kᵀK⁻¹k), is the same for all outputs.
        """

@final
class TimeWarp:
    """Monotone time warp of the demonstrations to the nominal one.

    Movements are compared by q = ẏ/√|ẏ|, of unit size: γ minimises ∫|q₀ − (q∘γ)√γ̇|² + λ ln²γ̇ dp over the phase p, exactly
    among the warps that are linear in each segment, with ends on a grid of a tenth of a segment.

    Parameters
    ----------
    n_segments : int
        Number K of n_segments of equal phase; 1 is linear. At most half the samples of each demonstration, and 1000.
    max_slope : float
        Bound of a segment's time, from 1 to 10: at most `max_slope` times that of linear scaling, at least 1 / `max_slope`.

    Raises
    ------
    ValueError
        A number out of range.

    References
    ----------
    Srivastava, Klassen, Joshi, Jermyn, IEEE TPAMI 33 (2011), https://doi.org/10.1109/TPAMI.2010.184; Nielsen, Carstensen,
    Smedsgaard, J. Chromatography A 805 (1998), https://doi.org/10.1016/S0021-9673(98)00021-1
    """
    def __new__(cls, n_segments: int = 8, max_slope: float = 2.5) -> TimeWarp: ...
    @property
    def n_segments(self) -> int:
        """Number K of n_segments."""
    @property
    def max_slope(self) -> float:
        """Bound of a segment's time, relative to linear scaling."""
    def __getnewargs__(self) -> tuple[int, float]: ...

@final
class NGnet:
    """Normalised Gaussian network: weighted bell functions on the clock, over their sum.

    b(u) = Σ wₖψₖ(u) / Σ ψₖ(u) with ψₖ = exp(−(u − cₖ)²/2s²), or exp((cos(u − cₖ) − 1)/s²) where the movement is
    rhythmic. The centres cₖ lie at equal distances h, for discrete movements up to 2h beyond the ends, and
    s = overlap·h.

    Parameters
    ----------
    n_basis : int
        Number of functions N, from 2 to 1000.
    overlap : float
        Width s of a function in centre spacings h, from 0.3 to 3. Narrow functions ripple between their centres, wide
        ones are nearly dependent.

    Raises
    ------
    ValueError
        A number out of range.

    References
    ----------
    Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, Neural Computation 25 (2013), https://doi.org/10.1162/NECO_a_00393
    """
    def __new__(cls, n_basis: int = 50, overlap: float = 1.2) -> NGnet: ...
    @property
    def n_basis(self) -> int:
        """Number of functions N."""
    @property
    def overlap(self) -> float:  # in centre spacings
        """Width of a function in centre spacings."""
    def regress(
        self,
        u: ArrayLike,  # (C,)
        targets: ArrayLike,  # (C, P)
        *,
        periodic: bool = False,
    ) -> NGnetRegression:
        """Regress targets (C, P) on the clock u (C,), from 0; within [0, 2π) if periodic."""

@final
class NGnetRegression:
    """A normalised Gaussian network given data."""
    def predict(self, u: ArrayLike) -> tuple[_Array, None]:  # mean (len(u), P), no variance
        """The outputs (n, P) at u (n,), and None: the network knows no variance."""
