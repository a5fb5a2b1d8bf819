"""Inserts pauses into movements that are recognised."""

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from report.observed import sampled

PAUSES = (0.3, 1.0)  # s
PLACES = (0.3, 0.6)  # shares of the movement before the pause
NOISE = 0.002  # of the largest range, while it pauses
STOP = 0.9  # probability from which on the clock rests
LATER = 0.2  # of the duration after the pause


def one(
    model: pdmp.Model, prior: pdmp.Prior, demo: Demonstration, rng: np.random.Generator
) -> np.ndarray:
    """Recognises one movement with and without a pause.

    Returns
    -------
    numpy.ndarray, (8,)
        Root mean square errors of the rest at the end of the pause, with and without it, and the
        same later; errors of the arrival with the pause, in durations, at both places; the time
        after which it was found, or NaN; and whether the movement without it was stopped.
    """
    time, position = sampled(demo)
    last = int(np.searchsorted(time, rng.uniform(*PLACES) * time[-1]))
    interval = np.median(np.diff(time))
    n = max(2, int(rng.uniform(*PAUSES) / interval))
    noise = NOISE * np.ptp(position, axis=0).max() * rng.standard_normal((n, position.shape[1]))
    held = position[last] + noise
    later = min(last + int(LATER * time[-1] / interval), len(time) - 5)
    pause = n * interval
    times = np.concatenate(
        [time[: last + 1], time[last] + interval * np.arange(1, n + 1), time[last + 1 :] + pause]
    )
    positions = np.concatenate([position[: last + 1], held, position[last + 1 :]])
    rest, arrivals, stopped = watched(
        model.recogniser(prior), times, positions, (last + n, later + n)
    )
    plain, _, falsely = watched(model.recogniser(prior), time, position, (last, later))
    found = np.flatnonzero(stopped[last : last + n + 1])
    return np.array(
        [
            *(error for pair in zip(rest, plain, strict=True) for error in pair),
            *(abs(arrival - times[-1]) / time[-1] for arrival in arrivals),
            times[last + found[0]] - time[last] if len(found) else np.nan,
            falsely.any(),
        ]
    )


def watched(
    recogniser: pdmp.Recogniser, time: np.ndarray, position: np.ndarray, marks: tuple[int, int]
) -> tuple[list[float], list[float], np.ndarray]:
    """Returns the errors of the rest and the arrivals at two samples, and where it was stopped."""
    rest, arrivals, stopped = [], [], []
    for k in range(len(time)):
        recogniser.update(time[k], position[k])
        estimate = recogniser.estimate()
        stopped.append(estimate.stopped > STOP)
        if k in marks:
            ahead = recogniser.continuation(time[k + 1 :])
            rest.append(float(np.sqrt(np.mean((ahead.position - position[k + 1 :]) ** 2))))
            arrivals.append(estimate.arrival)
    return rest, arrivals, np.array(stopped)


def table(scores: np.ndarray) -> str:
    """Returns the means of the results (N, 8) of `one`."""
    means = scores.mean(axis=0)
    found = scores[~np.isnan(scores[:, 6]), 6]
    header = ["", "at the end of the pause", "later"]
    lines = [
        ["recogniser", f"{means[0]:.3f}", f"{means[2]:.3f}"],
        ["without the pause", f"{means[1]:.3f}", f"{means[3]:.3f}"],
        ["error of the arrival, in durations", f"{means[4]:.3f}", f"{means[5]:.3f}"],
    ]
    after = f" after {np.median(found):.2f} s (median)" if len(found) else ""
    return (
        f"{markdown_table(header, lines, n_names=1)}\n\nStopped: {len(found)} of {len(scores)} "
        f"pauses{after}; {scores[:, 7].sum():.0f} of {len(scores)} movements without one."
    )
