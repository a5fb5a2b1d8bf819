"""Demonstrations in data frames and labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import clock_unit, column_labels, name_list, split_label
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration
from pdmp.io import _columns, _fields, _time_units
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._demonstration import Options, check_time, select


def from_dataframe(
    frame: Any,
    *,
    by: str | None = None,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> dict[str, Demonstration]:
    """Returns the demonstrations in a data frame of pandas or polars, by the values of a column.

    A row is a sample. Every numeric column is a degree of freedom, except `by`, `time`, `context`,
    counters such as `frame`, and the derivatives that `Trajectory.to_dataframe` writes. Units are
    part of the names, as in `knee [rad]`, or in `frame.attrs["units"]`.

    Parameters
    ----------
    frame : DataFrame
        One demonstration, or several one below the other.
    by : str, optional
        Column with the name or number of the demonstration of each row; without one, the frame is
        the single demonstration "0".
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order.
    time : str
        Column or index level of the time stamps, numbers in s or datetimes; by default `t`, `time`
        and the like, or the index of pandas unless it counts the rows.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s], a run of missing values, to interpolate; by default 0, none.
    context : sequence of str, optional
        Columns that form the context (Q,), constant within each demonstration.

    Raises
    ------
    ValueError
        A missing column, no time stamps, a context that varies within a demonstration, or data that
        `Demonstration` rejects.

    Examples
    --------
    >>> import pandas
    >>> s = np.linspace(0, 1, 50)
    >>> trials = [
    ...     pandas.DataFrame({"trial": k, "t": s, "load": 1.0 * k, "x [m]": (1 + k) * s**2})
    ...     for k in range(3)
    ... ]
    >>> demos = pdmp.io.from_dataframe(pandas.concat(trials), by="trial", context=["load"])
    >>> demos["2"].names, demos["2"].units, demos["2"].context
    (['x'], ['m'], array([2.]))
    """
    check_type("by", by, (str, type(None)), "the name of a column")
    if not hasattr(frame, "columns"):
        raise TypeError("frame has no columns: expected a data frame of pandas or polars")
    wanted = name_list("context", context or [])
    return read_frame("frame", frame, by, time, Options(columns, dt, max_gap), wanted)


def read_frame(
    source: str, frame: Any, by: str | None, time: str, options: Options, wanted: Sequence[str]
) -> dict[str, Demonstration]:
    """Returns the demonstrations in a data frame; `source` precedes the texts of errors."""
    check_time(time)
    names, units, table = _table(source, frame, time)
    clock = _columns.find_clock(names, time)
    for name in filter(None, [by, *wanted]):
        _fields.column_indices(source, names, [name])
    if clock is None and options.dt is None:
        raise value_error(
            f"{source}: no column '{time}' with the time among {', '.join(names)}: name it with "
            "time=, or pass dt="
        )
    kept = _positions(source, names, table, {by, clock, *wanted}, options.columns)
    groups = _groups(source, table[by]) if by is not None else {"0": slice(None)}
    demos = {
        group: _demonstration(
            f"{source}, {by} {group}" if by else source,
            options,
            {name: table[name][rows] for name in kept},
            [units[names.index(name)] for name in kept],
            None if clock is None else (clock, units[names.index(clock)], table[clock][rows]),
            {name: table[name][rows] for name in wanted},
        )
        for group, rows in groups.items()
    }
    return NamedDemonstrations(demos, wanted)


def _table(
    source: str, frame: Any, time: str
) -> tuple[list[str], list[str], dict[str, NDArray[Any]]]:
    """Returns names, units and columns of a frame, with the levels of its index."""
    index = getattr(frame, "index", None)
    if index is not None and type(index).__name__ != "RangeIndex":
        counts = len(index.names) == 1 and index.names[0] is None and _counts(np.asarray(index))
        attributes = dict(frame.attrs)
        if not counts:
            levels = [
                each or (time if len(index.names) == 1 else f"level_{k}")
                for k, each in enumerate(index.names)
            ]
            frame = frame.reset_index(names=levels)
            frame.attrs.update(attributes)
    columns = list(frame.columns)
    if not all(isinstance(name, str) for name in columns):
        raise value_error(f"{source}: columns without names: {columns[:5]}: name them by texts")
    labels = column_labels(frame)
    names = labels[0] or [split_label(name)[0] for name in columns]
    units = labels[1] or [""] * len(names)
    if len(set(names)) < len(names):
        raise value_error(f"{source}: two columns of the same name: rename one")
    arrays = {name: np.asarray(frame[own]) for name, own in zip(names, columns, strict=True)}
    return names, units, arrays


def _counts(index: NDArray[Any]) -> bool:
    """Returns True if an index numbers rows, as after the selection of some of them."""
    return index.dtype.kind in "iu"


def _positions(
    source: str,
    names: Sequence[str],
    table: Mapping[str, NDArray[Any]],
    others: set[str | None],
    columns: Sequence[str] | None,
) -> list[str]:
    """Returns the columns with positions."""
    if columns is not None:
        _fields.column_indices(source, names, columns)
        return list(columns)
    others = others | _columns.derivatives(names)
    kept = [
        name
        for name in names
        if name not in others
        and (table[name].dtype.kind in "fiu" or _is_numeric(table[name]))
        and not (_columns.COUNTER.fullmatch(name) and table[name].dtype.kind in "iu")
    ]
    if not kept:
        raise value_error(f"{source}: no numeric columns among {', '.join(names)}")
    return kept


def _is_numeric(values: NDArray[Any]) -> bool:
    """Returns True for objects that are numbers or missing, as nullable columns give."""
    if values.dtype.kind != "O":
        return False
    try:
        return bool(np.isfinite(_floats(values)).any())
    except (TypeError, ValueError):
        return False


def _floats(values: NDArray[Any]) -> NDArray[np.float64]:
    if values.dtype.kind != "O":
        return values.astype(float)
    if any(isinstance(value, (str, bytes)) for value in values):
        raise ValueError("texts")
    missing = [
        value is None or value != value or type(value).__name__ == "NAType" for value in values
    ]
    return np.array([np.nan if gone else float(v) for gone, v in zip(missing, values, strict=True)])


def _groups(source: str, values: NDArray[Any]) -> dict[str, Any]:
    """Returns the rows of each demonstration, in the order of their first rows."""
    rows: dict[str, list[int]] = {}
    for row, value in enumerate(values.tolist()):
        if value is None or value != value:
            raise value_error(f"{source}, row {row}: no demonstration in the column of by=")
        rows.setdefault(str(value), []).append(row)
    return {name: np.array(own) for name, own in rows.items()}


def _demonstration(
    source: str,
    options: Options,
    columns: Mapping[str, NDArray[Any]],
    units: Sequence[str],
    clock: tuple[str, str, NDArray[Any]] | None,
    context: Mapping[str, NDArray[Any]],
) -> Demonstration:
    """Returns the demonstration of some rows."""
    try:
        position = np.column_stack([_floats(values) for values in columns.values()])
    except (TypeError, ValueError):
        raise value_error(f"{source}: a column that is not numeric is kept") from None
    time = None
    if clock is not None and options.dt is None:
        name, unit, stamps = clock
        time = seconds(f"{source}, column '{name}'", name, unit, stamps)
    values = []
    for name, column in context.items():
        if any(value != column[0] for value in column):
            raise value_error(f"{source}: '{name}' varies, but is its context: leave it out")
        values.append(column[0].item() if hasattr(column[0], "item") else column[0])
    names = list(columns)
    return select(source, options, position, names, list(units), time=time, context=values or None)


def seconds(source: str, name: str, unit: str, stamps: NDArray[Any]) -> NDArray[np.float64]:
    """Returns time stamps in s; dates are relative to the first."""
    if stamps.dtype.kind in "Mm":
        return np.asarray((stamps - stamps[0]) / np.timedelta64(1, "s"), float)
    unit = _time_units.unit_of(source, name, unit or clock_unit(name) or "")
    try:
        numbers = stamps if stamps.dtype.kind in "iuf" else _floats(stamps)
    except (TypeError, ValueError):
        raise value_error(f"{source}: neither numbers nor datetimes") from None
    return _time_units.to_seconds(source, numbers, unit, f"name it '{name} [{{unit}}]'")
