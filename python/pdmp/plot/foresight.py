"""Figures of an evaluation: how well movements held out are foreseen."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from pdmp.plot._canvas import BLUE, GREY, PALETTE, canvas, dof_labels, dress, legend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pdmp.evaluation import Evaluation

MOST_DOFS = 6


def prediction_error(
    evaluation: Evaluation, *, unit: str = "", figure: Figure | None = None
) -> Figure:
    """Draws E over the number of style parameters J, interpolation and extrapolation apart.

    Every `PDMP` with `n_styles` among the predictors is a point: mean and standard deviation over
    the folds, as in Fig. 4a of the paper. Other predictors are levels.

    Parameters
    ----------
    evaluation : Evaluation
        What `pdmp.evaluate` returned, such as for the predictors of `evaluation.over_styles`.
    unit : str
        Unit of the positions, such as "rad".
    figure : matplotlib.figure.Figure, optional
        Where to draw.

    Raises
    ------
    ValueError
        No `PDMP` with `n_styles`.
    ImportError
        matplotlib is not installed.
    """
    # Who draws no evaluation does not import it.
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
    figure = canvas(figure, 4.6 * len(reaches), 3.8)
    from matplotlib.ticker import MaxNLocator

    panels = figure.subplots(1, len(reaches), squeeze=False, sharey=True)[0]
    for axes, reach in zip(panels, reaches, strict=True):
        found = [evaluation.summary(name, reach) for name in styles]
        deviation = np.nan_to_num([each.deviation for each in found])
        axes.errorbar(
            list(styles.values()),
            [each.error for each in found],
            deviation,
            color=BLUE,
            marker="o",
            markersize=4,
            capsize=3,
            label="PDMP",
        )
        levels = [name for name in evaluation.scores if name not in styles]
        for name, color in zip(levels, cycle(PALETTE[:0:-1])):
            level = evaluation.summary(name, reach).error
            axes.axhline(level, color=color, linestyle="--", linewidth=1, label=name)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        dress(axes, "number of style parameters J", "", reach)
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel(f"E [{unit}²]" if unit else "E")
    legend(figure, panels[0])
    return figure


def held_out(
    evaluation: Evaluation, predictor: str, *, unit: str = "", figure: Figure | None = None
) -> Figure:
    """Draws predictions with their 90 % band, and the demonstrations held out.

    One column for interpolation and one for extrapolation, each with the first condition of the
    fold of median E; one row per degree of freedom, of more than six those that vary most.

    Parameters
    ----------
    evaluation : Evaluation
        What `pdmp.evaluate` returned.
    predictor : str
        Whose forecasts.
    unit : str
        Unit of the positions, such as "rad", in place of those of the demonstrations.
    figure : matplotlib.figure.Figure, optional
        Where to draw.

    Raises
    ------
    ValueError
        A predictor that was not evaluated.
    ImportError
        matplotlib is not installed.
    """
    # Who draws no evaluation does not import it.
    from pdmp.evaluation.predictors import BAND, WIDTH

    score = evaluation.score(predictor)
    recordings = evaluation.recordings
    units = [unit] * len(recordings.names) if unit else recordings.units
    labels = dof_labels(recordings.names, units)
    spread = np.ptp(recordings.sampled, axis=(0, 1))
    dofs = np.sort(np.argsort(-spread, kind="stable")[:MOST_DOFS])
    whole = "duration" if recordings.kind == "discrete" else "period"
    reaches = evaluation.reaches()
    figure = canvas(figure, 4.2 * len(reaches), 1.7 * len(dofs) + 0.8)
    grid = figure.subplots(len(dofs), len(reaches), squeeze=False, sharex=True, sharey="row")
    at = np.linspace(0, 1, recordings.n_samples, endpoint=recordings.kind == "discrete")
    for column, reach in zip(grid.T, reaches, strict=True):
        rows = [k for k, split in enumerate(evaluation.splits) if split.reach == reach]
        middle = rows[int(np.argsort(score.error[rows], kind="stable")[(len(rows) - 1) // 2])]
        test, made = evaluation.splits[middle].test, evaluation.forecasts[predictor][middle][0]
        context = recordings.contexts[test[0]]
        shown = test[(recordings.contexts[test] == context).all(axis=1)]
        for axes, dof in zip(column, dofs, strict=True):
            for trace in recordings.sampled[shown, :, dof]:
                axes.plot(at, trace, color=GREY, linewidth=1.5, label="held out")
            mean = made.position[:, dof]
            if made.variance is not None:
                half = WIDTH * np.sqrt(made.variance[:, dof])
                band = {"color": BLUE, "alpha": 0.15, "linewidth": 0}
                axes.fill_between(at, mean - half, mean + half, label=f"{BAND:.0%} band", **band)
            axes.plot(at, mean, color=BLUE, linewidth=1.2, label="foreseen")
            dress(axes, "", labels[dof])
        shown_as = (v if isinstance(v, str) else f"{v:.3g}" for v in context)
        column[0].set_title(f"{reach}, context {' '.join(shown_as)}")
        column[-1].set_xlabel(f"share of the {whole}")
    legend(figure, grid[0, 0])
    return figure
