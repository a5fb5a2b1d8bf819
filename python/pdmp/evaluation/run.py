"""Evaluation of predictors on held-out demonstrations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pdmp._messages import check_function, check_number, check_type, quoted, value_error
from pdmp.evaluation.baselines import (
    Components,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
    RadialWeights,
)
from pdmp.evaluation.predictors import PDMP, Forecast, Predict, Predictor
from pdmp.evaluation.recordings import Demos, Kind, Recordings, recordings
from pdmp.evaluation.result import REFERENCE, Evaluation, score
from pdmp.evaluation.splits import Split, checked, held_out


def baselines() -> dict[str, Predictor]:
    """Returns the predictors that a primitive is compared with, by name.

    All maps from contexts are linear least squares.
    """
    return {
        REFERENCE: MeanDemonstration(),
        "nearest demonstration": NearestDemonstration(),
        "one demonstration, goal moved": MovedGoal(),
        "PCA, linear map": LinearWeights(Components()),
        "ProMP weights, linear map": LinearWeights(RadialWeights()),
    }


def over_styles(max_styles: int, **settings: Any) -> dict[str, Predictor]:
    """Returns primitives with J = 1 … `max_styles` style parameters, by name.

    Parameters
    ----------
    max_styles : int
        Largest J; at most the number of training demonstrations of the smallest split.
    **settings
        Other arguments of `pdmp.fit`.
    """
    return {f"PDMP, J = {j}": PDMP(n_styles=j, **settings) for j in range(1, max_styles + 1)}


def evaluate(
    demos: Demos,
    *,
    contexts: ArrayLike | Sequence[Sequence[float | str]] | None = None,
    predictors: Mapping[str, Predictor] | None = None,
    splits: Iterable[Sequence[object]] | None = None,
    kind: Kind | None = None,
    dt: float | None = None,
    period: ArrayLike | None = None,
    n_samples: int = 101,
    max_folds: int = 12,
    progress: Callable[[str, float], None] | None = None,
) -> Evaluation:
    """Measures the errors of predictions of held-out demonstrations by cross-validation.

    The error of the movement ŷ predicted for the context of a demonstration y is, over C samples of
    normalised time (of phase, if rhythmic) and all degrees of freedom,

        E = (1/C) Σ ‖ŷ(t) - y(t)‖²;

    that of a fold is the mean over its demonstrations. The difference of two orientations is the
    rotation vector [rad] from one to the other, whose length is the geodesic distance; E then adds
    squares of different units, which `Scores.distance` and `Scores.angle` separate. The relative
    error of the duration,
    |T̂ - T| / T, is reported separately. Demonstrations of equal context form one condition. Each
    condition is held out in turn. More than `max_folds` conditions are partitioned into
    `max_folds` folds of neighbours: the fold with the most conditions is halved along its longest
    side until there are enough. Contexts inside the convex hull of the training contexts are
    interpolation, all others extrapolation.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration or array_like (T_m, D), or array_like (M, T, D)
        The demonstrations, as for `pdmp.fit`.
    contexts : array_like, (M, Q) or (M,), or M lists of Q numbers and labels, or mapping, optional
        Context of each, as for `pdmp.fit`; by default those of the demonstrations.
    predictors : mapping of str to Predictor, optional
        Predictors by name; by default `evaluation.baselines()` and the primitive,
        `evaluation.PDMP()`. The mean demonstration, the reference of relative errors, is always
        added. A predictor that raises an ImportError is left out.
    splits : iterable of (train, test, reach), optional
        Indices of the training and test demonstrations, and "interpolation" or "extrapolation",
        in place of the folds.
    kind : str, optional
        "discrete", or "rhythmic": each demonstration is one cycle; by default that of cycles, or
        "discrete".
    dt : float, optional
        Sampling interval [s] of demonstrations without one.
    period : array_like, optional
        Periods [s] of time-stamped cycles, one or M.
    n_samples : int
        Number C of samples of each movement, interpolated linearly.
    max_folds : int
        Largest number of folds.
    progress : callable, optional
        Called with the name of the current predictor and the completed fraction of all folds of
        all predictors; an exception that it raises ends the evaluation.

    Returns
    -------
    Evaluation
        Errors of all predictors, which print as a table.

    Raises
    ------
    ValueError
        Contexts or splits that do not fit the demonstrations, fewer than two conditions, a label
        without a training demonstration in some split, another predictor called "mean
        demonstration", or a forecast of another shape or that is not finite.

    References
    ----------
    T. Matsubara, S.-H. Hyon, J. Morimoto (2011), Section 4.1.2 and Fig. 4,
    https://doi.org/10.1016/j.neunet.2011.02.004

    Examples
    --------
    >>> evaluation = pdmp.evaluate(demos, contexts=heights)
    >>> comparison = evaluation.compare("PDMP", "PCA, linear map")
    """
    if predictors is not None:
        check_type("predictors", predictors, Mapping, "a mapping of names to predictors")
        for name, predictor in predictors.items():
            if not callable(getattr(predictor, "fit", None)):
                found = f"predictors['{name}'] = {quoted(predictor)}"
                raise TypeError(f"{found}: expected an object with a method fit")
    if splits is not None:
        check_type("splits", splits, Iterable, "a list of (train, test, reach)")
    if progress is not None:
        check_function("progress", progress)
    check_number("max_folds", max_folds)
    own = kind or cast(Kind, getattr(demos, "kind", "discrete"))
    data = recordings(demos, contexts, kind=own, dt=dt, period=period, n_samples=n_samples)
    if splits is None:
        folds = held_out(data.numbers(data.contexts), max_folds)
    else:
        folds = checked(splits, data.n_demos)
    _check_labels(data, folds)
    selected = baselines() | {"PDMP": PDMP()} if predictors is None else dict(predictors)
    if not isinstance(selected.get(REFERENCE, MeanDemonstration()), MeanDemonstration):
        raise value_error(f"predictors: '{REFERENCE}' is always included: rename yours")
    evaluated = {REFERENCE: MeanDemonstration()} | selected
    forecasts, skipped = {}, {}
    for k, (name, predictor) in enumerate(evaluated.items()):

        def report(share: float, k: int = k, name: str = name) -> None:
            if progress is not None:
                progress(name, (k + share) / len(evaluated))

        try:
            forecasts[name] = _forecasts(name, predictor, data, folds, report)
        except ImportError as reason:
            skipped[name] = str(reason)
    scores = {name: score(data, folds, made) for name, made in forecasts.items()}
    return Evaluation(data, tuple(folds), evaluated, forecasts, scores, skipped)


def _forecasts(
    name: str,
    predictor: Predictor,
    data: Recordings,
    splits: Sequence[Split],
    report: Callable[[float], None],
) -> list[list[Forecast]]:
    """Returns the forecasts of a predictor per split; equal training sets are learnt from once."""
    learnt: dict[bytes, Predict] = {}
    forecasts = []
    for k, split in enumerate(splits):
        report(k / len(splits))
        key = split.train.tobytes()
        if key not in learnt:
            learnt[key] = predictor.fit(data[split.train])
        forecasts.append([learnt[key](data.contexts[m]) for m in split.test])
        for forecast in forecasts[-1]:
            _check_forecast(name, forecast, data)
    return forecasts


def _check_forecast(name: str, forecast: Forecast, data: Recordings) -> None:
    if not isinstance(forecast, Forecast):
        raise value_error(
            f"predictors: '{name}' returns a {type(forecast).__name__}, expected an "
            "evaluation.Forecast"
        )
    for kind in ("position", "variance"):
        values = getattr(forecast, kind)
        shape = (data.sampled if kind == "position" else data.dofs).shape[1:]
        if kind == "variance" and values is None:
            continue
        if np.shape(values) != shape:
            raise value_error(
                f"predictors: '{name}' predicts {kind}s of shape {np.shape(values)}, "
                f"expected (C, D) = {shape}"
            )
        if not np.isfinite(values).all():
            raise value_error(f"predictors: '{name}' predicts a {kind} that is not finite")
    for column in data.rotations:
        norms = np.linalg.norm(forecast.position[:, column : column + 4], axis=1)
        if (off := np.abs(norms - 1).max()) > 1e-3:
            raise value_error(
                f"predictors: '{name}' predicts quaternions whose norms deviate from 1 by {off:.3g}"
            )


def _check_labels(data: Recordings, splits: Sequence[Split]) -> None:
    """Rejects a held-out label that no training demonstration has."""
    for q in (q for q, labels in enumerate(data.labels) if labels):
        for split in splits:
            column = data.contexts[:, q]
            if unseen := sorted(set(column[split.test]) - set(column[split.train])):
                raise value_error(
                    f'contexts[:, {q}]: "{unseen[0]}" has no training demonstration: demonstrate '
                    "it in several conditions, or pass splits= that train on some of them"
                )
