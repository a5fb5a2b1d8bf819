"""Where contestants do the same work in turns, against the clock."""

import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter_ns

import numpy as np

# Few enough that hardly any of them meet another process, even where a call is slow.
TOGETHER = 20
# Whoever has taken so long takes part in no further bout.
PATIENCE = 6  # s

Call = Callable[[], object]
# Makes ready for a bout, untimed, and hands out the call to time.
Begin = Callable[[], Call]
# Makes ready for a work, untimed.
Prepare = Callable[[], Begin]


@dataclass(frozen=True)
class Work:
    """What is timed: so many calls a bout, so many bouts, and who takes part."""

    title: str
    calls: int
    bouts: int
    contestants: dict[str, Prepare]  # the first is what the others are compared with


def prepared(contestants: dict[str, Prepare]) -> dict[str, Begin]:
    """Prepares the contestants, and prints those that are not installed."""
    ready = {}
    for name, prepare in contestants.items():
        try:
            ready[name] = prepare()
        except ImportError as reason:
            print(f"left out: {name}: {reason}")
    return ready


def times(begin: Begin, calls: int, together: int) -> Iterator[float]:
    """Yields the time of one call [ns], averaged over calls timed together, throughout a bout."""
    call = begin()
    for _ in range(calls // together):
        start = perf_counter_ns()
        for _ in range(together):
            call()
        yield (perf_counter_ns() - start) / together


def run(work: Work) -> dict[str, float]:
    """Times a work, prints its table, and returns the medians [ns] by contestant."""
    print(f"\n{work.title}, at most {work.bouts} bouts of {work.calls}")
    ready = prepared(work.contestants)
    singly: dict[str, list[float]] = {name: [] for name in ready}
    together: dict[str, list[float]] = {name: [] for name in ready}
    for _ in range(work.bouts):
        for name, begin in ready.items():
            if sum(singly[name]) > PATIENCE * 1e9:
                continue
            singly[name].extend(times(begin, work.calls, 1))
            if work.calls > 1:
                together[name].extend(times(begin, work.calls, TOGETHER))
    medians = {name: float(np.median(together[name] or singly[name])) for name in ready}
    first = next(iter(medians.values()))
    print(f"\n| {'contestant':<46} |  median |   p99.9 |   worst |  ratio |")
    print(f"|{'-' * 48}|--------:|--------:|--------:|-------:|")
    for name, median in medians.items():
        # A few dozen calls have no thousandth.
        often = written(np.quantile(singly[name], 0.999)) if work.calls > 1 else "–"
        figures = f"{written(median):>7} | {often:>7} | {written(max(singly[name])):>7}"
        print(f"| {name:<46} | {figures} | {ratio(median, first):>6} |", flush=True)
    return medians


def written(ns: float) -> str:
    """Writes a time with three digits."""
    units = [(1e9, "s"), (1e6, "ms"), (1e3, "µs")]
    size, unit = next((pair for pair in units if ns >= pair[0]), (1, "ns"))
    return f"{ns / size:#.3g}".rstrip(".") + f" {unit}"


def ratio(median: float, first: float) -> str:
    """Writes a ratio with three digits, or as a whole number."""
    return f"{median / first:.3g}" if median < 999.5 * first else f"{median / first:.0f}"


def machine() -> str:
    """Returns the name of the processor, if the system gives it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
