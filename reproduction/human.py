"""People who reach over boxes: where their hands go, how long they take, how much they vary.

The recordings of the paper were never published. What stands in for them is made from what others
measured:

- The hand moves with minimum jerk through points on its way, when it is at them included: Flash,
  Hogan, Journal of Neuroscience 5, 1985, 1688-1703. Without an obstacle its path is straight.
- The points are over the upper edges of the obstacle, equally far from them at each height: carried
  over from the plane, where people keep a distance to obstacles (Dean, Brüwer, Experimental Brain
  Research 97, 1994, 497-514).
- Longer paths are made faster, and take little longer: duration grows with the root of the path's
  length (isochrony: Viviani, Schneider, Journal of Experimental Psychology: HPP 17, 1991, 198-218).
- Trials vary by noise that grows with the effort, by a constant noise, and in their duration:
  Harris, Wolpert, Nature 394, 1998, 780-784; van Beers, Haggard, Wolpert, Journal of
  Neurophysiology 91, 2004, 1050-1063.

The kinds are theirs; the numbers below are ours, such that all trials clear their boxes on the
robot, whose arm is thicker than a person's. They were set before anything was learnt from them.
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
RESTING = 0.07  # m from the table to the middle of the hand at start and goal
CLEARANCE = 0.15  # m from the upper edges of the obstacle to the middle of the hand over them
BOX = np.array([0.10, 0.15, 0.15])  # m: along the movement, across, up; the paper gives the last
PACE = 1.2  # s for the straight path
END_NOISE = 0.004  # m, of each coordinate of start and goal
VIA_NOISE = np.array([0.015, 0.010, 0.010])  # m: along the path, across, up
LIFT_NOISE = 0.05  # of the lift
PASSING_NOISE = 0.02  # of the duration, when the hand is over the obstacle
PACE_NOISE = 0.05  # of the duration
ELBOW_NOISE = 0.05  # rad


@dataclass(frozen=True)
class Task:
    """A place to start from and one to reach, on a table, and a pile of boxes half way."""

    start: Array
    goal: Array

    @property
    def middle(self) -> Array:
        """Half way, where the boxes are."""
        return 0.5 * (self.start + self.goal)

    @property
    def forward(self) -> Array:
        """Direction from start to goal."""
        return (self.goal - self.start) / np.linalg.norm(self.goal - self.start)

    @property
    def axes(self) -> Array:
        """Forward, sideways and up, as rows."""
        up = np.array([0.0, 0.0, 1.0])
        return np.array([self.forward, np.cross(up, self.forward), up])


@dataclass(frozen=True)
class Reach:
    """One trial."""

    hand: Array
    """The hand over time (T, 3) [m]."""
    elbow: float
    """How far the elbow is off its usual angle [rad]."""
    dt: float
    """Time between two samples [s]."""


def reach(task: Task, height: float, noise: Generator) -> Reach:
    """Reaches once over an obstacle of this height [m]."""
    clear = CLEARANCE * np.sqrt(0.5)
    lift = height + clear - RESTING if height > 0 else 0.0
    spread = np.hypot(VIA_NOISE, [0, 0, LIFT_NOISE * lift])
    off = np.array([0, 0, lift]) + noise.normal(0, spread) @ task.axes
    edge = (0.5 * BOX[0] + clear) * task.forward
    start, goal = (place + noise.normal(0, END_NOISE, 3) for place in (task.start, task.goal))
    points = np.array([start, task.middle - edge + off, task.middle + edge + off, goal])
    path = minimum_jerk(points, late=noise.normal(0, PASSING_NOISE))
    length = np.linalg.norm(np.diff(path(np.linspace(0, 1, 400)), axis=0), axis=1).sum()
    straight = np.linalg.norm(task.goal - task.start)
    duration = PACE * np.sqrt(length / straight) * np.exp(noise.normal(0, PACE_NOISE))
    hand = path(np.linspace(0, 1, round(duration * RATE) + 1))
    return Reach(hand, noise.normal(0, ELBOW_NOISE), 1 / RATE)


def minimum_jerk(points: Array, late: float = 0.0) -> Callable[[Array], Array]:
    """Returns the path from rest to rest through two points, over the share of its duration.

    Of all paths through points at given times the one of least ∫‖y⃛‖² is a spline of fifth degree;
    of all times as long before the middle as after it, those of least jerk are taken, and then
    shifted.

    Parameters
    ----------
    points : (4, 3) array
        Start, two points on the way, and goal [m].
    late : float
        By how much of the duration the points are passed later than that.
    """
    from scipy.interpolate import make_interp_spline
    from scipy.optimize import minimize_scalar

    rest = [(1, np.zeros(3)), (2, np.zeros(3))]

    def spline(apart: float, late: float = 0.0) -> Any:
        times = [0, 0.5 - apart + late, 0.5 + apart + late, 1]
        return make_interp_spline(times, points, k=5, bc_type=(rest, rest))

    def jerk(apart: float) -> float:
        third = spline(apart)((np.arange(400) + 0.5) / 400, nu=3)
        return float(np.sum(third**2))

    best = minimize_scalar(jerk, bounds=(0.02, 0.4), method="bounded").x
    return cast("Callable[[Array], Array]", spline(best, late))
