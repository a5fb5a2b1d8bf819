"""Reader of the text files of OpenSim: TRC, MOT and STO."""

from __future__ import annotations

import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from pdmp._files import file_path
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io._csv_layout import CsvTable, read_text
from pdmp.io._demonstration import Options
from pdmp.io._fields import parse_number
from pdmp.io._motion_capture import axis, head, whole
from pdmp.io._table import read_table

FORCE = re.compile(r"force|torque|moment|grf|_[vpm][xyz]$", re.IGNORECASE)
"""Columns of a file in degrees that are no angles."""


def read_opensim(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads one demonstration from a TRC, MOT or STO file.

    TRC files have markers, whose coordinates are named `LASI.x`, `LASI.y` and `LASI.z`, in the
    unit that the file states. MOT and STO files have one column per coordinate, such as
    `hip_flexion_r`. Angles of a file in degrees have the unit deg, coordinates that end in `_tx`,
    `_ty` or `_tz` the unit m, and other quantities none.

    Parameters
    ----------
    path : path
        A TRC, MOT or STO file.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of the time stamps.
    max_gap : float
        Longest gap [s], of empty fields or NaN, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A file of another format or with fewer rows than it states, a missing column, or data that
        `Demonstration` rejects.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap, context)
    text = read_text(path)
    table = _markers(path, text) if text[:12] == "PathFileType" else _storage(path, text)
    return read_table(table, "t", options)


def _markers(path: Path, text: str) -> CsvTable:
    """Layout of a TRC file."""
    rows = head(text, "\t", 8)
    rows += [[""]] * (6 - len(rows))
    settings = dict(zip(rows[1], rows[2], strict=False))
    markers = [name for name in rows[3][2:] if name]
    if [name.lower() for name in rows[3][:2]] != ["frame#", "time"] or not markers:
        raise value_error(f"{path}: a TRC file without 'Frame#', 'Time' and markers in line 4")
    names = ["Frame#", "Time", *(axis(name, letter) for name in markers for letter in "XYZ")]
    units = ["", "s", *[settings.get("Units", "")] * (3 * len(markers))]
    n_rows = parse_number(settings.get("NumFrames", ""))
    return CsvTable(path, 4, names, units, 5, "\t", text, n_rows=whole(n_rows))


def _storage(path: Path, text: str) -> CsvTable:
    """Layout of a MOT or STO file."""
    rows = head(text, "\t")
    end = next((k for k, row in enumerate(rows) if row[0].lower() == "endheader"), None)
    if end is None:
        raise value_error(f"{path}: not a TRC, MOT or STO file: no line 'endheader'")
    line = next((k for k in range(end + 1, len(rows)) if any(rows[k])), None)
    if line is None:
        raise value_error(f"{path}: no columns after 'endheader'")
    settings = {}
    for row in rows[:end]:
        key, _, value = row[0].replace("=", " ").partition(" ")
        settings[key.lower()] = value.strip()
    in_degrees = settings.get("indegrees", "").lower() == "yes"
    separator = "\t" if len(rows[line]) > 1 else " "
    names = rows[line] if separator == "\t" else rows[line][0].split()
    while names and not names[-1]:
        names = names[:-1]
    n_rows = parse_number(settings.get("nrows", settings.get("datarows", "")))
    units = [_unit(name, in_degrees) for name in names]
    return CsvTable(path, line + 1, names, units, line + 1, separator, text, n_rows=whole(n_rows))


def _unit(name: str, in_degrees: bool) -> str:
    """Returns the unit of a coordinate, as far as the format states it."""
    if name.lower() == "time":
        return "s"
    if re.search(r"_t[xyz](/value)?$", name):
        return "m"
    if in_degrees:
        return "" if FORCE.search(name) else "deg"
    return "rad" if name.endswith("/value") else ""
