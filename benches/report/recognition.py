"""Recognises held-out movements on their way, beside simpler predictors.

``make report`` prints the tables; ``--write`` writes docs/recognition.md too. At most
``--most`` movements of each set and split are recognised, 20 by default.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from recordings import ARM, HAND, is_available, recorded, rows
from report import observed, partners, pauses, poses, walks
from report.observed import BAND, SHARES, Simple, sampled, shown
from report.sets import cut, numbers

ROOT = Path(__file__).resolve().parents[2]
RECOGNISER, GIVEN = "recogniser", "recogniser, context"
NEAREST, MEAN = "nearest, true time", "mean"
ROW_NAMES = (
    RECOGNISER,
    GIVEN,
    "recogniser, true time",
    NEAREST,
    MEAN,
    "one Gaussian, true time",
    "ProMP, true time",
)
BANDS = ("goal", "arrival", "positions")


@dataclass(frozen=True, eq=False)
class Recordings:
    """Movements with the context, and the person or session, of each."""

    name: str
    demos: list[Demonstration]
    contexts: np.ndarray  # (M, Q)
    groups: list[str] | None


def sets() -> Iterator[Recordings]:
    """Yields the available sets."""
    if is_available("raise_hand_bandai"):
        index = rows("raise_hand_bandai")
        demos = recorded("raise_hand_bandai", ARM)
        rises = cut(demos, numbers(index, "rise_start_s", "rise_end_s"))
        heights = numbers(index, "hold_height_m")
        styles = [row["style"] for row in index]
        yield Recordings("raise_hand_bandai, rise", rises, heights, styles)
    if is_available("arms_hdm05"):
        index = rows("arms_hdm05")
        demos = recorded("arms_hdm05", ARM)
        columns = {"grabHighR": "peak_height_m", "depositFloorR": "low_height_m"}
        for motion, column in columns.items():
            own = [m for m, row in enumerate(index) if row["motion"] == motion]
            some = [index[m] for m in own]
            heights, actors = numbers(some, column), [row["actor"] for row in some]
            yield Recordings(f"arms_hdm05, {motion}", [demos[m] for m in own], heights, actors)
    if is_available("walking_force_speed"):
        index = rows("walking_force_speed")
        own = range(0, len(index), -(-len(index) // 60))
        demos = recorded("walking_force_speed")
        some = [index[m] for m in own]
        speeds, subjects = numbers(some, "speed_m_s"), [row["subject"] for row in some]
        yield Recordings("walking_force_speed", [demos[m] for m in own], speeds, subjects)
    if is_available("door_adroit"):
        index = rows("door_adroit")
        ends, places = (
            numbers(index, "latch_turns_at_s"),
            numbers(index, "door_x", "door_y", "door_z"),
        )
        reaches = cut(recorded("door_adroit", HAND), np.hstack([0 * ends, ends]))
        arms = [Demonstration(demo.position[:, :6], time=demo.time) for demo in reaches]
        yield Recordings("door_adroit, reach of the arm", arms, places, None)
    if is_available("arm3_pushing"):
        places = numbers(rows("arm3_pushing"), "object_x", "object_y", "target_x", "target_y")
        yield Recordings("arm3_pushing", recorded("arm3_pushing"), places, None)


@dataclass
class Scores:
    """Errors of held-out movements, for each share seen."""

    errors: np.ndarray  # (N, shares, predictors)
    goals: np.ndarray  # (N, shares), root mean square over the degrees of freedom
    arrivals: np.ndarray  # (N, shares), of the logarithm of the duration
    covered: np.ndarray  # (N, shares, without and with the context, BANDS), shares inside the bands
    pauses: np.ndarray  # (N, 8), of `report.pauses.one`

    @property
    def ratios(self) -> np.ndarray:
        """Mean errors without and with context over the better of two (2, shares)."""
        means = self.errors.mean(axis=0).T
        return means[:2] / means[self.simple].min(axis=0)

    @property
    def excess(self) -> np.ndarray:
        """Mean difference of these errors, in standard errors (2, shares)."""
        shares = np.arange(len(SHARES))
        better = np.array(self.simple)[self.errors.mean(axis=0).T[self.simple].argmin(axis=0)]
        differences = self.errors[:, :, :2] - self.errors[:, shares, better][:, :, None]
        deviations = differences.std(axis=0, ddof=1) / len(differences) ** 0.5
        return (differences.mean(axis=0) / deviations).T

    @property
    def simple(self) -> list[int]:
        """Places of the nearest demonstration and the mean among the predictors."""
        return [ROW_NAMES.index(NEAREST), ROW_NAMES.index(MEAN)]


def evaluated(recordings: Recordings, by_group: bool, most: int) -> Scores:
    """Recognises held-out movements with models and priors of the others."""
    folds = observed.folds(len(recordings.demos), recordings.groups if by_group else None)
    parts: list[list[np.ndarray]] = [[], [], [], [], []]
    rng = np.random.default_rng(1)
    for fold in folds:
        training = [m for m in range(len(recordings.demos)) if m not in fold]
        demos = [recordings.demos[m] for m in training]
        model = pdmp.fit(demos, contexts=recordings.contexts[training])
        groups = (
            [recordings.groups[m] for m in training] if by_group and recordings.groups else None
        )
        prior = model.prior(demos, groups=groups)
        simple = Simple(demos)
        step = max(1, -(-len(fold) * len(folds) // most))
        for m in fold[::step]:
            demo = recordings.demos[m]
            paused = pauses.one(model, prior, demo, rng)
            seen = one(model, prior, simple, demo, recordings.contexts[m])
            for part, values in zip(parts, (*seen, paused), strict=True):
                part.append(values)
    return Scores(*map(np.array, parts))


def one(
    model: pdmp.Model, prior: pdmp.Prior, simple: Simple, demo: Demonstration, context: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Recognises one movement."""
    time, position = sampled(demo)
    duration = demo.time[-1] - demo.time[0]
    unknown = [model.recogniser(prior), model.recogniser(prior, context=context)]
    known = model.recogniser(prior, duration=duration)
    errors, goals, arrivals, covered = [], [], [], []
    for n in shown([*unknown, known], time, position, duration):
        rest = position[n:]
        ahead = [each.continuation(time[n:]) for each in (*unknown, known)]
        predictions = [each.position for each in ahead]
        predictions += simple.predict(time, position[:n], duration)
        errors.append([np.sqrt(np.mean((each - rest) ** 2)) for each in predictions])
        inside = []
        for recogniser, coming in zip(unknown, ahead, strict=False):
            estimate = recogniser.estimate()
            error = np.abs(estimate.goal - demo.position[-1])
            late = abs(np.log(estimate.duration / duration))
            inside.append(
                [
                    np.mean(error < BAND * estimate.goal_deviation),
                    late < BAND * estimate.duration_deviation,
                    np.mean(np.abs(coming.position - rest) < BAND * coming.deviation),
                ]
            )
            if recogniser is unknown[0]:
                goals.append(np.sqrt(np.mean(error**2)))
                arrivals.append(late)
        covered.append(inside)
    return np.array(errors), np.array(goals), np.array(arrivals), np.array(covered, dtype=float)


