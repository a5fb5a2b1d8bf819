"""Recognises held-out poses on their way, beside simpler predictors.

``python -m report.poses`` prints the tables of docs/recognition.md.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from pdmp._native import from_tangent, mean_positions, to_tangent
from pdmp.datasets import folder
from pdmp.preprocessing import matrices_to_quaternions, rotation_vectors_to_quaternions
from recordings import ARM, is_available, recorded, rows
from report import observed
from report.observed import BAND, PHASES, SHARES, Simple, at, resampled, sampled, shown
from report.sets import numbers

ROTATIONS = {3: "wxyz"}
UNITS = ["m", "m", "m", "", "", "", ""]
PARTS = (slice(0, 3), slice(3, 6))
NEAREST, MEAN = "nearest, true time", "mean"
NAMES = (
    "recogniser",
    "recogniser, true time",
    "rotation vectors as positions",
    NEAREST,
    MEAN,
    "one Gaussian, true time",
    "ProMP, true time",
)


@dataclass(frozen=True, eq=False)
class Poses:
    """Movements of a pose x, y, z, qw, qx, qy, qz, with the group of each."""

    name: str
    demos: list[Demonstration]
    groups: list[str] | None


def sets() -> Iterator[Poses]:
    """Yields the available sets."""
    if is_available("raise_hand_bandai"):
        index = rows("raise_hand_bandai")
        styles = [row["style"] for row in index]
        yield Poses("raise_hand_bandai, rise of the forearm", list(forearms()), styles)
    if is_available("franka_tasks"):
        index = rows("franka_tasks")
        tools = recorded("franka_tasks", ["x", "y", "z", "qa", "qb", "qc", "qd"])
        for task in ("pouring", "openbox"):
            own = [
                Demonstration(tool.position, time=tool.time, rotations=ROTATIONS, units=UNITS)
                for tool, row in zip(tools, index, strict=True)
                if row["id"].startswith(task)
            ]
            yield Poses(f"franka_tasks, {task}", own, None)


def forearms() -> Iterator[Demonstration]:
    """Yields poses of the right forearm in the chest frame while the hand rises.

    The position is that of the hand, the orientation follows from the angles of the arm.
    """
    source = "raise_hand_bandai"
    arm = json.loads((folder(source) / "arm.json").read_text(encoding="utf-8"))
    base, zero = np.array(arm["shoulder_base_rows"]), np.array(arm["shoulder_zero"])
    bounds = numbers(rows(source), "rise_start_s", "rise_end_s")
    hand = ["r_hand_x", "r_hand_y", "r_hand_z"]
    mirror = np.diag([-1.0, 1.0, 1.0])  # the arm model is that of the left arm
    for demo, (begin, end) in zip(recorded(source, [*ARM, *hand]), bounds, strict=True):
        inside = (demo.time >= begin - 1e-3) & (demo.time <= end + 1e-3)
        angles, place = np.split(demo.position[inside], [4], axis=1)
        first, second, third = (angles[:, :3] + zero).T
        turns = about(0, first) @ about(2, second) @ about(1, third) @ about(0, -angles[:, 3])
        quaternions = matrices_to_quaternions(mirror @ base @ turns @ mirror, order="wxyz")
        pose = np.hstack([place, quaternions])
        yield Demonstration(pose, time=demo.time[inside], rotations=ROTATIONS, units=UNITS)


def about(axis: int, angles: np.ndarray) -> np.ndarray:
    """Returns matrices (T, 3, 3) of turns about a coordinate axis."""
    matrices = np.zeros((len(angles), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrices[:, axis, axis] = 1
    matrices[:, i, i] = matrices[:, j, j] = np.cos(angles)
    matrices[:, i, j], matrices[:, j, i] = -np.sin(angles), np.sin(angles)
    return matrices


class SimplePoses:
    """Predictors without a model of movements, in rotation vectors about the mean path."""

    def __init__(self, demos: list[Demonstration]) -> None:
        paths = [unit(resampled(demo.time, demo.position)) for demo in demos]
        self.path = mean_positions(paths, ROTATIONS)
        dofs = np.array([to_tangent(self.path, path, ROTATIONS) for path in paths])
        deviations = (dofs - dofs.mean(axis=0)).std(axis=(0, 1))
        length = np.linalg.norm(deviations[:3]) / np.linalg.norm(deviations[3:])
        self.scale = np.array([1.0, 1.0, 1.0, length, length, length])
        times = [(demo.time[-1] - demo.time[0]) * PHASES for demo in demos]
        self.simple = Simple(
            [Demonstration(own * self.scale, time=t) for own, t in zip(dofs, times, strict=True)]
        )

    def predict(self, time: np.ndarray, seen: np.ndarray, duration: float) -> list[np.ndarray]:
        """Returns the rest of a movement (T - n, 7) by each predictor."""
        n = len(seen)
        path = self.at(time / duration)
        dofs = to_tangent(path[:n], seen, ROTATIONS) * self.scale
        nearest, _, *others = self.simple.predict(time, dofs, duration)
        mean = self.at(time[n:] / self.simple.duration)
        first, *rest = (
            from_tangent(path[n:], own / self.scale, ROTATIONS) for own in (nearest, *others)
        )
        return [first, mean, *rest]

    def at(self, phases: np.ndarray) -> np.ndarray:
        """Returns the mean path at phases."""
        return unit(at(self.path, phases))


class RotationVectors:
    """Recogniser of positions: rotations are rotation vectors from the mean at the start."""

    def __init__(self, demos: list[Demonstration], groups: list[str] | None) -> None:
        self.centre = mean_positions([demo.position[[0]] for demo in demos], ROTATIONS)
        converted = [Demonstration(self.vectors(demo.position), time=demo.time) for demo in demos]
        model = pdmp.fit(converted)
        self.recogniser = model.recogniser(model.prior(converted, groups=groups))

    def vectors(self, position: np.ndarray) -> np.ndarray:
        """Returns positions and rotation vectors (T, 6)."""
        return to_tangent(np.repeat(self.centre, len(position), axis=0), position, ROTATIONS)

    def positions(self, vectors: np.ndarray) -> np.ndarray:
        """Returns poses (T, 7)."""
        return from_tangent(np.repeat(self.centre, len(vectors), axis=0), vectors, ROTATIONS)


def unit(position: np.ndarray) -> np.ndarray:
    """Returns poses whose quaternions have norm 1."""
    return np.hstack(
        [position[:, :3], position[:, 3:] / np.linalg.norm(position[:, 3:], axis=1)[:, None]]
    )


def errors(predicted: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Returns the root mean square errors of positions in m and of rotations in rad."""
    off = to_tangent(predicted, position, ROTATIONS)
    away = predicted[:, :3] - position[:, :3]
    return np.array([np.sqrt(np.mean(away**2)), np.sqrt((off[:, 3:] ** 2).sum(axis=1).mean())])


