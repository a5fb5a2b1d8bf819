"""Reader of demonstrations and writer of trajectories in Parquet files."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import atomic_write, file_path
from pdmp._native import Demonstration, Trajectory
from pdmp.io._demonstration import Options
from pdmp.io._packages import load, reading
from pdmp.io._trajectory import trajectory_table
from pdmp.io.frames import read_frame

FILES = "Parquet files"
INDEX = "__index_level_0__"
"""Column in which pandas writes an index without a name."""


def read_parquet(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads one demonstration from a Parquet file; needs the extra `parquet`.

    Columns are read as those of a data frame by `from_dataframe`, which also takes the frame of a
    file with several demonstrations.

    Parameters
    ----------
    path : path
        A Parquet file with a row per sample.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; by default all numeric columns
        except the time, counters and derivatives.
    time : str
        Column of the time stamps; by default `t`, `time` and the like, or the index of pandas.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s], of missing values or NaN, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ImportError
        The package pyarrow is not installed.
    ValueError
        A file of another format, a missing column, no time stamps, or data that `Demonstration`
        rejects.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap, context)
    parquet = load("pyarrow.parquet", "parquet", FILES)
    path.stat()  # a missing file is an error of the system
    with reading(path, "Parquet"):
        frame = _Frame(parquet.ParquetFile(path).read(), time)
    (demo,) = read_frame(str(path), frame, None, time, options, []).values()
    return demo


class _Frame:
    """Table of Arrow with the methods of a data frame; columns of lists are left out."""

    def __init__(self, table: Any, time: str) -> None:
        self._arrays: dict[str, NDArray[Any]] = {}
        for name, column in zip(table.column_names, table.columns, strict=True):
            if not hasattr(column.type, "value_field") and not hasattr(column.type, "fields"):
                values = column.to_numpy()
                self._arrays[time if name == INDEX else name] = values
        self.columns = list(self._arrays)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._arrays[name]


def write_parquet(
    path: str | PathLike[str],
    trajectory: Trajectory,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Writes a trajectory as Parquet, with the columns of `write_csv`; needs the extra `parquet`.

    `read_parquet` reads its positions back. The file is written atomically.

    Parameters
    ----------
    path : path
        File to write.
    trajectory : Trajectory
        A rollout.
    names, units : sequence of str, optional
        Names and units of the D degrees of freedom, instead of the trajectory's.

    Raises
    ------
    ImportError
        The package pyarrow is not installed.
    ValueError
        A number of names or units other than D, or names that would be read differently.
    OSError
        A file that cannot be written, or whose folder does not exist.
    """
    path = file_path(path)
    fields, columns = trajectory_table(path, trajectory, names, units)
    arrow, parquet = load("pyarrow", "parquet", FILES), load("pyarrow.parquet", "parquet", FILES)
    arrays = [np.ascontiguousarray(column) for column in columns.T]
    table = arrow.table(dict(zip(fields, arrays, strict=True)))
    with atomic_write(path) as draft:
        parquet.write_table(table, draft)
