"""Figures of the style space: its dimension, and the styles of the demonstrations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pdmp._native import Model
from pdmp.plot.canvas import (
    GREY,
    MARKERS,
    colormap,
    colors,
    draw_panels,
    figure_of,
    label_axes,
    legend,
    line_color,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

MAX_INTERVALS = 5
"""Largest number of intervals between the ticks of a style parameter."""


def singular_values(model: Model, *, ax: Axes | None = None) -> Figure:
    """Draws the share of each singular value in their sum, and the number J of styles.

    Parameters
    ----------
    model : Model
        The primitive.
    ax : matplotlib.axes.Axes, optional
        The panel; by default that of a new figure.

    Raises
    ------
    ImportError
        matplotlib is not installed.
    """
    (axes,) = draw_panels(ax, 1, 1, (7.0, 4.0))
    from matplotlib.ticker import MaxNLocator

    total = model.singular_values.sum() or 1.0
    share = 100 * model.singular_values / total
    number = np.arange(1, len(share) + 1)
    n_kept = model.n_styles
    axes.bar(number[:n_kept], share[:n_kept], color=line_color(0), label=f"kept: J = {n_kept}")
    if n_kept < len(share):
        axes.bar(number[n_kept:], share[n_kept:], color=GREY, label="left out")
    axes.plot(number, share.cumsum(), "o-", color=line_color(1), markersize=4, label="sum so far")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlim(0.4, len(share) + 0.6)
    axes.set_ylim(0, 105)
    truncated = f"{100 * model.truncation_error:.2g} % of the targets' RMS left out"
    title = f"J = {n_kept} of {model.n_demos}: {truncated}"
    label_axes(axes, "singular value, of those computed", "share of their sum [%]", title)
    legend(axes)
    return figure_of([axes])


def styles(
    model: Model, labels: Sequence[str] | None = None, *, ax: Axes | ArrayLike | None = None
) -> Figure:
    """Draws the style of each demonstration, in the planes of the first three style parameters.

    Without labels, a context of a single label labels the demonstrations, and a context of a single
    number is their colour. A single style parameter is drawn beside the index of the demonstration.

    Parameters
    ----------
    model : Model
        The primitive.
    labels : sequence of str, optional
        Label of each of the M demonstrations.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        A number of labels other than M.
    ImportError
        matplotlib is not installed.
    """
    if labels is not None and len(labels) != model.n_demos:
        raise ValueError(
            f"labels has length {len(labels)}, expected {model.n_demos}: one per demonstration"
        )
    context = model.contexts if labels is None else None
    if isinstance(context, list) and len(context[0]) == 1:
        labels = [str(value) for (value,) in context]
    points = np.column_stack([model.styles, np.arange(model.n_demos)])
    names = [f"style $s_{{{j + 1}}}$" for j in range(model.n_styles)] + ["demonstration"]
    others = [1, 2] if model.n_styles > 2 else [1]
    groups = list(dict.fromkeys(labels or [""]))
    values = None
    if isinstance(context, np.ndarray) and context.shape[1] == 1:
        values = context[:, 0]
    panels = draw_panels(ax, len(others), len(others), (1.0 + 4.5 * len(others), 4.2))
    figure = figure_of(panels)
    from matplotlib.ticker import MaxNLocator

    for axes, other in zip(panels, others, strict=True):
        for k, group in enumerate(groups):
            members = [m for m in range(model.n_demos) if labels is None or labels[m] == group]
            dots = axes.scatter(
                points[members, 0],
                points[members, other],
                c=line_color(k) if values is None else values,
                cmap=None if values is None else colormap(),
                marker=MARKERS[(k + k // len(colors())) % len(MARKERS)],
                s=36,
                label=group,
            )
        label_axes(axes, names[0], names[other])
        # Numbers that vary little have many digits.
        axes.xaxis.set_major_locator(MaxNLocator(MAX_INTERVALS, steps=[1, 2, 2.5, 5, 10]))
        if other == model.n_styles:
            axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
            axes.set_ylim(-0.5, model.n_demos - 0.5)
    if values is not None:
        ticks = None if np.ptp(values) > 0 else values[:1]
        (name,) = model.context_names or [""]
        figure.colorbar(dots, ax=panels, label=name or "context", ticks=ticks)
    elif labels is not None:
        legend(panels[0], "outside right upper")
    return figure
