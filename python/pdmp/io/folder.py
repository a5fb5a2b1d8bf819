"""Reader of folders of recordings, with or without an index."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Container, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from pdmp._files import file_path
from pdmp._labels import name_list, split_label
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _fields
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._csv_layout import parse_layout, read_text
from pdmp.io._demonstration import make_demonstration
from pdmp.io._formats import SINGLE, Part, single_part
from pdmp.io.npz import read_npz, read_recordings

Contexts = dict[str, list[float | str] | None]
FORMAT = (
    "expected an index.csv with a row per demonstration and its name in the column 'id', and "
    "files demos/<id>.csv (or .bvh, .c3d, .trc, …) or a demos.npz"
)


def read_folder(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> dict[str, Demonstration]:
    """Reads the demonstrations that a folder's `index.csv` lists, by their ids.

    Without an index, the file `demos.npz` or all files of the folder, or of its subfolder `demos`,
    that hold one demonstration each are read, in natural order of their names and without context.
    Where there are none, all NPZ files are; `FILE/NAME` is a demonstration of several in one file.

    Parameters
    ----------
    path : path
        A folder with the layout of `pdmp.io`.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    time : str
        Column of the time stamps in CSV files.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate; by default 0, none.
    context : sequence of str, optional
        Columns of the index whose numbers or labels form the context (Q,) of each demonstration.

    Raises
    ------
    ValueError
        A folder without demonstrations, an index without the column `id`, a repeated id, an id that
        is not a file name, a context that is not finite, or data that the
        reader of the format rejects.
    OSError
        A file that cannot be read.
    """
    options: dict[str, Any] = {"columns": columns, "dt": dt, "max_gap": max_gap}
    parts = folder_parts(file_path(path), time, context, **options)
    demos = NamedDemonstrations(context_names=context or ())
    for part in parts:
        demos.update(part.read())
    return demos


def folder_parts(
    path: Path, time: str, context: Sequence[str] | None, **options: Any
) -> list[Part]:
    """Returns the parts of a folder, in the order of their demonstrations."""
    index, archive = path / "index.csv", path / "demos.npz"
    if not path.is_dir():
        code = errno.ENOTDIR if path.exists() else errno.ENOENT
        raise OSError(code, os.strerror(code), str(path))
    if not index.exists():
        return _unlisted_parts(path, time, context, **options)
    contexts = _contexts(index, context or [])
    if archive.exists():
        return [Part(partial(_read_listed, archive, contexts, **options), is_single=False)]
    files = {name: _file(path, name) for name in contexts}
    return [
        single_part(name, file, time, context=contexts[name], **options)
        for name, file in files.items()
    ]


def _read_listed(
    archive: Path, contexts: Contexts, *, columns: Any, dt: Any, max_gap: float
) -> dict[str, Demonstration]:
    """Reads a file with all demonstrations of an index, in its order."""
    stored = list(read_recordings(archive, columns, dt))
    if len(stored) != len(contexts):
        raise value_error(
            f"{archive}: has {len(stored)} demonstrations, but index.csv lists {len(contexts)}"
        )
    recordings = zip(contexts.items(), stored, strict=True)
    return {
        name: make_demonstration(
            f"{archive}, '{name}'", position, max_gap=max_gap, context=values, **arguments
        )
        for (name, values), (_, position, arguments) in recordings
    }


def _unlisted_parts(
    path: Path, time: str, context: Sequence[str] | None, **options: Any
) -> list[Part]:
    """Returns the parts of a folder without an index."""
    if context is None:
        archive = path / "demos.npz"
        if archive.exists():
            return [Part(partial(read_npz, archive, **options), is_single=False)]
        if files := _files(path, SINGLE):
            parts = {file.stem: single_part(file.stem, file, time, **options) for file in files}
            return list(parts.values())
        if files := _files(path, [".npz"]):
            return [Part(partial(_read_npz, file, **options), is_single=False) for file in files]
    raise value_error(f"{path}: no index.csv{'' if context else ', and no files'}: {FORMAT}")


def _files(path: Path, suffixes: Container[str]) -> list[Path]:
    """Returns the files with some suffixes in a folder or else in `demos`, in natural order."""
    for folder in (path, path / "demos"):
        if files := [file for file in folder.glob("*") if file.suffix.lower() in suffixes]:
            return sorted(files, key=lambda file: _natural(file.name))
    return []


def _read_npz(path: Path, **options: Any) -> dict[str, Demonstration]:
    """Reads one of several NPZ files."""
    demos = read_npz(path, **options)
    is_one = len(demos) == 1
    return {path.stem if is_one else f"{path.stem}/{name}": each for name, each in demos.items()}


def _natural(name: str) -> list[tuple[int, str]]:
    """Returns a sort key in natural order, "2" before "10"."""
    return [(int(part) if part.isdecimal() else -1, part) for part in re.split(r"(\d+)", name)]


def _file(path: Path, name: str) -> Path:
    """Returns the path of the file of a demonstration, or of a CSV file if none exists."""
    if not name or re.search(r"[/\\:\x00-\x1f]", name) or name in (".", ".."):
        raise value_error(f"{path / 'index.csv'}: id '{name}' is not a file name: {FORMAT}")
    folder = path / "demos"
    paths = [folder / f"{name}{suffix}" for suffix in SINGLE]
    if name.lower().endswith(tuple(SINGLE)):
        paths.append(folder / name)
    return next((path for path in paths if path.exists()), paths[0])


def _contexts(path: Path, columns: Sequence[str]) -> Contexts:
    """Returns the context of each id in an index; a column without numbers has labels."""
    table = parse_layout(path, read_text(path), index=True)
    header, lines = [split_label(field)[0] for field in table.fields], list(table.rows())
    if table.separator != ",":
        lines = [(line, list(map(_with_point, fields))) for line, fields in lines]
    _fields.check_names(path, table.line, header if header[0] else header[1:])
    name, *indices = _fields.column_indices(path, header, ["id", *name_list("context", columns)])
    if not lines:
        raise value_error(f"{path}: lists no demonstrations: {FORMAT}")
    labels = {k for k in indices if not any(_fields.is_number(fields[k]) for _, fields in lines)}
    contexts: Contexts = {}
    for line, fields in lines:
        if fields[name] in contexts:
            raise value_error(f"{path}, line {line}: id '{fields[name]}' appears twice: rename one")
        for k in indices:
            if not fields[k] or (k not in labels and _fields.is_gap(fields[k])):
                kind = "label" if k in labels else "number"
                raise value_error(
                    f"{path}, line {line}, column '{header[k]}': no {kind}: fill it in"
                )
        values = [
            fields[k] if k in labels else _fields.read_number(path, line, header[k], fields[k])
            for k in indices
        ]
        contexts[fields[name]] = values or None
    return contexts


def _with_point(field: str) -> str:
    """Returns a number with its decimal comma replaced by a point, or a text unchanged."""
    number = field.replace(",", ".")
    return number if _fields.is_number(number) else field
