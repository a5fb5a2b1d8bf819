"""Predictors of movements from contexts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias

from pdmp._native import fit
from pdmp.evaluation.recordings import Array, Recordings

BAND = 0.9
"""Probability of the prediction band."""
HALF_WIDTH = 1.6448536269514722
"""Half width of the band of a normal variable, in standard deviations."""


class Forecast(NamedTuple):
    """Predicted movement for a context.

    Attributes
    ----------
    position : ndarray (C, D)
        Positions at the C normalised times of `Recordings.sampled`.
    duration : float
        Duration, or period [s].
    variance : ndarray (C, D), optional
        Variance of each position of a new movement in this context; None if it is not predicted.
        With rotations, a column for each degree of freedom: those of a rotation are variances of
        the rotation vector [rad²] from the predicted orientation, in the frame that rotates.
    """

    position: Array
    duration: float
    variance: Array | None = None


Predict: TypeAlias = Callable[[Array], Forecast]


class Predictor(Protocol):
    """Learner of predictions of movements.

    Examples
    --------
    >>> class First:
    ...     def fit(self, recordings):
    ...         position, duration = recordings.sampled[0], recordings.durations[0]
    ...         return lambda context: pdmp.evaluation.Forecast(position, duration)
    >>> evaluation = pdmp.evaluate(demos, contexts=heights, predictors={"first": First()})
    >>> list(evaluation.scores)
    ['mean demonstration', 'first']
    """

    def fit(self, recordings: Recordings) -> Predict:
        """Learns from recordings; returns a function from a context (Q,) to a forecast."""


class PDMP:
    """Primitive with a context map, learnt by `pdmp.fit`.

    Parameters
    ----------
    **settings
        Arguments of `pdmp.fit` other than demonstrations, kind, contexts and period.
    """

    def __init__(self, **settings: Any) -> None:
        self.settings = settings

    def fit(self, recordings: Recordings) -> Predict:
        """Fits a model; the variance is that of its prediction band."""
        model = fit(
            recordings.demos,
            kind=recordings.kind,
            contexts=recordings.contexts.tolist(),
            period=recordings.periods,
            **self.settings,
        )
        n_samples = recordings.n_samples
        if recordings.rotations:
            model = model.in_frame("body")

        def predict(context: Array) -> Forecast:
            condition = context.tolist()
            predicted = model.predict(condition)
            dt = recordings.interval(predicted.duration)
            position = model.rollout(predicted.conditions, dt=dt).position[:n_samples]
            variance = None
            if predicted.covariance is not None:
                lower, upper = model.band(condition, level=BAND, dt=dt)
                variance = ((upper - lower)[:n_samples] / (2 * HALF_WIDTH)) ** 2
            return Forecast(position, predicted.duration, variance)

        return predict
