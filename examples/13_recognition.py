"""Recognises the reach of a hand on its way, and lets a robot meet it."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s
SEEN = (0.1, 0.3, 0.5, 0.7)

rng = np.random.default_rng(1)
s = np.linspace(0, 1, 61)[:, None]
rise = s**3 * (10 - 15 * s + 6 * s**2)


def reach(goal, height, duration):
    """Returns the path of a hand (T, 2) [m] over an obstacle, and its sampling interval [s]."""
    lift = np.hstack([0 * s, height * (4 * s * (1 - s)) ** 2])
    return pdmp.Demonstration(rise * goal + lift, dt=duration / 60)


def random_reach():
    """Returns a reach to a random place; high reaches take longer."""
    height = rng.uniform(0.05, 0.25)
    duration = (0.8 + 1.5 * height) * np.exp(0.08 * rng.standard_normal())
    return reach(np.array([rng.uniform(0.4, 0.7), rng.uniform(-0.2, 0.3)]), height, duration)


demos = [random_reach() for _ in range(20)]
hand = pdmp.fit(demos)
prior = hand.prior(demos)
recogniser = hand.recogniser(prior)

# The robot has learnt the same task from its own side of the table.
SIDE = np.array([1.2, 0.0])
robot = pdmp.fit([pdmp.Demonstration(SIDE - 0.8 * demo.position, time=demo.time) for demo in demos])
styles, *_ = np.linalg.lstsq(hand.styles, robot.styles, rcond=None)  # of the robot, for a hand

new = random_reach()
truth, arrival = new.position[-1], new.time[-1]
controller = robot.controller(dt=DT)
clock, goals, path, forecasts = 0.0, [], [], {}
for time in np.arange(0, arrival + 0.3, DT):
    if time <= arrival:
        seen = [np.interp(time, new.time, y) for y in new.position.T]
        recogniser.update(time, seen + 0.001 * rng.standard_normal(2))
        estimate = recogniser.estimate()
        goals.append((time, *estimate.goal, *estimate.goal_deviation, estimate.arrival))
        controller.goal, controller.style = estimate.goal, estimate.style @ styles
        # The robot arrives with the hand, within the rates that it can follow.
        left = max(estimate.arrival - time, 0.05)
        controller.tau = np.clip(left / max(1 - clock, 0.05), 0.4, 3.0)
        for share in SEEN:
            if share not in forecasts and time >= share * arrival:
                ahead = recogniser.continuation(np.arange(time, arrival, DT))
                forecasts[share] = ahead
                error = np.linalg.norm(estimate.goal - truth)
                print(
                    f"{share:.0%} seen: goal to {error:.3f} m, arrival at "
                    f"{estimate.arrival:.2f} s of {arrival:.2f} s"
                )
    controller.step()
    clock += DT / controller.tau
    path.append(controller.position.copy())

path, goals = np.array(path), np.array(goals)
distance = np.linalg.norm(path[-1] - truth)
print(f"the robot meets the hand to {distance:.3f} m")

figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.2), layout="constrained")
for demo in demos:
    left.plot(*demo.position.T, color="0.85", linewidth=0.8)
left.plot(*new.position.T, "k", label="hand")
left.plot(*path.T, label="robot")
for share, ahead in forecasts.items():
    left.plot(*ahead.position.T, "--", linewidth=1, label=f"after {share:.0%}")
left.set(xlabel="x [m]", ylabel="y [m]", title="Hand and robot")
left.legend(frameon=False, fontsize="small")
for k, name in enumerate("xy"):
    (line,) = right.plot(goals[:, 0], goals[:, 1 + k], label=f"goal {name}")
    band = 1.645 * goals[:, 3 + k]
    right.fill_between(
        goals[:, 0],
        goals[:, 1 + k] - band,
        goals[:, 1 + k] + band,
        alpha=0.2,
        color=line.get_color(),
    )
    right.axhline(truth[k], color=line.get_color(), linestyle=":")
right.set(xlabel="time [s]", ylabel="[m]", title="Estimated goal, bands of 90 %")
right.legend(frameon=False)
figure.savefig("13_recognition.png", dpi=150)
