"""Two robots in MuJoCo, their joint limits, and primitives from recordings in their joint range."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

import pdmp
from pdmp.robots import REGISTRY
from recordings import recorded
from reproduction.baxter import DIRECTIONS, JOINTS, engine, limits, specification
from reproduction.torques import TorqueControlled

SHARE = 0.8  # of the joint range that the demonstrations take up at most
BRAKE = 1e4  # N m s/rad, of a held joint: motors of 100 N m move it by 0.01 rad/s
ARM = ["sh1", "sh2", "sh3", "elb"]


class Braked(TorqueControlled):
    """A robot that is held by brakes, which are stable on joints of any inertia."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.damping = self.model.dof_damping.copy()

    def hold(self, joint: int | None) -> None:
        """Brakes the joint of this index, or releases the one that is held."""
        self.model.dof_damping[:] = self.damping
        if joint is not None:
            self.model.dof_damping[self._moved[joint]] = BRAKE


@dataclass(frozen=True)
class Arms:
    """A robot, its limits, and the set of recordings for its joints.

    Attributes
    ----------
    name : str
        Name of the robot in robosuite.
    joints : tuple of str, (D,)
        Joints that move, as the description of the robot names them.
    signs : (D,) array
        Signs of their angles in the description.
    limits : pdmp.Limits
        Limits of the angles with these signs.
    source : str
        Set of recordings.
    columns : list of str, (D,)
        Its columns, one for each joint.
    """

    name: str
    joints: tuple[str, ...]
    signs: np.ndarray
    limits: pdmp.Limits
    source: str
    columns: list[str]

    def simulated(self, start: np.ndarray) -> "Braked":
        """Returns the robot at rest at joint angles (D,) [rad].

        Its parts do not collide: random angles bring them together.
        """
        specified = specification(self.name)
        specified.option.disableflags |= int(engine().mjtDisableBit.mjDSBL_CONTACT)
        return Braked(specified, self.joints, start, {}, self.signs)

    def model(self) -> pdmp.Model:
        """Returns the primitive of the recordings."""
        return self.fit(recorded(self.source, self.columns))

    def fit(self, demos: Sequence[pdmp.Demonstration]) -> pdmp.Model:
        """Returns the primitive of demonstrations (T, D) in the joint range of the robot.

        Each column is shifted to the middle of the range of its joint, and scaled down where all
        demonstrations together take up more than a share of that range; time stays as it is.
        """
        positions = np.concatenate([demo.position for demo in demos])
        least, most = positions.min(axis=0), positions.max(axis=0)
        lower, upper = self.limits.position
        scale = np.minimum(1.0, SHARE * (upper - lower) / (most - least))
        mapped = [
            pdmp.Demonstration(
                0.5 * (lower + upper) + scale * (demo.position - 0.5 * (least + most)),
                time=demo.time,
                names=list(self.joints),
                units=["rad"] * len(self.joints),
            )
            for demo in demos
        ]
        return pdmp.fit(mapped)


def panda() -> Arms:
    """Returns a Panda of seven joints, with the limits that its maker publishes."""
    joints = tuple(f"joint{k}" for k in range(1, 8))
    columns = [f"q{k}" for k in range(1, 8)]
    published = REGISTRY["panda"].limits()
    return Arms("panda", joints, np.ones(7), published, "obstacles_xarm", columns)


def baxter() -> Arms:
    """Returns both arms of the Baxter of `reproduction`, four joints each, with its signs."""
    sides = ("right", "left")
    signs = np.concatenate([DIRECTIONS[side] for side in sides])
    joints = tuple(f"{side}_{joint}" for side, joint in product(sides, JOINTS))
    columns = [f"{side[0]}_{joint}" for side, joint in product(sides, ARM)]
    return Arms("baxter", joints, signs, limits(*sides), "arms_hdm05", columns)


ROBOTS = {"Panda": panda, "Baxter": baxter}
