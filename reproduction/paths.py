"""Figures of paths of hands and joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdmp.plot.canvas import GREY, PALETTE, label_axes, legend, new_figure
from reproduction.human import BOX
from reproduction.reaching import NAMES, Reaching
from reproduction.robot import SHADES, Robot, boxes
from reproduction.torques import DT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


def draw_boxes(axes: Axes, reaching: Reaching, height: float, **style_kwargs: Any) -> None:
    """Draws a pile of boxes from the side."""
    from matplotlib.patches import Rectangle

    middle = 0.5 * np.linalg.norm(reaching.task.goal - reaching.task.start)
    for k in range(boxes(height)):
        corner = (middle - 0.5 * BOX[0], k * BOX[2])
        box = Rectangle(
            corner, BOX[0], BOX[2], **{"color": SHADES[k % 2], "alpha": 0.35, **style_kwargs}
        )
        axes.add_patch(box)


def draw_hand(axes: Axes, reaching: Reaching, hands: Array, **style_kwargs: Any) -> None:
    """Draws the path of a hand (T, 3) from the side."""
    axes.plot(*reaching.side_view(hands), **style_kwargs)


def label_side_view(axes: Axes, title: str) -> None:
    """Labels the axes of a side view."""
    label_axes(axes, "way from start to goal [m]", "height over the table [m]", title)


def joints(robots: Mapping[str, Robot], until: float) -> Figure:
    """Draws commanded and measured joint angles, and the distance between them.

    Parameters
    ----------
    robots : mapping of str to Robot
        Robots by their name in the legend.
    until : float
        End of the drawn time [s].
    """
    figure = new_figure(7.5, 8.5)
    panels = figure.subplots(len(NAMES) + 1, 1, sharex=True)
    for axes, name in zip(panels, NAMES, strict=False):
        label_axes(axes, "", f"{name} [rad]")
    label_axes(panels[-1], "time [s]", "off by [mrad]")
    for (name, robot), color in zip(robots.items(), PALETTE, strict=False):
        commanded, done = (rows[: round(until / DT)] for rows in robot.log.rows())
        time = DT * np.arange(1, len(commanded) + 1)
        for axes, command, angle in zip(panels, commanded.T, done.T, strict=False):
            axes.plot(time, command, color=GREY, linewidth=3, label="commanded")
            axes.plot(time, angle, color=color, linewidth=1.2, label=name)
        panels[-1].plot(time, 1e3 * np.abs(done - commanded).max(axis=1), color=color, linewidth=1)
    legend(panels[0])
    return figure
