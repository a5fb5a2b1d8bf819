"""Protocol of the kinematics of a robot, and the checks that its adapters share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from pdmp._messages import counted, quoted, value_error
from pdmp.robots._robot import listing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


@runtime_checkable
class Kinematics(Protocol):
    """Forward kinematics of a frame of a robot, and its Jacobian.

    A pose (7,) is x, y, z, qw, qx, qy, qz: the origin of the frame in the world frame, in the unit
    of the model, and the unit quaternion that maps a vector of the frame to the world frame, of
    either sign. These are the coordinates of a primitive that is fitted to poses with
    ``rotations={3: "wxyz"}``, and the rows of the Jacobian are its degrees of freedom::

        [v, ω] = jacobian(position) @ velocity

    with v the velocity of the origin in the world frame and ω the angular velocity in the frame
    itself, as with ``rotation_frame="body"``, the default of `pdmp.fit`.
    """

    def forward(self, position: ArrayLike, /) -> Array:
        """Returns the poses (..., 7) of the frame at joint positions (..., n)."""
        ...

    def jacobian(self, position: ArrayLike, /) -> Array:
        """Returns the Jacobian (6, n) at joint positions (n,)."""
        ...


def joint_positions(position: ArrayLike, joints: Sequence[str], *, rows: bool) -> Array:
    """Returns joint positions as an array (n,), or (..., n) with `rows`.

    Raises
    ------
    ValueError
        Another number of joints, or a number that is not finite.
    """
    n = len(joints)
    expected = f"expected a position for each of {counted(n, 'joint')} ({listing(joints)})"
    try:
        values = np.asarray(position, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise value_error(f"position = {quoted(position)}: {expected}") from None
    if values.shape[-1:] != (n,) or (values.ndim > 1 and not rows):
        raise value_error(f"position has shape {list(values.shape)}: {expected}")
    if not np.isfinite(values).all():
        at = np.argwhere(~np.isfinite(values))[0].tolist()
        place = ", ".join(map(str, at))
        raise value_error(
            f"position[{place}] = {values[tuple(at)]} of {quoted(joints[at[-1]])}: expected a "
            "finite number"
        )
    return values


def poses(position: Array, pose: Callable[[Array], Array]) -> Array:
    """Returns the pose (..., 7) of each row of joint positions (..., n)."""
    rows = position.reshape(-1, position.shape[-1])
    found = np.array([pose(row) for row in rows]).reshape(-1, 7)
    return found.reshape(*position.shape[:-1], 7)


def initial(configuration: ArrayLike | None, default: ArrayLike, name: str) -> Array:
    """Returns the positions (nq,) of all joints of a model: those given, or those of the model.

    Raises
    ------
    ValueError
        Another length, or a number that is not finite.
    """
    standard = np.array(default, dtype=np.float64)
    if configuration is None:
        return standard
    expected = f"expected the {name} finite coordinates of the model"
    try:
        values = np.array(configuration, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise value_error(f"configuration = {quoted(configuration)}: {expected}") from None
    if values.shape != standard.shape:
        raise value_error(f"configuration has shape {list(values.shape)}: {expected}")
    if not np.isfinite(values).all():
        raise value_error(f"configuration = {quoted(configuration)}: {expected}")
    return values
