"""A Panda, whose tool follows a primitive of recorded tool poses."""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

import pdmp
from pdmp.datasets import folder
from pdmp.io import read_folder
from pdmp.robots import MujocoKinematics
from poses.inverse import InverseKinematics
from recordings import is_available
from reproduction.baxter import engine, specification
from reproduction.robot import add_lights
from reproduction.torques import DT, TorqueControlled

SOURCES = ["franka_tasks", "kuka_paths"]
COLUMNS = ["x", "y", "z", "qa", "qb", "qc", "qd"]
DURATION = 8.0  # s; the recordings of a Franka have a phase instead of the time
SLOWER = 1.5  # at the recorded speed of a KUKA, the path leads the Panda's motors to their limits
DOWNWARDS = (0.0, 1.0, 0.0, 0.0)  # orientation of the hand on the paths of a KUKA, which have none
JOINTS = tuple(f"joint{k}" for k in range(1, 8))
NEAR = {
    "openbox": np.array([0.06, 0.46, -0.30, -2.27, -1.66, 1.73, 1.90]),
    "pouring": np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]),
    "sink": np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]),
}
"""Joint angles [rad] near which the tool is for each task."""
HELD_JOINT, HELD = 3, (3.0, 4.5)  # s, while a person holds the elbow
REST = 0.5  # s, after the movement


def tasks() -> dict[str, list[pdmp.Demonstration]]:
    """Reads the demonstrations of each task for which there are recordings, tool poses (T, 7)."""
    found = defaultdict(list)
    franka, kuka = SOURCES
    if is_available(franka):
        for name, demo in read_folder(folder(franka), columns=COLUMNS).items():
            dt = DURATION / (demo.n_samples - 1)
            recorded = pdmp.Demonstration(demo.position, dt=dt, rotations={3: "wxyz"})
            found[name.partition("_")[0]].append(recorded)
    if is_available(kuka):
        for name, demo in read_folder(folder(kuka)).items():
            if name.startswith("3D_sink"):
                # Half a turn of the base puts the paths in front of the Panda.
                point = demo.position * [-1.0, -1.0, 1.0]
                pose = np.hstack([point, np.tile(DOWNWARDS, (demo.n_samples, 1))])
                recorded = pdmp.Demonstration(pose, time=SLOWER * demo.time, rotations={3: "wxyz"})
                found["sink"].append(recorded)
    return dict(found)


@dataclass
class Record:
    """Motion of a run, a row per tick.

    Attributes
    ----------
    commanded, measured : list of (7,) array
        Poses of the tool.
    saturated : list of bool
        Ticks in which a motor was at its limit.
    states : list of array
        Positions of the simulation, for pictures.
    """

    commanded: list[np.ndarray] = field(default_factory=list)
    measured: list[np.ndarray] = field(default_factory=list)
    saturated: list[bool] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)

    def rows(self, name: str) -> np.ndarray:
        """Returns the rows of an attribute as an array."""
        return np.array(getattr(self, name))


class Arm(TorqueControlled):
    """A Panda, whose tool follows poses."""

    def __init__(self, start: np.ndarray, near: np.ndarray) -> None:
        specified = specification("panda")
        # The recorded poses are taken for those of the hand.
        specified.body("right_hand").add_site(name="tool")
        # The parts do not collide: a table or a box of the recordings is not there either.
        specified.option.disableflags |= int(engine().mjtDisableBit.mjDSBL_CONTACT)
        kinematic = specified.compile()
        self.tool = MujocoKinematics(kinematic, site="tool")
        published = pdmp.robots.REGISTRY["panda"]
        limits = dict(zip(JOINTS, published.velocity, strict=True))
        self.inverse = InverseKinematics(kinematic, ["tool"], near, limits)
        self.inverse.start(start[None])
        add_lights(specified)
        super().__init__(specified, JOINTS, self.inverse.position, {})
        self.record = Record()

    def measured(self) -> np.ndarray:
        """Returns the pose (7,) of the tool."""
        return self.tool.forward(self.position)

    def follow(self, pose: np.ndarray) -> None:
        """Moves the tool towards a pose (7,) for one tick."""
        self.inverse.follow(pose[None])
        self.move(self.inverse.position, self.inverse.velocity, self.inverse.acceleration)
        self.record.commanded.append(pose.copy())
        self.record.measured.append(self.measured())
        self.record.saturated.append(self.saturated)
        self.record.states.append(self.data.qpos.copy())


def run(
    model: pdmp.Model,
    conditions: pdmp.Conditions,
    near: np.ndarray,
    *,
    closed: bool,
    held: bool,
) -> tuple[Arm, Record]:
    """Moves the tool by a primitive.

    Parameters
    ----------
    model : pdmp.Model
        Primitive of tool poses.
    conditions : pdmp.Conditions
        Its conditions.
    near : (7,) array
        Joint angles [rad] near the first ones.
    closed : bool
        True to return the measured pose to the controller.
    held : bool
        True to hold the elbow for a while.
    """
    controller = model.controller(DT, conditions)
    arm = Arm(controller.position.copy(), near)
    tick, rest = 0, round(REST / DT)
    window = {round(HELD[0] / DT): HELD_JOINT, round(HELD[1] / DT): None}
    while rest:
        if held and tick in window:
            arm.hold(window[tick])
        measured = arm.measured() if closed else None
        if controller.step(measured=measured) == pdmp.Status.FINISHED:
            rest -= 1
        arm.follow(controller.position)
        tick += 1
        if tick * DT > 10 * DURATION:
            raise RuntimeError(f"the movement does not end within {10 * DURATION:g} s")
    return arm, arm.record
