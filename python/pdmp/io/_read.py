"""Reader of several files and folders of any format together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration
from pdmp.io._collections import ListedDemonstrations
from pdmp.io._formats import SEVERAL, SINGLE, WITH_CONTEXTS, folder_reader, read_single
from pdmp.io.folder import read_folder


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
    demos = ListedDemonstrations(context_names=context or ())
    check_type("paths", paths, (str, PathLike, Iterable), "a path, or a list of them")
    paths = [paths] if isinstance(paths, (str, PathLike)) else paths
    options: dict[str, Any] = {"columns": columns, "dt": dt, "max_gap": max_gap}
    for path in map(Path, paths):
        suffix = path.suffix.lower()
        reader = folder_reader(path) if path.is_dir() else SEVERAL.get(suffix)
        if path.is_dir() and reader is None:
            demos += read_folder(path, time=time, context=context, **options).values()
        elif reader in WITH_CONTEXTS:
            demos += reader(path, context=context, **options).values()
        elif context is not None:
            raise value_error(f"{path}: a context is read from the index.csv of a folder: pass one")
        elif reader is not None:
            demos += reader(path, **options).values()
        elif suffix in SINGLE:
            demos.append(read_single(path, time, **options))
        else:
            suffixes = ", ".join([*SINGLE, *SEVERAL])
            raise value_error(f"{path}: expected a folder or a file of one of {suffixes}")
    return demos
