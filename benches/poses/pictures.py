"""Frames of the simulated robots, in one figure each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pdmp.plot.canvas import new_figure, save
from reproduction.baxter import engine

WIDTH, HEIGHT = 400, 360  # pixels
TRAIL_STEP, TRAIL_WIDTH = 40, 0.008  # ticks, m
COLORS = (0.0, 0.45, 0.7, 1.0), (0.84, 0.37, 0.0, 1.0)  # RGBA of paths


def strip(
    path: Path,
    model: Any,
    states: Sequence[np.ndarray],
    trails: Sequence[np.ndarray],
    view: tuple[float, float, tuple[float, float, float]],
    n_frames: int = 5,
) -> None:
    """Draws frames at even times, and paths up to each.

    Parameters
    ----------
    path : Path
        File to write.
    model : mujoco.MjModel
        Scene.
    states : sequence of (nq,) array
        Positions at each tick.
    trails : sequence of (T, 3) array
        Up to two paths [m].
    view : tuple of float, float and (3,) tuple
        Azimuth [°], distance [m] and centre [m] of the camera.
    n_frames : int
        Number of frames.
    """
    mujoco = engine()
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
    camera, option, data = mujoco.MjvCamera(), mujoco.MjvOption(), mujoco.MjData(model)
    camera.azimuth, camera.distance, camera.lookat[:] = view
    camera.elevation = -18
    option.geomgroup[:], option.sitegroup[:] = [0, 1, 0, 0, 0, 0], 0
    figure = new_figure(2.3 * n_frames, 2.3)
    ticks = np.linspace(0, len(states) - 1, n_frames).round().astype(int)
    for axes, tick in zip(figure.subplots(1, n_frames), ticks, strict=True):
        data.qpos[:] = states[tick]
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera, option)
        for trail, color in zip(trails, COLORS, strict=False):
            _line(renderer.scene, trail[: tick + 1 : TRAIL_STEP], color)
        axes.imshow(renderer.render())
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(f"{tick / 1000:.1f} s", fontsize=9)
    renderer.close()
    save(figure, path)


def _line(scene: Any, positions: np.ndarray, color: Sequence[float]) -> None:
    """Adds a line through positions to a scene, up to its capacity."""
    mujoco = engine()
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    for start, end in zip(positions[:-1], positions[1:], strict=True):
        if scene.ngeom == scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        rgba = np.array(color, np.float32)
        mujoco.mjv_initGeom(geom, capsule, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
        mujoco.mjv_connector(geom, capsule, TRAIL_WIDTH / 2, start, end)
        scene.ngeom += 1
