"""Images of the robot, rendered by MuJoCo if a renderer is available."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pdmp.plot.canvas import new_figure
from reproduction.baxter import engine
from reproduction.robot import Robot
from reproduction.section import Section
from reproduction.torques import DT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 320, 300  # pixels
ELEVATION = -20.0  # °
TRAIL_STEP, TRAIL_WIDTH, TRAIL_COLOR = 0.02, 0.014, (0.0, 0.45, 0.7, 1.0)  # s, m, RGBA


class CameraView(NamedTuple):
    """Camera position, and duration of the drawn path of the hand."""

    azimuth: float  # °
    distance: float  # m
    centre: tuple[float, float, float]  # m
    trail: float  # s


REACHING = CameraView(210.0, 1.9, (0.4, -0.3, 0.15), trail=np.inf)
SWINGING = CameraView(140.0, 2.3, (0.35, -0.25, 0.05), trail=1.0)


class RendererError(Exception):
    """No renderer is available; the text gives the reason."""


def attach(
    section: Section, name: str, rows: Mapping[str, tuple[Robot, Sequence[float]]], shot: CameraView
) -> Section:
    """Adds a strip of images to a section, or the reason for its absence."""
    try:
        section.figures[name] = strip(rows, shot)
    except RendererError as reason:
        section.text.append(f"No images of the robot: {reason}.")
    return section


def strip(rows: Mapping[str, tuple[Robot, Sequence[float]]], shot: CameraView) -> Figure:
    """Draws robots at given times [s], with a row per robot, and the path of the right hand.

    Raises
    ------
    RendererError
        MuJoCo cannot render.
    """
    n_columns = max(len(times) for _, times in rows.values())
    figure = new_figure(2.1 * n_columns, 2.2 * len(rows))
    grid = figure.subplots(len(rows), n_columns, squeeze=False)
    for row, (name, (robot, times)) in zip(grid, rows.items(), strict=True):
        for axes, time, picture in zip(row, times, _pictures(robot, times, shot), strict=True):
            axes.imshow(picture)
            axes.set_xticks([])
            axes.set_yticks([])
            axes.set_title(f"{time:.2f} s", fontsize=8)
        row[0].set_ylabel(name, fontsize=9)
    return figure


def _pictures(robot: Robot, times: Sequence[float], shot: CameraView) -> list[Any]:
    mujoco = engine()
    if reason := _missing():
        raise RendererError(f"MuJoCo cannot render ({reason}): install EGL or OSMesa")
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


def _trail(scene: Any, positions: Sequence[Any]) -> None:
    """Adds a line through positions to a scene, up to its capacity."""
    mujoco = engine()
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    for start, end in itertools.pairwise(positions[: scene.maxgeom - scene.ngeom]):
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
    """Returns the reason why rendering fails; cached, as a second try may end the process."""
    mujoco = engine()
    try:
        mujoco.Renderer(mujoco.MjSpec().compile(), 1, 1).close()
    except Exception as error:  # missing libraries and drivers raise different errors
        return str(error) or type(error).__name__
    return ""
