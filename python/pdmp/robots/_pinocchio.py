"""Kinematics of a frame of a Pinocchio model."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._messages import quoted, value_error
from pdmp.robots._kinematics import initial, joint_positions, poses
from pdmp.robots._robot import chosen, listing

if TYPE_CHECKING:
    import pinocchio
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


class PinocchioKinematics:
    """`Kinematics` of a frame of a Pinocchio model.

    Not for several threads at a time: calls share the memory of one `pinocchio.Data`.

    Parameters
    ----------
    model : path or pinocchio.Model
        URDF file, or model.
    frame : str
        Name of the frame, such as that of a link.
    joints : sequence of str, optional
        Joints with one degree of freedom that move, in the order of the positions; by default all
        between the world and the frame. The position of a continuous joint is its angle.
    configuration : array_like, (nq,), optional
        Coordinates of the model, of which those of joints that do not move stay in force; by
        default ``pinocchio.neutral(model)``.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints that move (n,).

    Raises
    ------
    ImportError
        Pinocchio is not installed.
    ValueError
        An unknown or ambiguous frame, an unknown joint, one with several degrees of freedom, or one
        that mimics another, also on the way to the frame.
    """

    def __init__(
        self,
        model: str | os.PathLike[str] | pinocchio.Model,
        frame: str,
        *,
        joints: Sequence[str] | None = None,
        configuration: ArrayLike | None = None,
    ) -> None:
        try:
            import pinocchio
        except ImportError:
            raise ImportError("Pinocchio models need the package pin: pip install pin") from None
        self._pinocchio: Any = pinocchio
        place = "model"
        if isinstance(model, (str, os.PathLike)):
            place = str(Path(model))
            with open(place, "rb"):
                pass  # An absent file gets the error of the system.
            try:
                model = pinocchio.buildModelFromUrdf(place)
            except (ValueError, RuntimeError) as error:
                raise value_error(f"{place}: not read by Pinocchio: {error}") from None
        if not isinstance(model, pinocchio.Model):
            raise TypeError(f"model = {quoted(model)}: expected a path or a pinocchio.Model")
        self._model: Any = model
        named = [each.name for each in self._model.frames]
        if named.count(frame) != 1:
            reason = "several frames have the name" if frame in named else "no frame"
            names = listing(list(dict.fromkeys(named[1:])))
            raise value_error(f"{place}: {reason} {quoted(frame)}; to choose from: {names}")
        self._frame = named.index(frame)
        index = {name: k for k, name in enumerate(self._model.names) if k}
        # A joint that mimics another has no degree of freedom.
        movable = [name for name, k in index.items() if self._model.joints[k].nv == 1]
        mimics = [name for name, k in index.items() if self._model.joints[k].nv == 0]
        parent = self._model.frames[self._frame].parentJoint
        chain = [name for name, k in index.items() if k in list(self._model.supports[parent])]
        for joint in mimics:
            if joint in chain:
                raise value_error(
                    f"{place}: joint {quoted(joint)} on the way to the frame {quoted(frame)} "
                    "mimics another one: build the model without mimicking joints"
                )

        def why_not(name: str) -> str:
            if name in mimics:
                return f"joint {quoted(name)} mimics another one"
            return f"joint {quoted(name)} has several degrees of freedom" if name in index else ""

        if joints is None:
            joints = [joint for joint in chain if joint in movable]
            if not joints:
                raise value_error(
                    f"{place}: no joint with one degree of freedom moves the frame {quoted(frame)}"
                )
        self.joints = tuple(chosen(place, movable, joints, why_not))
        each = [self._model.joints[index[joint]] for joint in self.joints]
        self._addresses = np.array([joint.idx_q for joint in each])
        self._dofs = [joint.idx_v for joint in each]
        # Coordinates of a continuous joint are cosine and sine of its angle.
        self._circular = np.array([joint.nq == 2 for joint in each])
        self._data: Any = self._model.createData()
        default = pinocchio.neutral(self._model)
        self._configuration = initial(configuration, default, f"{self._model.nq}")

    def _coordinates(self, position: Array) -> Array:
        circular, first = self._circular, self._addresses
        self._configuration[first] = np.where(circular, np.cos(position), position)
        self._configuration[first[circular] + 1] = np.sin(position[circular])
        return self._configuration

    def _pose(self, position: Array) -> Array:
        model, data = self._model, self._data
        self._pinocchio.forwardKinematics(model, data, self._coordinates(position))
        pose = self._pinocchio.updateFramePlacement(model, data, self._frame)
        # The order of Pinocchio is x, y, z, qx, qy, qz, qw.
        return np.array(self._pinocchio.SE3ToXYZQUAT(pose))[[0, 1, 2, 6, 3, 4, 5]]

    def forward(self, position: ArrayLike, /) -> Array:
        """Returns the poses (..., 7) of the frame, as x, y, z, qw, qx, qy, qz.

        Parameters
        ----------
        position : array_like, (..., n)
            Positions of `joints`, in rad and m.
        """
        return poses(joint_positions(position, self.joints, rows=True), self._pose)

    def jacobian(self, position: ArrayLike, /) -> Array:
        """Returns the Jacobian (6, n): the velocity of the origin, and the body angular velocity.

        Parameters
        ----------
        position : array_like, (n,)
            Positions of `joints`, in rad and m.
        """
        module, model, data = self._pinocchio, self._model, self._data
        coordinates = self._coordinates(joint_positions(position, self.joints, rows=False))
        module.computeJointJacobians(model, data, coordinates)
        rotation = module.updateFramePlacement(model, data, self._frame).rotation
        local = module.getFrameJacobian(model, data, self._frame, module.ReferenceFrame.LOCAL)
        return np.concatenate([rotation @ local[:3], local[3:]])[:, self._dofs]
