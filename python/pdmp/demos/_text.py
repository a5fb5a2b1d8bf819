"""Rows, names and numbers of a CSV file, with the place of whatever is wrong in them."""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path


def rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and fields of each row that is not blank, the checked header first."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        header: list[str] = []
        try:
            for row in reader:
                fields = [field.strip() for field in row]
                if not any(fields):
                    continue
                if not header:
                    header = fields
                    if len(header) == 1 and re.search("[;\t]", header[0]):
                        raise ValueError(
                            f"{path}, line {reader.line_num}: '{header[0]}' is one field: "
                            "separate fields by commas"
                        )
                    check_names(path, reader.line_num, header)
                elif len(fields) != len(header):
                    raise ValueError(
                        f"{path}, line {reader.line_num}: {len(fields)} fields, "
                        f"expected {len(header)} as in the header"
                    )
                yield reader.line_num, fields
        except UnicodeDecodeError:
            raise ValueError(f"{path}: not UTF-8 text: save it as UTF-8") from None
        except csv.Error as error:
            raise ValueError(f"{path}, line {reader.line_num}: {error}") from None
    if not header:
        raise ValueError(f"{path}: empty: expected a header row with names, then one sample a row")


def label(field: str) -> tuple[str, str]:
    """Return name and unit of a header field such as `knee [rad]`; the unit is "" without one."""
    found = re.fullmatch(r"(.*\S)\s*\[([^][]*)\]", field)
    return (found[1], found[2].strip()) if found else (field, "")


def listed(argument: str, names: Sequence[str]) -> list[str]:
    """Return several names as a list; a text would be taken apart letter by letter."""
    if isinstance(names, str):
        raise ValueError(f"{argument} = '{names}': pass a list of names, ['{names}']")
    return list(names)


def check_names(path: Path, line: int, names: Sequence[str]) -> None:
    """Check that the first row names the columns, each by a name of its own."""
    for name in names:
        if not name.strip() or _parsed(name) is not None:
            raise ValueError(
                f"{path}, line {line}: '{name}' is not a name: the first row must name the columns"
            )
        if names.count(name) > 1:
            raise ValueError(f"{path}, line {line}: two columns are called '{name}': rename one")


def column(path: Path, header: Sequence[str], name: str) -> int:
    """Return the index of the column called `name`."""
    if name not in header:
        raise ValueError(f"{path}: no column '{name}' among {', '.join(header)}")
    return header.index(name)


def number(path: Path, line: int, name: str, field: str, *, gaps: bool = False) -> float:
    """Return the finite number in a field of the column called `name`, or NaN for a gap."""
    value = _parsed(field)
    if gaps and (not field or (value is not None and math.isnan(value))):
        return math.nan
    if not field:
        raise ValueError(
            f"{path}, line {line}, column '{name}': empty: pass max_gap= to interpolate what is "
            "missing, or cut the row out"
        )
    if value is None:
        raise ValueError(f"{path}, line {line}, column '{name}': '{field}' is not a number")
    if not math.isfinite(value):
        raise ValueError(
            f"{path}, line {line}, column '{name}': {field} is not finite: "
            "pass max_gap= to interpolate what is NaN, or cut the row out"
        )
    return value


def is_number(field: str) -> bool:
    """Say whether a field holds a number, finite or not."""
    return _parsed(field) is not None


def _parsed(field: str) -> float | None:
    try:
        return float(field)
    except ValueError:
        return None
