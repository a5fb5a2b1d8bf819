"""Straight reaches to goals nearer and farther than the demonstrated ones."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

import pdmp

N_SAMPLES = 2000
PHASES = (0.05, 0.2, 0.4, 0.7, 0.9, 1.1)  # at which a goal moves, in durations
FAR = 11.0  # ten ranges beyond the demonstrated goal at 1


@dataclass(frozen=True)
class Reach:
    """Properties of a model of straight reaches of length 0.9, 1 and 1.1."""

    outside: (
        float  # farthest point beyond start or goal at half the distance, share of the distance
    )
    initial: float  # |y''| at the start of a reach to FAR, in units of its largest along m
    largest: float  # largest |y''| of a reach to FAR, in that unit
    filtered: tuple[float, ...]  # largest |y''| due to a goal moved at PHASES, over shift / T²
    at_once: tuple[float, ...]  # the same without a transition of the command


def reach(transport: Literal["learnt", "immediate"]) -> Reach:
    """Returns the properties of a model with learnt or immediate transport.

    The unit of acceleration is the largest of moving by twelve ranges along the profile m.
    """
    model, learnt = straight(transport), straight("learnt")
    clock = np.linspace(0, 1, N_SAMPLES + 1)
    bend = np.gradient(np.gradient(learnt.transport(clock), clock), clock)
    unit = 12 * np.abs(bend).max() / model.tau**2
    dt = model.tau / N_SAMPLES
    near = model.rollout(start=[0.0], goal=[0.5], dt=dt).position
    far = np.abs(model.rollout(start=[0.0], goal=[FAR], dt=dt).acceleration)
    outside = max(-near.min(), near.max() - 0.5, 0.0) / 0.5
    return Reach(
        outside,
        far[0, 0] / unit,
        far.max() / unit,
        tuple(by_moved_goal(model, phase, None) for phase in PHASES),
        tuple(by_moved_goal(model, phase, 0.0) for phase in PHASES),
    )


def by_moved_goal(model: pdmp.Model, phase: float, transition: float | None) -> float:
    """Returns the largest |y''| due to a goal that moves by 1, in units of 1 over T squared."""
    duration = model.durations[model.nominal]
    moved, plain = (
        model.controller(duration / N_SAMPLES, goal=[1.0], transition=transition) for _ in range(2)
    )
    largest = 0.0
    for tick in range(3 * N_SAMPLES):
        if tick == round(phase * N_SAMPLES):
            moved.goal = [2.0]
        moved.step()
        plain.step()
        largest = max(largest, abs(moved.acceleration[0] - plain.acceleration[0]))
    return largest * duration**2


def straight(transport: Literal["learnt", "immediate"]) -> pdmp.Model:
    """Fits straight reaches of minimum jerk."""
    s = np.linspace(0, 1, 101)
    path = s**3 * (10 - 15 * s + 6 * s**2)
    return pdmp.fit(
        [(length * path)[:, None] for length in (0.9, 1.0, 1.1)], dt=0.01, transport=transport
    )
