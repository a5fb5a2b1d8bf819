"""How far a primitive is from what it learnt from."""

import numpy as np

from pdmp._native import Demonstration, Model
from pdmp.conditions import as_demonstrated


def reproduction_error(model: Model, demo: Demonstration, m: int) -> float:
    """Return the RMSE of the reproduction of demonstration `m` over the range of its movement."""
    position = demo.position
    dt = model.durations[m] / (len(position) - (model.kind == "discrete"))
    made = model.rollout(**as_demonstrated(model, m), dt=dt).position[: len(position)]
    return float(np.sqrt(np.mean((made - position) ** 2)) / np.ptp(position, axis=0).max())
