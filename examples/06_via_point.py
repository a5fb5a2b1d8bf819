"""Computes the style whose movement passes a via-point at a given time."""

import time

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s

s = np.linspace(0, 1, 101)
forward = 0.4 * s**3 * (10 - 15 * s + 6 * s**2)
upward = [h * np.sin(np.pi * s**k) ** 2 for h in (0.1, 0.2, 0.3) for k in (0.8, 1.0, 1.25)]
model = pdmp.fit([np.column_stack([forward, z]) for z in upward], dt=DT, n_styles=4)

nominal = model.styles[model.nominal]
k = 40  # sample of the via-point, at 0.4 s
without = model.rollout(style=nominal, dt=DT).position
before = without[k]
point = np.array([before[0], 0.24])  # m

# Movements are linear in the style, so that one least-squares step suffices. Of the styles that
# pass the point, it gives the nearest to that of the nominal demonstration.
began = time.perf_counter()
jacobian = model.jacobian("style", dt=DT)[k]
style = nominal + np.linalg.lstsq(jacobian, point - before, rcond=None)[0]
took = time.perf_counter() - began

made = model.rollout(style=style, dt=DT).position
print(f"before: {before.round(3)} m at {k * DT} s, via-point: {point.round(3)}")
print(f"style {style.round(3)} misses by {np.linalg.norm(made[k] - point):.1e} m")
print(f"and ends at {made[-1].round(3)} m; found in {1000 * took:.1f} ms")

figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for z in upward:
    axes.plot(forward, z, color="0.8", linewidth=0.8)
axes.plot(*without.T, "--", label="nominal style")
axes.plot(*made.T, label="through the point")
axes.plot(*point, "ko")
axes.set(xlabel="x [m]", ylabel="z [m]", title=f"Via-point at {k * DT} s")
axes.legend(loc="lower center")
figure.savefig("06_via_point.png", dpi=150)
