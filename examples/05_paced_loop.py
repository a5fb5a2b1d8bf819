"""Runs a primitive on the wall clock, with a robot that lags behind and is blocked temporarily."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

s = np.linspace(0, 1, 101)
forward = s**3 * (10 - 15 * s + 6 * s**2)
model = pdmp.fit(
    [np.column_stack([forward, h * np.sin(np.pi * s) ** 2]) for h in (0.1, 0.2, 0.4)], dt=0.006
)
controller = model.controller(style=model.styles[1])
robot = controller.position.copy()

loop = pdmp.PacedLoop(controller, rate_hz=1000, measured=lambda: robot)
time, motion = [], []
for tick in loop:
    if not 0.2 < tick.time < 0.4:  # the robot is blocked in between: the phase waits
        robot += 0.2 * (controller.position - robot)
    time.append(tick.time)
    motion.append([controller.position[1], robot[1]])
    if tick.missed:
        print(f"at {tick.time:.3f} s: {1000 * tick.lateness:.1f} ms late, {tick.missed} missed")

print(f"{loop.ticks} ticks in {controller.time:.3f} s, robot at {np.round(robot, 3)}")
print(f"{loop.missed} deadlines missed, at worst {1000 * loop.max_lateness:.1f} ms late")

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.axvspan(0.2, 0.4, color="0.93")
axes.plot(time, motion, label=["commanded", "robot"])
axes.set(xlabel="time [s]", ylabel="y [m]", title="The robot is blocked: the movement waits")
axes.legend()
figure.savefig("05_paced_loop.png", dpi=150)
