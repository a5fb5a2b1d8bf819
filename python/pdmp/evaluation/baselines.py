"""Baseline predictors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from pdmp._native import ContextMap, factorise, fit
from pdmp.evaluation.predictors import Forecast, Predict
from pdmp.evaluation.recordings import Array, Recordings


class MeanDemonstration:
    """Mean of the demonstrations, of rotations their Karcher mean, for every context."""

    def fit(self, recordings: Recordings) -> Predict:
        """Averages the demonstrations, and the logarithms of their durations."""
        mean, m = recordings.mean, recordings.n_demos
        variance = recordings.dofs.var(axis=0, ddof=1) * (1 + 1 / m) if m > 1 else None
        duration = float(np.exp(np.log(recordings.durations).mean()))
        return lambda _: Forecast(mean, duration, variance)


class NearestDemonstration:
    """Demonstration whose context, over the standard deviation of the contexts, is nearest."""

    def fit(self, recordings: Recordings) -> Predict:
        """Stores the demonstrations."""
        known = recordings.numbers(recordings.contexts)
        deviation = known.std(axis=0)
        unit = np.where(deviation > 0, deviation, 1)

        def predict(context: Array) -> Forecast:
            distance = np.sum(((known - recordings.numbers(context[None])) / unit) ** 2, axis=1)
            near = np.argmin(distance)
            return Forecast(recordings.sampled[near], float(recordings.durations[near]))

        return predict


class MovedGoal:
    """Primitive of one demonstration; a linear map of the context moves its ends, or its anchor."""

    def fit(self, recordings: Recordings) -> Predict:
        """Fits a primitive to the demonstration of median duration."""
        nominal = np.argsort(recordings.durations, kind="stable")[recordings.n_demos // 2]
        alone = recordings[np.array([nominal])]
        model = fit(alone.demos, kind=alone.kind, period=alone.periods)
        discrete = recordings.kind == "discrete"
        dofs = recordings.dofs
        ends = [dofs[:, -1], dofs[:, 0]] if discrete else [dofs.mean(axis=1)]
        rows = [slice(-1, None), slice(0, 1)] if discrete else [slice(0, 1)]
        end_map = ContextMap(recordings.contexts.tolist(), np.concatenate(ends, axis=1), "linear")
        duration_at = _duration_map(recordings)

        def predict(context: Array) -> Forecast:
            duration = duration_at(context)
            predicted = np.split(end_map.predict([context.tolist()])[0], len(ends), axis=1)
            positions = [recordings.positions(*end)[0] for end in zip(predicted, rows, strict=True)]
            names = ("goal", "start") if discrete else ("anchor",)
            rollout = model.rollout(
                **dict(zip(names, positions, strict=True)),
                tau=model.tau * duration / model.durations[0],
                dt=recordings.interval(duration),
            )
            return Forecast(rollout.position[: recordings.n_samples], duration)

        return predict


class Encoding(Protocol):
    """Linear encoding of movements by K weights: y = offset + weightsᵀ basis."""

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Returns weights (M, K), offset (C·D,) and basis (K, C·D)."""


class Components:
    """Principal components of the trajectories of all degrees of freedom together.

    Parameters
    ----------
    share : float
        Share of the sum of singular values that the components exceed.
    """

    def __init__(self, share: float = 0.9) -> None:
        self.share = share

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Factorises the differences from the mean."""
        joint = recordings.dofs.reshape(recordings.n_demos, -1)
        mean = joint.mean(axis=0)
        factors = factorise(joint - mean, singular_value_share=self.share)
        return factors.styles, mean, factors.basis_targets


class RadialWeights:
    """Weights of a ProMP: ridge regression on normalised radial basis functions, per DoF."""

    def __init__(self, n_weights: int = 20, ridge: float = 1e-6) -> None:
        self.n_weights = n_weights
        self.ridge = ridge

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Regresses each movement; the functions are periodic for rhythmic movements."""
        discrete, n = recordings.kind == "discrete", recordings.n_samples
        phase = np.linspace(0, 1, n, endpoint=discrete)
        centres = np.linspace(0, 1, self.n_weights, endpoint=discrete)
        width = 1 / (self.n_weights - discrete)
        distance = phase[:, None] - centres
        if not discrete:
            distance -= np.round(distance)
        radial = np.exp(-0.5 * (distance / width) ** 2)
        radial /= radial.sum(axis=1, keepdims=True)
        gram = radial.T @ radial + self.ridge * np.eye(self.n_weights)
        weights: Array = np.linalg.solve(gram, radial.T @ recordings.dofs)  # (M, N, D)
        n_dofs = weights.shape[2]
        basis = np.kron(radial.T, np.eye(n_dofs))
        return weights.reshape(recordings.n_demos, -1), np.zeros(n * n_dofs), basis


class LinearWeights:
    """Weights of an encoding, predicted by a linear map of the context."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding

    def fit(self, recordings: Recordings) -> Predict:
        """Encodes the movements and fits the map; the variance is propagated from the weights."""
        weights, offset, basis = self.encoding(recordings)
        weight_map = ContextMap(recordings.contexts.tolist(), weights, "linear")
        duration_at = _duration_map(recordings)
        shape = recordings.dofs.shape[1:]

        def predict(context: Array) -> Forecast:
            mean, covariance = weight_map.predict([context.tolist()])
            variance = None
            if covariance is not None:
                variance = np.sum(basis * (covariance[0] @ basis), axis=0).reshape(shape)
            position = recordings.positions((offset + mean[0] @ basis).reshape(shape))
            return Forecast(position, duration_at(context), variance)

        return predict


def _duration_map(recordings: Recordings) -> Callable[[Array], float]:
    """Returns the duration [s] as a function of the context, linear in its logarithm."""
    logarithms = np.log(recordings.durations)[:, None]
    logarithm_map = ContextMap(recordings.contexts.tolist(), logarithms, "linear")
    return lambda context: float(np.exp(logarithm_map.predict([context.tolist()])[0][0, 0]))
