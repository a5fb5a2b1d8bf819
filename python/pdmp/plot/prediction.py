"""Figures of an evaluation: prediction errors, and predictions of held-out demonstrations."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from pdmp._labels import join_label
from pdmp.plot.canvas import (
    GREY,
    colors,
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

    from pdmp.evaluation import Evaluation

MAX_DOFS = 6
MAX_LINEAR_RATIO = 20.0
"""Largest ratio of mean errors that a linear axis shows."""


def prediction_error(
    evaluation: Evaluation, *, unit: str = "", ax: Axes | ArrayLike | None = None
) -> Figure:
    """Draws the mean squared error E over the number of style parameters J, with a panel per reach.

    E = (1/T) Σ‖ŷ(t) − y(t)‖², over normalised time. Every `PDMP` with `n_styles` among the
    predictors is a point: mean and standard deviation over the folds, as in Fig. 4a of the paper.
    Other predictors are horizontal lines. The axis of E is logarithmic if the largest mean is more
    than twenty times the smallest.

    Parameters
    ----------
    evaluation : Evaluation
        Result of `pdmp.evaluate`, such as for the predictors of `evaluation.over_styles`.
    unit : str
        Unit of the positions, such as "rad", instead of that of the demonstrations.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        No `PDMP` with `n_styles`.
    ImportError
        matplotlib is not installed.
    """
    # Other figures do not import the evaluation.
    from pdmp.evaluation import PDMP

    styles = {}
    for name, predictor in evaluation.predictors.items():
        if isinstance(predictor, PDMP) and predictor.settings.get("n_styles") is not None:
            styles[name] = predictor.settings["n_styles"]
    if not styles:
        raise ValueError(
            f"evaluation: no PDMP with n_styles among {', '.join(evaluation.predictors)}: "
            "evaluate those of over_styles(J)"
        )
    reaches = evaluation.reaches()
    size = 4.6 * len(reaches), 3.8
    panels = draw_panels(ax, len(reaches), len(reaches), size, sharey=True)
    from matplotlib.ticker import MaxNLocator

    for axes, reach in zip(panels, reaches, strict=True):
        means = [evaluation.summary(name, reach) for name in styles]
        deviation = np.nan_to_num([mean.deviation for mean in means])
        axes.errorbar(
            list(styles.values()),
            [mean.error for mean in means],
            deviation,
            color=line_color(0),
            marker="o",
            markersize=4,
            capsize=3,
            label="PDMP",
        )
        levels = [name for name in evaluation.scores if name not in styles]
        for name, color in zip(levels, cycle(colors()[:0:-1])):
            level = evaluation.summary(name, reach).error
            axes.axhline(level, color=color, linestyle="--", linewidth=1, label=name)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        label_axes(axes, "number of style parameters J", "", reach)
    means = [evaluation.summary(name, reach) for name in evaluation.scores for reach in reaches]
    errors = [mean.error for mean in means]
    smallest = min((error for error in errors if error > 0), default=0.0)
    if max(errors) > MAX_LINEAR_RATIO * smallest > 0:
        for axes in panels:
            axes.set_yscale("log")
        # The deviation may exceed the mean.
        panels[0].set_ylim(bottom=smallest / 3)
    else:
        panels[0].set_ylim(bottom=0)
    units = set(evaluation.recordings.units)
    unit = unit or (units.pop() if len(units) == 1 else "")
    panels[0].set_ylabel(join_label("mean squared error E", unit and f"{unit}²"))
    legend(panels[0])
    return figure_of(panels)


def held_out(
    evaluation: Evaluation, predictor: str, *, unit: str = "", ax: Axes | ArrayLike | None = None
) -> Figure:
    """Draws predictions with their 90 % band, and the held-out demonstrations.

    A column per reach has the first condition of the fold of median E; a row per degree of freedom,
    at most the six that vary most. Those of a rotation are rotation vectors from the prediction.

    Parameters
    ----------
    evaluation : Evaluation
        Result of `pdmp.evaluate`.
    predictor : str
        Name of the predictor.
    unit : str
        Unit of the positions, such as "rad", instead of those of the demonstrations.
    ax : matplotlib.axes.Axes or array of Axes, optional
        The panels, or one in whose place they are drawn; by default those of a new figure.

    Raises
    ------
    ValueError
        A predictor that is not in the evaluation.
    ImportError
        matplotlib is not installed.
    """
    # Other figures do not import the evaluation.
    from pdmp.evaluation.predictors import BAND, HALF_WIDTH

    score = evaluation.score(predictor)
    recordings = evaluation.recordings
    units = [unit] * len(recordings.names) if unit else recordings.units
    labels = dof_labels(recordings.names, units)
    spread = np.ptp(recordings.dofs, axis=(0, 1))
    dofs = np.sort(np.argsort(-spread, kind="stable")[:MAX_DOFS])
    duration = "duration" if recordings.kind == "discrete" else "period"
    reaches = evaluation.reaches()
    n, size = len(reaches), (4.2 * len(reaches), 1.7 * len(dofs) + 0.8)
    panels = draw_panels(ax, n * len(dofs), n, size, sharex=True, sharey="row")
    phase = np.linspace(0, 1, recordings.n_samples, endpoint=recordings.kind == "discrete")
    for k, reach in enumerate(reaches):
        column = panels[k::n]
        rows = [i for i, split in enumerate(evaluation.splits) if split.reach == reach]
        median = rows[int(np.argsort(score.error[rows], kind="stable")[(len(rows) - 1) // 2])]
        test, forecast = evaluation.splits[median].test, evaluation.forecasts[predictor][median][0]
        context = recordings.contexts[test[0]]
        repeated = test[(recordings.contexts[test] == context).all(axis=1)]
        predicted = recordings.relative(forecast.position, forecast.position)
        traces = [recordings.relative(forecast.position, y) for y in recordings.sampled[repeated]]
        for axes, dof in zip(column, dofs, strict=True):
            for trace in traces:
                axes.plot(phase, trace[:, dof], color=GREY, linewidth=3, label="held out")
            mean = predicted[:, dof]
            if forecast.variance is not None:
                half = HALF_WIDTH * np.sqrt(forecast.variance[:, dof])
                band: dict[str, Any] = {"color": line_color(0), "alpha": 0.15, "linewidth": 0}
                axes.fill_between(phase, mean - half, mean + half, label=f"{BAND:.0%} band", **band)
            axes.plot(phase, mean, color=line_color(0), linewidth=0.9, label="predicted")
            label_axes(axes, "", labels[dof])
        values = (v if isinstance(v, str) else f"{v:.3g}" for v in context)
        column[0].set_title(f"{reach}, context {' '.join(values)}")
        column[-1].set_xlabel(f"share of the {duration}")
    legend(panels[0])
    return figure_of(panels)
