"""Construction of demonstrations from files, with errors that name the file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import name_list
from pdmp._messages import check_number, check_type, value_error
from pdmp._native import Demonstration, fill_gaps, turn_of
from pdmp.io import _fields


@dataclass(frozen=True)
class Options:
    """Options that all readers have."""

    columns: Sequence[str] | None = None
    dt: float | None = None
    max_gap: float = 0.0
    context: Any = None

    def __post_init__(self) -> None:
        """Raises an error for options of the wrong type."""
        check_number("max_gap", self.max_gap)
        if not float(self.max_gap) >= 0.0:
            raise value_error(
                f"max_gap = {float(self.max_gap):g}: must not be negative, in seconds; 0 fills none"
            )
        if self.dt is not None:
            check_number("dt", self.dt)
        if self.columns is not None:
            name_list("columns", self.columns)


def check_time(time: str) -> None:
    """Raises an error unless the name of the column of time stamps is a text."""
    check_type("time", time, str, "the name of a column")


def make_demonstration(
    source: Path | str,
    position: NDArray[Any],
    *,
    dt: float | None,
    time: NDArray[Any] | None,
    names: Sequence[str] | None,
    units: Sequence[str] | None,
    max_gap: float,
    context: Sequence[float | str] | None = None,
    rotations: Mapping[str, Any] | None = None,
) -> Demonstration:
    """Returns a demonstration with its gaps filled; `source` precedes the texts of errors.

    `rotations` has the order of the components of unit quaternions by the first of their names.
    Those whose columns are not kept are skipped.
    """
    n_samples, n_dofs = position.shape
    columns = [f"y{d}" for d in range(n_dofs)] if names is None else names
    turns = [(turn_of(unit) or 0.0) if unit else np.nan for unit in units or [""] * n_dofs]
    clock = np.arange(n_samples) * (dt or 1.0) if time is None else time
    kept = {name: order for name, order in (rotations or {}).items() if name in columns}
    try:
        filled = fill_gaps(position, clock, columns, turns, max_gap)
        return Demonstration(
            filled,
            dt=dt,
            time=time,
            context=context,
            names=names,
            units=units,
            rotations=kept or None,
        )
    except ValueError as error:
        raise value_error(f"{source}: {error}") from None


def select(
    source: Path | str,
    options: Options,
    position: NDArray[Any],
    names: Sequence[str],
    units: Sequence[str],
    *,
    dt: float | None = None,
    time: NDArray[Any] | None = None,
    rotations: Mapping[str, Any] | None = None,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Returns a demonstration of the columns that `options` keeps.

    `dt` and `time` are those of the file, which `options.dt` replaces. Components of a quaternion
    are kept together.
    """
    kept = list(names) if options.columns is None else name_list("columns", options.columns)
    indices = _fields.column_indices(source, names, kept)
    for first in rotations or {}:
        begin = list(names).index(first)
        parts = list(names[begin : begin + 4])
        where = [kept.index(part) for part in parts if part in kept]
        if where and (len(where) < 4 or where != list(range(where[0], where[0] + 4))):
            raise value_error(
                f"{source}: columns keep a part of a quaternion: keep {', '.join(parts)}, in this "
                "order, or none of them"
            )
    if options.dt is not None:
        dt, time = options.dt, None
    if dt is None and time is None:
        raise value_error(f"{source}: no time stamps: pass dt=")
    labels = [units[k] for k in indices]
    return make_demonstration(
        source,
        np.asarray(position, float)[:, indices],
        dt=dt if time is None else None,
        time=time,
        names=kept,
        units=labels if any(labels) else None,
        max_gap=options.max_gap,
        context=options.context if context is None else context,
        rotations=rotations,
    )
