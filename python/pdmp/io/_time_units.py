"""Units of time stamps, and their conversion to s."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import split_label
from pdmp._messages import value_error, warn

SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
ALIASES = {
    "μs": "us", "second": "s", "seconds": "s", "milliseconds": "ms", "msec": "ms",
    "microseconds": "us", "usec": "us", "nanoseconds": "ns", "nsec": "ns",
}  # fmt: skip
"""Other spellings of units; the first has the Greek letter μ instead of the micro sign µ."""
MAX_STEP = 5.0  # s, largest plausible sampling interval of a movement
EPOCH = (6e8, 4.2e9)  # s since 1970, from 1989 to 2103
MAX_STAMP = 1e11  # s, as for Demonstration


def unit_of(source: object, name: str, unit: str) -> str:
    """Returns the unit of a time column: `unit`, or that in parentheses in its name, or ""."""
    unit = unit or split_label(re.sub(r"\((.*)\)$", r"[\1]", name))[1]
    unit = ALIASES.get(unit.lower(), unit)
    if unit not in SECONDS:
        allowed = ", ".join(filter(None, SECONDS))
        raise value_error(f"{source}, column '{name}': its unit is '{unit}': expected {allowed}")
    return unit


def to_seconds(source: str, time: NDArray[Any], unit: str, remedy: str) -> NDArray[Any]:
    """Returns time stamps (T,) in s; those since 1970 are relative to the first.

    Unless a unit is given, stamps in ms, µs or ns since 1970 are recognised, with a warning.
    `remedy` is the advice in messages, with a placeholder {unit}.
    """
    if time.dtype.kind not in "iuf" or time.ndim != 1 or len(time) < 2:
        return time
    if not np.isfinite(time).all():
        return time
    step, first = float(np.median(np.abs(np.diff(time)))), float(time[0])
    scale = SECONDS[unit]
    if not unit and not (step < MAX_STEP and abs(first) < MAX_STAMP):
        unit = next((unit for unit in ("ms", "us", "ns") if _since_1970(first, step, unit)), "")
        if not unit:
            likely = [unit for unit in ("ms", "us", "ns") if 1e-4 < step * SECONDS[unit] < 1]
            likely_unit = likely[0] if likely else "s"
            raise value_error(
                f"{source}: time stamps from {first:g} in steps of {step:g} are not in seconds: "
                + remedy.replace("{unit}", likely_unit)
                + f" ({step * SECONDS[likely_unit]:g} s between samples), or [s] if they are"
            )
        scale = SECONDS[unit]
        warn(
            f"{source}: time stamps are read as {unit} since 1970: "
            + remedy.replace("{unit}", unit)
        )
    elif not unit and step >= 1 and (time == np.floor(time)).all():
        warn(
            f"{source}: time stamps are whole numbers that rise by {step:g}, and read as s: "
            + remedy.replace("{unit}", "s or ms")
        )
    if abs(first * scale) > MAX_STAMP or (scale < 1 and abs(first) * scale > EPOCH[0]):
        # Doubles since 1970 are whole in units of 0.2 µs.
        time = time - time[0]
    return np.asarray(time * scale, float)


def _since_1970(first: float, step: float, unit: str) -> bool:
    return EPOCH[0] < first * SECONDS[unit] < EPOCH[1] and step * SECONDS[unit] < MAX_STEP
