"""Standard input and output in place of files."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pdmp._files import check_folder
from pdmp.cli import console

STREAM = "-"
"""Path that stands for standard input or output."""
BEGINNINGS = {
    b"PK": ".npz",
    b"HIERARCHY": ".bvh",
    b"PathFileType": ".trc",
    b"PAR1": ".parquet",
    b"MATLAB": ".mat",
    b"\x89HDF": ".hdf5",
    b"\x89MCAP": ".mcap",
}
"""Suffixes of formats by the first bytes of their files; another one is CSV."""


@contextmanager
def inputs(paths: Sequence[str]) -> Iterator[list[str]]:
    """Yields paths, of a copy of standard input for -, which messages call "standard input"."""
    if paths.count(STREAM) > 1:
        raise ValueError("- is given twice, but standard input can be read once")
    if STREAM not in paths:
        yield list(paths)
        return
    with tempfile.TemporaryDirectory(prefix="pdmp-") as folder:
        data = sys.stdin.buffer.read()
        suffixes = (suffix for begin, suffix in BEGINNINGS.items() if data.startswith(begin))
        copy = Path(folder) / f"input{next(suffixes, '.csv')}"
        copy.write_bytes(data)
        console.aliases[str(copy)] = "standard input"
        yield [str(copy) if path == STREAM else path for path in paths]


@contextmanager
def output(path: str) -> Iterator[str]:
    """Yields the path of a file to write, whose bytes go to standard output for -."""
    if path != STREAM:
        check_file(path)
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="pdmp-") as folder:
        copy = Path(folder) / "output"
        yield str(copy)
        sys.stdout.flush()
        sys.stdout.buffer.write(copy.read_bytes())
        sys.stdout.buffer.flush()


def summarise(path: str, text: str) -> None:
    """Writes a summary of a written file, on standard error if the file is standard output."""
    if path == STREAM:
        console.say(f"standard output: {text}", file=sys.stderr)
    else:
        console.say(f"{path}: {text}")


def check_file(path: str) -> None:
    """Raises an error before a long call if its result could not be written to this file."""
    if Path(path).is_dir():
        raise IsADirectoryError(f"{path}: is a folder; name a file in it")
    check_folder(Path(path))
