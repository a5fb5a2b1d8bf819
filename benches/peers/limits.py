"""One tick within limits, and the fastest movement along a path."""

from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

import pdmp
from peers.movement import DT, N_DOFS, goals, movement, movements, primitive
from peers.steps import TICKS, after, pdmp_settled, ruckig_new_goal, ruckig_sample
from peers.timing import Begin, Task

LOOSE = pdmp.Limits(position=(-1e3, 1e3), velocity=1e3, acceleration=1e6)
# Demonstration that is followed fastest. toppra finds no time law for the first, a straight line.
PATH = 5
# The movement needs up to 13 /s and 40 /s².
TIGHT = pdmp.Limits(position=(-1.0, 6.0), velocity=4.0, acceleration=15.0)


def pdmp_limited(limits: pdmp.Limits) -> Begin:
    """Steps within limits, with constant commands."""
    controller = primitive().controller(dt=DT, limits=limits)
    return after(controller.reset, controller.step, tick=controller.step)


def pdmp_limited_new_goal(limits: pdmp.Limits) -> Begin:
    """Steps within limits, with a new goal before each tick."""
    controller = primitive().controller(dt=DT, limits=limits)
    targets = cycle(goals())

    def tick() -> None:
        controller.goal = next(targets)
        controller.step()

    return after(controller.reset, controller.step, tick=tick)


def klimits_step() -> Begin:
    """Computes the safe accelerations, takes the upper half of them, and steps, with one thread.

    The task differs in kind: no movement is learnt or followed.
    """
    import klimits

    lower, upper = [TIGHT.position[0][0], TIGHT.position[1][0]]
    pairs = {"pos": (lower, upper), "vel": (-4.0, 4.0), "acc": (-15.0, 15.0)}
    pairs["jerk"] = (-30.0 / DT, 30.0 / DT)  # from -A to A in one step
    limitation = klimits.PosVelJerkLimitation(
        time_step=DT,
        **{f"{name}_limits": [list(pair)] * N_DOFS for name, pair in pairs.items()},
        acceleration_after_max_vel_limit_factor=0.0001,
        normalize_acc_range=False,
        num_threads=1,
    )
    action = 0.5 * np.ones(N_DOFS)
    state: list[Any] = []

    def reset() -> None:
        state[:] = [movement(0)[0], np.zeros(N_DOFS), np.zeros(N_DOFS), 0]

    def tick() -> None:
        y, v, a, count = state
        safe, _ = limitation.calculate_valid_acceleration_range(y, v, a, time_step_counter=count)
        end = klimits.denormalize(action, safe.T)
        y_end = klimits.calculate_end_position(a, end, v, y, DT)
        state[:] = [y_end, klimits.calculate_end_velocity(a, end, v, DT), end, count + 1]

    return after(reset, tick, tick=tick)


def pdmp_fastest() -> Begin:
    """Computes time law and trajectory, a thousand samples or more."""
    model, limits = primitive(), pdmp.Limits(velocity=4.0, acceleration=15.0)
    conditions = model.conditions(PATH)
    return lambda: partial(model.fastest, limits, conditions, dt=1.5e-3)


def toppra_fastest(trajectory: bool) -> Begin:
    """Computes the time law on a thousand intervals of a spline, and perhaps its samples."""
    import toppra as ta
    import toppra.algorithm as algorithm
    import toppra.constraint as constraint

    ta.setup_logging("ERROR")
    path = movements(10)[PATH]
    spline = ta.SplineInterpolator(np.linspace(0, 1, len(path)), path)
    bounds = np.ones((N_DOFS, 1)) * [-1.0, 1.0]
    constraints = [
        constraint.JointVelocityConstraint(4.0 * bounds),
        constraint.JointAccelerationConstraint(
            15.0 * bounds, discretization_scheme=constraint.DiscretizationType.Interpolation
        ),
    ]
    grid = np.linspace(0, 1, 1001)

    def compute() -> None:
        instance = algorithm.TOPPRA(constraints, spline, gridpoints=grid)
        if trajectory:
            movement = instance.compute_trajectory(0, 0)
            times = np.arange(0, movement.duration, 1.5e-3)
            [movement(times, order) for order in range(3)]
        else:
            instance.compute_parameterization(0, 0)

    return lambda: compute


TASKS = [
    Task(
        "one step within limits, D=7, at 1 kHz",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3, limits that do not bind": partial(pdmp_limited, LOOSE),
            "pdmp, J=3, limits that bind": partial(pdmp_limited, TIGHT),
            "pdmp, J=3, no limits": pdmp_settled,
            "klimits, range of accelerations": klimits_step,
            "ruckig, sampling its trajectory": ruckig_sample,
        },
    ),
    Task(
        "one step within limits, D=7, to a goal that is new at every tick",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3, limits that do not bind": partial(pdmp_limited_new_goal, LOOSE),
            "pdmp, J=3, limits that bind": partial(pdmp_limited_new_goal, TIGHT),
            "ruckig, computing its trajectory": ruckig_new_goal,
        },
    ),
    Task(
        "fastest movement along a path, D=7, a thousand intervals",
        rounds=40,
        libraries={
            "pdmp, time law and trajectory": pdmp_fastest,
            "toppra, time law": partial(toppra_fastest, False),
            "toppra, time law and trajectory": partial(toppra_fastest, True),
        },
    ),
]
