"""Predictors, tried on demonstrations that they were not shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pdmp._messages import value_error
from pdmp.evaluation.baselines import (
    Components,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
    PeerWeights,
    ProcessWeights,
    RadialWeights,
)
from pdmp.evaluation.predictors import PDMP, Forecast, Foresee, Predictor
from pdmp.evaluation.recordings import Demos, Kind, Recordings, recordings
from pdmp.evaluation.result import REFERENCE, Evaluation, score
from pdmp.evaluation.splits import Split, checked, held_out


def baselines() -> dict[str, Predictor]:
    """Returns the predictors that a primitive is compared with, by name.

    All maps from contexts are linear least squares but those of the Gaussian processes, for which
    scikit-learn must be installed, as must movement_primitives for its ProMP; `Evaluation.left_out`
    tells which is not.
    """
    return {
        REFERENCE: MeanDemonstration(),
        "nearest demonstration": NearestDemonstration(),
        "one demonstration, goal moved": MovedGoal(),
        "PCA, linear map": LinearWeights(Components()),
        "ProMP weights, linear map": LinearWeights(RadialWeights()),
        "movement_primitives' ProMP": LinearWeights(PeerWeights()),
        "PCA, Gaussian processes": ProcessWeights(Components()),
    }


def over_styles(most: int, **settings: Any) -> dict[str, Predictor]:
    """Returns primitives with J = 1 … `most` style parameters, by name.

    Parameters
    ----------
    most : int
        The largest J; at most the demonstrations that a fold leaves to learn from.
    **settings
        Other arguments of `pdmp.fit`.
    """
    return {f"PDMP, J = {j}": PDMP(n_styles=j, **settings) for j in range(1, most + 1)}


def evaluate(
    demos: Demos,
    *,
    contexts: ArrayLike | Sequence[Sequence[float | str]] | None = None,
    predictors: Mapping[str, Predictor] | None = None,
    splits: Iterable[Sequence[object]] | None = None,
    kind: Kind = "discrete",
    dt: float | None = None,
    period: ArrayLike | None = None,
    n_samples: int = 101,
    max_folds: int = 12,
    progress: Callable[[str, float], None] | None = None,
) -> Evaluation:
    """Learns from some demonstrations, and measures the errors of predictions of the others.

    The error of a movement ŷ foreseen for the context of a demonstration y is, over C samples of
    normalised time (of phase, if rhythmic) and all degrees of freedom together,

        E = (1/C) Σ ‖ŷ(t) - y(t)‖²;

    that of a fold is the mean over its demonstrations. How far off the duration is counts apart, as
    |T̂ - T| / T. Demonstrations of equal context are one condition. Each condition is held out in
    turn; where there are more than `max_folds`, each fold of neighbouring ones: the fold of most
    conditions is halved along its longest side until there are so many. What lies inside the convex
    hull of the contexts learnt from is interpolation, of one context their range; the rest is
    extrapolation.

    Parameters
    ----------
    demos : sequence or mapping of Demonstration or array_like (T_m, D), or array_like (M, T, D)
        The demonstrations, as for `pdmp.fit`.
    contexts : array_like (M, Q), or M lists of Q numbers and labels, optional
        The condition of each; those that the demonstrations hold by default.
    predictors : mapping of str to Predictor, optional
        What is tried, by name; by default `evaluation.baselines()` and the primitive,
        `evaluation.PDMP()`. The mean demonstration is always tried, for the others to be compared
        with.
    splits : iterable of (train, test, reach), optional
        Indices to learn from, indices to foresee, and "interpolation" or "extrapolation", in place
        of the folds.
    kind : str
        "discrete", or "rhythmic": each demonstration is one cycle.
    dt : float, optional
        Sampling interval [s] of demonstrations that hold none.
    period : array_like, optional
        Periods [s] of time-stamped cycles, one or M.
    n_samples : int
        C, the samples over each movement, linear between those recorded.
    max_folds : int
        The most folds that conditions are parted into.
    progress : callable, optional
        Told the predictor that is tried next, and the share of all folds of all of them that is
        done; what it raises ends the evaluation.

    Returns
    -------
    Evaluation
        Printed, it is a table.

    Raises
    ------
    ValueError
        Contexts or splits that do not fit the demonstrations, fewer than two conditions, a label
        that a split holds out altogether, a predictor that takes the name of the mean
        demonstration, or a forecast of another shape, or not finite.

    References
    ----------
    T. Matsubara, S.-H. Hyon, J. Morimoto (2011), Section 4.1.2 and Fig. 4,
    https://doi.org/10.1016/j.neunet.2011.02.004

    Examples
    --------
    >>> found = pdmp.evaluate(demos, contexts=heights)
    >>> print(found)
    >>> found.compare("PDMP", "PCA, linear map")
    """
    read = recordings(demos, contexts, kind=kind, dt=dt, period=period, n_samples=n_samples)
    if splits is None:
        folds = held_out(read.numbers(read.contexts), max_folds)
    else:
        folds = checked(splits, read.n_demos)
    _check_labels(read, folds)
    chosen = baselines() | {"PDMP": PDMP()} if predictors is None else dict(predictors)
    if not isinstance(chosen.get(REFERENCE, MeanDemonstration()), MeanDemonstration):
        raise value_error(f"predictors: '{REFERENCE}' is always tried: give yours another name")
    tried = {REFERENCE: MeanDemonstration()} | chosen
    forecasts, left_out = {}, {}
    for k, (name, predictor) in enumerate(tried.items()):

        def tell(share: float, k: int = k, name: str = name) -> None:
            if progress is not None:
                progress(name, (k + share) / len(tried))

        try:
            forecasts[name] = _foreseen(name, predictor, read, folds, tell)
        except ImportError as reason:
            left_out[name] = str(reason)
    scores = {name: score(read, folds, made) for name, made in forecasts.items()}
    return Evaluation(read, tuple(folds), tried, forecasts, scores, left_out)


def _foreseen(
    name: str,
    predictor: Predictor,
    read: Recordings,
    splits: Sequence[Split],
    tell: Callable[[float], None],
) -> list[list[Forecast]]:
    """Returns the predictions of a predictor, split by split; it learns once from the same rows."""
    learnt: dict[bytes, Foresee] = {}
    forecasts = []
    for k, split in enumerate(splits):
        tell(k / len(splits))
        key = split.train.tobytes()
        if key not in learnt:
            learnt[key] = predictor.fit(read[split.train])
        forecasts.append([learnt[key](read.contexts[m]) for m in split.test])
        for forecast in forecasts[-1]:
            _check_forecast(name, forecast, read.sampled.shape[1:])
    return forecasts


def _check_forecast(name: str, forecast: Forecast, shape: tuple[int, ...]) -> None:
    if not isinstance(forecast, Forecast):
        raise value_error(
            f"predictors: '{name}' foresees a {type(forecast).__name__}, expected an "
            "evaluation.Forecast"
        )
    for kind in ("position", "variance"):
        values = getattr(forecast, kind)
        if kind == "variance" and values is None:
            continue
        if np.shape(values) != shape:
            raise value_error(
                f"predictors: '{name}' foresees {kind}s of shape {np.shape(values)}, "
                f"expected (C, D) = {shape}"
            )
        if not np.isfinite(values).all():
            raise value_error(f"predictors: '{name}' foresees a {kind} that is not finite")


def _check_labels(read: Recordings, splits: Sequence[Split]) -> None:
    """Raises an error for a held-out label that no training condition has."""
    for q in (q for q, labels in enumerate(read.labels) if labels):
        for split in splits:
            column = read.contexts[:, q]
            if unseen := sorted(set(column[split.test]) - set(column[split.train])):
                raise value_error(
                    f'contexts[:, {q}]: "{unseen[0]}" is held out altogether, and nothing tells of '
                    "it: show it in several conditions, or pass splits= that leave some of it"
                )
