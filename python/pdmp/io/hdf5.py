"""Reader of HDF5 files in the layout of robomimic."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain
from os import PathLike
from typing import Any

import numpy as np

from pdmp._files import file_path
from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _hdf5_text
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._demonstration import Options, select
from pdmp.io._features import QUATERNION, feature_list, numbered, unique_names
from pdmp.io._packages import ContentError, load, reading

MAX_DEFLATION = 1100
"""Largest ratio of the sizes of a data set before and after compression; deflate reaches 1032."""
POSE = ("obs/robot0_eef_pos", "obs/robot0_eef_quat")
"""Pose of the end effector of the first robot, as robomimic names it."""


def read_hdf5(
    path: str | PathLike[str],
    *,
    features: str | Sequence[str] = POSE,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> dict[str, Demonstration]:
    """Reads the demonstrations of an HDF5 file of robomimic; needs the extra `hdf5`.

    Such a file has a group per demonstration in the group `data`, with data sets (T, n). The
    elements of a data set are named by its last name and their number, as in
    `robot0_joint_pos.3`; of one that ends in `_pos` and has three, `.x`, `.y` and `.z` [m]. Data
    sets of four whose names end in `_quat` are rotations (x, y, z, w), as robomimic has them.

    Parameters
    ----------
    path : path
        An HDF5 file.
    features : str or sequence of str
        Data sets with the positions; by default the pose of the end effector.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of the control frequency that the file states.
    max_gap : float
        Longest gap [s], a run of NaN, to interpolate; by default 0, none.
    context : sequence of str, optional
        What forms the context (Q,) of each demonstration: attributes of its group, or data sets, by
        their first row.

    Returns
    -------
    dict
        Demonstrations by the names of their groups, in natural order.

    Raises
    ------
    ImportError
        The package h5py is not installed.
    ValueError
        A file of another format or layout, a missing data set or column, no interval, or data that
        `Demonstration` rejects.
    OSError
        A file that cannot be read.
    """
    path = file_path(path)
    options = Options(columns, dt, max_gap)
    listed, wanted = feature_list(features), name_list("context", context or [])
    package = load("h5py", "hdf5", "HDF5 files")
    path.stat()  # a missing file is an error of the system
    read: dict[str, tuple[dict[str, Any], list[float | str]]] = {}
    with reading(path, "HDF5"):
        interval = _hdf5_text.interval(path)
    with reading(path, "HDF5"), package.File(path, "r") as file:
        group = file.get("data", {})
        demos = [name for name in group if hasattr(group[name], "keys")]
        demos.sort(key=lambda name: [int(n) for n in re.findall(r"\d+", name)])
        for name in demos:
            arrays = {each: _matrix(package, group[name], each) for each in listed}
            rows = (_context(package, group[name], each) for each in wanted)
            read[name] = arrays, list(chain(*rows))
    if not read:
        raise value_error(f"{path}: no groups in the group 'data', where robomimic writes them")
    found = NamedDemonstrations(context_names=wanted)
    for name, (arrays, values) in read.items():
        source = f"{path}, '{name}'"
        if len({len(array) for array in arrays.values()}) > 1:
            raise value_error(f"{source}: data sets of different lengths")
        own = {each: _names(each, array.shape[1]) for each, array in arrays.items()}
        names = unique_names(own)
        units = ["m" if name.endswith((".x", ".y", ".z")) else "" for name in names]
        begins = np.cumsum([0, *(len(elements) for elements in own.values())])
        quaternions = zip(own.values(), begins, strict=False)
        found[name] = select(
            source,
            options,
            np.hstack(list(arrays.values())),
            names,
            units,
            dt=interval,
            rotations={names[b]: "xyzw" for each, b in quaternions if each[-1:][0].endswith("qw")},
            context=values or None,
        )
    return found


def _names(feature: str, n_elements: int) -> list[str]:
    """Returns the names of the elements of a data set."""
    short = feature.rpartition("/")[2]
    if short.endswith("_quat") and n_elements == 4:
        return [f"{short}.{letter}" for letter in QUATERNION]
    if short.endswith("_pos") and n_elements == 3 and "joint" not in short:
        return [f"{short}.{letter}" for letter in "xyz"]
    return numbered(short, n_elements)


def _matrix(package: Any, group: Any, name: str) -> Any:
    """Returns a data set of numbers as (T, n)."""
    vectors: list[str] = []

    def note(each: str, found: Any) -> None:
        is_array = isinstance(found, package.Dataset) and found.dtype.kind in "fiu"
        if is_array and found.ndim in (1, 2):
            vectors.append(each)

    group.visititems(note)
    if name not in vectors:
        raise ContentError(
            f"no data set '{name}' of vectors in {group.name}: pass features= with some of "
            + ", ".join(vectors)
        )
    item = group[name]
    if item.nbytes > MAX_DEFLATION * item.id.get_storage_size():
        raise ValueError(f"'{name}' states a size that exceeds the file")
    values = np.asarray(item[()], float)
    return values[:, None] if values.ndim == 1 else values


def _context(package: Any, group: Any, name: str) -> list[float | str]:
    """Returns an attribute of a group, or the first row of a data set, as context values."""
    if name in group.attrs:
        value = np.atleast_1d(group.attrs[name]).tolist()
        return [each.decode() if isinstance(each, bytes) else each for each in value]
    return list(_matrix(package, group, name)[0].tolist())
