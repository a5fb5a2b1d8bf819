"""Predictors, tried on demonstrations that they were not shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pdmp._native import Demonstration
from pdmp.evaluation.baselines import (
    Components,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
    ProcessWeights,
    RadialWeights,
)
from pdmp.evaluation.predictors import PDMP, Foresee, Forecast, Predictor
from pdmp.evaluation.recordings import Kind, Recordings, recordings
from pdmp.evaluation.result import REFERENCE, Evaluation, score
from pdmp.evaluation.splits import Split, checked, held_out


def baselines() -> dict[str, Predictor]:
    """Return what a primitive is measured against, by name."""
    return {
        REFERENCE: MeanDemonstration(),
        "nearest demonstration": NearestDemonstration(),
        "one demonstration, goal moved": MovedGoal(),
        "PCA, linear map": LinearWeights(Components()),
        "ProMP weights, linear map": LinearWeights(RadialWeights()),
        "PCA, Gaussian processes": ProcessWeights(Components()),
    }


def over_styles(most: int, **settings: Any) -> dict[str, Predictor]:
    """Return primitives with J = 1 … `most` style parameters, by name."""
    return {f"PDMP, J = {j}": PDMP(n_styles=j, **settings) for j in range(1, most + 1)}


def evaluate(
    demos: Sequence[Demonstration] | Sequence[ArrayLike] | ArrayLike,
    *,
    contexts: ArrayLike | None = None,
    predictors: Mapping[str, Predictor] | None = None,
    splits: Iterable[Sequence[object]] | None = None,
    kind: Kind = "discrete",
    dt: float | None = None,
    period: ArrayLike | None = None,
    n_samples: int = 101,
    max_folds: int = 12,
) -> Evaluation:
    """Learn from some demonstrations, and measure how well the others are foreseen."""
    read = recordings(demos, contexts, kind=kind, dt=dt, period=period, n_samples=n_samples)
    if splits is None:
        chosen = held_out(read.contexts, max_folds)
    else:
        chosen = checked(splits, read.n_demos)
    if predictors is None:
        predictors = baselines() | {"PDMP": PDMP()}
    tried = {REFERENCE: MeanDemonstration()} | dict(predictors)
    forecasts, left_out = {}, {}
    for name, predictor in tried.items():
        try:
            forecasts[name] = _foreseen(predictor, read, chosen)
        except ImportError as reason:
            left_out[name] = str(reason)
    scores = {name: score(read, chosen, made) for name, made in forecasts.items()}
    return Evaluation(read, tuple(chosen), tried, forecasts, scores, left_out)


def _foreseen(
    predictor: Predictor, read: Recordings, splits: Sequence[Split]
) -> list[list[Forecast]]:
    """Return what a predictor foresees, split by split; it learns once from the same rows."""
    learnt: dict[bytes, Foresee] = {}
    forecasts = []
    for split in splits:
        key = np.sort(split.train).tobytes()
        if key not in learnt:
            learnt[key] = predictor.fit(read[split.train])
        forecasts.append([learnt[key](read.contexts[m]) for m in split.test])
    return forecasts
