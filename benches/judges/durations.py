"""Durations of the fastest movements, beside those of toppra on the same paths."""

import logging
import os
from collections.abc import Iterator

import numpy as np

import pdmp
from peers.movement import DT, movements

# Limits of human reaches.
VELOCITY, ACCELERATION = 2.0, 8.0  # rad/s, rad/s²
N_INTERVALS = 1000
N_HALVINGS = 8  # of the intervals at rest, where a uniform grid costs 0.3 % of the duration
MAX_MOVEMENTS = 3  # of each task


def toppra_duration(u: np.ndarray, path: np.ndarray) -> float | None:
    """Returns the duration of the path (C, D) over u from rest to rest, None where toppra fails."""
    import toppra as ta
    import toppra.algorithm as algorithm
    import toppra.constraint as constraint

    ta.setup_logging("ERROR")
    logging.getLogger("toppra").setLevel(logging.ERROR)
    bounds = np.ones((path.shape[1], 1)) * [-1.0, 1.0]
    constraints = [
        constraint.JointVelocityConstraint(VELOCITY * bounds),
        constraint.JointAccelerationConstraint(
            ACCELERATION * bounds,
            discretization_scheme=constraint.DiscretizationType.Interpolation,
        ),
    ]
    grid = np.linspace(u[0], u[-1], N_INTERVALS + 1)
    near_rest = (grid[1] - grid[0]) * 0.5 ** np.arange(1, N_HALVINGS + 1)
    grid = np.sort(np.concatenate([grid, u[0] + near_rest, u[-1] - near_rest]))
    instance = algorithm.TOPPRA(constraints, ta.SplineInterpolator(u, path), gridpoints=grid)
    _, rate, _ = instance.compute_parameterization(0, 0)
    if rate is None:
        return None
    return float(np.sum(2 * np.diff(grid) / (rate[1:] + rate[:-1])))


def tasks() -> Iterator[tuple[str, list[pdmp.Demonstration]]]:
    """Yields the reaches in PDMP_DATA, or synthetic ones."""
    if "PDMP_DATA" not in os.environ:
        yield "synthetic", [pdmp.Demonstration(path, dt=DT) for path in movements(10)]
        return
    from transport.tasks import tasks as recorded

    for task in recorded():
        if task.source in {"raise_hand_bandai", "raise_hand_bandai, rise", "arms_hdm05"}:
            yield f"{task.source} {task.name}", task.demos


def report() -> None:
    """Prints durations relative to those of toppra and of the smallest constant tau."""
    limits = pdmp.Limits(velocity=VELOCITY, acceleration=ACCELERATION)
    ratios, gains, excess = [], [], []
    for name, demos in tasks():
        model = pdmp.fit(demos)
        for m in range(min(MAX_MOVEMENTS, len(demos))):
            # From rest, as for toppra.
            conditions = model.conditions(m).replace(tau=model.tau, velocity=np.zeros(model.n_dofs))
            try:
                fastest = model.fastest(limits, conditions, dt=1e-3)
            except ValueError as reason:
                print(f"left out: {name}, {m}: {reason}")
                continue
            duration = model.durations[model.nominal]
            path = model.rollout(conditions, dt=duration / 2000).position
            u = np.linspace(0, duration / model.tau, len(path))
            reference = toppra_duration(u, path)
            if reference is None:
                print(f"left out: {name}, {m}: toppra finds no time law")
                continue
            ratios.append(fastest.time[-1] / reference)
            constant = model.fastest_tau(limits, conditions) / model.tau * duration
            gains.append(constant / fastest.time[-1])
            excess.append(abs(fastest.acceleration).max() / ACCELERATION - 1)
    limited = f"{VELOCITY:g} rad/s and {ACCELERATION:g} rad/s²"
    print(f"\n{len(ratios)} fastest movements within {limited}:")
    print(f"durations relative to toppra from {min(ratios):.5f} to {max(ratios):.5f};")
    print(f"{np.median(gains):.2f} times as fast as the best constant tau (median);")
    print(f"acceleration above its limit by at most {max(excess):.2g} of it.")
