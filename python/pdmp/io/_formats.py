"""Readers by the suffixes of files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pdmp._native import Demonstration
from pdmp.io.bvh import read_bvh
from pdmp.io.c3d import read_c3d
from pdmp.io.csv import read_csv
from pdmp.io.hdf5 import read_hdf5
from pdmp.io.lerobot import read_lerobot
from pdmp.io.mat import read_mat
from pdmp.io.npz import read_npz
from pdmp.io.opensim import read_opensim
from pdmp.io.parquet import read_parquet
from pdmp.io.rosbag import read_rosbag

TIMED: dict[str, Callable[..., Demonstration]] = {
    ".csv": read_csv,
    ".tsv": read_csv,
    ".parquet": read_parquet,
}
"""Readers of one demonstration with a column of time stamps."""
SINGLE: dict[str, Callable[..., Demonstration]] = TIMED | {
    ".bvh": read_bvh,
    ".c3d": read_c3d,
    ".trc": read_opensim,
    ".mot": read_opensim,
    ".sto": read_opensim,
}
"""Readers of one demonstration, the preferred suffix first."""
SEVERAL: dict[str, Callable[..., dict[str, Demonstration]]] = {
    ".npz": read_npz,
    ".mat": read_mat,
    ".hdf5": read_hdf5,
    ".h5": read_hdf5,
    ".mcap": read_rosbag,
    ".db3": read_rosbag,
    ".bag": read_rosbag,
}
"""Readers of several demonstrations."""
WITH_CONTEXTS = (read_lerobot, read_hdf5)
"""Readers that find the named contexts of each demonstration in the file."""


class Part(NamedTuple):
    """Demonstrations of one file, which another process can read."""

    read: Callable[[], dict[str, Demonstration]]
    is_single: bool
    """The format holds one demonstration a file."""


def single_part(name: str, path: Path, time: str, **options: Any) -> Part:
    """Returns the part of a file of one demonstration."""
    return Part(partial(_read_named, name, path, time, **options), is_single=True)


def _read_named(name: str, path: Path, time: str, **options: Any) -> dict[str, Demonstration]:
    return {name: read_single(path, time, **options)}


def read_single(path: Path, time: str, **options: Any) -> Demonstration:
    """Reads a file of one demonstration."""
    suffix = path.suffix.lower()
    return SINGLE[suffix](path, **options, **({"time": time} if suffix in TIMED else {}))


def folder_reader(path: Path) -> Callable[..., dict[str, Demonstration]] | None:
    """Returns the reader of a folder that a robot wrote, or None."""
    if (path / "meta" / "info.json").exists():
        return read_lerobot
    return read_rosbag if (path / "metadata.yaml").exists() else None
