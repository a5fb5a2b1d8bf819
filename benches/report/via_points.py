"""Completes held-out movements from a few of their points.

``make report`` prints the table; ``python -m report.via_points --write`` writes docs/via_points.md.
"""

import argparse
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import pdmp
from pdmp._markdown import markdown_table
from recordings import discrete
from report.promp import N_WEIGHTS, ProMP

DOCS = Path(__file__).resolve().parents[2] / "docs"
SAMPLES = 101
FOLDS = 4  # of a task, evenly spaced
MAX_DEMOS = 60
MIN_DEMOS = 5
PLACES = {
    "1 point": ((25,), (50,), (75,)),
    "2 points": ((30, 60),),
    "4 points": ((20, 40, 60, 80),),
}
LEFT_OUT = {"door_adroit", "walking_force_speed"}  # 28 joints; one variable without a fixed goal
TEXT = """\
# Movements completed from a few points

`make report` prints this table; `PYTHONPATH=benches .venv/bin/python -m report.via_points --write`
writes it here. Demonstrations are held out in turn, up to {folds} of each task. Of each, one, two
or four points are given, at equal fractions of the duration (25, 50 or 75 %; 30 and 60 %; 20, 40,
60 and 80 %). The error of the completed movement is the root mean square over normalised time,
relative to that of the mean of the other demonstrations, averaged over tasks.

- *PDMP*: `Model.through` with its defaults.
- *conditions, nearly alone*: with `deviation=0.001`, the conditions carry all that they can.
- *forcing alone*: all conditions are those of the mean.
- *ProMP*: a Gaussian over the weights of {weights} radial basis functions per degree of freedom, by
  ridge regression, conditioned on the points with a standard deviation of 1 % of the range; exact
  points make it worse.
- *DMP, goal moved*: the goal moves such that the mean movement comes closer to the last point, as
  that of a DMP of one demonstration can.

{table}

The residual has a standard deviation of 3 % of the range and a length scale of a fifth of the
movement. From 2 to 5 % and from a tenth to three tenths of the movement, the geometric mean of
these errors changes by at most 4 %.
"""

Array = np.ndarray
Complete = Callable[[pdmp.Model, list[Array], list[int], Array], Array]


def main() -> None:
    """Completes the movements of every available set."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--write", action="store_true", help="write docs/via_points.md")
    write = arguments.parse_args().write
    warnings.simplefilter("ignore", UserWarning)
    rows = [row for source, tasks in selected() for row in completed(source, tasks)]
    if not rows:
        raise SystemExit("no recordings: set PDMP_DATA to a folder with sets of them")
    table = markdown_table(["recordings", "tasks", "given", *METHODS], rows, n_names=3)
    text = TEXT.format(folds=FOLDS, weights=N_WEIGHTS, table=table)
    print(text)
    if write:
        (DOCS / "via_points.md").write_text(text, encoding="utf-8")


def selected() -> Iterator[tuple[str, dict[str, list[pdmp.Demonstration]]]]:
    """Yields the available sets with their tasks of enough demonstrations."""
    for source, tasks in discrete():
        if source not in LEFT_OUT:
            enough = {
                name: demos[:MAX_DEMOS] for name, demos in tasks.items() if len(demos) >= MIN_DEMOS
            }
            if enough:
                yield source, enough


def completed(source: str, tasks: dict[str, list[pdmp.Demonstration]]) -> list[list[str]]:
    """Returns the rows of a set."""
    errors = [held_out(demos) for demos in tasks.values()]
    rows = []
    for given in PLACES:
        means = [np.mean([task[given, method] for task in errors]) for method in METHODS]
        rows.append([source, str(len(tasks)), given, *(f"{mean:.3f}" for mean in means)])
        print(*rows[-1], flush=True)
    return rows


def held_out(demos: list[pdmp.Demonstration]) -> dict[tuple[str, str], float]:
    """Returns the error of each number of points and method, relative to that of the mean."""
    sampled = [resampled(demo) for demo in demos]
    sums: dict[tuple[str, str], float] = {}
    reference = 0.0
    for m in np.unique(np.linspace(0, len(demos) - 1, FOLDS).astype(int)):
        others = [movement for k, movement in enumerate(sampled) if k != m]
        model = pdmp.fit([demo for k, demo in enumerate(demos) if k != m])
        reference += rms(np.mean(others, axis=0) - sampled[m])
        for given, choices in PLACES.items():
            for method, complete in METHODS.items():
                found = [complete(model, others, list(at), sampled[m][list(at)]) for at in choices]
                error = np.mean([rms(movement - sampled[m]) for movement in found])
                sums[given, method] = sums.get((given, method), 0.0) + float(error)
    return {key: error / reference for key, error in sums.items()}


def through(model: pdmp.Model, at: list[int], points: Array, **options: object) -> Array:
    """Returns the movement of `Model.through` at the samples."""
    duration = 1.0
    conditions = {"tau": model.tau * duration / model.duration}
    via = [
        pdmp.ViaPoint(k * duration / (SAMPLES - 1), point)
        for k, point in zip(at, points, strict=True)
    ]
    passage = model.through(via, **(conditions | options))
    return model.rollout(passage.conditions, dt=duration / (SAMPLES - 1)).position


def moved_goal(model: pdmp.Model, others: list[Array], at: list[int], points: Array) -> Array:
    """Returns the mean movement with the goal moved towards the last point."""
    mean = model.conditions(range(len(others))).replace(segment_durations=None, tau=model.tau)
    share = model.jacobian("goal", mean, dt=model.duration / (SAMPLES - 1))[:SAMPLES, 0, 0]
    movement = np.mean(others, axis=0)
    change = (points[-1] - movement[at[-1]]) * share[at[-1]] / (share[at[-1]] ** 2 + 1e-2)
    return movement + share[:, None] * change


def conditioned(model: pdmp.Model, others: list[Array], at: list[int], points: Array) -> Array:
    """Returns the movement of a ProMP conditioned on the points."""
    phases = np.linspace(0, 1, SAMPLES)
    return ProMP(np.array(others)).conditioned(phases[at], points, phases)


METHODS: dict[str, Complete] = {
    "PDMP": lambda model, _, at, points: through(model, at, points),
    "conditions, nearly alone": lambda model, _, at, points: through(
        model, at, points, deviation=1e-3
    ),
    "forcing alone": lambda model, others, at, points: through(
        model,
        at,
        points,
        conditions=model.conditions(range(len(others))).replace(
            segment_durations=None, tau=model.tau / model.duration
        ),
    ),
    "ProMP": conditioned,
    "DMP, goal moved": moved_goal,
}


def resampled(demo: pdmp.Demonstration) -> Array:
    """Returns the positions at equal fractions of the duration."""
    time = np.linspace(demo.time[0], demo.time[-1], SAMPLES)
    return np.column_stack([np.interp(time, demo.time, column) for column in demo.position.T])


def rms(errors: Array) -> float:
    """Returns the root mean square of the norms."""
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


if __name__ == "__main__":
    main()
