"""Reader of several files and folders of any format together."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from pdmp._files import file_path
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration
from pdmp.io._collections import ListedDemonstrations
from pdmp.io._demonstration import Options
from pdmp.io._formats import SEVERAL, SINGLE, WITH_CONTEXTS, Part, folder_reader, single_part
from pdmp.io.folder import folder_parts
from pdmp.io.lerobot import STATE, Episodes, open_lerobot, read_lerobot


def read(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> list[Demonstration]:
    """Reads every demonstration in files and folders of any format, in the order given.

    The suffix of a file, or what a folder contains, determines the reader, whose own options, such
    as the topic of a bag, need a call of that reader.

    Parameters
    ----------
    paths : path or iterable of path
        Files and folders.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    time : str
        Column of the time stamps in CSV and Parquet files.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate; by default 0, none.
    context : sequence of str, optional
        What forms the context (Q,): columns of the index.csv of a folder, features of LeRobot data
        sets, attributes of HDF5 files.

    Raises
    ------
    ImportError
        The package that reads a format is not installed.
    ValueError
        A file of another format, or data that the reader of its format rejects.
    OSError
        A file that cannot be read.
    """
    parts = parts_of(path_list(paths), time, context, None, columns=columns, dt=dt, max_gap=max_gap)
    demos = ListedDemonstrations(context_names=context or ())
    for part in parts:
        demos += part.read().values()
    return demos


def path_list(paths: str | PathLike[str] | Iterable[str | PathLike[str]]) -> list[Path]:
    """Returns one path, or several, as a list."""
    check_type("paths", paths, (str, PathLike, Iterable), "a path, or a list of them")
    listed = [paths] if isinstance(paths, (str, PathLike)) else list(paths)
    return [file_path(path, f"paths[{k}]") for k, path in enumerate(listed)]


def parts_of(
    paths: Iterable[Path],
    time: str,
    context: Sequence[str] | None,
    features: str | Sequence[str] | None,
    **options: Any,
) -> Iterator[Part | Episodes]:
    """Yields the parts of files and folders, in the order of their demonstrations.

    A data set of LeRobot is one part, which can be split.
    """
    chosen = {} if features is None else {"features": features}
    for path in paths:
        suffix = path.suffix.lower()
        reader = folder_reader(path) if path.is_dir() else SEVERAL.get(suffix)
        if features is not None and reader not in WITH_CONTEXTS:
            raise value_error(
                f"{path}: features are those of LeRobot data sets and HDF5 files: pass columns="
            )
        if reader is read_lerobot:
            yield open_lerobot(path, features or STATE, Options(**options), context or [])
        elif path.is_dir() and reader is None:
            yield from folder_parts(path, time, context, **options)
        elif reader in WITH_CONTEXTS:
            yield Part(partial(reader, path, context=context, **chosen, **options), False)
        elif context is not None:
            raise value_error(f"{path}: a context is read from the index.csv of a folder: pass one")
        elif reader is not None:
            yield Part(partial(reader, path, **options), is_single=False)
        elif suffix in SINGLE:
            yield single_part(path.stem, path, time, **options)
        elif not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        else:
            suffixes = ", ".join([*SINGLE, *SEVERAL])
            raise value_error(f"{path}: expected a folder or a file of one of {suffixes}")
