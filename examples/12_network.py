"""Trains a small network through a primitive: from pictures to style and goal of a movement."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.02  # s
SIZE, HIDDEN, BATCH = 12, 48, 64  # pixels a side, units, pictures
PASS = 24  # sample at which the hand passes the object

s = np.linspace(0, 1, 51)


def reach(height, delay):
    """Returns a demonstrated reach (T, 2) [m] over an object."""
    late = s**delay
    return np.column_stack(
        [0.4 * late**3 * (10 - 15 * late + 6 * late**2), height * np.sin(np.pi * s) ** 2]
    )


demos = [reach(height, delay) for height in (0.1, 0.2, 0.3) for delay in (0.8, 1.0, 1.25)]
model = pdmp.fit(demos, dt=DT, n_styles=3)
rng = np.random.default_rng(0)


def pictures(n):
    """Returns pictures (n, SIZE²) of an object and a target, and their positions (n, 2) [m]."""
    objects = rng.uniform([0.14, 0.12], [0.23, 0.28], (n, 2))
    targets = rng.uniform([0.35, -0.05], [0.45, 0.05], (n, 2))
    x, y = np.meshgrid(np.linspace(0, 0.5, SIZE), np.linspace(-0.1, 0.4, SIZE))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)

    def blobs(positions):
        squares = ((pixels - positions[:, None]) ** 2).sum(axis=2)
        return np.exp(-squares / (2 * 0.05**2))

    return blobs(objects) - blobs(targets), objects, targets


def loss(positions, objects, targets):
    """Returns the mean squared misses [m²] and their derivatives by the positions (B, T, D)."""
    cotangents = np.zeros_like(positions)
    cotangents[:, PASS] = positions[:, PASS] - objects
    cotangents[:, -1] = positions[:, -1] - targets
    value = (cotangents**2).sum(axis=(1, 2)).mean()
    return value, 2 * cotangents / len(positions)


# A network with one hidden layer, whose outputs are style and goal in units of the demonstrations.
scale = np.concatenate([model.styles.std(axis=0), [0.1, 0.1]])
offset = np.concatenate([model.styles.mean(axis=0), model.goals.mean(axis=0)])
n_outputs = len(scale)
weights = [
    rng.standard_normal((SIZE**2, HIDDEN)) / SIZE,
    np.zeros(HIDDEN),
    rng.standard_normal((HIDDEN, n_outputs)) * 0.1,
    np.zeros(n_outputs),
]


def conditions(inputs):
    """Returns the hidden layer, and the style and goal of each picture."""
    hidden = np.tanh(inputs @ weights[0] + weights[1])
    outputs = offset + scale * (hidden @ weights[2] + weights[3])
    return hidden, {"style": outputs[:, : model.n_styles], "goal": outputs[:, model.n_styles :]}


moments = [(np.zeros_like(w), np.zeros_like(w)) for w in weights]
history = []
for step in range(1, 601):
    inputs, objects, targets = pictures(BATCH)
    hidden, given = conditions(inputs)
    (positions,) = model.rollouts(**given, dt=DT, derivatives=0)
    value, cotangents = loss(positions, objects, targets)
    history.append(value)
    # Backwards through the primitive, and then through the network.
    by_outputs = np.hstack(model.rollouts_vjp(["style", "goal"], cotangents, **given, dt=DT))
    by_outputs *= scale
    by_hidden = (by_outputs @ weights[2].T) * (1 - hidden**2)
    gradients = [
        inputs.T @ by_hidden,
        by_hidden.sum(axis=0),
        hidden.T @ by_outputs,
        by_outputs.sum(axis=0),
    ]
    rate = 0.01 * 0.995**step
    for weight, gradient, (first, second) in zip(weights, gradients, moments, strict=True):
        # Adam (Kingma and Ba 2015).
        first += 0.1 * (gradient - first)
        second += 0.001 * (gradient**2 - second)
        weight -= rate * (first / (1 - 0.9**step)) / (np.sqrt(second / (1 - 0.999**step)) + 1e-12)

inputs, objects, targets = pictures(500)
_, given = conditions(inputs)
(positions,) = model.rollouts(**given, dt=DT, derivatives=0)
for name, sample, points in (("object", PASS, objects), ("target", -1, targets)):
    misses = np.linalg.norm(positions[:, sample] - points, axis=1)
    print(f"{name}: median miss {1000 * np.median(misses):.1f} mm in 500 new pictures")

figure, axes = plt.subplots(1, 4, figsize=(9.6, 2.6), layout="constrained")
for number, axis in enumerate(axes[:3]):
    extent = (0, 0.5, -0.1, 0.4)
    image = inputs[number].reshape(SIZE, SIZE)
    axis.imshow(image, cmap="RdBu", extent=extent, origin="lower", vmin=-2, vmax=2)
    axis.plot(*positions[number].T, "k")
    axis.plot(*objects[number], "ko", markerfacecolor="none")
    axis.plot(*targets[number], "kx")
    axis.set(xlabel="x [m]", xlim=extent[:2], ylim=extent[2:])
axes[0].set_ylabel("y [m]")
axes[3].semilogy(np.sqrt(history))
axes[3].set(xlabel="step of 64 pictures", ylabel="rms miss [m]")
figure.savefig("12_network.png", dpi=150)
