"""Moves: a demonstration is moved to the start and goal of another one of its task."""

from collections import defaultdict
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
    hindsight: float  # of the profile that is learnt from the target too
    standard_error: float  # of `ratio`, by the jackknife over the targets

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
    all_demos = responses(task.demos, "learnt")
    found: dict[str, list[float]] = defaultdict(list)
    for n in np.unique(np.linspace(0, n_demos - 1, min(n_demos, MAX_TARGETS)).astype(int)):
        others = [m for m in range(n_demos) if m != n]
        target, moved = paths[n], paths[others]
        by_start, by_goal = (target[row] - moved[:, row] for row in (0, -1))
        demos = [task.demos[m] for m in others]
        profiles = {
            "learnt": responses(demos, "learnt"),
            "immediate": responses(demos, "immediate"),
            "hindsight": all_demos,
        }
        for name, (of_start, of_goal) in profiles.items():
            change = of_start[:, None] * by_start[:, None] + of_goal[:, None] * by_goal[:, None]
            found[name].append(np.mean((moved + change - target) ** 2))
        found["unmoved"].append(np.mean((moved - target) ** 2))
        straight = target[0] + MINIMUM_JERK[:, None] * (target[-1] - target[0])
        found["minimum_jerk"].append(np.mean((straight - target) ** 2))
    means = {name: float(np.mean(values)) for name, values in found.items()}
    error = jackknife(np.array(found["learnt"]), np.array(found["immediate"]))
    return Errors(task.source, task.name, n_demos, **means, standard_error=error)


def jackknife(upper: np.ndarray, lower: np.ndarray) -> float:
    """Returns the standard error of the ratio of two sums."""
    n = len(upper)
    ratios = (upper.sum() - upper) / (lower.sum() - lower)
    return float(np.sqrt((n - 1) * np.var(ratios)))


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
