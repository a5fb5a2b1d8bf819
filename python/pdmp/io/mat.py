"""Reader of MAT files of MATLAB and Octave."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import file_path
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _mat_file, _time_units
from pdmp.io._demonstration import Options, select
from pdmp.io._packages import reading

POSITIONS = ("position", "positions", "pos", "q", "y", "x", "data")
"""Names of positions, the preferred one first, in any case."""
TIMES = ("time", "t", "timestamps", "timestamp", "stamps")
INTERVALS = ("dt", "ts")
LAYOUT = (
    "store position (T, D) with time (T,) or dt, in a struct or by themselves, or a cell or struct "
    "array of demonstrations"
)
Recording = tuple[NDArray[np.float64], NDArray[np.float64] | None, float | None, list[str] | None]


def read_mat(
    path: str | PathLike[str],
    *,
    variable: str | None = None,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> dict[str, Demonstration]:
    """Reads the demonstrations of a MAT file, numbered from "0".

    A demonstration is a matrix of positions, alone or in a field `position`, `pos`, `q`, `y`, `x`
    or `data` of a struct, beside `time` or `t` [s], or `dt`, and `names`. Several are a cell array,
    a struct array or an array (T, D, M). Samples may be rows or columns: the longer side, or that
    of the length of the time, is the time.

    Parameters
    ----------
    path : path
        A MAT file of version 7 or earlier, which MATLAB writes by default.
    variable : str, optional
        Variable with the demonstrations; by default the only one, or those above.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s], a run of NaN, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstrations.

    Raises
    ------
    ValueError
        A file of another format, version 7.3 or layout, or data that `Demonstration` rejects.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap, context)
    data = path.read_bytes()
    if data[:19] == b"MATLAB 7.3 MAT-file":
        raise value_error(f"{path}: version 7.3: save it by save(..., '-v7')")
    with reading(path, "MAT"):
        values = _mat_file.read(data)
    if variable is not None:
        if variable not in values:
            raise value_error(f"{path}: no variable '{variable}' among {', '.join(values)}")
        values = {variable: values[variable]}
    demos = {}
    for k, (position, time, interval, names) in enumerate(_recordings(path, values)):
        source = f"{path}, demonstration {k}"
        if time is not None and options.dt is None:
            time = _time_units.to_seconds(source, time, "", "store them in s instead of {unit}")
        labels = names or [f"y{d}" for d in range(position.shape[1])]
        if len(labels) != position.shape[1]:
            raise value_error(f"{source}: {len(labels)} names of {position.shape[1]} columns")
        demos[str(k)] = select(
            source, options, position, labels, [""] * len(labels), dt=interval, time=time
        )
    return demos


def _recordings(path: Path, values: dict[str, Any]) -> Iterator[Recording]:
    """Yields positions, times, interval and names of each demonstration."""
    fields = _lower(values)
    if any(name in fields for name in POSITIONS):
        yield from _of_fields(path, fields)
        return
    # A variable with demonstrations beside, perhaps, their number and the like.
    nested = {name: value for name, value in values.items() if isinstance(value, list)}
    matrices = {name: value for name, value in values.items() if np.size(value) > 1}
    chosen = nested or matrices
    if len(chosen) != 1:
        raise value_error(
            f"{path}: pass variable= one of {', '.join(chosen)}: {LAYOUT}"
            if chosen
            else f"{path}: has no variables: {LAYOUT}"
        )
    yield from _of_value(path, next(iter(chosen.values())))


def _of_value(path: Path, value: Any) -> Iterator[Recording]:
    """Yields the demonstrations of a struct, a cell array or a matrix."""
    if isinstance(value, dict):
        yield from _of_fields(path, _lower(value))
    elif isinstance(value, list):
        for each in value:
            yield from _of_value(path, each)
    else:
        yield from _of_fields(path, {"position": value})


def _of_fields(path: Path, fields: dict[str, Any]) -> Iterator[Recording]:
    """Yields the demonstrations of positions beside time stamps and names."""
    name = next((name for name in POSITIONS if name in fields), None)
    if name is None:
        raise value_error(f"{path}: no positions among {', '.join(fields)}: {LAYOUT}")
    if isinstance(fields[name], list):
        yield from _of_value(path, fields[name])
        return
    position = _real(path, name, fields[name])
    stamps = next((fields[each] for each in TIMES if each in fields), None)
    time = None if stamps is None else _real(path, "time", stamps).ravel()
    interval = next((fields[each] for each in INTERVALS if each in fields), None)
    step = None
    if interval is not None and time is None and np.size(interval) == 1:
        step = float(_real(path, "dt", interval).ravel()[0])
    names = fields.get("names")
    labels = [str(each).strip() for each in names] if isinstance(names, list) else None
    if position.ndim not in (2, 3) or not position.size:
        raise value_error(f"{path}: '{name}' has shape {position.shape}: {LAYOUT}")
    n_rows, n_columns = position.shape[:2]
    by_length = n_rows >= n_columns if time is None else n_rows == len(time)
    if not by_length and (time is None or n_columns == len(time)):
        position = position.swapaxes(0, 1)
    for each in [position] if position.ndim == 2 else np.moveaxis(position, 2, 0):
        yield each, time, step, labels


def _real(path: Path, name: str, value: Any) -> NDArray[np.float64]:
    if not isinstance(value, np.ndarray):
        raise value_error(f"{path}: '{name}' is not an array of real numbers: {LAYOUT}")
    return value


def _lower(values: dict[str, Any]) -> dict[str, Any]:
    return {name.lower(): value for name, value in values.items()}
