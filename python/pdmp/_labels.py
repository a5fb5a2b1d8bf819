"""Names and units of degrees of freedom, in headers, data frames and labelled arrays."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pdmp._messages import quoted, value_error, warn

if TYPE_CHECKING:
    from pdmp._native import Trajectory

ROTATION_DOF = "_rot"
"""Suffix of the name of a degree of freedom of a rotation, after that of its column."""


def dof_labels(
    names: Sequence[str], units: Sequence[str], rotations: Mapping[int, str]
) -> tuple[list[str], list[str]]:
    """Returns names and units of the degrees of freedom, from those of the coordinates."""
    own, own_units = list(names), list(units)
    for column in rotations:
        four = slice(column, column + 4)
        own[four] = [f"{name}{ROTATION_DOF}" for name in names[four]]
        own_units[four] = ["rad"] * 4
    scalars = {column + 3 * (order == "xyzw") for column, order in rotations.items()}
    kept = [column for column in range(len(own)) if column not in scalars]
    return [own[column] for column in kept], [own_units[column] for column in kept]


DERIVATIVES = (("", ""), ("_velocity", "/s"), ("_acceleration", "/s²"))
"""Suffixes of name and unit in the columns of position, velocity and acceleration."""

CLOCK = re.compile(
    r"t|(time([ _]?stamps?)?|timestamps?|stamps?|seconds?|secs?|elapsed([ _]time)?)", re.IGNORECASE
)
"""Names of a column of time stamps, without its unit."""
CLOCK_UNIT = re.compile(r"[ _](s|sec|seconds?|ms|us|µs|ns)$")
"""Unit at the end of such a name."""


def split_label(field: str) -> tuple[str, str]:
    """Returns name and unit of a header field such as `knee [rad]`; the unit is "" without one."""
    match = re.fullmatch(r"(.*\S)\s*\[([^][]*)\]", field.strip(), re.DOTALL)
    return (match[1], match[2].strip()) if match else (field.strip(), "")


def clock_unit(name: str) -> str | None:
    """Returns the unit in the name of a column of time stamps, or None for another column."""
    name, unit = split_label(re.sub(r"\((.*)\)$", r"[\1]", name))
    if not unit and (match := CLOCK_UNIT.search(name)):
        name, unit = name[: match.start()], match[1]
    # An upper-case T is a temperature or a torque.
    return unit if name != "T" and CLOCK.fullmatch(name) else None


def join_label(name: str, unit: str) -> str:
    """Returns a name with its unit, which `split_label` splits again."""
    return f"{name} [{unit}]" if unit else name


def name_list(argument: str, names: Sequence[str]) -> list[str]:
    """Returns names as a list; rejects a single text, which would become a list of letters."""
    if isinstance(names, str):
        raise value_error(f"{argument} = '{names}': pass a list of names, ['{names}']")
    listed = list(names) if isinstance(names, Iterable) else [None]
    if not all(isinstance(name, str) for name in listed):
        raise TypeError(f"{argument} = {quoted(names)}: expected a list of names")
    return listed


def names_and_units(value: Any) -> tuple[list[str] | None, list[str] | None]:
    """Returns names and units of positions; warns of a column that is probably the time."""
    names, units = column_labels(value)
    if times := [name for name in names or [] if clock_unit(name) is not None]:
        warn(
            f"the column '{times[0]}' of a data frame becomes a degree of freedom here: "
            "pdmp.io.from_dataframe reads it as the time"
        )
    return names, units


def column_labels(value: Any) -> tuple[list[str] | None, list[str] | None]:
    """Returns names and units of the degrees of freedom, or None.

    Names are the columns of a data frame, or the coordinate along the last axis of a labelled
    array. Units are part of the names, as in `knee [rad]`, or are in `attrs["units"]`.
    """
    fields = _fields(value)
    if not fields:
        return None, None
    names, units = map(list, zip(*map(split_label, fields), strict=True))
    attributes = getattr(value, "attrs", None)
    attribute = attributes.get("units") if isinstance(attributes, Mapping) else None
    if isinstance(attribute, str):
        attribute = dict.fromkeys(fields, attribute)
    if isinstance(attribute, Mapping):
        candidates = [attribute.get(field) for field in fields]
        units = [
            str(new) if isinstance(new, str) else old
            for old, new in zip(units, candidates, strict=True)
        ]
    return names, units if any(units) else None


def _fields(value: Any) -> list[str] | None:
    """Returns the names of the columns, or None unless all columns are named."""
    fields = getattr(value, "columns", None)
    dims, coords = getattr(value, "dims", None), getattr(value, "coords", None)
    if fields is None and isinstance(dims, tuple) and dims and isinstance(coords, Mapping):
        fields = getattr(coords.get(dims[-1]), "values", None)
    try:
        listed = list(fields)  # type: ignore[arg-type]
    except TypeError:
        return None
    all_named = all(isinstance(field, str) and field.strip() for field in listed)
    return [str(field) for field in listed] if all_named else None


def to_dataframe(trajectory: Trajectory) -> Any:
    """Returns a trajectory as a data frame; see `Trajectory.to_dataframe`."""
    try:
        import pandas
    except ImportError:
        raise ImportError("data frames need pandas: pip install pandas") from None
    columns, units = {}, {}
    derivatives = (trajectory.position, trajectory.velocity, trajectory.acceleration)
    coordinates = (trajectory.names, trajectory.units)
    dofs = (trajectory.dof_names, trajectory.dof_units)
    labels = (coordinates, dofs, dofs)
    labelled = zip(DERIVATIVES, labels, derivatives, strict=True)
    for (suffix, per), (names, own), values in labelled:
        for name, unit, column in zip(names, own, values.T, strict=True):
            columns[f"{name}{suffix}"] = column
            units[f"{name}{suffix}"] = unit and f"{unit}{per}"
    frame = pandas.DataFrame(columns, index=pandas.Index(trajectory.time, name="t"))
    frame.attrs["units"] = units
    return frame
