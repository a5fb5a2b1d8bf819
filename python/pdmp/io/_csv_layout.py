"""Layout of a CSV file: separator, lines before the header, header, units and rows."""

from __future__ import annotations

import csv
import io
import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from pdmp._messages import value_error
from pdmp.io import _fields

MAX_PREAMBLE = 200
"""Number of first rows that determine the layout; they must include the header."""
MAX_UNIT = 40
"""Largest number of characters of a unit; matching is too slow for longer texts."""
UNIT = re.compile(
    r"[munµμkMG]?(s|m|rad|N|Nm|g|V|A|Hz|W|J|Pa|T)|deg|°|°C|sec|min|h|cm|dm|deg|turns?|rev|px|%|1|"
    r"counts?|quat"
)
"""Units with their prefixes, alone or as factors of products and quotients."""
Row = tuple[int, list[str]]


@dataclass
class CsvTable:
    """Layout of a CSV file, and iteration over its rows."""

    path: Path
    line: int  # of the header
    fields: list[str]  # of the header
    units: list[str] | None = None  # of a row below it
    first: int = 0  # line before the first sample
    separator: str = ","
    text: str = field(default="", repr=False)
    last: float = math.inf  # line of the last sample
    interval: float | None = None  # of the samples [s], if the file states it
    n_rows: int | None = None  # number of samples, if the file states it
    rotations: dict[str, Any] = field(default_factory=dict)  # quaternions, by their first column
    ignored: set[str] = field(default_factory=set)  # columns that are kept only on demand

    def rows(self, *, blank: bool = False) -> Iterator[Row]:
        """Yields line number and fields of each sample, with `blank` also rows of empty fields.

        Blank lines, and rows of empty fields at the end, are skipped.
        """
        skipped: list[Row] = []
        for line, fields in _parse(self.path, self.text, self.separator):
            if line <= self.first:
                continue
            if line > self.last:
                break
            while len(fields) > len(self.fields) and not fields[-1]:
                fields.pop()  # separators at the end of the line
            if len(fields) != len(self.fields) and any(fields):
                hint = ""
                if len(fields) > len(self.fields) and self.separator == ",":
                    hint = "; with decimal commas, separate fields by semicolons"
                raise value_error(
                    f"{self.path}, line {line}: {len(fields)} fields, "
                    f"expected {len(self.fields)} as in the header{hint}"
                )
            if not any(fields):
                if blank and len(fields) == len(self.fields) > 1:
                    skipped.append((line, fields))
                continue
            yield from skipped
            skipped.clear()
            yield line, fields


