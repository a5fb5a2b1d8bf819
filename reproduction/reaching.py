"""Fifteen reaches of Section 4.1: obstacles of five heights, three trials each, four joints."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import pdmp
from reproduction.baxter import Arm, UnreachableError
from reproduction.human import HAND_HEIGHT, Task, reach
from reproduction.section import SEED

Array = NDArray[np.float64]

GOAL = np.array([-0.55, -0.97, 0.54, -1.42])  # rad, as printed
START = np.array([0.30, -0.55, 0.0])  # m, start of the hand relative to its goal
HEIGHTS = (0.0, 0.15, 0.30, 0.45, 0.60)  # m: none to four boxes
TRAINING_HEIGHTS = (0.0, 0.30, 0.45)  # m
TRIALS = 3
MAX_TRIALS = 100
CONSTANTS: dict[str, Any] = {
    **{"alpha_z": 1.5, "beta_z": 1.5, "alpha_x": 0.5, "tau": 0.3},
    "smoothing": None,
    "transport": "immediate",
}
"""As printed; the damping ratio is √(α_z/β_z)/2 = 0.5."""
NAMES = ["q1", "q2", "q3", "q4"]


@dataclass(frozen=True)
class Reaching:
    """Task on the robot, and its demonstrations."""

    arm: Arm
    task: Task
    start: Array  # rad
    goal: Array  # rad
    demos: list[pdmp.Demonstration]

    def miss(self, hand: Array, goal: Array | None = None) -> float:
        """Returns the distance [mm] of a hand (3,) [m] from its position at a goal [rad]."""
        goal_hand = self.arm.positions(self.goal if goal is None else goal)[2]
        return 1e3 * float(np.linalg.norm(hand - goal_hand))

    def side_view(self, hands: Array) -> tuple[Array, Array]:
        """Returns distance (T,) from start towards goal and height (T,) of hands (T, 3), in m."""
        distance = (hands - self.task.start) @ self.task.forward
        return distance, hands[:, 2] - self.task.goal[2] + HAND_HEIGHT

    def of(self, heights: tuple[float, ...]) -> list[pdmp.Demonstration]:
        """Returns the demonstrations over obstacles of these heights [m]."""
        return [demo for demo in self.demos if height_of(demo) in heights]


@cache
def demonstrate(seed: int = SEED) -> Reaching:
    """Returns simulated human reaches over all obstacles, mapped to the right arm.

    A trial that the robot cannot follow, with the elbow at its limit, is repeated.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    """
    arm = Arm()
    usual, end = arm.swivel(GOAL), arm.positions(GOAL)[2]
    task = Task(end + START, end)
    back = np.linspace(task.goal, task.start, 12)
    start = arm.reach(back, np.full(len(back), usual), GOAL)[-1]
    noise = np.random.default_rng(seed)
    demos = []
    for height in HEIGHTS:
        for _ in range(TRIALS):
            joints, dt = _trial(arm, task, height, usual, start, noise)
            demos.append(
                pdmp.Demonstration(
                    joints, dt=dt, context=[height], names=NAMES, units=["rad"] * len(NAMES)
                )
            )
    return Reaching(arm, task, start, GOAL, demos)


def _trial(
    arm: Arm, task: Task, height: float, usual: float, start: Array, noise: np.random.Generator
) -> tuple[Array, float]:
    """Returns the joint angles of one reach [rad], and their sampling interval [s]."""
    for _ in range(MAX_TRIALS):
        trial = reach(task, height, noise)
        with suppress(UnreachableError):
            elbow = np.full(len(trial.hand), usual + trial.elbow)
            return arm.reach(trial.hand, elbow, start), trial.dt
    raise UnreachableError(
        f"height = {height} m: none of {MAX_TRIALS} trials is within the arm's reach"
    )


def height_of(demo: pdmp.Demonstration) -> float:
    """Returns the height of the obstacle [m]."""
    return float(np.asarray(demo.context)[0])


def duration_of(demo: pdmp.Demonstration) -> float:
    """Returns the duration of a demonstration [s]."""
    return (demo.n_samples - 1) * float(np.asarray(demo.dt))
