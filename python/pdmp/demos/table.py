"""CSV files: one demonstration in, one trajectory out."""

import csv
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from pdmp._files import replacing
from pdmp._native import Demonstration, Trajectory
from pdmp.demos import _text
from pdmp.demos._recording import demonstration

SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def read_csv(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Read one demonstration from a CSV file.

    A column headed `knee [rad]` is called `knee`, and its unit is rad.

    Parameters
    ----------
    path : path
        UTF-8 text, fields separated by commas, names in the first row.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all but `time` by default.
    time : str
        Column of the time stamps, in s unless its header tells ms, µs or ns.
    dt : float, optional
        Sampling interval [s], in place of time stamps.
    max_gap : float
        Longest gap [s] that is interpolated, from the sample before to the one after; by default
        none is. A gap is an empty field or NaN; rows that are missing altogether are none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A field that is not a finite number, a gap that is longer than `max_gap` or at an end, a
        column that is missing, or what `Demonstration` refuses; names file, column, and line or
        time.
    OSError
        A file that cannot be read.
    """
    path = Path(path)
    lines = _text.rows(path)
    first, fields = next(lines)
    header, units = zip(*map(_text.label, fields), strict=True)
    _text.check_names(path, first, header)
    if dt is None and time not in header:
        raise ValueError(
            f"{path}: no column '{time}' with the time among {', '.join(header)}: "
            "name it with time=, or pass dt="
        )
    names = [name for name in header if name != time]
    if columns is not None:
        names = _text.listed("columns", columns)
    where = [_text.column(path, header, name) for name in names]
    clock = None if dt is not None else _text.column(path, header, time)
    numbers: list[list[float]] = []
    stamps: list[float] = []
    for line, row in lines:
        numbers.append(
            [_text.number(path, line, header[k], row[k], gaps=max_gap > 0) for k in where]
        )
        if clock is not None:
            stamps.append(_text.number(path, line, time, row[clock]))
    return demonstration(
        path,
        np.array(numbers).reshape(len(numbers), len(names)),
        dt=dt,
        time=None if clock is None else np.array(stamps) * _second(path, time, units[clock]),
        names=names,
        units=[units[k] for k in where] if any(units[k] for k in where) else None,
        max_gap=max_gap,
        context=context,
    )


def _second(path: Path, name: str, unit: str) -> float:
    """Return how many seconds the unit of a time column is, which may stand in parentheses too."""
    unit = unit or _text.label(name.replace("(", "[").replace(")", "]"))[1]
    if unit not in SECONDS:
        known = ", ".join(filter(None, SECONDS))
        raise ValueError(f"{path}, column '{name}': its unit is '{unit}': expected {known}")
    return SECONDS[unit]


def write_csv(
    path: str | PathLike[str],
    trajectory: Trajectory,
    names: Sequence[str],
    units: Sequence[str] | None = None,
) -> None:
    """Write a trajectory as CSV; `read_csv` with `columns=names` reads its positions back.

    The columns are `t` [s], then the position of each degree of freedom under its name, then
    velocities under `<name>_velocity` and accelerations under `<name>_acceleration`, with the units
    that are known in brackets. Numbers keep every bit. The file appears when it is complete.

    Parameters
    ----------
    path : path
        Where to write.
    trajectory : Trajectory
        What a rollout returned.
    names : sequence of str
        Names of the D degrees of freedom, such as `Model.names`.
    units : sequence of str, optional
        Their units, such as `Model.units`; "" where one is not known.

    Raises
    ------
    ValueError
        A number of names or units other than D, or names that would not be read back.
    OSError
        A file that cannot be written.
    """
    path, names = Path(path), _text.listed("names", names)
    n_dofs = trajectory.position.shape[1]
    units = [""] * n_dofs if units is None else units
    for kind, given in (("name", names), ("unit", units)):
        if len(given) != n_dofs:
            raise ValueError(
                f"{kind}s has length {len(given)}, expected {n_dofs}: one {kind} per DoF"
            )
    suffixes = (("", ""), ("_velocity", "/s"), ("_acceleration", "/s²"))
    _text.check_names(
        path, 1, ["t", *(f"{name}{suffix}" for suffix, _ in suffixes for name in names)]
    )
    header = [
        f"{name}{suffix} [{unit}{per}]" if unit else f"{name}{suffix}"
        for suffix, per in suffixes
        for name, unit in zip(names, units, strict=True)
    ]
    columns = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.acceleration)
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t", *header])
        writer.writerows(np.column_stack(columns).tolist())
