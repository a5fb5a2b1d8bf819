"""Position, velocity and acceleration of generated movements, beside limits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._labels import DERIVATIVES
from pdmp._messages import check_type
from pdmp._native import Limits, Trajectory
from pdmp.plot.canvas import dof_labels, draw_panels, figure_of, label_axes, legend, line_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

EXPECTED = "a Trajectory, as Model.rollout returns it, or a list or dict of them"
TITLES = ("position", "velocity", "acceleration")


def motion(
    trajectories: Trajectory | Sequence[Trajectory] | Mapping[str, Trajectory],
    *,
    limits: Limits | None = None,
    ax: Axes | ArrayLike | None = None,
) -> Figure:
    """Draws position, velocity and acceleration over time, with a row per degree of freedom.

    Parameters
    ----------
    trajectories : Trajectory, sequence or mapping of Trajectory
        Rollouts, forecasts or fastest movements of the same degrees of freedom. The keys of a
        mapping are their labels.
    limits : Limits, optional
        Limits, which are drawn as dashed lines.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        No trajectory, trajectories of other degrees of freedom than the first one, or limits of
        another number of them.
    ImportError
        matplotlib is not installed.

    Examples
    --------
    >>> limits = pdmp.Limits(velocity=2.0, acceleration=10.0)
    >>> movements = {"free": model.rollout(), "fastest": model.fastest(limits)}
    >>> figure = pdmp.plot.motion(movements, limits=limits)
    """
    labelled = _labelled(trajectories)
    first = labelled[0][1]
    names = [first.names, first.dof_names, first.dof_names]
    units = [first.units, first.dof_units, first.dof_units]
    n_rows = len(first.names)
    size = 9.6, 1.7 * n_rows + 0.8
    panels = draw_panels(ax, n_rows * len(TITLES), len(TITLES), size, sharex=True)
    grid = np.reshape(np.array(panels, dtype=object), (n_rows, len(TITLES)))
    for column, (title, (_, per)) in enumerate(zip(TITLES, DERIVATIVES, strict=True)):
        own = [unit and unit + per for unit in units[column]]
        texts = dof_labels(names[column], own)
        for axes in grid[len(texts) :, column]:
            axes.set_axis_off()
        for axes, text in zip(grid[:, column], texts, strict=False):
            label_axes(axes, "", text)
        grid[len(texts) - 1, column].set_xlabel("time [s]")
        grid[len(texts) - 1, column].xaxis.set_tick_params(labelbottom=True)
        grid[0, column].set_title(title)
    for k, (label, trajectory) in enumerate(labelled):
        derivatives = (trajectory.position, trajectory.velocity, trajectory.acceleration)
        for column, values in enumerate(derivatives):
            for axes, trace in zip(grid[:, column], values.T, strict=False):
                axes.plot(trajectory.time, trace, color=line_color(k), label=label)
    if limits is not None:
        _draw_limits(grid.T, limits, len(first.dof_names))
    if any(label for label, _ in labelled):
        legend(panels[0])
    return figure_of(panels)


def _labelled(
    trajectories: Trajectory | Sequence[Trajectory] | Mapping[str, Trajectory],
) -> list[tuple[str, Trajectory]]:
    """Returns trajectories of the same degrees of freedom with their labels, "" without any."""
    if isinstance(trajectories, Trajectory):
        trajectories = [trajectories]
    check_type("trajectories", trajectories, Iterable, EXPECTED)
    if isinstance(trajectories, Mapping):
        labelled = [(str(label), trajectory) for label, trajectory in trajectories.items()]
    else:
        labelled = [("", trajectory) for trajectory in trajectories]
    if not labelled:
        raise ValueError("trajectories is empty: pass at least one")
    for k, (label, trajectory) in enumerate(labelled):
        name = f"trajectories[{label!r}]" if label else f"trajectories[{k}]"
        check_type(name, trajectory, Trajectory, EXPECTED)
    expected = labelled[0][1].names
    for k, (_, trajectory) in enumerate(labelled):
        if trajectory.names != expected:
            raise ValueError(
                f"trajectories[{k}] has the degrees of freedom {trajectory.names}, "
                f"expected those of the first one, {expected}"
            )
    return labelled


def _draw_limits(columns: NDArray[Any], limits: Limits, n_dofs: int) -> None:
    """Draws limits of position, velocity and acceleration, where there are any."""
    magnitudes = [limits.velocity, limits.acceleration]
    ends = [limits.position, *(None if m is None else (-m, m) for m in magnitudes)]
    for column, both in zip(columns, ends, strict=True):
        for bound in both or ():
            if len(bound) not in (1, n_dofs):
                raise ValueError(f"limits of {len(bound)} degrees of freedom, expected {n_dofs}")
            for axes, value in zip(column, np.broadcast_to(bound, n_dofs), strict=False):
                if np.isfinite(value):
                    axes.axhline(value, color=axes.title.get_color(), linewidth=0.8, linestyle="--")
