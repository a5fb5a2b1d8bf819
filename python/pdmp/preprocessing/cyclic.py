"""Cycles of rhythmic recordings."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp import _native
from pdmp._labels import dof_labels
from pdmp._messages import value_error, warn
from pdmp._native import Demonstration


class Rejected(NamedTuple):
    """A rejected cycle or recording."""

    recording: int
    """Index of the recording."""
    start: float
    """Start in s on the recording's clock."""
    period: float
    """Duration in s."""
    reason: str
    """Reason for the rejection."""


class Growth(NamedTuple):
    """Gain of a degree of freedom per cycle of a recording, which is removed from closed cycles."""

    recording: int
    """Index of the recording."""
    dof: int
    """Index of the degree of freedom."""
    gain: float
    """Gain per cycle of median magnitude, in the unit of the degree of freedom."""
    turns: int
    """Full turns of an angle per cycle; 0 for other quantities."""


class Cycles(Sequence[Demonstration]):
    """Closed cycles that begin at a common phase, which `fit` learns as a rhythmic movement.

    Attributes
    ----------
    kind : str
        "rhythmic", which `fit` uses unless it is given a kind.
    contexts : dict or None
        Context values of the cycles by the names of the recordings' contexts.
    periods : (K,) array
        Period of each cycle in s: its number of samples times its dt.
    recordings : list of int
        Index of the recording of each cycle.
    rejected : list of Rejected
        Rejected cycles, and recordings without a period, with the reasons.
    gains : (K, D) array
        Gain of each degree of freedom over each cycle, before its removal; three columns of rad for
        each rotation.
    growths : list of Growth
        Degrees of freedom that turn, or whose gain per cycle exceeds their range within it.
    """

    kind = "rhythmic"

    def __init__(
        self,
        demos: list[Demonstration],
        periods: NDArray[np.float64],
        recordings: list[int],
        rejected: list[Rejected],
        gains: NDArray[np.float64],
        growths: list[Growth],
        contexts: dict[str, list[float | str]] | None = None,
    ) -> None:
        self._demos = demos
        self.periods = periods
        self.recordings = recordings
        self.rejected = rejected
        self.gains = gains
        self.growths = growths
        self.contexts = contexts

    def __len__(self) -> int:
        """Returns the number of cycles K."""
        return len(self._demos)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> list[Demonstration]: ...
    def __getitem__(self, index: Any) -> Any:
        """Returns a cycle, or a list of cycles for a slice."""
        return self._demos[index]

    def __repr__(self) -> str:
        """Returns the number of cycles and the range of their periods."""
        span = f" of {min(self.periods):.3f} to {max(self.periods):.3f} s" if len(self) else ""
        return f"<pdmp.preprocessing.Cycles: {len(self)}{span}, {len(self.rejected)} rejected>"


