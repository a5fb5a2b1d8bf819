"""Figures of the style space: how many dimensions it needs, and where the demonstrations lie."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pdmp._native import Model
from pdmp.plot._canvas import BLUE, GREY, MARKERS, ORANGE, PALETTE, canvas, dress, gradient

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def spectrum(model: Model, *, figure: Figure | None = None) -> Figure:
    """Draws the share of each singular value in their sum, and how many were kept.

    Parameters
    ----------
    model : Model
        The primitive.
    figure : matplotlib.figure.Figure, optional
        Where to draw.

    Raises
    ------
    ImportError
        matplotlib is not installed.
    """
    figure = canvas(figure, 7.0, 4.0)
    from matplotlib.ticker import MaxNLocator

    total = model.singular_values.sum() or 1.0
    share = 100 * model.singular_values / total
    number = np.arange(1, len(share) + 1)
    kept = model.n_styles
    axes = figure.subplots()
    axes.bar(number[:kept], share[:kept], color=BLUE, label=f"kept: J = {kept}")
    if kept < len(share):
        axes.bar(number[kept:], share[kept:], color=GREY, label="left out")
    axes.plot(number, share.cumsum(), "o-", color=ORANGE, markersize=4, label="sum so far")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlim(0.4, len(share) + 0.6)
    axes.set_ylim(0, 105)
    truncated = f"{100 * model.truncation_error:.2g} % of the targets' RMS left out"
    title = f"J = {kept} of {model.n_demos}: {truncated}"
    dress(axes, "singular value, of those computed", "share of their sum [%]", title)
    axes.legend(frameon=False, loc="center right")
    return figure


def styles(
    model: Model, labels: Sequence[str] | None = None, *, figure: Figure | None = None
) -> Figure:
    """Draws the style of each demonstration, in the planes of the first three style parameters.

    Without labels, the context serves where that is a single one, or the colour tells it where
    it is a single number.

    Parameters
    ----------
    model : Model
        The primitive.
    labels : sequence of str, optional
        What each of the M demonstrations shows.
    figure : matplotlib.figure.Figure, optional
        Where to draw.

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
    # The index of the demonstration takes the place of a second style parameter.
    points = np.column_stack([model.styles, np.arange(model.n_demos)])
    names = [f"style $s_{{{j + 1}}}$" for j in range(model.n_styles)] + ["demonstration"]
    others = [1, 2] if model.n_styles > 2 else [1]
    figure = canvas(figure, 1.0 + 4.5 * len(others), 4.2)
    groups = list(dict.fromkeys(labels or [""]))
    values = None
    if isinstance(context, np.ndarray) and context.shape[1] == 1:
        values = context[:, 0]
    panels = figure.subplots(1, len(others), squeeze=False)[0]
    for axes, other in zip(panels, others, strict=True):
        for k, group in enumerate(groups):
            chosen = [m for m in range(model.n_demos) if labels is None or labels[m] == group]
            dots = axes.scatter(
                points[chosen, 0],
                points[chosen, other],
                c=PALETTE[k % len(PALETTE)] if values is None else values,
                cmap=None if values is None else gradient(),
                marker=MARKERS[(k + k // len(PALETTE)) % len(MARKERS)],
                s=36,
                label=group,
            )
        dress(axes, names[0], names[other])
    if values is not None:
        figure.colorbar(dots, ax=list(panels), label="context")
    elif labels is not None:
        handles, texts = panels[0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="outside right upper", frameon=False)
    return figure
