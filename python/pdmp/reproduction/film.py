"""Pictures of the robot, where there is something to draw them with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp.plot._canvas import canvas
from pdmp.reproduction.baxter import engine
from pdmp.reproduction.robot import DT, Robot
from pdmp.reproduction.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 320, 300  # pixels
AZIMUTH, ELEVATION, DISTANCE = 140.0, -18.0, 2.3  # °, °, m
CENTRE = (0.35, -0.25, 0.05)  # m


class NoRenderer(Exception):
    """There is nothing to draw with; the reason is its text."""


def attach(
    section: Section, name: str, rows: Mapping[str, tuple[Robot, Sequence[float]]]
) -> Section:
    """Add a strip to a section, or the reason why there is none."""
    try:
        section.figures[name] = strip(rows)
    except NoRenderer as reason:
        section.text.append(f"No pictures of the robot: {reason}.")
    return section


def strip(rows: Mapping[str, tuple[Robot, Sequence[float]]]) -> Figure:
    """Draw how robots stood at some times [s], a row for each.

    Raises
    ------
    NoRenderer
        MuJoCo cannot draw here.
    """
    n_columns = max(len(times) for _, times in rows.values())
    figure = canvas(None, 2.1 * n_columns, 2.2 * len(rows))
    grid = figure.subplots(len(rows), n_columns, squeeze=False)
    for row, (name, (robot, times)) in zip(grid, rows.items(), strict=True):
        for axes, time, picture in zip(row, times, _pictures(robot, times), strict=True):
            axes.imshow(picture)
            axes.set_xticks([])
            axes.set_yticks([])
            axes.set_title(f"{time:.2f} s", fontsize=8)
        row[0].set_ylabel(name, fontsize=9)
    return figure


def _pictures(robot: Robot, times: Sequence[float]) -> list[Any]:
    mujoco = engine()
    if reason := _missing():
        raise NoRenderer(f"MuJoCo cannot draw here ({reason}): install EGL or OSMesa")
    renderer = mujoco.Renderer(robot.model, HEIGHT, WIDTH)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    camera.lookat[:] = CENTRE
    camera.azimuth, camera.elevation, camera.distance = AZIMUTH, ELEVATION, DISTANCE
    option.geomgroup[:] = [0, 1, 0, 0, 0, 0]
    data, states = mujoco.MjData(robot.model), robot.log.states
    pictures = []
    for time in times:
        data.qpos[:] = states[min(max(round(time / DT) - 1, 0), len(states) - 1)]
        mujoco.mj_forward(robot.model, data)
        renderer.update_scene(data, camera, option)
        pictures.append(np.array(renderer.render()))
    renderer.close()
    return pictures


@cache
def _missing() -> str:
    """Try to draw, and return why it fails; once, since a second attempt may end the process."""
    mujoco = engine()
    try:
        mujoco.Renderer(mujoco.MjSpec().compile(), 1, 1).close()
    except Exception as error:  # what a missing library or driver raises differs among them
        return str(error) or type(error).__name__
    return ""
