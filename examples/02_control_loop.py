"""Runs a control loop at 1 kHz, and changes goal and style during the movement."""

from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.001  # s
s = np.linspace(0, 1, 201)
forward = s**3 * (10 - 15 * s + 6 * s**2)
demos = [
    pdmp.Demonstration(np.column_stack([forward, bend * np.sin(np.pi * s) ** 2]), dt=0.01)
    for bend in (-0.2, 0.1, 0.3)
]
model = pdmp.fit(demos)
controller = model.controller(dt=DT, style=model.styles[0])

ticks, motion = [], []
status = pdmp.Status.WORKING
while status == pdmp.Status.WORKING:
    if len(ticks) == 800:
        controller.style = model.styles[2]
    if len(ticks) == 1000:
        controller.goal = [1.2, 0.3]
    begin = perf_counter()
    status = controller.step()
    ticks.append(perf_counter() - begin)
    motion.append([*controller.position, *controller.velocity])
    # A robot would be sent controller.position, controller.velocity, controller.acceleration here.

print(f"{len(ticks)} ticks, {controller.time:.3f} s, at {np.round(controller.position, 4)}")
print(f"mean {1e6 * np.mean(ticks):.2f} µs, worst {1e6 * np.max(ticks):.1f} µs")

figure, (upper, lower) = plt.subplots(2, 1, figsize=(6, 4), sharex=True, layout="constrained")
time = DT * np.arange(1, len(motion) + 1)
for d, name in enumerate("xy"):
    upper.plot(time, np.array(motion)[:, d], label=name)
    lower.plot(time, np.array(motion)[:, 2 + d])
for axes in (upper, lower):
    axes.axvline(0.8, color="0.5", linestyle=":")
    axes.axvline(1.0, color="0.5", linestyle="--")
upper.set(ylabel="position [m]", title="New style (dotted) and new goal (dashed) on the way")
upper.legend()
lower.set(xlabel="time [s]", ylabel="velocity [m/s]")
figure.savefig("02_control_loop.png", dpi=150)
