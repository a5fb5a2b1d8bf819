"""Pictures of the robot, where there is something to draw them with."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pdmp.plot._canvas import canvas
from reproduction.baxter import engine
from reproduction.robot import DT, Robot
from reproduction.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 320, 300  # pixels
ELEVATION = -20.0  # °
TRAIL_STEP, TRAIL_WIDTH, TRAIL_COLOR = 0.02, 0.014, (0.0, 0.45, 0.7, 1.0)  # s, m, RGBA


class Shot(NamedTuple):
    """Where the camera stands, and how much of the hand's way it shows."""

    azimuth: float  # °
    distance: float  # m
    centre: tuple[float, float, float]  # m
    trail: float  # s


REACHING = Shot(210.0, 1.9, (0.4, -0.3, 0.15), trail=np.inf)
SWINGING = Shot(140.0, 2.3, (0.35, -0.25, 0.05), trail=1.0)


class NoRenderer(Exception):
    """There is nothing to draw with; the reason is its text."""


def attach(
    section: Section, name: str, rows: Mapping[str, tuple[Robot, Sequence[float]]], shot: Shot
) -> Section:
    """Adds a strip to a section, or the reason why there is none."""
    try:
        section.figures[name] = strip(rows, shot)
    except NoRenderer as reason:
        section.text.append(f"No pictures of the robot: {reason}.")
    return section


def strip(rows: Mapping[str, tuple[Robot, Sequence[float]]], shot: Shot) -> Figure:
    """Draws robots at some times [s], a row for each, and the path of the right hand.

    Raises
    ------
    NoRenderer
        MuJoCo cannot draw here.
    """
    n_columns = max(len(times) for _, times in rows.values())
    figure = canvas(None, 2.1 * n_columns, 2.2 * len(rows))
    grid = figure.subplots(len(rows), n_columns, squeeze=False)
    for row, (name, (robot, times)) in zip(grid, rows.items(), strict=True):
        for axes, time, picture in zip(row, times, _pictures(robot, times, shot), strict=True):
            axes.imshow(picture)
            axes.set_xticks([])
            axes.set_yticks([])
            axes.set_title(f"{time:.2f} s", fontsize=8)
        row[0].set_ylabel(name, fontsize=9)
    return figure


def _pictures(robot: Robot, times: Sequence[float], shot: Shot) -> list[Any]:
    mujoco = engine()
    if reason := _missing():
        raise NoRenderer(f"MuJoCo cannot draw here ({reason}): install EGL or OSMesa")
    renderer = mujoco.Renderer(robot.model, HEIGHT, WIDTH)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    camera.lookat[:] = shot.centre
    camera.azimuth, camera.elevation, camera.distance = shot.azimuth, ELEVATION, shot.distance
    option.geomgroup[:] = [0, 1, 0, 0, 0, 0]
    data, states = mujoco.MjData(robot.model), robot.log.states
    pictures = []
    for time in times:
        tick = min(max(round(time / DT) - 1, 0), len(states) - 1)
        data.qpos[:] = states[tick]
        mujoco.mj_forward(robot.model, data)
        renderer.update_scene(data, camera, option)
        first = max(0, tick - round(min(shot.trail, time) / DT))
        _trail(renderer.scene, robot.log.hands[first : tick + 1 : round(TRAIL_STEP / DT)])
        pictures.append(np.array(renderer.render()))
    renderer.close()
    return pictures


def _trail(scene: Any, places: Sequence[Any]) -> None:
    """Adds a line through some places to a scene, up to its capacity."""
    mujoco = engine()
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    for start, end in itertools.pairwise(places[: scene.maxgeom - scene.ngeom]):
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            geom,
            capsule,
            np.zeros(3),
            np.zeros(3),
            np.eye(3).ravel(),
            np.array(TRAIL_COLOR, np.float32),
        )
        mujoco.mjv_connector(geom, capsule, TRAIL_WIDTH / 2, start, end)
        scene.ngeom += 1


@cache
def _missing() -> str:
    """Returns the reason why drawing fails; tried once, a second attempt may end the process."""
    mujoco = engine()
    try:
        mujoco.Renderer(mujoco.MjSpec().compile(), 1, 1).close()
    except Exception as error:  # what a missing library or driver raises differs among them
        return str(error) or type(error).__name__
    return ""
