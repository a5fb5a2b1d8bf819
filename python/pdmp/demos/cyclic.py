"""Cycles of rhythmic recordings."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp import _native
from pdmp._native import Demonstration
from pdmp._shown import refusal


class Rejected(NamedTuple):
    """A cycle that was left out."""

    recording: int
    """Index of the recording."""
    start: float
    """When it begins, in s on the recording's clock."""
    period: float
    """How long it lasts, in s."""
    reason: str
    """What is odd about it."""


class Cycles(Sequence[Demonstration]):
    """Closed cycles, in one phase, for `fit(kind="rhythmic")`.

    Attributes
    ----------
    periods : (K,) array
        Period of each in s: its number of samples times its dt.
    recordings : list of int
        Index of the recording that each is from.
    rejected : list of Rejected
        Cycles that were left out, and why.
    """

    def __init__(
        self,
        demos: list[Demonstration],
        periods: NDArray[np.float64],
        recordings: list[int],
        rejected: list[Rejected],
    ) -> None:
        self._demos = demos
        self.periods = periods
        self.recordings = recordings
        self.rejected = rejected

    def __len__(self) -> int:
        """Return the number of cycles K."""
        return len(self._demos)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> list[Demonstration]: ...
    def __getitem__(self, index: Any) -> Any:
        """Return a cycle, or a list of several."""
        return self._demos[index]

    def __repr__(self) -> str:
        """Return how many there are, and of what periods."""
        span = f" of {min(self.periods):.3f} to {max(self.periods):.3f} s" if len(self) else ""
        return f"<pdmp.demos.Cycles: {len(self)}{span}, {len(self.rejected)} rejected>"


def cycles(
    recordings: Demonstration | Sequence[Demonstration] | Mapping[str, Demonstration],
    *,
    events: ArrayLike | Sequence[ArrayLike] | Mapping[str, ArrayLike] | None = None,
    average: bool = False,
) -> Cycles:
    """Cut cyclic recordings into closed cycles that begin in the same phase.

    Without events, `period` finds the period of each recording, and a template of its mean cycle
    when each cycle begins: in the phase of the first recording's first sample, to which the others
    are turned by circular cross-correlation with its mean cycle.

    A cycle is C samples of the cubic spline through the recording, as many as the first recording
    has in a period. Its drift from y(0) to y(T) is distributed over it, so that it joins itself
    without a jump and keeps its mean::

        y_c = y(c T / C) - (c / C - 1/2) (y(T) - y(0))

    A cycle is rejected if its period differs from the median of its recording by more than 3.5
    robust standard deviations and 10 %, or its shape from the median cycle by 3.5 robust standard
    deviations more than usual, twice what is usual, and a quarter of the movement's standard
    deviation.

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
        A recording without a period, whose correlation with itself is told, without times, or with
        other degrees of freedom than the first; events that do not increase or lie outside.

    References
    ----------
    B. Iglewicz, D. C. Hoaglin, How to detect and handle outliers, ASQC Quality Press 1993
    """
    if isinstance(recordings, Mapping) and isinstance(events, Mapping):
        if odd := sorted(map(str, recordings.keys() ^ events.keys())):
            raise refusal(f"events: '{odd[0]}' is among the recordings or the events alone")
        events = [events[name] for name in recordings]
    begins = cast("Sequence[ArrayLike] | None", events)
    if isinstance(recordings, Demonstration):
        recordings = [recordings]
        begins = None if events is None else [cast(ArrayLike, events)]
    demos, periods, sources, rejected = _native.cycles(recordings, begins, average)
    return Cycles(demos, periods, sources, [Rejected(*cycle) for cycle in rejected])
