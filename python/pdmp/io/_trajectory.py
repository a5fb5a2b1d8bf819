"""Columns of a trajectory in a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import DERIVATIVES, join_label, name_list, split_label
from pdmp._messages import check_type, value_error
from pdmp._native import Trajectory
from pdmp.io import _fields


def trajectory_table(
    path: Path,
    trajectory: Trajectory,
    names: Sequence[str] | None,
    units: Sequence[str] | None,
) -> tuple[list[str], NDArray[np.float64]]:
    """Returns header fields and columns: time, positions, velocities and accelerations."""
    check_type("trajectory", trajectory, Trajectory, "pdmp.Trajectory")
    names = trajectory.names if names is None else name_list("names", names)
    units = trajectory.units if units is None else name_list("units", units)
    # With rotations, the columns of derivatives are degrees of freedom, not coordinates.
    dofs = (trajectory.dof_names, trajectory.dof_units)
    of_dofs = dofs if trajectory.rotations else (names, units)
    n_dofs = trajectory.position.shape[1]
    for kind, labels in (("name", names), ("unit", units)):
        if len(labels) != n_dofs:
            raise ValueError(
                f"{kind}s has length {len(labels)}, expected {n_dofs}: one {kind} per DoF"
            )
    columns_of = list(zip(DERIVATIVES, ((names, units), of_dofs, of_dofs), strict=True))
    header = [f"{name}{suffix}" for (suffix, _), (own, _) in columns_of for name in own]
    _fields.check_names(path, 1, ["t", *header])
    units = [unit and f"{unit}{per}" for (_, per), (_, own) in columns_of for unit in own]
    fields = list(map(join_label, header, units))
    for name, unit, field in zip(header, units, fields, strict=True):
        if split_label(field) != (name, unit):
            raise value_error(f"{path}: '{field}' would not be read as '{name}' in '{unit}'")
    columns = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.acceleration)
    return ["t", *fields], np.column_stack(columns)
