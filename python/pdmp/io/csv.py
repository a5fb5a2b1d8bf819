"""Reader of demonstrations and writer of trajectories in CSV files."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import atomic_write
from pdmp._labels import DERIVATIVES, ROTATION_DOF, join_label, name_list, split_label
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration, Trajectory
from pdmp.io import _fields, _time_units
from pdmp.io._csv_layout import CsvTable, parse_layout
from pdmp.io._demonstration import check_options, make_demonstration

THOUSANDS = re.compile(r"[^,]*|[-+]?[1-9]\d{0,2}(,\d{3})+")
CLOCKS = ("t", "time", "Time", "TIME")
"""Default names of the column of time stamps; the first is the default of `time`."""


def read_csv(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads one demonstration from a CSV file.

    A header field `knee [rad]` gives the name `knee` and the unit rad; a row of units below the
    header is read too. Fields are separated by commas, semicolons, tabs or spaces; unless by
    commas, decimal commas are allowed. Lines before the header, comments, which begin with #, and
    the unnamed index column of pandas are skipped.

    Parameters
    ----------
    path : path
        UTF-8 or UTF-16 text with a row of names, then one sample per row.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; by default all columns except `time`
        and the derivatives `<name>_velocity` and `<name>_acceleration`, which `write_csv` writes.
    time : str
        Column of the time stamps, by default `t` or `time`, in s unless its header or this
        argument has ms, µs or ns in brackets. Stamps in ms, µs or ns since 1970 are recognised,
        with a warning, and are relative to the first.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate, from the sample before to the sample after it; by default 0,
        none. A gap is an empty field, NaN, NA or null, not a missing row.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A field that is not a finite number, a gap that is longer than `max_gap` or at an end, a
        missing column, time stamps in an unknown unit, or data that `Demonstration` rejects; the
        text gives file, column, and line or time.
    OSError
        A file that cannot be read.
    """
    path = Path(path)
    check_options(dt, max_gap, time)
    times = CLOCKS if time == CLOCKS[0] else (time, split_label(time)[0])
    table = parse_layout(path, times if dt is None else ())
    header, units = _labels(table)
    names = [name for name in header if name]
    _fields.check_names(path, table.line, names)
    stamped = next((name for name in times if name in header), None)
    if dt is None and stamped is None:
        raise value_error(
            f"{path}: no column '{time}' with the time among {', '.join(names)}: "
            "name it with time=, or pass dt="
        )
    if columns is None:
        dofs = (f"{name}{rotation}" for name in names for rotation in ("", ROTATION_DOF))
        derived = {f"{dof}{suffix}" for dof in dofs for suffix, _ in DERIVATIVES[1:]}
        names = [name for name in names if name != stamped and name not in derived]
    else:
        names = name_list("columns", columns)
    indices = _fields.column_indices(path, header, names)
    clock = header.index(stamped) if dt is None and stamped is not None else None
    position, stamps = _numbers(table, header, indices, clock, gaps=max_gap > 0)
    if clock is not None and stamps is not None:
        name = header[clock]
        declared = units[clock] or ("" if name == time else split_label(time)[1])
        remedy = f"write '{name} [{{unit}}]' in the header or as time="
        unit = _time_units.unit_of(path, name, declared)
        stamps = _time_units.to_seconds(f"{path}, column '{name}'", stamps, unit, remedy)
    return make_demonstration(
        path,
        position,
        dt=dt,
        time=stamps,
        names=names,
        units=[units[k] for k in indices] if any(units[k] for k in indices) else None,
        max_gap=max_gap,
        context=context,
    )


def _labels(table: CsvTable) -> tuple[list[str], list[str]]:
    """Returns names and units of the columns; units in the header take precedence."""
    header, units = map(list, zip(*map(split_label, table.fields), strict=True))
    if table.units is not None:
        units = [unit or below for unit, below in zip(units, table.units, strict=True)]
    return header, units


