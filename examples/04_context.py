"""Predicts style, goal and duration of a reach from the height of the obstacle."""

import matplotlib.pyplot as plt
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
expected = reach(unseen)
print(f"peak {trajectory.position[:, 1].max():.3f} m, expected {expected[:, 1].max():.3f} m")

figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for demo, height in zip(demos, heights, strict=True):
    axes.plot(*demo.position.T, color="0.7")
    axes.annotate(f"{height} m", demo.position[55], color="0.4", fontsize=8)
axes.plot(*trajectory.position.T, label=f"predicted for {unseen} m")
axes.plot(*expected.T, ":", color="black", label="expected")
axes.set(xlabel="x [m]", ylabel="z [m]", title="Demonstrations (grey) and a height between them")
axes.legend()
figure.savefig("04_context.png", dpi=150)
