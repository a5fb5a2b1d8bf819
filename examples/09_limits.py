"""Keeps a control loop within the limits of a robot, and follows a path as fast as they allow."""

from collections import Counter

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.001  # s
JOINTS = ["panda_joint2", "panda_joint4"]
s = np.linspace(0, 1, 201)
forward = s**3 * (10 - 15 * s + 6 * s**2)
demos = [
    pdmp.Demonstration(
        np.column_stack([-0.9 + 1.4 * forward, -2.4 + 1.2 * forward + h * np.sin(np.pi * s) ** 2]),
        dt=0.01,
        names=JOINTS,
        units=["rad", "rad"],
    )
    for h in (0.2, 0.5, 0.8)
]
model = pdmp.fit(demos)

# Limits that the maker publishes. pdmp.Limits.from_urdf("robot.urdf", model.names) and
# pdmp.Limits.from_mujoco read them from the robot's own description.
limits = pdmp.robots.REGISTRY["panda"].limits(model.names)
figure, panels = plt.subplots(2, 1, figsize=(6, 4.4), sharex=True, layout="constrained")


def run(name: str, kept: pdmp.Limits | None, push: float = 0.0) -> None:
    """Gives a new goal and half the time to a movement, and prints how far it goes."""
    controller = model.controller(dt=DT, limits=kept, style=model.styles[1])
    active: Counter[str] = Counter()
    motion = []
    # A push by an acceleration in rad/s², for a tenth of a second.
    while controller.step(coupling=([0, 0], [push * (600 <= len(motion) < 700), 0])):
        if len(motion) == 500:
            controller.goal = [2.1, -1.6]  # that of the first joint is beyond its limit
            controller.tau = 0.5 * model.tau
        active.update(limit for limit in controller.limited if limit is not None)
        motion.append([controller.position.copy(), controller.velocity.copy()])
    position, velocity = np.swapaxes(motion, 0, 1)
    acceleration = np.diff(velocity, axis=0) / DT
    for axes, values in zip(panels, (position, velocity), strict=True):
        axes.plot(DT * np.arange(1, len(motion) + 1), values[:, 0], label=name)
    print(f"{name}: {len(motion) * DT:.2f} s, ends at {position[-1].round(3)} rad;", end=" ")
    print(f"largest velocity {np.abs(velocity).max():.2f} rad/s,", end=" ")
    print(f"acceleration {np.abs(acceleration).max():.1f} rad/s²")
    if kept is not None:
        print(f"{name}: ticks with an active limit: {dict(active)}")


run("without limits", None)
run("with limits", limits)  # slows down on the path
run("pushed, with limits", limits, push=500.0)  # leaves the path
panels[0].axhline(limits.position[1][0], color="black", linewidth=0.6)
panels[1].axhline(limits.velocity[0], color="black", linewidth=0.6)
panels[0].set(ylabel="joint 2 [rad]", title="The first joint with its limits (black)")
panels[1].set(xlabel="time [s]", ylabel="velocity [rad/s]")
panels[0].legend()
figure.savefig("09_limits.png", dpi=150)

# The learnt path in the shortest time, and with the best constant tau.
fastest = model.fastest(limits, style=model.styles[1], dt=DT)
constant = model.fastest_tau(limits, style=model.styles[1]) / model.tau * model.durations[1]
print(f"demonstrated {model.durations[1]:.2f} s, constant tau {constant:.2f} s,", end=" ")
print(f"fastest {fastest.time[-1]:.2f} s on the same path")
