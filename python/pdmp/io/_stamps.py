"""Time stamps in the fields of a table: numbers, dates and times of day."""

import re
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import value_error
from pdmp.io import _fields

CLOCK = re.compile(r"(?:(-?\d+) days? \+?)?(\d{1,9}):(\d\d):(\d\d(?:\.\d{1,12})?)")
"""Time of day, or a time difference as pandas writes it."""


def read_stamp(path: Path, line: int, name: str, field: str) -> float | int | datetime:
    """Returns the time stamp in a field: a number, s of a time of day, or a date."""
    if ":" not in field and "-" not in field[1:-1]:
        value = _fields.read_number(path, line, name, field)
        # ns since 1970 exceed the precision of a double, and fit into 64 bits.
        return int(field) if field.isdecimal() and value < 2**63 else value
    if match := CLOCK.fullmatch(field):
        days, hours, minutes, seconds = (float(part or 0) for part in match.groups())
        return 86400 * days + 3600 * hours + 60 * minutes + seconds
    try:
        return datetime.fromisoformat(field)
    except ValueError:
        return _fields.read_number(path, line, name, field)


def to_array(source: str, stamps: list[float | int | datetime]) -> tuple[NDArray[np.generic], bool]:
    """Returns the stamps as an array, and True if they are in s because they were dates."""
    dated = [isinstance(stamp, datetime) for stamp in stamps]
    if not any(dated):
        return np.array(stamps), False
    try:
        first = stamps[0]
        seconds = [(stamp - first).total_seconds() for stamp in stamps]  # type: ignore[operator,union-attr]
    except (TypeError, AttributeError):
        raise value_error(
            f"{source}: dates with a zone, without one, or numbers are mixed"
        ) from None
    return np.array(seconds), True
