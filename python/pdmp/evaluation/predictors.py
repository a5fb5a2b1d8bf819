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

        def foresee(context: Array) -> Forecast:
            duration = model.predict(context).duration
            dt = interval(duration, recordings)
            position = model.rollout(context=context, dt=dt).position[:n_samples]
            return Forecast(position, duration, _variance(model, context, dt, n_samples))

        return foresee


def _variance(model: Model, context: Array, dt: float, n_samples: int) -> Array | None:
    """Return the variance of a predicted movement, which is linear in all but the duration."""
    predicted = model.predict(context)
    if predicted.covariance is None:
        return None
    tau = model.tau * predicted.duration / model.durations[model.nominal]
    if model.kind == "discrete":
        parts = [
            model.style_jacobian(dt, tau=tau, start=predicted.start),
            model.goal_jacobian(dt, tau=tau),
            model.start_jacobian(dt, tau=tau),
        ]
    else:
        parts = [model.style_jacobian(dt, tau=tau), model.anchor_jacobian(dt, tau=tau)]
    jacobian = np.concatenate(parts, axis=2)[:n_samples]
    return np.sum((jacobian @ predicted.covariance[:-1, :-1]) * jacobian, axis=2)


def periods(recordings: Recordings) -> dict[str, Array]:
    """Return what `fit` must be told of the durations."""
    return {"period": recordings.durations} if recordings.kind == "rhythmic" else {}


def interval(duration: float, recordings: Recordings) -> float:
    """Return the interval [s] between the C samples of a movement."""
    return duration / (recordings.n_samples - (recordings.kind == "discrete"))
