"""Names and units of degrees of freedom, in headers, data frames and labelled arrays."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pdmp._messages import value_error

if TYPE_CHECKING:
    from pdmp._native import Trajectory

DERIVATIVES = (("", ""), ("_velocity", "/s"), ("_acceleration", "/s²"))
"""Suffixes of the name and the unit of each derivative, in the columns of a table."""
FULL_TURN = {"rad": math.tau, "deg": 360.0, "°": 360.0}
"""Full turn in each unit of angle."""


def split_label(field: str) -> tuple[str, str]:
    """Returns name and unit of a header field such as `knee [rad]`; the unit is "" without one."""
    found = re.fullmatch(r"(.*\S)\s*\[([^][]*)\]", field.strip(), re.DOTALL)
    return (found[1], found[2].strip()) if found else (field.strip(), "")


def name_list(argument: str, names: Sequence[str]) -> list[str]:
    """Returns names as a list; refuses a text, which would become a list of letters."""
    if isinstance(names, str):
        raise value_error(f"{argument} = '{names}': pass a list of names, ['{names}']")
    return list(names)


def names_and_units(value: Any) -> tuple[list[str] | None, list[str] | None]:
    """Returns names and units of the degrees of freedom, each None where the object has none.

    Names are the columns of a data frame, or the coordinate along the last axis of a labelled
    array. Units stand in the names, as `knee [rad]`, or in `attrs["units"]`.
    """
    fields = _fields(value)
    if not fields:
        return None, None
    names, units = map(list, zip(*map(split_label, fields), strict=True))
    noted = getattr(value, "attrs", None)
    noted = noted.get("units") if isinstance(noted, Mapping) else None
    if isinstance(noted, str):
        noted = dict.fromkeys(fields, noted)
    if isinstance(noted, Mapping):
        given = [noted.get(field) for field in fields]
        units = [
            str(new) if isinstance(new, str) else old for old, new in zip(units, given, strict=True)
        ]
    return names, units if any(units) else None


def _fields(value: Any) -> list[str] | None:
    """Returns the names of the columns, if all of them have one."""
    fields = getattr(value, "columns", None)
    dims, coords = getattr(value, "dims", None), getattr(value, "coords", None)
    if fields is None and isinstance(dims, tuple) and dims and isinstance(coords, Mapping):
        fields = getattr(coords.get(dims[-1]), "values", None)
    try:
        listed = list(fields)  # type: ignore[arg-type]
    except TypeError:
        return None
    named = all(isinstance(field, str) and field.strip() for field in listed)
    return [str(field) for field in listed] if named else None


def to_dataframe(trajectory: Trajectory) -> Any:
    """Returns a trajectory as a data frame, as `Trajectory.to_dataframe` describes."""
    try:
        import pandas
    except ImportError:
        raise ImportError("data frames need pandas: pip install pandas") from None
    columns, units = {}, {}
    kinds = (trajectory.position, trajectory.velocity, trajectory.acceleration)
    for (suffix, per), values in zip(DERIVATIVES, kinds, strict=True):
        for name, unit, column in zip(trajectory.names, trajectory.units, values.T, strict=True):
            columns[f"{name}{suffix}"] = column
            units[f"{name}{suffix}"] = unit and f"{unit}{per}"
    frame = pandas.DataFrame(columns, index=pandas.Index(trajectory.time, name="t"))
    frame.attrs["units"] = units
    return frame
