"""Teaches two arms to carry an object: stiff between the hands, compliant as a whole."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp
from pdmp.robots import absolute_relative, left_right, mean_pose

DT = 0.002  # s
# Grippers that face each other are half a turn apart, where the midpoint of their orientations
# needs a reference: the rotation from the left to the right gripper, qw, qx, qy, qz.
FACING = [0.0, 1.0, 0.0, 0.0]
random = np.random.default_rng(0)
s = np.linspace(0, 1, 151)[:, None]
forward = s**3 * (10 - 15 * s + 6 * s**2)


def recorded(lift: float, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns recorded poses x, y, z, qw, qx, qy, qz of both hands, (T, 7) each."""
    half = 0.5 * yaw * forward
    turn = np.hstack([np.cos(half), 0 * s, 0 * s, np.sin(half)])
    place = np.array([0.6, 0.1, 0.1]) + forward * [0.0, -0.3, 0.1]
    place += np.sin(np.pi * s) ** 2 * [0, 0, lift]
    hands = left_right(np.hstack([place, turn]), [0.0, -0.4, 0.0, *FACING], reference=FACING)
    noise = 0.004 * np.sin(3 * np.pi * s) * random.normal(size=(2, 1, 7))
    left, right = hands + noise
    for hand in (left, right):
        hand[:, 3:] /= np.linalg.norm(hand[:, 3:], axis=1, keepdims=True)
    return left, right


recordings = [recorded(lift, yaw) for lift, yaw in [(0.1, 0.3), (0.2, -0.2), (0.3, 0.5)]]
pairs = [absolute_relative(*hands, reference=FACING) for hands in recordings]
# The object is rigid: one relative pose replaces those of all samples.
grasp = mean_pose([relative for _, relative in pairs])
demos = [
    pdmp.Demonstration(
        np.hstack([absolute, np.tile(grasp, (len(absolute), 1))]),
        dt=0.02,
        rotations={3: "wxyz", 10: "wxyz"},
    )
    for absolute, _ in pairs
]
model = pdmp.fit(demos, n_styles=2)
figure, axes = plt.subplots(figsize=(5.0, 3.2), layout="constrained")


def run(name: str, held: range) -> None:
    """Moves both hands to a new goal, during which a person may hold the object."""
    controller = model.controller(dt=DT, style=model.styles[1])
    goal, hands = model.goals[1].copy(), []
    goal[:3] += [0.05, 0.1, 0.0]
    while True:
        tick = len(hands)
        if tick == 200:
            controller.goal = goal
        # On a robot: absolute_relative of the measured poses of the hands, such as those of
        # pdmp.robots.MujocoKinematics. The commanded relative pose keeps the grasp stiff.
        pose = controller.position
        if tick not in held:
            absolute = pose[:7].copy()
        measured = np.concatenate([absolute, pose[7:]])
        if controller.step(measured=measured) == pdmp.Status.FINISHED:
            break
        pose = controller.position
        hands.append(left_right(pose[:7], pose[7:], reference=FACING))
    left, right = np.swapaxes(hands, 0, 1)
    axes.plot(DT * np.arange(1, len(hands) + 1), left[:, 2], label=f"left hand, {name}")
    apart = np.linalg.norm(right[:, :3] - left[:, :3], axis=1)
    print(
        f"{name}: {len(hands) * DT:.2f} s, ends at {controller.position[:3].round(3)} m;", end=" "
    )
    print(f"distance of the hands {apart.mean():.4f} m, changes by {np.ptp(apart):.0e} m")


run("free", range(0))
run("held for a second", range(500, 1000))
axes.set(xlabel="time [s]", ylabel="height z [m]", title="New goal at 0.4 s; held from 1 to 2 s")
axes.legend()
figure.savefig("11_two_arms.png", dpi=150)
