"""Learns to throw a ball into a basket by a search over style and release."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s
GRAVITY = np.array([0.0, -9.81])  # m/s²
BASKET = np.array([2.5, 0.8])  # m

s = np.linspace(0, 1, 61)[:, None]


def swing(speed, lift):
    """Returns a demonstrated swing (T, 2) of the hand [m]."""
    forward = speed * 0.5 * s**3 * (4 - 3 * s)
    return np.hstack([forward, lift * 0.6 * s**4 * (5 - 4 * s)])


demos = [swing(speed, lift) for speed in (0.8, 1.0, 1.3) for lift in (0.7, 1.0, 1.4)]
model = pdmp.fit(demos, dt=DT, n_styles=2)


def miss(positions, velocities, releases):
    """Returns the distance [m] at which each throw crosses the height of the basket in its fall."""
    rows = np.arange(len(releases))
    start, velocity = positions[rows, releases], velocities[rows, releases]
    # y + v t − g t²/2 = height, at the later time; a throw that stays below falls short.
    discriminant = velocity[:, 1] ** 2 + 2 * GRAVITY[1] * (BASKET[1] - start[:, 1])
    time = (velocity[:, 1] + np.sqrt(np.maximum(discriminant, 0))) / -GRAVITY[1]
    return np.hypot(start[:, 0] + velocity[:, 0] * time - BASKET[0], np.minimum(discriminant, 0))


# Cross-entropy method: candidates from a normal distribution, fitted to the best of them.
rng = np.random.default_rng(0)
candidates = np.column_stack([model.styles, np.full(len(demos), 0.8)])
mean, deviation = candidates.mean(axis=0), [*candidates[:, :2].std(axis=0), 0.1]
history = []
for _ in range(12):
    candidates = mean + deviation * rng.standard_normal((400, 3))
    positions, velocities = model.rollouts(style=candidates[:, :2], tau=0.25, dt=DT)
    n = positions.shape[1]
    releases = np.clip((candidates[:, 2] * n).astype(int), 1, n - 1)
    costs = miss(positions, velocities, releases)
    history.append((np.median(costs), costs.min()))
    best = candidates[np.argsort(costs)[:40]]
    mean, deviation = best.mean(axis=0), best.std(axis=0) + 1e-3
    print(f"median miss {history[-1][0]:.3f} m, best {history[-1][1]:.4f} m")

positions, velocities = model.rollouts(style=mean[None, :2], tau=0.25, dt=DT)
release = int(mean[2] * positions.shape[1])
start, velocity = positions[0, release], velocities[0, release]
t = np.linspace(0, 1, 200)[:, None]
flight = start + velocity * t + 0.5 * GRAVITY * t**2
print(
    f"style {mean[:2].round(3)}, release after {mean[2]:.0%} at {np.linalg.norm(velocity):.1f} m/s"
)

figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.2), layout="constrained")
for demo in demos:
    left.plot(*demo.T, color="0.8", linewidth=0.8)
left.plot(*positions[0, : release + 1].T, label="hand")
left.plot(*flight[flight[:, 1] > 0].T, "--", label="ball")
left.plot(*BASKET, "k_", markersize=16, label="basket")
left.set(xlabel="x [m]", ylabel="z [m]", title="Throw", aspect="equal")
left.legend(frameon=False)
right.semilogy(np.arange(1, len(history) + 1), [median for median, _ in history], "o-")
right.set(xlabel="iteration of 400 throws", ylabel="median miss [m]", title="Search over the style")
figure.savefig("10_policy_search.png", dpi=150)
