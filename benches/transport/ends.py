"""Ends: excursion from the goal after arrival, and the time at which a movement is finished."""

from dataclasses import dataclass

import numpy as np

import pdmp
from transport.tasks import Task

TOLERANCES = (0.001, 0.002, 0.005, 0.01, 0.02)  # shares of the range of each degree of freedom
REST = 0.02  # largest end speed of a movement at rest, as a share of its peak speed
N_SAMPLES = 1000  # of the duration of a movement
N_DURATIONS = 3


@dataclass(frozen=True)
class End:
    """End of one demonstration, reproduced by a default fit of its task."""

    source: str
    end_speed: float  # share of the peak speed, of the smoothed demonstration
    range: float  # largest range of a DoF within one demonstration of the task
    excursion: float  # largest |y - g| after the duration, share of `range`
    own_excursion: float  # the same as a share of the range of each DoF
    finished: float  # time at which a controller is FINISHED, in durations
    settled: tuple[float, ...]  # time of settling to each of TOLERANCES, in durations
    braking: float  # kappa in units of alpha_z
    deceleration: float  # largest |y''| past the end, share of the hardest demonstrated one

    @property
    def is_at_rest(self) -> bool:
        """True if the demonstration ends at rest."""
        return self.end_speed <= REST


def ends(task: Task) -> list[End]:
    """Returns the ends of the demonstrations of one task."""
    model = pdmp.fit(task.demos)
    # With all styles a rollout is the smoothed demonstration.
    smoothed = pdmp.fit(task.demos, n_styles=len(task.demos))
    ranges = np.max([np.ptp(demo.position, axis=0) for demo in task.demos], axis=0)
    clocks = model.durations * model.tau / model.durations[model.nominal]
    hardest = np.max(
        [
            np.abs(rollout(smoothed, m, 1).acceleration * clock**2).max(axis=0)
            for m, clock in enumerate(clocks)
        ],
        axis=0,
    )
    found = []
    for m, clock in enumerate(clocks):
        made = rollout(model, m, N_DURATIONS)
        late = slice(N_SAMPLES, None)
        distance = np.abs(made.position[late] - model.goals[m])
        # The displacement that remains is at most this at critical damping.
        bound = distance + 2 * clock * np.abs(made.velocity[late]) / model.alpha_z
        braking = np.abs(made.acceleration[N_SAMPLES + 1 :] * clock**2).max(axis=0)
        speed = np.linalg.norm(rollout(smoothed, m, 1).velocity / ranges, axis=1)
        found.append(
            End(
                task.source,
                speed[-1] / speed.max(),
                ranges.max(),
                distance.max() / ranges.max(),
                (distance / ranges).max(),
                finished(model, m),
                tuple(settled((bound / ranges).max(axis=1), share) for share in TOLERANCES),
                (model.braking or np.nan) / model.alpha_z,
                float((braking / hardest).max()),
            )
        )
    return found


def rollout(model: pdmp.Model, m: int, n_durations: int) -> pdmp.Trajectory:
    """Returns the rollout of a demonstration over several of its durations."""
    duration = model.durations[m]
    conditions = model.conditions(m)
    return model.rollout(conditions, dt=duration / N_SAMPLES, duration=n_durations * duration)


def settled(bound: np.ndarray, tolerance: float) -> float:
    """Returns the time from which a bound on the distance stays within a tolerance."""
    beyond = np.flatnonzero(bound > tolerance)
    if not len(beyond):
        return 1.0
    return 1 + (beyond[-1] + 1) / N_SAMPLES if beyond[-1] + 1 < len(bound) else np.inf


def finished(model: pdmp.Model, m: int) -> float:
    """Returns the time at which a controller is FINISHED, in durations."""
    controller = model.controller(model.durations[m] / N_SAMPLES, model.conditions(m))
    for tick in range(1, 2 * N_DURATIONS * N_SAMPLES):
        if controller.step() == pdmp.Status.FINISHED:
            return tick / N_SAMPLES
    return np.inf


def rest() -> tuple[float, float]:
    """Returns the excursions of synthetic reaches that rest on their goals.

    The first rest for the last tenth of their duration, the second at their last sample alone.
    """
    excursions = []
    for moving in (0.9, 1.0):
        s = np.minimum(np.linspace(0, 1, 101) / moving, 1)
        reach = s**3 * (10 - 15 * s + 6 * s**2)
        demos = [(size * reach)[:, None] for size in (0.8, 1.0, 1.2)]
        model = pdmp.fit(demos, dt=0.01)
        late = [
            np.abs(rollout(model, m, N_DURATIONS).position[N_SAMPLES:] - model.goals[m])
            for m in range(model.n_demos)
        ]
        excursions.append(np.max(late) / 1.2)
    return excursions[0], excursions[1]