def table(scores: Scores) -> str:
    """Returns the errors of the rest and the coverages."""
    means = scores.errors.mean(axis=0).T
    header = ["", *(f"{share:.0%} seen" for share in SHARES)]
    lines = [
        [name, *(f"{value:.3f}" for value in row)]
        for name, row in zip(ROW_NAMES, means, strict=True)
    ]
    covered = scores.covered.mean(axis=0)
    for k, name in enumerate((RECOGNISER, GIVEN)):
        ratios, excess = scores.ratios[k], scores.excess[k]
        lines.append([f"{name} / better of nearest and mean", *(f"{v:.2f}" for v in ratios)])
        lines.append(["excess, in standard errors", *(f"{v:+.1f}" for v in excess)])
        for j, band in enumerate(BANDS):
            lines.append([f"coverage, {band}", *(f"{value:.0%}" for value in covered[:, k, j])])
    lines.append(["error of the goal", *(f"{value:.3f}" for value in scores.goals.mean(axis=0))])
    lines.append(["error of log T", *(f"{value:.3f}" for value in scores.arrivals.mean(axis=0))])
    return markdown_table(header, lines, n_names=1)


def summary(of_splits: dict[str, list[Scores]]) -> str:
    """Returns what the tables say together, for each way of leaving out."""
    lines = []
    for split, scores in of_splits.items():
        for k, name in enumerate((RECOGNISER, GIVEN)):
            ratios = np.array([each.ratios[k] for each in scores])
            excess = np.array([each.excess[k] for each in scores])
            inside = np.concatenate([each.covered[:, :, k].mean(axis=1) for each in scores])
            lines.append(
                [
                    f"{split}: {name}",
                    f"{np.sum(excess <= 1)} of {excess.size}",
                    f"{np.sum(ratios.mean(axis=1) <= 0.7)} of {len(ratios)}",
                    *(f"{value:.0%}" for value in inside.mean(axis=0)),
                ]
            )
    header = ["", "no worse", "mean ratio ≤ 0.7", *(f"coverage, {band}" for band in BANDS)]
    return f"## All sets\n\n{SUMMARY}\n{markdown_table(header, lines, n_names=1)}\n"


