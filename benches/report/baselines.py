"""Baseline predictors that need other libraries: movement_primitives and scikit-learn."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from pdmp.evaluation import Components, Encoding, Forecast, LinearWeights, Predictor, Recordings
from pdmp.evaluation.predictors import Predict
from pdmp.evaluation.recordings import Array


def library_baselines() -> dict[str, Predictor]:
    """Returns the baselines of other libraries, by name."""
    return {
        "movement_primitives' ProMP": LinearWeights(PeerWeights()),
        "PCA, Gaussian processes": ProcessWeights(Components()),
    }


class PeerWeights:
    """Weights of a ProMP of the library movement_primitives."""

    def __init__(self, n_weights: int = 20) -> None:
        self.n_weights = n_weights

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Regresses each movement, and evaluates the trajectory of each unit weight."""
        try:
            from movement_primitives.promp import ProMP
        except ImportError:
            raise ImportError("movement_primitives is not installed") from None
        n_samples, n_dofs = recordings.sampled.shape[1:]
        time = np.linspace(0, 1, n_samples)
        peer = ProMP(n_dofs, self.n_weights)
        weights = np.array([peer.weights(time, movement) for movement in recordings.sampled])
        unit_weights = np.eye(weights.shape[1])
        basis = np.array(
            [peer.trajectory_from_weights(time, unit).ravel() for unit in unit_weights]
        )
        return weights, np.zeros(n_samples * n_dofs), basis


class ProcessWeights:
    """Weights of an encoding, each predicted by a Gaussian process of scikit-learn."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding

    def fit(self, recordings: Recordings) -> Predict:
        """Fits a process per weight, and one for the logarithm of the duration."""
        try:
            from sklearn.gaussian_process import GaussianProcessRegressor
            from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
        except ImportError:
            raise ImportError("scikit-learn is not installed") from None
        weights, offset, basis = self.encoding(recordings)
        known = recordings.numbers(recordings.contexts)
        centre, deviation = known.mean(axis=0), known.std(axis=0)
        unit = np.where(deviation > 0, deviation, 1)
        kernel = ConstantKernel() * RBF(np.ones(len(unit))) + WhiteKernel(0.1)

        def fitted(outputs: Array) -> Any:
            process = GaussianProcessRegressor(kernel, normalize_y=True)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # hyperparameters at their bounds are accepted
                return process.fit((known - centre) / unit, outputs)

        processes = [fitted(outputs) for outputs in weights.T]
        logarithm = fitted(np.log(recordings.durations))
        shape = recordings.sampled.shape[1:]

        def predict(context: Array) -> Forecast:
            query = (recordings.numbers(context[None]) - centre) / unit
            predicted = [process.predict(query, return_std=True) for process in processes]
            mean, deviation = np.array(predicted)[:, :, 0].T
            return Forecast(
                (offset + mean @ basis).reshape(shape),
                float(np.exp(logarithm.predict(query)[0])),
                (deviation**2 @ basis**2).reshape(shape),
            )

        return predict
