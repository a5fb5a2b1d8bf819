"""What a primitive is measured against, each in a few lines."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from pdmp._native import ContextMap, factorise, fit
from pdmp.evaluation.predictors import Forecast, Foresee
from pdmp.evaluation.recordings import Array, Recordings


class MeanDemonstration:
    """The mean of the demonstrations, whatever the context."""

    def fit(self, recordings: Recordings) -> Foresee:
        """Averages them, and their durations by logarithm."""
        mean, m = recordings.sampled.mean(axis=0), recordings.n_demos
        variance = recordings.sampled.var(axis=0, ddof=1) * (1 + 1 / m) if m > 1 else None
        duration = float(np.exp(np.log(recordings.durations).mean()))
        return lambda _: Forecast(mean, duration, variance)


class NearestDemonstration:
    """The demonstration of the nearest context, over the contexts' deviations."""

    def fit(self, recordings: Recordings) -> Foresee:
        """Keeps them all."""
        shown = recordings.numbers(recordings.contexts)
        deviation = shown.std(axis=0)
        unit = np.where(deviation > 0, deviation, 1)

        def foresee(context: Array) -> Forecast:
            distance = np.sum(((shown - recordings.numbers(context[None])) / unit) ** 2, axis=1)
            near = np.argmin(distance)
            return Forecast(recordings.sampled[near], float(recordings.durations[near]))

        return foresee


class MovedGoal:
    """A primitive of the nominal demonstration alone; a linear map moves its ends or centre."""

    def fit(self, recordings: Recordings) -> Foresee:
        """Learns from the demonstration of median duration."""
        nominal = np.argsort(recordings.durations, kind="stable")[recordings.n_demos // 2]
        alone = recordings[np.array([nominal])]
        model = fit(alone.demos, kind=alone.kind, period=alone.periods)
        discrete = recordings.kind == "discrete"
        sampled = recordings.sampled
        ends = [sampled[:, -1], sampled[:, 0]] if discrete else [sampled.mean(axis=1)]
        moved = ContextMap(recordings.contexts.tolist(), np.concatenate(ends, axis=1), "linear")
        duration_of = _lasting(recordings)

        def foresee(context: Array) -> Forecast:
            duration = duration_of(context)
            places = np.split(moved.predict([context.tolist()])[0][0], len(ends))
            names = ("goal", "start") if discrete else ("anchor",)
            made = model.rollout(
                **dict(zip(names, places, strict=True)),  # type: ignore[arg-type]
                tau=model.tau * duration / model.durations[0],
                dt=recordings.interval(duration),
            )
            return Forecast(made.position[: recordings.n_samples], duration)

        return foresee


class Encoding(Protocol):
    """A way to write movements as weights."""

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Returns weights (M, K), and offset (C·D,) and basis (K, C·D) that give movements back."""


class Components:
    """Principal components of the joint trajectories, as many as make a share of the spectrum."""

    def __init__(self, spectrum: float = 0.9) -> None:
        self.spectrum = spectrum

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Factorises what differs from the mean."""
        joint = recordings.sampled.reshape(recordings.n_demos, -1)
        mean = joint.mean(axis=0)
        factors = factorise(joint - mean, singular_value_share=self.spectrum)
        return factors.styles, mean, factors.basis


class RadialWeights:
    """Weights of a ProMP: ridge regression on normalised radial functions, by DoF."""

    def __init__(self, n_weights: int = 20, ridge: float = 1e-6) -> None:
        self.n_weights = n_weights
        self.ridge = ridge

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Regresses each movement; of a cycle, the functions are periodic."""
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
        weights: Array = np.linalg.solve(gram, radial.T @ recordings.sampled)  # (M, N, D)
        n_dofs = weights.shape[2]
        basis = np.kron(radial.T, np.eye(n_dofs))
        return weights.reshape(recordings.n_demos, -1), np.zeros(n * n_dofs), basis


class PeerWeights:
    """Weights of a ProMP, as the library movement_primitives has them."""

    def __init__(self, n_weights: int = 20) -> None:
        self.n_weights = n_weights

    def __call__(self, recordings: Recordings) -> tuple[Array, Array, Array]:
        """Regresses each movement, and predicts each weight."""
        try:
            from movement_primitives.promp import ProMP
        except ImportError:
            raise ImportError("movement_primitives is not installed") from None
        n_samples, n_dofs = recordings.sampled.shape[1:]
        time = np.linspace(0, 1, n_samples)
        peer = ProMP(n_dofs, self.n_weights)
        weights = np.array([peer.weights(time, movement) for movement in recordings.sampled])
        units = np.eye(weights.shape[1])
        basis = np.array([peer.trajectory_from_weights(time, unit).ravel() for unit in units])
        return weights, np.zeros(n_samples * n_dofs), basis


class LinearWeights:
    """Weights of each movement, and a linear map that foresees them."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding

    def fit(self, recordings: Recordings) -> Foresee:
        """Encodes and regresses; the variance is that of the weights."""
        weights, offset, basis = self.encoding(recordings)
        chosen = ContextMap(recordings.contexts.tolist(), weights, "linear")
        duration_of = _lasting(recordings)
        shape = recordings.sampled.shape[1:]

        def foresee(context: Array) -> Forecast:
            mean, covariance = chosen.predict([context.tolist()])
            variance = None
            if covariance is not None:
                variance = np.sum(basis * (covariance[0] @ basis), axis=0).reshape(shape)
            position = (offset + mean[0] @ basis).reshape(shape)
            return Forecast(position, duration_of(context), variance)

        return foresee


class ProcessWeights:
    """Weights of each movement, each foreseen by a Gaussian process of its own (scikit-learn)."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding

    def fit(self, recordings: Recordings) -> Foresee:
        """Encodes, and learns one process per weight and one for the duration's logarithm."""
        try:
            from sklearn.gaussian_process import GaussianProcessRegressor
            from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
        except ImportError:
            raise ImportError("scikit-learn is not installed") from None
        weights, offset, basis = self.encoding(recordings)
        shown = recordings.numbers(recordings.contexts)
        centre, deviation = shown.mean(axis=0), shown.std(axis=0)
        unit = np.where(deviation > 0, deviation, 1)
        kernel = ConstantKernel() * RBF(np.ones(len(unit))) + WhiteKernel(0.1)

        def learnt(outputs: Array) -> Any:
            process = GaussianProcessRegressor(kernel, normalize_y=True)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # hyperparameters at their bounds serve too
                return process.fit((shown - centre) / unit, outputs)

        processes = [learnt(outputs) for outputs in weights.T]
        logarithm = learnt(np.log(recordings.durations))
        shape = recordings.sampled.shape[1:]

        def foresee(context: Array) -> Forecast:
            at = (recordings.numbers(context[None]) - centre) / unit
            found = [process.predict(at, return_std=True) for process in processes]
            mean, deviation = np.array(found)[:, :, 0].T
            return Forecast(
                (offset + mean @ basis).reshape(shape),
                float(np.exp(logarithm.predict(at)[0])),
                (deviation**2 @ basis**2).reshape(shape),
            )

        return foresee


def _lasting(recordings: Recordings) -> Callable[[Array], float]:
    """Returns a map from context to duration [s], whose logarithm is linear in the context."""
    logarithms = np.log(recordings.durations)[:, None]
    chosen = ContextMap(recordings.contexts.tolist(), logarithms, "linear")
    return lambda context: float(np.exp(chosen.predict([context.tolist()])[0][0, 0]))
