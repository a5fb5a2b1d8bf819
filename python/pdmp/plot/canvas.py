"""Elements of all figures: a palette for colour-blind readers, panels, labelled axes, legends."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from pdmp._files import atomic_write
from pdmp._labels import join_label
from pdmp._native import Model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

# Palette of Okabe and Ito, ordered by contrast on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
MAX_LABEL = 20
"""Largest number of characters of an axis label in one line."""
BLUE, ORANGE, GREY = PALETTE[0], PALETTE[1], "#B8B8B8"


def ensure_figure(figure: Figure | None, width: float, height: float) -> Figure:
    """Returns `figure`, or a new one of this size [inches]."""
    if figure is not None:
        return figure
    try:
        from pdmp.plot._figure import _NotebookFigure
    except ImportError:
        raise ImportError("figures need matplotlib: pip install 'pdmp[plot]'") from None
    return _NotebookFigure(figsize=(width, height), layout="constrained", dpi=150)


def colormap() -> Colormap:
    """Returns a colour map from blue to orange without colours that are pale on white."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("pdmp", [BLUE, PALETTE[3], ORANGE])


def label_axes(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Labels the axes, and removes lines without information."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def dof_labels(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Returns the names of the degrees of freedom with their units; long ones take two lines."""
    return [fill(label, MAX_LABEL) for label in map(join_label, names, units)]


def movement_panels(
    model: Model, titles: Sequence[str], figure: Figure | None
) -> tuple[Figure, list[list[Axes]]]:
    """Returns a figure and, per title, a column of panels for `draw_movement`.

    With two degrees of freedom, the first panel is for the path. The others are for each degree of
    freedom over time, in a grid if one column has more than four.
    """
    labels = dof_labels(model.coordinate_names, model.coordinate_units)
    if len(titles) == 1 and len(labels) > 4:
        figure, panels = grid_panels(labels, "time [s]", figure)
        if titles[0]:
            figure.suptitle(titles[0])
        return figure, [panels]
    has_path = len(labels) == 2
    heights = [3.6] * has_path + [1.7] * len(labels)
    figure = ensure_figure(figure, max(3.2 * len(titles), 5.5), sum(heights) + 0.5)
    grid = figure.subplots(len(heights), len(titles), squeeze=False, height_ratios=heights)
    for column, title in zip(grid.T, titles, strict=True):
        if has_path:
            label_axes(column[0], *labels)
            column[0].set_aspect("equal", adjustable="datalim")
        for axes, label in zip(column[has_path:], labels, strict=True):
            label_axes(axes, "time [s]", label)
        column[0].set_title(title)
    return figure, [list(column) for column in grid.T]


def grid_panels(labels: Sequence[str], x: str, figure: Figure | None) -> tuple[Figure, list[Axes]]:
    """Returns a figure and a grid with a panel per label, over `x`."""
    n_columns = min(len(labels), 3 if len(labels) < 13 else 5)
    n_rows = ceil(len(labels) / n_columns)
    figure = ensure_figure(figure, max(3.2 * n_columns, 5.5), 1.9 * n_rows + 0.5)
    panels = figure.subplots(n_rows, n_columns, sharex=True, squeeze=False).ravel()
    for axes, label in zip(panels, labels, strict=False):
        label_axes(axes, "", label)
    for axes in panels[len(labels) - n_columns : len(labels)]:
        axes.set_xlabel(x)
        axes.xaxis.set_tick_params(labelbottom=True)
    for axes in panels[len(labels) :]:
        axes.set_axis_off()
    return figure, list(panels[: len(labels)])


def draw_movement(
    panels: Sequence[Axes], time: NDArray[Any], position: NDArray[Any], **style: Any
) -> None:
    """Draws positions (T, D) in a column of `movement_panels`."""
    n_dofs = position.shape[1]
    if len(panels) > n_dofs:
        panels[0].plot(*position.T, **style)
    for axes, trace in zip(panels[-n_dofs:], position.T, strict=True):
        axes.plot(time, trace, **style)


def legend(figure: Figure, axes: Axes) -> None:
    """Adds a legend below the figure, with one entry per label of `axes`."""
    handles, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=len(entries),
        frameon=False,
    )


def save(figure: Figure, path: str | PathLike[str]) -> None:
    """Writes a figure in the format of the suffix of its path, PNG without one, atomically.

    Raises
    ------
    ValueError
        A suffix that matplotlib does not support.
    OSError
        A file that cannot be written, or whose folder does not exist.
    """
    with atomic_write(path) as draft:
        figure.savefig(draft, format=Path(path).suffix[1:] or "png")
