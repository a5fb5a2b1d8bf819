"""Phase portrait of a rhythmic primitive."""

from __future__ import annotations

from math import ceil, pi
from typing import TYPE_CHECKING, Any

from pdmp._native import Model
from pdmp.plot.canvas import (
    GREY,
    dof_labels,
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

N_SAMPLES = 500
N_PERIODS = 4


def phase_portrait(model: Model, *, ax: Axes | ArrayLike | None = None) -> Figure:
    """Draws velocity over position: the limit cycles, and the convergence of a movement from rest.

    Parameters
    ----------
    model : Model
        A rhythmic primitive.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        A discrete primitive.
    ImportError
        matplotlib is not installed.
    """
    if model.kind != "rhythmic":
        raise ValueError(f"model: a {model.kind} primitive has no limit cycle: pass a rhythmic one")
    n_columns = min(model.n_dofs, 4)
    size = max(3.6 * n_columns, 5.5), 3.4 * ceil(model.n_dofs / n_columns) + 0.5
    panels = draw_panels(ax, model.n_dofs, n_columns, size)
    cycles = [
        model.rollout(model.conditions(m), dt=model.durations[m] / N_SAMPLES)
        for m in range(model.n_demos)
    ]
    centre = model.anchors[model.nominal]
    period = 2 * pi * model.tau
    converging = model.rollout(
        start=centre, velocity=0 * centre, duration=N_PERIODS * period, dt=period / N_SAMPLES
    )
    orbit: dict[str, Any] = {"color": GREY, "linewidth": 1, "label": "limit cycles"}
    start: dict[str, Any] = {
        "color": line_color(0),
        "linewidth": 1.4,
        "marker": "o",
        "markevery": [0],
    }
    start["label"] = "from rest at the anchor"
    paths = [*((cycle, orbit) for cycle in cycles), (converging, start)]
    labels = dof_labels(model.names, model.units)
    for dof, (axes, label, unit) in enumerate(zip(panels, labels, model.units, strict=True)):
        for path, style in paths:
            axes.plot(path.position[:, dof], path.velocity[:, dof], **style)
        label_axes(axes, label, f"velocity [{unit}/s]" if unit else "velocity [per s]")
    legend(panels[0])
    return figure_of(panels)
