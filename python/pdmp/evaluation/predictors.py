"""What is evaluated: anything that learns from recordings and foresees a movement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from pdmp._native import Model, fit
from pdmp.evaluation.recordings import Array, Recordings


class Forecast(NamedTuple):
    """A movement foreseen for a context."""

    position: Array  # over normalised time (C, D)
    duration: float  # [s], or the period
    variance: Array | None = None  # of each position (C, D), where it is known


Foresee: TypeAlias = Callable[[Array], Forecast]


class Predictor(Protocol):
    """Something that learns to foresee movements."""

    def fit(self, recordings: Recordings) -> Foresee:
        """Learn from recordings, and return what foresees a movement from a context (Q,)."""


class PDMP:
    """The primitive with its context map, learnt by `pdmp.fit` with the settings given."""

    def __init__(self, **settings: Any) -> None:
        self.settings = settings

    def fit(self, recordings: Recordings) -> Foresee:
        """Learn a model, whose covariance of a prediction is carried over to positions."""
        model = fit(
            recordings.demos,
            kind=recordings.kind,
            contexts=recordings.contexts,
            **periods(recordings),
            **self.settings,
        )
        n_samples = recordings.n_samples
        jacobian = _jacobian(model, recordings)

        def foresee(context: Array) -> Forecast:
            predicted = model.predict(context)
            dt = interval(predicted.duration, recordings)
            position = model.rollout(context=context, dt=dt).position[:n_samples]
            variance = None
            if predicted.covariance is not None:
                spread = jacobian @ predicted.covariance[:-1, :-1]
                variance = np.sum(spread * jacobian, axis=2)
            return Forecast(position, predicted.duration, variance)

        return foresee


def _jacobian(model: Model, recordings: Recordings) -> Array:
    """Return the derivatives (C, D, P) by all that a context predicts but the duration.

    Over normalised time they are the same for every duration.
    """
    dt = interval(float(model.durations[model.nominal]), recordings)
    if model.kind == "discrete":
        parts = [model.style_jacobian(dt), model.goal_jacobian(dt), model.start_jacobian(dt)]
    else:
        parts = [model.style_jacobian(dt), model.anchor_jacobian(dt)]
    return np.concatenate(parts, axis=2)[: recordings.n_samples]


def periods(recordings: Recordings) -> dict[str, Array]:
    """Return what `fit` must be told of the durations."""
    return {"period": recordings.durations} if recordings.kind == "rhythmic" else {}


def interval(duration: float, recordings: Recordings) -> float:
    """Return the interval [s] between the C samples of a movement."""
    return duration / (recordings.n_samples - (recordings.kind == "discrete"))
