"""Predicted reaches over boxes within the limits of the robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from reproduction.baxter import ACCELERATION, limits
from reproduction.loop import reach_over
from reproduction.reaching import Reaching
from reproduction.robot import Robot, boxes, pile
from reproduction.torques import DT

Array = NDArray[np.float64]

ARM = limits("right")


def beyond(robot: Robot) -> float:
    """Returns the largest distance of a commanded joint beyond its limits [rad], 0 if inside."""
    assert ARM.position is not None
    lower, upper = ARM.position
    commanded, _ = robot.log.rows()
    return float(np.maximum(lower - commanded, commanded - upper).max(initial=0.0))


def reach_inside(model: pdmp.Model, reaching: Reaching, height: float, style: Array) -> Robot:
    """Drives the robot over an obstacle of this height [m] by a controller with limits."""
    return reach_over(model, reaching, height, style, limits=ARM)


def reach_fastest(
    model: pdmp.Model, reaching: Reaching, height: float, style: Array
) -> tuple[Robot, float] | None:
    """Drives the robot along the same path as fast as its limits allow.

    Returns
    -------
    tuple of Robot and float, or None
        The robot, and the duration with the best constant time constant [s]; None if the path
        leaves the limits.
    """
    movement = pdmp.Conditions(
        style=style, start=reaching.start, velocity=np.zeros(model.n_dofs), goal=reaching.goal
    )
    try:
        fastest = model.fastest(ARM, movement, dt=DT)
    except ValueError:
        return None
    robot = Robot(reaching.start, reaching.task, boxes(height))
    motion = zip(fastest.position, fastest.velocity, fastest.acceleration, strict=True)
    for position, velocity, acceleration in motion:
        robot.move(position, velocity, acceleration)
    tau = model.fastest_tau(ARM, movement)
    return robot, tau / model.tau * float(model.durations[model.nominal])


def table(
    models: Mapping[int, pdmp.Model],
    styles: Mapping[int, Mapping[float, Array]],
    reached: Mapping[int, Mapping[float, Robot]],
    reaching: Reaching,
) -> list[str]:
    """Returns text and table on the reaches within the limits.

    Parameters
    ----------
    models : mapping of int to pdmp.Model
        Models by their number of style parameters.
    styles : mapping of int to mapping of float to array
        Predicted styles by height [m].
    reached : mapping of int to mapping of float to Robot
        The reaches without limits.
    reaching : Reaching
        Task.
    """
    header = ["J", "pile", "beyond, no limits", "contact, no limits", "contact", "tracking error"]
    rows = []
    for n_styles, model in models.items():
        for height, style in styles[n_styles].items():
            free = reached[n_styles][height]
            inside = reach_inside(model, reaching, height, style)
            fastest = reach_fastest(model, reaching, height, style)
            rows.append(
                [
                    n_styles,
                    pile(height),
                    f"{beyond(free):.2f} rad",
                    f"{free.log.contact():.3f} s",
                    f"{inside.log.contact():.3f} s",
                    f"{1e3 * inside.log.tracking_error():.0f} mrad",
                    *_fastest_cells(fastest),
                ]
            )
    return [
        "The same with a controller that keeps the published limits of position and velocity, and "
        f"{ACCELERATION:g} rad/s². A path inside the limits is also followed as fast as they "
        "allow, beside the duration with the best constant time constant.",
        markdown_table([*header, "fastest", "constant", "contact, fastest"], rows),
    ]


def _fastest_cells(fastest: tuple[Robot, float] | None) -> list[str]:
    if fastest is None:
        return ["path outside", "–", "–"]
    robot, constant = fastest
    duration = DT * (len(robot.log.commanded) - 1)
    return [f"{duration:.2f} s", f"{constant:.2f} s", f"{robot.log.contact():.3f} s"]
