"""Reader of C3D files, the markers of motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from pdmp._files import file_path
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _c3d_file
from pdmp.io._demonstration import Options, select
from pdmp.io._packages import reading


def read_c3d(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads the points of a C3D file as one demonstration.

    The coordinates of each point, a marker or a computed quantity, are named `LASI.x`, `LASI.y`
    and `LASI.z`, in the unit that the file states. Analogue channels are not read.

    Parameters
    ----------
    path : path
        A C3D file, of any processor.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of the rate of the file.
    max_gap : float
        Longest gap [s], of hidden markers, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ValueError
        A file that is not C3D or damaged, a missing column, a gap, or data that `Demonstration`
        rejects.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap, context)
    data = path.read_bytes()
    with reading(path, "C3D"):
        points, parameters = _c3d_file.read(data)
        rate = float((parameters.get("POINT:RATE") or [0.0])[0])
        unit = str((parameters.get("POINT:UNITS") or [""])[0])
        # Labels beyond 255 are in LABELS2, LABELS3 and so on.
        keys = ["POINT:LABELS", *(f"POINT:LABELS{k}" for k in range(2, 300))]
        listed = [str(label) for key in keys for label in parameters.get(key, [])]
    n_samples, n_points, _ = points.shape
    labels = listed[:n_points]
    if not n_points:
        raise value_error(f"{path}: has no points")
    if len(set(labels) - {""}) != n_points:
        raise value_error(
            f"{path}: {len(set(labels) - {''})} different labels of {n_points} points: label them"
        )
    names = [f"{label}.{axis}" for label in labels for axis in "xyz"]
    units = [unit] * len(names)
    interval = 1 / rate if rate > 0 else None
    return select(path, options, points.reshape(n_samples, -1), names, units, dt=interval)
