"""Mean and standard deviation of groups of demonstrations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pdmp._native import Demonstration
from pdmp.plot.canvas import GREY, dof_labels, figure_of, grid_panels, legend, line_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

PERCENT = np.arange(101.0)


def variation(
    demos: Sequence[Demonstration] | Mapping[str, Demonstration],
    labels: Sequence[str] | None = None,
    *,
    kind: Literal["discrete", "rhythmic"] | None = None,
    ax: Axes | ArrayLike | None = None,
) -> Figure:
    """Draws mean ± standard deviation of each group, over the percentage of movement or cycle.

    Without labels, there is one group, and each demonstration is drawn behind it.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration
        Demonstrations of the same degrees of freedom, such as cycles of
        `pdmp.preprocessing.cycles`.
    labels : sequence of str, optional
        Group of each demonstration: a person, a condition.
    kind : {"discrete", "rhythmic"}, optional
        A rhythmic demonstration is one cycle, which ends where it begins; by default that of the
        result of `pdmp.preprocessing.cycles`, otherwise a discrete one.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        No demonstrations, demonstrations of different degrees of freedom, or a number of labels
        other than theirs.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> low_or_high = ["low" if height < 0.3 else "high" for height in heights]
    >>> figure = pdmp.plot.variation(demos, low_or_high)
    """
    own = str(kind or getattr(demos, "kind", "discrete"))
    demos = list(demos.values() if isinstance(demos, Mapping) else demos)
    if not demos:
        raise ValueError("demos is empty: pass at least one demonstration")
    if labels is not None and len(labels) != len(demos):
        raise ValueError(
            f"labels has length {len(labels)}, expected {len(demos)}: one per demonstration"
        )
    n = demos[0].n_coordinates
    for m, demo in enumerate(demos):
        if demo.n_coordinates != n:
            raise ValueError(f"demo {m} has {demo.n_coordinates} columns, expected {n} as demo 0")
    traces = np.stack([_over_percent(demo, own) for demo in demos])
    names = demos[0].names or [f"y{d}" for d in range(n)]
    x = "cycle [%]" if own == "rhythmic" else "movement [%]"
    panels = grid_panels(dof_labels(names, demos[0].units or [""] * n), x, ax)
    groups = ["mean ± SD"] if labels is None else list(dict.fromkeys(labels))
    if labels is None:
        for axes, columns in zip(panels, traces.T, strict=True):
            axes.plot(PERCENT, columns, color=GREY, linewidth=0.6)
    for k, group in enumerate(groups):
        members = [labels is None or labels[m] == group for m in range(len(demos))]
        mean, deviation = traces[members].mean(axis=0), _deviation(traces[members])
        color, label = line_color(k), f"{group} (n = {sum(members)})"
        for axes, line, band in zip(panels, mean.T, deviation.T, strict=True):
            axes.plot(PERCENT, line, color=color, label=label)
            axes.fill_between(PERCENT, line - band, line + band, color=color, alpha=0.2, lw=0)
    panels[0].set_xlim(0, 100)
    legend(panels[0])
    return figure_of(panels)


def _deviation(traces: NDArray[Any]) -> NDArray[Any]:
    """Returns the standard deviation (101, D) of traces, 0 of a single one."""
    return traces.std(axis=0, ddof=1) if len(traces) > 1 else np.zeros_like(traces[0])


def _over_percent(demo: Demonstration, kind: str) -> NDArray[Any]:
    """Returns positions (101, D) at each percent of the duration or period."""
    position, n = demo.position, demo.n_samples
    share = np.linspace(0, 100, n) if demo.time is None else demo.time - demo.time[0]
    if kind == "rhythmic":
        step = np.diff(share).mean()
        share, position = np.append(share, share[-1] + step), np.vstack([position, position[:1]])
    share = 100 * share / share[-1]
    return np.stack([np.interp(PERCENT, share, column) for column in position.T], axis=1)
