"""Moves: a demonstration is moved to the start and goal of another one of its task."""

from dataclasses import dataclass

import numpy as np

import pdmp
from transport.tasks import Task

MAX_TARGETS = 20  # of a task, evenly spaced; each is left out of two fits
SHARES = np.linspace(0, 1, 101)
MINIMUM_JERK = SHARES**3 * (10 - 15 * SHARES + 6 * SHARES**2)


@dataclass(frozen=True)
class Errors:
    """Mean squared errors of one task, over pairs of demonstrations, in the scale of the fit."""

    source: str
    name: str
    n_demos: int
    learnt: float
    immediate: float
    unmoved: float
    minimum_jerk: float

    @property
    def ratio(self) -> float:
        """Error with learnt relative to that with immediate transport."""
        return self.learnt / self.immediate


def errors(task: Task) -> Errors:
    """Moves every demonstration to start and goal of every other one, which is left out of the fit.

    A moved movement is the demonstration plus the difference of two rollouts, so that the
    truncation of styles has no effect.
    """
    paths = aligned(task) / pdmp.fit(task.demos).dof_scale
    n_demos = len(paths)
    sums = dict.fromkeys(("learnt", "immediate", "unmoved", "minimum_jerk"), 0.0)
    targets = np.unique(np.linspace(0, n_demos - 1, min(n_demos, MAX_TARGETS)).astype(int))
    for n in targets:
        others = [m for m in range(n_demos) if m != n]
        target, moved = paths[n], paths[others]
        by_start, by_goal = (target[row] - moved[:, row] for row in (0, -1))
        for transport in ("learnt", "immediate"):
            shares = responses([task.demos[m] for m in others], transport)
            change = sum(
                share[:, None] * by[:, None]
                for share, by in zip(shares, (by_start, by_goal), strict=True)
            )
            sums[transport] += np.mean((moved + change - target) ** 2)
        sums["unmoved"] += np.mean((moved - target) ** 2)
        straight = target[0] + MINIMUM_JERK[:, None] * (target[-1] - target[0])
        sums["minimum_jerk"] += np.mean((straight - target) ** 2)
    means = {name: total / len(targets) for name, total in sums.items()}
    return Errors(task.source, task.name, n_demos, **means)


def aligned(task: Task) -> np.ndarray:
    """Returns the demonstrations (M, C, D) in linearly scaled time."""
    paths = []
    for demo in task.demos:
        share = (demo.time - demo.time[0]) / np.ptp(demo.time)
        paths.append([np.interp(SHARES, share, trace) for trace in demo.position.T])
    return np.moveaxis(np.array(paths), 1, 2)


def responses(demos: list[pdmp.Demonstration], transport: str) -> tuple[np.ndarray, np.ndarray]:
    """Returns the effects (C,) of a unit change of the start and of the goal on a fitted movement.

    They are equal for all degrees of freedom and styles, since the output system is linear.
    """
    model = pdmp.fit(demos, transport=transport)
    duration = model.durations[model.nominal]
    zeros, ones = np.zeros(model.n_dofs), np.ones(model.n_dofs)

    def path(start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        dt = duration / (len(SHARES) - 1)
        return model.rollout(start=start, goal=goal, dt=dt, duration=duration).position[:, 0]

    plain = path(zeros, zeros)
    return path(ones, zeros) - plain, path(zeros, ones) - plain
