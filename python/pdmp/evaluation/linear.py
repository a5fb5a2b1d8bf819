"""The linear map from contexts that the baselines share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pdmp.evaluation.recordings import Array, Recordings


class LinearMap:
    """Least squares of minimum norm from contexts (M, Q) to outputs (M, P)."""

    def __init__(self, contexts: Array, outputs: Array) -> None:
        self.centre = contexts.mean(axis=0)
        offsets = contexts - self.centre
        self.mean = outputs.mean(axis=0)
        self.slopes, _, rank, _ = np.linalg.lstsq(offsets, outputs - self.mean)
        self.inverse_scatter = np.linalg.pinv(offsets.T @ offsets)
        self.n_demos = len(contexts)
        self.freedom = self.n_demos - 1 - int(rank)

    def __call__(self, context: Array) -> Array:
        """Return the outputs (..., P) for contexts (..., Q)."""
        return np.asarray(self.mean + (context - self.centre) @ self.slopes)

    def spread(self, context: Array) -> float:
        """Return the variance of a new output for a context, over the sum of squared residuals."""
        offset = context - self.centre
        return float(1 + 1 / self.n_demos + offset @ self.inverse_scatter @ offset) / self.freedom


def lasting(recordings: Recordings) -> Callable[[Array], float]:
    """Return what foresees the duration [s] from a context; its logarithm is linear in that."""
    logarithm = LinearMap(recordings.contexts, np.log(recordings.durations)[:, None])
    return lambda context: float(np.exp(logarithm(context)[0]))
