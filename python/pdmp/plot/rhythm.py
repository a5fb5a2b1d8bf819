"""Phase portrait of a rhythmic primitive."""

from __future__ import annotations

from math import ceil, pi
from typing import TYPE_CHECKING, Any

from pdmp._native import Model
from pdmp.plot.canvas import BLUE, GREY, dof_labels, ensure_figure, label_axes, legend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

N_SAMPLES = 500
N_PERIODS = 4


def phase_portrait(model: Model, *, figure: Figure | None = None) -> Figure:
    """Draws velocity over position: the limit cycles, and the convergence of a movement from rest.

    Parameters
    ----------
    model : Model
        A rhythmic primitive.
    figure : matplotlib.figure.Figure, optional
        Figure to draw on; by default a new one.

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
    n_rows = ceil(model.n_dofs / n_columns)
    figure = ensure_figure(figure, max(3.6 * n_columns, 5.5), 3.4 * n_rows + 0.5)
    panels = figure.subplots(n_rows, n_columns, squeeze=False).ravel()
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
    start: dict[str, Any] = {"color": BLUE, "linewidth": 1.4, "marker": "o", "markevery": [0]}
    start["label"] = "from rest at the anchor"
    paths = [*((cycle, orbit) for cycle in cycles), (converging, start)]
    labels = dof_labels(model.names, model.units)
    for dof, (axes, label, unit) in enumerate(zip(panels, labels, model.units, strict=False)):
        for path, style in paths:
            axes.plot(path.position[:, dof], path.velocity[:, dof], **style)
        label_axes(axes, label, f"velocity [{unit}/s]" if unit else "velocity [per s]")
    for axes in panels[model.n_dofs :]:
        axes.set_axis_off()
    legend(figure, panels[0])
    return figure
