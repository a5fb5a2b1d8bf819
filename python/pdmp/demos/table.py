"""CSV files: one demonstration in, one trajectory out."""

import csv
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from pdmp._files import replacing
from pdmp._native import Demonstration, Trajectory
from pdmp.demos import _text
from pdmp.demos._recording import demonstration


def read_csv(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    time: str = "t",
    dt: float | None = None,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Read one demonstration from a CSV file.

    Parameters
    ----------
    path : path
        UTF-8 text, fields separated by commas, names in the first row.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all but `time` by default.
    time : str
        Column of the time stamps [s].
    dt : float, optional
        Sampling interval [s], in place of time stamps.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A field that is not a finite number, a column that is missing, or what `Demonstration`
        refuses; names file, line and column.
    OSError
        A file that cannot be read.
    """
    path = Path(path)
    lines = _text.rows(path)
    _, header = next(lines)
    if dt is None and time not in header:
        raise ValueError(
            f"{path}: no column '{time}' with the time among {', '.join(header)}: "
            "name it with time=, or pass dt="
        )
    names = list(columns) if columns is not None else [name for name in header if name != time]
    wanted = names if dt is not None else [*names, time]
    where = [_text.column(path, header, name) for name in wanted]
    numbers = [
        [_text.number(path, line, header[k], fields[k]) for k in where] for line, fields in lines
    ]
    samples = np.array(numbers).reshape(len(numbers), len(where))
    position, stamps = np.split(samples, [len(names)], axis=1)
    stamped = None if dt is not None else stamps[:, 0]
    return demonstration(path, position, dt=dt, time=stamped, context=context, names=names)


def write_csv(path: str | PathLike[str], trajectory: Trajectory, names: Sequence[str]) -> None:
    """Write a trajectory as CSV; `read_csv` with `columns=names` reads its positions back.

    The columns are `t` [s], then the position of each degree of freedom under its name, then
    velocities under `<name>_velocity` and accelerations under `<name>_acceleration`. Numbers keep
    every bit. The file appears when it is complete.

    Parameters
    ----------
    path : path
        Where to write.
    trajectory : Trajectory
        What a rollout returned.
    names : sequence of str
        Names of the D degrees of freedom, such as `Model.names`.

    Raises
    ------
    ValueError
        A number of names other than D.
    OSError
        A file that cannot be written.
    """
    n_dofs = trajectory.position.shape[1]
    if len(names) != n_dofs:
        raise ValueError(f"names has length {len(names)}, expected {n_dofs}: one name per DoF")
    header = [f"{name}{suffix}" for suffix in ("", "_velocity", "_acceleration") for name in names]
    columns = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.acceleration)
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t", *header])
        writer.writerows(np.column_stack(columns).tolist())
