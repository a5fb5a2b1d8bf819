"""Poses: one step, the error of reproduction, and arms that hold a rigid object."""

from functools import cache, partial
from typing import Any

import numpy as np

import pdmp
from pdmp.datasets import folder
from pdmp.io import read_folder
from pdmp.robots import absolute_relative, left_right, mean_pose
from peers.movement import DT
from peers.steps import TICKS, after
from peers.timing import Begin, Task

N_SAMPLES, DURATION = 251, 1.0  # –, s
N_DEMOS = 10
TURNS = (90, 162, 270)  # °
SPREAD = 0.5  # rad, standard deviation of each of three styles
N_WEIGHTS = (10, 50)  # of movement_primitives: its default, and the default of pdmp's network
FACING = np.array([0.0, 1.0, 0.0, 0.0])
GRASP = np.array([0.02, -0.4, 0.01, *FACING])
# Gains k, c1 and c2 of the coupling of movement_primitives: the default, and stiffer ones that its
# integration at 1 kHz still follows.
GAINS = ((1.0, 1.0, 30.0), (1.0, 1.0, 1e4), (10.0, 1.0, 1e3), (100.0, 1.0, 1e2), (100.0, 0.0, 1e3))


def rotated(vectors: np.ndarray) -> np.ndarray:
    """Returns unit quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vectors).as_quat(scalar_first=True)


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns products (..., 4) of quaternions."""
    from scipy.spatial.transform import Rotation

    first, second = (Rotation.from_quat(q, scalar_first=True) for q in (a, b))
    return (first * second).as_quat(scalar_first=True, canonical=False)


