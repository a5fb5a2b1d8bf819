"""Simulation of Baxter in MuJoCo with a table and movable boxes."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduction.baxter import DIRECTIONS, JOINTS, engine, specification
from reproduction.human import BOX, HAND_HEIGHT, Task
from reproduction.torques import DT, TorqueControlled

Array = NDArray[np.float64]

BOX_MASS = 0.5  # kg
TABLE = np.array([0.80, 1.10, 0.04])  # m
RESTING_ARM = {"s0": 0.0, "s1": 0.9, "e0": 0.0, "e1": 0.6}  # rad, with Baxter's signs
WOOD, SHADES = (0.72, 0.62, 0.48, 1), ((0.95, 0.60, 0.25, 1), (0.84, 0.37, 0.0, 1))


@dataclass
class Log:
    """Record of a run, with a row per tick."""

    commanded: list[Array] = field(default_factory=list)  # rad
    measured: list[Array] = field(default_factory=list)  # rad
    hands: list[Array] = field(default_factory=list)  # m
    touching: list[bool] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)  # of MuJoCo, for pictures

    def rows(self) -> tuple[Array, Array]:
        """Returns commanded and measured joint angles, (T, D) each [rad]."""
        return np.array(self.commanded), np.array(self.measured)

    def tracking_error(self) -> float:
        """Returns the largest distance of a joint from its command [rad]."""
        commanded, measured = self.rows()
        return float(np.abs(commanded - measured).max())

    def contact(self) -> float:
        """Returns the time during which the robot contact_times a box [s]."""
        return DT * sum(self.touching)


class Robot(TorqueControlled):
    """Baxter with one or two moving arms; the others are fixed.

    Parameters
    ----------
    start : (4,) or (8,) array_like
        Initial joint angles q1 to q4 [rad] of the right arm, or of the right and the left arm.
    task : Task, optional
        Task with a table and boxes; none by default.
    n_boxes : int
        Number of boxes in the pile.
    """

    def __init__(self, start: ArrayLike, task: Task | None = None, n_boxes: int = 0) -> None:
        sides = ("right", "left")[: np.size(start) // len(JOINTS)]
        specified = specification()
        add_lights(specified)
        disable_torso_contacts(specified)
        if task is not None:
            _add_table_and_boxes(specified, task, n_boxes)
        resting = {
            f"{side}_{name}": RESTING_ARM[name] for side in ("right", "left") for name in JOINTS
        }
        super().__init__(
            specified,
            [f"{side}_{joint}" for side in sides for joint in JOINTS],
            start,
            resting,
            np.concatenate([DIRECTIONS[side] for side in sides]),
        )
        model = self.model
        self._is_box = np.array([_root(model, g).startswith("box") for g in range(model.ngeom)])
        self._is_robot = np.array([_root(model, g) == "base" for g in range(model.ngeom)])
        self._hand = model.body("right_hand").id
        self.log = Log()

    def move(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> None:
        """Controls the arms towards a state (D,) [rad, rad/s, rad/s²] for one tick."""
        super().move(position, velocity, acceleration)
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


def _add_table_and_boxes(specified: Any, task: Task, n_boxes: int) -> None:
    """Adds a table below start and goal, and a pile of boxes half way."""
    box = engine().mjtGeom.mjGEOM_BOX
    forward = task.forward
    turned = [0, 0, float(np.arctan2(forward[1], forward[0]))]
    top = task.middle - [0, 0, HAND_HEIGHT]
    specified.compiler.degree = False
    # Geom group 1, with the robot's meshes, is rendered; group 0 has the collision shapes.
    table = specified.worldbody.add_geom(type=box, size=0.5 * TABLE, rgba=WOOD, group=1)
    table.pos = top + [0.05, 0, -0.5 * TABLE[2]]
    for k in range(n_boxes):
        body = specified.worldbody.add_body(name=f"box_{k}", euler=turned)
        body.pos = top + [0, 0, (k + 0.5) * BOX[2]]
        body.add_freejoint()
        body.add_geom(type=box, size=0.5 * BOX, mass=BOX_MASS, rgba=SHADES[k % 2], group=1)


def disable_torso_contacts(specified: Any) -> None:
    """Disables contacts between the upper arms and the convex hull of the torso.

    Lowered arms are inside the hull although five centimetres from the surface of the torso.
    """
    for side, part in product(("right", "left"), ("upper_elbow", "lower_elbow")):
        specified.add_exclude(bodyname1="torso", bodyname2=f"{side}_{part}")


def add_lights(specified: Any) -> None:
    """Adds two lights and a white background."""
    mujoco = engine()
    sky = specified.add_texture(type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=16, height=96)
    sky.builtin, sky.rgb1, sky.rgb2 = mujoco.mjtBuiltin.mjBUILTIN_FLAT, [1, 1, 1], [1, 1, 1]
    specified.worldbody.add_light(pos=[1.5, -1.5, 2.5], dir=[-0.5, 0.5, -1.0])
    specified.worldbody.add_light(pos=[1.5, 1.5, 2.5], dir=[-0.5, -0.5, -1.0])


def _root(model: Any, geom: int) -> str:
    """Returns the name of the top-level body of a geom."""
    return str(model.body(model.body_rootid[model.geom_bodyid[geom]]).name)


def boxes(height: float) -> int:
    """Returns the number of boxes in a pile of this height [m]."""
    return round(height / float(BOX[2]))


def pile(height: float) -> str:
    """Returns the description of a pile of this height [m]."""
    return {0: "no box", 1: "1 box"}.get(boxes(height), f"{boxes(height)} boxes")
