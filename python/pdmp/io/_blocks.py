"""Blocks of recordings, which are read when they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain, groupby
from numbers import Integral
from operator import itemgetter
from os import PathLike
from typing import Any, TypeVar, overload

from pdmp._labels import name_list
from pdmp._messages import check_type
from pdmp._native import Demonstration
from pdmp.io._collections import ListedDemonstrations
from pdmp.io._demonstration import Options, check_time
from pdmp.io._formats import Part
from pdmp.io._read import parts_of, path_list
from pdmp.io.lerobot import Episodes

SIZE = 500
"""Number of demonstrations in a block by default: 6 MB of 200 samples of seven joints."""
T = TypeVar("T")
Read = Callable[[], list[Demonstration]]


class Blocks(Sequence[Read]):
    """Functions without arguments, each of which reads a block of demonstrations.

    They can be sent to other processes. A call returns an iterator that reads one block after the
    other. A slice has some of the blocks.
    """

    def __init__(self, functions: Iterable[Read]) -> None:
        self._functions = tuple(functions)

    def __call__(self) -> Iterator[list[Demonstration]]:
        return (read() for read in self._functions)

    def __len__(self) -> int:
        return len(self._functions)

    @overload
    def __getitem__(self, index: int) -> Read: ...

    @overload
    def __getitem__(self, index: slice) -> Blocks: ...

    def __getitem__(self, index: int | slice) -> Read | Blocks:
        found = self._functions[index]
        return Blocks(found) if isinstance(found, tuple) else found

    def __repr__(self) -> str:
        return f"Blocks(n_blocks={len(self)})"


def read_blocks(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    size: int | None = None,
    features: str | Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> Blocks:
    """Returns the demonstrations that `read` would return, in blocks that are read when needed.

    `pdmp.fit` and `pdmp.fit_distributed` take the result, and then have one block in memory for
    each process. A block is read in every pass, from its own files alone; of data sets of LeRobot,
    from the files and row groups with its episodes. Metadata and indices are read here, once.

    Parameters
    ----------
    paths : path or iterable of path
        Files and folders, which all processes find at these places.
    size : int, optional
        Number of demonstrations per block, or of files in formats with several demonstrations, such
        as NPZ, HDF5 and bags; by default 500 demonstrations or one such file.
    features : str or sequence of str, optional
        Features with the positions, of LeRobot data sets and HDF5 files; by default those of their
        readers.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    time : str
        Column of the time stamps in CSV and Parquet files.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate; by default 0, none.
    context : sequence of str, optional
        What forms the context (Q,) of each demonstration, as for `read`. Models that are fitted to
        blocks take its values in this order, without the names.

    Returns
    -------
    sequence of callable
        Functions without arguments that return a list of demonstrations, which other processes can
        call. Called itself, the sequence returns an iterator over the blocks.

    Raises
    ------
    ImportError
        The package that reads a format is not installed.
    ValueError
        No paths, a size below 1, a folder without demonstrations, or a missing column or feature of
        a LeRobot data set. Other content is refused when its block is read.
    OSError
        A folder or index that cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for k in range(8):
    ...         movement = model.rollout(goal=[0.1 * k, 0.0])
    ...         pdmp.io.write_csv(Path(folder, f"reach{k}.csv"), movement)
    ...     blocks = pdmp.io.read_blocks(folder, size=3)
    ...     print(blocks, [len(block) for block in blocks()])
    ...     print(pdmp.fit(blocks).n_demos)
    Blocks(n_blocks=3) [3, 3, 2]
    8
    """
    if size is not None:
        check_type("size", size, Integral, "a whole number")
        if size < 1:
            raise ValueError(f"size = {size}: must be at least 1")
    Options(columns, dt, max_gap)
    check_time(time)
    names = name_list("context", context or [])
    # Workers may run in other folders.
    places = [path.absolute() for path in path_list(paths)]
    if not places:
        raise ValueError("paths is empty: pass at least one file or folder")
    options: dict[str, Any] = {"columns": columns, "dt": dt, "max_gap": max_gap}

    parts = parts_of(places, time, context, features, **options)
    return Blocks(partial(_read_parts, block, names) for block in _grouped(parts, size))


def _grouped(parts: Iterable[Part | Episodes], size: int | None) -> list[list[Part | Episodes]]:
    """Returns parts in blocks; neighbours are in one block if they have the same limit."""
    limited: list[tuple[int, Part | Episodes]] = []
    for part in parts:
        if isinstance(part, Episodes):
            limited += [(1, part.part(own)) for own in _batches(part.episodes, size or SIZE)]
        else:
            limited.append((size or (SIZE if part.is_single else 1), part))
    runs = groupby(limited, key=itemgetter(0))
    return list(chain(*(_batches([part for _, part in run], limit) for limit, run in runs)))


def _batches(items: Iterable[T], size: int) -> list[list[T]]:
    listed = list(items)
    return [listed[k : k + size] for k in range(0, len(listed), size)]


def _read_parts(parts: Sequence[Part | Episodes], context: Sequence[str]) -> list[Demonstration]:
    """Returns the demonstrations of a block."""
    return ListedDemonstrations(chain(*(part.read().values() for part in parts)), context)
