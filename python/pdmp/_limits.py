"""Limits from the description of a robot, as constructors of `Limits`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pdmp._native import Limits

if TYPE_CHECKING:
    from mujoco import MjModel
    from numpy.typing import ArrayLike

__all__ = ["Limits"]


def from_urdf(
    path: str | os.PathLike[str],
    joints: Sequence[str] | None = None,
    *,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
) -> Limits:
    """Reads the joint limits of a robot from a URDF file.

    Positions are in rad or m. Continuous joints have no limits of position. Joints that are fixed,
    that mimic another one or that have several degrees of freedom, floating and planar, are left
    out. The soft limits of a safety controller are not used.

    Parameters
    ----------
    path : path
        A URDF file; one in xacro must be expanded first.
    joints : sequence of str, optional
        Joints in the order of the degrees of freedom, such as those of a fitted model;
        by default all that can be moved, in the order of the file.
    velocity, acceleration, jerk : float or array_like, (D,), optional
        Bounds per s, s² and s³, where the file has none or where the task needs smaller ones: of
        two bounds of a joint the smaller holds. Most files have no acceleration and jerk, which
        URDF has since version 1.2; of acceleration and deceleration the smaller holds.

    Raises
    ------
    ValueError
        A file that is not URDF, incomplete or has a document type declaration; a joint that is
        missing or cannot be moved; a limit that is missing, not a number or, as some exporters
        write it, 0 for unknown, unless the argument replaces it.
    OSError
        A file that cannot be read.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> path = pathlib.Path(tempfile.mkdtemp(), "arm.urdf")
    >>> _ = path.write_text(
    ...     "<robot name='arm'><joint name='elbow' type='revolute'>"
    ...     "<limit lower='-1.5' upper='2' velocity='3' effort='10'/></joint></robot>"
    ... )
    >>> pdmp.Limits.from_urdf(path, acceleration=8.0)
    pdmp.Limits(position=([-1.5], [2.0]), velocity=[3.0], acceleration=[8.0])
    """
    from pdmp.robots import _urdf  # at the first use: a control loop may do without

    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk}
    return _urdf.read(path, joints, given)


def from_mujoco(
    model: str | os.PathLike[str] | MjModel,
    joints: Sequence[str] | None = None,
    *,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
) -> Limits:
    """Reads the joint limits of a robot from a MuJoCo model; needs the package mujoco.

    Positions are in rad or m, for files in degrees too. A joint that is not limited has no limits
    of position. Joints that follow another one through an active equality constraint, free
    joints and ball joints are left out. MuJoCo has limits of the position alone.

    Parameters
    ----------
    model : path or mujoco.MjModel
        A file in MJCF, with its meshes, or a compiled model.
    joints : sequence of str, optional
        Joints in the order of the degrees of freedom, such as those of a fitted model;
        by default all that can be moved, in the order of the MuJoCo model.
    velocity, acceleration, jerk : float or array_like, (D,), optional
        Bounds per s, s² and s³.

    Raises
    ------
    ImportError
        The package mujoco is not installed.
    ValueError
        A file that MuJoCo does not compile, or a joint that is missing or cannot be moved.
    TypeError
        A model that is neither a path nor a compiled model.
    OSError
        A file that cannot be read.
    """
    from pdmp.robots import _mujoco

    given = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk}
    return _mujoco.read(model, joints, given)


# The readers are in Python, which the compiled class does not import.
for _constructor in (from_urdf, from_mujoco):
    setattr(Limits, _constructor.__name__, staticmethod(_constructor))
del from_urdf, from_mujoco
