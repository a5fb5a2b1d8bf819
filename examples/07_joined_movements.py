"""Joins two movements without a stop: the first ends with the velocity that the second starts with.

A swing at a ball is learnt from rest to rest, the follow-through from recordings that start in
motion, when the ball is hit. The swing also hits a ball that moves on the way, and harder.
"""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.001  # s

s = np.linspace(0, 1, 101)
reach = s**3 * (10 - 15 * s + 6 * s**2)
swing = pdmp.fit(
    [np.column_stack([0.6 * reach, 64 * bend * (s * (1 - s)) ** 3]) for bend in (0.1, 0.2, 0.3)],
    dt=0.006,
)
# From a speed at the ball to rest, with zero acceleration at both ends.
run_out = s * (1 - s**2 + s**3 / 2)
follow = pdmp.fit(
    [np.column_stack([0.5 * speed * run_out, 0.1 * speed * reach]) for speed in (1.6, 2.0, 2.4)],
    dt=0.005,
)

ball = np.array([0.6, 0.1])  # m
velocity = follow.rollout(dt=DT).velocity[0]
way = follow.goals[1] - follow.starts[1]
start_of_follow = follow.conditions(1).replace(start=ball, goal=ball + way)


def joined(hit: np.ndarray) -> np.ndarray:
    """Returns the velocities (T, 2) of swing and follow-through, joined with a velocity."""
    movements = (
        (swing, swing.conditions(1).replace(goal=ball, goal_velocity=hit)),
        (follow, start_of_follow.replace(velocity=hit)),
    )
    velocities = []
    for model, conditions in movements:
        controller = model.controller(DT, conditions)
        # The goal is passed when the duration is over; later ticks would brake.
        for _ in range(round(model.durations[1] / DT)):
            controller.step()
            velocities.append(controller.velocity.copy())
    return np.array(velocities)


n_swing = round(swing.durations[1] / DT)
figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
for name, hit in (("with a stop", np.zeros(2)), ("joined", velocity)):
    velocities = joined(hit)
    hardest = np.linalg.norm(np.diff(velocities, axis=0), axis=1).max() / DT
    speed = np.linalg.norm(velocities[n_swing - 1])
    norm = np.linalg.norm(velocities, axis=1)
    axes.plot(DT * np.arange(1, len(norm) + 1), norm, label=name)
    print(f"{name}: hits the ball at {speed:.3f} m/s, accelerates by at most {hardest:.1f} m/s²")

axes.axvline(DT * n_swing, color="0.5", linestyle=":")
axes.set(xlabel="time [s]", ylabel="speed [m/s]", title="Swing and follow-through; the ball dotted")
axes.legend()
figure.savefig("07_joined_movements.png", dpi=150)

controller = swing.controller(DT, swing.conditions(1).replace(goal=ball, goal_velocity=velocity))
for tick in range(n_swing):
    if tick == n_swing // 3:
        controller.goal = ball + [0.05, -0.03]
        controller.goal_velocity = 1.5 * velocity
    controller.step()
place, speed = np.round(controller.position, 4), np.linalg.norm(controller.velocity)
print(f"the moved ball: hit at {place} m with {speed:.3f} m/s")
