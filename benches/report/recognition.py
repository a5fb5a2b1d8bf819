"""Recognises held-out movements on their way, beside simpler predictors.

``make report`` prints the tables; ``--write`` writes docs/recognition.md too. At most
``--most`` movements of each set and split are recognised, 20 by default.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

import pdmp
from pdmp import Demonstration
from pdmp._markdown import markdown_table
from recordings import ARM, HAND, is_available, recorded, rows
from report import partners, pauses
from report.observed import MAX_FOLDS, SHARES, Simple, sampled, shown
from report.sets import cut, numbers

ROOT = Path(__file__).resolve().parents[2]
BAND = 1.6449  # half-width of a band of 90 %, in standard deviations
RECOGNISER, KNOWN = "recogniser", "recogniser, true time"
NEAREST, MEAN = "nearest, true time", "mean"
GAUSSIAN, PROMP = "one Gaussian, true time", "ProMP, true time"
ROW_NAMES = (RECOGNISER, KNOWN, NEAREST, MEAN, GAUSSIAN, PROMP)


@dataclass(frozen=True, eq=False)
class Recordings:
    """Movements with the person or session of each."""

    name: str
    demos: list[Demonstration]
    groups: list[str] | None

    def folds(self, by_group: bool) -> list[list[int]]:
        """Returns the demonstrations to leave out together."""
        if by_group and self.groups is not None:
            names = sorted(set(self.groups))
            return [[m for m, group in enumerate(self.groups) if group == name] for name in names]
        n = min(MAX_FOLDS, len(self.demos))
        return [list(range(first, len(self.demos), n)) for first in range(n)]


def sets() -> Iterator[Recordings]:
    """Yields the available sets."""
    if is_available("raise_hand_bandai"):
        index = rows("raise_hand_bandai")
        demos = recorded("raise_hand_bandai", ARM)
        rises = cut(demos, numbers(index, "rise_start_s", "rise_end_s"))
        yield Recordings("raise_hand_bandai, rise", rises, [row["style"] for row in index])
    if is_available("arms_hdm05"):
        index = rows("arms_hdm05")
        demos = recorded("arms_hdm05", ARM)
        for motion in ("grabHighR", "depositFloorR"):
            own = [m for m, row in enumerate(index) if row["motion"] == motion]
            actors = [index[m]["actor"] for m in own]
            yield Recordings(f"arms_hdm05, {motion}", [demos[m] for m in own], actors)
    if is_available("walking_force_speed"):
        index = rows("walking_force_speed")
        own = range(0, len(index), -(-len(index) // 60))
        demos = recorded("walking_force_speed")
        subjects = [index[m]["subject"] for m in own]
        yield Recordings("walking_force_speed", [demos[m] for m in own], subjects)
    if is_available("door_adroit"):
        ends = numbers(rows("door_adroit"), "latch_turns_at_s")
        reaches = cut(recorded("door_adroit", HAND), np.hstack([0 * ends, ends]))
        arms = [Demonstration(demo.position[:, :6], time=demo.time) for demo in reaches]
        yield Recordings("door_adroit, reach of the arm", arms, None)
    if is_available("arm3_pushing"):
        yield Recordings("arm3_pushing", recorded("arm3_pushing"), None)


@dataclass
class Scores:
    """Errors of held-out movements, for each share seen."""

    errors: np.ndarray  # (N, shares, predictors)
    goals: np.ndarray  # (N, shares), root mean square over the degrees of freedom
    arrivals: np.ndarray  # (N, shares), of the logarithm of the duration
    covered: (
        np.ndarray
    )  # (N, shares, 3), shares of goals, arrivals and positions inside their bands
    pauses: np.ndarray  # (N, 8), of `report.pauses.one`


def evaluated(recordings: Recordings, by_group: bool, most: int) -> Scores:
    """Recognises held-out movements with models and priors of the others."""
    folds = recordings.folds(by_group)
    parts: list[list[np.ndarray]] = [[], [], [], [], []]
    rng = np.random.default_rng(1)
    for fold in folds:
        training = [m for m in range(len(recordings.demos)) if m not in fold]
        demos = [recordings.demos[m] for m in training]
        model = pdmp.fit(demos)
        groups = (
            [recordings.groups[m] for m in training] if by_group and recordings.groups else None
        )
        prior = model.prior(demos, groups=groups)
        simple = Simple(demos)
        step = max(1, -(-len(fold) * len(folds) // most))
        for m in fold[::step]:
            demo = recordings.demos[m]
            paused = pauses.one(model, prior, demo, rng)
            for part, values in zip(parts, (*one(model, prior, simple, demo), paused), strict=True):
                part.append(values)
    return Scores(*map(np.array, parts))


def one(
    model: pdmp.Model, prior: pdmp.Prior, simple: Simple, demo: Demonstration
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Recognises one movement."""
    time, position = sampled(demo)
    duration = demo.time[-1] - demo.time[0]
    unknown, known = model.recogniser(prior), model.recogniser(prior, duration=duration)
    errors, goals, arrivals, covered = [], [], [], []
    for n in shown([unknown, known], time, position, duration):
        rest = position[n:]
        ahead, estimate = unknown.continuation(time[n:]), unknown.estimate()
        predictions = [ahead.position, known.continuation(time[n:]).position]
        predictions += simple.predict(time, position[:n], duration)
        errors.append([np.sqrt(np.mean((each - rest) ** 2)) for each in predictions])
        error = np.abs(estimate.goal - demo.position[-1])
        late = np.log(estimate.duration / duration)
        goals.append(np.sqrt(np.mean(error**2)))
        arrivals.append(abs(late))
        covered.append(
            [
                np.mean(error < BAND * estimate.goal_deviation),
                abs(late) < BAND * estimate.duration_deviation,
                np.mean(np.abs(ahead.position - rest) < BAND * ahead.deviation),
            ]
        )
    return np.array(errors), np.array(goals), np.array(arrivals), np.array(covered, dtype=float)


