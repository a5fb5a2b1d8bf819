"""A control loop on the clock: a tick each period, and what was late."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator
from numbers import Real
from time import perf_counter, sleep
from typing import NamedTuple, TypeAlias, TypeVar

from numpy.typing import ArrayLike

from pdmp._native import Controller, Status

T = TypeVar("T")
_Measured: TypeAlias = Callable[[], ArrayLike | None] | None
_Coupling: TypeAlias = Callable[[], tuple[ArrayLike, ArrayLike] | None] | None


class Tick(NamedTuple):
    """One tick of a paced loop.

    Attributes
    ----------
    time : float
        Time of the movement since the loop began in s: whole periods, which is when the tick was
        due, or the last of its deadlines if it missed some.
    late : float
        How long after its deadline it began in s, the first of them if it missed some.
    missed : int
        How many deadlines it missed; it then moved by as many periods more.
    """

    time: float
    late: float
    missed: int


class Run:
    """A paced loop, made by `Controller.run`: iterable with `for` and with `async for`.

    Each iteration begins anew, at the time it begins. Its deadlines are start + k / rate_hz for
    k = 1, 2, …, so that no delay adds up. Before each the loop sleeps, without holding the
    interpreter; then it steps, and hands out the tick.

    Attributes
    ----------
    ticks : int
        Ticks made.
    missed : int
        Deadlines missed: a whole period went by between them and the next tick.
    worst : float
        Largest lateness of a tick in s.
    """

    def __init__(
        self,
        controller: Controller,
        rate_hz: float,
        duration: float | None,
        measured: _Measured,
        coupling: _Coupling,
    ) -> None:
        self._controller = controller
        self._rate = _countable("rate_hz", rate_hz)
        self._last = None if duration is None else _periods(duration, self._rate)
        self._measured = _function("measured", measured)
        self._coupling = _function("coupling", coupling)
        self._begin()

    def __iter__(self) -> Iterator[Tick]:
        """Begin a loop that sleeps between its ticks."""
        self._begin()
        while not self._over():
            sleep(self._wait())
            yield self._tick()

    async def __aiter__(self) -> AsyncIterator[Tick]:
        """Begin a loop that lets others run between its ticks."""
        from asyncio import sleep

        self._begin()
        while not self._over():
            await sleep(self._wait())
            while (early := self._wait()) > 0:  # as event loops may wake
                await sleep(early)
            yield self._tick()

    def _begin(self) -> None:
        self.ticks = self.missed = 0
        self.worst = 0.0
        self._periods = 0  # that the movement has made
        self._start = perf_counter()

    def _over(self) -> bool:
        """Tell whether to end, with what the body commanded taken into account."""
        if self._last is None:
            return self.ticks > 0 and self._controller.status == Status.FINISHED
        # A movement that has settled is held, and may be commanded anew.
        return self._periods >= self._last

    def _due(self) -> float:
        return self._start + (self._periods + 1) / self._rate

    def _wait(self) -> float:
        return max(0.0, self._due() - perf_counter())

    def _tick(self) -> Tick:
        late = max(0.0, perf_counter() - self._due())
        missed = int(late * self._rate)
        if self._last is not None:
            missed = min(missed, self._last - self._periods - 1)
        self._controller.step(
            (1 + missed) / self._rate, measured=self._measured(), coupling=self._coupling()
        )
        self._periods += 1 + missed
        self.ticks += 1
        self.missed += missed
        self.worst = max(self.worst, late)
        return Tick(self._periods / self._rate, late, missed)


def _countable(name: str, value: float) -> float:
    """Return a number that clocks can count with."""
    if not (isinstance(value, Real) and 1e-9 <= value <= 1e9):
        raise ValueError(f"{name} = {value!r}: must be a number between 1e-9 and 1e9")
    return float(value)


def _periods(duration: float, rate: float) -> int:
    """Return how many whole periods a duration has."""
    periods = round(_countable("duration", duration) * rate)
    if periods < 1:
        raise ValueError(f"duration = {duration}: must be at least one period, {1 / rate} s")
    return periods


def _function(name: str, ask: Callable[[], T] | None) -> Callable[[], T | None]:
    """Return a function to ask before each tick."""
    if ask is None:
        return lambda: None
    if not callable(ask):
        raise ValueError(f"{name} must be a function to ask before each tick: pass lambda: …")
    return ask
