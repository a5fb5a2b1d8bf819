"""Kinematics of a body or site of a MuJoCo model."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._messages import quoted, value_error
from pdmp.robots._kinematics import initial, joint_positions, poses
from pdmp.robots._mujoco import Joints, compiled
from pdmp.robots._robot import chosen, listing

if TYPE_CHECKING:
    from mujoco import MjModel
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


class MujocoKinematics:
    """`Kinematics` of a body or a site of a MuJoCo model.

    Not for several threads at a time: calls share the memory of one `mujoco.MjData`.

    Parameters
    ----------
    model : path or mujoco.MjModel
        File or compiled model.
    body, site : str
        Name of the frame: one of both.
    joints : sequence of str, optional
        Hinges and slides that move, in the order of the positions; by default all between the
        world and the frame.
    configuration : array_like, (nq,), optional
        Positions of all joints of the model, of which those that do not move stay in force; by
        default ``model.qpos0``.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints that move (n,).

    Raises
    ------
    ImportError
        MuJoCo is not installed.
    ValueError
        An unknown frame or joint, a free or ball joint, or one that follows another joint by an
        equality constraint, also on the way to the frame.
    """

    def __init__(
        self,
        model: str | os.PathLike[str] | MjModel,
        *,
        body: str | None = None,
        site: str | None = None,
        joints: Sequence[str] | None = None,
        configuration: ArrayLike | None = None,
    ) -> None:
        place, self._model = compiled(model)
        import mujoco

        self._mujoco: Any = mujoco
        if (body is None) == (site is None):
            raise value_error(
                f"body = {quoted(body)}, site = {quoted(site)}: name the frame by one of both"
            )
        kind, name = ("body", body) if site is None else ("site", site)
        n = self._model.nbody if site is None else self._model.nsite
        named = [getattr(self._model, kind)(k).name for k in range(n)]
        if name not in named:
            raise value_error(
                f"{place}: no {kind} {quoted(name)}; to choose from: "
                f"{listing([each for each in named if each])}"
            )
        self._frame = named.index(name)
        self._kind = kind
        found = Joints.of(self._model)
        chain = self._chain(found)
        for joint in chain:
            if joint in found.coupled:
                raise value_error(
                    f"{place}: joint {quoted(joint)} on the way to the {kind} {quoted(name)} "
                    "follows an equality constraint, which kinematics leave out"
                )
        if joints is None:
            joints = [joint for joint in chain if joint in found.movable]
            if not joints:
                raise value_error(f"{place}: no hinge or slide moves the {kind} {quoted(name)}")
        self.joints = tuple(chosen(place, found.movable, joints, found.why_not))
        each = [self._model.joint(found.index[joint]) for joint in self.joints]
        self._addresses = [int(joint.qposadr[0]) for joint in each]
        self._dofs = [int(joint.dofadr[0]) for joint in each]
        self._data: Any = mujoco.MjData(self._model)
        self._data.qpos[:] = initial(configuration, self._model.qpos0, f"{self._model.nq}")

    def _chain(self, found: Joints) -> list[str]:
        """Returns the joints between the world and the frame, in the order of the model."""
        body = self._frame if self._kind == "body" else int(self._model.site_bodyid[self._frame])
        bodies = set()
        while body:
            bodies.add(body)
            body = int(self._model.body_parentid[body])
        return [name for name, k in found.index.items() if int(self._model.jnt_bodyid[k]) in bodies]

    def _place(self, position: Array) -> Array:
        self._data.qpos[self._addresses] = position
        self._mujoco.mj_kinematics(self._model, self._data)
        places = self._data.xpos if self._kind == "body" else self._data.site_xpos
        return np.array(places[self._frame])

    def _rotation(self) -> Array:
        rotations = self._data.xmat if self._kind == "body" else self._data.site_xmat
        return np.array(rotations[self._frame])

    def _pose(self, position: Array) -> Array:
        pose = np.empty(7)
        pose[:3] = self._place(position)
        self._mujoco.mju_mat2Quat(pose[3:], self._rotation())
        return pose

    def forward(self, position: ArrayLike, /) -> Array:
        """Returns the poses (..., 7) of the frame, as x, y, z, qw, qx, qy, qz.

        Parameters
        ----------
        position : array_like, (..., n)
            Positions of `joints`, in rad and in the unit of length of the model.
        """
        return poses(joint_positions(position, self.joints, rows=True), self._pose)

    def jacobian(self, position: ArrayLike, /) -> Array:
        """Returns the Jacobian (6, n): the velocity of the origin, and the body angular velocity.

        Parameters
        ----------
        position : array_like, (n,)
            Positions of `joints`, in rad and in the unit of length of the model.
        """
        origin = self._place(joint_positions(position, self.joints, rows=False))
        self._mujoco.mj_comPos(self._model, self._data)
        linear, angular = np.empty((2, 3, self._model.nv))
        body = self._frame if self._kind == "body" else int(self._model.site_bodyid[self._frame])
        self._mujoco.mj_jac(self._model, self._data, linear, angular, origin, body)
        turned = self._rotation().reshape(3, 3).T @ angular
        return np.concatenate([linear, turned])[:, self._dofs]
