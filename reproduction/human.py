"""Model of people who reach over boxes: path of the hand, duration and variability.

The recordings of the paper were never published. This model, based on published measurements,
replaces them:

- The hand moves with minimum jerk through via-points, including their times: Flash, Hogan, Journal
  of Neuroscience 5, 1985, 1688-1703. Without an obstacle its path is straight.
- The via-points are above the upper edges of the obstacle, at a clearance that is the same for all
  heights. In the plane, people keep a clearance to obstacles (Dean, Brüwer, Experimental Brain
  Research 97, 1994, 497-514).
- Longer movements are faster: the duration grows with the square root of the path length
  (isochrony: Viviani, Schneider, Journal of Experimental Psychology: HPP 17, 1991, 198-218).
- Trials vary by signal-dependent noise, by constant noise, and in their duration:
  Harris, Wolpert, Nature 394, 1998, 780-784; van Beers, Haggard, Wolpert, Journal of
  Neurophysiology 91, 2004, 1050-1063.

The forms of these laws are from the references. The constants below were chosen so that all trials
clear their boxes on the robot, whose arm is thicker than a person's, before any fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 60.0  # Hz, of the motion capture
HAND_HEIGHT = 0.07  # m from the table to the middle of the hand at start and goal
CLEARANCE = 0.15  # m from the upper edges of the obstacle to the middle of the hand over them
BOX = np.array([0.10, 0.15, 0.15])  # m: along the movement, across, up; the last is from the paper
NOMINAL_DURATION = 1.2  # s for the straight path
END_NOISE = 0.004  # m, of each coordinate of start and goal
VIA_NOISE = np.array([0.015, 0.010, 0.010])  # m: along the path, across, up
LIFT_NOISE = 0.05  # of the lift
PASSING_NOISE = 0.02  # of the duration, when the hand is over the obstacle
DURATION_NOISE = 0.05  # of the duration
ELBOW_NOISE = 0.05  # rad


@dataclass(frozen=True)
class Task:
    """Start and goal on a table, and a pile of boxes half way."""

    start: Array
    goal: Array

    @property
    def middle(self) -> Array:
        """Midpoint of start and goal, where the boxes are."""
        return 0.5 * (self.start + self.goal)

    @property
    def forward(self) -> Array:
        """Direction from start to goal."""
        return (self.goal - self.start) / np.linalg.norm(self.goal - self.start)

    @property
    def axes(self) -> Array:
        """Unit vectors forward, sideways and up, as rows (3, 3)."""
        up = np.array([0.0, 0.0, 1.0])
        return np.array([self.forward, np.cross(up, self.forward), up])


@dataclass(frozen=True)
class Reach:
    """One trial."""

    hand: Array
    """Path of the hand (T, 3) [m]."""
    elbow: float
    """Deviation of the swivel angle from its usual value [rad]."""
    dt: float
    """Sampling interval [s]."""


def reach(task: Task, height: float, noise: Generator) -> Reach:
    """Returns one trial over an obstacle of this height [m]."""
    clear = CLEARANCE * np.sqrt(0.5)
    lift = height + clear - HAND_HEIGHT if height > 0 else 0.0
    spread = np.hypot(VIA_NOISE, [0, 0, LIFT_NOISE * lift])
    off = np.array([0, 0, lift]) + noise.normal(0, spread) @ task.axes
    edge = (0.5 * BOX[0] + clear) * task.forward
    start, goal = (place + noise.normal(0, END_NOISE, 3) for place in (task.start, task.goal))
    points = np.array([start, task.middle - edge + off, task.middle + edge + off, goal])
    path = minimum_jerk(points, delay=noise.normal(0, PASSING_NOISE))
    length = np.linalg.norm(np.diff(path(np.linspace(0, 1, 400)), axis=0), axis=1).sum()
    straight = np.linalg.norm(task.goal - task.start)
    duration = (
        NOMINAL_DURATION * np.sqrt(length / straight) * np.exp(noise.normal(0, DURATION_NOISE))
    )
    hand = path(np.linspace(0, 1, round(duration * RATE) + 1))
    return Reach(hand, noise.normal(0, ELBOW_NOISE), 1 / RATE)


def minimum_jerk(points: Array, delay: float = 0.0) -> Callable[[Array], Array]:
    """Returns the minimum-jerk path from rest to rest through two points, over normalised time.

    The path of minimum ∫‖y⃛‖² through points at given times is a quintic spline. The times are
    symmetric about the middle and minimise the jerk too; `delay` then shifts them.

    Parameters
    ----------
    points : (4, 3) array
        Start, two via-points, and goal [m].
    delay : float
        Delay of the via-points, as a share of the duration.
    """
    from scipy.interpodelay import make_interp_spline
    from scipy.optimize import minimize_scalar

    rest = [(1, np.zeros(3)), (2, np.zeros(3))]

    def spline(apart: float, delay: float = 0.0) -> Any:
        times = [0, 0.5 - apart + delay, 0.5 + apart + delay, 1]
        return make_interp_spline(times, points, k=5, bc_type=(rest, rest))

    def jerk(apart: float) -> float:
        third = spline(apart)((np.arange(400) + 0.5) / 400, nu=3)
        return float(np.sum(third**2))

    best = minimize_scalar(jerk, bounds=(0.02, 0.4), method="bounded").x
    return cast("Callable[[Array], Array]", spline(best, delay))
