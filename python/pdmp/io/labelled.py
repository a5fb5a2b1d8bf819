"""Demonstrations in labelled arrays of xarray."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from pdmp._labels import name_list, split_label
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration
from pdmp.io import _columns
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._demonstration import Options, check_time, select
from pdmp.io.frames import seconds


def from_xarray(
    array: Any,
    *,
    by: str | None = None,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> dict[str, Demonstration]:
    """Returns the demonstrations in an array or a data set of xarray, by the values of a dimension.

    The dimension of time has the time stamps as its coordinate. The coordinates of the other
    dimensions, apart from `by`, name the degrees of freedom, as in `LASI.x`; of a data set, so do
    its variables. The attribute `units` is the unit, of an array or of each variable. Samples at
    the end that are NaN in every degree of freedom, where a demonstration is shorter than others,
    are left out.

    Parameters
    ----------
    array : DataArray or Dataset
        One demonstration, or several along the dimension `by`.
    by : str, optional
        Dimension of the demonstrations; without one, the array is the single demonstration "0".
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    time : str
        Dimension of time, by default `t`, `time` and the like, with coordinates in s or datetimes.
    dt : float, optional
        Sampling interval [s], instead of the coordinates of time.
    max_gap : float
        Longest gap [s], a run of NaN, to interpolate; by default 0, none.
    context : sequence of str, optional
        Coordinates along `by` that form the context (Q,).

    Raises
    ------
    ValueError
        A missing dimension or coordinate, or data that `Demonstration` rejects.
    """
    check_time(time)
    check_type("by", by, (str, type(None)), "the name of a dimension")
    if not hasattr(array, "dims") or not hasattr(array, "coords"):
        raise TypeError("array has no dimensions: expected a DataArray or Dataset of xarray")
    options = Options(columns, dt, max_gap)
    wanted = name_list("context", context or [])
    variables = {str(name): array[name] for name in getattr(array, "data_vars", [])} or {"": array}
    dims = [str(dim) for dim in array.dims]
    clock = _columns.find_clock(dims, time)
    if clock is None or (by is not None and by not in dims):
        missing = f"'{time}' of time: name it with time=" if clock is None else f"'{by}'"
        raise value_error(f"array: no dimension {missing} among {', '.join(dims)}")
    stamps = np.asarray(array.coords[clock]) if clock in array.coords else None
    unit = str(array.coords[clock].attrs.get("units", "")) if clock in array.coords else ""
    demos = NamedDemonstrations(context_names=wanted)
    labels = [None] if by is None else _values(array, by)
    for row, label in enumerate(labels):
        rows = {} if by is None else {by: row}
        names, units, position = _matrix(variables, clock, rows)
        source = "array" if by is None else f"array, {by} {label}"
        present = np.flatnonzero(~np.isnan(position).all(axis=1))
        end = present[-1] + 1 if len(present) else 0
        values = [_context(array, name, rows) for name in wanted]
        own = None
        if stamps is not None and options.dt is None:
            own = seconds(f"{source}, '{clock}'", clock, unit, stamps[:end])
        demos["0" if label is None else str(label)] = select(
            source, options, position[:end], names, units, time=own, context=values or None
        )
    return demos


def _matrix(variables: dict[str, Any], clock: str, rows: dict[str, int]) -> Any:
    """Returns names, units and positions (T, D) of one demonstration."""
    names, units, blocks = [], [], []
    for variable, array in variables.items():
        if clock not in array.dims or array.dtype.kind not in "fiu":
            continue
        own = array.isel({dim: row for dim, row in rows.items() if dim in array.dims})
        others = [dim for dim in own.dims if dim != clock]
        block = np.asarray(own.transpose(clock, *others), float)
        parts = [[str(value) for value in _values(own, str(dim))] for dim in others]
        for part in product(*parts):
            name, unit = split_label(".".join(filter(None, [variable, *part])) or "y0")
            names.append(name)
            units.append(unit or str(own.attrs.get("units", "")))
        blocks.append(block.reshape(len(block), -1))
    if not blocks:
        raise value_error(f"array: no numbers along the dimension '{clock}'")
    return names, units, np.hstack(blocks)


def _values(array: Any, dim: str) -> list[Any]:
    """Returns the coordinates of a dimension, or the indices along it."""
    return list(array.coords[dim].values if dim in array.coords else range(array.sizes[dim]))


def _context(array: Any, name: str, rows: dict[str, int]) -> Any:
    """Returns a coordinate of one demonstration."""
    if name not in array.coords:
        raise value_error(
            f"array: no coordinate '{name}' among {', '.join(map(str, array.coords))}"
        )
    coordinate = array.coords[name]
    value = coordinate.isel({dim: row for dim, row in rows.items() if dim in coordinate.dims})
    if value.ndim:
        raise value_error(f"array: the coordinate '{name}' has more than one value each")
    return value.item()
