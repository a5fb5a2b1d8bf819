"""NPZ files: several demonstrations in one."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pdmp._native import Demonstration
from pdmp.demos import _text
from pdmp.demos._recording import demonstration


def read_npz(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
) -> dict[str, Demonstration]:
    """Read the demonstrations in an NPZ file, by name ("0", "1", … where they have none).

    Parameters
    ----------
    path : path
        An NPZ file in one of the two layouts that `pdmp.demos` describes.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], in place of time stamps.
    max_gap : float
        Longest gap [s] that is interpolated, from the sample before to the one after; by default
        none is. A gap is NaN.

    Raises
    ------
    ValueError
        A layout other than these, a name that is missing, neither time stamps nor `dt`, a gap that
        is longer than `max_gap` or at an end, or what `Demonstration` refuses.
    OSError
        A file that cannot be read.
    """
    return {
        name: demonstration(f"{path}, '{name}'", position, max_gap=max_gap, **given)
        for name, position, given in recordings(Path(path), columns, dt)
    }


def recordings(
    path: Path, columns: Sequence[str] | None, dt: float | None
) -> Iterator[tuple[str, NDArray[Any], dict[str, Any]]]:
    """Yield name, positions (T, D) and the other arguments of each demonstration in the file."""
    arrays = _arrays(path)
    names, units = _labels(arrays, "names"), _labels(arrays, "units")
    if columns is not None and names is None:
        raise ValueError(f"{path}: no array 'names' to tell which columns are {', '.join(columns)}")
    for name, position, time in _parts(path, arrays):
        for labels in (names, units):
            expected = "D" if labels is None else len(labels)
            if position.ndim != 2 or expected not in (position.shape[1], "D"):
                shape = position.shape
                raise ValueError(f"{path}, '{name}': shape {shape}, expected (T, {expected})")
        if dt is None and time is None:
            raise ValueError(f"{path}, '{name}': no time stamps: pass dt=")
        kept = list(range(position.shape[1]))
        if columns is not None and names is not None:
            kept = [_text.column(path, names, name) for name in _text.listed("columns", columns)]
        given = {
            kind: None if labels is None else [labels[k] for k in kept]
            for kind, labels in (("names", names), ("units", units))
        }
        yield name, position[:, kept], {"dt": dt, "time": time if dt is None else None, **given}


def _labels(arrays: dict[str, NDArray[Any]], kind: str) -> list[str] | None:
    """Take the names or units of the degrees of freedom out of the arrays."""
    if kind not in arrays:
        return None
    labels = np.atleast_1d(arrays.pop(kind)).tolist()
    return [label.decode() if isinstance(label, bytes) else str(label) for label in labels]


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            raise ValueError("it is a single array; use numpy.savez")
        with archive:
            return dict(archive)
    except (BadZipFile, EOFError, ValueError) as error:
        raise ValueError(f"{path}: not an NPZ file of plain arrays: {error}") from None


def _parts(
    path: Path, arrays: dict[str, NDArray[Any]]
) -> Iterator[tuple[str, NDArray[Any], NDArray[Any] | None]]:
    """Yield name, positions and time stamps of each demonstration, in either layout."""
    if "y" not in arrays or "start" not in arrays:
        for name, position in arrays.items():
            if not name.endswith(".t"):
                yield name, position, arrays.get(f"{name}.t")
            elif name.removesuffix(".t") not in arrays:
                raise ValueError(f"{path}: '{name}' has time stamps of nothing")
        return
    position, time = arrays["y"], arrays.get("t")
    given = np.atleast_1d(arrays["start"])
    whole = given.dtype.kind in "iuf" and given.ndim == 1 and (given == np.floor(given)).all()
    start = given.astype(int).tolist() if whole else []
    rises = all(before < after for before, after in pairwise(start))
    if len(start) < 2 or not rises or (start[0], start[-1]) != (0, len(position)):
        raise ValueError(
            f"{path}: 'start' must rise from 0 to {len(position)}, where the last demonstration "
            f"ends, in whole numbers, got {given.tolist()}"
        )
    for demo, (begin, end) in enumerate(pairwise(start)):
        yield str(demo), position[begin:end], None if time is None else time[begin:end]
