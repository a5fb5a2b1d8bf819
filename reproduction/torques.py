"""Torque control of a simulated robot in MuJoCo at 1 kHz."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduction.baxter import engine

Array = NDArray[np.float64]

DT = 0.001  # s
STIFFNESS, DAMPING = 900.0, 60.0  # per s², per s: errors vanish in 0.2 s, critically damped
LOCK_STIFFNESS, LOCK_DAMPING = 4000.0, 100.0  # N m/rad, N m s/rad, of a locked joint


class TorqueControlled:
    """A robot whose joints follow commands.

    The torques are those of computed torque control::

        τ = M (q̈_d + 60 (q̇_d − q̇) + 900 (q_d − q)) + h(q, q̇)

    within the limits of the motors.

    Parameters
    ----------
    specified : mujoco.MjSpec
        Model of the robot, with a motor of torque for each joint to control. These joints precede
        all others and are in the order of the motors.
    joints : sequence of str, (D,)
        Joints that move.
    start : (D,) array_like
        Their initial angles [rad].
    others : mapping of str to float
        Initial angles of other joints, which stay there [rad].
    signs : (D,) array_like
        Signs of the angles of joints in those of the model.

    Attributes
    ----------
    position_gain, velocity_gain : float
        Gains of the feedback, per s² and per s.
    """

    position_gain, velocity_gain = STIFFNESS, DAMPING

    def __init__(
        self,
        specified: Any,
        joints: Sequence[str],
        start: ArrayLike,
        others: Mapping[str, float],
        signs: ArrayLike = 1.0,
    ) -> None:
        self._mujoco = mujoco = engine()
        specified.option.timestep = DT
        self.model = model = specified.compile()
        self.data: Any = mujoco.MjData(model)
        self._moved = np.array([model.joint(name).qposadr[0] for name in joints])
        self._motors = model.actuator_trnid[:, 0]
        # Each of these joints has one degree of freedom and one coordinate: a single index
        # addresses both.
        self._driven = model.jnt_dofadr[self._motors]
        self._signs = np.array(signs, dtype=float)
        self._lock: tuple[int, float] | None = None
        for name, angle in others.items():
            self.data.joint(name).qpos = angle
        self.data.qpos[self._moved] = self._signs * start
        self._target = self.data.qpos[self._driven].copy()
        self.saturated = False
        """True if a motor was at its limit in the last tick."""
        mujoco.mj_step1(model, self.data)

    @property
    def position(self) -> Array:
        """Joint angles (D,) [rad]."""
        return np.array(self._signs * self.data.qpos[self._moved])

    def hold(self, joint: int | None) -> None:
        """Locks the joint of this index at its position, or releases it."""
        if joint is None:
            self._lock = None
            self.data.qfrc_applied[:] = 0
        else:
            index = int(self._moved[joint])
            self._lock = (index, float(self.data.qpos[index]))

    def move(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> None:
        """Controls the joints towards a state (D,) [rad, rad/s, rad/s²] for one tick."""
        model, data, mujoco = self.model, self.data, self._mujoco
        target, rate, acceleration_command = self._target, np.zeros(model.nv), np.zeros(model.nv)
        target[self._moved] = self._signs * position
        rate[self._moved] = self._signs * velocity
        acceleration_command[self._moved] = self._signs * acceleration
        driven = self._driven
        acceleration_command[driven] += self.position_gain * (target - data.qpos[driven])
        acceleration_command[driven] += self.velocity_gain * (rate[driven] - data.qvel[driven])
        torque = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, torque, acceleration_command)
        wanted = (torque + data.qfrc_bias)[driven]
        data.ctrl[:] = np.clip(wanted, *model.actuator_ctrlrange.T)
        self.saturated = bool((data.ctrl != wanted).any())
        if self._lock is not None:
            index, angle = self._lock
            spring = LOCK_STIFFNESS * (angle - data.qpos[index])
            data.qfrc_applied[index] = spring - LOCK_DAMPING * data.qvel[index]
        mujoco.mj_step2(model, data)
        # Updates kinematics and dynamics, from which the next torques are computed.
        mujoco.mj_step1(model, data)
