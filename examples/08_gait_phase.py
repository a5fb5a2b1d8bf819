"""Synchronises a learnt gait with a walking person, by a measured phase or at heel strikes."""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

DT = 0.001  # s
STRIDE = 1.1  # s, demonstrated
SAMPLES = 220
phi = np.linspace(0, 2 * np.pi, SAMPLES, endpoint=False)
hip = 0.15 + 0.40 * np.cos(phi)
knee = 0.45 - 0.25 * np.cos(phi - 0.6) - 0.30 * np.cos(2 * phi - 1.0)
angles = np.column_stack([hip, knee])
demo = pdmp.Demonstration(angles, dt=STRIDE / SAMPLES, units=["rad", "rad"])
gait = pdmp.fit([demo], kind="rhythmic")

# The person is elsewhere in the cycle at first, and walks 8 % faster than the demonstration.
cycles = 0.3 + 1.08 / STRIDE * DT * np.arange(10_001)
noise = 0.05 * np.random.default_rng(0).standard_normal(len(cycles))  # rad
figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")


def run(name: str, pull: bool = False, reset: bool = False) -> None:
    """Runs ten seconds, and prints how far the phases and how fast the joints are."""
    controller = gait.controller(dt=DT)
    apart, speed, sampled, strike = [], 0.0, 0, 0
    for k in range(10_000):
        if k % 10 == 0:  # The sensor is slower than the loop.
            sampled = k
        # The last sample advances at the rate of the gait.
        measured = (
            2 * np.pi * cycles[sampled] + noise[sampled] + (k - sampled) * DT / controller.tau
        )
        controller.step(phase=measured if pull else None)
        if reset and np.floor(cycles[k + 1]) > np.floor(cycles[k]):
            controller.phase = 0.0
            if strike:
                # The frequency adapts by half of its error.
                omega, observed = 1 / controller.tau, 2 * np.pi / ((k - strike) * DT)
                controller.tau = 1 / (omega + 0.5 * (observed - omega))
            strike = k
        difference = controller.phase / (2 * np.pi) - cycles[k + 1]
        apart.append(abs(difference - np.round(difference)))
        speed = max(speed, np.abs(controller.velocity).max())
    print(f"{name}: {apart[0]:.2f}, later at most {max(apart[-5000:]):.3f} cycles apart; ", end="")
    print(f"fastest joint {speed:.1f} rad/s")
    axes.plot(DT * np.arange(1, len(apart) + 1), apart, label=name)


run("alone")
run("pulled by the measured phase", pull=True)
run("reset at heel strikes", reset=True)
axes.set(xlabel="time [s]", ylabel="phase difference [cycles]", title="A gait follows a person")
axes.legend()
figure.savefig("08_gait_phase.png", dpi=150)
