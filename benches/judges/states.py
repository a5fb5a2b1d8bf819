"""Viable states and accelerations, judged by klimits.

klimits interpolates the acceleration linearly over a step. From a joint that brakes already, its
range of the next acceleration is not empty exactly if the joint can stop inside the limits; from
one that moves away from a limit, if it was not accelerated towards it.
"""

from typing import Any

import numpy as np

import pdmp
from pdmp._markdown import markdown_table
from peers.movement import N_DOFS, primitive

DT = 1e-3  # s
N_STATES = 20_000
N_TICKS = 20_000
# Relative distance to the boundary of the viable states within which verdicts may differ.
ROUNDING = 1e-6
PUSH = 1e9  # acceleration of a coupling term, above every limit


def random_limits(random: np.random.Generator) -> tuple[pdmp.Limits, np.ndarray]:
    """Returns limits of all joints, also as lower, upper, V and A (4, D)."""
    upper = 10 ** random.uniform(-1, 0.5, N_DOFS)
    velocity = 10 ** random.uniform(-0.5, 1, N_DOFS)
    acceleration = velocity * 10 ** random.uniform(0.5, 2, N_DOFS)
    limits = pdmp.Limits(position=(-upper, upper), velocity=velocity, acceleration=acceleration)
    return limits, np.array([-upper, upper, velocity, acceleration])


def judge(numbers: np.ndarray) -> Any:
    """Returns the limitation of klimits."""
    from klimits import PosVelJerkLimitation

    lower, upper, v, a = numbers
    jerk = 2 * a / DT  # from -A to A in one step
    pairs = {
        "pos_limits": np.transpose([lower, upper]),
        "vel_limits": np.transpose([-v, v]),
        "acc_limits": np.transpose([-a, a]),
        "jerk_limits": np.transpose([-jerk, jerk]),
    }
    return PosVelJerkLimitation(
        time_step=DT,
        **{name: pair.tolist() for name, pair in pairs.items()},
        acceleration_after_max_vel_limit_factor=0.0001,
        normalize_acc_range=False,
        num_threads=1,
    )