SUMMARY = """\
No worse: cells of the tables, one for each share seen, in which the mean error is at most one
standard error above that of the better of nearest demonstration (which is given the true time) and
mean movement. Mean ratio: sets whose error is at most 0.7 of that one, on average over the shares.
Coverage is that of all movements and shares.
"""

INTRODUCTION = """\
# Recognition

Held-out movements are recognised on their way by models and priors of the others
([`Model.recogniser`](api/recognition.md)); `make report` prints these tables. The rows
give the root mean square error of the positions to come, in the unit of the recordings, after a
share of the movement was seen. The recogniser estimates the duration, too. Rows with "context" are
given the context of the held-out movement: the height that a hand reaches, the speed of a walk, the
place of a door, or those of an object and its target. Rows with "true time"
take the duration of the held-out movement itself, an advantage over the others. The nearest
demonstration is that with the smallest squared distance so far. The mean movement has the mean
duration. The ProMP is a Gaussian over the weights of 20 radial basis functions per degree of
freedom, by ridge regression, conditioned on every sample with a standard deviation of 1 % of the
range. Coverage is that of bands of 90 %. Left out are tenths of the demonstrations, or all of one
person, where the prior is learnt with `groups`.

The second table of each set is of the same movements with a pause of 0.3 to 1 s inserted after 30
to 60 %: a position is held, with noise of 0.2 % of the largest range. Its errors are those at the
end of the pause and a fifth of the duration later, beside those at the same places of the movement
without the pause. A movement counts as stopped where the probability of it exceeds 0.9.

[A how-to](howto/recognition.md) shows the calls: learn a prior, keep it in the file of the model,
and recognise a movement in Python, Rust, C or C++.
"""


def times() -> str:
    """Measures a sample and an estimate with 7 degrees of freedom, 6 styles and 64 hypotheses."""
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 101)[:, None]
    rise = s**3 * (10 - 15 * s + 6 * s**2)
    bumps = [np.sin((k + 1) * np.pi * s) ** 2 for k in range(6)]
    demos = []
    for _ in range(30):
        shapes = sum(0.1 * rng.standard_normal(7) * bump for bump in bumps)
        path = rise * rng.standard_normal(7) + shapes + 0.001 * rng.standard_normal((101, 7))
        demos.append(Demonstration(path, dt=0.01 * rng.uniform(0.8, 1.2)))
    model = pdmp.fit(demos, n_styles=6)
    recogniser = model.recogniser(model.prior(demos))
    sample, estimate = observed.times(recogniser, demos)
    return (
        f"## Time\n\n7 degrees of freedom, 6 styles, {recogniser.n_hypotheses} hypotheses, 30 "
        f"demonstrations: a sample takes {sample:.0f} µs and an estimate {estimate:.0f} µs "
        "(medians).\n"
    )


def main() -> None:
    """Evaluates every set that is available."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--write", action="store_true", help="write docs/recognition.md")
    arguments.add_argument("--most", type=int, default=20, help="movements of each set and split")
    options = arguments.parse_args()
    sections: list[str] = []
    of_splits: dict[str, list[Scores]] = {"tenths": [], "people": []}
    for recordings in sets():
        for by_group in (False, True):
            if by_group and recordings.groups is None:
                continue
            split = "a person left out" if by_group else "a tenth left out"
            scores = evaluated(recordings, by_group, options.most)
            of_splits["people" if by_group else "tenths"].append(scores)
            title = f"## {recordings.name}: {split}, {len(scores.errors)} movements"
            section = f"{title}\n\n{table(scores)}\n\n{pauses.table(scores.pauses)}\n"
            print(section, flush=True)
            sections.append(section)
    if not sections:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    sections = [INTRODUCTION, times(), summary(of_splits), *sections]
    sections += [walks.section(options.most), partners.section(), poses.section(options.most)]
    print("\n".join(sections[1:3]), flush=True)
    if options.write:
        (ROOT / "docs" / "recognition.md").write_text("\n".join(sections), encoding="utf-8")


if __name__ == "__main__":
    main()
