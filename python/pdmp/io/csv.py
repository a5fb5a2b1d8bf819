"""Reader of demonstrations and writer of trajectories in CSV files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from os import PathLike

from pdmp._files import atomic_write, file_path
from pdmp._native import Demonstration, Trajectory
from pdmp.io._demonstration import Options, check_time
from pdmp.io._motion_capture import parse_table
from pdmp.io._table import read_table
from pdmp.io._trajectory import trajectory_table


def read_csv(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads one demonstration from a CSV file.

    A header field `knee [rad]` gives the name `knee` and the unit rad; a row of units below the
    header is read too. Fields are separated by commas, semicolons, tabs or spaces; unless by
    commas, decimal commas are allowed. Lines before the header, comments, which begin with #, and
    the unnamed index column of pandas are skipped.

    Parameters
    ----------
    path : path
        UTF-8 or UTF-16 text with a row of names, then one sample per row.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; by default all columns except `time`
        and the derivatives `<name>_velocity` and `<name>_acceleration`, which `write_csv` writes.
    time : str
        Column of the time stamps, by default `t` or `time`, in s unless its header or this
        argument has ms, µs or ns in brackets. Stamps in ms, µs or ns since 1970 are recognised,
        with a warning, and are relative to the first.
    dt : float, optional
        Sampling interval [s], instead of time stamps.
    max_gap : float
        Longest gap [s] to interpolate, from the sample before to the sample after it; by default 0,
        none. A gap is an empty field, NaN, NA or null. Rows with time stamps further apart than a
        positive `max_gap`, and than five usual intervals, are an error.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A field that is not a finite number, a gap that is longer than `max_gap` or at an end, a
        missing column, time stamps in an unknown unit, or data that `Demonstration` rejects; the
        text gives file, column, and line or time.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    check_time(time)
    options = Options(columns, dt, max_gap, context)
    return read_table(parse_table(path, time), time, options)


def write_csv(
    path: str | PathLike[str],
    trajectory: Trajectory,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Writes a trajectory as CSV; `read_csv` reads its positions back.

    The columns are `t` [s], then the positions `<name>`, velocities `<name>_velocity` and
    accelerations `<name>_acceleration` of all degrees of freedom, with units in brackets. Those of
    rotations have the names of `trajectory.dof_names`. Numbers are exact. The file is written
    atomically.

    Parameters
    ----------
    path : path
        File to write.
    trajectory : Trajectory
        A rollout.
    names : sequence of str, optional
        Names of the D degrees of freedom, instead of the trajectory's.
    units : sequence of str, optional
        Their units, instead of the trajectory's; "" for none.

    Raises
    ------
    ValueError
        A number of names or units other than D, or names that would be read differently.
    OSError
        A file that cannot be written, or whose folder does not exist.
    """
    path = file_path(path)
    fields, columns = trajectory_table(path, trajectory, names, units)
    with atomic_write(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(fields)
        writer.writerows(columns.tolist())
