"""Reader of NPZ files with one or several demonstrations."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import file_path
from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _fields, _npz_arrays, _time_units
from pdmp.io._demonstration import Options, make_demonstration

LAYOUT = "store time (T,) and position (T, D), or arrays NAME (T, D) and NAME.t (T,)"


def read_npz(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
) -> dict[str, Demonstration]:
    """Reads the demonstrations in an NPZ file, by name ("0", "1", … without names).

    Parameters
    ----------
    path : path
        An NPZ file in one of the layouts of `pdmp.io`.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate, from the sample before to the sample after it; by default 0,
        none. A gap is NaN.

    Raises
    ------
    ValueError
        Another layout, a missing name, neither time stamps nor `dt`, a gap that is longer than
        `max_gap` or at an end, or data that `Demonstration` rejects.
    OSError
        A file that cannot be read.
    """
    Options(columns, dt, max_gap)
    return {
        name: make_demonstration(f"{path}, '{name}'", position, max_gap=max_gap, **arguments)
        for name, position, arguments in read_recordings(file_path(path), columns, dt)
    }


def read_recordings(
    path: Path, columns: Sequence[str] | None, dt: float | None
) -> Iterator[tuple[str, NDArray[Any], dict[str, Any]]]:
    """Yields name, positions (T, D) and the other arguments of each demonstration in the file."""
    arrays = _npz_arrays.read_arrays(path)
    names, units = _labels(path, arrays, "names"), _labels(path, arrays, "units")
    if columns is not None and names is None:
        raise value_error(f"{path}: no array 'names' to select the columns {', '.join(columns)}")
    for name, position, time in _demonstrations(path, arrays):
        source = f"{path}, '{name}'"
        for labels in (names, units):
            expected = "D" if labels is None else len(labels)
            if position.ndim != 2 or expected not in (position.shape[1], "D"):
                raise value_error(
                    f"{source}: shape {position.shape}, expected (T, {expected}): " + LAYOUT
                )
        if dt is None and time is None:
            raise value_error(f"{source}: no time stamps: pass dt=")
        indices = list(range(position.shape[1]))
        if columns is not None and names is not None:
            indices = _fields.column_indices(path, names, name_list("columns", columns))
        if dt is None and time is not None:
            time = _time_units.to_seconds(
                source, time, "", "store them in s instead of {unit}, or pass dt="
            )
        selected = {
            kind: None if labels is None else [labels[k] for k in indices]
            for kind, labels in (("names", names), ("units", units))
        }
        yield (
            name,
            position[:, indices],
            {"dt": dt, "time": time if dt is None else None, **selected},
        )


def _labels(path: Path, arrays: dict[str, NDArray[Any]], kind: str) -> list[str] | None:
    """Removes the names or units of the degrees of freedom from the arrays, and returns them."""
    if kind not in arrays:
        return None
    labels = np.atleast_1d(arrays.pop(kind))
    if labels.ndim != 1 or labels.dtype.kind not in "US":
        raise value_error(f"{path}: '{kind}' must be a vector of texts, one per DoF")
    try:
        texts = [label.decode() if isinstance(label, bytes) else label for label in labels.tolist()]
        "".join(texts).encode()
    except (SystemError, ValueError):
        # numpy does not validate code points when it reads texts.
        raise value_error(f"{path}: '{kind}' has invalid code points") from None
    return texts


def _demonstrations(
    path: Path, arrays: dict[str, NDArray[Any]]
) -> Iterator[tuple[str, NDArray[Any], NDArray[Any] | None]]:
    """Yields name, positions and time stamps of each demonstration, in any layout."""
    if "y" in arrays and "start" in arrays:
        yield from _concatenated(path, arrays["y"], arrays.get("t"), arrays["start"])
    elif "position" in arrays and "position.t" not in arrays:
        time = arrays.get("time", arrays.get("t"))
        position = arrays["position"]
        position = position[:, None] if position.ndim == 1 else position
        stack = position if position.ndim == 3 else [position]
        has_rows = position.ndim == 3 and time is not None and time.shape[:-1] == position.shape[:1]
        for m, each in enumerate(stack):
            yield str(m), each, time[m] if has_rows and time is not None else time
    else:
        for name, position in arrays.items():
            if not name.endswith(".t"):
                yield name, position, arrays.get(f"{name}.t")
            elif name.removesuffix(".t") not in arrays:
                raise value_error(f"{path}: '{name}' has no positions '{name.removesuffix('.t')}'")


def _concatenated(
    path: Path, position: NDArray[Any], time: NDArray[Any] | None, start: NDArray[Any]
) -> Iterator[tuple[str, NDArray[Any], NDArray[Any] | None]]:
    """Yields the demonstrations of concatenated arrays."""
    n_samples = len(position) if position.ndim else 0
    start = np.atleast_1d(start)
    finite = start.dtype.kind in "iuf" and start.ndim == 1 and np.isfinite(start).all()
    rows = start.tolist() if finite and (start == np.floor(start)).all() else []
    rises = all(before < after for before, after in pairwise(rows))
    if len(rows) < 2 or not rises or (rows[0], rows[-1]) != (0, n_samples):
        raise value_error(
            f"{path}: 'start' must be whole numbers that rise from 0 to {n_samples}, the number of "
            f"samples, got {np.array2string(start, threshold=9) if finite else start.dtype}"
        )
    if time is not None and time.shape != (n_samples,):
        raise value_error(f"{path}: 't' has shape {time.shape}, expected ({n_samples},)")
    for demo, (begin, end) in enumerate(pairwise(map(int, rows))):
        yield str(demo), position[begin:end], None if time is None else time[begin:end]
