"""Layouts of the text files that systems of motion capture export: Vicon, OptiTrack, Qualisys."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

from pdmp._messages import value_error
from pdmp.io import _columns
from pdmp.io._csv_layout import MAX_PREAMBLE, CsvTable, parse_layout, read_text
from pdmp.io._fields import parse_number

LENGTHS = {"meters": "m", "centimeters": "cm", "millimeters": "mm"}
VICON = r"^\"?Frame\"?[,;\t]\"?Sub ?Frame\"?[,;\t]"
"""Beginning of the line of axes of a section in Vicon files."""
MAX_TITLE = 1 << 16
"""Number of first characters that include the titles of the first section."""
VICON_SECTIONS = ("Trajectories", "Model Outputs", "Joints", "Segments")
"""Sections of Vicon files that are read, the preferred one first."""
DERIVATIVES = {"": "", "'": "_velocity", "''": "_acceleration"}
"""Marks of derivatives in Vicon files, and their suffixes in names."""
Head = list[list[str]]


def parse_table(path: Path, time: str) -> CsvTable:
    """Returns the layout of a CSV file, of motion capture or any other."""
    text = read_text(path)
    first = text.lstrip()[:200]
    if first.startswith("Format Version,"):
        return _optitrack(path, text)
    if first.startswith("NO_OF_FRAMES\t"):
        return _qualisys(path, text)
    if re.search(VICON, text[:MAX_TITLE], re.MULTILINE | re.IGNORECASE):
        return _vicon(path, text)
    return parse_layout(path, text, lambda field: _columns.find_clock([field], time) is not None)


def head(text: str, separator: str, n_lines: int | None = MAX_PREAMBLE) -> Head:
    """Returns the fields of the first lines, at least one of each, without their quotes."""
    lines = islice(text.splitlines(), n_lines)
    return [[field.strip().strip('"') for field in line.split(separator)] for line in lines]


def axis(name: str, letter: str) -> str:
    """Returns the name of a coordinate of a marker, a joint or a body."""
    return f"{name}.{letter.lower() if letter in 'XYZ' else letter}" if letter else name


def whole(number: float | None) -> int | None:
    """Returns a number of rows that a file states; -1 for one that cannot be right."""
    if number is None:
        return None
    return int(number) if 0 <= number < 2**53 else -1


def _vicon(path: Path, text: str) -> CsvTable:
    """Layout of a Vicon file: sections of a title, the rate, names, axes, units and samples."""
    separator = max(",;\t", key=text[:2000].count)
    rows = head(text, separator, None)
    lines = [k for k, row in enumerate(rows) if row[0].lower() == "frame" and k >= 3]
    titled = {rows[k - 3][0].strip(": "): k for k in lines if rows[k - 3]}
    title = next((title for title in VICON_SECTIONS if title in titled), None)
    if title is None:
        raise value_error(
            f"{path}: a Vicon file with {', '.join(titled) or 'no section'}: expected a section "
            f"{' or '.join(VICON_SECTIONS)} with its rate, names and axes"
        )
    line = titled[title]
    axes, units = rows[line], rows[line + 1] if line + 1 < len(rows) else []
    rate = parse_number(rows[line - 2][0]) or 0.0
    names, name = [], ""
    subjects = rows[line - 1] + [""] * (len(axes) - len(rows[line - 1]))
    for own, letter in zip(subjects, axes, strict=False):
        name = own or name
        mark = letter.lstrip("XYZRTW")
        suffix = DERIVATIVES.get(mark)
        if suffix is not None:
            letter = letter.removesuffix(mark) if mark else letter
        names.append((axis(name, letter) if name else letter) + (suffix or ""))
    end = next((k for k in range(line + 2, len(rows)) if not any(rows[k])), len(rows))
    units = units[: len(names)] + [""] * (len(names) - len(units))
    interval = 1 / rate if rate > 0 else None
    return CsvTable(
        path, line + 1, names, units, line + 2, separator, text, last=end, interval=interval
    )


def _optitrack(path: Path, text: str) -> CsvTable:
    """Layout of an OptiTrack file: a line of settings, and rows that name each column."""
    rows = head(text, ",")
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    line = next((k for k, row in enumerate(rows) if row and row[0] == "Frame"), 0)
    labels = {row[1]: row for row in rows[1:line] if len(row) > 1 and not row[0]}
    if line < 2 or "Name" not in labels:
        raise value_error(f"{path}: an OptiTrack file without rows that name its columns")
    axes, measures = rows[line], rows[line - 1]
    width = len(axes)
    kinds, own, measures = (
        row + [""] * (width - len(row))
        for row in (labels.get("Type", []), labels["Name"], measures)
    )
    length = LENGTHS.get(settings.get("Length Units", "").lower(), "")
    quaternions = settings.get("Rotation Type", "Quaternion") == "Quaternion"
    names, units, rotations = axes[:2], ["", ""], {}
    ignored = set()
    for k in range(2, width):
        name, letter = own[k], axes[k].lower()
        if measures[k] == "Position":
            names.append(f"{name}.{letter}")
            units.append(length)
        elif measures[k] == "Rotation":
            names.append(f"{name}.{'q' if quaternions else 'r'}{letter}")
            units.append("" if quaternions else "deg")
            if quaternions and [field.lower() for field in axes[k : k + 4]] == list("xyzw"):
                rotations[names[-1]] = "xyzw"
        else:
            names.append(f"{name}.{measures[k] or k}")
            units.append("")
            ignored.add(names[-1])
        if kinds[k] in ("Rigid Body Marker", "Bone Marker"):
            ignored.add(names[-1])
    rate = parse_number(settings.get("Export Frame Rate", "")) or 0.0
    return CsvTable(
        path,
        line + 1,
        names,
        units,
        line + 1,
        ",",
        text,
        interval=1 / rate if rate > 0 else None,
        rotations=rotations,
        ignored=ignored,
    )


def _qualisys(path: Path, text: str) -> CsvTable:
    """Layout of a Qualisys file: lines of a key and its values, then three columns per marker."""
    rows = head(text, "\t")
    keys = {row[0]: row[1:] for row in rows if re.fullmatch("[A-Z_]+", row[0])}
    markers = [name for name in keys.get("MARKER_NAMES", []) if name]
    rate = parse_number("".join(keys.get("FREQUENCY", [])[:1])) or 0.0
    n_rows = parse_number("".join(keys["NO_OF_FRAMES"][:1]))
    if not markers:
        raise value_error(f"{path}: a Qualisys file without MARKER_NAMES: export 3D data")
    first = next((k for k, row in enumerate(rows) if parse_number(row[0]) is not None), len(rows))
    names = [axis(name, letter) for name in markers for letter in "XYZ"]
    if first and rows[first - 1][0] == "Frame":
        names = [*rows[first - 1][:2], *names]
    return CsvTable(
        path,
        first,
        names,
        ["" if name in ("Frame", "Time") else "mm" for name in names],
        first,
        "\t",
        text,
        interval=1 / rate if rate > 0 else None,
        n_rows=whole(n_rows),
    )
