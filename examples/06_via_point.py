"""Leads a movement through via-points: planned ahead, and added to a movement under way."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s

s = np.linspace(0, 1, 101)
forward = 0.4 * s**3 * (10 - 15 * s + 6 * s**2)
upward = [h * np.sin(np.pi * s**k) ** 2 for h in (0.1, 0.2, 0.3) for k in (0.8, 1.0, 1.25)]
demos = [pdmp.Demonstration(np.column_stack([forward, z]), dt=DT, names=["x", "z"]) for z in upward]
model = pdmp.fit(demos, n_styles=4)

# A height that no demonstration has at this time: the style changes, and the rest is forcing.
point = pdmp.ViaPoint(0.4, [0.24], dofs=["z"])
passage = model.through(point)
planned = model.rollout(passage.conditions, dt=DT).position
print(f"misses by {abs(planned[40, 1] - 0.24):.0e} m, at a distance of {passage.distance:.2f}")

# During the movement a second point turns up. From here on the forcing leads to it.
height = planned[75, 1] + 0.01  # m
controller = model.controller(dt=DT, conditions=passage.conditions)
path = [controller.position.copy()]
for k in range(100):
    if k == 50:
        new = pdmp.ViaPoint(0.75, [height], dofs=["z"])
        change = model.through(new, passage.conditions, from_phase=controller.phase)
        controller.add_forcing(change.forcing)
    controller.step()
    path.append(controller.position.copy())
moved = np.array(path)
print(f"the second point: {abs(moved[75, 1] - height):.0e} m, the end: {moved[-1].round(3)} m")

figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for z in upward:
    axes.plot(forward, z, color="0.8", linewidth=0.8)
axes.plot(*planned.T, "--", label="through one point")
axes.plot(*moved.T, label="second point at half time")
axes.plot(*planned[40], "ko")
axes.plot(*moved[75], "ko")
axes.set(xlabel="x [m]", ylabel="z [m]", title="Via-points at 0.4 s and 0.75 s")
axes.legend(loc="lower center")
figure.savefig("06_via_point.png", dpi=150)