def read_text(path: Path) -> str:
    """Returns the text of a file; spreadsheets write UTF-16 with a byte order mark as "Unicode"."""
    raw = path.read_bytes()
    try:
        return raw.decode("utf-16" if raw[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        raise value_error(f"{path}: not UTF-8 text: save it as UTF-8") from None


def parse_layout(
    path: Path, text: str, is_clock: Callable[[str], bool] | None = None, *, index: bool = False
) -> CsvTable:
    """Finds separator, header and units of a CSV file.

    Comments, which begin with #, a line such as `sep=;` and other lines before the header are
    skipped. The header is the row of names with the number of fields of the samples; among several,
    the one with the name of a column of time stamps. It may be in a comment. A row of units may
    follow it. The header of an index, whose rows may be words, is its first row.
    """
    separator = _separator(path, text)
    sample = [row for row in islice(_parse(path, text, separator), MAX_PREAMBLE) if any(row[1])]
    sample = [row for row in sample if not _declared_separator(separator.join(row[1]))]
    if not sample:
        raise value_error(
            f"{path}: empty: expected a header row with names, then one sample per row"
        )
    width = _width([fields for _, fields in sample])
    line, fields = sample[0]
    if not index:
        line, fields = _header(path, text, separator, sample, width, is_clock)
    below = next((row for row in sample if row[0] > line), None)
    units, first = None, line
    if not index and below is not None and len(below[1]) == width and _are_units(below[1]):
        units, first = [unit.strip("[]()-") for unit in below[1]], below[0]
    fields = [re.sub(r"^%\s+", "", fields[0]), *fields[1:]]
    return CsvTable(path, line, fields, units, first, separator, text)


def _parse(path: Path, text: str, separator: str) -> Iterator[Row]:
    """Yields line number and fields of each row; comments are blank rows."""
    lines = ("\n" if _is_comment(line) else line for line in io.StringIO(text, newline=""))
    if separator == " ":
        lines = (line.strip() + "\n" for line in lines)
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        for row in reader:
            yield reader.line_num, [cell.strip() for cell in row]
    except csv.Error as error:
        raise value_error(f"{path}, line {reader.line_num}: {error}") from None


def _is_comment(line: str) -> bool:
    return line.lstrip(" ").startswith("#")


def _separator(path: Path, text: str) -> str:
    """Returns the separator that gives most of the first rows the same number of fields."""
    head = "".join(islice(io.StringIO(text, newline=""), MAX_PREAMBLE))
    for line in head.splitlines():
        if separator := _declared_separator(line):
            return separator
        if line.strip():
            break
    n_equal = {",": 1}  # rows with the same number of fields, by separator; the first wins a tie
    for separator in ",;\t ":
        rows = [fields for _, fields in _parse(path, head, separator) if len(fields) > 1]
        counts = Counter(len(fields) for fields in rows if any(fields))
        n_equal[separator] = max(n_equal.get(separator, 0), *counts.values(), 0)
    return max(n_equal, key=lambda separator: n_equal[separator])


def _declared_separator(line: str) -> str:
    """Returns the separator of a line such as `sep=;`, or ""."""
    match = re.fullmatch(r'"?sep=(.|\\t)"?', line.strip("\r\n"), re.IGNORECASE)
    return match[1].replace("\\t", "\t") if match else ""


def _width(rows: list[list[str]]) -> int:
    """Returns the most frequent number of fields, above one if possible: lines of text have one."""
    counts = Counter(len(fields) for fields in rows)
    wide = {n: count for n, count in counts.items() if n > 1} or counts
    return max(wide, key=lambda n: (wide[n], n))


def _header(
    path: Path,
    text: str,
    separator: str,
    sample: list[Row],
    width: int,
    is_clock: Callable[[str], bool] | None,
) -> Row:
    """Returns the row that names the columns, or the first row."""
    named: list[Row] = []
    previous: list[str] = []
    for line, fields in sample:
        if len(fields) == width and _are_numbers(fields):
            break
        units = named and previous is named[-1][1] and _are_units(fields)
        if len(fields) == width and not units and _are_names(fields):
            named.append((line, fields))
        previous = fields
    timed = [row for row in named if is_clock and any(map(is_clock, row[1]))]
    if len(timed or named) > 1 and not timed:
        raise value_error(
            f"{path}: lines {named[0][0]} and {named[1][0]} may both name the columns: delete the "
            "lines before the header"
        )
    if named:
        return (timed or named)[0]
    header = sample[0]
    for number, comment in enumerate(io.StringIO(text), 1):
        if number >= sample[0][0]:
            break
        if _is_comment(comment):
            for _, fields in _parse(path, comment.lstrip(" #%"), separator):
                if len(fields) == width and _are_names(fields):
                    header = number, fields
    return header


def _are_names(fields: list[str]) -> bool:
    """Returns True if a row can name the columns; the first and the last may be empty."""
    inner = fields[1:-1] if len(fields) > 2 else [cell for cell in fields if cell]
    return (
        any(fields)
        and all(map(_fields.is_name, inner))
        and not any(_fields.is_number(fields[k]) for k in (0, -1))
    )


def _are_numbers(fields: list[str]) -> bool:
    """Returns True if a row is a sample."""
    values = [cell for cell in fields if not _fields.is_gap(cell)]
    return bool(values) and all(_fields.is_number(cell.replace(",", ".", 1)) for cell in values)


def _are_units(fields: list[str]) -> bool:
    """Returns True if a row gives units, each in brackets or a unit of `UNIT`."""
    texts = [cell for cell in fields if cell.strip("-") and not _fields.is_number(cell)]
    # A single word above the samples is a name rather than a unit.
    is_word = len(fields) == 1 and not fields[0].startswith(("[", "("))
    return bool(texts) and not is_word and all(map(_is_unit, fields))


def _is_unit(cell: str) -> bool:
    if len(cell) > MAX_UNIT:
        return False
    if re.fullmatch(r"-?|\[[^][]*\]|\([^()]*\)", cell):
        return True
    parts = re.split(r"[/*·⋅ ]", re.sub(r"(\^?[-+]?[1-4]|[²³⁴⁻¹])+$", "", cell))
    parts = [re.sub(r"(\^?[-+]?[1-4]|[²³⁴⁻¹])+$", "", part) for part in parts]
    return all(map(UNIT.fullmatch, parts))