def table(scores: Scores) -> str:
    """Returns the errors of the rest and the coverages."""
    means = scores.errors.mean(axis=0).T
    header = ["", *(f"{share:.0%} seen" for share in SHARES)]
    lines = [
        [name, *(f"{value:.3f}" for value in row)]
        for name, row in zip(ROW_NAMES, means, strict=True)
    ]
    better = np.minimum(means[2], means[3])
    best = np.where(means[2] < means[3], 2, 3)
    excess = [scores.errors[:, k, 0] - scores.errors[:, k, best[k]] for k in range(len(SHARES))]
    deviations = [np.mean(each) / (np.std(each, ddof=1) / len(each) ** 0.5) for each in excess]
    lines.append(
        ["recogniser / better of nearest and mean", *(f"{v:.2f}" for v in means[0] / better)]
    )
    lines.append(["excess, in standard errors", *(f"{value:+.1f}" for value in deviations)])
    lines.append(["error of the goal", *(f"{value:.3f}" for value in scores.goals.mean(axis=0))])
    lines.append(["error of log T", *(f"{value:.3f}" for value in scores.arrivals.mean(axis=0))])
    for k, name in enumerate(("goal", "arrival", "positions")):
        covered = scores.covered.mean(axis=0)[:, k]
        lines.append([f"coverage, {name}", *(f"{value:.0%}" for value in covered)])
    return markdown_table(header, lines, n_names=1)


INTRODUCTION = """\
# Recognition

Held-out movements are recognised on their way by models and priors of the others
([`Model.recogniser`](api/recognition.md)); `make report` prints these tables. The rows
give the root mean square error of the positions to come, in the unit of the recordings, after a
share of the movement was seen. The recogniser estimates the duration, too. Rows with "true time"
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
    updates, estimates = [], []
    for demo in demos:
        recogniser.reset()
        for time, position in zip(demo.time[:80], demo.position, strict=False):
            begin = perf_counter()
            recogniser.update(time, position)
            middle = perf_counter()
            recogniser.estimate()
            updates.append(middle - begin)
            estimates.append(perf_counter() - middle)
    sample, estimate = (1e6 * np.median(each) for each in (updates, estimates))
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
    sections = [INTRODUCTION, times()]
    print(sections[-1], flush=True)
    for recordings in sets():
        for by_group in (False, True):
            if by_group and recordings.groups is None:
                continue
            split = "a person left out" if by_group else "a tenth left out"
            scores = evaluated(recordings, by_group, options.most)
            title = f"## {recordings.name}: {split}, {len(scores.errors)} movements"
            section = f"{title}\n\n{table(scores)}\n\n{pauses.table(scores.pauses)}\n"
            print(section, flush=True)
            sections.append(section)
    sections.append(partners.section())
    if len(sections) == 3:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    if options.write:
        (ROOT / "docs" / "recognition.md").write_text("\n".join(sections), encoding="utf-8")


if __name__ == "__main__":
    main()
