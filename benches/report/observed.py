"""Movements that are shown in part, and simple predictors of their rest."""

from collections.abc import Iterator, Sequence
from time import perf_counter

import numpy as np

import pdmp
from pdmp import Demonstration
from report.promp import ProMP

SHARES = (0.1, 0.3, 0.5, 0.7)
MAX_FOLDS = 10
BAND = 1.6449  # half-width of a band of 90 %, in standard deviations
PHASES = np.linspace(0, 1, 201)


def folds(n_demos: int, groups: Sequence[str] | None) -> list[list[int]]:
    """Returns the demonstrations to leave out together: tenths, or those of each group."""
    if groups is not None:
        return [
            [m for m, group in enumerate(groups) if group == name] for name in sorted({*groups})
        ]
    n = min(MAX_FOLDS, n_demos)
    return [list(range(first, n_demos, n)) for first in range(n)]


def times(recogniser: pdmp.Recogniser, demos: list[Demonstration]) -> tuple[float, float]:
    """Returns the median times of a sample and of an estimate in µs."""
    updates, estimates = [], []
    for demo in demos:
        recogniser.reset()
        for time, position in zip(demo.time[:80], demo.position, strict=False):
            begin = perf_counter()
            recogniser.update(time, position)
            middle = perf_counter()
            recogniser.estimate()
            updates.append(middle - begin)
            estimates.append(perf_counter() - middle)
    return 1e6 * float(np.median(updates)), 1e6 * float(np.median(estimates))


def sampled(demo: Demonstration) -> tuple[np.ndarray, np.ndarray]:
    """Returns times from 0 and positions of a movement, fewer than 120 of them."""
    step = max(1, demo.n_samples // 60)
    return demo.time[::step] - demo.time[0], demo.position[::step]


def shown(
    recognisers: Sequence[pdmp.Recogniser],
    time: np.ndarray,
    position: np.ndarray,
    duration: float,
) -> Iterator[int]:
    """Shows a movement to recognisers, and yields the number of samples seen at each share."""
    seen = 0
    for share in SHARES:
        n = max(2, int(np.searchsorted(time, share * duration)) + 1)
        for k in range(seen, n):
            for recogniser in recognisers:
                recogniser.update(time[k], position[k])
        seen = n
        yield n


class Simple:
    """Predictors without a model of movements."""

    def __init__(self, demos: list[Demonstration]) -> None:
        self.demos = np.array([resampled(demo.time, demo.position) for demo in demos])
        self.promp = ProMP(self.demos)
        self.duration = np.exp(np.mean([np.log(demo.time[-1] - demo.time[0]) for demo in demos]))

    def predict(self, time: np.ndarray, seen: np.ndarray, duration: float) -> list[np.ndarray]:
        """Returns the rest of a movement (T - n, D) by each predictor."""
        n, phases = len(seen), time / duration
        distances = [np.nansum((at(demo, phases[:n]) - seen) ** 2) for demo in self.demos]
        mean = self.demos.mean(axis=0)
        nearest = at(self.demos[np.argmin(distances)], phases[n:])
        gaussian = self.gaussian(phases, seen)
        promp = self.promp.conditioned(phases[:n], seen, phases[n:])
        return [nearest, at(mean, time[n:] / self.duration), gaussian, promp]

    def gaussian(self, phases: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Conditions one Gaussian over whole movements, of the rank of the demonstrations."""
        n = len(seen)
        movements = np.array([at(demo, phases) for demo in self.demos])
        mean = movements.mean(axis=0)
        deviations = (movements - mean) / np.sqrt(len(movements))
        before, after = deviations[:, :n].reshape(len(movements), -1), deviations[:, n:]
        noise = 0.02 * movements.std() + 1e-12
        kernel = before @ before.T / noise**2 + np.eye(len(movements))
        weights = np.linalg.solve(kernel, before @ (seen - mean[:n]).ravel() / noise**2)
        return mean[n:] + np.tensordot(weights, after, 1)


def resampled(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Returns a movement at even phases."""
    return at(position, PHASES, (time - time[0]) / (time[-1] - time[0]))


def at(position: np.ndarray, phases: np.ndarray, own: np.ndarray = PHASES) -> np.ndarray:
    """Interpolates a movement (S, D) at phases; past its end it rests."""
    return np.stack([np.interp(phases, own, column) for column in position.T], axis=1)