def _numbers(
    table: CsvTable, header: list[str], indices: list[int], clock: int | None, *, gaps: bool
) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """Returns positions (T, D), NaN in gaps, and time stamps (T,) in the unit of the file."""
    path = table.path
    numbers: list[list[float]] = []
    stamps: list[float] = []
    names = [header[k] for k in indices]
    unnamed = [k for k, name in enumerate(header) if not name]
    decimal = {True: 0, False: 0}  # last line with a decimal comma, and with a decimal point
    thousands = True  # True while all commas may separate thousands
    for line, row in table.rows(blank=clock is None):
        _check_unnamed(path, line, row, unnamed, len(numbers))
        cells = [row[k] for k in indices]
        stamp = "0" if clock is None else row[clock]
        text = "".join((*cells, stamp))
        if table.separator != "," and "," in text:
            decimal[True] = line
            thousands = thousands and all(map(THOUSANDS.fullmatch, (*cells, stamp)))
            cells, stamp = [cell.replace(",", ".") for cell in cells], stamp.replace(",", ".")
        if "." in text:
            decimal[False] = line
        if table.separator != "," and all(decimal.values()):
            raise value_error(
                f"{path}, line {line}: numbers have decimal commas and decimal points: use one of "
                "them throughout, without separators of thousands"
            )
        if clock is not None:
            value = _fields.read_number(path, line, header[clock], stamp)
            # ns since 1970 exceed the precision of a double, and fit into 64 bits.
            stamps.append(int(stamp) if stamp.isdecimal() and value < 2**63 else value)
        numbers.append(_row(path, line, cells, names, gaps=gaps))
    if decimal[True] and thousands:
        raise value_error(
            f"{path}, line {decimal[True]}: commas are decimal or separate thousands: write "
            "decimal points"
        )
    positions = np.array(numbers, float).reshape(len(numbers), len(indices))
    return positions, None if clock is None else np.array(stamps)


def _row(path: Path, line: int, cells: list[str], names: list[str], *, gaps: bool) -> list[float]:
    """Returns the numbers of a row."""
    try:
        values = list(map(float, cells))
        if all(map(math.isfinite, values)) and "_" not in "".join(cells):
            return values
    except ValueError:
        pass
    return [
        _fields.read_number(path, line, name, cell, gaps=gaps)
        for name, cell in zip(names, cells, strict=True)
    ]


def _check_unnamed(path: Path, line: int, row: list[str], unnamed: list[int], sample: int) -> None:
    """Rejects a column without a name unless it is empty or the index of pandas."""
    for k in unnamed:
        if row[k] and not (k == 0 and row[k] == str(sample)):
            raise value_error(
                f"{path}, line {line}: '{row[k]}' is in column {k + 1}, which has no name: "
                "the first row must name the columns"
            )


def write_csv(
    path: str | PathLike[str],
    trajectory: Trajectory,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Writes a trajectory as CSV; `read_csv` reads its positions back.

    The columns are `t` [s], then the positions `<name>`, velocities `<name>_velocity` and
    accelerations `<name>_acceleration` of all degrees of freedom, with units in brackets. Those of
    rotations have the names of `trajectory.dof_names`. Numbers are exact. The file is written
    atomically.

    Parameters
    ----------
    path : path
        File to write.
    trajectory : Trajectory
        A rollout.
    names : sequence of str, optional
        Names of the D degrees of freedom, instead of the trajectory's.
    units : sequence of str, optional
        Their units, instead of the trajectory's; "" for none.

    Raises
    ------
    ValueError
        A number of names or units other than D, or names that would be read differently.
    OSError
        A file that cannot be written, or whose folder does not exist.
    """
    path = Path(path)
    check_type("trajectory", trajectory, Trajectory, "pdmp.Trajectory")
    names = trajectory.names if names is None else name_list("names", names)
    units = trajectory.units if units is None else name_list("units", units)
    # With rotations, the columns of derivatives are degrees of freedom, not coordinates.
    dofs = (trajectory.dof_names, trajectory.dof_units)
    of_dofs = dofs if trajectory.rotations else (names, units)
    n_dofs = trajectory.position.shape[1]
    for kind, labels in (("name", names), ("unit", units)):
        if len(labels) != n_dofs:
            raise ValueError(
                f"{kind}s has length {len(labels)}, expected {n_dofs}: one {kind} per DoF"
            )
    columns_of = list(zip(DERIVATIVES, ((names, units), of_dofs, of_dofs), strict=True))
    header = [f"{name}{suffix}" for (suffix, _), (own, _) in columns_of for name in own]
    _fields.check_names(path, 1, ["t", *header])
    units = [unit and f"{unit}{per}" for (_, per), (_, own) in columns_of for unit in own]
    fields = list(map(join_label, header, units))
    for name, unit, field in zip(header, units, fields, strict=True):
        if split_label(field) != (name, unit):
            raise value_error(f"{path}: '{field}' would not be read as '{name}' in '{unit}'")
    columns = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.acceleration)
    with atomic_write(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t", *fields])
        writer.writerows(np.column_stack(columns).tolist())
