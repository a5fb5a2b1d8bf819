"""Rows, names and numbers of a CSV file, with the place of whatever is wrong in them."""

import csv
import math
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
                    _check_header(path, reader.line_num, header)
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


def column(path: Path, header: Sequence[str], name: str) -> int:
    """Return the index of the column called `name`."""
    if name not in header:
        raise ValueError(f"{path}: no column '{name}' among {', '.join(header)}")
    return header.index(name)


def number(path: Path, line: int, name: str, field: str) -> float:
    """Return the finite number in a field of the column called `name`."""
    value = _parsed(field)
    if value is None:
        raise ValueError(f"{path}, line {line}, column '{name}': '{field}' is not a number")
    if not math.isfinite(value):
        raise ValueError(
            f"{path}, line {line}, column '{name}': {field} is not finite: "
            "fill the gap or cut the row out first"
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


def _check_header(path: Path, line: int, header: Sequence[str]) -> None:
    for name in header:
        if not name or _parsed(name) is not None:
            raise ValueError(
                f"{path}, line {line}: '{name}' is not a name: the first row must name the columns"
            )
        if header.count(name) > 1:
            raise ValueError(f"{path}, line {line}: two columns are called '{name}': rename one")
