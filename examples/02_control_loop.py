"""Runs a control loop at 1 kHz, and changes goal and style during the movement."""

from time import perf_counter

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

ticks = []
status = pdmp.Status.WORKING
while status == pdmp.Status.WORKING:
    if len(ticks) == 800:
        controller.style = model.styles[2]
    if len(ticks) == 1000:
        controller.goal = [1.2, 0.3]
    begin = perf_counter()
    status = controller.step()
    ticks.append(perf_counter() - begin)
    # A robot would be sent controller.position, controller.velocity, controller.acceleration here.

print(f"{len(ticks)} ticks, {controller.time:.3f} s, at {np.round(controller.position, 4)}")
print(f"mean {1e6 * np.mean(ticks):.2f} µs, worst {1e6 * np.max(ticks):.1f} µs")
