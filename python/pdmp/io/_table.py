"""Demonstration in a table of numbers of any program."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import clock_unit, name_list, split_label
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _columns, _fields, _stamps, _time_units
from pdmp.io._csv_layout import CsvTable
from pdmp.io._demonstration import Options, make_demonstration

THOUSANDS = re.compile(r"[^,]*|[-+]?[1-9]\d{0,2}(,\d{3})+")


def read_table(table: CsvTable, time: str, options: Options) -> Demonstration:
    """Returns the demonstration in a table; see `read_csv` for the columns."""
    path = table.path
    header, units = _labels(table)
    names = [name for name in header if name]
    _fields.check_names(path, table.line, names)
    clock = _clock(table, header, time)
    interval = options.dt
    if interval is None and clock is None:
        interval = table.interval
        if interval is None:
            raise value_error(
                f"{path}: no column '{time}' with the time among {', '.join(names)}: "
                "name it with time=, or pass dt="
            )
    stamped = None if clock is None else header[clock]
    if options.columns is None:
        left_out = _columns.derivatives(names) | table.ignored | {stamped}
        names = [name for name in names if name not in left_out]
    else:
        names = name_list("columns", options.columns)
    indices = _fields.column_indices(path, header, names)
    clock = clock if interval is None else None
    position, stamps = _numbers(table, header, indices, clock, gaps=options.max_gap > 0)
    if table.n_rows is not None and len(position) != table.n_rows:
        raise value_error(
            f"{path}: has {len(position)} samples, but states {table.n_rows}: export it again"
        )
    if options.columns is None:
        counting = _columns.counters(names, position)
        kept = [d for d in range(len(names)) if d not in counting]
        # A recording of a counter alone is one all the same.
        kept = kept or list(range(len(names)))
        position, indices = position[:, kept], [indices[d] for d in kept]
    seconds = None
    if clock is not None and stamps is not None:
        seconds = _seconds(table, header[clock], units[clock], time, stamps)
    return make_demonstration(
        path,
        position,
        dt=interval,
        time=seconds,
        names=[header[k] for k in indices],
        units=[units[k] for k in indices] if any(units[k] for k in indices) else None,
        max_gap=options.max_gap,
        context=options.context,
        rotations=table.rotations,
    )


def _labels(table: CsvTable) -> tuple[list[str], list[str]]:
    """Returns names and units of the columns; units in the header take precedence."""
    header, units = map(list, zip(*map(split_label, table.fields), strict=True))
    if table.units is not None:
        units = [unit or below for unit, below in zip(units, table.units, strict=True)]
    return header, units


def _clock(table: CsvTable, header: list[str], time: str) -> int | None:
    """Returns the column of the time stamps; the unnamed index of pandas may be one."""
    named = _columns.find_clock(header, time)
    if named is not None:
        return header.index(named)
    if not header[0] and len(header) > 1 and time == _columns.CLOCKS[0]:
        index = [row[0].replace(",", ".") for _, row in table.rows()]
        stamps = [_fields.parse_number(field) for field in index if ":" not in field]
        rising = all(a is not None and b is not None and a < b for a, b in pairwise(stamps))
        if any(index) and rising and index != list(map(str, range(len(index)))):
            return 0
    return None


def _seconds(
    table: CsvTable, name: str, unit: str, time: str, stamps: list[Any]
) -> NDArray[np.float64]:
    """Returns the time stamps in s."""
    source = f"{table.path}, column '{name}'"
    values, dated = _stamps.to_array(source, stamps)
    declared = unit or ("" if name == time else split_label(time)[1])
    declared = declared or ("s" if dated else clock_unit(name) or "")
    remedy = f"write '{name} [{{unit}}]' in the header or as time="
    unit = _time_units.unit_of(table.path, name, declared)
    return _time_units.to_seconds(source, values, unit, remedy)


def _numbers(
    table: CsvTable, header: list[str], indices: list[int], clock: int | None, *, gaps: bool
) -> tuple[NDArray[Any], list[Any] | None]:
    """Returns positions (T, D), NaN in gaps, and time stamps (T,) in the unit of the file."""
    path = table.path
    numbers: list[list[float]] = []
    stamps: list[Any] = []
    names = [header[k] for k in indices]
    unnamed = [k for k, name in enumerate(header) if not name and k != clock]
    commas = Commas()
    for line, row in table.rows(blank=clock is None):
        _check_unnamed(path, line, row, unnamed, len(numbers))
        cells = [row[k] for k in indices]
        if clock is not None:
            cells.append(row[clock])
        if table.separator != ",":
            cells = commas.with_points(path, line, cells)
        if clock is not None:
            stamps.append(_stamps.read_stamp(path, line, header[clock], cells.pop()))
        numbers.append(_row(path, line, cells, names, gaps=gaps))
    commas.check(path)
    positions = np.array(numbers, float).reshape(len(numbers), len(indices))
    return positions, None if clock is None else stamps


@dataclass
class Commas:
    """Meaning of the commas in the numbers of a table."""

    comma: int = 0  # last line with a decimal comma
    point: int = 0  # and with a decimal point
    thousands: bool = True  # while all commas may separate thousands

    def with_points(self, path: Path, line: int, cells: list[str]) -> list[str]:
        """Returns the numbers of a row with decimal points."""
        text = "".join(cells)
        if "." in text:
            self.point = line
        if "," in text:
            self.comma = line
            self.thousands = self.thousands and all(map(THOUSANDS.fullmatch, cells))
            cells = [cell.replace(",", ".") for cell in cells]
        if self.comma and self.point:
            raise value_error(
                f"{path}, line {line}: numbers have decimal commas and decimal points: use one of "
                "them throughout, without separators of thousands"
            )
        return cells

    def check(self, path: Path) -> None:
        """Raises an error if all commas may separate thousands."""
        if self.comma and self.thousands:
            raise value_error(
                f"{path}, line {self.comma}: commas are decimal or separate thousands: write "
                "decimal points"
            )


def _row(
    path: Path, line: int, cells: Sequence[str], names: Sequence[str], *, gaps: bool
) -> list[float]:
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
