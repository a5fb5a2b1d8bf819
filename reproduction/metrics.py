"""Error of reproduced demonstrations."""

import numpy as np

import pdmp


def reproduction_error(model: pdmp.Model, demo: pdmp.Demonstration, m: int) -> float:
    """Returns the RMSE of the reproduction of demonstration `m`, over the range of its movement.

    The mean is over samples and degrees of freedom; the range is the largest of any degree of
    freedom.
    """
    position = demo.position
    dt = model.durations[m] / (len(position) - (model.kind == "discrete"))
    reproduced = model.rollout(model.conditions(m), dt=dt).position[: len(position)]
    return float(np.sqrt(np.mean((reproduced - position) ** 2)) / np.ptp(position, axis=0).max())
