"""What is evaluated: anything that learns from recordings and foresees a movement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from pdmp._native import Model, fit
from pdmp.evaluation.recordings import Array, Recordings


class Forecast(NamedTuple):
    """A movement foreseen for a context.

    Attributes
    ----------
    position : ndarray (C, D)
        Over normalised time, at the samples of `Recordings.sampled`.
    duration : float
        Duration, or period [s].
    variance : ndarray (C, D), optional
        Of each position of a new movement in this context, where the predictor knows it.
    """

    position: Array
    duration: float
    variance: Array | None = None


Foresee: TypeAlias = Callable[[Array], Forecast]


class Predictor(Protocol):
    """Something that learns to foresee movements.

    Examples
    --------
    >>> class First:
    ...     def fit(self, recordings):
    ...         position, duration = recordings.sampled[0], recordings.durations[0]
    ...         return lambda context: Forecast(position, duration)
    >>> pdmp.evaluate(demos, contexts=heights, predictors={"first": First()})
    """

    def fit(self, recordings: Recordings) -> Foresee:
        """Learn from recordings, and return what foresees a movement from a context (Q,)."""


class PDMP:
    """The primitive with its context map, learnt by `pdmp.fit` with the settings given.

    Parameters
    ----------
    **settings
        Arguments of `pdmp.fit` other than demonstrations, kind, contexts and period.
    """

    def __init__(self, **settings: Any) -> None:
        self.settings = settings

    def fit(self, recordings: Recordings) -> Foresee:
        """Learn a model, whose covariance of a prediction is carried over to positions."""
        model = fit(
            recordings.demos,
            kind=recordings.kind,
            contexts=recordings.contexts,
            period=recordings.periods,
            **self.settings,
        )
        n_samples = recordings.n_samples
        jacobian = _jacobian(model, recordings)

        def foresee(context: Array) -> Forecast:
            predicted = model.predict(context)
            dt = recordings.interval(predicted.duration)
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
    dt = recordings.interval(float(model.durations[model.nominal]))
    if model.kind == "discrete":
        parts = [model.style_jacobian(dt), model.goal_jacobian(dt), model.start_jacobian(dt)]
    else:
        parts = [model.style_jacobian(dt), model.anchor_jacobian(dt)]
    return np.concatenate(parts, axis=2)[: recordings.n_samples]
