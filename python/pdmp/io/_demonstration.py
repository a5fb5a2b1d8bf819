"""Construction of demonstrations from files, with errors that name the file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import check_number, check_type, value_error
from pdmp._native import Demonstration, fill_gaps, turn_of


def check_options(dt: float | None, max_gap: float, time: str = "t") -> None:
    """Raises an error for options of a reader that are of the wrong type."""
    check_type("time", time, str, "the name of a column")
    check_number("max_gap", max_gap)
    if dt is not None:
        check_number("dt", dt)


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
) -> Demonstration:
    """Returns a demonstration with its gaps filled; `source` precedes the texts of errors."""
    n_samples, n_dofs = position.shape
    columns = [f"y{d}" for d in range(n_dofs)] if names is None else names
    turns = [(turn_of(unit) or 0.0) if unit else np.nan for unit in units or [""] * n_dofs]
    clock = np.arange(n_samples) * (dt or 1.0) if time is None else time
    try:
        filled = fill_gaps(position, clock, columns, turns, max_gap)
        return Demonstration(filled, dt=dt, time=time, context=context, names=names, units=units)
    except ValueError as error:
        raise value_error(f"{source}: {error}") from None
