"""Figures of movements: demonstrations and their reproductions, and blends of two conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pdmp._messages import counted
from pdmp._native import Conditions, Demonstration, Model, blend
from pdmp.plot.canvas import (
    GREY,
    colormap,
    draw_movement,
    figure_of,
    legend,
    line_color,
    movement_panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

N_SAMPLES = 500


def demonstrations(
    model: Model,
    demos: Sequence[Demonstration] | Mapping[str, Demonstration],
    *,
    labels: Sequence[str] | None = None,
    ax: Axes | ArrayLike | None = None,
) -> Figure:
    """Draws the demonstrations and their reproductions by the model, with a column per label.

    Rows are the degrees of freedom over time; with two of them, the first row is the path.

    Parameters
    ----------
    model : Model
        The primitive learnt from `demos`.
    demos : sequence or mapping of Demonstration
        The M demonstrations, in the order of the fit.
    labels : sequence of str, optional
        Label of each of the M demonstrations.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        A number of demonstrations or labels other than M, or demonstrations of other degrees of
        freedom than the model's.
    ImportError
        matplotlib is not installed.
    """
    demos = list(demos.values()) if isinstance(demos, Mapping) else demos
    check_demonstrations(model, demos)
    labels = [""] * len(demos) if labels is None else labels
    _check_number(model, "label", len(labels))
    titles = list(dict.fromkeys(labels))
    columns = movement_panels(model, titles, ax)
    for m, (demo, label) in enumerate(zip(demos, labels, strict=True)):
        panels = columns[titles.index(label)]
        rollout = model.rollout(model.conditions(m), dt=model.durations[m] / N_SAMPLES)
        time = sample_times(model, m, demo)
        draw_movement(panels, time, demo.position, color=GREY, linewidth=3, label="demonstration")
        draw_movement(
            panels,
            rollout.time,
            rollout.position,
            color=line_color(0),
            linewidth=0.9,
            label="reproduction",
        )
    legend(columns[0][0])
    return figure_of(columns[0])


def sample_times(model: Model, m: int, demo: Demonstration) -> NDArray[np.float64]:
    """Returns the times (T,) of the samples of demonstration m [s], from 0."""
    if demo.time is not None:
        time: NDArray[np.float64] = demo.time - demo.time[0]
        return time
    ends = model.kind == "discrete"
    return np.linspace(0, model.durations[m], demo.n_samples, endpoint=ends)


def check_demonstrations(model: Model, demos: Sequence[Demonstration]) -> None:
    """Rejects demonstrations that are not one per demonstration of the fit."""
    _check_number(model, "recording", len(demos))
    for m, demo in enumerate(demos):
        _check(model, m, demo)


def _check_number(model: Model, name: str, number: int) -> None:
    """Rejects another number of things than of demonstrations."""
    if number != model.n_demos:
        raise ValueError(
            f"{counted(number, name)} given, expected {model.n_demos}: "
            "one per demonstration of the fit, in its order"
        )


def _check(model: Model, m: int, demo: Demonstration) -> None:
    """Rejects a demonstration with other degrees of freedom than the model's."""
    if not isinstance(demo, Demonstration):
        raise ValueError(f"demo {m}: expected a pdmp.Demonstration, got {type(demo).__name__}")
    if demo.n_dofs != model.n_dofs:
        raise ValueError(f"demo {m}: expected {model.n_dofs} DoFs, found {demo.n_dofs}")
    if demo.rotations != model.rotations:
        raise ValueError(f"demo {m}: rotations {demo.rotations}, expected {model.rotations}")
    for kind, actual, expected in (
        ("names", demo.names, model.coordinate_names),
        ("units", demo.units, model.coordinate_units),
    ):
        if actual is not None and list(actual) != list(expected):
            raise ValueError(f"demo {m}: {kind} {actual}, expected those of the model, {expected}")


def fan(
    model: Model,
    a: Conditions,
    b: Conditions,
    *,
    n: int = 9,
    ends: tuple[str, str] = ("a", "b"),
    ax: Axes | ArrayLike | None = None,
) -> Figure:
    """Draws movements whose conditions are blended from `a` to `b`.

    Parameters
    ----------
    model : Model
        The primitive.
    a, b : Conditions
        Conditions of the first and the last movement, such as two of `Model.conditions`.
    n : int
        Number of movements, at least 2.
    ends : tuple of str
        Labels of `a` and `b`.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        Fewer than two movements, or conditions that `blend` or `Model.rollout` rejects.
    ImportError
        matplotlib is not installed.
    """
    if n < 2:
        raise ValueError(f"n = {n}: must be at least 2, the two ends")
    shares = np.linspace(0, 1, n)
    dt = model.durations.min() / N_SAMPLES
    rollouts = [model.rollout(blend(a, b, share), dt=dt) for share in shares]
    (panels,) = movement_panels(model, [""], ax)
    from matplotlib.cm import ScalarMappable

    mapping = ScalarMappable(cmap=colormap())
    mapping.set_clim(0, 1)
    for share, rollout in zip(shares, rollouts, strict=True):
        draw_movement(
            panels,
            rollout.time,
            rollout.position,
            color=mapping.to_rgba(share),
            linewidth=2.4 if share in (0, 1) else 1.2,
            marker="o",
            markevery=[0],
            markersize=4,
        )
    figure = figure_of(panels)
    bar = figure.colorbar(mapping, ax=panels, ticks=[0, 0.5, 1], aspect=40)
    bar.ax.set_yticklabels([ends[0], "half way", ends[1]])
    return figure
