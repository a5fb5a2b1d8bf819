"""Predicts style, goal and duration of a reach from the height of the obstacle."""

import numpy as np

import pdmp


def reach(height: float) -> np.ndarray:
    """Returns a reach over an obstacle of this height [m] to a position behind it, shape (T, 2)."""
    s = np.linspace(0, 1, 101)
    ramp = s**3 * (10 - 15 * s + 6 * s**2)
    return np.column_stack([0.4 * ramp, height / 2 * ramp + 64 * height * (s * (1 - s)) ** 3])


heights = [0.05, 0.10, 0.20, 0.25]
demos = [
    pdmp.Demonstration(reach(height), dt=0.01 + 0.02 * height, context=[height])
    for height in heights
]
model = pdmp.fit(demos)

unseen = 0.15
prediction = model.predict([unseen])
conditions = prediction.conditions
print(f"style {np.round(conditions.style, 3)}, goal {np.round(conditions.goal, 3)} m")
print(f"duration {prediction.duration:.2f} s")
trajectory = model.rollout(context=[unseen])
wanted = reach(unseen)[:, 1].max()
print(f"peak {trajectory.position[:, 1].max():.3f} m, wanted {wanted:.3f} m")
