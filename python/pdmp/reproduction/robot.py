"""Baxter in MuJoCo: a table, boxes that can be knocked over, and torques at 1 kHz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp.reproduction.baxter import DIRECTIONS, JOINTS, specification
from pdmp.reproduction.human import BOX, RESTING, Task

Array = NDArray[np.float64]

DT = 0.001  # s
STIFFNESS, DAMPING = 900.0, 60.0  # per s², per s: errors vanish in 0.2 s, critically damped
GRIP, GRIP_DAMPING = 4000.0, 100.0  # N m/rad, N m s/rad: a hand that holds a joint fast
BOX_MASS = 0.5  # kg
TABLE = np.array([0.80, 1.10, 0.04])  # m


@dataclass
class Log:
    """What happened, a row per tick."""

    commanded: list[Array] = field(default_factory=list)  # rad
    measured: list[Array] = field(default_factory=list)  # rad
    hands: list[Array] = field(default_factory=list)  # m
    touching: list[bool] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)  # of MuJoCo, for pictures

    def tracking_error(self) -> float:
        """Return the largest distance of a joint from its command [rad]."""
        return float(np.abs(np.array(self.commanded) - self.measured).max())

    def contact(self) -> float:
        """Return for how long the robot touched a box [s]."""
        return DT * sum(self.touching)


class Robot:
    """Baxter, some arms of which are moved and the rest held still.

    Torques are those that the model asks for, by computed torque control::

        τ = M (q̈_d + 60 (q̇_d − q̇) + 900 (q_d − q)) + h(q, q̇)

    within the limits of the motors.

    Parameters
    ----------
    start : (4,) or (8,) array_like
        Joint angles q1 to q4 [rad] to start from; of the right arm, or of the right and the left.
    task : Task, optional
        Where table and boxes stand; without, there are none.
    n_boxes : int
        How many boxes are piled up.
    """

    def __init__(self, start: ArrayLike, task: Task | None = None, n_boxes: int = 0) -> None:
        import mujoco

        q = np.array(start, dtype=float)
        sides = ("right", "left")[: len(q) // len(JOINTS)]
        names = [f"{side}_{joint}" for side in sides for joint in JOINTS]
        specified = specification()
        specified.option.timestep = DT
        _light(specified)
        if task is not None:
            _furnish(specified, task, n_boxes)
        self._mujoco = mujoco
        self.model = model = specified.compile()
        self.data: Any = mujoco.MjData(model)
        moved = [model.joint(name) for name in names]
        self._moved = np.array([joint.qposadr[0] for joint in moved])
        self._motors = model.actuator_trnid[:, 0]
        # The motors' joints come before the boxes: one degree of freedom, one coordinate each.
        self._driven = model.jnt_dofadr[self._motors]
        self._signs = np.tile(DIRECTIONS, len(sides))
        self._is_box = np.array([_root(model, g).startswith("box") for g in range(model.ngeom)])
        self._is_robot = np.array([_root(model, g) == "base" for g in range(model.ngeom)])
        self._hand = model.body("right_hand").id
        self._grip: tuple[int, float] | None = None
        self.data.qpos[self._moved] = self._signs * q
        self._target = self.data.qpos[self._driven].copy()
        self.log = Log()
        mujoco.mj_forward(model, self.data)

    @property
    def position(self) -> Array:
        """Joint angles (D,) [rad]."""
        return np.array(self._signs * self.data.qpos[self._moved])

    @property
    def velocity(self) -> Array:
        """Joint velocities (D,) [rad/s]."""
        return np.array(self._signs * self.data.qvel[self._moved])

    def hold(self, joint: int | None) -> None:
        """Grip the joint of this index where it is, or let go."""
        if joint is None:
            self._grip = None
            self.data.qfrc_applied[:] = 0
        else:
            at = int(self._moved[joint])
            self._grip = (at, float(self.data.qpos[at]))

    def move(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> None:
        """Drive the arms towards a state for one tick: (D,) [rad, rad/s, rad/s²]."""
        model, data, mujoco = self.model, self.data, self._mujoco
        mujoco.mj_step1(model, data)
        wanted, rate, asked = self._target, np.zeros(model.nv), np.zeros(model.nv)
        wanted[self._moved] = self._signs * position
        rate[self._moved] = self._signs * velocity
        asked[self._moved] = self._signs * acceleration
        driven = self._driven
        asked[driven] += STIFFNESS * (wanted - data.qpos[driven])
        asked[driven] += DAMPING * (rate[driven] - data.qvel[driven])
        torque = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, torque, asked)
        data.ctrl[:] = np.clip((torque + data.qfrc_bias)[driven], *model.actuator_ctrlrange.T)
        if self._grip is not None:
            at, place = self._grip
            pull = GRIP * (place - data.qpos[at]) - GRIP_DAMPING * data.qvel[at]
            data.qfrc_applied[at] = pull
        mujoco.mj_step2(model, data)
        self._write(position)

    def _write(self, position: ArrayLike) -> None:
        pairs = self.data.contact.geom[self.data.contact.dist < 0]
        first, second = pairs.T
        box, robot = self._is_box, self._is_robot
        touching = (box[first] & robot[second]) | (box[second] & robot[first])
        self.log.commanded.append(np.array(position))
        self.log.measured.append(self.position)
        self.log.hands.append(self.data.xpos[self._hand].copy())
        self.log.touching.append(bool(touching.any()))
        self.log.states.append(self.data.qpos.copy())


def _furnish(specified: Any, task: Task, n_boxes: int) -> None:
    """Put a table below start and goal, and a pile of boxes half way."""
    import mujoco

    box = mujoco.mjtGeom.mjGEOM_BOX
    forward = task.forward
    turned = [0, 0, float(np.arctan2(forward[1], forward[0]))]
    top = task.middle - [0, 0, RESTING]
    specified.compiler.degree = False
    table = specified.worldbody.add_geom(type=box, size=0.5 * TABLE, rgba=[0.72, 0.62, 0.48, 1])
    table.pos = top + [0.05, 0, -0.5 * TABLE[2]]
    for k in range(n_boxes):
        body = specified.worldbody.add_body(name=f"box_{k}", euler=turned)
        body.pos = top + [0, 0, (k + 0.5) * BOX[2]]
        body.add_freejoint()
        shade = [0.84, 0.37, 0.0, 1] if k % 2 else [0.95, 0.60, 0.25, 1]
        body.add_geom(type=box, size=0.5 * BOX, mass=BOX_MASS, rgba=shade)


def _light(specified: Any) -> None:
    specified.worldbody.add_light(pos=[1.5, -1.5, 2.5], dir=[-0.5, 0.5, -1.0])
    specified.worldbody.add_light(pos=[1.5, 1.5, 2.5], dir=[-0.5, -0.5, -1.0])


def _root(model: Any, geom: int) -> str:
    """Return the name of the body below the world that a shape belongs to."""
    return str(model.body(model.body_rootid[model.geom_bodyid[geom]]).name)


def boxes(height: float) -> int:
    """Return how many boxes make this height [m]."""
    return round(height / BOX[2])


def play(robot: Robot, states: Sequence[tuple[Array, Array, Array]]) -> None:
    """Drive the robot along positions, velocities and accelerations, a tick each."""
    for state in states:
        robot.move(*state)
