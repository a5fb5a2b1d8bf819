"""Cycles of rhythmic recordings."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp import _native
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
    """Gain of a degree of freedom per cycle of a recording, which closed cycles lack."""

    recording: int
    """Index of the recording."""
    dof: int
    """Index of the degree of freedom."""
    gain: float
    """Gain in a cycle, the median one by size, in the unit of the degree of freedom."""
    turns: int
    """Full turns of an angle per cycle; 0 for other quantities."""


class Cycles(Sequence[Demonstration]):
    """Closed cycles, in one phase, for `fit(kind="rhythmic")`.

    Attributes
    ----------
    periods : (K,) array
        Period of each in s: its number of samples times its dt.
    recordings : list of int
        Index of the recording that each is from.
    rejected : list of Rejected
        Rejected cycles, and recordings without a period, with the reasons.
    gains : (K, D) array
        Gain of each degree of freedom from the beginning to the end of a cycle, before its
        distribution over the cycle.
    growths : list of Growth
        Degrees of freedom that turn, or gain more per cycle than they move within it.
    """

    def __init__(
        self,
        demos: list[Demonstration],
        periods: NDArray[np.float64],
        recordings: list[int],
        rejected: list[Rejected],
        gains: NDArray[np.float64],
        growths: list[Growth],
    ) -> None:
        self._demos = demos
        self.periods = periods
        self.recordings = recordings
        self.rejected = rejected
        self.gains = gains
        self.growths = growths

    def __len__(self) -> int:
        """Returns the number of cycles K."""
        return len(self._demos)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> list[Demonstration]: ...
    def __getitem__(self, index: Any) -> Any:
        """Returns a cycle, or a list of several."""
        return self._demos[index]

    def __repr__(self) -> str:
        """Returns the number of cycles and the range of their periods."""
        span = f" of {min(self.periods):.3f} to {max(self.periods):.3f} s" if len(self) else ""
        return f"<pdmp.preprocessing.Cycles: {len(self)}{span}, {len(self.rejected)} rejected>"


def cycles(
    recordings: Demonstration | Sequence[Demonstration] | Mapping[str, Demonstration],
    *,
    events: ArrayLike | Sequence[ArrayLike] | Mapping[str, ArrayLike] | None = None,
    average: bool = False,
) -> Cycles:
    """Cuts cyclic recordings into closed cycles that begin in the same phase.

    Without events, `period` finds the period of each recording, and a template of its mean cycle
    when each cycle begins: in the phase of the first recording's first sample, to which the others
    are turned by circular cross-correlation with its mean cycle.

    A cycle is C samples, as many as its recording has in a period, of the cubic smoothing spline
    that generalised cross-validation chooses, with what that takes off the nearest recorded
    samples: noise stays white, and a fit can still smooth it. The gain from f(0) to f(T) of the
    spline f is distributed over the cycle, so that it joins itself without a jump and keeps its
    mean::

        y_c = y(c T / C) - (c / C - 1/2) (f(T) - f(0))

    The angle of a wheel or a crank gains full turns per cycle; they are taken off each cycle and
    all that follow. A unit of angle marks what turns; without units, a gain of one turn in radians
    or degrees to a hundredth does. Of anything else that gains more per cycle than it moves within
    it, such as the way walked, a warning gives the gain: a model of closed cycles stays in place.

    A cycle is rejected if its period differs from the median of its recording by more than 3.5
    robust standard deviations and 10 %, or its shape from the median cycle by 3.5 robust standard
    deviations more than usual, twice what is usual, and a quarter of the movement's standard
    deviation. A recording among several that does not repeat itself is rejected with a warning.

    Parameters
    ----------
    recordings : Demonstration, or sequence or mapping of Demonstration
        Recordings of at least one cycle and a half, with `dt` or `time`.
    events : (K,) array_like, or one for each recording, optional
        Times in s at which cycles begin, such as foot strikes, on the clock of the recording; the
        last ends the last cycle. Of a mapping of recordings, they may be a mapping too.
    average : bool
        Make one mean cycle of each recording, instead of keeping each.

    Returns
    -------
    Cycles
        Demonstrations with `dt`, such that T · dt is the period; names, units and context go along.

    Raises
    ------
    ValueError
        No recording with a period, with the correlation of the first with itself; a recording
        without times, or with other degrees of freedom than the first; events that do not increase
        or lie outside.

    Warns
    -----
    UserWarning
        A recording that does not repeat itself; degrees of freedom that gain more per cycle than
        they move within it and are no angles of full turns.

    References
    ----------
    B. Iglewicz, D. C. Hoaglin, How to detect and handle outliers, ASQC Quality Press 1993
    """
    if isinstance(recordings, Mapping) and isinstance(events, Mapping):
        if lone := sorted(map(str, recordings.keys() ^ events.keys())):
            raise value_error(f"events: '{lone[0]}' is among the recordings or the events alone")
        events = [events[name] for name in recordings]
    begins = cast("Sequence[ArrayLike] | None", events)
    if isinstance(recordings, Demonstration):
        recordings = [recordings]
        begins = None if events is None else [cast(ArrayLike, events)]
    demos, periods, gains, sources, odd, grown = _native.cycles(recordings, begins, average)
    for recording, _, _, reason, whole in odd:
        if whole:
            warn(f"recording {recording} is left out: {reason}")
    growths = [Growth(*growth) for growth in grown]
    if gaining := [growth for growth in growths if not growth.turns]:
        warn(_gains(gaining, demos))
    rejected = [Rejected(*cycle[:4]) for cycle in odd]
    return Cycles(demos, periods, sources, rejected, np.array(gains), growths)


def _gains(growths: list[Growth], demos: list[Demonstration]) -> str:
    """Returns a warning about gains from cycle to cycle."""
    names, units = (demos[0].names, demos[0].units) if demos else (None, None)
    gains = []
    for dof in sorted({growth.dof for growth in growths}):
        largest = max((g for g in growths if g.dof == dof), key=lambda growth: abs(growth.gain))
        name = names[dof] if names else f"y{dof}"
        unit = f" {units[dof]}" if units and units[dof] else ""
        gains.append(f"'{name}' gains {largest.gain:.3g}{unit} in recording {largest.recording}")
    return (
        f"more is gained per cycle than moved within one: {', '.join(gains)}; closed cycles lack "
        "the gain, and a model of them stays in place: leave these degrees of freedom out, or make "
        "them relative to what moves along"
    )
