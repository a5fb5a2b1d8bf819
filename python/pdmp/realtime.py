"""Control loop on the wall clock, which reports its lateness and missed deadlines."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Real
from threading import Lock
from time import perf_counter, sleep
from typing import Literal, TypeAlias, TypeVar

from numpy.typing import ArrayLike

from pdmp._messages import check_type
from pdmp._native import Controller, Status

__all__ = ["PacedLoop", "Tick"]

T = TypeVar("T")
_Measured: TypeAlias = Callable[[], ArrayLike | None] | None
_Coupling: TypeAlias = Callable[[], tuple[ArrayLike, ArrayLike] | None] | None


@dataclass(frozen=True, slots=True)
class Tick:
    """Timing of one tick of a paced loop.

    Attributes
    ----------
    time : float
        Time of the movement since the loop began in s, a multiple of the period.
    lateness : float
        Time in s from the deadline to the start of the tick; after missed deadlines, from the first
        of them.
    missed : int
        Number n of missed deadlines. With `late="catch up"` the tick lasts n periods more; with
        `late="wait"` the remaining deadlines move back by n periods.
    """

    time: float
    lateness: float
    missed: int


class PacedLoop:
    """Control loop that steps a controller once per period of the wall clock.

    The first tick comes one period after the loop begins; commands in the body of the loop act on
    the next tick. Deadlines are start + k / rate_hz for k = 1, 2, …, so that delays do not
    accumulate. Until each deadline the loop sleeps without the interpreter lock; `async for` runs
    other tasks instead (event loops wake to the millisecond, so periods below some 5 ms need
    threads). `break` or an exception, Ctrl-C included, ends the loop between two ticks. A
    controller runs in one loop at a time.

    Parameters
    ----------
    controller : Controller
        Controller of the movement.
    rate_hz : float, optional
        Ticks per second; by default 1 / dt of the controller.
    duration : float, optional
        Duration in s, rounded to whole periods. By default a discrete movement runs until its
        `status` is `FINISHED` after the commands of the body, a rhythmic one until the loop is
        left.
    measured, coupling : callable, optional
        Function without arguments that is called before each tick; its result, which may be None,
        is the argument of `Controller.step` of this name.
    late : {"wait", "catch up"}
        Behaviour after n missed deadlines. "wait": the tick has the usual length, and the remaining
        deadlines move back by n periods, so that the position never jumps. "catch up": one step of
        n + 1 periods follows the wall clock, and the position jumps accordingly.

    Attributes
    ----------
    ticks : int
        Number of ticks.
    missed : int
        Number of deadlines missed.
    max_lateness : float
        Largest lateness of a tick in s.

    Raises
    ------
    ValueError
        A rate or duration that is not a number between 1e-9 and 1e9, a duration below one period,
        `measured` or `coupling` that is not callable, or an unknown `late`.
    RuntimeError
        On the first tick, if the controller runs in another loop.

    Examples
    --------
    >>> controller = model.controller(dt=0.001, goal=[1.2, 0.1])
    >>> commands = []
    >>> for tick in pdmp.PacedLoop(controller, duration=0.01):
    ...     commands.append(controller.position.copy())
    >>> len(commands)
    10
    """

    def __init__(
        self,
        controller: Controller,
        rate_hz: float | None = None,
        *,
        duration: float | None = None,
        measured: _Measured = None,
        coupling: _Coupling = None,
        late: Literal["wait", "catch up"] = "wait",
    ) -> None:
        check_type("controller", controller, Controller, "pdmp.Controller, of model.controller(dt)")
        self._controller = controller
        self._rate = _checked_number("rate_hz", 1 / controller.dt if rate_hz is None else rate_hz)
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

        for _ in range(3):  # the event loop closes a loop that was left
            if id(self._controller) in _running:
                await sleep(0)
        with _exclusive(self._controller):
            self._begin()
            while not self._over():
                await sleep(self._wait())
                while (early := self._wait()) > 0:  # event loops may wake early
                    await sleep(early)
                yield self._tick()

    def _begin(self) -> None:
        self.ticks = self.missed = 0
        self.max_lateness = 0.0
        self._periods = 0  # of the movement
        self._start = perf_counter()

    def _over(self) -> bool:
        """Returns True if the loop ends after the commands of its last iteration."""
        if self._last is None:
            return self.ticks > 0 and self._controller.status == Status.FINISHED
        # A finished movement rests, and may be commanded again.
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
        self.max_lateness = max(self.max_lateness, late)
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
                "iterator that was left by break), or use one controller per loop"
            )
        _running.add(key)
    try:
        yield
    finally:
        with _lock:
            _running.discard(key)


def _checked_number(name: str, value: float) -> float:
    """Returns a number within the range of clocks."""
    if not (isinstance(value, Real) and 1e-9 <= value <= 1e9):
        raise ValueError(f"{name} = {value!r}: must be a number between 1e-9 and 1e9")
    return float(value)


def _n_periods(duration: float, rate: float) -> int:
    """Returns the number of whole periods in a duration."""
    periods = round(_checked_number("duration", duration) * rate)
    if periods < 1:
        raise ValueError(f"duration = {duration}: must be at least one period, {1 / rate} s")
    return periods


def _function(name: str, function: Callable[[], T] | None) -> Callable[[], T | None]:
    """Returns a function to call before each tick."""
    if function is None:
        return lambda: None
    if not callable(function):
        raise ValueError(f"{name} must be a function, called before each tick: pass lambda: …")
    return function
