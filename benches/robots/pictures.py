"""Figure of a command with and without limits."""

from pathlib import Path

import numpy as np

import pdmp
from pdmp.plot.canvas import BLUE, GREY, ORANGE, label_axes, legend, new_figure, save
from pdmp.robots import REGISTRY
from reproduction.torques import DT

JOINTS = ["panda_joint2", "panda_joint4"]
START, GOAL = np.array([-0.9, -2.4]), np.array([0.5, -1.2])  # rad
HIGHER = np.array([0.0, 0.8])  # rad, by which the second joint rises on the way
COMMAND_AT = 0.5  # s
NEW_GOAL = np.array([2.1, -1.6])  # rad; that of the first joint is beyond its limit
HURRY = 0.5  # times the tau of the model
N_SECONDS = 2.5


def draw(path: Path) -> None:
    """Draws position, velocity and acceleration of two joints of a Panda."""
    figure = new_figure(7.6, 6.2)
    grid = figure.subplots(3, len(JOINTS), sharex=True)
    limits = REGISTRY["panda"].limits(JOINTS)
    lines = {
        "without limits": (None, {"color": GREY, "linewidth": 3}),
        "with limits": (limits, {"color": BLUE, "linewidth": 1.6}),
    }
    for label, (kept, style) in lines.items():
        time, *motion = commanded(kept)
        for row, rows in zip(grid, motion, strict=True):
            for axes, values in zip(row, rows.T, strict=True):
                axes.plot(time, values, label=label, **style)
    velocity, acceleration = limits.velocity, limits.acceleration
    bounds = [limits.position, (-velocity, velocity), (-acceleration, acceleration)]
    labels = ["position [rad]", "velocity [rad/s]", "acceleration [rad/s²]"]
    for row, pair, label in zip(grid, bounds, labels, strict=True):
        row[0].set_ylabel(label)
        for axes, ends in zip(row, np.transpose(pair), strict=True):
            label_axes(axes, "", axes.get_ylabel())
            for end in ends:
                axes.axhline(end, color="black", linestyle="--", linewidth=1, label="limits")
            axes.axvline(COMMAND_AT, color=ORANGE, linewidth=1, label="new goal, half the time")
    for axes, joint in zip(grid[0], JOINTS, strict=True):
        axes.set_title(joint)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    legend(grid[0, 0])
    save(figure, path)


def commanded(limits: pdmp.Limits | None) -> list[np.ndarray]:
    """Returns time (T,) and position, velocity and acceleration (T, D) about the command."""
    s = np.linspace(0, 1, 201)[:, None]
    forward = s**3 * (10 - 15 * s + 6 * s**2)
    demos = [
        START + (GOAL - START) * forward + share * HIGHER * np.sin(np.pi * s) ** 2
        for share in (0.2, 0.6, 1.0)
    ]
    model = pdmp.fit(demos, dt=0.01)
    controller = model.controller(DT, model.conditions(1), limits=limits)
    rows = []
    for tick in range(round(N_SECONDS / DT)):
        if tick == round(COMMAND_AT / DT):
            controller.goal = NEW_GOAL
            controller.tau = HURRY * controller.tau
        controller.step()
        rows.append([controller.position, controller.velocity, controller.acceleration])
        rows[-1] = [each.copy() for each in rows[-1]]
    return [DT * np.arange(1, len(rows) + 1), *np.swapaxes(rows, 0, 1)]
