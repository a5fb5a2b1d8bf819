"""The fifteen reaches of Section 4.1: five heights of obstacle, three trials each, four joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp.reproduction.baxter import Arm
from pdmp.reproduction.human import Task, reach

Array = NDArray[np.float64]

GOAL = np.array([-0.55, -0.97, 0.54, -1.42])  # rad, as printed
START = np.array([0.30, -0.55, 0.0])  # m, of the hand, from where it ends
HEIGHTS = (0.0, 0.15, 0.30, 0.45, 0.60)  # m: none to four boxes
TRAINED = (0.0, 0.30, 0.45)  # m
TRIALS = 3
CONSTANTS = {"alpha_z": 1.5, "beta_z": 1.5, "alpha_x": 0.5, "tau": 0.3}
"""As printed; the damping ratio is √(α_z/β_z)/2 = 0.5."""
NAMES = ["q1", "q2", "q3", "q4"]


@dataclass(frozen=True)
class Reaching:
    """The task on the robot, and its demonstrations."""

    arm: Arm
    task: Task
    start: Array  # rad
    demos: list[pdmp.Demonstration]

    def of(self, heights: tuple[float, ...]) -> list[pdmp.Demonstration]:
        """Return the demonstrations over obstacles of these heights [m]."""
        return [demo for demo in self.demos if height_of(demo) in heights]


def demonstrate(seed: int = 2011) -> Reaching:
    """Let a person reach over every obstacle, and bring that to the robot's right arm."""
    arm = Arm()
    usual, end = arm.swivel(GOAL), arm.places(GOAL)[2]
    task = Task(end + START, end)
    back = np.linspace(task.goal, task.start, 12)
    start = arm.reach(back, np.full(len(back), usual), GOAL)[-1]
    noise = np.random.default_rng(seed)
    demos = []
    for height in HEIGHTS:
        for _ in range(TRIALS):
            trial = reach(task, height, noise)
            elbow = np.full(len(trial.hand), usual + trial.elbow)
            joints = arm.reach(trial.hand, elbow, start)
            demos.append(
                pdmp.Demonstration(
                    position=joints,
                    dt=trial.dt,
                    context=[height],
                    names=NAMES,
                    units=["rad"] * len(NAMES),
                )
            )
    return Reaching(arm, task, start, demos)


def height_of(demo: pdmp.Demonstration) -> float:
    """Return the height of the obstacle that was reached over [m]."""
    return float(np.asarray(demo.context)[0])
