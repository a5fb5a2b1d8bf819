"""A control loop paced by the clock, with its lateness and missed deadlines."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from numbers import Real
from threading import Lock
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
        Time of the movement since the loop began in s: whole periods.
    late : float
        How long after its deadline it began in s, the first of them if it missed some.
    missed : int
        How many deadlines it missed; where it catches up it moved by as many periods more, where it
        waits the deadlines to come are later by as many.
    """

    time: float
    late: float
    missed: int


class Run:
    """A paced loop, made by `Controller.run`: iterable with `for` and with `async for`.

    Each iteration begins anew, at the time it begins. Its deadlines are start + k / rate_hz for
    k = 1, 2, …, so that no delay adds up; where the movement waits, whole periods that were missed
    are added to start. Before each the loop sleeps, without holding the interpreter; then it steps,
    and hands out the tick. A controller runs in one loop at a time: a second one is refused.

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
        late: str = "wait",
    ) -> None:
        self._controller = controller
        self._rate = _checked_number("rate_hz", rate_hz)
        self._last = None if duration is None else _n_periods(duration, self._rate)
        self._measured = _function("measured", measured)
        self._coupling = _function("coupling", coupling)
        if late not in ("wait", "catch up"):
            raise ValueError(f'late = {late!r}: must be "wait" or "catch up"')
        self._catches_up = late == "catch up"
        self._begin()

    def __iter__(self) -> Iterator[Tick]:
        """Begins a loop that sleeps between its ticks."""
        with _exclusive(self._controller):
            self._begin()
            while not self._over():
                sleep(self._wait())
                yield self._tick()

    async def __aiter__(self) -> AsyncIterator[Tick]:
        """Begins a loop that lets other tasks run between its ticks."""
        from asyncio import sleep

        for _ in range(3):  # a loop that was left is closed by the event loop
            if id(self._controller) in _running:
                await sleep(0)
        with _exclusive(self._controller):
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
        """Returns whether the loop ends, given the commands of its last iteration."""
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
        if self._catches_up and self._last is not None:
            missed = min(missed, self._last - self._periods - 1)
        periods = 1 + missed if self._catches_up else 1
        self._controller.step(
            periods / self._rate, measured=self._measured(), coupling=self._coupling()
        )
        if not self._catches_up:
            self._start += missed / self._rate
        self._periods += periods
        self.ticks += 1
        self.missed += missed
        self.worst = max(self.worst, late)
        return Tick(self._periods / self._rate, late, missed)


_running: set[int] = set()  # controllers in a loop, by their identity
_lock = Lock()


@contextmanager
def _exclusive(controller: Controller) -> Iterator[None]:
    """Reserves a controller for one loop, which ends with its iterator."""
    key = id(controller)
    with _lock:
        if key in _running:
            raise RuntimeError(
                "this controller runs in another loop already: end that one first (close() an "
                "iterator that was left by break), or give each loop a controller of its own"
            )
        _running.add(key)
    try:
        yield
    finally:
        with _lock:
            _running.discard(key)


def _checked_number(name: str, value: float) -> float:
    """Returns a number that clocks can count with."""
    if not (isinstance(value, Real) and 1e-9 <= value <= 1e9):
        raise ValueError(f"{name} = {value!r}: must be a number between 1e-9 and 1e9")
    return float(value)


def _n_periods(duration: float, rate: float) -> int:
    """Returns the number of whole periods in a duration."""
    periods = round(_checked_number("duration", duration) * rate)
    if periods < 1:
        raise ValueError(f"duration = {duration}: must be at least one period, {1 / rate} s")
    return periods


def _function(name: str, ask: Callable[[], T] | None) -> Callable[[], T | None]:
    """Returns a function to ask before each tick."""
    if ask is None:
        return lambda: None
    if not callable(ask):
        raise ValueError(f"{name} must be a function to ask before each tick: pass lambda: …")
    return ask
