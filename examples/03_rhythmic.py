"""Fits a family of closed loops, and changes amplitude, frequency and anchor on line."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

PERIOD = 2.0  # s
SAMPLES = 200
# One cycle each; the first sample is not repeated at the end.
phi = np.linspace(0, 2 * np.pi, SAMPLES, endpoint=False)
demos = [
    pdmp.Demonstration(
        np.column_stack([np.cos(phi), (1 - share) * np.sin(phi) + share * np.sin(2 * phi)]),
        dt=PERIOD / SAMPLES,
    )
    for share in (0.0, 0.5, 1.0)
]
model = pdmp.fit(demos, kind="rhythmic", n_styles=2)
print(model)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
for name, style in {"circle": model.styles[0], "eight": model.styles[2]}.items():
    cycle = model.rollout(style=style).position
    gap = np.abs(cycle[-1] - cycle[0]).max()
    print(f"{name}: {np.round(np.ptp(cycle, axis=0), 3)} wide and high, closed to {gap:.0e}")
    left.plot(*cycle.T, label=name)

controller = model.controller(dt=0.001, style=model.styles[0])
path = []
for _ in range(4000):
    controller.step()
    path.append(controller.position.copy())
controller.amplitude = 0.5
controller.anchor = [3.0, 0.0]
controller.tau = model.tau / 2
for _ in range(20_000):
    controller.step()
    path.append(controller.position.copy())
radius = np.linalg.norm(controller.position - controller.anchor)
speed = np.linalg.norm(controller.velocity)
print(f"half as wide, twice as fast: radius {radius:.3f}, speed {speed:.3f}")

left.set(xlabel="x [m]", ylabel="y [m]", title="Two styles", aspect="equal")
left.legend()
right.plot(*np.transpose(path), linewidth=0.8)
right.set(xlabel="x [m]", title="Half the amplitude about another anchor", aspect="equal")
figure.savefig("03_rhythmic.png", dpi=150)
