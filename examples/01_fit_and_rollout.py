"""Fits one primitive to five reaches over obstacles of different heights, and computes rollouts."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s


def reach(height: float, duration: float) -> np.ndarray:
    """Returns a minimum-jerk reach of 0.4 m with a bump of this height [m], shape (T, 2)."""
    s = np.arange(0, duration + DT / 2, DT) / duration
    forward = 0.4 * s**3 * (10 - 15 * s + 6 * s**2)
    upward = 64 * height * (s * (1 - s)) ** 3
    return np.column_stack([forward, upward])


heights = [0.05, 0.10, 0.15, 0.20, 0.25]
demos = [
    pdmp.Demonstration(reach(height, 1.0 + height), dt=DT, names=["x", "z"]) for height in heights
]
model = pdmp.fit(demos, n_styles=2)
print(model)

# Styles are points in a vector space; this is the mean of two of them.
style = (model.styles[0] + model.styles[4]) / 2
between = model.rollout(style=style, dt=DT)
peak = between.position[:, 1].max()
print(f"style {np.round(style, 3)}: {len(between.time)} samples, peak {peak:.3f} m")

# The nominal style with another goal and half the duration.
moved = model.rollout(goal=[0.5, 0.1], tau=model.tau / 2)
print(f"at {moved.time[-1]:.2f} s: {np.round(moved.position[-1], 3)} m")

figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
for demo in demos:
    axes.plot(*demo.position.T, color="0.7")
axes.plot(*between.position.T, label="mean of two styles")
axes.plot(*moved.position.T, label="another goal")
axes.set(xlabel="x [m]", ylabel="z [m]", title="Five demonstrations (grey) and two rollouts")
axes.legend()
figure.savefig("01_fit_and_rollout.png", dpi=150)
