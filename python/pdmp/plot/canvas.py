"""Elements of all figures: a palette for colour-blind readers, panels, labelled axes, legends."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import ceil
from os import PathLike
from pathlib import Path
from textwrap import TextWrapper
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from pdmp._files import atomic_write
from pdmp._labels import join_label
from pdmp._messages import counted
from pdmp._native import Model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

# Palette of Okabe and Ito, ordered by contrast on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
MAX_LABEL = 14
"""Largest number of characters of an axis label in one line; 16 are as long as a low panel."""
BLUE, ORANGE, GREY = PALETTE[0], PALETTE[1], "#B8B8B8"
Place: TypeAlias = Literal["outside lower center", "outside right upper"]
DPI = 150
"""Resolution of a figure unless rcParams have another one [pixels per inch]."""


def changed(name: str) -> Any:
    """Returns a parameter of `matplotlib.rcParams` that differs from its default, or None."""
    from matplotlib import rcParams, rcParamsDefault

    current: Any = rcParams
    default: Any = rcParamsDefault
    return None if current[name] == default[name] else current[name]


def new_figure(width: float, height: float) -> Figure:
    """Returns a figure of this size [inches], or in proportion to the size in rcParams."""
    try:
        from pdmp.plot._figure import _NotebookFigure
    except ImportError:
        raise ImportError("figures need matplotlib: pip install 'pdmp[plot]'") from None
    from matplotlib import rcParamsDefault

    size = changed("figure.figsize")
    if size is not None:
        usual = rcParamsDefault["figure.figsize"]
        width, height = width * size[0] / usual[0], height * size[1] / usual[1]
    dpi = changed("figure.dpi") or DPI
    return _NotebookFigure(figsize=(width, height), layout="constrained", dpi=dpi)


def colors() -> Sequence[str]:
    """Returns the colours of lines in their order: those of rcParams, or the palette."""
    cycle = changed("axes.prop_cycle")
    return PALETTE if cycle is None else cycle.by_key().get("color", PALETTE)


def line_color(k: int) -> str:
    """Returns colour k of lines, from the first one again after the last one."""
    each = colors()
    return each[k % len(each)]


def colormap() -> Colormap:
    """Returns the colour map of rcParams, or one from blue to orange without pale colours."""
    import matplotlib
    from matplotlib.colors import LinearSegmentedColormap

    name = changed("image.cmap")
    if name is not None:
        return matplotlib.colormaps[name]
    return LinearSegmentedColormap.from_list("pdmp", [BLUE, PALETTE[3], ORANGE])


def draw_panels(
    ax: Axes | ArrayLike | None,
    n: int,
    n_columns: int,
    size: tuple[float, float],
    *,
    heights: Sequence[float] | None = None,
    sharex: bool = False,
    sharey: bool | Literal["row"] = False,
) -> list[Axes]:
    """Returns n panels in rows of n_columns.

    Parameters
    ----------
    ax : Axes or array of Axes, optional
        The n panels themselves, or one Axes in whose place they are made; by default a new figure
        is made.
    size : tuple of float
        Width and height of a new figure [inches].
    heights : sequence of float, optional
        Heights of the rows in proportion.

    Raises
    ------
    ValueError
        Another number of Axes, or one outside a grid in whose place there should be several.
    TypeError
        Not Axes.
    """
    figure = new_figure(*size) if ax is None else None
    from matplotlib.axes import Axes

    n_rows = ceil(n / n_columns)
    share: dict[str, Any] = {"sharex": sharex, "sharey": sharey, "squeeze": False}
    if figure is not None:
        grid = figure.subplots(n_rows, n_columns, height_ratios=heights, **share)
    elif isinstance(ax, Axes):
        if n == 1:
            return [ax]
        place = ax.get_subplotspec()
        if place is None:
            raise ValueError(
                f"ax is not one of pyplot.subplots: pass {n} Axes, {n_rows} rows of {n_columns}"
            )
        ax.set_axis_off()
        grid = place.subgridspec(n_rows, n_columns, height_ratios=heights).subplots(**share)
    else:
        given = list(np.ravel(np.asarray(ax, dtype=object)))
        for each in given:
            if not isinstance(each, Axes):
                raise TypeError(f"ax: expected Axes of matplotlib, got {type(each).__name__}")
        if len(given) != n:
            raise ValueError(
                f"ax has {counted(len(given), 'panel')}, expected {n}: {n_rows} rows of "
                f"{n_columns}; or pass one Axes, in whose place they are made"
            )
        return given
    for axes in grid.ravel()[n:]:
        axes.set_axis_off()
    return list(grid.ravel()[:n])


def figure_of(panels: Sequence[Axes]) -> Figure:
    """Returns the figure that has the panels."""
    # The figure of a part of a figure is the whole.
    return panels[0].figure.figure


def label_axes(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Labels the axes, and removes lines without information."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


class _LabelWrapper(TextWrapper):
    """Breaks labels between words, which underscores, points and hyphens end too outside units."""

    wordsep_re = re.compile(r"(\s+|(?<=[_.-])(?=\w)(?![^\[]*\]))")


def dof_labels(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Returns the names of the degrees of freedom with their units; long ones take several lines.

    A layout makes no room above and below a panel for a label that is longer than the panel.
    """
    wrapper = _LabelWrapper(width=MAX_LABEL)
    return [wrapper.fill(label) for label in map(join_label, names, units)]


