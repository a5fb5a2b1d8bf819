"""Learns handovers of two partners in one model, sees one of them, and generates the other."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.01  # s
SEEN = (0.1, 0.3, 0.5, 0.7)
GIVER, RECEIVER = slice(0, 2), slice(2, 4)  # degrees of freedom
N_SAMPLES = 81

rng = np.random.default_rng(1)


def rise(s):
    """Returns a minimum-jerk rise from 0 to 1 [-] over s in [0, 1]."""
    s = np.clip(s, 0, 1)[:, None]
    return s**3 * (10 - 15 * s + 6 * s**2)


def random_handover():
    """Returns the hands of giver and receiver (T, 4) [m], who meet at a random place."""
    place = np.array([rng.uniform(0.45, 0.7), rng.uniform(-0.25, 0.25)])
    height, duration = rng.uniform(0.0, 0.2), rng.uniform(1.0, 1.6)
    s = np.linspace(0, 1, N_SAMPLES)
    lift = np.outer((4 * s * (1 - s)) ** 2, [0.0, height])
    giver = rise(s / 0.8) * place + lift
    # The receiver starts late, from the other side of the table, and gives way to a high giver.
    side = np.array([1.3, 0.1])
    receiver = side + rise((s - 0.2) / 0.8) * (place + [0.08, 0.0] - side) - 0.8 * lift
    hands = np.hstack([giver, receiver]) + 0.002 * rng.standard_normal((N_SAMPLES, 4)).cumsum(0) / 3
    return pdmp.Demonstration(hands, dt=duration / (N_SAMPLES - 1))


demos = [random_handover() for _ in range(20)]
model = pdmp.fit(demos)
prior = model.prior(demos)


def watch(recogniser, movement, share):
    """Shows the giver alone up to a share of the movement; the receiver is missing."""
    seen = [k for k, time in enumerate(movement.time) if time <= share * movement.time[-1]]
    for k in seen:
        recogniser.update(movement.time[k], [*movement.position[k, GIVER], np.nan, np.nan])
    return len(seen)


# Errors of the receiver to come, on other handovers, beside simpler predictions.
mean = np.mean([demo.position[:, RECEIVER] for demo in demos], axis=0)
fractions = np.linspace(0, 1, N_SAMPLES)
duration = np.exp(np.mean([np.log(demo.time[-1]) for demo in demos]))
errors = np.zeros((len(SEEN), 3))
others = [random_handover() for _ in range(20)]
for movement in others:
    for k, share in enumerate(SEEN):
        recogniser = model.recogniser(prior)
        n = watch(recogniser, movement, share)
        ahead = recogniser.continuation(movement.time[n:]).position[:, RECEIVER]
        distances = [
            np.sum((demo.position[:n, GIVER] - movement.position[:n, GIVER]) ** 2) for demo in demos
        ]
        # The nearest demonstration has the true duration, which the recogniser estimates.
        nearest = demos[np.argmin(distances)].position[n:, RECEIVER]
        late = movement.time[n:] / duration
        average = np.column_stack([np.interp(late, fractions, column) for column in mean.T])
        for j, predicted in enumerate((ahead, nearest, average)):
            error = predicted - movement.position[n:, RECEIVER]
            errors[k, j] += np.sqrt(np.mean(error**2)) / len(others)
print("error of the receiver [mm]: recogniser, nearest demonstration, mean movement")
for share, row in zip(SEEN, errors, strict=True):
    print(f"{share:.0%} seen:", "  ".join(f"{1000 * error:5.1f}" for error in row))

# A robot is the receiver: its controller has the joint model, and takes style, goal and time.
new = others[0]
end = new.time[-1]
recogniser = model.recogniser(prior)
controller = model.controller(dt=DT, start=[0.0, 0.0, 1.3, 0.1])
path, goals, clock = [], [], 0.0
for time in np.arange(0, end + 0.3, DT):
    if time <= end:
        hand = [np.interp(time, new.time, y) for y in new.position[:, GIVER].T]
        recogniser.update(time, [*hand, np.nan, np.nan])
        estimate = recogniser.estimate()
        goals.append((time, *estimate.goal[RECEIVER], *estimate.goal_deviation[RECEIVER]))
        controller.style, controller.goal = estimate.style, estimate.goal
        left = max(estimate.arrival - time, 0.05)
        controller.tau = np.clip(left / max(1 - clock, 0.05), 0.5, 3.0)
    controller.step()
    clock += DT / controller.tau
    path.append(controller.position[RECEIVER].copy())
path, goals = np.array(path), np.array(goals)
distance = np.linalg.norm(path[-1] - new.position[-1, RECEIVER])
print(f"the robot ends {1000 * distance:.0f} mm from where the person would have")

figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.2), layout="constrained")
for demo in demos:
    for partner in (GIVER, RECEIVER):
        left.plot(*demo.position[:, partner].T, color="0.85", linewidth=0.8)
left.plot(*new.position[:, GIVER].T, "k", label="giver, seen")
left.plot(*new.position[:, RECEIVER].T, "k:", label="receiver, not seen")
left.plot(*path.T, label="robot")
left.set(xlabel="x [m]", ylabel="y [m]", title="Two partners, one model")
left.legend(frameon=False, fontsize="small")
for k, name in enumerate("xy"):
    (line,) = right.plot(goals[:, 0], goals[:, 1 + k], label=f"goal {name} of the receiver")
    band = 1.645 * goals[:, 3 + k]
    right.fill_between(
        goals[:, 0],
        goals[:, 1 + k] - band,
        goals[:, 1 + k] + band,
        alpha=0.2,
        color=line.get_color(),
    )
    right.axhline(new.position[-1, RECEIVER][k], color=line.get_color(), linestyle=":")
right.set(xlabel="time [s]", ylabel="[m]", title="Estimated from the giver, bands of 90 %")
right.legend(frameon=False)
figure.savefig("14_handover.png", dpi=150)
