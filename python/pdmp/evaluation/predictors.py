"""What is evaluated: anything that learns from recordings and foresees a movement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias

from pdmp._native import fit
from pdmp.evaluation.recordings import Array, Recordings

BAND = 0.9
WIDTH = 1.6448536269514722  # deviations from the mean of a normal variable to the edge of the band


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
        """Learns from recordings, and returns a map from a context (Q,) to a movement."""


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
        """Learns a model, whose band gives the variance."""
        model = fit(
            recordings.demos,
            kind=recordings.kind,
            contexts=recordings.contexts.tolist(),
            period=recordings.periods,
            **self.settings,
        )
        n_samples = recordings.n_samples

        def foresee(context: Array) -> Forecast:
            condition = context.tolist()
            predicted = model.predict(condition)
            dt = recordings.interval(predicted.duration)
            position = model.rollout(context=condition, dt=dt).position[:n_samples]
            variance = None
            if predicted.covariance is not None:
                lower, upper = model.band(condition, level=BAND, dt=dt)
                variance = ((upper - lower)[:n_samples] / (2 * WIDTH)) ** 2
            return Forecast(position, predicted.duration, variance)

        return foresee
