"""Commands and measurements of a run beside the limits."""

from dataclasses import dataclass

import numpy as np

import pdmp
from reproduction.torques import DT
from robots.commands import Record


@dataclass(frozen=True)
class Excess:
    """Figures of a run.

    Attributes
    ----------
    position : float
        Largest distance of a commanded position beyond a limit, over the range of the joint; a
        negative one if all are inside.
    velocity, acceleration : float
        Largest magnitude of a command over its limit. The acceleration is the change of the
        commanded velocity over the tick.
    jumps : float
        Share of the ticks in which the acceleration of a joint changes by more than its limit.
    limited : float
        Share of the ticks in which a limit was active.
    median, worst : float
        Tracking error, the largest of the joints, without ticks in which a joint is held [rad].
    held : float
        Its largest value in those ticks [rad].
    saturated : float
        Share of the ticks in which a motor was at its limit.
    n_commands, n_movements : int
        Numbers of commands, and of movements.
    """

    position: float
    velocity: float
    acceleration: float
    jumps: float
    limited: float
    median: float
    worst: float
    held: float
    saturated: float
    n_commands: int
    n_movements: int


def excess(record: Record, limits: pdmp.Limits) -> Excess:
    """Compares a run with limits of position, velocity and acceleration."""
    lower, upper = limits.position
    outside = np.maximum(lower - record.position, record.position - upper) / (upper - lower)
    acceleration = np.diff(record.velocity, axis=0) / DT
    error = np.abs(record.measured - record.position).max(axis=1)
    return Excess(
        position=float(outside.max()),
        velocity=float((np.abs(record.velocity) / limits.velocity).max()),
        acceleration=float((np.abs(acceleration) / limits.acceleration).max()),
        jumps=float((np.abs(np.diff(acceleration, axis=0)) > limits.acceleration).any(1).mean()),
        limited=float(record.limited.mean()),
        median=float(np.median(error[~record.held])),
        worst=float(error[~record.held].max()),
        held=float(error[record.held].max(initial=0.0)),
        saturated=record.saturated / len(error),
        n_commands=record.commands.total(),
        n_movements=1 + record.commands["start"],
    )
