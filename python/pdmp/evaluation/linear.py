"""The linear map from contexts that the baselines share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pdmp.evaluation.recordings import Array, Recordings


class LinearMap:
    """Least squares of minimum norm from contexts (M, Q) to outputs (M, P).

    The norm is taken of contexts scaled to unit size, as in the primitive's own map.
    """

    def __init__(self, contexts: Array, outputs: Array) -> None:
        self.centre, self.mean = contexts.mean(axis=0), outputs.mean(axis=0)
        offsets = contexts - self.centre
        sizes = np.abs(offsets).max(axis=0)
        unit = np.where(sizes > 0, sizes, 1)
        self.inverse, _, rank, _ = np.linalg.lstsq(offsets / unit, np.eye(len(offsets)))
        self.inverse /= unit[:, None]
        self.slopes = self.inverse @ (outputs - self.mean)
        self.freedom = len(offsets) - 1 - int(rank)

    def __call__(self, context: Array) -> Array:
        """Return the outputs (..., P) for contexts (..., Q)."""
        return np.asarray(self.mean + (context - self.centre) @ self.slopes)

    def spread(self, context: Array) -> float:
        """Return the variance of a new output for a context, over the sum of squared residuals."""
        influence = (context - self.centre) @ self.inverse
        return float(1 + 1 / len(influence) + influence @ influence) / self.freedom


def lasting(recordings: Recordings) -> Callable[[Array], float]:
    """Return what foresees the duration [s] from a context; its logarithm is linear in that."""
    logarithm = LinearMap(recordings.contexts, np.log(recordings.durations)[:, None])
    return lambda context: float(np.exp(logarithm(context)[0]))