def verdict(limitation: Any, y: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Returns the joints that klimits admits after braking with A or at rest before (D,)."""
    admitted = np.zeros(N_DOFS, dtype=bool)
    for before in (-a * np.sign(v), np.zeros(N_DOFS)):
        _, code = limitation.calculate_valid_acceleration_range(y, v, before, time_step_counter=0)
        admitted |= np.asarray(code) == 0
    return admitted


def stop_excess(numbers: np.ndarray, y: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Returns the distance of the point of rest beyond the limits, relative to their range."""
    lower, upper, _, a = numbers
    stop = y + v * abs(v) / (2 * a)
    return np.maximum(stop - upper, lower - stop) / (upper - lower)


def stops_inside(
    controller: pdmp.Controller, numbers: np.ndarray, y: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """Returns the joints that pdmp, pushed towards their limits, keeps inside from a state (D,)."""
    lower, upper, speed, a = numbers
    controller.reset(start=y, velocity=v, goal=0 * y)
    coupling = (np.zeros(N_DOFS), PUSH * np.sign(v))
    inside = np.ones(N_DOFS, dtype=bool)
    # Time to stop from V under A, and as long again.
    for _ in range(int(2 * np.max(speed / a) / DT) + 2):
        controller.step(coupling=coupling)
        margin = 1e-9 * (upper - lower)
        position = controller.position
        inside &= (position >= lower - margin) & (position <= upper + margin)
    return inside


def random_states(random: np.random.Generator) -> dict[str, int]:
    """Compares the verdicts on random states, on both sides of the boundary."""
    counts = dict.fromkeys(["states", "viable by both", "by neither", "by pdmp", "by klimits"], 0)
    counts["on the boundary"] = 0
    for _ in range(N_STATES // N_DOFS // 20):
        limits, numbers = random_limits(random)
        limitation = judge(numbers)
        controller = primitive().controller(dt=DT, limits=limits)
        lower, upper, speed, a = numbers
        for _ in range(20):
            y = random.uniform(lower, upper)
            side = random.choice([-1.0, 1.0], N_DOFS)
            way = np.where(side > 0, upper - y, y - lower)
            # Half of the states within a thousandth of the boundary.
            near = np.where(random.random(N_DOFS) < 0.5, 0.5, 1e-3)
            share = 1 + near * random.uniform(-1, 1, N_DOFS)
            v = side * np.minimum(share * np.sqrt(2 * a * way), speed)
            ours = stops_inside(controller, numbers, y, v)
            theirs = verdict(limitation, y, v, a)
            boundary = abs(stop_excess(numbers, y, v)) < ROUNDING
            counts["states"] += N_DOFS
            counts["on the boundary"] += int(np.sum(boundary))
            counts["viable by both"] += int(np.sum(ours & theirs & ~boundary))
            counts["by neither"] += int(np.sum(~ours & ~theirs & ~boundary))
            counts["by pdmp"] += int(np.sum(ours & ~theirs & ~boundary))
            counts["by klimits"] += int(np.sum(~ours & theirs & ~boundary))
    return counts


def visited_states(random: np.random.Generator) -> tuple[int, int, int]:
    """Judges the states of a controller under random pushes, goals and speeds.

    Returns the numbers of states, of those that klimits rejects, and of those limited by pdmp.
    """
    states = rejected = limited = 0
    for _ in range(20):
        limits, numbers = random_limits(random)
        lower, upper, speed, a = numbers
        limitation = judge(numbers)
        controller = primitive().controller(dt=DT, limits=limits)
        controller.reset(start=random.uniform(lower, upper), velocity=np.zeros(N_DOFS))
        controller.step()
        push = np.zeros(N_DOFS)
        for _ in range(N_TICKS // N_DOFS // 20):
            if random.random() < 0.02:
                push = random.normal(size=N_DOFS) * a * 10 ** random.uniform(-1, 3)
            if random.random() < 0.02:
                controller.goal = random.uniform(2 * lower, 2 * upper)
                controller.tau = primitive().tau * 10 ** random.uniform(-1, 1)
            controller.step(coupling=(np.zeros(N_DOFS), push))
            y, v = controller.position, controller.velocity
            # A state on the boundary is drawn inside by rounding.
            good = verdict(limitation, (1 - 1e-9) * y, (1 - 1e-9) * v, a)
            states += N_DOFS
            rejected += int(np.sum(~good))
            limited += sum(limit is not None for limit in controller.limited)
    return states, rejected, limited


def ranges(random: np.random.Generator) -> np.ndarray:
    """Returns the differences of the largest accelerations where position limits it, relative to A.

    That of klimits is the acceleration at the end of a step that begins with braking.
    """
    differences = []
    for _ in range(100):
        limits, numbers = random_limits(random)
        lower, upper, speed, a = numbers
        limitation = judge(numbers)
        controller = primitive().controller(dt=DT, limits=limits)
        y = random.uniform(0.5 * upper, upper)
        v = np.minimum(random.uniform(0.9, 1, N_DOFS) * np.sqrt(2 * a * (upper - y)), 0.9 * speed)
        controller.reset(start=y, velocity=v, goal=0 * y)
        controller.step(coupling=(np.zeros(N_DOFS), PUSH * np.ones(N_DOFS)))
        ours = (controller.velocity - v) / DT
        found, code = limitation.calculate_valid_acceleration_range(y, v, -a, time_step_counter=0)
        theirs = np.asarray(found)[:, 1]
        between = (np.asarray(code) == 0) & (abs(ours) < 0.999 * a) & (abs(theirs) < 0.999 * a)
        differences.append(abs(ours - theirs)[between] / a[between])
    return np.concatenate(differences)


def report() -> None:
    """Prints the agreement with klimits."""
    random = np.random.default_rng(0)
    counts = random_states(random)
    print(f"\nRandom states of a joint: can it stop inside its limits? Steps of {DT:g} s.\n")
    print(markdown_table(list(counts), [[str(count) for count in counts.values()]]))
    states, rejected, limited = visited_states(random)
    print(f"\n{states} states of a controller under random commands, {limited} of them limited:")
    print(f"klimits rejects {rejected}.")
    differences = ranges(random)
    median, largest = np.median(differences), differences.max()
    print(f"\nLargest acceleration in front of a limit, {len(differences)} states: differs from")
    print(f"that of klimits by {median:.2g} of A (median), at most {largest:.2g}.")