def deviation(poses: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns distances [m] and angles [rad] between poses (..., 7)."""
    from scipy.spatial.transform import Rotation

    first, second = (
        Rotation.from_quat(each[..., 3:], scalar_first=True) for each in (poses, others)
    )
    angles = np.linalg.norm((first.inv() * second).as_rotvec(), axis=-1)
    return np.linalg.norm(poses[..., :3] - others[..., :3], axis=-1), angles


def synthetic(degrees: float) -> list[np.ndarray]:
    """Returns poses (T, 7) of a screw with a bend for each of three styles, about its own axis."""
    random = np.random.default_rng(0)
    s = np.linspace(0, 1, N_SAMPLES)[:, None]
    forward = s**3 * (10 - 15 * s + 6 * s**2)
    bends = np.stack(
        [np.sin(np.pi * s) ** 2, np.sin(np.pi * s) * np.sin(2 * np.pi * s), forward], axis=-1
    )
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    found = []
    for _ in range(N_DEMOS):
        bend = (bends * random.normal(size=3) * SPREAD)[:, 0] @ axes
        turn = rotated(np.radians(degrees) * forward * [0.6, 0.0, 0.8])
        bent = rotated(bend)
        place = [0.2, -0.3, 0.1] * forward + 0.2 * bend
        found.append(np.hstack([place, times(turn, bent)]))
    return found


def recordings() -> dict[str, list[np.ndarray]]:
    """Returns tool poses (T, 7) by task, synthetic ones and recorded ones where available."""
    found = {f"synthetic, {degrees}°": synthetic(degrees) for degrees in TURNS}
    columns = ["x", "y", "z", "qa", "qb", "qc", "qd"]
    try:
        recorded = read_folder(folder("franka_tasks"), columns=columns)
    except FileNotFoundError as reason:
        print(f"left out: {reason}")
        recorded = {}
    for name, demo in recorded.items():
        poses = demo.position.copy()
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        found.setdefault(f"franka_tasks, {name.partition('_')[0]}", []).append(poses)
    return found


def fitted(demos: list[np.ndarray], n_styles: int | None = None) -> pdmp.Model:
    """Fits a primitive of poses, without smoothing: the peers do not smooth either."""
    made = [
        pdmp.Demonstration(
            poses, dt=DURATION / (len(poses) - 1), rotations={3: "wxyz", **other(poses)}
        )
        for poses in demos
    ]
    return pdmp.fit(made, n_styles=n_styles or len(demos), smoothing=None, threads=1)


def other(poses: np.ndarray) -> dict[int, str]:
    """Returns the rotation of a second pose."""
    return {10: "wxyz"} if poses.shape[1] == 14 else {}


def cartesian(poses: np.ndarray, n_weights: int, dual: bool = False) -> Any:
    """Returns a primitive of movement_primitives, fitted to one demonstration."""
    from movement_primitives.dmp import CartesianDMP, DualCartesianDMP

    kind = DualCartesianDMP if dual else CartesianDMP
    dmp = kind(DURATION, dt=DT, n_weights_per_dim=n_weights, int_dt=DT)
    dmp.imitate(np.linspace(0, DURATION, len(poses)), poses)
    return dmp


def reproduction() -> None:
    """Prints the errors of reproduction of every demonstration."""
    print("\nreproduction of the demonstrations: rms and largest angle [°], rms distance [mm]\n")
    print(f"| {'demonstrations':<22} | {'library':<42} |  rms [°] |  max [°] | rms [mm] |")
    print(f"|{'-' * 24}|{'-' * 44}|---------:|---------:|---------:|")
    for name, demos in recordings().items():
        for library, errors in reproduced(demos).items():
            apart, angles = map(np.concatenate, zip(*errors, strict=True))
            figures = [np.degrees(rms(angles)), np.degrees(angles.max()), 1e3 * rms(apart)]
            row = " | ".join(f"{each:>8.2g}" for each in figures)
            print(f"| {name:<22} | {library:<42} | {row} |", flush=True)


def rms(values: np.ndarray) -> float:
    """Returns the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def reproduced(demos: list[np.ndarray]) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Returns distances and angles between each demonstration and its reproduction."""
    found = {}
    for title, n_styles in (("pdmp, J = M", len(demos)), ("pdmp, J = 3", 3)):
        model = fitted(demos, n_styles)
        rollouts = [
            model.rollout(model.conditions(m), dt=DURATION / (len(poses) - 1)).position
            for m, poses in enumerate(demos)
        ]
        found[title] = [deviation(*pair) for pair in zip(rollouts, demos, strict=True)]
    for n_weights in N_WEIGHTS:
        try:
            dmps = [cartesian(poses, n_weights) for poses in demos]
        except ImportError as reason:
            print(f"left out: {reason}")
            break
        errors = []
        for dmp, poses in zip(dmps, demos, strict=True):
            time, path = dmp.open_loop()
            near = np.abs(time[:, None] - np.linspace(0, DURATION, len(poses))).argmin(axis=0)
            errors.append(deviation(path[near], poses))
        found[f"movement_primitives, {n_weights} weights, M models"] = errors
    return found


@cache
def hands() -> list[np.ndarray]:
    """Returns poses (T, 14) of the left and the right hand, which hold a rigid object."""
    return [np.hstack(left_right(poses, GRASP, reference=FACING)) for poses in synthetic(90)]


@cache
def holding() -> pdmp.Model:
    """Fits a primitive of absolute and relative pose."""
    pairs = [absolute_relative(both[:, :7], both[:, 7:], reference=FACING) for both in hands()]
    grasp = mean_pose([relative for _, relative in pairs])
    demos = [np.hstack([absolute, np.tile(grasp, (N_SAMPLES, 1))]) for absolute, _ in pairs]
    return fitted(demos, 3)


def moved(absolute: np.ndarray) -> np.ndarray:
    """Returns an absolute pose (7,) moved by 0.25 m and turned by 40°."""
    turn = rotated(np.radians(40) * np.array([0.0, 0.6, 0.8]))
    return np.concatenate([absolute[:3] + [0.15, -0.2, 0.0], times(turn, absolute[3:])])


def rigidity() -> None:
    """Prints the deviation from a rigid grasp when the goal moves."""
    print("\nlargest deviation of the grasp of a rigid object [m] and [rad]\n")
    print(f"| {'library':<46} |  demonstrated | goal moved    | goal moved half way |")
    print(f"|{'-' * 48}|--------------:|--------------:|--------------------:|")
    rows = {"pdmp, absolute and relative pose": [grasp_of_pdmp(at) for at in (None, 0.0, 0.5)]}
    try:
        for gains in (None, *GAINS):
            label = (
                "no coupling" if gains is None else "k, c1, c2 = {:g}, {:g}, {:g}".format(*gains)
            )
            rows[f"movement_primitives, {label}"] = [
                grasp_of_peer(at, gains) for at in (None, 0.0, 0.5)
            ]
    except ImportError as reason:
        print(f"left out: {reason}")
    for name, figures in rows.items():
        text = " | ".join(f"{apart:.1e}, {angle:.0e}" for apart, angle in figures)
        print(f"| {name:<46} | {text} |", flush=True)


def change(path: np.ndarray) -> tuple[float, float]:
    """Returns the largest change [m, rad] of the grasp along poses (T, 14) of both hands."""
    from scipy.spatial.transform import Rotation

    left, right = path[:, :7], path[:, 7:]
    back = Rotation.from_quat(left[:, 3:], scalar_first=True).inv()
    turned = back * Rotation.from_quat(right[:, 3:], scalar_first=True)
    grasp = np.hstack([back.apply(right[:, :3] - left[:, :3]), turned.as_quat(scalar_first=True)])
    apart, angle = deviation(grasp, np.broadcast_to(grasp[0], grasp.shape))
    return float(apart.max()), float(angle.max())


def grasp_of_pdmp(at: float | None) -> tuple[float, float]:
    """Returns the change of the grasp for a goal that moves at a share of the duration."""
    model = holding()
    controller, path = model.controller(DT, model.conditions(0)), []
    goal = model.goals[0].copy()
    goal[:7] = moved(goal[:7])
    for tick in range(round(1.5 * DURATION / DT)):
        if at is not None and tick == round(at * DURATION / DT):
            controller.goal = goal
        controller.step()
        path.append(controller.position.copy())
    poses = np.array(path)
    return change(np.hstack(left_right(poses[:, :7], poses[:, 7:], reference=FACING)))


def grasp_of_peer(at: float | None, gains: tuple[float, ...] | None) -> tuple[float, float]:
    """Returns the same change for movement_primitives, with its coupling or without."""
    from movement_primitives.dmp import CouplingTermDualCartesianPose
    from pytransform3d.transformations import concat, invert_transform, transform_from_pq

    both = hands()[0]
    dmp = cartesian(both, N_WEIGHTS[1], dual=True)
    term = None
    if gains is not None:
        left, right = transform_from_pq(both[0, :7]), transform_from_pq(both[0, 7:])
        k, c1, c2 = gains
        term = CouplingTermDualCartesianPose(
            concat(right, invert_transform(left)), lf=(1.0, 1.0), k=k, c1=c1, c2=c2
        )
    end, _ = absolute_relative(both[-1, :7], both[-1, 7:], reference=FACING)
    goal = np.concatenate(left_right(moved(end), GRASP, reference=FACING))
    y, yd, path = both[0].copy(), np.zeros(12), [both[0]]
    for tick in range(round(1.5 * DURATION / DT)):
        if at is not None and tick == round(at * DURATION / DT):
            dmp.configure(goal_y=goal)
        y, yd = dmp.step(y, yd, coupling_term=term)
        path.append(y.copy())
    return change(np.array(path))


def pdmp_pose() -> Begin:
    """Steps with constant commands."""
    controller = fitted(synthetic(90), 3).controller(dt=DT)
    return after(controller.reset, controller.step, tick=controller.step)


def pdmp_joints() -> Begin:
    """Steps a primitive of six joints, the first coordinates of the poses."""
    demos = [pdmp.Demonstration(poses[:, :6], dt=DURATION / 250) for poses in synthetic(90)]
    controller = pdmp.fit(demos, n_styles=3, smoothing=None, threads=1).controller(dt=DT)
    return after(controller.reset, controller.step, tick=controller.step)


def pdmp_two_arms() -> Begin:
    """Steps, and converts to the poses of both hands."""
    controller = holding().controller(dt=DT)

    def tick() -> None:
        controller.step()
        pose = controller.position
        left_right(pose[:7], pose[7:], reference=FACING)

    return after(controller.reset, tick, tick=tick)


def movement_primitives_pose() -> Begin:
    """Steps with the compiled methods."""
    dmp = cartesian(synthetic(90)[0], N_WEIGHTS[1])
    return stepping(dmp, {})


def movement_primitives_two_arms(coupled: bool) -> Begin:
    """Steps both hands with the compiled method, with the coupling or without."""
    from movement_primitives.dmp import CouplingTermDualCartesianPose
    from pytransform3d.transformations import transform_from_pq

    dmp = cartesian(hands()[0], N_WEIGHTS[1], dual=True)
    term = CouplingTermDualCartesianPose(transform_from_pq(GRASP), lf=(1.0, 1.0))
    return stepping(dmp, {"coupling_term": term} if coupled else {})


def stepping(dmp: Any, arguments: dict[str, Any]) -> Begin:
    """Returns a preparation of steps of a primitive of movement_primitives."""
    state = [dmp.start_y, dmp.start_yd]

    def tick() -> None:
        state[:] = dmp.step(*state, **arguments)

    def reset() -> None:
        dmp.reset()
        state[:] = dmp.start_y, dmp.start_yd

    return after(reset, tick, tick=tick)


TASKS = [
    Task(
        "one step of a pose, at 1 kHz",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3": pdmp_pose,
            "pdmp, J=3, six joints": pdmp_joints,
            "movement_primitives": movement_primitives_pose,
        },
    ),
    Task(
        "one step of the poses of two arms, at 1 kHz",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3, absolute and relative pose": pdmp_two_arms,
            "movement_primitives": partial(movement_primitives_two_arms, False),
            "movement_primitives, coupled": partial(movement_primitives_two_arms, True),
        },
    ),
]