@dataclass
class Scores:
    """Errors of held-out movements, of positions in m and of rotations in rad."""

    errors: np.ndarray  # (N, shares, predictors, 2)
    goals: np.ndarray  # (N, shares, 2)
    arrivals: np.ndarray  # (N, shares), of the logarithm of the duration
    covered: np.ndarray  # (N, shares, 3), shares of goals, arrivals and poses inside their bands


def evaluated(poses: Poses, by_group: bool, most: int) -> Scores:
    """Recognises held-out movements with models and priors of the others."""
    found = []
    folds = observed.folds(len(poses.demos), poses.groups if by_group else None)
    for fold in folds:
        training = [m for m in range(len(poses.demos)) if m not in fold]
        demos = [poses.demos[m] for m in training]
        groups = [poses.groups[m] for m in training] if by_group and poses.groups else None
        model = pdmp.fit(demos)
        predictors = Predictors(
            model,
            model.prior(demos, groups=groups),
            SimplePoses(demos),
            RotationVectors(demos, groups),
        )
        step = max(1, -(-len(fold) * len(folds) // most))
        found += [one(predictors, poses.demos[m]) for m in fold[::step]]
    return Scores(*(np.array(part) for part in zip(*found, strict=True)))


@dataclass(frozen=True, eq=False)
class Predictors:
    """Predictors of one fold."""

    model: pdmp.Model
    prior: pdmp.Prior
    simple: SimplePoses
    vectors: RotationVectors


def one(
    predictors: Predictors, demo: Demonstration
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Recognises one movement."""
    time, position = sampled(demo)
    duration = demo.time[-1] - demo.time[0]
    model, prior, vectors = predictors.model, predictors.prior, predictors.vectors
    unknown, known = model.recogniser(prior), model.recogniser(prior, duration=duration)
    vectors.recogniser.reset()
    steps = shown([unknown, known], time, position, duration)
    others = shown([vectors.recogniser], time, vectors.vectors(position), duration)
    errors, goals, arrivals, covered = [], [], [], []
    for n, _ in zip(steps, others, strict=True):
        ahead, estimate = unknown.continuation(time[n:]), unknown.estimate()
        predictions = [ahead.position, known.continuation(time[n:]).position]
        predictions.append(vectors.positions(vectors.recogniser.continuation(time[n:]).position))
        predictions += predictors.simple.predict(time, position[:n], duration)
        rests = [off(each, position[n:]) for each in predictions]
        errors.append([sizes(rest) for rest in rests])
        goal = off(estimate.goal[None], demo.position[[-1]])
        late = np.log(estimate.duration / duration)
        goals.append(sizes(goal))
        arrivals.append(abs(late))
        covered.append(
            [
                np.mean(np.abs(goal) < BAND * estimate.goal_deviation),
                abs(late) <= BAND * estimate.duration_deviation,
                np.mean(np.abs(rests[0]) < BAND * ahead.deviation),
            ]
        )
    return np.array(errors), np.array(goals), np.array(arrivals), np.array(covered, dtype=float)


def off(predicted: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Returns errors (T, 6): of positions in m, and rotation vectors in rad."""
    errors = to_tangent(predicted, position, ROTATIONS)
    errors[:, :3] -= predicted[:, :3]
    return errors


def sizes(errors: np.ndarray) -> list[float]:
    """Returns the root mean squares of the distances in m and of the angles in rad."""
    return [float(np.sqrt((errors[:, part] ** 2).sum(axis=1).mean())) for part in PARTS]


def table(scores: Scores) -> str:
    """Returns the errors of the rest and the coverages."""
    means = scores.errors.mean(axis=0)  # (shares, predictors, 2)
    header = ["m, rad", *(f"{share:.0%} seen" for share in SHARES)]
    lines = [[name, *map(pair, means[:, k])] for k, name in enumerate(NAMES)]
    nearest, mean = NAMES.index(NEAREST), NAMES.index(MEAN)
    ratios = means[:, 0] / np.minimum(means[:, nearest], means[:, mean])
    lines.append(
        ["recogniser / better of nearest and mean", *(f"{a:.2f}, {b:.2f}" for a, b in ratios)]
    )
    lines.append(["error of the goal", *map(pair, scores.goals.mean(axis=0))])
    lines.append(["error of log T", *(f"{value:.3f}" for value in scores.arrivals.mean(axis=0))])
    for k, name in enumerate(("goal", "arrival", "poses")):
        covered = scores.covered.mean(axis=0)[:, k]
        lines.append([f"coverage, {name}", *(f"{value:.0%}" for value in covered)])
    return markdown_table(header, lines, n_names=1)


def pair(errors: np.ndarray) -> str:
    """Returns an error in m and one in rad."""
    return f"{errors[0]:.4f}, {errors[1]:.3f}"


def times() -> str:
    """Measures a sample and an estimate of a pose with 6 styles and 64 hypotheses."""
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 101)[:, None]
    rise = s**3 * (10 - 15 * s + 6 * s**2)
    demos = []
    for _ in range(30):
        bumps = sum(
            0.1 * rng.standard_normal(6) * np.sin((k + 1) * np.pi * s) ** 2 for k in range(6)
        )
        place, turn = np.split(rise * rng.uniform(0.2, 0.8, 6) + bumps, 2, axis=1)
        pose = np.hstack([place, rotation_vectors_to_quaternions(turn, order="wxyz")])
        dt = 0.01 * rng.uniform(0.8, 1.2)
        demos.append(Demonstration(pose, dt=dt, rotations=ROTATIONS, units=UNITS))
    model = pdmp.fit(demos, n_styles=6)
    recogniser = model.recogniser(model.prior(demos))
    sample, estimate = observed.times(recogniser, demos)
    return (
        f"A sample of a pose with 6 styles and {recogniser.n_hypotheses} hypotheses takes "
        f"{sample:.0f} µs, an estimate {estimate:.0f} µs (medians).\n"
    )


def section(most: int) -> str:
    """Returns the tables of all available sets."""
    parts = [INTRODUCTION, times()]
    print(*parts, sep="\n", flush=True)
    for poses in sets():
        for by_group in (False, True):
            if by_group and poses.groups is None:
                continue
            split = "a person left out" if by_group else "a tenth left out"
            scores = evaluated(poses, by_group, most)
            title = f"### {poses.name}: {split}, {len(scores.errors)} movements"
            parts.append(f"{title}\n\n{table(scores)}\n")
            print(parts[-1], flush=True)
    return "\n".join(parts)


INTRODUCTION = """\
## Poses

Rows give the root mean square distance of the positions to come in m, and the root mean square
angle of the rotations to come in rad. "Rotation vectors as positions" is a recogniser of a model
without rotations, of the rotation vector from the mean orientation at the start. The other
predictors compare and predict rotation vectors about the mean path of the demonstrations, which
weigh as the deviations of the positions. The forearm is that of the set above, computed from the
angles of the arm. The movements of franka_tasks have one duration, in units of it: there the true
time is no advantage.
"""


if __name__ == "__main__":
    section(20)
