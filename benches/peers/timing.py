"""Timing of libraries that alternate on the same task."""

import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter_ns

import numpy as np

# Calls per round, few enough that another process rarely interrupts them, even if calls are slow.
TOGETHER = 20
# A library that has taken longer is left out of further rounds.
MAX_TIME = 6  # s

Call = Callable[[], object]
# Prepares a round, untimed, and returns the call to time.
Begin = Callable[[], Call]
# Prepares a task, untimed.
Prepare = Callable[[], Begin]


@dataclass(frozen=True)
class Task:
    """Task to time: number of calls per round, number of rounds, and libraries."""

    title: str
    rounds: int
    libraries: dict[str, Prepare]  # the first is the reference of the ratios
    calls: int = 1


def prepared(libraries: dict[str, Prepare]) -> dict[str, Begin]:
    """Prepares the libraries, and prints those that are not installed."""
    ready = {}
    for name, prepare in libraries.items():
        try:
            ready[name] = prepare()
        except ImportError as reason:
            print(f"left out: {name}: {reason}")
    return ready


def times(begin: Begin, calls: int, together: int) -> Iterator[float]:
    """Yields the time of one call [ns], averaged over calls timed together, for a round."""
    call = begin()
    for _ in range(calls // together):
        start = perf_counter_ns()
        for _ in range(together):
            call()
        yield (perf_counter_ns() - start) / together


def run(task: Task) -> dict[str, float]:
    """Times a task, prints its table, and returns the medians [ns] by library."""
    print(f"\n{task.title}, at most {task.rounds} rounds of {task.calls}")
    ready = prepared(task.libraries)
    singly: dict[str, list[float]] = {name: [] for name in ready}
    together: dict[str, list[float]] = {name: [] for name in ready}
    for _ in range(task.rounds):
        for name, begin in ready.items():
            if sum(singly[name]) > MAX_TIME * 1e9:
                continue
            singly[name].extend(times(begin, task.calls, 1))
            if task.calls > 1:
                together[name].extend(times(begin, task.calls, TOGETHER))
    medians = {name: float(np.median(together[name] or singly[name])) for name in ready}
    first = next(iter(medians.values()))
    print(f"\n| {'library':<46} |  median |   p99.9 |   worst |  ratio |")
    print(f"|{'-' * 48}|--------:|--------:|--------:|-------:|")
    for name, median in medians.items():
        # A few dozen calls have no 99.9th percentile.
        often = written(np.quantile(singly[name], 0.999)) if task.calls > 1 else "–"
        figures = f"{written(median):>7} | {often:>7} | {written(max(singly[name])):>7}"
        print(f"| {name:<46} | {figures} | {ratio(median, first):>6} |", flush=True)
    return medians


def written(ns: float) -> str:
    """Returns a time with three digits as text."""
    units = [(1e9, "s"), (1e6, "ms"), (1e3, "µs")]
    size, unit = next((pair for pair in units if ns >= pair[0]), (1, "ns"))
    return f"{ns / size:#.3g}".rstrip(".") + f" {unit}"


def ratio(median: float, first: float) -> str:
    """Returns a ratio with three digits, or as a whole number, as text."""
    return f"{median / first:.3g}" if median < 999.5 * first else f"{median / first:.0f}"


def machine() -> str:
    """Returns the name of the processor, or an empty text."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
