"""Arrays of an NPZ file, read in memory bounded by the size of the file."""

from __future__ import annotations

import os
from math import prod
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from pdmp._messages import value_error

MAX_DEFLATION = 1100
"""Largest ratio of the sizes of a member before and after compression; deflate reaches 1032."""
MAX_MEMBERS = 1_000_000


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Returns the arrays of an NPZ file by name.

    Raises
    ------
    ValueError
        A file that is not one of plain arrays, or is damaged.
    OSError
        A file that cannot be read.
    """
    with path.open("rb") as file:
        try:
            return _arrays(file)
        except OSError:
            raise
        except Exception as error:
            # zipfile, zlib and numpy raise a dozen types of errors for damaged files.
            reason = f"{error}" if isinstance(error, ValueError) else f"it is damaged ({error})"
            raise value_error(f"{path}: not an NPZ file of plain arrays: {reason}") from None


def _arrays(file: IO[bytes]) -> dict[str, NDArray[Any]]:
    size = os.fstat(file.fileno()).st_size
    if file.read(len(npy.MAGIC_PREFIX)) == npy.MAGIC_PREFIX:
        raise ValueError("it is a single array: use numpy.savez")
    file.seek(0)
    arrays = {}
    with ZipFile(file) as archive:
        members = archive.infolist()
        if len(members) > MAX_MEMBERS:
            raise ValueError(f"it has {len(members)} members")
        for member in members:
            if not member.filename.endswith(".npy"):
                raise ValueError(f"'{member.filename}' is not an array: use numpy.savez")
            if max(member.compress_size, member.file_size / MAX_DEFLATION - 1) > size:
                raise ValueError(f"'{member.filename}' states a size that exceeds the file")
            with archive.open(member) as opened:
                arrays[member.filename.removesuffix(".npy")] = _array(opened, member)
    return arrays


def _array(file: IO[bytes], member: ZipInfo) -> NDArray[Any]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, in_fortran_order, dtype = read(file)
    if dtype.hasobject:
        raise ValueError(f"'{member.filename}' has objects instead of numbers: convert it")
    if not dtype.itemsize:
        raise ValueError(f"'{member.filename}' has no numbers")
    n_bytes = prod(shape) * dtype.itemsize
    data = file.read(n_bytes) if n_bytes <= member.file_size else b""
    if len(data) != n_bytes or any(axis < 0 for axis in shape) or file.read(1):
        raise ValueError(f"'{member.filename}' has another number of values than its header states")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if in_fortran_order else "C")