def cycles(
    recordings: Demonstration | Sequence[Demonstration] | Mapping[str, Demonstration],
    *,
    onsets: ArrayLike | Sequence[ArrayLike] | Mapping[str, ArrayLike] | None = None,
    average: bool = False,
) -> Cycles:
    """Cuts cyclic recordings into closed cycles that begin at the same phase.

    Without onsets, `period` estimates the period of each recording, and matching with a template,
    its mean cycle, finds the beginnings of the cycles. They have the phase of the first sample of
    the first recording; circular cross-correlation of the mean cycles aligns the other recordings.

    A cycle has C samples, the number of samples of its recording in a period. They are those of a
    cubic smoothing spline f, selected by generalised cross-validation, plus its residuals at the
    nearest recorded samples: noise stays white, so that a fit can smooth it. The gain f(T) - f(0)
    is distributed over the cycle, which makes it continuous and keeps its mean::

        y_c = y(c T / C) - (c / C - 1/2) (f(T) - f(0))

    The angle of a wheel or a crank gains full turns per cycle; they are subtracted from each cycle.
    Angles are degrees of freedom with a unit of angle; without units, those that gain one turn, in
    rad or degrees, to a hundredth. For other quantities whose gain per cycle exceeds their range
    within it, such as the distance walked, a warning reports the gain: a model of closed cycles
    stays in place.

    The gain of a rotation is the rotation vector from the orientation at the start to that at the
    end of the cycle, removed in the body frame; full turns per cycle are no gain, as they end in
    the same orientation. Cycles of rotations are found and compared by the elements of rotation
    matrices, on which the signs of quaternions have no effect.

    A cycle is rejected if its period differs from the median of its recording by more than 3.5
    robust standard deviations and 10 %, or if the distance of its shape from the median cycle
    exceeds the median distance by 3.5 robust standard deviations and by a factor of two, and
    exceeds a quarter of the movement's standard deviation. A recording among several without a
    period is rejected with a warning.

    Parameters
    ----------
    recordings : Demonstration, or sequence or mapping of Demonstration
        Recordings of at least one cycle and a half, with `dt` or `time`.
    onsets : (K,) array_like, or one for each recording, optional
        Times in s at which cycles begin, such as foot strikes, on the clock of the recording; the
        last ends the last cycle. For a mapping of recordings, a mapping is possible too.
    average : bool
        Return the mean cycle of each recording instead of all cycles.

    Returns
    -------
    Cycles
        Demonstrations with `dt`, such that T · dt is the period, and with names, units and context.

    Raises
    ------
    ValueError
        No recording with a period (the text gives the autocorrelation of the first); a recording
        without times, or with other degrees of freedom than the first; onsets that do not increase
        or lie outside the recording.

    Warns
    -----
    UserWarning
        A recording without a period; degrees of freedom, other than angles of full turns, whose
        gain per cycle exceeds their range within it.

    References
    ----------
    B. Iglewicz, D. C. Hoaglin, How to detect and handle outliers, ASQC Quality Press 1993
    """
    collection = recordings
    if isinstance(recordings, Mapping) and isinstance(onsets, Mapping):
        if unpaired := sorted(map(str, recordings.keys() ^ onsets.keys())):
            raise value_error(
                f"onsets: '{unpaired[0]}' is among the recordings or the onsets alone"
            )
        onsets = [onsets[name] for name in recordings]
    per_recording = cast("Sequence[ArrayLike] | None", onsets)
    if isinstance(recordings, Demonstration):
        recordings = [recordings]
        per_recording = None if onsets is None else [cast(ArrayLike, onsets)]
    demos, periods, gains, sources, outliers, gained = _native.cycles(
        recordings, per_recording, average
    )
    for recording, _, _, reason, is_recording in outliers:
        if is_recording:
            warn(f"recording {recording} is left out: {reason}")
    growths = [Growth(*growth) for growth in gained]
    if gaining := [growth for growth in growths if not growth.turns]:
        warn(_gains(gaining, demos))
    rejected = [Rejected(*cycle[:4]) for cycle in outliers]
    names = getattr(collection, "contexts", None) or {}
    contexts = {name: [column[k] for k in sources] for name, column in names.items()}
    return Cycles(demos, periods, sources, rejected, np.array(gains), growths, contexts or None)


def _gains(growths: list[Growth], demos: list[Demonstration]) -> str:
    """Returns a warning about gains from cycle to cycle."""
    n = demos[0].n_coordinates if demos else 0
    names = (demos[0].names if demos else None) or [f"y{d}" for d in range(n)]
    units = (demos[0].units if demos else None) or [""] * n
    names, units = dof_labels(names, units, demos[0].rotations if demos else {})
    gains = []
    for dof in sorted({growth.dof for growth in growths}):
        largest = max((g for g in growths if g.dof == dof), key=lambda growth: abs(growth.gain))
        name = names[dof] if names else f"y{dof}"
        unit = f" {units[dof]}" if names and units[dof] else ""
        gains.append(f"'{name}' gains {largest.gain:.3g}{unit} in recording {largest.recording}")
    return (
        f"more is gained per cycle than moved within one: {', '.join(gains)}; closed cycles lack "
        "the gain, and a model of them stays in place: leave these degrees of freedom out, or make "
        "them relative to what moves along"
    )
