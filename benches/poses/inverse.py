"""Differential inverse kinematics by mink, from poses of frames to motions of joints."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from reproduction.torques import DT

ORIENTATION_COST = 0.3  # m/rad, weight of rotations over that of positions
POSTURE_COST, POSTURE_GAIN = 1e-3, 2.0  # –, per s, with which redundant joints return to angles
DAMPING = 1e-6  # of Levenberg and Marquardt
N_SEARCHED, SEARCH_DT = 200, 0.1  # iterations to the first pose, and their length in s


class InverseKinematics:
    """Joint angles whose frames follow poses.

    Parameters
    ----------
    model : mujoco.MjModel
        Robot, all of whose joints move.
    sites : sequence of str, (K,)
        Frames that follow poses.
    near : (n,) array
        Joint angles [rad] that redundant joints stay near.
    velocity : mapping of str to float
        Limits of the velocities of joints [rad/s].

    Attributes
    ----------
    position, velocity, acceleration : (n,) array
        Motion of the joints [rad, rad/s, rad/s²].
    """

    def __init__(
        self, model: Any, sites: Sequence[str], near: np.ndarray, velocity: dict[str, float]
    ) -> None:
        import mink

        self._mink: Any = mink
        self._configuration = mink.Configuration(model, q=near)
        self._tasks = [
            mink.FrameTask(site, "site", 1.0, ORIENTATION_COST, lm_damping=DAMPING)
            for site in sites
        ]
        self._posture = mink.PostureTask(model, POSTURE_COST, gain=POSTURE_GAIN * DT)
        self._posture.set_target(near)
        self._limits = [mink.ConfigurationLimit(model)]
        self._velocity_limit = mink.VelocityLimit(model, velocity)
        self.velocity, self.acceleration = np.zeros((2, model.nv))

    @property
    def position(self) -> np.ndarray:
        """Joint angles (n,) [rad]."""
        return np.array(self._configuration.q)

    def start(self, poses: np.ndarray) -> None:
        """Moves the joints to poses (K, 7), where they rest.

        Raises
        ------
        ValueError
            The search does not reach the poses.
        """
        for _ in range(N_SEARCHED):
            self._solve(poses, SEARCH_DT, self._limits)
        if (error := self.error()) > 1e-3:
            raise ValueError(f"poses: the search for joint angles ends {error:.3g} m or rad away")
        self.velocity[:], self.acceleration[:] = 0, 0

    def follow(self, poses: np.ndarray) -> None:
        """Moves the joints towards poses (K, 7) for one tick."""
        velocity = self._solve(poses, DT, [*self._limits, self._velocity_limit])
        self.acceleration = (velocity - self.velocity) / DT
        self.velocity = velocity

    def error(self) -> float:
        """Returns the largest distance of a frame from its pose [m, rad]."""
        return max(
            float(np.abs(each.compute_error(self._configuration)).max()) for each in self._tasks
        )

    def _solve(self, poses: np.ndarray, dt: float, limits: list[Any]) -> np.ndarray:
        for task, pose in zip(self._tasks, poses, strict=True):
            task.set_target(self._mink.SE3(np.concatenate([pose[3:], pose[:3]])))
        tasks = [*self._tasks, self._posture]
        velocity = self._mink.solve_ik(self._configuration, tasks, dt, "daqp", limits=limits)
        self._configuration.integrate_inplace(velocity, dt)
        return np.array(velocity)
