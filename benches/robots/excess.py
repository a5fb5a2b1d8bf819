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
        Largest distance of a commanded position beyond a limit, over the range of the joint, at
        the ticks and where a joint turns round between them; negative if all are inside.
    velocity, acceleration : float
        Largest magnitude of a command over its limit. The acceleration is the change of the
        commanded velocity over the tick.
    jumps : float
        Share of the ticks in which the acceleration of a joint changes by more than its limit.
    limited, pending : float
        Shares of the ticks in which a limit was active, and in which a command waited.
    median, worst : float
        Tracking error, the largest of the joints, without ticks in which a joint is held [rad].
    held : float
        Its largest value in those ticks [rad].
    saturated : float
        Share of the ticks in which a motor was at its limit, of those without a held joint.
    n_commands, n_movements : int
        Numbers of commands, and of movements.
    """

    position: float
    velocity: float
    acceleration: float
    jumps: float
    limited: float
    pending: float
    median: float
    worst: float
    held: float
    saturated: float
    n_commands: int
    n_movements: int


def excess(record: Record, limits: pdmp.Limits) -> Excess:
    """Compares a run with limits of position, velocity and acceleration."""
    lower, upper = limits.position
    positions = np.concatenate([record.position, turns(record)])
    outside = np.maximum(lower - positions, positions - upper) / (upper - lower)
    acceleration = np.diff(record.velocity, axis=0) / DT
    error = np.abs(record.measured - record.position).max(axis=1)
    return Excess(
        position=float(outside.max()),
        velocity=float((np.abs(record.velocity) / limits.velocity).max()),
        acceleration=float((np.abs(acceleration) / limits.acceleration).max()),
        jumps=float((np.abs(np.diff(acceleration, axis=0)) > limits.acceleration).any(1).mean()),
        limited=float(record.limited.mean()),
        pending=float(record.pending.mean()),
        median=float(np.median(error[~record.held])),
        worst=float(error[~record.held].max()),
        held=float(error[record.held].max(initial=0.0)),
        saturated=float(record.saturated[~record.held].mean()),
        n_commands=record.commands.total(),
        n_movements=1 + record.commands["start"],
    )


def turns(record: Record) -> np.ndarray:
    """Returns positions (T - 1, D) where joints turn round within a tick, else those at its end.

    They are those of the cubic y + v r + b r² + c r³, r = 0…1, through both ends of the tick.
    """
    y, v, w = record.position[:-1], DT * record.velocity[:-1], DT * record.velocity[1:]
    way = record.position[1:] - y
    b, c = 3 * way - 2 * v - w, v + w - 2 * way
    # Of the two zeros of the slope v + 2 b r + 3 c r², one is inside if the velocity changes sign.
    q = -b - np.copysign(np.sqrt(np.maximum(b**2 - 3 * c * v, 0.0)), b)
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = np.array([v / q, q / (3 * c)])
        inside = (zeros > 0) & (zeros < 1) & (v * w < 0)
        r = np.where(inside, zeros, 0.0).sum(axis=0)
    return np.where(inside.any(axis=0), y + r * (v + r * (b + r * c)), record.position[1:])
