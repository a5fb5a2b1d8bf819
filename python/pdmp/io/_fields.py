"""Names and numbers in the fields of a CSV file, with errors that give file, line and column."""

import math
from collections.abc import Sequence
from pathlib import Path

from pdmp._messages import value_error

MAX_QUOTED = 80
"""Largest number of characters of a field in an error."""
GAPS = frozenset([
    "na", "n/a", "#n/a", "#na", "<na>", "null", "none", "nan", "+nan", "-nan", "nan(ind)",
    "-nan(ind)", "1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind",
])  # fmt: skip
"""Texts, besides the empty one, that mark a missing number."""


def check_names(path: Path, line: int, names: Sequence[str]) -> None:
    """Rejects a header with a number, an empty field or the same name twice."""
    seen: set[str] = set()
    for name in names:
        if not is_name(name):
            raise value_error(
                f"{path}, line {line}: '{short(name)}' is not a name: the first row must name the "
                "columns"
            )
        if name in seen:
            raise value_error(
                f"{path}, line {line}: two columns are called '{short(name)}': rename one"
            )
        seen.add(name)


def is_name(field: str) -> bool:
    """Returns True if a field can be the name of a column."""
    return bool(field.strip()) and parse_number(field.replace(",", ".", 1)) is None


def column_indices(path: Path | str, header: Sequence[str], names: Sequence[str]) -> list[int]:
    """Returns the index of the column of each name."""
    indices = {name: k for k, name in enumerate(header)}
    for name in names:
        if name not in indices:
            available = ", ".join(header) if len(header) <= 40 else f"{len(header)} columns"
            raise value_error(f"{path}: no column '{name}' among {available}")
    return [indices[name] for name in names]


def read_number(path: Path, line: int, name: str, field: str, *, gaps: bool = False) -> float:
    """Returns the finite number in a field of column `name`, or NaN for a gap if `gaps` is True."""
    value = parse_number(field)
    field = short(field)
    location = f"{path}, line {line}, column '{name}'"
    if is_gap(field):
        if gaps:
            return math.nan
        reason = f"{field} is not finite" if value is not None else f"'{field}' marks a gap"
        raise value_error(
            f"{location}: {reason if field else 'empty'}: pass max_gap= to interpolate "
            "gaps, or delete the row"
        )
    if value is None:
        hint = ""
        if parse_number(field.replace(",", ".")) is not None:
            hint = ": decimal commas are read where semicolons or tabs separate the fields"
        raise value_error(f"{location}: '{field}' is not a number{hint}")
    if not math.isfinite(value):
        raise value_error(f"{location}: {field} is not finite: delete the row")
    return value


def short(field: str) -> str:
    """Returns a field, or the beginning of a long one."""
    return field if len(field) <= MAX_QUOTED else field[:MAX_QUOTED] + "..."


def is_gap(field: str) -> bool:
    """Returns True if a field marks a missing number."""
    return not field or field.lower() in GAPS


def is_number(field: str) -> bool:
    """Returns True if a field is a number, finite or not."""
    return parse_number(field) is not None


def parse_number(field: str) -> float | None:
    """Returns the number in a field, or None."""
    try:
        # Python parses 1_000 as 1000.
        return None if "_" in field else float(field)
    except ValueError:
        return None