def movement_panels(
    model: Model, titles: Sequence[str], ax: Axes | ArrayLike | None
) -> list[list[Axes]]:
    """Returns a column of panels for `draw_movement` per title.

    With two degrees of freedom, the first panel is for the path, at one scale if they have the same
    unit. The others are for each degree of freedom over time, in a grid if one column has more than
    four.
    """
    labels = dof_labels(model.coordinate_names, model.coordinate_units)
    if len(titles) == 1 and len(labels) > 4:
        panels = grid_panels(labels, "time [s]", ax)
        panels[0].set_title(titles[0])
        return [panels]
    has_path = len(labels) == 2
    heights = [3.6] * has_path + [1.7] * len(labels)
    n = len(titles)
    size = max(3.2 * n, 5.5), sum(heights) + 0.5
    panels = draw_panels(ax, n * len(heights), n, size, heights=heights)
    columns = [panels[k::n] for k in range(n)]
    for column, title in zip(columns, titles, strict=True):
        if has_path:
            label_axes(column[0], *labels)
            if len(set(model.coordinate_units)) == 1:
                column[0].set_aspect("equal", adjustable="datalim")
        for axes, label in zip(column[has_path:], labels, strict=True):
            label_axes(axes, "time [s]", label)
        column[0].set_title(title)
    return columns


def grid_panels(labels: Sequence[str], x: str, ax: Axes | ArrayLike | None) -> list[Axes]:
    """Returns a grid with a panel per label, over `x`."""
    n_columns = min(len(labels), 3 if len(labels) < 13 else 5)
    size = max(3.2 * n_columns, 5.5), 1.9 * ceil(len(labels) / n_columns) + 0.5
    panels = draw_panels(ax, len(labels), n_columns, size, sharex=True)
    for axes, label in zip(panels, labels, strict=True):
        label_axes(axes, "", label)
    for axes in panels[-n_columns:]:
        axes.set_xlabel(x)
        axes.xaxis.set_tick_params(labelbottom=True)
    return panels


def draw_movement(
    panels: Sequence[Axes], time: NDArray[Any], position: NDArray[Any], **style: Any
) -> None:
    """Draws positions (T, D) in a column of `movement_panels`."""
    n_dofs = position.shape[1]
    if len(panels) > n_dofs:
        panels[0].plot(*position.T, **style)
    for axes, trace in zip(panels[-n_dofs:], position.T, strict=True):
        axes.plot(time, trace, **style)


def legend(axes: Axes, place: Place = "outside lower center") -> None:
    """Adds a legend with one entry per label of `axes`.

    It has this place in a figure of this package, and is in `axes` of another figure.
    """
    handles, labels = axes.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    from pdmp.plot._figure import _NotebookFigure

    if not isinstance(axes.figure, _NotebookFigure):
        axes.legend(list(entries.values()), list(entries))
        return
    axes.figure.legend(
        list(entries.values()),
        list(entries),
        loc=place,
        ncols=1 if "right" in place else len(entries),
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
