"""Columns of a table that are not degrees of freedom: time stamps, counters and derivatives."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import DERIVATIVES, ROTATION_DOF, clock_unit, split_label

CLOCKS = ("t", "time", "Time", "TIME")
"""Usual names of the column of time stamps; the first is the default of `time`."""
COUNTER = re.compile(
    r"(sub[ _]?)?frames?([ _]?(number|index|id|no\.?))?#?|"
    r"(sample|row|index|step)([ _]?(number|id))?",
    re.IGNORECASE,
)
"""Names of columns with the number of a sample."""


def find_clock(header: Sequence[str], time: str) -> str | None:
    """Returns the column of the time stamps that `time` names; by default the most usual one."""
    named = CLOCKS if time == CLOCKS[0] else (time, split_label(time)[0])
    found = next((name for name in named if name in header), None)
    if found is None and time == CLOCKS[0]:
        found = next((name for name in header if clock_unit(name) is not None), None)
    return found


def derivatives(names: Sequence[str]) -> set[str]:
    """Returns the names that velocities and accelerations of the other columns have."""
    dofs = [f"{name}{rotation}" for name in names for rotation in ("", ROTATION_DOF)]
    return {f"{dof}{suffix}" for dof in dofs for suffix, _ in DERIVATIVES[1:]}


def counts(values: NDArray[np.float64]) -> bool:
    """Returns True if the values of a column rise by ones or are zeros."""
    return bool((np.diff(values) == 1).all() or (values == 0).all())


def counters(names: Sequence[str], position: NDArray[np.float64]) -> list[int]:
    """Returns the columns that count the samples, and have a name that says so."""
    return [d for d, name in enumerate(names) if COUNTER.fullmatch(name) and counts(position[:, d])]
